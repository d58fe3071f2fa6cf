//! Tests of the pass visibility against the kd-tree. The rasterizer snaps corners to its sub-pixel grid. Where the
//! two differ, a nearby ray must meet the rasterizer's triangle.

use glam::{DVec2, dvec2, swizzles::Vec4Swizzles, uvec2, vec3};
use kdray::{
    layout::{Batch, Frame, NO_TRIANGLE},
    reference::{
        self,
        camera::pixel_of,
        primary_hit::camera_ray,
        traverser::{Tracer, Traverser},
    },
};

use super::stage::{FIRST, Stage, options};
use crate::support::{compare, meshes, scenes};

/// Distance from a pixel's centre, in pixels, within which a ray counts as nearby. Snapping to 1/16 px (Vulkan's
/// least `subPixelPrecisionBits`) moves an edge by at most 1/32 px on each axis.
const SNAP_PX: f32 = 1.0 / 16.0;

/// Returns the triangle that each pixel shows according to its primary hit, in rows from the top.
fn rasterized(stage: &Stage) -> Vec<u32> {
    let n_pixels = stage.options.width * stage.options.height;
    let batch = Batch { n_pixels, ..FIRST };
    stage.set_n_rays(&[n_pixels]);
    stage.run(|commands| {
        stage.draw_triangles(commands);
        stage.passes.primary_hit.record(commands, &batch);
    });
    let hits = stage.resources.queue.hits.download().expect("hits");
    let mut ids = vec![0; n_pixels as usize];
    for (place, hit) in (0..n_pixels).zip(hits) {
        let pixel = pixel_of(place, stage.options.width, stage.options.height);
        ids[(pixel.y * stage.options.width + pixel.x) as usize] = hit.triangle_ix;
    }
    ids
}

/// Returns the same from the kd-tree.
fn on_cpu(stage: &Stage) -> Vec<u32> {
    let mut ids = vec![0xdead; (stage.options.width * stage.options.height) as usize];
    reference::visibility::visibility(&stage.inputs(), stage.options.traversal, &mut ids);
    ids
}

/// Returns whether some ray within `SNAP_PX` of the pixel's centre meets triangle `id` first.
fn is_met_nearby(stage: &Stage, pixel_ix: u32, id: u32) -> bool {
    let mut traverser = Traverser::new(&stage.inputs(), stage.options.traversal);
    let frame = stage.resources.constants();
    let pixel = uvec2(pixel_ix % frame.width, pixel_ix / frame.width);
    let shifted = |dx: f32, dy: f32| Frame { sample_x: frame.sample_x + dx, sample_y: frame.sample_y + dy, ..*frame };
    (0..17 * 17).any(|i| {
        let offset = |i: i32| (i - 8) as f32 / 8.0 * SNAP_PX;
        let ray = camera_ray(&shifted(offset(i % 17), offset(i / 17)), pixel);
        traverser.traverse::<false>(&stage.inputs(), &(&ray).into()).triangle_ix == id
    })
}

/// Returns whether triangle `id`, seen edge-on, comes within `SNAP_PX` of the pixel's centre with all of its corners
/// in front of the eye. So thin a triangle may be missed by every nearby ray.
fn is_touched(stage: &Stage, pixel_ix: u32, id: u32) -> bool {
    let (width, height) = (stage.options.width, stage.options.height);
    let centre = uvec2(pixel_ix % width, pixel_ix / width).as_dvec2() + 0.5;
    let Some(triangle) = stage.world.scene().triangles.get(id as usize) else { return false };
    let clip = [triangle.v0, triangle.v1, triangle.v2]
        .map(|v| stage.resources.constants().clip_from_world.as_dmat4() * v.as_dvec3().extend(1.0));
    if clip.iter().any(|corner| corner.w <= 0.0) {
        return false;
    }
    let corners = clip.map(|c| (c.xy() / c.w + 1.0) / 2.0 * dvec2(width.into(), height.into()) - centre);
    let distance = |a: DVec2, b: DVec2| {
        let share = (-a.dot(b - a) / (b - a).length_squared()).clamp(0.0, 1.0);
        (a + share * (b - a)).length()
    };
    (0..3).any(|i| distance(corners[i], corners[(i + 1) % 3]) <= f64::from(SNAP_PX))
}

/// Returns the number of pixels whose IDs differ, and the pixels among them whose ID no nearby ray explains.
fn differences(stage: &Stage, expected: &[u32], found: &[u32]) -> (usize, Vec<u32>) {
    let differing: Vec<u32> =
        (0..expected.len() as u32).filter(|&i| expected[i as usize] != found[i as usize]).collect();
    let wrong = differing
        .iter()
        .copied()
        .filter(|&i| !is_met_nearby(stage, i, found[i as usize]) && !is_touched(stage, i, found[i as usize]))
        .collect();
    (differing.len(), wrong)
}

#[test]
fn shows_the_triangle_that_the_camera_ray_meets() {
    for (scene, width, height) in [
        (scenes::mixed(), 160, 120),
        (scenes::mixed_outdoors(), 33, 65),
        (scenes::mixed(), 1, 1),
        (scenes::orthographic(scenes::mixed_outdoors()), 80, 61),
    ] {
        let stage = Stage::new(scene, options(width, height), width * height);
        let expected = on_cpu(&stage);
        let found = rasterized(&stage);
        let (n_differing, wrong) = differences(&stage, &expected, &found);
        assert!(n_differing <= expected.len() / 100, "{n_differing} pixels of {width} x {height} differ");
        assert_eq!(wrong, Vec::<u32>::new(), "pixels of {width} x {height}");
    }
}

#[test]
fn nothing_is_shown_of_an_empty_scene() {
    let mut scene = scenes::empty();
    scenes::add(&mut scene, Vec::new(), scenes::BLACK);
    let stage = Stage::new(scene, options(9, 7), 63);
    compare::exact(&[NO_TRIANGLE; 63], &rasterized(&stage)).unwrap();
}

/// The id 0 is a valid triangle, not the background.
#[test]
fn a_lone_triangle_is_shown() {
    let mut scene = scenes::empty();
    let corners = [vec3(-9.0, -9.0, 0.0), vec3(9.0, -9.0, 0.0), vec3(0.0, 9.0, 0.0)];
    scenes::add(&mut scene, vec![meshes::triangle(corners[0], corners[1], corners[2])], scenes::BLACK);
    let stage = Stage::new(scene, options(9, 7), 63);
    compare::exact(&[0; 63], &rasterized(&stage)).unwrap();
    compare::exact(&[0; 63], &on_cpu(&stage)).unwrap();
}

#[test]
fn another_triangle_is_noticed() {
    let stage = Stage::new(scenes::mixed(), options(40, 30), 1200);
    let mut found = rasterized(&stage);
    found[600] = if found[600] == 3 { 4 } else { 3 };
    assert_eq!(differences(&stage, &on_cpu(&stage), &found).1, [600]);
}
