//! The sun's light after its way through the air: Preetham, Shirley, Smits, *A Practical Analytic Model for Daylight*,
//! SIGGRAPH 1999, appendix A.1. Water vapour and oxygen, which absorb at the red end alone, are left out.

use glam::DVec3;

/// Wavelength of the first entry of the tables, and from each entry to the next, nanometres.
const FIRST_NM: f64 = 380.0;
const STEP_NM: f64 = 10.0;
/// Radiance of the sun outside the atmosphere, watt per square centimetre, steradian and micrometre: table 2 of the
/// paper.
const RADIANCE: [f64; 38] = [
    1655.9, 1623.37, 2112.75, 2588.82, 2582.91, 2423.23, 2676.05, 2965.83, 3054.54, 3005.75, 3066.37, 2883.04, 2871.21,
    2782.5, 2710.06, 2723.36, 2636.13, 2550.38, 2506.02, 2531.16, 2535.59, 2513.42, 2463.15, 2417.32, 2368.53, 2321.21,
    2282.77, 2233.98, 2197.02, 2152.67, 2109.79, 2072.83, 2024.04, 1987.08, 1942.72, 1907.24, 1862.89, 1825.92,
];
/// Absorption of ozone, per centimetre: table 2 of the paper.
const OZONE: [f64; 38] = [
    0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.003, 0.003, 0.006, 0.009, 0.014, 0.021, 0.03, 0.04, 0.048, 0.063, 0.075, 0.085,
    0.103, 0.12, 0.12, 0.115, 0.125, 0.12, 0.105, 0.09, 0.079, 0.067, 0.057, 0.048, 0.036, 0.028, 0.023, 0.018, 0.014,
    0.011, 0.01, 0.009,
];
/// Thickness of the ozone at the pressure of the ground, centimetres.
const OZONE_CM: f64 = 0.35;
/// Luminous efficacy of the wavelength to which eyes are most sensitive, lumen per watt.
const EFFICACY: f64 = 683.0;

/// Returns X, Y and Z of the sun's disk, of which Y is the luminance, kilocandela per square metre. `zenith_angle`: of
/// the sun, radians.
pub(super) fn luminance(turbidity: f64, zenith_angle: f64) -> DVec3 {
    let mass = air_mass(zenith_angle);
    through(|nm, ozone| transmittance(turbidity, mass, nm, ozone))
}

/// Returns X, Y and Z of the disk of a sun that is seen through air of this transmittance, a function of the wavelength
/// and of the ozone's absorption.
pub(super) fn through(transmittance: impl Fn(f64, f64) -> f64) -> DVec3 {
    let of_wavelength = |(ix, (radiance, ozone)): (usize, (f64, f64))| {
        let nm = FIRST_NM + STEP_NM * ix as f64;
        matching(nm) * (radiance * transmittance(nm, ozone))
    };
    let sum: DVec3 = RADIANCE.into_iter().zip(OZONE).enumerate().map(of_wavelength).sum();
    // A watt per square centimetre and micrometre is 10 watt per square metre and nanometre.
    sum * (10.0 * STEP_NM * EFFICACY / 1000.0)
}

/// Returns how many times as much air as below the zenith light passes (Kasten 1966).
fn air_mass(zenith_angle: f64) -> f64 {
    1.0 / (zenith_angle.cos() + 0.15 * (93.885 - zenith_angle.to_degrees()).powf(-1.253))
}

/// Returns the share of light that molecules, haze and ozone let pass.
pub(super) fn transmittance(turbidity: f64, air_mass: f64, nm: f64, ozone: f64) -> f64 {
    let micrometres = nm / 1000.0;
    let molecules = 0.008735 * micrometres.powf(-4.08);
    let haze = (0.04608 * turbidity - 0.04586) * micrometres.powf(-1.3);
    (-(molecules + haze + ozone * OZONE_CM) * air_mass).exp()
}

/// Returns the colour matching functions of the CIE for 2 degrees: Wyman, Sloan, Shirley, *Simple Analytic
/// Approximations to the CIE XYZ Color Matching Functions*, JCGT 2013.
fn matching(nm: f64) -> DVec3 {
    let lobe = |height: f64, middle: f64, [below, above]: [f64; 2]| {
        let deviations = (nm - middle) / if nm < middle { below } else { above };
        height * (-0.5 * deviations * deviations).exp()
    };
    DVec3::new(
        lobe(1.056, 599.8, [37.9, 31.0]) + lobe(0.362, 442.0, [16.0, 26.7]) + lobe(-0.065, 501.1, [20.4, 26.2]),
        lobe(0.821, 568.8, [46.9, 40.5]) + lobe(0.286, 530.9, [16.3, 31.1]),
        lobe(1.217, 437.0, [11.8, 36.0]) + lobe(0.681, 459.0, [26.0, 13.8]),
    )
}
