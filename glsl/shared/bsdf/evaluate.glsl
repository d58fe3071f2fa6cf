// The sum of a surface's lobes for two directions, and the pdf with which sample_bsdf samples the one towards the
// light. Twin of src/reference/bsdf/evaluate.rs.
#ifndef KDRAY_BSDF_EVALUATE
#define KDRAY_BSDF_EVALUATE

#include "layout.glsl"
#include "shading/maps.glsl"
#include "shading/surface.glsl"
#include "bsdf/albedo.glsl"
#include "bsdf/clearcoat.glsl"
#include "bsdf/lambert.glsl"
#include "bsdf/lobes.glsl"
#include "bsdf/local_frame.glsl"
#include "bsdf/reflection.glsl"
#include "bsdf/sheen.glsl"
#include "bsdf/terms.glsl"
#include "bsdf/transmission.glsl"

// The scattered share of light times the cosine, and the pdf of its direction.
struct BsdfEval {
    vec3 value;
    float pdf;
};

// Adds the interface's reflection.
void add_reflection(BsdfTerms terms, vec3 to_light, vec3 half_vector, inout BsdfEval sum) {
    if (terms.width == 0.0 || !terms.has_interface) return;
    float lobe = evaluate_reflection(terms.to_viewer, to_light, half_vector, terms.width);
    InterfaceSplit split = split_at(terms, dot(terms.to_viewer, half_vector));
    sum.value += terms.base_share * split.reflected * lobe;
    // Light that passes straight tells nothing of a microfacet, so the surface's normal decides.
    float choice = passes_straight(terms) ? terms.straight_choice : reflected_choice(split);
    sum.pdf += terms.choice.x * choice * reflection_pdf(terms.to_viewer, half_vector, terms.width);
}

// Adds the reflection of the clear coat.
void add_clearcoat(BsdfTerms terms, vec3 to_light, vec3 half_vector, inout BsdfEval sum) {
    if (!has_clearcoat(terms.material) || terms.coat_roughness == 0.0) return;
    float width = terms.coat_roughness * terms.coat_roughness;
    float lobe = evaluate_reflection(terms.to_viewer, to_light, half_vector, width);
    sum.value += terms.material.clearcoat * clearcoat_fresnel(dot(terms.to_viewer, half_vector)) * lobe;
    sum.pdf += terms.choice.z * reflection_pdf(terms.to_viewer, half_vector, width);
}

// Adds the Lambertian lobe.
void add_lambert(BsdfTerms terms, vec3 to_light, inout BsdfEval sum) {
    GgxAlbedo albedo = NO_ALBEDO;
    if (terms.has_interface) albedo = ggx_albedo(to_light.z, sqrt(terms.width));
    float left = max(1.0 - dielectric_albedo(terms.dielectric, albedo), 0.0);
    vec3 reflectance = terms.below * left + terms.between * albedo.loss;
    sum.value += terms.base_share * evaluate_lambert(reflectance, to_light);
    sum.pdf += terms.choice.y * lambert_pdf(to_light);
}

// Adds the sheen.
void add_sheen(BsdfTerms terms, vec3 to_light, inout BsdfEval sum) {
    if (!has_sheen(terms.material)) return;
    float lobe = evaluate_sheen(terms.to_viewer, to_light, terms.sheen_roughness) * terms.sheen_bound;
    sum.value += terms.sheen_share * terms.material.sheen_colour * lobe;
    sum.pdf += terms.choice.w * sheen_pdf(to_light);
}

// Adds the light that passes through the interface.
void add_transmission(BsdfTerms terms, vec3 to_light, inout BsdfEval sum) {
    if (!scene_has_lobe(LOBE_TRANSMISSION) || terms.width == 0.0 || passes_straight(terms)) return;
    vec3 mirrored = vec3(to_light.xy, -to_light.z);
    vec3 half_vector = terms.is_solid
        ? refracting_normal(terms.to_viewer, to_light, terms.eta)
        : normalize(terms.to_viewer + mirrored);
    if (terms.is_solid && !refracts_between(terms.to_viewer, to_light, half_vector)) return;
    InterfaceSplit split = split_at(terms, dot(terms.to_viewer, half_vector));
    float lobe, pdf;
    if (terms.is_solid) {
        lobe = evaluate_refraction(terms.to_viewer, to_light, half_vector, terms.width, terms.eta);
        pdf = refraction_pdf(terms.to_viewer, to_light, half_vector, terms.width, terms.eta);
    } else {
        lobe = evaluate_reflection(terms.to_viewer, mirrored, half_vector, terms.width);
        pdf = reflection_pdf(terms.to_viewer, half_vector, terms.width);
    }
    sum.value += terms.base_share * split.transmitted * lobe;
    sum.pdf += terms.choice.x * (1.0 - reflected_choice(split)) * pdf;
}

// The sum of all lobes but the delta lobes. to_light: in the frame of the surface.
BsdfEval eval_lobes(BsdfTerms terms, vec3 to_light) {
    BsdfEval sum = BsdfEval(vec3(0.0), 0.0);
    if (to_light.z > 0.0) {
        vec3 half_vector = normalize(terms.to_viewer + to_light);
        add_reflection(terms, to_light, half_vector, sum);
        add_lambert(terms, to_light, sum);
        add_clearcoat(terms, to_light, half_vector, sum);
        add_sheen(terms, to_light, sum);
    } else if (to_light.z < 0.0) {
        add_transmission(terms, to_light, sum);
    }
    return sum;
}

// The share of the light from a direction that the surface itself lets pass to its lobes: nothing if the direction is
// not on the same side of the surface and of its frame. The surface of a bent normal is the interpolated one, towards
// whose horizon the bumps shadow one another. local: the direction in the frame.
float share_from(Surface surface, vec3 direction, vec3 local) {
    vec3 up = is_bent(surface) ? surface.interpolated : surface.geometric;
    return dot(up, direction) * local.z > 0.0 ? bump_shadowing(surface, direction) : 0.0;
}

// The sum of all lobes but the delta lobes, at a surface.
BsdfEval eval_bsdf(BsdfTerms terms, Surface surface, vec3 to_light) {
    vec3 local = to_local(terms.frame, to_light);
    float share = share_from(surface, to_light, local);
    if (terms.choice == vec4(0.0) || !(share > 0.0)) return BsdfEval(vec3(0.0), 0.0);
    BsdfEval found = eval_lobes(terms, local);
    found.value *= share;
    return found;
}

#endif
