//! Tests of frames with textures, cut-outs and microfacets: against closed forms, and device against CPU.

use std::{f64::consts::PI, path::Path};

use glam::{DQuat, DVec3, Vec2, Vec3, Vec4, vec2, vec3};
use half::f16;
use kdray::{
    accel::kdtree::Traversal,
    cpu,
    frame::{BounceStats, Picture, Primary, RenderOptions},
    render::GpuRenderer,
    scene::{
        Alpha, Camera, Channel, Image, Light, Lobes, Maps, Material, Microfacet, Pixels, Projection, Scene, Texture,
        Transform, Wrap,
    },
    world::FlatScene,
};

use super::studio::{assert_silent, device, differing, identical, on_both, on_cpu, on_device, options, world_of};
use crate::support::{
    grid_worlds, scenes,
    textured::{self, add, add_image, empty, placed, square, unlit},
};

/// Half the side of what the camera at z = 4 sees at z = 0, for a picture that is as wide as high.
const HALF_VIEW: f64 = 4.0 * 0.414_213_56;

/// A camera that sees the same at z = 0 from so far away that all its rays are almost parallel.
fn far_camera() -> Camera {
    let camera = Camera { projection: Projection::Perspective { vertical_fov_degrees: 1.0 }, ..empty().camera };
    Camera { eye: vec3(0.0, 0.0, 2.0 * HALF_VIEW as f32 / camera.height_at(1.0)), ..camera }
}

/// A scene of one unlit square that fills the view.
fn poster(is_far: bool, texture: impl FnOnce(&mut Scene) -> Texture) -> FlatScene {
    let mut scene = empty();
    let texture = texture(&mut scene);
    add(&mut scene, square(), placed(HALF_VIEW, DVec3::ZERO), unlit(Vec3::ONE, Some(texture)));
    if is_far {
        scene.camera = far_camera();
    }
    flat(&scene)
}

fn flat(scene: &Scene) -> FlatScene {
    FlatScene::new(scene).expect("a scene that fits together")
}

fn linear(byte: u8) -> f32 {
    let encoded = f32::from(byte) / 255.0;
    if encoded <= 0.04045 { encoded / 12.92 } else { ((encoded + 0.055) / 1.055).powf(2.4) }
}

fn rgb(picture: &Picture, x: u32, y: u32) -> Vec3 {
    Vec4::from_array(picture.radiance[(y * picture.width + x) as usize]).truncate()
}

/// Each pixel's centre falls on the centre of a texel, so it shows that texel: by each kind of primary visibility.
#[test]
fn a_pixel_shows_its_texel() {
    let colour = |x: u32, y: u32| [(16 * x) as u8, (16 * y) as u8, (x * y) as u8, 255];
    for is_smooth in [false, true] {
        let image = |scene: &mut Scene| add_image(scene, [16, 16], colour);
        let scene = poster(true, |scene| Texture { is_smooth, ..Texture::of_image(image(scene)) });
        for primary in [Primary::Raster, Primary::Trace] {
            for picture in on_both(&scene, &RenderOptions { primary, ..options(16, 16, 1) }) {
                for (x, y) in (0..256).map(|i| (i % 16, i / 16)) {
                    let [r, g, b, _] = colour(x, y).map(linear);
                    let off = (rgb(&picture, x, y) - vec3(r, g, b)).abs().max_element();
                    assert!(off < 1.0 / 255.0, "{x}, {y}: {}, not {:?}", rgb(&picture, x, y), colour(x, y));
                }
            }
        }
    }
}

