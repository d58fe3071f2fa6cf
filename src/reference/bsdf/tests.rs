//! Tests of the surfaces of the path tracer: energy, reciprocity, and that samples have the pdfs that are stated.

use std::f32::consts::TAU;

use glam::{Vec3, Vec3Swizzles, vec3};

use super::{
    albedo::{ggx_albedo, mean_ggx_albedo, sheen_albedo},
    bsdf_terms,
    conductor::conductor_reflectance,
    eval_bsdf,
    ggx::{ggx_root, ggx_visible_pdf, sample_ggx},
    is_smooth,
    reflection::{evaluate_reflection, reflected_by},
    sample::BsdfSample,
    sheen::{evaluate_sheen, sample_sheen},
};
use crate::{
    layout::{
        LEAST_INDEX_STEP, LEAST_SHEEN_ROUGHNESS, MATERIAL_MICROFACET, MATERIAL_SINGLE_SCATTERING, MATERIAL_SOLID,
        MATERIAL_UNLIT, Material,
    },
    reference::{
        chi_square::{LARGEST_DEVIATION, Uniform, chi_square, probabilities},
        fresnel::{fresnel, refraction_cosine},
        surface::Surface,
    },
};

const VIEW_COSINES: [f32; 5] = [0.1, 0.3, 0.5, 0.8, 1.0];
const SINGLE: u32 = MATERIAL_SINGLE_SCATTERING;
const SOLID: u32 = MATERIAL_SOLID;

fn sample_bsdf(material: &Material, surface: &Surface, to_viewer: Vec3, u: Vec3) -> BsdfSample {
    super::sample_bsdf(&bsdf_terms(&mut material.clone(), surface, to_viewer), surface, u)
}

fn evaluate_bsdf(material: &Material, surface: &Surface, to_viewer: Vec3, to_light: Vec3) -> Vec3 {
    eval_bsdf(&bsdf_terms(&mut material.clone(), surface, to_viewer), surface, to_light).value
}

fn bsdf_pdf(material: &Material, surface: &Surface, to_viewer: Vec3, to_light: Vec3) -> f32 {
    eval_bsdf(&bsdf_terms(&mut material.clone(), surface, to_viewer), surface, to_light).pdf
}

/// The triangle and the normals of the surface, with the normal z.
fn flat(from_inside: bool) -> Surface {
    bent(Vec3::Z, from_inside)
}

fn bent(shading: Vec3, from_inside: bool) -> Surface {
    Surface {
        point_world: Vec3::ZERO,
        geometric: Vec3::Z,
        interpolated: shading,
        shading,
        is_reversed: false,
        origin_offset: 0.0,
        from_inside,
    }
}

/// A triangle of a curved surface with the normal z, whose map bends the normal away from many views.
fn mapped() -> Surface {
    Surface {
        geometric: vec3(0.1, 0.0, 1.0).normalize(),
        interpolated: Vec3::Z,
        ..bent(vec3(-0.5, -0.4, 0.7).normalize(), false)
    }
}

/// A triangle at the silhouette of a curved surface, whose interpolated normal and whose map face away from viewers.
fn seen_from_behind() -> Surface {
    Surface {
        geometric: vec3(0.9, 0.0, 0.4).normalize(),
        interpolated: -Vec3::Z,
        ..bent(vec3(-0.94, 0.0, -0.34).normalize(), false)
    }
}

/// Returns a white dielectric of this roughness.
fn white(roughness: f32) -> Material {
    Material {
        kd: Vec3::ONE,
        ks: Vec3::ONE,
        tf: Vec3::ONE,
        ni: 1.5,
        d: 1.0,
        roughness,
        flags: MATERIAL_MICROFACET,
        ..Material::default()
    }
}

fn metal(roughness: f32) -> Material {
    Material { metallic: 1.0, ..white(roughness) }
}

fn sheet(roughness: f32) -> Material {
    Material { transmission: 1.0, ..white(roughness) }
}

fn glass(roughness: f32, ni: f32) -> Material {
    Material { ni, flags: MATERIAL_MICROFACET | SOLID, ..sheet(roughness) }
}

fn with_flag(material: Material, flag: u32) -> Material {
    Material { flags: material.flags | flag, ..material }
}

