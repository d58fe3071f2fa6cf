//! Tests of the kernel atrous_filter against its twin, and closed forms of the whole filter.

use glam::Vec3;
use kdray::{
    layout::{AtrousIteration, Auxiliary, N_ATROUS_ITERATIONS},
    reference,
};

use super::{
    demodulate::{N_PIXELS, edge_stage, flat, mixed_aux},
    path_stage::PathStage,
};
use crate::support::{compare, random::Random};

/// Takes the iterations of the filter that are in the range.
fn filtered(
    stage: &PathStage,
    iterations: std::ops::Range<u32>,
    aux: &[Auxiliary],
    light: &[[f32; 4]],
) -> Vec<[f32; 4]> {
    let pixels = &stage.resources.pixels;
    pixels.pixel_aux.upload(aux).expect("pixel_aux");
    pixels.filtered().upload(light).expect("pixel_filtered");
    for iteration_ix in iterations {
        stage.run(|commands| stage.passes.edge.atrous_filter.record(commands, &stage.resources, iteration_ix));
    }
    pixels.filtered().download().expect("pixel_filtered")
}

/// Runs the whole filter over light whose luminance has the variance `variance`. Returns the radiance.
fn whole(aux: &[Auxiliary], light: impl Fn(usize) -> f32, variance: f32) -> Vec<f32> {
    let halves = |pixel_ix: usize| {
        let light = light(pixel_ix % N_PIXELS);
        [light, light, light, variance]
    };
    let light: Vec<_> = (0..2 * N_PIXELS).map(halves).collect();
    let found = filtered(&edge_stage(1), 0..N_ATROUS_ITERATIONS, aux, &light);
    found[..N_PIXELS].iter().map(|pixel| pixel[0]).collect()
}

fn plane(albedo: f32) -> Vec<Auxiliary> {
    (0..N_PIXELS).map(|pixel_ix| flat(pixel_ix, albedo)).collect()
}

#[test]
fn agrees_with_its_twin() {
    let stage = edge_stage(1);
    let mut random = Random(3);
    let aux = mixed_aux(&mut random);
    let mut pixel = |_| random.in_box(Vec3::ZERO, Vec3::ONE).extend(random.between(0.0, 0.2)).to_array();
    let light: Vec<_> = (0..2 * N_PIXELS).map(&mut pixel).collect();
    for iteration_ix in 0..N_ATROUS_ITERATIONS {
        let mut expected = light.clone();
        reference::atrous_filter::atrous_filter(stage.frame(), &AtrousIteration { iteration_ix }, &aux, &mut expected);
        assert_ne!(expected, light);
        compare::pixels(1e-4, 0, &expected, &filtered(&stage, iteration_ix..iteration_ix + 1, &aux, &light)).unwrap();
    }
}

#[test]
fn a_constant_picture_stays_constant() {
    for variance in [0.0, 0.3] {
        let found = whole(&plane(0.5), |_| 3.0, variance);
        assert!(found.iter().all(|radiance| (radiance - 1.5).abs() < 1e-5), "{found:?}");
    }
}

/// Two walls at right angles are lit differently. No light passes from one to the other, however large the noise is.
#[test]
fn an_edge_between_surfaces_stays_sharp() {
    let is_left = |pixel_ix: usize| pixel_ix % 40 < 17;
    let mut aux = plane(1.0);
    aux.iter_mut().enumerate().filter(|(pixel_ix, _)| !is_left(*pixel_ix)).for_each(|(_, aux)| {
        aux.normal_world = Vec3::X;
        aux.position_world.z = 17.0 - aux.position_world.x;
        aux.position_world.x = 17.0;
    });
    let light = |pixel_ix| if is_left(pixel_ix) { 1.0 } else { 0.1 };
    for (pixel_ix, radiance) in whole(&aux, light, 100.0).into_iter().enumerate() {
        assert!((radiance - light(pixel_ix)).abs() < 1e-3, "pixel {pixel_ix}: {radiance}");
    }
}

/// Shadows are edges, too, where the light is known well.
#[test]
fn an_edge_of_light_stays_if_there_is_no_noise() {
    let light = |pixel_ix: usize| if pixel_ix % 40 < 17 { 1.0 } else { 0.1 };
    for (pixel_ix, radiance) in whole(&plane(1.0), light, 1e-6).into_iter().enumerate() {
        assert!((radiance - light(pixel_ix)).abs() < 1e-3, "pixel {pixel_ix}: {radiance}");
    }
}

/// An iteration that regards all differences as noise averages them with the spline's weights, which leave (35 / 128)^2
/// of the variance.
#[test]
fn a_step_reduces_noise_by_the_factor_of_its_weights() {
    let stage = edge_stage(1);
    let mut random = Random(11);
    let mut pixel = |_| {
        let light = 1.0 + random.between(-0.1, 0.1);
        [light, light, light, 1e6]
    };
    let light: Vec<_> = (0..2 * N_PIXELS).map(&mut pixel).collect();
    let found = filtered(&stage, 0..1, &plane(1.0), &light);
    // Pixels whose square is within the picture.
    let inner = || (2..28).flat_map(|y| (2..38).map(move |x| 40 * y + x));
    let variance = |pixels: &[[f32; 4]]| {
        inner().map(|pixel_ix| (pixels[pixel_ix][0] - 1.0).powi(2)).sum::<f32>() / inner().count() as f32
    };
    let factor = (35.0_f32 / 128.0).powi(2);
    let found_factor = variance(&found[..N_PIXELS]) / variance(&light[N_PIXELS..]);
    assert!((found_factor / factor - 1.0).abs() < 0.3, "{found_factor}, not {factor}");
    assert!(inner().all(|pixel_ix| (found[pixel_ix][3] / 1e6 / factor - 1.0).abs() < 0.01));
}

/// A pixel on an edge, whose samples are on both sides, is blurred with both sides.
#[test]
fn a_pixel_of_two_surfaces_gets_light_from_both() {
    let mut aux = plane(1.0);
    let at = |pixel_ix: usize| pixel_ix % 40;
    for (pixel_ix, aux) in aux.iter_mut().enumerate().filter(|(pixel_ix, _)| at(*pixel_ix) >= 17) {
        let is_edge = at(pixel_ix) == 17;
        aux.normal_world = if is_edge { 0.5 * (Vec3::X + Vec3::Z) } else { Vec3::X };
        aux.position_world.z = 17.0 - aux.position_world.x;
        aux.position_world.x = 17.0;
    }
    // The samples of one pixel on the edge were dark by chance.
    let dark = 15 * 40 + 17;
    let light = |pixel_ix| if pixel_ix == dark { 0.0 } else { 1.0 };
    assert!((whole(&aux, light, 1.0)[dark] - 1.0).abs() < 0.2);
    let mut apart = aux;
    apart[dark].normal_world = Vec3::Y;
    assert!(whole(&apart, light, 1.0)[dark] < 0.2, "a surface of its own");
}
