//! Reflection by microfacets: metals and dielectrics, after glTF 2.0, Appendix B. Twin of `shading/microfacet.glsl`,
//! which names the sources.

use glam::{Vec3, Vec4};

use crate::layout::{
    DIFFUSE_ROUGHNESS, LEAST_COSINE, LEAST_MICROFACET_WIDTH, MATERIAL_MICROFACET, MIRROR_ROUGHNESS, Material,
};

/// Whether the material reflects by microfacets.
pub fn is_microfacet(material: &Material) -> bool {
    material.flags & MATERIAL_MICROFACET != 0
}

/// The width of the distribution of normals.
fn microfacet_width(material: &Material) -> f32 {
    (material.roughness * material.roughness).max(LEAST_MICROFACET_WIDTH)
}

/// The dielectric's reflectance for light along the normal.
pub fn normal_reflectance(material: &Material) -> Vec3 {
    let ratio = (material.ni - 1.0) / (material.ni + 1.0);
    (ratio * ratio * material.ks).min(Vec3::ONE)
}

/// Schlick's weight of the reflectance at grazing angles.
pub fn grazing_weight(cosine: f32) -> f32 {
    let x = (1.0 - cosine).clamp(0.0, 1.0);
    x * x * x * x * x
}

/// The dielectric's reflectance where the light's angle to the normal has this cosine.
pub fn dielectric_reflectance(material: &Material, cosine: f32) -> Vec3 {
    let at_grazing = material.ks.max_element().min(1.0);
    normal_reflectance(material).lerp(Vec3::splat(at_grazing), grazing_weight(cosine))
}

/// The metal's reflectance where the light's angle to the normal has this cosine.
pub fn metal_reflectance(material: &Material, cosine: f32) -> Vec3 {
    material.kd.lerp(Vec3::ONE, grazing_weight(cosine))
}

/// Pi times the distribution of normals, times masking and shadowing, divided by 4 and by both cosines.
/// `sin_half_squared`, `cos_half`: of the angle between the normal and the half vector.
fn ggx_smith(width: f32, cos_view: f32, cos_light: f32, cos_half: f32, sin_half_squared: f32) -> f32 {
    let squared = width * width;
    let spread = sin_half_squared + cos_half * cos_half * squared;
    let distribution = squared / (spread * spread);
    let shadowing = cos_light * (cos_view * cos_view * (1.0 - squared) + squared).sqrt()
        + cos_view * (cos_light * cos_light * (1.0 - squared) + squared).sqrt();
    distribution * 0.5 / shadowing
}

/// The reflectance towards the viewer, times the cosine of the light's direction. All vectors are unit vectors that
/// point away from the surface.
pub fn microfacet_reflectance(material: &Material, normal: Vec3, to_viewer: Vec3, to_light: Vec3) -> Vec3 {
    let cos_light = normal.dot(to_light);
    // Not `<=`: a NaN is dark.
    if !(cos_light > 0.0) {
        return Vec3::ZERO;
    }
    let cos_view = normal.dot(to_viewer).max(LEAST_COSINE);
    let between = (to_viewer + to_light).normalize();
    let aside = normal.cross(between);
    let lobe = ggx_smith(microfacet_width(material), cos_view, cos_light, normal.dot(between), aside.dot(aside));
    let cos_between = to_viewer.dot(between);
    let fresnel = dielectric_reflectance(material, cos_between);
    let diffuse = material.kd * ((1.0 - material.transmission) * (1.0 - fresnel.max_element()));
    let metal = metal_reflectance(material, cos_between) * lobe;
    (diffuse + fresnel * lobe).lerp(metal, material.metallic) * cos_light
}

/// The share of the reflected light that arrives as a mirrored ray. The surface shows the rest by lights alone.
pub fn mirror_share(material: &Material) -> f32 {
    ((DIFFUSE_ROUGHNESS - material.roughness) / (DIFFUSE_ROUGHNESS - MIRROR_ROUGHNESS)).clamp(0.0, 1.0)
}

/// The share of uniform light from all directions that the surface reflects: diffusely, and by its microfacets except
/// for what arrives as a mirrored ray.
pub fn ambient_reflectance(material: &Material, normal: Vec3, to_viewer: Vec3) -> Vec3 {
    let cos_view = normal.dot(to_viewer).max(LEAST_COSINE);
    let r = material.roughness * Vec4::new(-1.0, -0.0275, -0.572, 0.022) + Vec4::new(1.0, 0.0425, 1.04, -0.04);
    let a = (r.x * r.x).min((-9.28 * cos_view).exp2()) * r.x + r.y;
    let (scale, bias) = (-1.04 * a + r.z, 1.04 * a + r.w);
    let at_grazing = material.ks.max_element().min(1.0);
    let dielectric = normal_reflectance(material) * scale + at_grazing * bias;
    let metal = material.kd * scale + bias;
    let diffuse = material.kd * ((1.0 - material.transmission) * (1.0 - dielectric.max_element()));
    let by_lights = 1.0 - mirror_share(material);
    (diffuse + dielectric * by_lights).lerp(metal * by_lights, material.metallic)
}

