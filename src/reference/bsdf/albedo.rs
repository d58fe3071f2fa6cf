//! Directional albedos: the share of the light from one direction that a lobe reflects. Twin of `bsdf/albedo.glsl`.

use glam::Vec4;

/// The albedo of reflection by GGX at one cosine. A Fresnel term F0 + (F90 - F0) (1 - V.H)^5 reflects
/// F0 (1 - loss - grazing) + F90 grazing.
#[derive(Clone, Copy, Debug)]
pub struct GgxAlbedo {
    /// The share of light that is not reflected although the Fresnel term is 1, because it meets further microfacets.
    pub loss: f32,
    /// The share that is reflected if the Fresnel term is Schlick's weight (1 - V.H)^5.
    pub grazing: f32,
}

/// Powers 1 to 4.
fn powers_of(x: f32) -> Vec4 {
    let squared = x * x;
    Vec4::new(x, squared, squared * x, squared * squared)
}

/// The variable of the polynomials, -1 to 1, for one of 0 to 1. Coefficients are then small, and round little.
fn centred(x: f32) -> f32 {
    2.0 * x - 1.0
}

fn loss_polynomial(z: f32, powers: Vec4, fifth: f32) -> f32 {
    let y = 0.05061298 + Vec4::new(-0.48358548, 0.15916474, 1.2829756, 1.0614296).dot(powers) + 0.20548154 * fifth;
    let y =
        y * z + -0.13874173 + Vec4::new(-0.6994655, 0.15456805, 2.2882538, 2.5646296).dot(powers) + 0.94598657 * fifth;
    let y =
        y * z + -0.39460304 + Vec4::new(0.22238626, 0.37179673, 1.3073437, 2.1353924).dot(powers) + 1.1228601 * fifth;
    let y =
        y * z + -0.12285215 + Vec4::new(0.7024384, 0.82025933, 0.5706922, 0.5520335).dot(powers) + 0.27289453 * fifth;
    let y =
        y * z + 0.40329757 + Vec4::new(0.6511315, 1.0314175, 0.60844195, -0.1749438).dot(powers) + -0.27012518 * fifth;
    y * z + 0.32030332 + Vec4::new(0.39432263, 0.5965222, 0.33280572, -0.11012778).dot(powers) + -0.14635271 * fifth
}

fn grazing_polynomial(z: f32, powers: Vec4, fifth: f32) -> f32 {
    let y = -0.27699554 + Vec4::new(0.86916727, 0.8740421, 1.7877537, 1.8112689).dot(powers) + -1.5997394 * fifth;
    let y =
        y * z + -0.8551063 + Vec4::new(0.6374431, 4.513031, 4.2166076, 1.7199866).dot(powers) + -0.090891734 * fifth;
    let y = y * z + -0.8048706 + Vec4::new(-2.256373, 3.9497612, 5.400407, 1.3915476).dot(powers) + 2.6716585 * fifth;
    let y = y * z + 0.19544311 + Vec4::new(-2.9967628, -2.5920486, 3.630944, 3.7848535).dot(powers) + 1.0182526 * fifth;
    let y =
        y * z + 0.9133323 + Vec4::new(0.23875533, -3.3636262, -0.2198798, 2.705742).dot(powers) + 0.053990252 * fifth;
    y * z + -0.32218575 + Vec4::new(0.8386179, 0.049529385, -1.1930618, 0.22775501).dot(powers) + 0.40759394 * fifth
}

/// `roughness`: square root of the distribution's width; 0 if the surface is perfectly smooth.
pub fn ggx_albedo(cosine: f32, roughness: f32) -> GgxAlbedo {
    let powers = powers_of(centred(roughness));
    let fifth = centred(roughness) * powers.w;
    let z = cosine / (cosine + roughness * roughness);
    let x = (1.0 - cosine).clamp(0.0, 1.0);
    let loss = ((1.0 - z) * loss_polynomial(centred(z), powers, fifth)).clamp(0.0, 0.9);
    let smooth_grazing = x * x * x * x * x;
    let grazing = smooth_grazing + (1.0 - z) * grazing_polynomial(centred(z), powers, fifth);
    // GLSL's `clamp`, which takes a limit that is NaN: Rust's panics.
    GgxAlbedo { loss, grazing: grazing.max(0.0001).min(1.0 - loss) }
}

/// The mean of [`ggx_albedo`] over the hemisphere, weighted by the cosine.
pub fn mean_ggx_albedo(roughness: f32) -> GgxAlbedo {
    let powers = powers_of(centred(roughness));
    let fifth = centred(roughness) * powers.w;
    let loss =
        0.23559959 + Vec4::new(0.45514977, 0.08237253, -0.20343474, -0.023440205).dot(powers) + 0.044103485 * fifth;
    let change = -0.059065323
        + Vec4::new(-0.0047479947, 0.08910083, -0.08968468, -0.046510242).dot(powers)
        + 0.065464064 * fifth;
    GgxAlbedo { loss: (roughness * loss).max(0.0), grazing: 1.0 / 21.0 + roughness * change }
}

/// The albedo of a sheen of reflectance 1. `roughness`: at least [`crate::layout::LEAST_SHEEN_ROUGHNESS`].
pub fn sheen_albedo(cosine: f32, roughness: f32) -> f32 {
    let powers = powers_of(centred(roughness));
    let z = centred((1.0 - cosine).clamp(0.0, 1.0));
    let y = -0.025658233 + Vec4::new(-0.079442926, 0.15305589, -0.12680236, 0.04373475).dot(powers);
    let y = y * z + 0.04537495 + Vec4::new(-0.04196653, 0.07835384, -0.05967113, 0.017228179).dot(powers);
    let y = y * z + 0.074563555 + Vec4::new(0.07415557, -0.096496835, 0.05393373, -0.016278138).dot(powers);
    let y = y * z + 0.026118582 + Vec4::new(0.006430548, -0.011569813, -0.027085755, 0.02527979).dot(powers);
    let y = y * z + 0.046010688 + Vec4::new(-0.09292707, 0.23614322, -0.2758054, 0.12156358).dot(powers);
    let y = y * z + 0.298807 + Vec4::new(-0.13584308, 0.102032214, 0.02426417, -0.061889347).dot(powers);
    let y = y * z + 0.4354193 + Vec4::new(0.27736488, -0.137553, 0.09287007, -0.070511475).dot(powers);
    let y = y.max(0.01);
    y * y
}

#[cfg(test)]
mod tests {
    use super::*;

    /// As in the kernels, a direction that is none has an albedo that is none, and ends nothing.
    #[test]
    fn a_cosine_that_is_nan_does_not_panic() {
        for (cosine, roughness) in [(f32::NAN, 0.5), (0.0, 0.0), (0.5, f32::NAN)] {
            let GgxAlbedo { loss, grazing } = ggx_albedo(cosine, roughness);
            assert!(loss.is_nan() || (0.0..=0.9).contains(&loss), "{cosine}, {roughness}: {loss}");
            assert!(grazing.is_nan() || (0.0001..=1.0).contains(&grazing), "{cosine}, {roughness}: {grazing}");
        }
    }
}
