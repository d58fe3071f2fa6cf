//! Tests of the rasterizing kernels against the kd-tree: they find the hits of the camera rays, to the last bit.

use std::sync::Arc;

use glam::{Vec3, uvec2, vec3};
use kdray::{
    frame::{Crop, Primary, RenderOptions, plan},
    gpu::{Access, Commands, GpuError},
    layout::{Batch, Hit, RASTER_GROUPS_X, RASTER_GROUPS_Y, Triangle},
    passes::{Inputs, Passes, Rasterize, Trace},
    reference::primary_hit::camera_ray,
    render::GpuRenderer,
    scene::{Camera, Projection},
    world::FlatScene,
};

use super::stage::{FIRST, Stage, options};
use crate::support::{compare, device, kept, meshes, random::Random, scenes, without_wide_atomics, world_of};

/// A stage that rasterizes by kernels, and the pass that traces the same rays.
struct View {
    stage: Stage,
    trace: Arc<Trace>,
}

/// Makes a view, or returns `None` if the device has no atomics of 64 bits.
fn view(scene: FlatScene, options: RenderOptions) -> Option<View> {
    let can_rasterize = device().has_int64_atomics();
    let crop = options.crop_or_whole();
    let options = RenderOptions { primary: Primary::SoftwareRaster, ..options };
    let stage = can_rasterize.then(|| Stage::new(scene, options, crop.width() * crop.height()))?;
    let options = RenderOptions { primary: Primary::Trace, ..stage.options.clone() };
    let passes = Passes::new(&stage.context, &stage.resources.bindings, &options).expect("passes");
    Some(View { stage, trace: passes.trace })
}

/// Returns the hits of all pixels.
fn hits_by(stage: &Stage, record: impl Fn(&Commands, &Batch)) -> Vec<Hit> {
    let batch = Batch { n_pixels: stage.resources.n_pixels() as u32, ..FIRST };
    stage.set_n_rays(&[batch.n_pixels]);
    stage.set_hits(&[]);
    stage.trace(&batch, record);
    stage.resources.queue.hits.download().expect("hits")
}

impl View {
    fn rasterized(&self) -> Vec<Hit> {
        let Stage { passes, resources, .. } = &self.stage;
        hits_by(&self.stage, |commands, batch| {
            Rasterize::reset(commands, resources);
            commands.barrier(Access::TransferWrite, Access::AnyUse); // raster_groups
            passes.record_sequence(commands, resources, &plan::visibility(Primary::SoftwareRaster), &Inputs::default());
            passes.primary_hit.record(commands, batch);
        })
    }

    fn traced(&self) -> Vec<Hit> {
        hits_by(&self.stage, |commands, batch| self.trace.record(commands, &self.stage.resources, batch))
    }

    fn look(&mut self, camera: &Camera) {
        let mut constants = *self.stage.resources.constants();
        constants.set_view(camera, self.stage.world.bounds(), 0);
        self.stage.resources.set_constants(&constants);
        self.stage.resources.frame.upload(&[constants]).expect("constants");
    }

    /// Asserts that both find the same hits. Returns the number of pixels that show a triangle.
    fn check(&self) -> usize {
        let found = self.rasterized();
        // Searches meet instances in their own space, where hits are rounded otherwise.
        let agree = if kept::is_asked_for() {
            compare::hits(found.len() / 100, &self.traced(), &found)
        } else {
            compare::exact(&self.traced(), &found)
        };
        agree.unwrap();
        found.iter().filter(|hit| hit.t < f32::INFINITY).count()
    }
}

fn check(scene: FlatScene, options: RenderOptions) -> usize {
    view(scene, options).map_or(usize::MAX, |view| view.check())
}

/// Returns an orthographic camera. The heights range from a detail of one triangle to more than the scene.
fn random_parallel_camera(random: &mut Random, reach: f32) -> Camera {
    let heights = [0.05, 1.0, 6.0, 12.0];
    let projection = Projection::Orthographic { height: heights[random.below(heights.len())] };
    Camera { projection, ..random_camera(random, reach) }
}

