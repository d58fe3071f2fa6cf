//! Limits on a scene's size and on its distance from the origin, within which single precision tells its triangles
//! apart.

use std::path::Path;

use glam::{DVec3, Vec3};
use rayon::prelude::*;

use super::{Scene, SceneError, mesh::bounds_of};

/// Smallest length of a scene's longest side. Smaller scenes are refused, because products of their coordinates would
/// underflow.
///
/// Let L be the longest side and s the size of a triangle. The hit test multiplies pairs of coordinates perpendicular
/// to the ray, each of size s, which gives edge functions of size s^2. It adds these up to the determinant, and
/// multiplies them by depths of size L to find t. Devices may flush values below 2^-126 to zero. Two conditions
/// follow:
///
/// - t is right to single precision only if a flushed value is less than 2^-24 of the sum: s^2 L >= 2^-102. With
///   L = 1e-8 > 2^-27, this holds for s >= 2^-37.5.
/// - At edges that the ray meets, the test adds each product's rounding error to the product. The sum is exact only
///   if no rounding error is flushed. The smallest that is not 0 is 2^-48 of s^2, so s^2 >= 2^-78. This holds for
///   s >= 2^-39.
///
/// Triangles may thus be as small as 2^-10.5 of the scene; a surface has some two million triangles of that size. All
/// other products of the traversal and of shading are of lower degree, or of vectors that were scaled to unit length.
pub const MIN_EXTENT: f32 = 1e-8;

/// Least number of single-precision steps along a scene's longest side. With fewer steps, a picture could show detail
/// that the coordinates have lost: one step is a sixteenth of a pixel in a picture 4096 pixels wide.
const MIN_STEPS: f64 = 65_536.0;

/// Which point of a mesh file becomes the origin of its mesh.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum MeshOrigin {
    /// This one.
    At(DVec3),
    /// The file's own origin, or a point near the mesh if the mesh is so far from it that single precision is coarse.
    Near,
}

impl MeshOrigin {
    /// Returns the origin with which a file is read first.
    pub fn first(self) -> DVec3 {
        match self {
            Self::At(origin) => origin,
            Self::Near => DVec3::ZERO,
        }
    }

    /// Returns the origin with which a file has to be read again, if there is one. `points` are those of the mesh, as
    /// it has been read with the first origin. A few of them may be far away from the rest, as one at 0 in a file of a
    /// map is: the origin is near the rest.
    pub fn second(self, points: &[Vec3]) -> Option<DVec3> {
        if let Self::At(_) = self {
            return None;
        }
        let coarse = |bounds: (Vec3, Vec3)| Measure::of(bounds).filter(|it| it.is_coarse);
        let of_most = || bounds_of_most(points).filter(|(min, max)| min != max);
        let all = bounds_of(points.par_iter().copied().filter(|p| p.is_finite()));
        coarse(all).or_else(|| coarse(of_most()?)).map(|it| it.middle)
    }
}

/// Most points of a sample that tells where most points of a mesh are.
const N_SAMPLE: usize = 2048;
/// Share of the sample that is left out at each end of each axis.
const LEFT_OUT: f64 = 0.1;

/// Returns the box around most of the points, or `None` if there are none.
fn bounds_of_most(points: &[Vec3]) -> Option<(Vec3, Vec3)> {
    let step = points.len().div_ceil(N_SAMPLE).max(1);
    let sample: Vec<Vec3> = points.iter().step_by(step).copied().filter(|p| p.is_finite()).collect();
    let n_left_out = (sample.len() as f64 * LEFT_OUT) as usize;
    let ends = |axis: usize| {
        let mut places: Vec<f32> = sample.iter().map(|p| p[axis]).collect();
        places.sort_by(f32::total_cmp);
        Some((*places.get(n_left_out)?, *places.get(places.len() - 1 - n_left_out)?))
    };
    let [x, y, z] = [ends(0)?, ends(1)?, ends(2)?];
    Some((Vec3::new(x.0, y.0, z.0), Vec3::new(x.1, y.1, z.1)))
}

