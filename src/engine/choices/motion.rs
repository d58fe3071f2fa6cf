//! The structure of a scene whose meshes deform. It is built again for each frame, so its build counts as its rays do.

use std::collections::HashMap;

use glam::Vec3;

use super::Workload;
use crate::{
    accel::{AccelKind, bottom_level::LEAST_DEVICE_TRIANGLES, grid::GridOptions},
    scene::{Mesh, Scene},
};

/// What a frame of a moving scene costs.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FrameWork {
    /// Number of triangles that deform from frame to frame.
    n_deformed: usize,
    /// Number of rays of a frame; none if paths are traced, which are long.
    n_rays: Option<u64>,
    /// Whether triangles are so evenly spread in each mesh that a grid suits it.
    is_even: bool,
}

/// Milliseconds of a frame: of a build as such, and of a million triangles and rays of it. Measured on an H200
/// (docs/performance.md): builds are those of "Scenes that change"; rays are between the diffuse ones there, which take
/// 0.3 and 1.9 ms, and those of frames of a glass knot ("Films"), 0.6 and 1.4 ms.
struct Cost {
    build: f64,
    triangles: f64,
    rays: f64,
}

const KD_TREE: Cost = Cost { build: 3.45, triangles: 11.2, rays: 0.4 };
/// The uniform grid is never ahead of it by more than half a millisecond.
const GRID2: Cost = Cost { build: 0.72, triangles: 0.87, rays: 1.7 };

/// A grid's cells suit a mesh if the triangles that share a cell are, in the mean over all triangles, at most this many
/// times the cube root of their number. Of an even surface it is 1.7.
const MOST_SHARING: f64 = 8.0;

impl FrameWork {
    /// `workload`: that of one frame.
    pub fn of(scene: &Scene, workload: &Workload) -> Self {
        let n_deformed = scene.meshes.iter().filter(|mesh| mesh.deforms).map(|mesh| mesh.faces.len()).sum();
        let n_rays = (!workload.traces_paths).then_some(workload.n_rays);
        Self { n_deformed, n_rays, is_even: n_deformed > 0 && scene.meshes.iter().all(is_even) }
    }

    #[cfg(test)]
    pub(super) fn fixed(n_deformed: usize, n_rays: u64) -> Self {
        Self { n_deformed, n_rays: Some(n_rays), is_even: true }
    }

    /// Returns the estimated time of a frame's build and rays, ms; none where the structure does not suit.
    fn ms(&self, kind: AccelKind) -> Option<f64> {
        let Cost { build, triangles, rays } = match kind {
            AccelKind::KdTree => KD_TREE,
            AccelKind::Grid2 if self.is_even => GRID2,
            _ => return None,
        };
        Some(build + 1e-6 * (triangles * self.n_deformed as f64 + rays * self.n_rays? as f64))
    }

    /// Returns the kind of structure that takes the least time.
    pub(super) fn quickest(&self) -> AccelKind {
        match [AccelKind::KdTree, AccelKind::Grid2].map(|kind| self.ms(kind)) {
            [Some(kd_tree), Some(grid2)] if grid2 < kd_tree => AccelKind::Grid2,
            _ => AccelKind::KdTree,
        }
    }

    /// Returns a sentence about the choice between both structures; none if there was none.
    pub fn note(&self) -> Option<String> {
        let (kd_tree, grid2) = (self.ms(AccelKind::KdTree)?, self.ms(AccelKind::Grid2)?);
        let (taken, other) = match self.quickest() {
            AccelKind::KdTree => ("kdtree", "grid2"),
            _ => ("grid2", "kdtree"),
        };
        Some(format!(
            "--accel {taken} is taken, since {} triangles deform: build and rays of a frame take some {kd_tree:.1} ms \
             with kdtree and {grid2:.1} ms with grid2 on an H200; --accel {other} overrules that",
            self.n_deformed
        ))
    }
}

/// Whether triangles are evenly spread over the cells of the upper level of a grid.
fn is_even(mesh: &Mesh) -> bool {
    let n = mesh.faces.len();
    if n < LEAST_DEVICE_TRIANGLES {
        return true;
    }
    let places = || mesh.faces.iter().map(|face| face.map(|ix| mesh.positions[ix as usize]).into_iter().sum::<Vec3>());
    let (min, max) = places().fold((Vec3::MAX, Vec3::MIN), |(min, max), at| (min.min(at), max.max(at)));
    let size = (max - min).max(Vec3::splat((max - min).max_element() * 1e-3));
    let n_cells = GridOptions::two_level().levels.upper_density() * n as f32;
    let cell = (size / size.max_element()).element_product().cbrt() * size.max_element() / n_cells.cbrt();
    let mut counts = HashMap::<_, u32>::new();
    places().for_each(|at| *counts.entry(((at - min) / cell).as_uvec3()).or_default() += 1);
    let sum: f64 = counts.values().map(|count| f64::from(*count).powi(2)).sum();
    sum / n as f64 <= MOST_SHARING * (n as f64).cbrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn chosen(n_deformed: usize, n_rays: u64) -> AccelKind {
        FrameWork::fixed(n_deformed, n_rays).quickest()
    }

    #[test]
    fn few_rays_go_through_grids_and_many_through_kd_trees() {
        for (n_deformed, n_rays) in [(203_000, 3_700_000), (810_000, 8_500_000), (3_240_000, 27_800_000)] {
            assert_eq!(chosen(n_deformed, n_rays * 9 / 10), AccelKind::Grid2, "{n_deformed}");
            assert_eq!(chosen(n_deformed, n_rays * 11 / 10), AccelKind::KdTree, "{n_deformed}");
        }
        let few = FrameWork::fixed(203_000, 1000);
        assert!(few.note().unwrap().starts_with("--accel grid2 is taken, since 203000 triangles deform"));
        for unsuited in [FrameWork { is_even: false, ..few }, FrameWork { n_rays: None, ..few }] {
            assert_eq!((unsuited.quickest(), unsuited.note()), (AccelKind::KdTree, None));
        }
    }

    #[test]
    fn a_body_in_a_stadium_is_uneven() {
        let at = |u: usize, v: usize, scale: f32| {
            let (u, v) = (u as f32 / 100.0, v as f32 / 100.0);
            Vec3::new(u, v, (u * 7.0).sin()) * scale
        };
        let sheet = |scale| {
            let places = (0..10_000).map(move |ix| at(ix % 100, ix / 100, scale));
            let positions: Vec<_> = places.collect();
            let faces = (0..9_900_u32).map(|ix| [ix, ix + 1, ix + 100]).collect();
            Mesh::of_triangles(positions, faces)
        };
        assert!(is_even(&sheet(1.0)));
        let mut both = sheet(1.0);
        both.append(sheet(1e-3));
        assert!(!is_even(&both));
    }
}
