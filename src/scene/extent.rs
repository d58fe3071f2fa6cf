//! Limits on a scene's size and on its distance from the origin, within which single precision tells its triangles
//! apart.

use std::path::Path;

use glam::Vec3;

use super::SceneError;

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

/// Refuses a scene that is too small to be traced, and warns of one that lies so far from the origin that its
/// coordinates are coarse. `(min, max)` are the bounds of all triangles, world space.
pub(super) fn check(path: &Path, (min, max): (Vec3, Vec3)) -> Result<(), SceneError> {
    let extent = (max.as_dvec3() - min.as_dvec3()).max_element();
    let largest = min.abs().max(max.abs()).max_element();
    let spacing = f64::from(largest.next_up()) - f64::from(largest);
    let is_coarse = extent < MIN_STEPS * spacing;
    let precision = format!(
        "its coordinates reach {largest:e}, where single-precision numbers are {spacing:.2e} apart, and its longest \
         side is {extent:.2e}"
    );
    if extent < f64::from(MIN_EXTENT) {
        let cure = if is_coarse && largest >= MIN_EXTENT { "move it to the origin" } else { "scale it up" };
        let what = format!("is too small to be traced: {precision}, less than {MIN_EXTENT:e}; {cure}");
        return Err(SceneError::file(path, what));
    }
    if is_coarse {
        // A few digits are enough for a point near the middle.
        let step = 10_f64.powf(extent.log10().floor());
        let middle = (min.as_dvec3() + max.as_dvec3()) / 2.0;
        let [x, y, z] = (middle / step).round().to_array().map(|n| n * step);
        tracing::warn!(
            "{}: {precision}: smaller details are lost; `origin = [{x:?}, {y:?}, {z:?}]` in the [[mesh]] table of a \
             scene file keeps what an OBJ, PLY or STL file has of them",
            path.display()
        );
    }
    Ok(())
}