/// Materials with every lobe and with several of them, none of them perfectly smooth.
fn rough_materials() -> Vec<Material> {
    let coloured = Material { kd: vec3(0.8, 0.5, 0.2), ks: vec3(1.0, 0.6, 0.4), ..white(0.5) };
    vec![
        white(0.6),
        coloured,
        metal(0.4),
        Material { metallic: 0.5, ..coloured },
        sheet(0.5),
        glass(0.5, 1.5),
        glass(0.7, 0.8),
        Material { transmission: 0.6, metallic: 0.2, kd: vec3(0.9, 0.7, 0.3), ..glass(0.6, 1.3) },
        Material { clearcoat: 0.8, clearcoat_roughness: 0.4, ..coloured },
        Material { sheen_colour: vec3(0.9, 0.5, 0.2), sheen_roughness: 0.5, ..coloured },
        Material { clearcoat: 1.0, clearcoat_roughness: 0.5, sheen_colour: Vec3::ONE, ..metal(0.6) },
        Material { conductor_eta: vec3(0.2, 0.9, 1.2), conductor_k: vec3(3.9, 2.4, 2.2), ..metal(0.5) },
    ]
}

fn view(cosine: f32) -> Vec3 {
    let sine = (1.0 - cosine * cosine).max(0.0).sqrt();
    vec3(sine * 0.6, sine * 0.8, cosine)
}

/// Number `i` of a sequence of points that fill the cube evenly (Roberts: The Unreasonable Effectiveness of
/// Quasirandom Sequences, 2018).
fn point(i: usize) -> Vec3 {
    let part = |step: f64| (0.5 + (i + 1) as f64 * step).fract() as f32;
    vec3(part(0.819_172_513_396_164_4), part(0.671_043_606_703_789_3), part(0.549_700_477_901_970_2))
        .min(Vec3::splat(0.999_999_94))
}

/// The share of uniform light from all around that is scattered to the viewer. Light from beyond a solid's boundary is
/// stated relative to the square of the index there, as it is in equilibrium.
fn furnace(material: &Material, surface: &Surface, to_viewer: Vec3) -> Vec3 {
    let n = 16_384;
    let is_solid = material.flags & SOLID != 0 && (material.ni - 1.0).abs() >= LEAST_INDEX_STEP;
    let eta = if surface.from_inside { material.ni } else { 1.0 / material.ni };
    let sum = (0..n).fold(Vec3::ZERO, |sum, i| {
        let sample = sample_bsdf(material, surface, to_viewer, point(i));
        let is_beyond = sample.direction.z < 0.0;
        sum + sample.weight / if is_beyond && is_solid { eta * eta } else { 1.0 }
    });
    sum / n as f32
}

/// White surfaces scatter all light, within the error of the fits. Their lobes share it.
#[test]
fn white_surfaces_lose_no_light() {
    let mut materials = Vec::new();
    for roughness in [0.0, 0.02, 0.1, 0.25, 0.4, 0.6, 0.8, 1.0] {
        let (plain, shiny) = (white(roughness), Material { ni: 4.0, ..white(roughness) });
        materials.extend([plain, shiny, metal(roughness), sheet(roughness)]);
        materials.push(Material { metallic: 0.5, transmission: 0.5, ..plain });
        materials.push(Material { clearcoat: 1.0, clearcoat_roughness: 0.3, ..metal(roughness) });
        materials.push(Material { clearcoat: 0.5, ..plain });
        materials.push(Material { sheen_colour: Vec3::ONE, sheen_roughness: roughness, ..plain });
    }
    for material in &materials {
        for cosine in VIEW_COSINES {
            let found = furnace(material, &flat(false), view(cosine));
            assert!((found - 1.0).abs().max_element() < 0.015, "{cosine}: {found} for {material:?}");
        }
    }
    // Without the compensation, the same comparison fails.
    let single = furnace(&with_flag(metal(0.6), SINGLE), &flat(false), view(0.5));
    assert!(single.max_element() < 0.92, "{single}");
}

