//! Tests that data that does not fit together is refused before a kernel reads it, since kernels check no bounds.

use kdray::{
    accel::{
        Accel,
        kdtree::{BuildOptions, KdTree},
    },
    world::{FlatScene, Geometry, Mismatch, World},
};

use crate::support::scenes;

/// Returns the error of making a world of the scene. It must be the same whether the world builds the tree or is
/// given it.
fn refusal(scene: &FlatScene) -> Mismatch {
    let options = BuildOptions::default();
    let built = World::of_flat(scene.clone(), &options).expect_err("a refusal");
    let given = World::with_tree(scene.clone(), KdTree::build(&scene.triangles, &options), &options);
    assert_eq!(given.expect_err("a refusal"), built);
    built
}

#[test]
fn a_tree_of_other_triangles() {
    let (mut scene, options) = (scenes::mixed(), BuildOptions::default());
    let (tree, n) = (KdTree::build(&scene.triangles, &options), scene.triangles.len());
    let accel = Accel::KdTree(tree.clone());
    assert!(Geometry::new(&scene.triangles, &accel).is_ok());
    scene.triangles.pop();
    scene.triangle_materials.pop();
    let expected = Mismatch::Accel { accel: n, triangles: n - 1 };
    assert_eq!(Geometry::new(&scene.triangles, &accel).expect_err("a refusal"), expected);
    assert_eq!(World::with_tree(scene, tree, &options).expect_err("a refusal"), expected);
    let text = format!("the acceleration structure was built from {n} triangles, but {} are given with it", n - 1);
    assert_eq!(expected.to_string(), text);
}

#[test]
fn materials_of_more_or_fewer_triangles() {
    let changes: [fn(&mut FlatScene); 2] =
        [|scene| _ = scene.triangle_materials.pop(), |scene| scene.triangle_materials.push(0)];
    for change in changes {
        let mut scene = scenes::mixed();
        change(&mut scene);
        let (triangles, triangle_materials) = (scene.triangles.len(), scene.triangle_materials.len());
        assert_eq!(refusal(&scene), Mismatch::TriangleMaterials { triangle_materials, triangles });
    }
}

#[test]
fn a_material_that_is_not_there() {
    let mut scene = scenes::mixed();
    let n_materials = scene.materials.len();
    scene.triangle_materials[7] = n_materials as u32;
    let expected = format!("triangle 7 has material {n_materials}, but there are {n_materials} materials");
    assert_eq!(refusal(&scene).to_string(), expected);
    scene.triangle_materials[7] -= 1;
    assert!(World::of_flat(scene, &BuildOptions::default()).is_ok());
}
