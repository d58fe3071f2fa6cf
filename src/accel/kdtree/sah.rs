//! Surface area heuristic (SAH): the cost of splits of a cell.
//!
//! Splits of a cell are compared by their *weights*. A weight is the expected number of ray-triangle tests below a
//! split, `p_below * n_below + p_above * n_above`, where p is the child's share of the cell's surface (MacDonald and
//! Booth 1990). Along an axis the weight is linear between the places where triangles' bounds begin or end, so only
//! planes through these need be tried.

use super::BuildOptions;
use crate::accel::bounds::Bounds;

/// The least extent on an axis at which a cell is split on that axis, world units: 2^-115. The greatest extent is
/// `f32::MAX`. The lower limit keeps the quotient of 1024 bins and the extent finite in f32. The upper limit keeps a
/// plane's distance from the cell's face finite.
const MIN_EXTENT: f64 = f32::MIN_POSITIVE as f64 * 2048.0;

/// A plane that splits a cell, and the weight of the split.
#[derive(Clone, Copy, Debug)]
pub struct Split {
    pub axis: usize,
    pub position: f32,
    /// Expected ray-triangle tests of a ray through the cell, after the bonus for cutting off empty space.
    pub weight: f32,
    /// The number of triangles below and above. Triangles that straddle the plane count on both sides.
    pub n_references: [u32; 2],
}

impl Split {
    /// No split: its weight is worse than any other.
    pub const NONE: Self = Self { axis: 0, position: 0.0, weight: f32::INFINITY, n_references: [0; 2] };
}

/// Surface areas of the two parts into which a plane perpendicular to `axis` splits a cell, as linear functions of
/// the plane's position. The areas are shares of the cell's surface area.
#[derive(Clone, Copy, Debug)]
pub struct ChildAreas {
    pub axis: usize,
    /// The cell's least coordinate on the axis, world units.
    pub min: f32,
    /// The cell's greatest coordinate on the axis, world units.
    pub max: f32,
    /// 1 / extent of the cell on the axis.
    pub per_extent: f32,
    /// The share of a part of thickness 0, which comes from its two faces parallel to the plane.
    base: f32,
    /// The increase of the share from a part of thickness 0 to the whole cell.
    slope: f32,
    /// Factor on the weight of a split with an empty side.
    empty_factor: f32,
}

impl ChildAreas {
    /// Returns none where no plane can split the cell: its extent on this axis is too small or too large, or it has
    /// no surface.
    pub fn new(cell: &Bounds, axis: usize, options: &BuildOptions) -> Option<Self> {
        let extent = cell.extent();
        let [along, u, v] = [extent[axis], extent[(axis + 1) % 3], extent[(axis + 2) % 3]];
        let half_area = along * u + along * v + u * v;
        (along >= MIN_EXTENT && along <= f64::from(f32::MAX) && half_area > 0.0).then(|| Self {
            axis,
            min: cell.min[axis],
            max: cell.max[axis],
            per_extent: (1.0 / along) as f32,
            base: (u * v / half_area) as f32,
            slope: (along * (u + v) / half_area) as f32,
            empty_factor: 1.0 - options.empty_bonus,
        })
    }

    /// Returns the position of a plane in the cell as a fraction of the extent, 0 to 1.
    #[inline]
    pub fn fraction(&self, position: f32) -> f32 {
        (position - self.min) * self.per_extent
    }

    /// Returns the shares below and above a plane at a fraction of the extent.
    #[inline]
    fn child_areas(&self, fraction: f32) -> [f32; 2] {
        [self.base + self.slope * fraction, self.base + self.slope * (1.0 - fraction)]
    }

    /// Returns the weight of a split at a fraction of the extent, with `n_below` and `n_above` triangles on its
    /// sides.
    #[inline]
    pub fn weight(&self, fraction: f32, n_below: f32, n_above: f32) -> f32 {
        self.lower_bound(fraction, fraction, n_below, n_above)
    }

    /// Returns a lower bound of the weights of splits between two fractions of the extent, each with at least
    /// `n_below` and `n_above` triangles on its sides.
    #[inline]
    pub fn lower_bound(&self, from: f32, to: f32, n_below: f32, n_above: f32) -> f32 {
        let (below, above) = (self.child_areas(from)[0], self.child_areas(to)[1]);
        let factor = if n_below == 0.0 || n_above == 0.0 { self.empty_factor } else { 1.0 };
        factor * (below * n_below + above * n_above)
    }

    /// Returns the split at a position strictly inside the cell. `n_references`: the number of triangles below and
    /// above.
    #[inline]
    pub fn split(&self, position: f32, n_references: [u32; 2]) -> Split {
        let weight = self.weight(self.fraction(position), n_references[0] as f32, n_references[1] as f32);
        Split { axis: self.axis, position, weight, n_references }
    }
}