/// Perfectly smooth glass splits light into what it reflects and what it lets pass, from both sides.
#[test]
fn smooth_glass_loses_no_light() {
    for ni in [0.5, 0.995, 1.0, 1.1, 1.5, 3.0] {
        for from_inside in [false, true] {
            for cosine in VIEW_COSINES {
                let found = furnace(&glass(0.0, ni), &flat(from_inside), view(cosine));
                assert!((found - 1.0).abs().max_element() < 1e-3, "{ni}, {from_inside}, {cosine}: {found}");
            }
        }
    }
}

/// Rough glass loses no light either, within the error of the table.
#[test]
fn rough_glass_loses_no_light() {
    for (roughness, ni) in [(0.1, 1.5), (0.25, 1.33), (0.5, 1.5), (0.5, 2.4), (0.8, 1.1), (1.0, 1.5), (0.7, 0.7)] {
        for from_inside in [false, true] {
            for cosine in VIEW_COSINES {
                let found = furnace(&glass(roughness, ni), &flat(from_inside), view(cosine));
                let message = format!("{roughness}, {ni}, {from_inside}, {cosine}: {found}");
                assert!((found - 1.0).abs().max_element() < 0.02, "{message}");
            }
        }
    }
    // Without the compensation, the same comparison fails.
    let single = furnace(&with_flag(glass(0.5, 1.5), SINGLE), &flat(true), view(0.7));
    assert!(single.max_element() < 0.92, "{single}");
}

/// No surface scatters more light than it receives, whatever its colours and with light from any side.
#[test]
fn no_surface_gains_light() {
    let bright = Material { kd: Vec3::splat(3.0), ks: Vec3::splat(30.0), ..white(0.4) };
    let mut materials = rough_materials();
    materials.extend([bright, Material { transmission: 0.5, ..bright }, Material { metallic: 0.5, ..bright }]);
    materials.extend([glass(1.0, 1.5), glass(0.3, 3.0), glass(0.3, 1.05)]);
    for material in &materials {
        for surface in [flat(false), flat(true), mapped()] {
            for cosine in VIEW_COSINES {
                let found = furnace(material, &surface, view(cosine));
                assert!(found.max_element() < 1.03, "{cosine}: {found} for {material:?} at {surface:?}");
            }
        }
    }
}

/// The visible normals fill the viewer's view: their pdf integrates to 1, without shadowing (the weak white
/// furnace; Heitz 2014).
#[test]
fn visible_normals_integrate_to_one() {
    let integral = |pdf: &dyn Fn(Vec3) -> f32| {
        let n = 300;
        let mut sum = 0.0_f64;
        for i in 0..n * n {
            // A grid that is finer near the normal, where the distribution is high.
            let (a, b) = (((i % n) as f32 + 0.5) / n as f32, ((i / n) as f32 + 0.5) / n as f32);
            let z = 1.0 - a * a;
            let sine = (1.0 - z * z).sqrt();
            let normal = vec3(sine * (b * TAU).cos(), sine * (b * TAU).sin(), z);
            sum += f64::from(pdf(normal) * 2.0 * a * TAU);
        }
        sum / (n * n) as f64
    };
    for width in [0.1_f32, 0.4, 1.0] {
        for cosine in VIEW_COSINES {
            let to_viewer = view(cosine);
            let of_normal = |normal| ggx_visible_pdf(to_viewer, normal, width) * to_viewer.dot(normal).max(0.0);
            let found = integral(&of_normal);
            assert!((found - 1.0).abs() < 0.01, "{width}, {cosine}: {found}");
            // Normals of which none is masked are too many, except for a view along the normal of a smooth surface.
            let unmasked = |normal| of_normal(normal) * (to_viewer.z + ggx_root(to_viewer.z, width)) / (2.0 * cosine);
            assert!(width < 0.4 || cosine > 0.9 || integral(&unmasked) > 1.02, "{width}, {cosine}");
        }
    }
}

/// The largest relative difference, over pairs of directions, between f / index^2 with viewer and light in either
/// order. The index is that of the viewer's side. `between` gives the surface's reflectance without the cosine.
fn irreciprocity(material: &Material, between: &dyn Fn(&Material, Vec3, Vec3) -> Vec3) -> f32 {
    let directions = [vec3(0.3, 0.1, 0.9), vec3(-0.7, 0.2, 0.4), vec3(0.1, -0.9, 0.3), vec3(-0.2, -0.1, 0.8)];
    let mut worst = 0.0_f32;
    for a in directions.map(Vec3::normalize) {
        for b in directions.map(Vec3::normalize) {
            for b in [b, vec3(b.x, b.y, -b.z)] {
                let (there, back) = (between(material, a, b), between(material, b, a));
                let size = there.max_element().max(back.max_element());
                if size > 1e-6 {
                    worst = worst.max((there - back).abs().max_element() / size);
                }
            }
        }
    }
    worst
}

