// Fewer rays than the device has lanes: each ray gets several, of which the first works. Rays of one subgroup wait for one
// another wherever their ways part, so the long ones, which the dispatch waits for, end sooner with fewer beside them.
#ifndef KDRAY_LANES
#define KDRAY_LANES

// The ray of a lane, or one beyond all.
uint ray_of_lane(uint lane, uint lanes_log2) {
    bool works = (lane & ((1u << lanes_log2) - 1u)) == 0u;
    return works ? lane >> lanes_log2 : 0xffffffffu;
}

#endif
