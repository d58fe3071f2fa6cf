//! The distribution of luminance and colour over a clear sky: Preetham, Shirley, Smits, *A Practical Analytic Model for
//! Daylight*, SIGGRAPH 1999, appendix A.2. All functions are fits, linear or quadratic in the turbidity T.

use std::f64::consts::PI;

use glam::{DVec3, DVec4};

/// The parameters A to E of the function of Perez et al. as factor on T and constant, for x, y and Y in turn.
const A: [DVec3; 2] = [DVec3::new(-0.0193, -0.0167, 0.1787), DVec3::new(-0.2592, -0.2608, -1.4630)];
const B: [DVec3; 2] = [DVec3::new(-0.0665, -0.0950, -0.3554), DVec3::new(0.0008, 0.0092, 0.4275)];
const C: [DVec3; 2] = [DVec3::new(-0.0004, -0.0079, -0.0227), DVec3::new(0.2125, 0.2102, 5.3251)];
const D: [DVec3; 2] = [DVec3::new(-0.0641, -0.0441, 0.1206), DVec3::new(-0.8989, -1.6537, -2.5771)];
const E: [DVec3; 2] = [DVec3::new(-0.0033, -0.0109, -0.0670), DVec3::new(0.0452, 0.0529, 0.3703)];
/// Chromaticities of the zenith: the factors on T^2, T and 1 of polynomials in the sun's angle from the zenith, whose
/// coefficients begin with that of the third power.
const ZENITH_X: [DVec4; 3] = [
    DVec4::new(0.00166, -0.00375, 0.00209, 0.0),
    DVec4::new(-0.02903, 0.06377, -0.03202, 0.00394),
    DVec4::new(0.11693, -0.21196, 0.06052, 0.25886),
];
const ZENITH_Y: [DVec4; 3] = [
    DVec4::new(0.00275, -0.00610, 0.00317, 0.0),
    DVec4::new(-0.04214, 0.08970, -0.04153, 0.00516),
    DVec4::new(0.15346, -0.26756, 0.06670, 0.26688),
];

/// A sky of one turbidity and one place of the sun.
pub(super) struct Distribution {
    /// The parameters A to E for x, y and Y.
    parameters: [DVec3; 5],
    /// x, y and Y of the zenith, divided by the function of Perez et al. there.
    scale: DVec3,
}

impl Distribution {
    /// Makes the distribution of a turbidity for a sun at this angle from the zenith, radians.
    pub fn new(turbidity: f64, sun_angle: f64) -> Self {
        let parameters = [A, B, C, D, E].map(|[slope, constant]| slope * turbidity + constant);
        let zenith = zenith(turbidity, sun_angle);
        Self { parameters, scale: zenith / perez(&parameters, 1.0, sun_angle) }
    }

    /// Returns the chromaticities x and y, and the luminance Y in kilocandela per square metre, of a direction.
    /// `cosine`: of its angle from the zenith. `sun_angle`: between it and the sun, radians.
    pub fn at(&self, cosine: f64, sun_angle: f64) -> DVec3 {
        self.scale * perez(&self.parameters, cosine, sun_angle)
    }
}

/// Returns the chromaticities x and y and the luminance Y of the zenith, kilocandela per square metre.
pub(super) fn zenith(turbidity: f64, sun_angle: f64) -> DVec3 {
    let powers_of_angle = DVec4::new(sun_angle.powi(3), sun_angle.powi(2), sun_angle, 1.0);
    let powers_of_turbidity = DVec3::new(turbidity.powi(2), turbidity, 1.0);
    let chromaticity =
        |fit: [DVec4; 3]| DVec3::from_array(fit.map(|row| row.dot(powers_of_angle))).dot(powers_of_turbidity);
    let chi = (4.0 / 9.0 - turbidity / 120.0) * (PI - 2.0 * sun_angle);
    let luminance = (4.0453 * turbidity - 4.9710) * chi.tan() - 0.2155 * turbidity + 2.4192;
    DVec3::new(chromaticity(ZENITH_X), chromaticity(ZENITH_Y), luminance)
}

/// Returns the function of Perez, Seals, Michalsky (*All-weather model for sky luminance distribution*, 1993) for x, y
/// and Y.
fn perez([a, b, c, d, e]: &[DVec3; 5], cosine: f64, sun_angle: f64) -> DVec3 {
    // At the horizon, the exponent is minus infinity, and its exponential 0.
    let gradient = DVec3::ONE + *a * (*b / cosine).exp();
    let around_sun = DVec3::ONE + *c * (*d * sun_angle).exp() + *e * sun_angle.cos().powi(2);
    gradient * around_sun
}