/// The scattered share without the cosine, divided by the square of the index on the viewer's side.
fn reduced(material: &Material, to_viewer: Vec3, to_light: Vec3) -> Vec3 {
    let from_inside = to_viewer.z < 0.0;
    let flip = |v: Vec3| if from_inside { vec3(v.x, v.y, -v.z) } else { v };
    let index = if from_inside && material.flags & SOLID != 0 { material.ni } else { 1.0 };
    let value = evaluate_bsdf(material, &flat(from_inside), flip(to_viewer), flip(to_light));
    value / to_light.z.abs() / if to_viewer.z * to_light.z < 0.0 { index * index } else { 1.0 }
}

#[test]
fn scattering_is_reciprocal() {
    let coloured = Material { kd: vec3(0.8, 0.5, 0.2), ks: vec3(1.0, 0.6, 0.4), ..white(0.5) };
    // The compensation of sheets, clear coats and sheen depend on the viewer alone.
    let materials = [
        coloured,
        Material { metallic: 1.0, ..coloured },
        Material { metallic: 0.5, ..coloured },
        with_flag(sheet(0.4), SINGLE),
        with_flag(glass(0.4, 1.5), SINGLE),
        with_flag(glass(0.8, 0.7), SINGLE),
        with_flag(Material { transmission: 0.6, metallic: 0.2, ..glass(0.6, 1.3) }, SINGLE),
    ];
    for material in &materials {
        let found = irreciprocity(material, &reduced);
        assert!(found < 2e-3, "{found} for {material:?}");
    }
    // Radiance that is not scaled at the boundary is noticed.
    let unscaled = |m: &Material, a: Vec3, b: Vec3| reduced(m, a, b) * if a.z < 0.0 && b.z > 0.0 { 2.25 } else { 1.0 };
    assert!(irreciprocity(&materials[4], &unscaled) > 0.1);
}

#[test]
fn samples_have_the_stated_pdf() {
    let surfaces = [flat(false), flat(true), bent(vec3(0.3, -0.2, 0.9).normalize(), false), mapped()];
    for (ix, material) in rough_materials().iter().enumerate() {
        let surface = &surfaces[ix % 4];
        for cosine in [0.25, 0.7] {
            let to_viewer = view(cosine);
            let mut random = Uniform(ix as u64);
            let mut sample = || {
                let sample = sample_bsdf(material, surface, to_viewer, random.point());
                (sample.pdf > 0.0 && !sample.is_delta).then_some(sample.direction)
            };
            let pdf = |direction| bsdf_pdf(material, surface, to_viewer, direction);
            let found = chi_square((30_000, 8), &mut sample, &pdf);
            assert!(found < LARGEST_DEVIATION, "{found} deviations at {cosine} for {material:?}");
            // A pdf that is 15 % higher on one side is noticed.
            let skewed = |direction: Vec3| pdf(direction) * (1.0 + 0.15 * direction.x.signum());
            assert!(chi_square((30_000, 8), &mut sample, &skewed) > LARGEST_DEVIATION, "{cosine} for {material:?}");
        }
    }
}

/// A sample's weight and pdf are those of its direction.
#[test]
fn weights_are_values_divided_by_pdfs() {
    for material in rough_materials() {
        for surface in [flat(false), flat(true), bent(vec3(0.3, -0.2, 0.9).normalize(), false), mapped()] {
            for i in 0..200 {
                let to_viewer = view(0.05 + 0.9 * point(i + 999).x);
                let sample = sample_bsdf(&material, &surface, to_viewer, point(i));
                if sample.pdf == 0.0 || sample.is_delta {
                    continue;
                }
                let pdf = bsdf_pdf(&material, &surface, to_viewer, sample.direction);
                let value = evaluate_bsdf(&material, &surface, to_viewer, sample.direction);
                assert!((pdf - sample.pdf).abs() <= 2e-3 * pdf, "{pdf} {sample:?} {material:?}");
                let least = 2e-3 * value.max_element();
                assert!((value - sample.weight * pdf).abs().max_element() <= least, "{sample:?} {material:?}");
            }
        }
    }
}

