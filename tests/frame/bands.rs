//! Tests that a picture rendered in bands has the same bits as one rendered at once. The devices here overrides to bind
//! only little memory, so that even small pictures need bands.

use std::sync::Arc;

use glam::{Vec3, vec3};
use kdray::{
    frame::{BounceStats, Crop, Denoise, Goal, Picture, Primary, RenderOptions},
    gpu::{Context, DeviceOverrides, GpuError},
    layout::PixelAovs,
    render::{BandedRenderer, GpuRenderer},
    scene::{Camera, Projection},
    world::FlatScene,
};

use super::studio::{assert_silent, device, identical, options, world_of};
use crate::support::{meshes, pretended, scenes};

/// Size of a row of 64 pixels without AOVs, in bytes.
const ROW: u64 = 64 * 16;
const ELSEWHERE: Camera = Camera {
    eye: vec3(1.5, 0.5, 3.5),
    target: vec3(0.0, -0.2, 0.0),
    up: Vec3::Y,
    projection: Projection::Perspective { vertical_fov_degrees: 60.0 },
};
const FILTER: Denoise = Denoise::Paper { threshold: 0.1 };

/// Returns a device that binds at most 24 rows of 64 pixels.
fn small_device() -> Arc<Context> {
    pretended(DeviceOverrides { storage_range: Some(24 * ROW), ..DeviceOverrides::default() })
}

/// Returns a scene with mirrors but without glass. Its rays do not branch, so that a batch has enough pixels even on
/// a device that binds little.
fn scene() -> FlatScene {
    let mut scene = scenes::empty();
    scenes::add(&mut scene, scenes::room(5.0), scenes::diffuse(vec3(0.7, 0.6, 0.5)));
    let torus = meshes::placed(meshes::torus(12, 8), 1.3, vec3(0.1, -0.6, 0.0));
    scenes::add(&mut scene, torus, scenes::glossy(vec3(0.2, 0.5, 0.3), Vec3::splat(0.5), 20.0));
    scenes::add(&mut scene, scenes::smooth_sphere(5, 0.9, vec3(-1.0, 0.8, 0.3)), scenes::mirror(Vec3::splat(0.9)));
    scene.lights = vec![scenes::point_light(vec3(2.0, 3.5, 3.0), vec3(9.0, 8.0, 7.0))];
    scene.ambient = Vec3::splat(0.2);
    scene
}

/// A picture with its AOVs and its counts of rays.
#[derive(Clone)]
struct Made {
    picture: Picture,
    pixel_aovs: Vec<PixelAovs>,
    bounces: Vec<BounceStats>,
}

/// Renders the pictures of two cameras, each at once.
fn at_once(context: &Arc<Context>, options: &RenderOptions, n_samples: u32) -> Vec<Made> {
    let scene = scene();
    let mut renderer = GpuRenderer::new(context.clone(), &world_of(&scene), options).expect("a renderer");
    let made = [scene.camera, ELSEWHERE].map(|camera| {
        renderer.set_camera(&camera);
        let mut profile = renderer.draw_sample().expect("a sample");
        let pixel_aovs = if options.pixel_aovs { renderer.pixel_aovs().expect("pixel_aovs") } else { Vec::new() };
        (1..n_samples).for_each(|_| profile.add(&renderer.draw_sample().expect("a sample")));
        Made { picture: renderer.picture().expect("a picture"), pixel_aovs, bounces: profile.bounces }
    });
    made.to_vec()
}

/// Renders the same pictures in bands. Returns them and the number of bands. Asserts that the callback is called for
/// each sample of each band.
fn in_bands(context: &Arc<Context>, options: &RenderOptions, n_samples: u32) -> (Vec<Made>, u32) {
    let scene = scene();
    let mut renderer = BandedRenderer::new(context.clone(), &world_of(&scene), options).expect("a renderer");
    let n_bands = renderer.n_bands();
    let made = [scene.camera, ELSEWHERE].map(|camera| {
        renderer.set_camera(&camera);
        let mut n_told = 0;
        let drawn = renderer.draw(Goal::Samples(n_samples), &mut || n_told += 1).expect("a drawing");
        assert_eq!(n_told, n_samples * n_bands);
        let n_batches = drawn.profile.passes.iter().filter_map(|pass| pass.batch).max().map_or(0, |batch| batch + 1);
        assert_eq!(drawn.profile.n_batches, n_batches);
        let picture = renderer.picture().expect("a picture").into_owned();
        Made { picture, pixel_aovs: drawn.pixel_aovs, bounces: drawn.profile.bounces }
    });
    (made.to_vec(), n_bands)
}

