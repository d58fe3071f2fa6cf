// The paths of a batch. Each path has a fixed place in the buffers. The samples of a pixel follow each other, because
// their rays have much in common: they meet the same parts of the tree and the same materials. Lists of indices say
// which paths are alive at a bounce, and which have a shadow ray. Twin of src/reference/paths.rs.
//
// Needs nothing. Provides `list_of`, `list_of_shadow_rays`, `path_of`, `sample_of_path`, `pixel_at`, `pixel_of_path`,
// `key_of_path` and the push constants `batch`.
#ifndef KDRAY_PATHS
#define KDRAY_PATHS

#include "layout.glsl"
#include "rays/camera.glsl"
#include "rays/noise_tiles.glsl"
#include "sampler.glsl"

layout(push_constant) uniform BatchBlock { Batch batch; };

// Where the list of the paths that are alive at a bounce begins in `live_paths`.
uint list_of(uint depth) {
    return (depth & 1u) * frame.queue_capacity;
}

// Where the list of the paths with a shadow ray begins in `live_paths`.
uint list_of_shadow_rays() {
    return 2u * frame.queue_capacity;
}

// The path of a pixel and of a sample of the frame. place: how many pixels of the batch come before the pixel.
uint path_of(uint place, uint sample_ix) {
    return (place << frame.samples_log2) + sample_ix;
}

// The index of a path's sample among those of the frame.
uint sample_of_path(uint path_ix) {
    return path_ix % (1u << frame.samples_log2);
}

// The window's pixel at a place in the batch.
uvec2 pixel_at(uint place) {
    return pixel_of(batch.first_pixel + place, frame.width, frame.height);
}

// The window's pixel of a path.
uvec2 pixel_of_path(uint path_ix) {
    return pixel_at(path_ix >> frame.samples_log2);
}

// What the random numbers of a path depend on. pixel: the window's pixel.
SampleKey key_of_path(uint path_ix, uvec2 pixel) {
    return sample_key(picture_pixel_of(pixel), first_sample_of(pixel) + sample_of_path(path_ix));
}

#endif