/// The integral of the reflectance over all directions is the mean weight of samples: no lobe is evaluated that is not
/// sampled, or the reverse.
#[test]
fn values_integrate_to_the_mean_weight() {
    for material in rough_materials() {
        for from_inside in [false, true] {
            let (surface, to_viewer) = (flat(from_inside), view(0.6));
            let of_channel = |channel: usize| {
                let value = |direction| evaluate_bsdf(&material, &surface, to_viewer, direction)[channel];
                probabilities(8, &value).iter().sum::<f64>() as f32
            };
            let integral = vec3(of_channel(0), of_channel(1), of_channel(2));
            let n = 4096;
            let weights = (0..n).map(|i| sample_bsdf(&material, &surface, to_viewer, point(i)).weight);
            let mean = weights.sum::<Vec3>() / n as f32;
            let is_near = |integral: Vec3| (integral - mean).abs().max_element() < 0.01;
            assert!(is_near(integral), "{integral} {mean} {material:?}");
            // A lobe that is evaluated and not sampled, which reflects 3 %, is noticed.
            assert!(!is_near(integral + 0.03), "{integral} {mean} {material:?}");
        }
    }
}

/// Samples are chosen about as their values need: no weight is large, so that no path becomes a bright speck. Light
/// from beyond a solid's boundary is scaled by the square of the index besides.
#[test]
fn weights_are_bounded() {
    for material in rough_materials() {
        for from_inside in [false, true] {
            for i in 0..20_000 {
                let to_viewer = view(0.02 + 0.97 * point(i + 999).y);
                let sample = sample_bsdf(&material, &flat(from_inside), to_viewer, point(i));
                let eta = if from_inside { material.ni } else { 1.0 / material.ni };
                let scale = if sample.direction.z < 0.0 && material.flags & SOLID != 0 { eta * eta } else { 1.0 };
                assert!(sample.weight.max_element() < 6.0 * scale, "{sample:?} {to_viewer} {material:?}");
            }
        }
    }
}

/// The polynomials are the albedos of the lobes.
#[test]
fn albedos_are_those_of_the_lobes() {
    let n = 4096;
    for roughness in [0.1_f32, 0.2, 0.35, 0.5, 0.7, 0.85, 1.0] {
        let width = roughness * roughness;
        for cosine in [0.05, 0.15, 0.3, 0.5, 0.7, 0.9, 1.0] {
            let to_viewer = view(cosine);
            let (mut whole, mut grazing, mut sheen) = (0.0, 0.0, 0.0);
            for i in 0..n {
                let u = point(i);
                let half_vector = sample_ggx(to_viewer, width, u.xy());
                let to_light = reflected_by(to_viewer, half_vector);
                if to_light.z > 0.0 {
                    let value = evaluate_reflection(to_viewer, to_light, half_vector, width);
                    let weight = value / (0.25 * ggx_visible_pdf(to_viewer, half_vector, width));
                    whole += weight / n as f32;
                    grazing += weight * (1.0 - to_viewer.dot(half_vector)).powi(5) / n as f32;
                }
                let to_light = sample_sheen(u.xy());
                sheen += evaluate_sheen(to_viewer, to_light, roughness.max(LEAST_SHEEN_ROUGHNESS)) * TAU / n as f32;
            }
            let found = ggx_albedo(cosine, roughness);
            assert!((1.0 - found.loss - whole).abs() < 0.006, "{roughness}, {cosine}: {found:?} {whole}");
            assert!((found.grazing - grazing).abs() < 0.02, "{roughness}, {cosine}: {found:?} {grazing}");
            let found = sheen_albedo(cosine, roughness.max(LEAST_SHEEN_ROUGHNESS));
            assert!((found - sheen).abs() < 0.04, "{roughness}, {cosine}: {found} {sheen}");
        }
        let n = 1000;
        let cosines = (0..n).map(|i| (i as f32 + 0.5) / n as f32);
        let (loss, grazing) = cosines.fold((0.0, 0.0), |(loss, grazing), cosine| {
            let (albedo, weight) = (ggx_albedo(cosine, roughness), 2.0 * cosine / n as f32);
            (loss + weight * albedo.loss, grazing + weight * albedo.grazing)
        });
        let mean = mean_ggx_albedo(roughness);
        assert!((mean.loss - loss).abs() < 0.001, "{roughness}: {mean:?} {loss}");
        assert!((mean.grazing - grazing).abs() < 0.002, "{roughness}: {mean:?} {grazing}");
    }
}

