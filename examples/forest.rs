//! Renders a forest: 100 trees of 100,000 triangles each, every one of which stands at 100 places. These are a billion
//! triangles, of which ten million are stored.
//!
//! ```sh
//! cargo run --release --example forest -- forest.png
//! ```

use std::{
    env,
    error::Error,
    f32::consts::TAU,
    path::{Path, PathBuf},
};

use glam::{DQuat, DVec3, Quat, Vec3, vec3};
use kdray::{
    engine::{Engine, LoadRequest},
    frame::{Goal, Integrator},
    gpu::ContextOptions,
    output,
    scene::{Camera, Instance, Material, Mesh, PictureChoices, Projection, Scene, Sky, Transform, Up},
};

const N_TREES: u64 = 100;
const N_PLACES: u64 = 10_000;
const TRIANGLES_OF_TREE: usize = 100_000;
/// Distance between the places of trees, metres.
const APART: f32 = 6.0;

fn main() -> Result<(), Box<dyn Error>> {
    let picture = env::args_os().nth(1).map(PathBuf::from).ok_or("usage: forest PICTURE")?;
    let engine = match Engine::open(&ContextOptions::default()) {
        Err(error) if error.is_without_driver() => Engine::on_cpu(),
        opened => opened?,
    };
    let choices = PictureChoices {
        integrator: Some(Integrator::Path),
        size: Some((1280, 720)),
        exposure: Some(2.5),
        ..PictureChoices::default()
    };
    let loaded = engine.load(forest(), &LoadRequest::pictures(choices))?;
    loaded.notes.iter().for_each(|note| eprintln!("{note}"));
    let mut renderer = engine.renderer(&loaded.world, &loaded.options)?;
    renderer.draw(&loaded.world.scene().camera, Goal::Samples(64), || ())?;
    output::write_picture(&picture, renderer.picture()?.as_ref())?;
    println!("{} on {}", picture.display(), engine.device_name());
    Ok(())
}

/// Pseudo-random numbers from 0 to 1 (SplitMix64, as in Steele, Lea, Flood: Fast Splittable Pseudorandom Number
/// Generators, 2014).
struct Random(u64);

impl Random {
    fn next(&mut self) -> f32 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let z = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 40) as f32 / (1 << 24) as f32
    }

    fn between(&mut self, low: f32, high: f32) -> f32 {
        low + (high - low) * self.next()
    }
}

/// Height of the ground, metres.
fn height(x: f32, z: f32) -> f32 {
    9.0 * (0.011 * x).sin() * (0.013 * z + 1.0).cos() + 3.0 * (0.031 * x + 0.027 * z).sin()
}

/// A tree: branches that divide, and leaves at the thin ones, as many as fit.
struct Tree {
    mesh: Mesh,
    random: Random,
    /// Where leaves may grow, and the direction of the branch there.
    twigs: Vec<(Vec3, Vec3)>,
}

impl Tree {
    fn grown(seed: u64) -> Mesh {
        let mut tree = Tree { mesh: Mesh::default(), random: Random(seed), twigs: Vec::new() };
        let lean = 0.1 * vec3(tree.random.next() - 0.5, 0.0, tree.random.next() - 0.5);
        let length = tree.random.between(2.2, 3.4);
        tree.branch(Vec3::ZERO, (Vec3::Y + lean).normalize(), length, 0.09 * length, 6);
        tree.leaves();
        tree.mesh
    }

    /// Adds a branch and those that grow from it. `order`: how many times it divides.
    fn branch(&mut self, from: Vec3, direction: Vec3, length: f32, radius: f32, order: u32) {
        let to = from + length * direction;
        self.cone(from, to, radius, 0.68 * radius);
        if order <= 2 {
            self.twigs.push((from.lerp(to, 0.3), direction));
            self.twigs.push((from.lerp(to, 0.8), direction));
        }
        if order == 0 {
            return;
        }
        let n_branches = if order > 3 { 3 } else { 4 };
        let turn = self.random.between(0.0, TAU);
        for i in 0..n_branches {
            let around = turn + TAU * i as f32 / n_branches as f32 + self.random.between(-0.4, 0.4);
            let spread = self.random.between(0.4, 0.85);
            let beside = Quat::from_axis_angle(direction, around) * direction.any_orthonormal_vector();
            let next = (direction + spread * beside + 0.12 * Vec3::Y).normalize();
            let share = self.random.between(0.62, 0.8);
            let start = from.lerp(to, self.random.between(0.7, 1.0));
            self.branch(start, next, share * length, 0.6 * radius, order - 1);
        }
    }

