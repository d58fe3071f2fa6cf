//! Rows of `bounces`: how many rays a level has, and what that makes of its dispatches. `compact_spine.comp` does the same on
//! the device.

use crate::layout::{Bounce, Frame, MOST_LANES_LOG2, RAY_GROUP_SIZE, SCAN_BLOCK_SIZE};

impl Bounce {
    /// A level of `n_rays`, all of which there is room for.
    pub fn of(n_rays: u32, constants: &Frame) -> Self {
        let mut row = Self {
            n_wanted: n_rays,
            ray_groups_y: 1,
            ray_groups_z: 1,
            trace_groups_y: 1,
            trace_groups_z: 1,
            shadow_groups_y: constants.n_lights,
            shadow_groups_z: 1,
            scan_groups_y: 1,
            scan_groups_z: 1,
            ..Self::default()
        };
        row.set_n_rays(n_rays, constants);
        row
    }

    /// Sizes the dispatches along x.
    pub fn set_n_rays(&mut self, n_rays: u32, constants: &Frame) {
        let for_rays = lanes_log2(n_rays, constants.n_lanes);
        let for_segments = lanes_log2(n_rays * constants.n_lights, constants.n_lanes);
        self.n_rays = n_rays;
        self.ray_groups_x = n_rays.div_ceil(RAY_GROUP_SIZE);
        self.trace_groups_x = (n_rays << for_rays).div_ceil(RAY_GROUP_SIZE);
        self.trace_lanes_log2 = for_rays;
        self.shadow_groups_x = (n_rays << for_segments).div_ceil(RAY_GROUP_SIZE);
        self.shadow_lanes_log2 = for_segments;
        self.scan_groups_x = n_rays.div_ceil(SCAN_BLOCK_SIZE);
    }
}

/// Logarithm of the lanes that each of so many rays gets of a device's, of which one works: a power of two, as far as they go
/// round. Rays of one subgroup wait for one another wherever their ways part; with lanes to spare, they need not.
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
    fn without_lanes_to_spare_all_dispatches_over_rays_are_alike() {
        let row = Bounce::of(100, &Frame { n_lights: 3, ..Frame::default() });
        assert_eq!([row.ray_groups_x, row.trace_groups_x, row.shadow_groups_x, row.shadow_groups_y], [2, 2, 2, 3]);
        assert_eq!((row.trace_lanes_log2, row.shadow_lanes_log2), (0, 0));
    }
}