/// Returns whether the picture and the AOVs agree in every bit.
fn agree(a: &Made, b: &Made) -> bool {
    identical(&a.picture, &b.picture)
        && bytemuck::cast_slice::<_, u8>(&a.pixel_aovs) == bytemuck::cast_slice::<_, u8>(&b.pixel_aovs)
}

fn assert_same_bits(options: &RenderOptions, n_samples: u32, least_bands: u32) {
    let (large, small) = (device(), small_device());
    let expected = at_once(&large, options, n_samples);
    let (found, n_bands) = in_bands(&small, options, n_samples);
    assert!(n_bands >= least_bands, "{options:?}: {n_bands} bands");
    for (found, expected) in found.iter().zip(&expected) {
        assert!(agree(found, expected), "{options:?}");
        // With the filter, the margins of bands are drawn twice, so that the counts differ.
        assert!(options.denoise != Denoise::Off || found.bounces == expected.bounces, "{options:?}");
    }
    assert!(!agree(&found[0], &found[1]), "the cameras see different pictures");
    assert_silent(&large);
    assert_silent(&small);
}

#[test]
fn every_way_of_primary_rays() {
    for primary in [Primary::Raster, Primary::Trace, Primary::SoftwareRaster] {
        if primary == Primary::SoftwareRaster && !device().has_int64_atomics() {
            continue;
        }
        assert_same_bits(&RenderOptions { primary, ..options(64, 48, 2) }, 1, 2);
    }
}

#[test]
fn the_noise_filter_sees_beyond_a_band() {
    let filtered = RenderOptions { denoise: FILTER, ..options(64, 48, 2) };
    assert_same_bits(&filtered, 1, 3);
    // Without the filter, the picture differs.
    let scene = scene();
    let draw = |options: &RenderOptions| {
        let mut renderer = GpuRenderer::new(device(), &world_of(&scene), options).expect("a renderer");
        renderer.render().expect("a frame").0
    };
    assert!(!identical(&draw(&filtered), &draw(&options(64, 48, 2))));
}

#[test]
fn several_samples_and_aovs() {
    let pixel_aovs = RenderOptions { pixel_aovs: true, ..options(64, 48, 2) };
    assert_same_bits(&pixel_aovs, 1, 8);
    assert_same_bits(&RenderOptions { denoise: FILTER, ..pixel_aovs }, 3, 8);
    assert_same_bits(&options(64, 48, 2), 3, 2);
}

#[test]
fn a_part_of_a_picture() {
    let crop = Some(Crop { x0: 3, y0: 5, x1: 64, y1: 47 });
    assert_same_bits(&RenderOptions { crop, ..options(64, 48, 2) }, 1, 2);
    assert_same_bits(&RenderOptions { crop, denoise: FILTER, ..options(64, 48, 2) }, 2, 2);
}

#[test]
fn a_device_that_holds_all_pixels_draws_one_band() {
    let (made, n_bands) = in_bands(&device(), &options(64, 48, 2), 2);
    assert_eq!(n_bands, 1);
    assert!(made.iter().zip(&at_once(&device(), &options(64, 48, 2), 2)).all(|(a, b)| agree(a, b)));
}

/// The small device must refuse the picture at once; otherwise the tests with it would prove nothing.
#[test]
fn the_small_device_refuses_the_picture_at_once() {
    let scene = scene();
    let refused = GpuRenderer::new(small_device(), &world_of(&scene), &options(64, 48, 2)).err();
    assert!(matches!(refused, Some(GpuError::TooLarge { .. })), "{refused:?}");
}

#[test]
fn one_changed_pixel_or_aovs_is_noticed() {
    let options = RenderOptions { pixel_aovs: true, ..options(64, 48, 2) };
    let made = at_once(&device(), &options, 1).remove(0);
    let mut changed = made.clone();
    changed.pixel_aovs[64 * 30 + 7].n_steps += 1;
    assert!(agree(&made, &made) && !agree(&made, &changed));
}
