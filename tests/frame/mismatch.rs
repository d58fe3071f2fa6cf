//! What does not fit together is refused before a kernel, which checks no bounds, can read it.

use kdray::{
    accel::{
        Query,
        kdtree::{BuildOptions, KdTree, Traversal},
    },
    cast::{Caster, cast_on_cpu},
    cpu,
    gpu::GpuError,
    layout::Triangle,
    render::Renderer,
    scene::{Mismatch, Scene},
};

use super::studio::{assert_silent, device, options, tree_of};
use crate::support::{meshes, scenes};

/// What the renderers of the device and of the CPU say of a scene and a tree; it must be the same.
fn refusal(scene: &Scene, tree: &KdTree) -> String {
    let (context, options) = (device(), options(8, 8, 2));
    let on_device = Renderer::new(context.clone(), scene, tree, &options).err().expect("a refusal");
    assert!(matches!(on_device, GpuError::Mismatch(_)), "{on_device}");
    let on_cpu = cpu::render(scene, tree, &options).expect_err("a refusal");
    assert_eq!(on_device.to_string(), on_cpu.to_string());
    assert_silent(&context);
    on_cpu.to_string()
}

#[test]
fn a_tree_of_other_triangles() {
    let mut scene = scenes::mixed();
    let (n, tree) = (scene.triangles.len(), tree_of(&scene));
    scene.triangles.pop();
    scene.triangle_materials.pop();
    let expected = format!("the kd-tree was built from {n} triangles, but {} are given with it", n - 1);
    assert_eq!(refusal(&scene, &tree), expected);
    let cast = |triangles: &[Triangle]| {
        let caster = Caster::new(&device(), triangles, &tree, Traversal::Mask).err().map(|error| error.to_string());
        (caster, cast_on_cpu(triangles, &tree, Traversal::Mask, &[], Query::Closest).err())
    };
    let (triangles, tree) = (n - 1, n);
    assert_eq!(cast(&scene.triangles), (Some(expected), Some(Mismatch::Tree { tree, triangles })));
    assert_eq!(cast(&scenes::mixed().triangles), (None, None));
}

#[test]
fn materials_of_more_or_fewer_triangles() {
    let changes: [fn(&mut Scene); 2] =
        [|scene| _ = scene.triangle_materials.pop(), |scene| scene.triangle_materials.push(0)];
    for change in changes {
        let mut scene = scenes::mixed();
        change(&mut scene);
        let (n, n_materials) = (scene.triangles.len(), scene.triangle_materials.len());
        let expected = format!("triangle_materials has {n_materials} entries for {n} triangles");
        assert_eq!(refusal(&scene, &tree_of(&scene)), expected);
    }
}

#[test]
fn a_material_that_is_not_there() {
    let mut scene = scenes::mixed();
    let n_materials = scene.materials.len();
    scene.triangle_materials[7] = n_materials as u32;
    let expected = format!("triangle 7 has material {n_materials}, but there are {n_materials} materials");
    assert_eq!(refusal(&scene, &tree_of(&scene)), expected);
    scene.triangle_materials[7] -= 1;
    assert_eq!(scene.check(&tree_of(&scene)), Ok(()));
}

/// The renderer's own tree is on the device already: boxes and ropes of another one do not go with it.
#[test]
fn the_ropes_of_another_tree() {
    let (mut scene, context) = (scenes::empty(), device());
    scenes::add(&mut scene, meshes::torus(20, 10), scenes::BLACK);
    let tree = tree_of(&scene);
    let options = options(8, 8, 2);
    let mut renderer = Renderer::new(context.clone(), &scene, &tree, &options).expect("a renderer");
    let other = KdTree::build(&scene.triangles, &BuildOptions::fast());
    assert_ne!(other.nodes().len(), tree.nodes().len());
    let changed = kdray::frame::RenderOptions { traversal: Traversal::Backtrack, ..options };
    let refused = renderer.set_options(&changed, &other).expect_err("a refusal").to_string();
    assert!(refused.contains("but the one on the device has"), "{refused}");
    renderer.set_options(&changed, &tree).expect("the renderer's own tree");
    assert_silent(&context);
}