/// GLSL and Rust have the same polynomials.
#[test]
fn the_twin_has_the_same_coefficients() {
    let numbers = |text: &str| {
        let words = text.split(|c: char| !(c.is_ascii_digit() || "+-.e".contains(c)));
        let numbers = words.filter(|word| word.matches('.').count() == 1 && word.len() > 7);
        numbers.map(|word| word.parse::<f32>().expect("a number")).collect::<Vec<_>>()
    };
    let of_glsl = numbers(include_str!("../../../glsl/shared/bsdf/albedo.glsl"));
    assert_eq!(of_glsl, numbers(include_str!("albedo.rs")));
    assert!(of_glsl.len() > 110, "{}", of_glsl.len());
}

/// A metal without extinction is a dielectric. Gold's reflectance along the normal has a closed form.
#[test]
fn conductors_reflect_as_the_closed_forms_say() {
    for cosine in [0.05, 0.3, 0.7, 1.0] {
        let found = conductor_reflectance(cosine, Vec3::splat(1.5), Vec3::ZERO).x;
        let expected = fresnel(cosine, refraction_cosine(cosine, 1.0 / 1.5), 1.0 / 1.5);
        assert!((found - expected).abs() < 1e-5, "{cosine}: {found} {expected}");
    }
    let (eta, k) = (vec3(0.18, 0.42, 1.37), vec3(3.42, 2.35, 1.77));
    let expected = ((eta - 1.0) * (eta - 1.0) + k * k) / ((eta + 1.0) * (eta + 1.0) + k * k);
    assert!((conductor_reflectance(1.0, eta, k) - expected).abs().max_element() < 1e-5);
    assert!((conductor_reflectance(0.0, eta, k) - 1.0).abs().max_element() < 1e-5);
}

/// Smooth surfaces send light where the laws of reflection and refraction say.
#[test]
fn smooth_surfaces_reflect_and_refract_exactly() {
    let to_viewer = view(0.6);
    let mirrored = vec3(-to_viewer.x, -to_viewer.y, to_viewer.z);
    let mirror = sample_bsdf(&metal(0.0), &flat(false), to_viewer, point(3));
    assert!(mirror.is_delta && (mirror.direction - mirrored).length() < 1e-5, "{mirror:?}");
    assert!((mirror.weight - 1.0).abs().max_element() < 1e-5, "{mirror:?}");
    let glass = sample_bsdf(&glass(0.0, 1.5), &flat(false), to_viewer, vec3(0.5, 0.5, 0.999));
    let sine = (1.0 - glass.direction.z * glass.direction.z).sqrt();
    assert!(glass.is_delta && glass.direction.z < 0.0 && (sine * 1.5 - 0.8).abs() < 1e-5, "{glass:?}");
    assert!((glass.weight - 1.0 / 2.25).abs().max_element() < 1e-5, "{glass:?}");
    let sheet = sample_bsdf(&sheet(0.0), &flat(false), to_viewer, vec3(0.5, 0.5, 0.999));
    assert!(sheet.is_delta && (sheet.direction + to_viewer).length() < 1e-5, "{sheet:?}");
    assert!(is_smooth(&metal(0.0)) && is_smooth(&self::glass(0.02, 1.5)) && !is_smooth(&white(0.0)));
    assert!(!is_smooth(&metal(0.1)) && is_smooth(&with_flag(white(1.0), MATERIAL_UNLIT)));
}