/// To an orthographic camera, a pixel of 4 x 4 texels shows their mean from any distance, also in a mirror.
#[test]
fn a_pixel_shows_the_mean_of_its_texels_at_any_distance() {
    let colour = |x: u32, y: u32| [(4 * x) as u8, (4 * y) as u8, (x * y % 256) as u8, 255];
    let mean = |x: u32, y: u32| {
        let texel = |i: u32| colour(4 * x + i % 4, 4 * y + i / 4).map(linear);
        (0..16).map(texel).map(|[r, g, b, _]| vec3(r, g, b)).sum::<Vec3>() / 16.0
    };
    let seen_from = |eye: Vec3, target: Vec3| {
        let mut scene = empty();
        let texture = Texture::of_image(add_image(&mut scene, [64, 64], colour));
        add(&mut scene, square(), placed(HALF_VIEW, DVec3::ZERO), unlit(Vec3::ONE, Some(texture)));
        let lobes = Lobes { reflection: true, ..Lobes::default() };
        let mirror = Material { kd: Vec3::ZERO, ks: Vec3::ONE, lobes, ..Material::default() };
        let turned = Transform::new(DVec3::splat(9.0), DQuat::from_rotation_y(std::f64::consts::PI), DVec3::Z * 50.0);
        add(&mut scene, square(), turned.expect("a transform"), mirror);
        let projection = Projection::Orthographic { height: 2.0 * HALF_VIEW as f32 };
        scene.camera = Camera { eye, target, projection, ..scene.camera };
        flat(&scene)
    };
    let [near, far] = [1.0, 49.0].map(|z| seen_from(Vec3::Z * z, Vec3::ZERO));
    // The camera looks away from the poster, at the mirror.
    let mirrored = seen_from(Vec3::Z * 2.0, Vec3::Z * 50.0);
    for (scene, is_mirrored) in [(near, false), (far, false), (mirrored, true)] {
        for picture in on_both(&scene, &options(16, 16, 2)) {
            for (x, y) in (0..256).map(|i| (i % 16, i / 16)) {
                let expected = if is_mirrored { mean(15 - x, y) } else { mean(x, y) };
                let off = (rgb(&picture, x, y) - expected).abs().max_element();
                // Each of two levels is rounded to bytes.
                assert!(off < 2.0 / 255.0, "{x}, {y}: {}, not {expected}", rgb(&picture, x, y));
            }
        }
    }
}

/// From afar, a fine checkerboard is grey: the mean of its colours in linear light.
#[test]
fn a_distant_checkerboard_is_the_mean_of_its_colours() {
    let check = |x: u32, y: u32| if (x + y).is_multiple_of(2) { [255; 4] } else { [0, 0, 0, 255] };
    // Half a texel aside, pixels' centres are not where four texels meet, whose mean is grey at every level.
    let aside = Vec2::splat(0.5 / 256.0);
    let scene = poster(false, |scene| Texture::of_image(add_image(scene, [256, 256], check)).placed(Vec2::ONE, aside));
    for picture in on_both(&scene, &options(16, 16, 1)) {
        assert!((0..256).all(|i| (rgb(&picture, i % 16, i / 16) - 0.5).abs().max_element() < 0.005));
    }
}

/// The level is that at which a texel is as large as a pixel. The image's columns are as wide as the texels of level 2,
/// so a picture with pixels of that size still shows them, and one with pixels of twice the size shows their mean.
#[test]
fn the_mip_level_follows_the_size_of_pixels() {
    let column = |x: u32, _: u32| if (x / 4).is_multiple_of(2) { [255; 4] } else { [0, 0, 0, 255] };
    let scene = poster(true, |scene| Texture::of_image(add_image(scene, [64, 64], column)));
    for picture in on_both(&scene, &options(16, 16, 1)) {
        assert!((0..16).all(|x| (rgb(&picture, x, 8).x - if x % 2 == 0 { 1.0 } else { 0.0 }).abs() < 0.02));
    }
    // Half a column aside, the centre of each of the larger pixels lies in the middle of a column.
    let scene = poster(true, |scene| {
        Texture::of_image(add_image(scene, [64, 64], column)).placed(Vec2::ONE, vec2(2.0 / 64.0, 0.0))
    });
    for picture in on_both(&scene, &options(8, 8, 1)) {
        assert!((0..8).all(|x| (rgb(&picture, x, 4).x - 0.5).abs() < 0.02));
    }
}

