//! The structure of a scene whose meshes deform. It is built again for each frame, so its build counts as its rays do.

use glam::Vec3;
use hashbrown::HashMap;
use rayon::prelude::*;

use super::Workload;
use crate::{
    accel::{AccelKind, bottom_level::LEAST_DEVICE_TRIANGLES, grid::GridOptions},
    scene::{Mesh, Scene, mesh},
};

/// What a frame of a moving scene builds and traces.
#[derive(Clone, Copy, Debug, PartialEq)]
struct FrameWork {
    /// Number of meshes that devices build structures for and that may deform from frame to frame. They are built one
    /// after the other.
    n_meshes: usize,
    /// Number of their triangles.
    n_triangles: usize,
    n_rays: u64,
}

/// What a structure costs in a frame, in milliseconds. The figures fit measurements on an H200: diffuse rays in the
/// table "Scenes that change" of docs/performance.md.
struct Cost {
    /// The time of each build, however few triangles it has.
    build: f64,
    /// The time that a build takes in addition for a million triangles.
    triangles: f64,
    /// The time of a million rays through a million triangles.
    rays: f64,
    /// The time of rays grows with this power of the number of triangles.
    growth: f64,
}

const KD_TREE: Cost = Cost { build: 2.45, triangles: 8.16, rays: 0.3, growth: 0.0 };
/// With up to a million triangles, the uniform grid is never ahead of it by more than a millisecond.
const GRID2: Cost = Cost { build: 0.72, triangles: 0.87, rays: 1.55, growth: 1.0 / 6.0 };

/// A grid's cells suit a mesh if the triangles that share a cell are, in the mean over all triangles, at most this many
/// times the cube root of their number. Of an even surface it is 1.7.
const MOST_SHARING: f64 = 8.0;

/// Returns the kind of structure with which build and rays of a frame take the least time, and a note that says why.
/// There is none if nothing deforms, if paths are traced, whose rays are too many for a grid, or if costs of rays are
/// shown, which depend on the structure. `workload`: that of one frame.
pub(super) fn quickest(scene: &Scene, workload: &Workload) -> Option<(AccelKind, String)> {
    let deformed = scene.meshes.iter().filter(|mesh| mesh.deforms && mesh.faces.len() >= LEAST_DEVICE_TRIANGLES);
    let n_meshes = deformed.clone().count();
    if n_meshes == 0 || workload.traces_paths || workload.shows_costs {
        return None;
    }
    let n_triangles = deformed.map(|mesh| mesh.faces.len()).sum();
    let frame = FrameWork { n_meshes, n_triangles, n_rays: workload.n_rays };
    let taken = match frame.quickest() {
        AccelKind::Grid2 if !scene.meshes.par_iter().all(is_even) => {
            let why = "some mesh's triangles are too unevenly spread for grid2, which would be quicker to build";
            return Some((AccelKind::KdTree, format!("--accel kdtree is taken: {why}")));
        }
        taken => taken,
    };
    let [kd_tree, grid2] = [KD_TREE, GRID2].map(|cost| frame.ms(&cost));
    let note = format!(
        "--accel {taken} is taken, since {n_triangles} triangles may deform: build and rays of a frame take some \
         {kd_tree:.1} ms with kdtree and {grid2:.1} ms with grid2 on an H200"
    );
    Some((taken, note))
}

impl FrameWork {
    /// Returns the estimated time of build and rays, ms.
    fn ms(&self, cost: &Cost) -> f64 {
        let [triangles, rays] = [self.n_triangles as f64, self.n_rays as f64].map(|n| 1e-6 * n);
        cost.build * self.n_meshes as f64 + cost.triangles * triangles + cost.rays * triangles.powf(cost.growth) * rays
    }

    fn quickest(&self) -> AccelKind {
        if self.ms(&GRID2) < self.ms(&KD_TREE) { AccelKind::Grid2 } else { AccelKind::KdTree }
    }
}

