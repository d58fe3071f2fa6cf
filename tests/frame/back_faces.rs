//! Tests that the camera does not see the back faces of single-sided materials, in any way of finding what it sees, and
//! that all other rays meet them.

use std::sync::Arc;

use glam::{DQuat, DVec3, Vec3, Vec4, vec3};
use kdray::{
    accel::kdtree::{BuildOptions, Traversal},
    cpu::{self, Batching, CpuRenderer},
    frame::{Integrator, PathOptions, Picture, Primary, RenderOptions},
    gpu::{Context, DeviceOverrides},
    layout::PixelAovs,
    render::GpuRenderer,
    scene::{Alpha, Lobes, Maps, Material, Mesh, Scene, Texture, Transform},
    world::{FlatScene, World},
};

use super::studio::{assert_silent, device, differing, identical, on_both, on_cpu, on_device, options, world_of};
use crate::support::{
    grid_worlds, pretended,
    textured::{add, add_image, empty, placed, sphere, square, unlit},
    with_lanes, world_by,
};

const RED: Vec3 = vec3(1.0, 0.0, 0.0);
const GREEN: Vec3 = vec3(0.0, 1.0, 0.0);
const BLUE: Vec3 = vec3(0.0, 0.0, 1.0);

/// Width and height of all pictures, pixels.
const SIZE: u32 = 32;
/// Index of the pixel of the ball, behind which there is the shell.
const OF_BALL: usize = 16 * SIZE as usize + 16;
/// Index of a pixel beside the ball, of the inside of the shell.
const OF_SHELL: usize = 16 * SIZE as usize + 20;
/// Index of a pixel of the mirror.
const OF_MIRROR: usize = 16 * SIZE as usize + 3;

/// Whether a shell is made of faces that turn inwards.
fn shell(is_inverted: bool) -> Mesh {
    let mut mesh = sphere(6);
    if is_inverted {
        mesh.faces.iter_mut().for_each(|face| face.swap(1, 2));
        mesh.normals.iter_mut().for_each(|normals| normals.swap(1, 2));
        mesh.uvs[0].iter_mut().for_each(|uvs| uvs.swap(1, 2));
        mesh.tangents.iter_mut().for_each(|tangents| tangents.swap(1, 2));
    }
    mesh
}

/// A red ball in a green shell, and beside them a mirror in which the outside of the shell is seen.
fn outlined(shell: Mesh, scale: DVec3, is_double_sided: bool) -> Scene {
    let mut scene = empty();
    add(&mut scene, sphere(6), placed(0.3, DVec3::ZERO), unlit(RED, None));
    let single = Material { is_double_sided, ..unlit(GREEN, None) };
    add(&mut scene, shell, Transform::new(scale, DQuat::IDENTITY, DVec3::ZERO).expect("a transform"), single);
    let lobes = Lobes { reflection: true, ..Lobes::default() };
    let mirror = Material { kd: Vec3::ZERO, ks: Vec3::ONE, lobes, ..Material::default() };
    let turn = DQuat::from_rotation_y(54_f64.to_radians());
    let place = Transform::new(DVec3::splat(0.3), turn, DVec3::new(-1.3, 0.0, 0.0));
    add(&mut scene, square(), place.expect("a transform"), mirror);
    scene.background = BLUE;
    scene
}

fn flat(scene: &Scene) -> FlatScene {
    FlatScene::new(scene).expect("a scene that fits together")
}

/// The scene in all forms in which the camera sees the ball through the shell.
fn seen_through() -> [FlatScene; 2] {
    [
        outlined(shell(true), DVec3::splat(0.6), false),
        // A mirroring transform reverses the winding, and so does not turn the shell inside out.
        outlined(shell(true), DVec3::new(0.6, -0.6, 0.6), false),
    ]
    .map(|scene| flat(&scene))
}

fn rgb(picture: &Picture, ix: usize) -> Vec3 {
    Vec4::from_array(picture.radiance[ix]).truncate()
}

/// Checks what the pixels of the ball, the shell and the mirror show.
fn check(picture: &Picture, expected: [Vec3; 3], what: &str) {
    let found = [OF_BALL, OF_SHELL, OF_MIRROR].map(|ix| rgb(picture, ix));
    let off = (0..3).map(|i| (found[i] - expected[i]).abs().max_element()).fold(0.0, f32::max);
    assert!(off < 1e-3, "{what}: {found:?}, not {expected:?}");
}