#[test]
fn images_wrap_as_the_texture_says() {
    let colours = [40_u8, 200];
    for (wrap, expected) in
        [(Wrap::Repeat, [40, 200, 40, 200]), (Wrap::Mirror, [200, 40, 40, 200]), (Wrap::Clamp, [40, 40, 40, 200])]
    {
        let scene = poster(true, |scene| {
            let image = add_image(scene, [2, 1], |x, _| [colours[x as usize], 0, 0, 255]);
            // Two texels fill half of the square, from its middle to the right.
            let texture = Texture { wrap: [wrap; 2], is_smooth: false, ..Texture::of_image(image) };
            texture.placed(vec2(2.0, 1.0), vec2(-1.0, 0.0))
        });
        for picture in on_both(&scene, &options(4, 4, 1)) {
            let found = [0, 1, 2, 3].map(|x| rgb(&picture, x, 1).x);
            assert!((0..4).all(|x| (found[x] - linear(expected[x])).abs() < 0.01), "{wrap:?}: {found:?}");
        }
    }
}

/// A red sheet with a hole in front of a white wall, lit from the front. Through the hole, the wall is seen and lit.
pub(super) fn holed_sheet() -> Scene {
    let mut scene = empty();
    let image = add_image(&mut scene, [8, 8], |x, y| {
        let is_hole = (2..6).contains(&x) && (2..6).contains(&y);
        [255, 0, 0, if is_hole { 0 } else { 255 }]
    });
    let texture = Texture { is_smooth: false, ..Texture::of_image(image) };
    let maps = Maps { base_colour: Some(texture), ..Maps::default() };
    let sheet = Material { alpha: Alpha::Mask(0.5), maps, ..textured::rough(Vec3::ONE) };
    add(&mut scene, square(), placed(1.0, DVec3::new(0.0, 0.0, 0.5)), sheet);
    add(&mut scene, square(), placed(3.0, DVec3::new(0.0, 0.0, -0.5)), textured::rough(Vec3::ONE));
    scene.lights = vec![Light::Directional { towards: Vec3::Z, irradiance: Vec3::ONE }];
    scene
}

/// All ways of seeing agree on the hole: rasterization, kernels that rasterize, and every traversal, on device and CPU.
/// Rays to the light pass through it, too.
#[test]
fn a_hole_is_seen_through_and_lit_through_in_every_way() {
    let scene = flat(&holed_sheet());
    let traced = RenderOptions { primary: Primary::Trace, ..options(32, 32, 2) };
    let expected = on_cpu(&scene, &traced);
    let middle = rgb(&expected, 16, 16);
    assert!(middle.min_element() > 0.8, "the wall is lit through the hole: {middle}");
    assert!(rgb(&expected, 8, 16).y < 0.1 && rgb(&expected, 8, 16).x > 0.5, "{}", rgb(&expected, 8, 16));
    // The sheet shadows the wall beside the lit part, which the hole shows a little of.
    assert!(rgb(&expected, 11, 16).max_element() < 0.05, "{}", rgb(&expected, 11, 16));
    for &traversal in Traversal::ALL {
        let picture = on_cpu(&scene, &RenderOptions { traversal, ..traced.clone() });
        assert_eq!(differing(&expected, &picture, 0.0), [0usize; 0], "{traversal}");
    }
    for traversal in [Traversal::Mask, Traversal::Ropes, Traversal::Brute] {
        for (way, picture) in
            ["device", "CPU"].iter().zip(on_both(&scene, &RenderOptions { traversal, ..traced.clone() }))
        {
            assert_eq!(differing(&expected, &picture, 1e-4), [0usize; 0], "{way}, {traversal}");
        }
    }
    for world in grid_worlds(&scene) {
        let context = device();
        let mut renderer = GpuRenderer::new(context.clone(), &world, &traced).expect("a renderer");
        let pictures = [renderer.render().expect("a frame").0, cpu::render(&world, &traced).0];
        assert_silent(&context);
        for picture in pictures {
            assert_eq!(differing(&expected, &picture, 1e-4), [0usize; 0], "{}", world.accel().kind());
        }
    }
    let raster = on_device(&scene, &RenderOptions { primary: Primary::Raster, ..traced.clone() });
    assert!(differing(&expected, &raster, 1e-4).len() <= 40, "only pixels on outlines differ");
    assert!((rgb(&raster, 16, 16) - middle).abs().max_element() < 1e-4);
    if device().has_int64_atomics() {
        let compute = on_device(&scene, &RenderOptions { primary: Primary::SoftwareRaster, ..traced.clone() });
        assert!(identical(&compute, &on_device(&scene, &traced)));
    }
}

