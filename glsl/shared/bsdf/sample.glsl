// A random direction from which light is scattered to the viewer. Twin of src/reference/bsdf/sample.rs.
#ifndef KDRAY_BSDF_SAMPLE
#define KDRAY_BSDF_SAMPLE

#include "layout.glsl"
#include "shading/surface.glsl"
#include "shading/fresnel.glsl"
#include "bsdf/clearcoat.glsl"
#include "bsdf/evaluate.glsl"
#include "bsdf/ggx.glsl"
#include "bsdf/lambert.glsl"
#include "bsdf/lobes.glsl"
#include "bsdf/local_frame.glsl"
#include "bsdf/reflection.glsl"
#include "bsdf/sheen.glsl"
#include "bsdf/terms.glsl"
#include "bsdf/transmission.glsl"

// A sampled direction. weight: the scattered share times the cosine, divided by the pdf. pdf: of all lobes, per
// steradian; of a delta lobe, the probability of its choice. A pdf of 0 means that the light is absorbed.
struct BsdfSample {
    vec3 direction;
    vec3 weight;
    float pdf;
    bool is_delta;
};

const BsdfSample BSDF_ABSORBED = BsdfSample(vec3(0.0, 0.0, 1.0), vec3(0.0), 0.0, false);

// A direction that is sampled for one lobe.
struct LobeSample {
    // A unit vector in the frame of the surface.
    vec3 local;
    // 1: the lobe is on the viewer's side; -1: on the other side; 0: there is no lobe.
    float side;
    bool is_delta;
    // The share of light that a delta lobe scatters, and the probability with which it was chosen. Other lobes have
    // no use for them.
    vec3 share;
    float probability;
};

const LobeSample NO_LOBE = LobeSample(vec3(0.0, 0.0, 1.0), 0.0, false, vec3(0.0), 0.0);

LobeSample rough_lobe(vec3 local, float side) {
    return LobeSample(local, side, false, vec3(0.0), 0.0);
}

LobeSample delta_lobe(vec3 local, vec3 share, float probability) {
    return LobeSample(local, 1.0, true, share, probability);
}

// A sample of the interface. u.z selects between reflection and transmission.
LobeSample sample_interface(BsdfTerms terms, vec3 u) {
    bool is_rough = terms.width > 0.0;
    vec3 half_vector = vec3(0.0, 0.0, 1.0);
    if (is_rough) half_vector = sample_ggx(terms.to_viewer, terms.width, u.xy);
    float cosine = dot(terms.to_viewer, half_vector);
    InterfaceSplit split = split_at(terms, passes_straight(terms) ? terms.to_viewer.z : cosine);
    float choice = reflected_choice(split);
    vec3 mirrored = reflected_by(terms.to_viewer, half_vector);
    if (u.z < choice) {
        if (is_rough) return rough_lobe(mirrored, 1.0);
        return delta_lobe(mirrored, terms.base_share * split.reflected, terms.choice.x * choice);
    }
    if (!scene_has_lobe(LOBE_TRANSMISSION)) return NO_LOBE;
    float probability = terms.choice.x * (1.0 - choice);
    if (passes_straight(terms)) return delta_lobe(-terms.to_viewer, terms.base_share * split.transmitted, probability);
    if (!terms.is_solid) return rough_lobe(vec3(mirrored.xy, -mirrored.z), -1.0);
    // A black sample of total reflection.
    if (refraction_cosine(cosine, terms.eta) <= 0.0) return NO_LOBE;
    vec3 refracted = refracted_by(terms.to_viewer, half_vector, terms.eta);
    if (is_rough) return rough_lobe(refracted, -1.0);
    return delta_lobe(refracted, terms.base_share * terms.eta * terms.eta * split.transmitted, probability);
}

// A sample of the clear coat.
LobeSample sample_clearcoat(BsdfTerms terms, vec2 u) {
    float width = terms.coat_roughness * terms.coat_roughness;
    vec3 half_vector = vec3(0.0, 0.0, 1.0);
    if (width > 0.0) half_vector = sample_ggx(terms.to_viewer, width, u);
    vec3 mirrored = reflected_by(terms.to_viewer, half_vector);
    if (width > 0.0) return rough_lobe(mirrored, 1.0);
    float share = terms.material.clearcoat * clearcoat_fresnel(terms.to_viewer.z);
    return delta_lobe(mirrored, vec3(share), terms.choice.z);
}

// A sample of the lobe that u.z selects.
LobeSample sample_lobe(BsdfTerms terms, vec3 u) {
    vec4 choice = terms.choice;
    if (choice == vec4(0.0)) return NO_LOBE;
    if (u.z < choice.x) {
        if (!scene_has_lobe(LOBE_INTERFACE)) return NO_LOBE;
        return sample_interface(terms, vec3(u.xy, min(u.z / choice.x, 0.99999994)));
    }
    if (u.z < choice.x + choice.y) return rough_lobe(sample_lambert(u.xy), 1.0);
    if (u.z < choice.x + choice.y + choice.z) {
        return scene_has_lobe(LOBE_CLEARCOAT) ? sample_clearcoat(terms, u.xy) : NO_LOBE;
    }
    bool is_sheen = scene_has_lobe(LOBE_SHEEN) && choice.w > 0.0;
    return is_sheen ? rough_lobe(sample_sheen(u.xy), 1.0) : NO_LOBE;
}

// The sample of a delta lobe, which no other lobe scatters light to.
BsdfSample delta_sample(BsdfTerms terms, Surface surface, LobeSample lobe) {
    vec3 side = lobe.local.z < 0.0 ? -surface.geometric : surface.geometric;
    vec3 direction = keep_side(to_world(terms.frame, lobe.local), side);
    if (!(lobe.probability > 0.0)) return BSDF_ABSORBED;
    return BsdfSample(direction, lobe.share / lobe.probability, lobe.probability, true);
}

// The sample of a lobe with a pdf. All lobes with a pdf scatter light to its direction.
BsdfSample rough_sample(BsdfTerms terms, Surface surface, LobeSample lobe) {
    vec3 direction = to_world(terms.frame, lobe.local);
    bool is_on_side = lobe.local.z * lobe.side > 0.0;
    float share = share_from(surface, direction, lobe.local);
    if (!is_on_side || !(share > 0.0)) return BSDF_ABSORBED;
    BsdfEval found = eval_lobes(terms, lobe.local);
    if (!(found.pdf > 0.0)) return BSDF_ABSORBED;
    return BsdfSample(direction, found.value * share / found.pdf, found.pdf, false);
}

// A direction from which light is scattered to the viewer. u: random numbers in [0, 1). u.z selects the lobe, and
// within the interface between reflection and transmission.
BsdfSample sample_bsdf(BsdfTerms terms, Surface surface, vec3 u) {
    LobeSample lobe = sample_lobe(terms, u);
    // Samples of all lobes are evaluated by the same code, so that neighbours with other lobes do not wait for them.
    if (lobe.is_delta) return delta_sample(terms, surface, lobe);
    return rough_sample(terms, surface, lobe);
}

#endif