fn whitted(primary: Primary) -> RenderOptions {
    RenderOptions { primary, ..options(SIZE, SIZE, 3) }
}

fn on(context: Arc<Context>, world: &World, options: &RenderOptions) -> Picture {
    let mut renderer = GpuRenderer::new(context.clone(), world, options).expect("a renderer");
    let picture = renderer.render().expect("a frame").0;
    assert_silent(&context);
    picture
}

/// The ways of finding what the camera sees that the device has.
fn primaries() -> Vec<Primary> {
    let has_atomics = device().has_int64_atomics();
    Primary::ALL.iter().copied().filter(|primary| has_atomics || *primary != Primary::SoftwareRaster).collect()
}

#[test]
fn an_inverted_shell_shows_what_is_in_it_in_every_way() {
    for scene in seen_through() {
        for primary in primaries() {
            for (way, picture) in ["device", "CPU"].iter().zip(on_both(&scene, &whitted(primary))) {
                check(&picture, [RED, GREEN, GREEN], &format!("{way}, {primary}"));
            }
        }
        // The kernels of GPUs, which do not predicate branches.
        for primary in primaries() {
            check(&on(with_lanes(1000), &world_of(&scene), &whitted(primary)), [RED, GREEN, GREEN], "as a GPU");
        }
        let expected = on_cpu(&scene, &whitted(Primary::Trace));
        for &traversal in Traversal::ALL {
            let options = RenderOptions { traversal, ..whitted(Primary::Trace) };
            assert_eq!(differing(&expected, &on_cpu(&scene, &options), 0.0), [0usize; 0], "{traversal}");
        }
        for world in grid_worlds(&scene) {
            for picture in
                [on(device(), &world, &whitted(Primary::Trace)), cpu::render(&world, &whitted(Primary::Trace)).0]
            {
                check(&picture, [RED, GREEN, GREEN], "grid");
            }
        }
    }
}

#[test]
fn traced_rays_agree_in_every_search_of_the_device() {
    let [scene, _] = seen_through();
    let expected = on_cpu(&scene, &whitted(Primary::Trace));
    for &traversal in Traversal::ALL {
        let picture = on_device(&scene, &RenderOptions { traversal, ..whitted(Primary::Trace) });
        assert_eq!(differing(&expected, &picture, 1e-4), [0usize; 0], "{traversal}");
    }
    if device().has_int64_atomics() {
        let compute = on_device(&scene, &whitted(Primary::SoftwareRaster));
        assert!(identical(&compute, &on_device(&scene, &whitted(Primary::Trace))));
    }
    // A ray that is interrupted goes on as the same kind of ray.
    let overrides = DeviceOverrides { loop_limit: Some(40), ..DeviceOverrides::default() };
    let interrupted = on(pretended(overrides), &world_of(&scene), &whitted(Primary::Trace));
    assert_eq!(differing(&expected, &interrupted, 1e-4), [0usize; 0]);
}

#[test]
fn paths_begin_with_rays_that_pass_back_faces() {
    for (aperture, focus) in [(0.0, None), (1e-4, Some(4.0))] {
        let paths = PathOptions { aperture, focus, ..PathOptions::default() };
        let options = RenderOptions { integrator: Integrator::Path, paths, ..options(SIZE, SIZE, 4) };
        for scene in seen_through() {
            for (way, picture) in ["device", "CPU"].iter().zip(on_both(&scene, &options)) {
                check(&picture, [RED, GREEN, GREEN], way);
            }
            check(&on(with_lanes(1000), &world_of(&scene), &options), [RED, GREEN, GREEN], "as a GPU");
        }
    }
}

/// A shell that is not inverted hides the ball, also if a transform mirrors it, and so does one with two sides.
#[test]
fn front_faces_and_two_sided_materials_hide_what_is_behind_them() {
    let mirroring = DVec3::new(-0.6, 0.6, 0.6);
    for scene in [
        outlined(shell(false), DVec3::splat(0.6), false),
        outlined(shell(false), mirroring, false),
        outlined(shell(true), DVec3::splat(0.6), true),
        outlined(shell(true), mirroring, true),
    ] {
        let scene = flat(&scene);
        let of_paths = RenderOptions { integrator: Integrator::Path, ..whitted(Primary::Trace) };
        for options in primaries().into_iter().map(whitted).chain([of_paths]) {
            for picture in on_both(&scene, &options) {
                check(&picture, [GREEN; 3], "hidden");
            }
        }
    }
}

