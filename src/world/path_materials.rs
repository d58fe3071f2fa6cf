//! Materials as the path tracer reads them: each one is a material of microfacets.
//!
//! MTL's materials reflect by Phong's model, which gains energy: its highlight is not normalized, and the sum of Kd and
//! Ks may exceed 1. Here they become a dielectric over a Lambertian surface, whose layers share the light
//! (bsdf/bsdf.glsl):
//!
//! | MTL | microfacets |
//! |---|---|
//! | Kd | base colour, at most 1 unless the material is unlit |
//! | Ks, with a highlight or mirror | reflectance along the normal |
//! | Ns, with a highlight | width sqrt(2 / (Ns + 2)), about as wide as Blinn's distribution (Walter et al., 2007) |
//! | illum 3, 8 | perfectly smooth, as a mirror is |
//! | illum 5 | the same; Ni and Ks give the reflectance, as Fresnel's term times Ks does |
//! | illum 4, 6, 7, 9 | glass: perfectly smooth, Ni, and Tf as the tint of each boundary. Kd and Ks are ignored |

use glam::Vec3;

use super::FlatScene;
use crate::layout::{
    MATERIAL_FRESNEL, MATERIAL_MICROFACET, MATERIAL_PHONG_WIDTH, MATERIAL_REFLECT, MATERIAL_REFRACT,
    MATERIAL_SINGLE_SIDED, MATERIAL_SOLID, MATERIAL_SPECULAR, MATERIAL_UNLIT, Material,
};

/// Index of refraction of an MTL material that does not state its reflectance by Ni, and the reflectance along the
/// normal that it gives.
const NEUTRAL_INDEX: f32 = 1.5;
const NEUTRAL_REFLECTANCE: f32 = 0.04;

/// Returns the materials of a scene for the path tracer, in their order.
pub fn path_materials(scene: &FlatScene) -> Vec<Material> {
    scene.materials.iter().map(path_material).collect()
}

fn path_material(material: &Material) -> Material {
    if material.flags & MATERIAL_MICROFACET != 0 {
        return *material;
    }
    let &Material { kd, ks, flags, tf, .. } = material;
    let has = |flag: u32| flags & flag != 0;
    let is_single_sided = flags & MATERIAL_SINGLE_SIDED;
    // It shows its colour as it is, and reflects nothing.
    if has(MATERIAL_UNLIT) {
        return Material { flags: MATERIAL_MICROFACET | MATERIAL_UNLIT | is_single_sided, ..*material };
    }
    let flags = MATERIAL_MICROFACET | is_single_sided;
    let base = Material { kd: kd.min(Vec3::ONE), flags, tf: Vec3::ONE, ..*material };
    if has(MATERIAL_REFRACT) {
        // Whitted's rays refract wherever the surface is, whatever its opacity.
        let (flags, tf) = (flags | MATERIAL_SOLID, tf.min(Vec3::ONE));
        return Material { kd: Vec3::ONE, ks: Vec3::ONE, d: 1.0, flags, tf, transmission: 1.0, ..base };
    }
    if has(MATERIAL_REFLECT) && has(MATERIAL_FRESNEL) {
        return base;
    }
    // The factor on the reflectance of the neutral index gives Ks along the normal.
    let ks = if has(MATERIAL_SPECULAR) || has(MATERIAL_REFLECT) { ks.min(Vec3::ONE) } else { Vec3::ZERO };
    let flags = if has(MATERIAL_REFLECT) { flags } else { flags | MATERIAL_PHONG_WIDTH };
    Material { ks: ks / NEUTRAL_REFLECTANCE, ni: NEUTRAL_INDEX, flags, ..base }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::{self, Lobes};

    fn of_illum(illum: u32) -> Material {
        let lobes = Lobes::of_illum(illum).expect("an illum");
        let (kd, ks, tf) = (Vec3::new(0.9, 1.5, 0.3), Vec3::new(0.5, 0.2, 1.2), Vec3::new(0.7, 0.8, 0.9));
        Material::from(&scene::Material { kd, ks, tf, ns: 62.0, ni: 1.3, lobes, ..scene::Material::default() })
    }

    /// Reflectance along the normal.
    fn reflectance(material: &Material) -> Vec3 {
        crate::reference::microfacet::normal_reflectance(material)
    }

    #[test]
    fn each_illum_becomes_microfacets() {
        for illum in [0, 1] {
            let diffuse = path_material(&of_illum(illum));
            assert_eq!((diffuse.kd, diffuse.ks), (Vec3::new(0.9, 1.0, 0.3), Vec3::ZERO));
        }
        for illum in [2, 10] {
            let glossy = path_material(&of_illum(illum));
            assert!((reflectance(&glossy) - Vec3::new(0.5, 0.2, 1.0)).abs().max_element() < 1e-6, "{glossy:?}");
            assert_eq!((glossy.flags, glossy.ns), (MATERIAL_MICROFACET | MATERIAL_PHONG_WIDTH, 62.0));
        }
        for illum in [3, 8] {
            let mirror = path_material(&of_illum(illum));
            assert!((reflectance(&mirror) - Vec3::new(0.5, 0.2, 1.0)).abs().max_element() < 1e-6, "{mirror:?}");
            assert_eq!((mirror.flags, mirror.roughness), (MATERIAL_MICROFACET, 0.0));
        }
        let fresnel = path_material(&of_illum(5));
        assert_eq!((fresnel.ks, fresnel.ni, fresnel.roughness), (Vec3::new(0.5, 0.2, 1.2), 1.3, 0.0));
        for illum in [4, 6, 7, 9] {
            let glass = path_material(&of_illum(illum));
            assert_eq!(glass.flags, MATERIAL_MICROFACET | MATERIAL_SOLID);
            assert_eq!((glass.kd, glass.tf, glass.ni), (Vec3::ONE, Vec3::new(0.7, 0.8, 0.9), 1.3));
            assert_eq!((glass.transmission, glass.roughness, glass.d), (1.0, 0.0, 1.0));
        }
    }

    #[test]
    fn unlit_materials_keep_their_colour() {
        for illum in [1, 2, 5, 6] {
            let phong = Material { flags: of_illum(illum).flags | MATERIAL_UNLIT, d: 0.3, ..of_illum(illum) };
            let unlit = path_material(&phong);
            assert_eq!((unlit.kd, unlit.d, unlit.flags), (phong.kd, 0.3, MATERIAL_MICROFACET | MATERIAL_UNLIT));
        }
    }

    #[test]
    fn materials_of_microfacets_are_left_as_they_are() {
        let flags = MATERIAL_MICROFACET | MATERIAL_SOLID;
        let material = Material { flags, roughness: 0.3, kd: Vec3::splat(0.4), ns: 1.0, ..Material::default() };
        assert_eq!(path_material(&material), material);
    }
}