#[test]
fn without_its_cutoff_the_sheet_has_no_hole() {
    let mut scene = holed_sheet();
    scene.materials[0].alpha = Alpha::Opaque;
    for picture in on_both(&flat(&scene), &options(32, 32, 2)) {
        assert!(rgb(&picture, 16, 16).y < 0.1);
    }
}

/// A see-through sheet weakens what is behind it by its coverage, and lets shadow rays pass below half of it. The
/// material, its texture or the mesh's corners say what the coverage is.
#[test]
fn coverage_blends_and_a_thin_veil_casts_no_shadow() {
    for (alpha, is_shadowed) in [(64, false), (191, true)] {
        let coverage = f32::from(alpha) / 255.0;
        for source in ["material", "texture", "corners"] {
            let mut scene = empty();
            let (mut sheet, mut veil) = (square(), Material { ks: Vec3::ZERO, ..textured::rough(Vec3::ZERO) });
            match source {
                "material" => veil.d = coverage,
                "texture" => {
                    let image = add_image(&mut scene, [1, 1], |_, _| [255, 255, 255, alpha]);
                    veil.maps.base_colour = Some(Texture::of_image(image));
                }
                _ => sheet.colours = vec![[Vec3::ONE.extend(coverage); 3]; 2],
            }
            add(&mut scene, sheet, placed(1.0, DVec3::new(0.0, 0.0, 0.5)), veil);
            let wall = Material { ks: Vec3::ZERO, ..textured::rough(Vec3::ONE) };
            add(&mut scene, square(), placed(3.0, DVec3::new(0.0, 0.0, -0.5)), wall);
            scene.lights = vec![Light::Directional { towards: Vec3::Z, irradiance: Vec3::ONE }];
            let expected = if is_shadowed { 0.0 } else { 1.0 - coverage };
            for picture in on_both(&flat(&scene), &options(16, 16, 3)) {
                let found = rgb(&picture, 8, 8);
                assert!((found - expected).abs().max_element() < 1e-3, "{source} {coverage}: {found}, not {expected}");
            }
        }
    }
}

/// The colour of a float image is shown however bright it is, but not where it is negative.
#[test]
fn no_colour_of_a_float_image_is_negative() {
    let pixel = [-1.0, 0.5, 2.0, 1.0].map(|value| f16::from_f32(value).to_bits());
    let scene = poster(true, |scene| {
        let (pixels, name) = (Pixels::Halves(vec![pixel]), "image".to_owned());
        scene.images.push(Image { name, width: 1, height: 1, pixels, is_linear: true });
        Texture::of_image(0)
    });
    for picture in on_both(&scene, &options(4, 4, 1)) {
        assert_eq!(rgb(&picture, 2, 2), vec3(0.0, 0.5, 2.0));
    }
}

