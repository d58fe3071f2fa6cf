//! Tone curves: from exposed radiance to a display's 0..1, both linear. Twin of `picture/tone_curves.glsl`, which names
//! the sources.

use glam::{Mat3, Vec3};

use crate::layout::{TONEMAP_ACES, TONEMAP_AGX, TONEMAP_NEUTRAL};

/// Exposed radiance is clamped to this, since infinities would become NaN. Every curve shows white above it.
const BRIGHTEST: f32 = 65504.0;

/// The matrix with these rows.
const fn rows(r: [f32; 3], g: [f32; 3], b: [f32; 3]) -> Mat3 {
    Mat3::from_cols_array_2d(&[[r[0], g[0], b[0]], [r[1], g[1], b[1]], [r[2], g[2], b[2]]])
}

fn aces(exposed: Vec3) -> Vec3 {
    const TO_AP1: Mat3 = rows([0.59719, 0.35458, 0.04823], [0.076, 0.90834, 0.01566], [0.0284, 0.13383, 0.83777]);
    const FROM_AP1: Mat3 =
        rows([1.60475, -0.53108, -0.07367], [-0.10208, 1.10813, -0.00605], [-0.00327, -0.07276, 1.07602]);
    let v = TO_AP1 * exposed;
    let numerator = v * (v + 0.0245786) - 0.000090537;
    let denominator = v * (0.983729 * v + 0.432951) + 0.238081;
    FROM_AP1 * (numerator / denominator)
}

fn agx(exposed: Vec3) -> Vec3 {
    const INSET: Mat3 = rows(
        [0.842_479_05, 0.078_433_6, 0.079_223_745],
        [0.042_328_243, 0.878_468_64, 0.079_166_12],
        [0.042_375_654, 0.078_433_6, 0.879_143],
    );
    const OUTSET: Mat3 = rows(
        [1.196_879, -0.098_020_88, -0.099_029_74],
        [-0.052_896_85, 1.151_903_2, -0.098_961_174],
        [-0.052_971_635, -0.098_043_45, 1.151_073_7],
    );
    const LEAST_EV: f32 = -12.47393;
    const MOST_EV: f32 = 4.026069;
    let ev = (INSET * exposed).map(|x| x.max(1e-10).log2().clamp(LEAST_EV, MOST_EV));
    let x = (ev - LEAST_EV) / (MOST_EV - LEAST_EV);
    let curve = (((((15.5 * x - 40.14) * x + 31.96) * x - 6.868) * x + 0.4298) * x + 0.1191) * x - 0.00232;
    (OUTSET * curve).map(|x| x.max(0.0).powf(2.2))
}

fn neutral(exposed: Vec3) -> Vec3 {
    const FIRST_COMPRESSED: f32 = 0.8 - 0.04;
    const ROOM_ABOVE: f32 = 1.0 - FIRST_COMPRESSED;
    const FADING: f32 = 0.15;
    let least = exposed.min_element();
    let exposed = exposed - if least < 0.08 { least - 6.25 * least * least } else { 0.04 };
    let peak = exposed.max_element();
    if peak < FIRST_COMPRESSED {
        return exposed;
    }
    let shown_peak = 1.0 - ROOM_ABOVE * ROOM_ABOVE / (peak + ROOM_ABOVE - FIRST_COMPRESSED);
    let kept = (FADING * (peak - shown_peak) + 1.0).recip();
    Vec3::splat(shown_peak).lerp(exposed * (shown_peak / peak), kept)
}