/// Whether triangles are evenly spread over the cells of the upper level of a grid.
fn is_even(mesh: &Mesh) -> bool {
    let n = mesh.faces.len();
    if n < LEAST_DEVICE_TRIANGLES {
        return true;
    }
    // A face may name a point that does not exist. World::with_accel refuses such meshes later.
    let point = |ix: u32| mesh.positions.get(ix as usize).copied().unwrap_or_default();
    let place = |face: &[u32; 3]| face.map(point).into_iter().sum::<Vec3>();
    let (min, max) = mesh::bounds_of(mesh.faces.par_iter().map(place));
    let size = (max - min).max(Vec3::splat((max - min).max_element() * 1e-3));
    let n_cells = GridOptions::two_level().levels.upper_density() * n as f32;
    let cell = (size / size.max_element()).element_product().cbrt() * size.max_element() / n_cells.cbrt();
    let mut counts = HashMap::<_, u32>::new();
    for at in mesh.faces.iter().map(place) {
        *counts.entry(((at - min) / cell).as_uvec3()).or_default() += 1;
    }
    let sum: f64 = counts.values().map(|count| f64::from(*count).powi(2)).sum();
    sum / n as f64 <= MOST_SHARING * (n as f64).cbrt()
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;
    use crate::frame::RenderOptions;

    fn chosen(n_meshes: usize, n_triangles: usize, n_rays: u64) -> AccelKind {
        FrameWork { n_meshes, n_triangles, n_rays }.quickest()
    }

    #[test]
    fn few_rays_go_through_grids_and_many_through_kd_trees() {
        for (n_triangles, n_rays) in [(203_000, 3_600_000), (810_000, 6_400_000), (3_240_000, 16_000_000)] {
            assert_eq!(chosen(1, n_triangles, n_rays * 9 / 10), AccelKind::Grid2, "{n_triangles}");
            assert_eq!(chosen(1, n_triangles, n_rays * 11 / 10), AccelKind::KdTree, "{n_triangles}");
        }
        // Each mesh is a build.
        assert_eq!(chosen(20, 203_000, 30_000_000), AccelKind::Grid2);
    }

    #[test]
    fn what_does_not_suit_grids_has_kd_trees() {
        let few = Workload::of_pictures(&RenderOptions { width: 64, height: 64, ..Default::default() }, 1, 1);
        let deforming = |mesh| {
            let meshes = vec![Mesh { deforms: true, ..mesh }];
            Scene { meshes, ..Scene::empty(Path::new("scene")) }
        };
        let (kind, note) = quickest(&deforming(sheet(1.0)), &few).unwrap();
        assert_eq!(kind, AccelKind::Grid2);
        assert!(note.starts_with("--accel grid2 is taken, since 9900 triangles may deform: build and rays"), "{note}");
        let mut uneven = sheet(1.0);
        uneven.append(sheet(1e-3));
        assert_eq!(quickest(&deforming(uneven), &few).unwrap().0, AccelKind::KdTree);
        let (paths, costs) = (Workload { traces_paths: true, ..few }, Workload { shows_costs: true, ..few });
        assert_eq!([paths, costs].map(|workload| quickest(&deforming(sheet(1.0)), &workload)), [None, None]);
        let rigid = Scene { meshes: vec![sheet(1.0)], ..Scene::empty(Path::new("scene")) };
        assert_eq!(quickest(&rigid, &few), None);
    }

    fn sheet(scale: f32) -> Mesh {
        let at = |u: f32, v: f32| Vec3::new(u, v, (u * 7.0).sin()) * scale;
        let positions = (0..10_000).map(|ix| at((ix % 100) as f32 / 100.0, (ix / 100) as f32 / 100.0)).collect();
        Mesh::of_triangles(positions, (0..9_900).map(|ix| [ix, ix + 1, ix + 100]).collect())
    }
}
