// Distribution of rays over lanes. If a dispatch has fewer rays than the device has lanes, each ray gets 2^lanes_log2
// lanes, of which only the first works. Divergent rays of a subgroup wait for one another. With fewer rays in a
// subgroup, the longest rays, for which the dispatch waits, end sooner.
//
// Needs nothing. Provides `ray_of_lane`.
#ifndef KDRAY_LANES
#define KDRAY_LANES

// The index of the lane's ray. For a lane that does not work, an index that is beyond all rays.
uint ray_of_lane(uint lane, uint lanes_log2) {
    bool works = (lane & ((1u << lanes_log2) - 1u)) == 0u;
    return works ? lane >> lanes_log2 : 0xffffffffu;
}

#endif