/// The size of a box around points, and what single precision makes of it.
#[derive(Clone, Copy, Debug)]
struct Measure {
    /// The longest side.
    extent: f64,
    /// The largest absolute value of a coordinate.
    largest: f32,
    /// The distance of the numbers of single precision at the largest coordinate.
    spacing: f64,
    is_coarse: bool,
    /// A point near the middle, of few digits.
    middle: DVec3,
}

impl Measure {
    /// Returns the measure of a box, or `None` if the box is empty.
    fn of((min, max): (Vec3, Vec3)) -> Option<Self> {
        if !(min.is_finite() && max.is_finite()) {
            return None;
        }
        let extent = (max.as_dvec3() - min.as_dvec3()).max_element();
        let largest = min.abs().max(max.abs()).max_element();
        let spacing = f64::from(largest.next_up()) - f64::from(largest);
        // Powers of ten are exact from 1 on, so steps below 1 are divisors.
        let digits = extent.max(spacing).max(f64::from(f32::MIN_POSITIVE)).log10().floor() as i32;
        let round = |x: f64| match digits >= 0 {
            true => (x / 10_f64.powi(digits)).round() * 10_f64.powi(digits),
            false => (x * 10_f64.powi(-digits)).round() / 10_f64.powi(-digits),
        };
        let middle = (min.as_dvec3() + max.as_dvec3()) / 2.0;
        let middle = DVec3::from_array(middle.to_array().map(round));
        Some(Self { extent, largest, spacing, is_coarse: extent < MIN_STEPS * spacing, middle })
    }

    fn in_words(&self) -> String {
        let Self { extent, largest, spacing, .. } = self;
        format!(
            "its coordinates reach {largest:e}, where single-precision numbers are {spacing:.2e} apart, and its \
             longest side is {extent:.2e}"
        )
    }
}

/// Moves a scene to the origin if its coordinates are so large that single precision would lose details, and tells the
/// user so. The meshes keep the precision that their files have, since transforms are in double precision. Lights and
/// cameras are left to the caller. `path` is the scene's file.
pub(crate) fn recentre(path: &Path, scene: &mut Scene) {
    let Some(measure) = Measure::of(scene.bounds()).filter(|it| it.is_coarse && it.largest >= MIN_EXTENT) else {
        return;
    };
    scene.instances.iter_mut().for_each(|it| it.transform = it.transform.moved(-measure.middle));
    scene.origin = measure.middle;
    note(path, scene.origin);
}

/// Tells the user that a scene has another origin than its file.
pub(crate) fn note(path: &Path, origin: DVec3) {
    let path = path.display();
    tracing::info!(
        "{path}: its coordinates are large, so the scene is computed around {:?} of the file",
        origin.to_array()
    );
}

/// Refuses a scene that is too small to be traced, and warns of one that lies so far from the origin that its
/// coordinates are coarse. `bounds` are those of all triangles, world space.
pub(crate) fn check(path: &Path, bounds: (Vec3, Vec3)) -> Result<(), SceneError> {
    let Some(measure) = Measure::of(bounds) else { return Ok(()) };
    let Measure { extent, largest, is_coarse, middle, .. } = measure;
    if extent < f64::from(MIN_EXTENT) {
        let cure = if is_coarse && largest >= MIN_EXTENT { "move it to the origin" } else { "scale it up" };
        let precision = measure.in_words();
        let what = format!("is too small to be traced: {precision}, less than {MIN_EXTENT:e}; {cure}");
        return Err(SceneError::file(path, what));
    }
    if is_coarse {
        tracing::warn!(
            "{}: {}: smaller details are lost; `origin = {:?}` in the [[mesh]] table of a scene file keeps what an \
             OBJ, PLY or STL file has of them",
            path.display(),
            measure.in_words(),
            middle.to_array()
        );
    }
    Ok(())
}
