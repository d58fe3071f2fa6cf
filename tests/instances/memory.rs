//! What instances take on a device.

use glam::{DQuat, DVec3};
use kdray::{
    accel::kdtree::Traversal,
    cast::GpuCaster,
    scene::{Instance, Material, Scene, Transform},
    world::World,
};

use super::{flattened, kept, mesh_of};
use crate::support::{device, meshes, textured};

const N_MESHES: usize = 551;
const N_INSTANCES: usize = 2909;

/// As many meshes and places as a public scene of an industrial plant has. The sizes of meshes, and how often each is
/// used, follow power laws: a few meshes are large and occur often, most are small and occur once or twice.
fn plant() -> Scene {
    let rank = |ix: usize| (ix + 1) as f64;
    let meshes: Vec<_> =
        (0..N_MESHES).map(|ix| mesh_of(&meshes::cube((10.0 / rank(ix).sqrt()).ceil() as usize, 0.5))).collect();
    let sum: f64 = (0..N_MESHES).map(|ix| 1.0 / rank(ix)).sum();
    let n_more = (N_INSTANCES - N_MESHES) as f64;
    let uses = (0..N_MESHES).flat_map(|ix| std::iter::repeat_n(ix, 1 + (n_more / (rank(ix) * sum)).round() as usize));
    let uses = uses.chain(std::iter::repeat(N_MESHES - 1)).take(N_INSTANCES);
    let instance = |(ix, mesh_ix): (usize, usize)| {
        let at = DVec3::new((ix % 54) as f64, (ix / 54) as f64, (ix % 7) as f64);
        let turn = DQuat::from_rotation_y(ix as f64);
        let transform = Transform::new(DVec3::ONE, turn, 2.0 * at).expect("a transform");
        Instance { mesh_ix, transform, materials: vec![0], ..Instance::default() }
    };
    Scene {
        meshes,
        instances: uses.enumerate().map(instance).collect(),
        materials: vec![Material::default()],
        ..textured::empty()
    }
}

#[test]
fn a_plant_takes_a_fifth_of_its_flattened_memory() {
    let scene = plant();
    assert_eq!((scene.meshes.len(), scene.instances.len()), (N_MESHES, N_INSTANCES));
    let context = device();
    let bytes = || context.memory().iter().map(|memory| memory.bytes).sum::<u64>();
    let of = |world: World| {
        let before = bytes();
        let caster = GpuCaster::new(&context, world.geometry(), Traversal::OF_GPUS).expect("a caster");
        let taken = bytes() - before;
        drop(caster);
        taken
    };
    let [kept, flat] = [of(kept(&scene)), of(flattened(&scene))];
    assert!(5 * kept <= flat, "{kept} bytes, and {flat} flattened");
}