/// Between two smooth dielectrics, each reflection leaves 4 % of the light. Rays that carry next to nothing are not
/// traced.
#[test]
fn rays_that_carry_next_to_nothing_are_dropped() {
    let mut scene = empty();
    let smooth = Microfacet { roughness: 0.0, ..Microfacet::default() };
    let plate = Material { microfacet: Some(smooth), ..textured::rough(Vec3::ONE) };
    add(&mut scene, square(), placed(9.0, DVec3::ZERO), plate.clone());
    add(&mut scene, square(), placed(9.0, DVec3::new(0.0, 0.0, 9.0)), plate);
    let (scene, options) = (flat(&scene), RenderOptions { profile: true, ..options(16, 16, 10) });
    let n_rays = |stats: &[BounceStats]| stats.iter().map(|bounce| bounce.n_rays).collect::<Vec<_>>();
    let context = device();
    let mut renderer = GpuRenderer::new(context.clone(), &world_of(&scene), &options).expect("a renderer");
    let on_device = n_rays(&renderer.render().expect("a frame").1.bounces);
    assert_silent(&context);
    assert_eq!(on_device[..3], [256; 3]);
    assert!(on_device[3..].iter().all(|&n| n == 0), "{on_device:?}");
    assert_eq!(n_rays(&cpu::render(&world_of(&scene), &options).1.bounces), on_device[..3]);
}

/// A normal map of one colour tilts all normals alike, as a mesh with tilted normals has them. The sheet is also
/// mirrored, rotated, and seen from behind.
#[test]
fn a_constant_normal_map_equals_tilted_normals() {
    let tilt = vec3(0.48, 0.36, 0.8);
    let encoded = tilt.to_array().map(|c| ((c + 1.0) / 2.0 * 255.0).round() as u8);
    let decoded = Vec3::from_array(encoded.map(|c| f32::from(c) / 255.0 * 2.0 - 1.0)).normalize();
    let turned = DQuat::from_rotation_z(0.7);
    let from_behind = DQuat::from_rotation_y(PI);
    for (scale, rotation) in [
        (DVec3::ONE, DQuat::IDENTITY),
        (DVec3::new(-1.0, 1.0, 1.0), turned),
        (DVec3::ONE, turned),
        (DVec3::ONE, from_behind),
    ] {
        let transform = Transform::new(scale, rotation, DVec3::ZERO).expect("a transform");
        let scene_with = |mesh: kdray::scene::Mesh, is_mapped: bool| {
            let mut scene = empty();
            let image = add_image(&mut scene, [1, 1], |_, _| [encoded[0], encoded[1], encoded[2], 255]);
            let normal = is_mapped.then(|| Texture::of_data(image, Channel::Red));
            let maps = Maps { normal, normal_scale: 1.0, ..Maps::default() };
            let material = Material { maps, ks: Vec3::ZERO, ..textured::rough(Vec3::ONE) };
            add(&mut scene, mesh, transform.clone(), material);
            scene.lights = vec![Light::Directional { towards: vec3(0.3, 0.2, 1.0).normalize(), irradiance: Vec3::ONE }];
            flat(&scene)
        };
        let mut tilted = square();
        // The square's tangent is +x and its bitangent +y, as the map's x and y are.
        tilted.normals.fill([decoded; 3]);
        let expected = on_both(&scene_with(tilted, false), &options(12, 12, 1));
        let found = on_both(&scene_with(square(), true), &options(12, 12, 1));
        for (expected, found) in expected.iter().zip(&found) {
            let [a, b] = [expected, found].map(|picture| rgb(picture, 6, 6));
            assert!(a.x > 0.3 && a.x < 0.97 && (a - b).abs().max_element() < 4e-3, "{b}, not {a}");
        }
    }
}

/// The light of a spot falls off between its two angles, and with the square of the distance.
#[test]
fn a_spot_light_falls_off_as_the_closed_form_says() {
    let mut scene = empty();
    let wall = Material { ks: Vec3::ZERO, ..textured::rough(Vec3::ONE) };
    add(&mut scene, square(), placed(HALF_VIEW, DVec3::ZERO), wall);
    let (inner_cos, outer_cos, height) = (0.95_f32, 0.85, 2.0_f32);
    let position = vec3(0.0, 0.0, height);
    let intensity = Vec3::splat(5.0);
    scene.lights = vec![Light::Spot { position, towards: Vec3::NEG_Z, intensity, inner_cos, outer_cos }];
    for picture in on_both(&flat(&scene), &options(33, 33, 1)) {
        for x in 0..33 {
            let offset = (x as f32 + 0.5) / 33.0 * 2.0 - 1.0;
            let squared = (offset * HALF_VIEW as f32).powi(2) + height * height;
            let cosine = height / squared.sqrt();
            let share = ((cosine - outer_cos) / (inner_cos - outer_cos)).clamp(0.0, 1.0).powi(2);
            let expected = 5.0 * share * cosine / squared;
            assert!((rgb(&picture, x, 16).x - expected).abs() < 2e-3, "{x}: {} {expected}", rgb(&picture, x, 16).x);
        }
    }
}