fn random_camera(random: &mut Random, reach: f32) -> Camera {
    let [eye, target, up] = [reach, 3.0, 1.0].map(|r| random.in_box(Vec3::splat(-r), Vec3::splat(r)));
    // The fields of view range from very narrow to so wide that parts beside the eye are cut off.
    let fovs = [5.0, 45.0, 90.0, 150.0, 176.0];
    Camera {
        eye,
        target,
        up,
        projection: Projection::Perspective { vertical_fov_degrees: fovs[random.below(fovs.len())] },
    }
}

/// The eye is inside and outside of the scene, with triangles behind, beside and around it.
#[test]
fn shows_what_camera_rays_hit_from_anywhere() {
    let mut random = Random(17);
    for scene in [scenes::mixed(), scenes::mixed_outdoors()] {
        let Some(mut view) = view(scene, options(41, 33)) else { return };
        for i in 0..30 {
            view.look(&random_camera(&mut random, [2.0, 4.9, 20.0][i % 3]));
            view.check();
        }
    }
}

/// The eye is inside and outside of the scene, but not so far away that traced rays are moved to the scene first.
#[test]
fn shows_what_parallel_rays_hit_from_anywhere() {
    let mut random = Random(19);
    for scene in [scenes::mixed(), scenes::mixed_outdoors()] {
        let Some(mut view) = view(scenes::orthographic(scene), options(41, 33)) else { return };
        for i in 0..30 {
            view.look(&random_parallel_camera(&mut random, [2.0, 4.9, 9.0][i % 3]));
            view.check();
        }
    }
}

/// Rays are parallel to many triangles, and begin in the plane of some.
#[test]
fn shows_what_parallel_rays_hit_along_the_axes() {
    let Some(mut view) = view(scenes::orthographic(scenes::mixed()), options(40, 40)) else { return };
    for (axis, up) in [(Vec3::X, Vec3::Y), (Vec3::Y, Vec3::Z), (Vec3::Z, Vec3::Y)] {
        for eye in [axis * -5.0, axis * 5.0, axis * 9.0, axis * 0.1] {
            // At a height of 10, a pixel is 1/4 wide, and edges pass through samples.
            for height in [10.0, 4.0] {
                let projection = Projection::Orthographic { height };
                view.look(&Camera { eye, target: eye - axis, up, projection });
                view.check();
            }
        }
    }
}

/// Triangles as large as a room are all around the eye, and some pass through it.
#[test]
fn shows_what_camera_rays_hit_amid_triangles() {
    let mut random = Random(23);
    let eye = Vec3::splat(0.125);
    let mut corner = || random.in_box(Vec3::splat(-3.0), Vec3::splat(3.0));
    let mut triangles: Vec<Triangle> = (0..150).map(|_| meshes::triangle(corner(), corner(), corner())).collect();
    triangles.push(meshes::triangle(eye - Vec3::X, eye + Vec3::X, corner()));
    triangles.push(meshes::triangle(eye, corner(), corner()));
    let mut scene = scenes::empty();
    scenes::add(&mut scene, triangles, scenes::BLACK);
    for is_parallel in [false, true] {
        let scene = if is_parallel { scenes::orthographic(scene.clone()) } else { scene.clone() };
        let Some(mut view) = view(scene, options(50, 37)) else { return };
        for i in 0..30 {
            let random_camera = if is_parallel { random_parallel_camera } else { random_camera };
            let camera = random_camera(&mut random, 2.0);
            view.look(&if i % 2 == 0 { Camera { eye, ..camera } } else { camera });
            assert!(view.check() > 0, "view {i}");
        }
    }
}

/// There are far more triangles than pixels, triangles that contain no pixel's sample, and more than one row of
/// workgroups.
#[test]
fn shows_what_camera_rays_hit_of_small_triangles() {
    for triangles in [meshes::soup(20_000, 3), meshes::torus(300, 120), meshes::threefold(meshes::cube(9, 0.0))] {
        let mut scene = scenes::empty();
        scenes::add(&mut scene, triangles, scenes::BLACK);
        assert!(check(scenes::orthographic(scene.clone()), options(64, 48)) > 0);
        assert!(check(scene, options(64, 48)) > 0);
    }
}