#[cfg(test)]
mod tests {
    use glam::vec3;

    use super::*;

    fn material(metallic: f32, roughness: f32) -> Material {
        let (kd, ks) = (vec3(0.8, 0.5, 0.2), Vec3::ONE);
        Material { kd, ks, ni: 1.5, d: 1.0, metallic, roughness, flags: MATERIAL_MICROFACET, ..Material::default() }
    }

    /// Along the normal, everything is known in closed form: the cosines are 1, the distribution is
    /// `1 / (pi width^2)`, and masking and shadowing are 1.
    #[test]
    fn light_along_the_normal_is_reflected_as_the_closed_form_says() {
        for roughness in [0.2_f32, 0.5, 1.0] {
            let lobe = 0.25 / roughness.powi(4);
            let z = Vec3::Z;
            let metal = microfacet_reflectance(&material(1.0, roughness), z, z, z);
            assert!((metal - vec3(0.8, 0.5, 0.2) * lobe).abs().max_element() < 1e-4 * lobe, "{metal}");
            let dielectric = microfacet_reflectance(&material(0.0, roughness), z, z, z);
            let expected = vec3(0.8, 0.5, 0.2) * 0.96 + 0.04 * lobe;
            assert!((dielectric - expected).abs().max_element() < 1e-4 * lobe, "{dielectric}");
        }
    }

    /// Diffuse light lacks the coat's largest reflectance in all three channels, so that the coat does not tint it.
    #[test]
    fn diffuse_light_lacks_the_largest_reflectance() {
        let coated = Material { kd: Vec3::ONE, ks: vec3(1.0, 0.2, 0.2), ..material(0.0, 1.0) };
        let found = microfacet_reflectance(&coated, Vec3::Z, Vec3::Z, Vec3::Z);
        assert!((found - (0.96 + vec3(0.04, 0.008, 0.008) * 0.25)).abs().max_element() < 1e-5, "{found}");
    }

    /// A white metal reflects no more than it receives, for each direction of view: the integral over the hemisphere of
    /// lights. It loses what bounces between microfacets, the more the rougher it is.
    #[test]
    fn a_white_metal_reflects_no_more_than_it_receives() {
        let white = |roughness| Material { kd: Vec3::ONE, ..material(1.0, roughness) };
        for (roughness, least) in [(0.3, 0.9), (0.6, 0.75), (1.0, 0.3)] {
            for cos_view in [0.2_f32, 0.6, 1.0] {
                let to_viewer = vec3((1.0 - cos_view * cos_view).sqrt(), 0.0, cos_view);
                let n = 400;
                let mut sum = 0.0;
                for i in 0..n * n {
                    let (a, b) = ((i % n) as f32 + 0.5, (i / n) as f32 + 0.5);
                    let (cosine, azimuth) = (a / n as f32, b / n as f32 * std::f32::consts::TAU);
                    let sine = (1.0 - cosine * cosine).sqrt();
                    let to_light = vec3(sine * azimuth.cos(), sine * azimuth.sin(), cosine);
                    sum += microfacet_reflectance(&white(roughness), Vec3::Z, to_viewer, to_light).x;
                }
                // The reflectances are multiplied by pi, so a factor 1 / pi is left of 2 pi / pi.
                let reflected = sum * 2.0 / (n * n) as f32;
                assert!((least..1.01).contains(&reflected), "roughness {roughness}, {cos_view}: {reflected}");
            }
        }
    }

    #[test]
    fn reflection_is_reciprocal() {
        let (a, b) = (vec3(0.3, 0.1, 0.9).normalize(), vec3(-0.7, 0.2, 0.4).normalize());
        for material in [material(1.0, 0.4), material(0.0, 0.7), material(0.5, 0.2)] {
            let there = microfacet_reflectance(&material, Vec3::Z, a, b) / b.z;
            let back = microfacet_reflectance(&material, Vec3::Z, b, a) / a.z;
            assert!((there - back).abs().max_element() < 1e-5 * there.max_element(), "{there} {back}");
        }
    }
}