/// A solid absorbs light by Beer's law, over the distance that the light takes through it.
#[test]
fn a_solid_absorbs_what_beers_law_says() {
    let mut scene = empty();
    let glow = unlit(Vec3::ONE, None);
    add(&mut scene, square(), placed(9.0, DVec3::new(0.0, 0.0, -3.0)), glow);
    let microfacet = kdray::scene::Microfacet {
        transmission: 1.0,
        roughness: 1.0,
        is_solid: true,
        attenuation_colour: vec3(0.5, 0.25, 1.0),
        attenuation_distance: 0.5,
        ..Default::default()
    };
    // The index of refraction is 1, so nothing is reflected or bent. The slab is 1 thick.
    let glass = Material { ni: 1.0, microfacet: Some(microfacet), ..textured::rough(Vec3::ONE) };
    add(&mut scene, square(), placed(2.0, DVec3::new(0.0, 0.0, 0.5)), glass.clone());
    let turned = Transform::new(DVec3::splat(2.0), DQuat::from_rotation_y(PI), DVec3::new(0.0, 0.0, -0.5));
    add(&mut scene, square(), turned.expect("a transform"), glass);
    for picture in on_both(&flat(&scene), &options(9, 9, 4)) {
        let found = rgb(&picture, 4, 4);
        assert!((found - vec3(0.25, 0.0625, 1.0)).abs().max_element() < 2e-3, "{found}");
    }
}

#[test]
fn device_and_cpu_agree_on_every_kind() {
    let scene = textured::every_kind();
    for traversal in [Traversal::Mask, Traversal::Ropes] {
        let options = RenderOptions { traversal, primary: Primary::Trace, ..options(80, 60, 5) };
        let [device, cpu] = on_both(&scene, &options);
        let n_differing = differing(&device, &cpu, 4e-3).len();
        assert!(n_differing <= device.radiance.len() / 100, "{traversal}: {n_differing} pixels differ");
    }
    let [device, cpu] = on_both(&scene, &options(80, 60, 5));
    let n_differing = differing(&device, &cpu, 4e-3).len();
    assert!(n_differing <= device.radiance.len() / 20, "rasterized: {n_differing} pixels differ");
}

#[test]
fn frames_with_textures_are_the_same_bits_each_time() {
    let scene = textured::every_kind();
    let options = options(60, 45, 4);
    assert!(identical(&on_device(&scene, &options), &on_device(&scene, &options)));
}

/// The radiance of a picture in relation to its own brightness: a file's lights may have any units.
#[test]
fn device_and_cpu_agree_on_the_scenes_with_textures_that_ship() {
    for name in ["room.toml", "still_life.gltf"] {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes").join(name);
        let scene = scenes::load(&path);
        let options = RenderOptions { primary: Primary::Trace, ..options(96, 72, scene.defaults.max_depth) };
        let [device, cpu] = on_both(&scene, &options);
        let sum: f32 = cpu.radiance.iter().map(|pixel| pixel[..3].iter().sum::<f32>()).sum();
        let mean = sum / (3 * cpu.radiance.len()) as f32;
        let n_differing = differing(&device, &cpu, 0.02 * mean).len();
        assert!(mean > 0.0 && n_differing <= device.radiance.len() / 50, "{name}: {n_differing} pixels differ");
    }
}
