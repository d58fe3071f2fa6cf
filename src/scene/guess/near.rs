//! The part of a scene that a new camera shows: all of it, except a few small things that are far away from the rest.
//!
//! Programs leave such things behind: a speck at the origin of a map, a copy that was moved away, a broken facet. In a
//! picture of everything, the rest would be a dot.

use std::path::Path;

use glam::Vec3;
use rayon::prelude::*;

use crate::scene::{
    meshes::ground::Ground,
    model::{Instance, Scene},
};

/// Least ratio of the longest side of a box to that of its core, where things in the box are far away from the core. In
/// a picture 1024 pixels wide, the core would cover 32 of them.
const FAR: usize = 32;
/// Most of the area of all triangles that things far away may have together, as a share.
const FAR_AREA: f64 = 0.01;
/// Most of all triangles that may be far away, as a share. A house of a dozen triangles counts more than a marker of
/// three dozen; what has nearly all triangles is what a scene is about.
const FAR_TRIANGLES: f64 = 0.8;

/// Number of slices into which a box is cut along each axis.
const N_SLICES: usize = 1024;
/// Number of times that a box is made smaller, each time by a factor of at least [`FAR`] / 3.
const N_CUTS: usize = 8;
/// Number of triangles of a sample. Of most scenes, the sample shows that nothing is far away, and the full search is
/// skipped.
const N_SAMPLED: usize = 1 << 17;
/// Number of triangles that one thread looks at at a time.
const TRIANGLES_PER_CHUNK: usize = 65_536;
/// Number of units of area in the square of the diagonal of the scene's box. Areas are whole numbers, whose sums do not
/// depend on the order of the summands. 2^31 triangles of the largest area fit into 128 bits.
const AREA_UNITS: f64 = (1_u128 << 96) as f64;

/// A box: its smallest and largest coordinates, world space.
type Bounds = (Vec3, Vec3);

/// The part of a scene that a picture shows.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct NearPart {
    /// The box around its triangles.
    pub bounds: Bounds,
    /// Number of triangles that are not in it.
    n_far: usize,
    /// Whether some of them have an area.
    has_visible_far: bool,
}

impl NearPart {
    /// Finds the near part of some instances of a scene.
    pub fn of(scene: &Scene, instances: &[Instance]) -> Self {
        let mut near = Self { bounds: scene.bounds_of(instances), n_far: 0, has_visible_far: false };
        let diagonal = f64::from((near.bounds.1 - near.bounds.0).length());
        let triangles = Triangles { scene, instances, unit: diagonal * diagonal / AREA_UNITS };
        let n_triangles: usize = instances.iter().map(|instance| scene.meshes[instance.mesh_ix].faces.len()).sum();
        let step = n_triangles.div_ceil(N_SAMPLED).max(1);
        // The core of a sample may be larger than that of all triangles, so this test is half as strict.
        if step > 1 && !is_small(triangles.core(near.bounds, step), near.bounds, FAR / 2) {
            return near;
        }
        let mut all = None;
        for _ in 0..N_CUTS {
            let core = triangles.core(near.bounds, 1);
            if !is_small(core, near.bounds, FAR) {
                break;
            }
            let all = *all.get_or_insert_with(|| triangles.within(near.bounds));
            // What is beside the core belongs to it.
            let margin = Vec3::splat((core.1 - core.0).max_element());
            let kept = triangles.within((core.0 - margin, core.1 + margin));
            let n_far = all.n - kept.n;
            let is_little = (all.area - kept.area) as f64 <= FAR_AREA * all.area as f64
                && n_far as f64 <= FAR_TRIANGLES * all.n as f64;
            if !is_little || n_far == near.n_far {
                break;
            }
            near = Self { bounds: kept.bounds, n_far, has_visible_far: kept.area < all.area };
        }
        near
    }

    /// Returns whether it is the whole scene.
    pub fn is_whole(&self) -> bool {
        self.n_far == 0
    }

    /// Returns whether a point of world space is in its box.
    pub fn contains(&self, point: Vec3) -> bool {
        let (min, max) = self.bounds;
        point.cmpge(min).all() && point.cmple(max).all()
    }

