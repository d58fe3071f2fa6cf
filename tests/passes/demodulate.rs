//! Tests of the kernel demodulate against its twin, and against known variances.

use glam::{Vec3, vec3};
use kdray::{frame::Denoise, layout::Auxiliary, reference};

use super::{path_stage::PathStage, stage::UNTOUCHED_PIXEL};
use crate::support::{compare, random::Random, scenes};

pub const N_PIXELS: usize = 1200;

/// Returns a stage of 40 x 30 pixels with the filter, whose pictures have this number of samples.
pub fn edge_stage(n_samples: u32) -> PathStage {
    let mut scene = scenes::empty();
    scenes::add(&mut scene, Vec::new(), scenes::BLACK);
    let mut stage = PathStage::with_filter(scene, 0, Denoise::Edge);
    stage.set_n_earlier(n_samples - 1);
    stage
}

/// The auxiliary buffers of a pixel that shows a plane across the view, one unit for each pixel, of one albedo.
pub fn flat(pixel_ix: usize, albedo: f32) -> Auxiliary {
    Auxiliary {
        position_world: vec3((pixel_ix % 40) as f32, (pixel_ix / 40) as f32, 0.0),
        n_hits: 1,
        normal_world: Vec3::Z,
        albedo: Vec3::splat(albedo),
        n_samples: 1,
        ..Auxiliary::default()
    }
}

/// Auxiliary buffers of two planes that meet, of several albedos, with pixels among them that show no surface.
pub fn mixed_aux(random: &mut Random) -> Vec<Auxiliary> {
    let mut aux = |pixel_ix: usize| {
        let is_left = pixel_ix % 40 < 20;
        let albedo = if random.below(9) == 0 { Vec3::ZERO } else { random.in_box(Vec3::splat(0.1), Vec3::ONE) };
        Auxiliary {
            normal_world: if is_left { Vec3::Z } else { vec3(0.6, 0.0, 0.8) } + 0.05 * random.direction(),
            n_hits: if random.below(20) == 0 { 0 } else { 3 },
            albedo,
            seen: if random.below(5) == 0 { random.in_box(Vec3::ZERO, Vec3::splat(0.2)) } else { Vec3::ZERO },
            n_samples: 3,
            ..flat(pixel_ix, 1.0)
        }
    };
    (0..N_PIXELS).map(&mut aux).collect()
}

fn demodulated(stage: &PathStage, radiance: &[[f32; 4]], aux: &[Auxiliary]) -> Vec<[f32; 4]> {
    let pixels = &stage.resources.pixels;
    pixels.pixel_radiance.upload(radiance).expect("pixel_radiance");
    pixels.pixel_aux.upload(aux).expect("pixel_aux");
    pixels.filtered().upload(&[UNTOUCHED_PIXEL; 2 * N_PIXELS]).expect("pixel_filtered");
    stage.run(|commands| stage.passes.edge.demodulate.record(commands, &stage.resources));
    pixels.filtered().download().expect("pixel_filtered")
}

#[test]
fn agrees_with_its_twin() {
    for n_samples in [1, 2, 16] {
        let stage = edge_stage(n_samples);
        let mut random = Random(n_samples.into());
        let aux = mixed_aux(&mut random);
        let mut pixel = |_| {
            let radiance = random.in_box(Vec3::ZERO, Vec3::ONE);
            radiance.extend(2.0 * reference::noise::squared_luminance(radiance)).to_array()
        };
        let radiance: Vec<_> = (0..N_PIXELS).map(&mut pixel).collect();
        let mut expected = vec![UNTOUCHED_PIXEL; 2 * N_PIXELS];
        reference::demodulate::demodulate(stage.frame(), &radiance, &aux, &mut expected);
        compare::pixels(1e-4, 0, &expected, &demodulated(&stage, &radiance, &aux)).unwrap();
    }
}

/// A pixel of albedo 1/2 has twice the light, and four times the variance, whether its samples show it or the pixels
/// around.
#[test]
fn noise_has_its_variance() {
    let aux: Vec<_> = (0..N_PIXELS).map(|pixel_ix| flat(pixel_ix, 0.5)).collect();
    // A chessboard of 0.4 and 0.6, whose variance is 0.01.
    let board = |pixel_ix: usize| if (pixel_ix % 40 + pixel_ix / 40).is_multiple_of(2) { 0.4 } else { 0.6 };
    let radiance: Vec<[f32; 4]> =
        (0..N_PIXELS).map(|pixel_ix| [board(pixel_ix); 3]).map(|[r, g, b]| [r, g, b, r * r]).collect();
    let found = demodulated(&edge_stage(1), &radiance, &aux);
    assert_eq!(found[..N_PIXELS], [UNTOUCHED_PIXEL; N_PIXELS], "the first half");
    for (pixel, light) in radiance.iter().zip(&found[N_PIXELS..]) {
        assert!((light[0] - 2.0 * pixel[0]).abs() < 1e-6 && (light[3] / 0.04 - 1.0).abs() < 0.02, "{light:?}");
    }
    // Four samples of 0.5 with the variance 0.03 between them: the variance of their mean is 0.03 / 4 * 4 / 3.
    let samples = [[0.5, 0.5, 0.5, 0.25 + 0.03]; N_PIXELS];
    for light in &demodulated(&edge_stage(4), &samples, &aux)[N_PIXELS..] {
        assert!((light[0] - 1.0).abs() < 1e-6 && (light[3] - 0.04).abs() < 1e-5, "{light:?}");
    }
}