/// Light from a direction that is on one side of the triangle and on the other of the shading normal is not scattered.
#[test]
fn inconsistent_sides_carry_nothing() {
    let surface = bent(vec3(0.7, 0.0, 0.7).normalize(), false);
    let (above, below) = (vec3(-0.9, 0.1, 0.3).normalize(), vec3(0.9, 0.1, -0.3).normalize());
    for material in rough_materials() {
        for direction in [above, below] {
            assert_eq!(evaluate_bsdf(&material, &surface, Vec3::Z, direction), Vec3::ZERO, "{material:?}");
            assert_eq!(bsdf_pdf(&material, &surface, Vec3::Z, direction), 0.0, "{material:?}");
        }
    }
}

/// Nothing is NaN or infinite, and nothing negative, for the extremes of all terms.
#[test]
fn extremes_give_finite_numbers() {
    let edge = 0.999_999_94;
    let us = [Vec3::ZERO, Vec3::splat(edge), vec3(0.0, edge, 0.5), vec3(edge, 0.0, 0.9), vec3(0.3, 0.6, 0.2)];
    let mut materials = Vec::new();
    for roughness in [0.0, 0.031, 0.032, 0.5, 1.0] {
        for ni in [0.001, 0.5, 1.0, 1.009, 1.011, 1.5, 100.0] {
            for colour in [0.0, 1.0] {
                let base = Material { ni, kd: Vec3::splat(colour), ..white(roughness) };
                let clear = Material { transmission: 1.0, ..base };
                let layered = Material { clearcoat: 1.0, sheen_colour: Vec3::splat(colour), ..base };
                materials.extend([base, clear, with_flag(clear, SOLID), layered]);
                materials.push(Material { metallic: 1.0, ks: Vec3::ZERO, ..base });
            }
        }
    }
    let tangent = vec3(1.0, 0.0, 0.0);
    let directions = [Vec3::Z, -Vec3::Z, tangent, view(1e-5), -view(1e-5), view(0.5), vec3(-0.6, -0.8, -1e-6)];
    for material in &materials {
        for surface in [flat(false), flat(true), bent(tangent, false), mapped(), seen_from_behind()] {
            for to_viewer in [Vec3::Z, tangent, view(1e-5), view(0.5)] {
                for u in us {
                    let sample = sample_bsdf(material, &surface, to_viewer, u);
                    let is_right = sample.weight.is_finite() && sample.weight.min_element() >= 0.0;
                    assert!(is_right && sample.pdf.is_finite(), "{sample:?} at {to_viewer} for {material:?}");
                    assert!((sample.direction.length() - 1.0).abs() < 1e-3, "{sample:?} for {material:?}");
                }
                for direction in directions {
                    let value = evaluate_bsdf(material, &surface, to_viewer, direction);
                    let pdf = bsdf_pdf(material, &surface, to_viewer, direction);
                    let is_right = value.is_finite() && value.min_element() >= 0.0 && pdf >= 0.0;
                    assert!(is_right && pdf.is_finite(), "{value} {pdf} {direction} {material:?}");
                }
            }
        }
    }
}

/// Without an interface, its terms are left out. The result is what they give if the interface reflects next to
/// nothing.
#[test]
fn a_surface_without_an_interface_is_the_limit_of_one_with_it() {
    let surface = flat(false);
    for (clearcoat, sheen) in [(0.0, 0.0), (0.7, 0.0), (0.0, 0.4)] {
        let without = Material {
            ks: Vec3::ZERO,
            kd: vec3(0.7, 0.4, 0.1),
            clearcoat,
            sheen_colour: Vec3::splat(sheen),
            ..white(0.5)
        };
        let with = Material { ks: Vec3::splat(1.0e-30), ..without };
        assert_ne!(
            bsdf_terms(&mut without.clone(), &surface, Vec3::Z).has_interface,
            bsdf_terms(&mut with.clone(), &surface, Vec3::Z).has_interface
        );
        for i in 0..64 {
            let (to_viewer, u) = (view(0.1 + 0.8 * point(i).x), point(i + 64));
            let [a, b] = [&without, &with].map(|material| sample_bsdf(material, &surface, to_viewer, u));
            assert!((a.weight - b.weight).abs().max_element() < 1.0e-6, "{a:?} {b:?}");
            assert!((a.pdf - b.pdf).abs() < 1.0e-6 && (a.direction - b.direction).length() < 1.0e-6);
        }
    }
}