    /// Tells the user of what the picture leaves out. `path` is the scene's file.
    pub fn warn_of_far(&self, path: &Path, scene: &Scene) {
        if self.has_visible_far {
            tracing::warn!(
                "{}: {} of {} triangles are so far away that the others would be a dot in a picture of all: the \
                 picture shows the others; --eye and --target show all",
                path.display(),
                self.n_far,
                scene.n_triangles()
            );
        }
    }
}

impl Scene {
    /// Returns the bounds of what a picture of the scene is about: without the ground that a mesh gets under a sky, and
    /// without a few things that are far away. Those of a scene without triangles are a cube around the origin.
    pub fn shown_bounds(&self) -> (Vec3, Vec3) {
        let n_grounds = usize::from(Ground::of(self).is_some());
        let things = &self.instances[..self.instances.len() - n_grounds];
        if things.iter().all(|instance| self.meshes[instance.mesh_ix].faces.is_empty()) {
            return (Vec3::NEG_ONE, Vec3::ONE);
        }
        NearPart::of(self, things).bounds
    }
}

/// The triangles of some instances of a scene.
struct Triangles<'a> {
    scene: &'a Scene,
    instances: &'a [Instance],
    /// Unit of areas.
    unit: f64,
}

/// Some triangles, all together.
#[derive(Clone, Copy)]
struct Sum {
    n: usize,
    bounds: Bounds,
    area: u128,
}

/// Area along each axis, by the places of the triangles' corners.
struct Slices([Vec<u128>; 3]);

impl Triangles<'_> {
    /// Folds every `step`-th triangle of each mesh. A triangle is three points of world space and has an area. The area
    /// is multiplied, so that those of a mesh's sample have about the sum of all.
    fn fold<T: Send>(
        &self,
        step: usize,
        none: impl Fn() -> T + Sync,
        add: impl Fn(&mut T, [Vec3; 3], u128) + Sync,
        join: impl Fn(T, T) -> T + Sync,
    ) -> T {
        let of_instance = |Instance { mesh_ix, transform, .. }: &Instance| {
            let mesh = &self.scene.meshes[*mesh_ix];
            let (n_faces, n_sampled) = (mesh.faces.len() as u128, mesh.faces.len().div_ceil(step).max(1) as u128);
            let of_faces = |mut sum: T, face: &[u32; 3]| {
                let corners @ [a, b, c] = face.map(|ix| transform.point(mesh.positions[ix as usize]));
                let [a, b, c] = [a, b, c].map(|p| p.as_dvec3());
                let area = ((b - a).cross(c - a).length() / 2.0 / self.unit) as u128;
                add(&mut sum, corners, area * n_faces / n_sampled);
                sum
            };
            let faces = mesh.faces.par_iter().step_by(step).with_min_len(TRIANGLES_PER_CHUNK);
            faces.fold(&none, of_faces).reduce(&none, &join)
        };
        self.instances.iter().map(of_instance).fold(none(), &join)
    }

    /// Returns the sum of the triangles that are in a box with all corners.
    fn within(&self, (min, max): Bounds) -> Sum {
        let none = || Sum { n: 0, bounds: (Vec3::INFINITY, Vec3::NEG_INFINITY), area: 0 };
        let join = |a: Sum, b: Sum| Sum {
            n: a.n + b.n,
            bounds: (a.bounds.0.min(b.bounds.0), a.bounds.1.max(b.bounds.1)),
            area: a.area + b.area,
        };
        let add = |sum: &mut Sum, [a, b, c]: [Vec3; 3], area: u128| {
            let bounds @ (least, most) = (a.min(b).min(c), a.max(b).max(c));
            if least.cmpge(min).all() && most.cmple(max).all() {
                *sum = join(*sum, Sum { n: 1, bounds, area });
            }
        };
        self.fold(1, none, add, join)
    }

    /// Returns the core of a box: the slices that are left if [`FAR_AREA`] of the area is taken from each end of each
    /// axis. Every `step`-th triangle counts.
    fn core(&self, bounds @ (min, max): Bounds, step: usize) -> Bounds {
        let size = max - min;
        let Slices(slices) = self.slices(bounds, step);
        let kept = slices.map(|slices| kept_slices(&slices));
        let place = |ix: [usize; 3]| min + size * Vec3::from_array(ix.map(|ix| ix as f32 / N_SLICES as f32));
        (place(kept.map(|(first, _)| first)), place(kept.map(|(_, last)| last + 1)))
    }

    fn slices(&self, (min, max): Bounds, step: usize) -> Slices {
        let scale = N_SLICES as f32 / (max - min).max(Vec3::splat(f32::MIN_POSITIVE));
        let add = |Slices(slices): &mut Slices, corners: [Vec3; 3], area: u128| {
            let is_in = |p: &Vec3| p.cmpge(min).all() && p.cmple(max).all();
            if !corners.iter().all(is_in) {
                return;
            }
            for corner in corners {
                let place = (corner - min) * scale;
                for (axis, slices) in slices.iter_mut().enumerate() {
                    slices[(place[axis] as usize).min(N_SLICES - 1)] += area;
                }
            }
        };
        let none = || Slices([const { Vec::new() }; 3].map(|_: Vec<u128>| vec![0; N_SLICES]));
        let join = |Slices(mut a): Slices, Slices(b): Slices| {
            a.iter_mut().zip(&b).for_each(|(a, b)| a.iter_mut().zip(b).for_each(|(a, b)| *a += b));
            Slices(a)
        };
        self.fold(step, none, add, join)
    }
}

