//! Instances in place of flat worlds, in all tests: with `KDRAY_TEST_INSTANCES=keep`, worlds that tests make of flat
//! scenes keep instances, and commands that tests run are given `--instances keep`.

use glam::{DQuat, DVec3};
use kdray::{
    accel::kdtree::BuildOptions,
    layout::Triangle,
    scene::{Instance, Material, Mesh, Scene, Transform},
    world::{FlatScene, World},
};

use super::{scenes, textured};

/// Whether instances are asked for.
pub fn is_asked_for() -> bool {
    std::env::var("KDRAY_TEST_INSTANCES").is_ok_and(|word| word == "keep")
}

/// Whether a test is left out because instances are asked for. `why`: what it reads, which only flat worlds have.
pub fn leaves_out(why: &str) -> bool {
    if is_asked_for() {
        println!("left out with instances: {why}");
    }
    is_asked_for()
}

/// Returns the scene. If instances are asked for, it has one for each run of triangles of one material. They are scaled
/// by powers of two, so that all triangles of the world have the same bits. A scene that would be refused is returned
/// as it is.
pub fn if_asked_for(scene: &FlatScene) -> FlatScene {
    let is_plain = scene.instances.is_none() && scene.triangles.len() == scene.triangle_materials.len();
    if is_asked_for() && is_plain { in_instances(scene) } else { scene.clone() }
}

/// Returns a world with an instance of a mesh, or none if the mesh is refused.
pub fn mesh(triangles: &[Triangle]) -> Option<World> {
    let mut scene = scenes::empty();
    scenes::add(&mut scene, triangles.to_vec(), scenes::BLACK);
    World::of_flat(in_instances(&scene), &BuildOptions::default()).ok()
}

fn in_instances(flat: &FlatScene) -> FlatScene {
    let mut scene = Scene { materials: vec![Material::default(); flat.materials.len()], ..textured::empty() };
    let mut triangles = Vec::with_capacity(flat.triangles.len());
    for run in flat.triangle_materials.chunk_by(|a, b| a == b) {
        let scale = [1.0, 2.0, 0.5][scene.meshes.len() % 3];
        let first = triangles.len();
        let small = |t: &Triangle| Triangle { v0: t.v0 / scale, v1: t.v1 / scale, v2: t.v2 / scale, ..*t };
        triangles.extend(flat.triangles[first..][..run.len()].iter().map(small));
        let positions = triangles[first..].iter().flat_map(|t| [t.v0, t.v1, t.v2]).collect();
        let faces = (0..run.len() as u32).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
        let mesh_ix = scene.meshes.len();
        scene.meshes.push(Mesh::of_triangles(positions, faces));
        let transform = Transform::new(DVec3::splat(f64::from(scale)), DQuat::IDENTITY, DVec3::ZERO);
        let transform = transform.expect("a transform");
        scene.instances.push(Instance { mesh_ix, transform, materials: vec![run[0]], ..Instance::default() });
    }
    let Some(instances) = FlatScene::with_instances(&scene).ok().and_then(|kept| kept.instances) else {
        return flat.clone();
    };
    let triangle_materials = vec![0; triangles.len()].into();
    FlatScene { triangles: triangles.into(), triangle_materials, instances: Some(instances), ..flat.clone() }
}
