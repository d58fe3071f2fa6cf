// How surfaces of microfacets scatter light in the path tracer: the bidirectional scattering distribution function.
// Twin of src/reference/bsdf/mod.rs.
//
// From the top, a surface has these lobes:
//
// - a clear coat (clearcoat.glsl),
// - the sheen of cloth (sheen.glsl),
// - an interface of microfacets, which reflects (reflection.glsl) or lets pass (transmission.glsl),
// - a Lambertian surface below it (lambert.glsl).
//
// The first two leave to those below what they do not reflect towards the viewer (albedo scaling, as in
// KHR_materials_sheen). Below the interface, the light that it leaves is reciprocal (multiple_scattering.glsl). The
// interface is a metal with the share `metallic`, else a dielectric. Of the light that enters the dielectric, the share
// `transmission` passes, and the rest meets the Lambertian surface. A sheet (without MATERIAL_SOLID) lets light pass
// straight: its transmitted lobe is the reflected one, mirrored to the other side.
//
// A direction is sampled for one lobe, which is chosen in proportion to the lobes' albedos. Its pdf is that of all
// lobes together. Perfectly smooth (delta) lobes have no pdf per steradian: they are sampled alone.
//
// Light from a direction whose sides of the triangle and of the shading normal differ is not scattered. If the viewer
// is behind the shading normal, the triangle's normal replaces it. Where a map bends the normal, the interpolated
// surface takes the triangle's place: light fades towards its horizon (`share_from`), and the normal turns towards the
// interpolated one as far as the viewer demands (`normal_of_lobes`), so that no edges of triangles are seen.
//
// Needs nothing. Provides `bsdf_terms` (terms.glsl), `eval_bsdf` (evaluate.glsl), `sample_bsdf` (sample.glsl), and
// `is_smooth`, `hit_albedo`, `surface_albedo` and `surface_gloss` (lobes.glsl).
#ifndef KDRAY_BSDF
#define KDRAY_BSDF

#include "bsdf/evaluate.glsl"
#include "bsdf/lobes.glsl"
#include "bsdf/sample.glsl"
#include "bsdf/terms.glsl"

#endif
