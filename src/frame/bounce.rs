//! Rows of the buffer `bounces`, one for each bounce of each batch. A row has the bounce's range of rays and the sizes
//! of the dispatches over them; of paths, it also has the number of shadow rays. Twin of `compact_spine.comp`, which
//! computes the rows of secondary rays on the device.

use std::ops::Range;

use crate::layout::{Bounce, Frame, MOST_LANES_LOG2, RAY_GROUP_SIZE, SCAN_GROUP_SIZE};

impl Bounce {
    /// Returns the row of a bounce whose `n_rays` rays are the first in the queue. The queue must have room for them.
    /// With no rays, it is the initial row of a later bounce, which compaction fills in.
    pub fn of(n_rays: u32, constants: &Frame) -> Self {
        let mut row = Self {
            n_wanted: n_rays,
            trace_groups_y: 1,
            trace_groups_z: 1,
            shadow_groups_y: constants.n_lights,
            shadow_groups_z: 1,
            scan_groups_y: 1,
            scan_groups_z: 1,
            shade_groups_y: 1,
            shade_groups_z: 1,
            ..Self::default()
        };
        row.set_rays(0, n_rays, constants);
        row
    }

    /// Returns the row of the first bounce of a batch of `n_paths` paths. With no paths, it is the initial row of a
    /// later bounce, which compaction fills in.
    pub fn of_paths(n_paths: u32, constants: &Frame) -> Self {
        let mut row = Self::of(0, constants);
        row.set_paths(n_paths, 0, constants);
        row
    }

    /// Sets the number of paths that are alive at the bounce, the lanes of each ray and shadow ray, and the sizes of
    /// the dispatches along x. `n_shadow_rays`: the number of shadow rays of the bounce before, which are traced with
    /// the rays of this bounce.
    pub fn set_paths(&mut self, n_paths: u32, n_shadow_rays: u32, constants: &Frame) {
        let n_traced = n_paths + n_shadow_rays;
        self.n_rays = n_paths;
        self.n_wanted = n_paths;
        self.trace_lanes_log2 = lanes_log2(n_traced, constants.n_lanes);
        self.trace_groups_x = (n_traced << self.trace_lanes_log2).div_ceil(RAY_GROUP_SIZE);
        self.scan_groups_x = n_paths.div_ceil(SCAN_GROUP_SIZE);
    }

    /// Sets the bounce's range of rays in the queue, the lanes of each ray, and the sizes of the dispatches along x.
    pub fn set_rays(&mut self, first_ray: u32, n_rays: u32, constants: &Frame) {
        let n_so_far = first_ray + n_rays;
        let for_rays = lanes_log2(n_rays, constants.n_lanes);
        let for_shadow_rays = lanes_log2(n_so_far.saturating_mul(constants.n_lights), constants.n_lanes);
        self.first_ray = first_ray;
        self.n_rays = n_rays;
        self.trace_groups_x = (n_rays << for_rays).div_ceil(RAY_GROUP_SIZE);
        self.trace_lanes_log2 = for_rays;
        self.shadow_groups_x = (n_so_far << for_shadow_rays).div_ceil(RAY_GROUP_SIZE);
        self.shadow_lanes_log2 = for_shadow_rays;
        self.scan_groups_x = n_rays.div_ceil(SCAN_GROUP_SIZE);
        self.shade_groups_x = n_so_far.div_ceil(RAY_GROUP_SIZE);
    }

    /// Returns the indices of the bounce's rays in the queue.
    pub fn rays(&self) -> Range<usize> {
        self.first_ray as usize..(self.first_ray + self.n_rays) as usize
    }
}

/// Returns the base-2 logarithm n of the number of lanes that each ray gets. Only the first of them works, and the
/// others are idle. `n_lanes`: the number of lanes of the device; if it is 0, each ray gets one lane.
///
/// Divergent rays of a subgroup wait for one another. So if a dispatch has fewer rays than the device has lanes, the
/// rays are spread over all lanes, and fewer of them share a subgroup. n is the largest for which the device has
/// enough lanes, and at most [`MOST_LANES_LOG2`].
pub fn lanes_log2(n_rays: u32, n_lanes: u32) -> u32 {
    (n_lanes / n_rays.max(1)).checked_ilog2().map_or(0, |log2| log2.min(MOST_LANES_LOG2))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lanes_go_round() {
        let n_lanes = 270_336;
        for n_rays in [1, 63, 8448, 8449, 16_384, 65_536, 135_168, 135_169, 270_336, 270_337, 1 << 24] {
            let lanes = 1 << lanes_log2(n_rays, n_lanes);
            assert!(lanes == 1 || lanes * n_rays <= n_lanes, "{n_rays}: {lanes}");
            assert!(lanes == 1 << MOST_LANES_LOG2 || 2 * lanes * n_rays > n_lanes, "{n_rays}: {lanes}");
        }
        assert_eq!((lanes_log2(0, 0), lanes_log2(5, 0), lanes_log2(0, n_lanes)), (0, 0, MOST_LANES_LOG2));
    }

    #[test]
    fn light_is_for_all_rays_so_far() {
        let constants = Frame { n_lights: 3, ..Frame::default() };
        let mut row = Bounce::of(100, &constants);
        assert_eq!([row.trace_groups_x, row.shade_groups_x, row.shadow_groups_x, row.shadow_groups_y], [2, 2, 2, 3]);
        assert_eq!((row.trace_lanes_log2, row.shadow_lanes_log2), (0, 0));
        row.set_rays(100, 60, &constants);
        assert_eq!([row.trace_groups_x, row.shade_groups_x, row.shadow_groups_x, row.shadow_groups_y], [1, 3, 3, 3]);
        assert_eq!((row.scan_groups_x, row.rays()), (1, 100..160));
    }
}