/// Returns whether a core is smaller than its box by at least a factor.
fn is_small(core: Bounds, bounds: Bounds, factor: usize) -> bool {
    (core.1 - core.0).max_element() * factor as f32 <= (bounds.1 - bounds.0).max_element()
}

/// Returns the first and the last slice of those that are left.
fn kept_slices(slices: &[u128]) -> (usize, usize) {
    let most = (slices.iter().sum::<u128>() as f64 * FAR_AREA) as u128;
    let n_left_out = |slices: &mut dyn Iterator<Item = &u128>| {
        let sums = slices.scan(0, |sum, area| {
            *sum += area;
            Some(*sum)
        });
        sums.take_while(|sum| *sum <= most).count()
    };
    let (first, after) = (n_left_out(&mut slices.iter()), n_left_out(&mut slices.iter().rev()));
    (first.min(N_SLICES - 1), N_SLICES - 1 - after.min(N_SLICES - 1))
}

#[cfg(test)]
mod tests {
    use glam::{DQuat, DVec3};

    use super::*;
    use crate::scene::model::{Mesh, Transform};

    /// Returns a mesh of triangles in a row, each with an area of a half.
    fn row(n: usize) -> Mesh {
        let positions = (0..n).flat_map(|ix| [Vec3::ZERO, Vec3::X, Vec3::Y].map(|p| p + (ix % 50) as f32 * Vec3::Z));
        let faces: Vec<[u32; 3]> = (0..n as u32).map(|ix| [3 * ix, 3 * ix + 1, 3 * ix + 2]).collect();
        let (normals, slots) = (vec![[Vec3::Z; 3]; n], vec![0; n]);
        Mesh { positions: positions.collect(), faces, normals, slots, ..Mesh::default() }
    }

    fn scene_of(meshes: [(usize, f64); 2]) -> Scene {
        let mut scene = Scene::empty(Path::new("scene"));
        for (n, x) in meshes {
            let place = Transform::new(DVec3::ONE, DQuat::IDENTITY, DVec3::new(x, 0.0, 0.0)).unwrap();
            scene.push_mesh(row(n), place, vec![0]).unwrap();
        }
        scene
    }

    /// A small mesh has at least one triangle in a sample, and yet no more than its share of the area.
    #[test]
    fn samples_weigh_meshes_by_their_areas() {
        let scene = scene_of([(20_000, 0.0), (2, 1e5)]);
        let triangles = Triangles { scene: &scene, instances: &scene.instances, unit: 1e-6 };
        for step in [1, 77, 5000] {
            let core = triangles.core(scene.bounds(), step);
            assert!(is_small(core, scene.bounds(), FAR), "step {step}: {core:?}");
        }
    }

    #[test]
    fn a_viewer_moves_around_what_is_near() {
        let (min, max) = scene_of([(2000, 0.0), (2, 1e5)]).shown_bounds();
        assert!((max - min).max_element() < 60.0, "{min} {max}");
        assert_eq!(Scene::empty(Path::new("scene")).shown_bounds(), (Vec3::NEG_ONE, Vec3::ONE));
    }
}