/// Applies the exposure and a curve, one of `TONEMAP_*`. Returns linear display values, 0..1; black for NaN.
#[expect(clippy::manual_clamp, reason = "`clamp` keeps NaN")]
pub fn tone_mapped(curve: u32, radiance: Vec3, exposure: f32) -> Vec3 {
    let exposed = (radiance * exposure).map(|x| x.max(0.0).min(BRIGHTEST));
    let shown = match curve {
        TONEMAP_AGX => agx(exposed),
        TONEMAP_ACES => aces(exposed),
        TONEMAP_NEUTRAL => neutral(exposed),
        _ => exposed,
    };
    shown.map(|x| x.max(0.0).min(1.0))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::layout::TONEMAP_LINEAR;

    fn grey(curve: u32, value: f32) -> Vec3 {
        tone_mapped(curve, Vec3::splat(value), 1.0)
    }

    #[test]
    fn greys_stay_grey_and_rise_from_black_to_white() {
        for curve in [TONEMAP_LINEAR, TONEMAP_AGX, TONEMAP_ACES, TONEMAP_NEUTRAL] {
            assert!(grey(curve, 0.0).max_element() < 1e-5);
            assert!(grey(curve, f32::INFINITY).min_element() > 0.99);
            let mut before = -1.0;
            for i in -20..=20 {
                let shown = grey(curve, 1.25_f32.powi(i));
                assert!(shown.max_element() - shown.min_element() < 1e-3, "{curve}: {shown}");
                assert!(shown.x > before || shown.x > 0.99, "{curve}: {shown}");
                before = shown.x;
            }
        }
    }

    /// Worked out by hand. ACES: (0.18 * 0.2045786 - 0.000090537) / (0.18 * 0.6100222 + 0.238081). AgX: (log2 0.18 +
    /// 12.47393) / 16.5 is 0.606061, the polynomial there 0.49673, and that to the power of 2.2.
    #[test]
    fn middle_grey_is_shown_as_published() {
        assert_eq!(grey(TONEMAP_LINEAR, 0.18), Vec3::splat(0.18));
        assert!((grey(TONEMAP_ACES, 0.18) - 0.10559).abs().max_element() < 2e-5, "{}", grey(TONEMAP_ACES, 0.18));
        assert!((grey(TONEMAP_AGX, 0.18) - 0.21452).abs().max_element() < 2e-4, "{}", grey(TONEMAP_AGX, 0.18));
    }

    /// A dielectric of albedo a in full light has the radiance a + 0.04, which the curve takes off again. At 0.8, where
    /// the compression begins, the curve and its slope are continuous; by hand, 1.76 becomes 1 - 0.24^2 / 1.2.
    #[test]
    fn the_neutral_curve_keeps_base_colours() {
        let base = Vec3::new(0.7, 0.3, 0.1);
        assert!(tone_mapped(TONEMAP_NEUTRAL, base + 0.04, 1.0).abs_diff_eq(base, 1e-6));
        let [below, at, above] = [0.799, 0.8, 0.801].map(|value| grey(TONEMAP_NEUTRAL, value).x);
        assert!((at - 0.76).abs() < 1e-6 && (above - at - (at - below)).abs() < 1e-5, "{below} {at} {above}");
        assert!((grey(TONEMAP_NEUTRAL, 1.76).x - 0.952).abs() < 1e-5);
    }

    /// As the exposure rises, the linear curve clips one channel after the other. The other curves fade the colour
    /// towards white.
    #[test]
    fn bright_colours_fade() {
        let orange = Vec3::new(20.0, 8.0, 1.0);
        assert_eq!(tone_mapped(TONEMAP_LINEAR, orange, 1.0), Vec3::ONE);
        for curve in [TONEMAP_AGX, TONEMAP_ACES, TONEMAP_NEUTRAL] {
            let [dim, bright] = [0.02, 5.0].map(|exposure| tone_mapped(curve, orange, exposure));
            assert!(dim.z / dim.x < 0.3 && bright.z / bright.x > 0.8, "{curve}: {dim} {bright}");
        }
    }

    #[test]
    fn the_exposure_is_a_factor() {
        let colour = Vec3::new(0.4, 0.2, 0.1);
        for curve in [TONEMAP_LINEAR, TONEMAP_AGX, TONEMAP_ACES, TONEMAP_NEUTRAL] {
            assert_eq!(tone_mapped(curve, colour, 2.0), tone_mapped(curve, colour * 2.0, 1.0));
        }
    }
}