/// The slivers are so thin that rounding decides from which side they are seen. They contain the samples through
/// which the rays pass.
#[test]
fn shows_what_camera_rays_hit_of_slivers() {
    let (options, mut random) = (options(64, 48), Random(41));
    for empty in [scenes::empty(), scenes::orthographic(scenes::empty())] {
        let mut scene = empty;
        let world = world_of(&scene);
        let frame = world.frame_constants(&options);
        let mut sliver = || {
            let pixel = uvec2(random.below(64) as u32, random.below(48) as u32);
            let ray = camera_ray(&frame, pixel);
            let across = ray.direction.cross(random.direction()).normalize();
            // Slivers are some 6 pixels long.
            let at = |random: &mut Random, share: f32| {
                let along = ray.direction + share * across * random.between(0.0, 0.04);
                ray.origin + along * random.between(2.0, 6.0)
            };
            let (a, b) = (at(&mut random, 1.0), at(&mut random, -1.0));
            let width = 10f32.powf(random.between(-8.0, -3.0));
            meshes::triangle(a, b, a + width * random.direction())
        };
        scenes::add(&mut scene, (0..20_000).map(|_| sliver()).collect(), scenes::BLACK);
        assert!(check(scene, options.clone()) > 1000);
    }
}

/// Triangles have some 25 pixels, so that a workgroup has more tests than fit at once.
#[test]
fn shows_all_pixels_of_a_workgroups_triangles() {
    let mut scene = scenes::empty();
    let corner = |i: usize, j: usize| vec3(i as f32 / 8.0 - 2.0, j as f32 / 8.0 - 2.0, (i + j) as f32 * 0.01);
    let square = |(i, j)| {
        [
            meshes::triangle(corner(i, j), corner(i + 1, j), corner(i, j + 1)),
            meshes::triangle(corner(i + 1, j), corner(i + 1, j + 1), corner(i, j + 1)),
        ]
    };
    let squares = (0..32).flat_map(|i| (0..32).map(move |j| (i, j)));
    scenes::add(&mut scene, squares.flat_map(square).collect(), scenes::BLACK);
    assert!(check(scene, options(200, 200)) > 30_000);
}

/// Slivers across the picture have many blocks of pixels, most of which are empty. Together there are more blocks
/// than workgroups.
#[test]
fn shows_all_blocks_of_large_triangles() {
    let (width, height) = (160, 120);
    let n_blocks = 5 * 4;
    let n_slivers = RASTER_GROUPS_X * RASTER_GROUPS_Y / n_blocks + 2000;
    let mut random = Random(31);
    let mut scene = scenes::empty();
    let sliver = |_| {
        let [x, y] = [0; 2].map(|_| random.between(-0.3, 0.3));
        let (a, b) = (vec3(-4.0 + x, -3.0 + y, y), vec3(4.0 + y, 3.0 + x, x));
        meshes::triangle(a, b, b + vec3(0.001, 0.0, 0.0))
    };
    scenes::add(&mut scene, (0..n_slivers).map(sliver).collect(), scenes::BLACK);
    assert!(check(scene.clone(), options(width, height)) > 500);
    scene.camera.projection = Projection::Orthographic { height: 3.3 };
    assert!(check(scene, options(width, height)) > 500);
}

#[test]
fn a_window_shows_its_part() {
    for (x0, y0, x1, y1) in [(0, 0, 1, 1), (30, 20, 51, 48), (63, 47, 64, 48), (0, 9, 64, 10)] {
        let crop = Some(Crop { x0, y0, x1, y1 });
        check(scenes::mixed(), RenderOptions { crop, ..options(64, 48) });
        check(scenes::orthographic(scenes::mixed()), RenderOptions { crop, ..options(64, 48) });
    }
}

#[test]
fn nothing_is_shown_of_an_empty_scene() {
    let mut scene = scenes::empty();
    scenes::add(&mut scene, Vec::new(), scenes::BLACK);
    check(scene, options(9, 7));
}

#[test]
fn a_device_without_wide_atomics_is_told_so() {
    let context = without_wide_atomics();
    let scene = scenes::mixed();
    let options = RenderOptions { primary: Primary::SoftwareRaster, ..options(9, 7) };
    match GpuRenderer::new(context, &world_of(&scene), &options).err() {
        Some(GpuError::Lacks { missing, .. }) => assert_eq!(missing, "shaderBufferInt64Atomics"),
        other => panic!("{other:?}"),
    }
}