/// A closed mesh looks the same, whatever is said of its back faces, which nobody sees.
#[test]
fn a_closed_mesh_looks_the_same_with_one_side() {
    let [single, double] = [false, true].map(|it| flat(&outlined(shell(false), DVec3::splat(0.6), it)));
    for primary in primaries() {
        assert_eq!(on_device(&single, &whitted(primary)), on_device(&double, &whitted(primary)), "{primary}");
    }
    assert_eq!(on_cpu(&single, &whitted(Primary::Trace)), on_cpu(&double, &whitted(Primary::Trace)));
}

/// A shell with holes is both culled and alpha-tested: its front faces show what is behind them through the holes.
#[test]
fn back_faces_and_holes_go_together() {
    let mut scene = outlined(shell(true), DVec3::splat(0.6), false);
    let image = add_image(&mut scene, [1, 1], |_, _| [255, 255, 255, 0]);
    let maps = Maps { base_colour: Some(Texture::of_image(image)), ..Maps::default() };
    scene.materials[1] = Material { alpha: Alpha::Mask(0.5), maps, ..scene.materials[1].clone() };
    // A ball that is masked and has no holes.
    let image = add_image(&mut scene, [1, 1], |_, _| [255, 255, 255, 255]);
    let maps = Maps { base_colour: Some(Texture::of_image(image)), ..Maps::default() };
    scene.materials[0] = Material { alpha: Alpha::Mask(0.5), maps, ..scene.materials[0].clone() };
    let scene = flat(&scene);
    let of_paths = RenderOptions { integrator: Integrator::Path, ..whitted(Primary::Trace) };
    for options in primaries().into_iter().map(whitted).chain([of_paths]) {
        for picture in on_both(&scene, &options) {
            check(&picture, [RED, BLUE, RED], "holes");
        }
    }
}

/// A needle that is seen almost along its length has the side that its corners say.
#[test]
fn needles_have_the_right_side() {
    let mut scene = empty();
    let positions = vec![vec3(-300.0, 0.0, -1.0), vec3(300.0, 0.0, -1.0), vec3(0.3, 1e-4, -1.0)];
    let needle =
        Mesh { positions, faces: vec![[0, 1, 2]], normals: vec![[Vec3::Z; 3]], slots: vec![0], ..Mesh::default() };
    add(&mut scene, needle, Transform::IDENTITY, Material { is_double_sided: false, ..unlit(GREEN, None) });
    scene.camera.eye = vec3(0.0, 4e-5, 3.0);
    scene.camera.target = vec3(0.0, 4e-5, 0.0);
    for picture in on_both(&flat(&scene), &RenderOptions { primary: Primary::Trace, ..options(5, 5, 1) }) {
        assert_eq!(rgb(&picture, 12), GREEN);
    }
    scene.meshes[0].faces[0].swap(1, 2);
    for picture in on_both(&flat(&scene), &RenderOptions { primary: Primary::Trace, ..options(5, 5, 1) }) {
        assert_eq!(rgb(&picture, 12), Vec3::ZERO);
    }
}

/// Device and CPU count the same steps of rays that pass back faces. A software device tests no slabs, so the tree has
/// none then.
#[test]
fn the_costs_of_passing_are_counted() {
    let [scene, _] = seen_through();
    for integrator in [Integrator::Whitted, Integrator::Path] {
        let options =
            RenderOptions { integrator, pixel_aovs: true, traversal: Traversal::Ropes, ..whitted(Primary::Trace) };
        let context = device();
        let slabs = !context.is_software();
        let world = world_by(&scene, &BuildOptions { slabs, ..BuildOptions::default() });
        let mut renderer = GpuRenderer::new(context.clone(), &world, &options).expect("a renderer");
        renderer.draw_sample().expect("a frame");
        let mut of_cpu = CpuRenderer::new(&world, &options, Batching::default());
        of_cpu.draw_sample();
        let [a, b] = [renderer.pixel_aovs().expect("AOVs"), of_cpu.pixel_aovs()];
        let steps = |aovs: &[PixelAovs]| aovs.iter().map(|aovs| aovs.n_steps).collect::<Vec<_>>();
        let n_differing = steps(&a).iter().zip(steps(&b)).filter(|(a, b)| **a != *b).count();
        assert!(n_differing <= 10, "{integrator}: {n_differing} pixels");
        assert_eq!(a[OF_BALL].triangle_ix, b[OF_BALL].triangle_ix);
    }
}