    fn cone(&mut self, from: Vec3, to: Vec3, radius: f32, end_radius: f32) {
        const N_SIDES: u32 = 6;
        let (u, v) = (to - from).normalize().any_orthonormal_pair();
        let first = self.mesh.positions.len() as u32;
        let around = |i: u32| {
            let (sin, cos) = (TAU * i as f32 / N_SIDES as f32).sin_cos();
            cos * u + sin * v
        };
        for i in 0..N_SIDES {
            self.mesh.push_position(from + radius * around(i));
            self.mesh.push_position(to + end_radius * around(i));
        }
        for i in 0..N_SIDES {
            let next = (i + 1) % N_SIDES;
            let [a, b, c, d] = [2 * i, 2 * next, 2 * next + 1, 2 * i + 1].map(|corner| first + corner);
            for face in [[a, b, c], [a, c, d]] {
                self.mesh.push_flat(face, 0);
                let normal = |ix: u32| around((ix - first) / 2);
                *self.mesh.normals.last_mut().expect("the face's") = face.map(normal);
            }
        }
    }

    /// Adds leaves of two triangles each.
    fn leaves(&mut self) {
        while self.mesh.faces.len() + 1 < TRIANGLES_OF_TREE {
            let (at, along) = self.twigs[(self.random.next() * self.twigs.len() as f32) as usize];
            let mut vector =
                |size: f32| size * vec3(self.random.next() - 0.5, self.random.next() - 0.5, self.random.next() - 0.5);
            let stem = at + vector(0.5);
            let towards = (along + vector(2.4)).normalize();
            let side = towards.cross(vector(1.0)).normalize_or(Vec3::X);
            let size = self.random.between(0.09, 0.16);
            let tip = stem + size * towards;
            let middle = stem + 0.45 * size * towards;
            let [a, b, c, d] = [stem, middle + 0.3 * size * side, tip, middle - 0.3 * size * side]
                .map(|corner| self.mesh.push_position(corner));
            self.mesh.push_flat([a, b, c], 1);
            self.mesh.push_flat([a, c, d], 1);
        }
    }
}

/// The ground below all trees, as squares of a quarter of their distance.
fn ground(half: f32) -> Mesh {
    const N: u32 = 400;
    let place = |i: u32| half * (2.0 * i as f32 / N as f32 - 1.0);
    let point = |x: u32, z: u32| vec3(place(x), height(place(x), place(z)), place(z));
    let mut mesh = Mesh::default();
    for (z, x) in (0..=N).flat_map(|z| (0..=N).map(move |x| (z, x))) {
        mesh.push_position(point(x, z));
    }
    for (z, x) in (0..N).flat_map(|z| (0..N).map(move |x| (z, x))) {
        let a = z * (N + 1) + x;
        mesh.push_flat([a, a + N + 1, a + N + 2], 0);
        mesh.push_flat([a, a + N + 2, a + 1], 0);
    }
    mesh
}

fn forest() -> Scene {
    let mut random = Random(0);
    let mut meshes: Vec<Mesh> = (1..=N_TREES).map(Tree::grown).collect();
    let colour = |name: &str, kd: Vec3| Material { name: name.to_owned(), kd, ka: kd, ..Material::default() };
    let mut materials = vec![colour("bark", vec3(0.16, 0.11, 0.08)), colour("earth", vec3(0.13, 0.14, 0.06))];
    let n_others = materials.len() as u32;
    let greens = (0..12).map(|i| {
        let share = i as f32 / 11.0;
        colour("leaves", vec3(0.07, 0.17, 0.04).lerp(vec3(0.22, 0.24, 0.05), share))
    });
    materials.extend(greens);
    let n_columns = N_PLACES.isqrt();
    let half = APART * n_columns as f32 / 2.0;
    let mut place = |i: u64| {
        let [x, z] = [i % n_columns, i / n_columns].map(|cell| APART * (cell as f32 + random.between(0.1, 0.9)) - half);
        let size = f64::from(random.between(0.75, 1.35));
        let turn = DQuat::from_rotation_y(f64::from(random.between(0.0, TAU)));
        let transform = Transform::new(DVec3::splat(size), turn, vec3(x, height(x, z) - 0.1, z).as_dvec3());
        Instance {
            mesh_ix: (random.next() * N_TREES as f32) as usize,
            transform: transform.expect("a turn, a size and a place"),
            materials: vec![0, n_others + (random.next() * 12.0) as u32],
            ..Instance::default()
        }
    };
    let mut instances: Vec<Instance> = (0..N_PLACES).map(&mut place).collect();
    instances.push(Instance { mesh_ix: meshes.len(), materials: vec![1], ..Instance::default() });
    meshes.push(ground(half));
    let eye = vec3(-0.4 * half, height(-0.4 * half, half) + 24.0, 1.02 * half);
    Scene {
        meshes,
        instances,
        materials,
        sky: Some(Sky::new([32.0, 250.0], Up::Y).expect("a sun above the horizon")),
        camera: Camera {
            eye,
            target: vec3(0.1 * half, height(0.0, 0.3 * half) + 2.0, 0.2 * half),
            up: Vec3::Y,
            projection: Projection::Perspective { vertical_fov_degrees: 40.0 },
        },
        ..Scene::empty(Path::new("forest"))
    }
}
