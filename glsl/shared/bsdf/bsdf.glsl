// How surfaces of microfacets scatter light in the path tracer: the bidirectional scattering distribution function.
// Twin of src/reference/bsdf/mod.rs.
//
// From the top, a surface has these layers:
//
// - a clear layer (clearcoat.glsl),
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
// A direction is sampled for one lobe, which is chosen in proportion to the lobes' albedos. Its density is that of all
// lobes together. Perfectly smooth (delta) lobes have no density per steradian: they are sampled alone.
//
// Light from a direction whose sides of the triangle and of the shading normal differ is not scattered. If the viewer
// is behind the shading normal, the triangle's normal replaces it.
#ifndef KDRAY_BSDF
#define KDRAY_BSDF

#include "layout.glsl"
#include "surface.glsl"
#include "microfacet.glsl"
#include "fresnel.glsl"
#include "bsdf/albedo.glsl"
#include "bsdf/clearcoat.glsl"
#include "bsdf/conductor.glsl"
#include "bsdf/lambert.glsl"
#include "bsdf/local_frame.glsl"
#include "bsdf/multiple_scattering.glsl"
#include "bsdf/reflection.glsl"
#include "bsdf/sheen.glsl"
#include "bsdf/transmission.glsl"

// A sampled direction. weight: the scattered share times the cosine, divided by the density. density: of all lobes, per
// steradian; of a delta lobe, the probability of its choice. A density of 0 means that the light is absorbed.
struct BsdfSample {
    vec3 direction;
    vec3 weight;
    float density;
    bool is_delta;
};

// What all lobes need that depends on the material and the viewer.
struct BsdfTerms {
    Material material;
    LocalFrame frame;
    vec3 to_viewer;
    // Width of the interface's distribution of normals. It is 0 if the interface is perfectly smooth.
    float width;
    // Roughness of the clear layer. It is 0 if the layer is perfectly smooth.
    float coat_roughness;
    float sheen_roughness;
    // Index of refraction on the viewer's side, divided by that of the other side. 1: light passes unbent.
    float eta;
    bool is_solid;
    // Whether the interface reflects light or lets it pass. Without an interface, the base is Lambertian.
    bool has_interface;
    // Share of the light that the layers above leave to the sheen, and to the interface.
    float sheen_share;
    float base_share;
    float sheen_bound;
    // Factor on what a sheet reflects and transmits, which makes up for light that bounces between microfacets.
    float clear_gain;
    // Largest channels of what the dielectric reflects: along the normal, at grazing angles, and after light has
    // bounced between microfacets. They give its albedo.
    vec3 dielectric;
    // Reflectance of the Lambertian surface and of the light that bounces between microfacets, apart from the factor
    // that depends on the light's direction.
    vec3 below;
    vec3 between;
    // Probabilities of the lobes: interface, Lambertian, clear layer, sheen. Their sum is 1, or 0 for a black surface.
    vec4 choice;
};

// The shares of light that a microfacet of the interface reflects and lets pass.
struct InterfaceSplit {
    vec3 reflected;
    vec3 transmitted;
};

// The scattered share of light times the cosine, and the density of its direction.
struct BsdfValue {
    vec3 value;
    float density;
};

const BsdfSample BSDF_ABSORBED = BsdfSample(vec3(0.0, 0.0, 1.0), vec3(0.0), 0.0, false);

float mean_of(vec3 v) {
    return (v.x + v.y + v.z) / 3.0;
}

// The width of the distribution of the interface's normals; 0 if it is perfectly smooth.
float interface_width(Material material) {
    bool is_of_phong = (material.flags & MATERIAL_PHONG_WIDTH) != 0u;
    float width = is_of_phong ? sqrt(2.0 / (material.ns + 2.0)) : material.roughness * material.roughness;
    return width < LEAST_ROUGH_WIDTH ? 0.0 : min(width, 1.0);
}

// The roughness of the clear layer; 0 if it is perfectly smooth.
float clearcoat_roughness(Material material) {
    float roughness = material.clearcoat_roughness;
    return roughness * roughness < LEAST_ROUGH_WIDTH ? 0.0 : min(roughness, 1.0);
}

// Share of light that passes through the surface, of that which the dielectric and the metal do not reflect.
float passing_share(Material material) {
    return material.transmission * (1.0 - material.metallic);
}

// Whether all of the surface's lobes are perfectly smooth. Lights cannot be picked for it.
bool is_smooth(Material material) {
    if ((material.flags & MATERIAL_UNLIT) != 0u) return true;
    bool has_lambert = largest_of(material.kd) * (1.0 - material.metallic) * (1.0 - material.transmission) > 0.0;
    bool has_rough_coat = material.clearcoat > 0.0 && clearcoat_roughness(material) > 0.0;
    bool has_sheen = largest_of(material.sheen_colour) > 0.0;
    return interface_width(material) == 0.0 && !has_lambert && !has_rough_coat && !has_sheen;
}

// Reflectance of the metal where the light's angle to the microfacet's normal has this cosine.
vec3 metal_fresnel(Material material, float cosine) {
    if ((material.flags & MATERIAL_CONDUCTOR) == 0u) return metal_reflectance(material, cosine);
    return conductor_reflectance(cosine, material.conductor_eta, material.conductor_k);
}

// About the share of light that the surface scatters, by colour: what it reflects along its normal, or lets pass. It is
// 1 if the surface is perfectly smooth, since that shows other surfaces.
vec3 surface_albedo(Material material) {
    if (is_smooth(material)) return vec3(1.0);
    vec3 dielectric = material.kd + normal_reflectance(material);
    return clamp(mix(dielectric, metal_fresnel(material, 1.0), material.metallic), 0.0, 1.0);
}

// How narrow the surface scatters light, 0..1: the share of its albedo that is not Lambertian, less the wider its
// distribution of microfacets is.
float surface_gloss(Material material) {
    float sum = mean_of(surface_albedo(material));
    if (is_smooth(material) || !(sum > 0.0)) return is_smooth(material) ? 1.0 : 0.0;
    float lambertian = mean_of(material.kd) * (1.0 - material.metallic) * (1.0 - material.transmission);
    return (1.0 - interface_width(material)) * clamp(1.0 - lambertian / sum, 0.0, 1.0);
}

// What a microfacet of the interface does with light. cosine: between the microfacet's normal and the viewer.
InterfaceSplit split_at(BsdfTerms terms, float cosine) {
    Material material = terms.material;
    cosine = clamp(cosine, 0.0, 1.0);
    vec3 opaque = dielectric_reflectance(material, cosine);
    vec3 clear = opaque;
    if (terms.is_solid) clear = vec3(fresnel(cosine, refraction_cosine(cosine, terms.eta), terms.eta));
    vec3 reflected = mix(opaque, terms.clear_gain * clear, material.transmission);
    reflected = mix(reflected, metal_fresnel(material, cosine), material.metallic);
    // Light passes two boundaries of a solid, and is tinted at both.
    vec3 tint = material.tf * (terms.is_solid ? sqrt(material.kd) : material.kd);
    float passing = terms.clear_gain * passing_share(material) * (1.0 - largest_of(clear));
    return InterfaceSplit(reflected, passing * tint);
}

// Probability that light is sampled as reflected, not as let pass.
float reflected_choice(InterfaceSplit split) {
    float reflected = mean_of(split.reflected), sum = reflected + mean_of(split.transmitted);
    return sum > 0.0 ? reflected / sum : 0.0;
}

// Whether transmitted light keeps its direction exactly.
bool passes_straight(BsdfTerms terms) {
    return terms.is_solid ? terms.eta == 1.0 : terms.width == 0.0;
}

// Share of light that the dielectric reflects, from `BsdfTerms.dielectric`.
float dielectric_albedo(vec3 dielectric, GgxAlbedo albedo) {
    float at_normal = 1.0 - albedo.loss - albedo.grazing;
    return dielectric.x * at_normal + dielectric.y * albedo.grazing + dielectric.z * albedo.loss;
}

// The albedo of a surface without an interface, which reflects and loses nothing.
const GgxAlbedo NO_ALBEDO = GgxAlbedo(0.0, 0.0);

// Sets the terms of the Lambertian lobe. albedo: of the interface, towards the viewer.
void set_lambert(inout BsdfTerms terms, GgxAlbedo albedo, float roughness) {
    Material material = terms.material;
    terms.between = vec3(0.0);
    terms.dielectric = vec3(0.0);
    terms.below = material.kd;
    if (!terms.has_interface) return;
    GgxAlbedo mean = mean_ggx_albedo(roughness);
    vec3 at_normal = normal_reflectance(material);
    vec3 at_grazing = vec3(min(largest_of(material.ks), 1.0));
    vec3 later = vec3(0.0), later_metal = vec3(0.0);
    if ((material.flags & MATERIAL_SINGLE_SCATTERING) == 0u && mean.loss > 0.0) {
        later = later_bounces(mean_reflectance(at_normal, at_grazing), mean.loss);
        later_metal = later_bounces(mean_reflectance(metal_fresnel(material, 1.0), vec3(1.0)), mean.loss);
        vec3 share = mix((1.0 - material.transmission) * later, later_metal, material.metallic);
        terms.between = share * (albedo.loss / mean.loss);
    }
    terms.dielectric = vec3(largest_of(at_normal), at_grazing.x, largest_of(later));
    float left = 1.0 - dielectric_albedo(terms.dielectric, albedo);
    float mean_left = max(1.0 - dielectric_albedo(terms.dielectric, mean), 1.0e-4);
    float share = (1.0 - material.metallic) * (1.0 - material.transmission);
    terms.below = material.kd * (share * max(left, 0.0) / mean_left);
}

// Share of light that the interface reflects, without what a solid reflects of the light that it transmits.
vec3 interface_albedo(BsdfTerms terms, GgxAlbedo albedo) {
    Material material = terms.material;
    float at_normal = 1.0 - albedo.loss - albedo.grazing;
    vec3 opaque = normal_reflectance(material) * at_normal + terms.dielectric.y * albedo.grazing;
    vec3 metal = metal_fresnel(material, 1.0) * at_normal + albedo.grazing;
    return mix((1.0 - material.transmission) * opaque, metal, material.metallic);
}

// Sets the shares of the layers, and the probabilities of the lobes.
void set_layers(inout BsdfTerms terms, GgxAlbedo albedo) {
    Material material = terms.material;
    float cosine = terms.to_viewer.z;
    float coat = 0.0, sheen = 0.0;
    if (material.clearcoat > 0.0) coat = material.clearcoat * clearcoat_albedo(cosine, terms.coat_roughness);
    if (largest_of(material.sheen_colour) > 0.0) sheen = sheen_albedo(cosine, terms.sheen_roughness);
    terms.sheen_bound = sheen_bound(sheen);
    sheen *= terms.sheen_bound;
    terms.sheen_share = 1.0 - coat;
    terms.base_share = terms.sheen_share * (1.0 - largest_of(material.sheen_colour) * sheen);
    InterfaceSplit split = InterfaceSplit(vec3(0.0), vec3(0.0));
    vec3 reflected = vec3(0.0);
    if (terms.has_interface) {
        split = split_at(terms, cosine);
        reflected = max(split.reflected, interface_albedo(terms, albedo));
    }
    float left = max(1.0 - dielectric_albedo(terms.dielectric, albedo), 0.0);
    terms.choice = vec4(
        terms.base_share * (mean_of(reflected) + mean_of(split.transmitted)),
        terms.base_share * mean_of(terms.below * left + terms.between * albedo.loss),
        coat,
        terms.sheen_share * mean_of(material.sheen_colour) * sheen
    );
    // Light of macroscopic total reflection may still pass through some microfacets.
    terms.choice.x += terms.base_share * 0.01 * passing_share(material);
    float sum = terms.choice.x + terms.choice.y + terms.choice.z + terms.choice.w;
    terms.choice = sum > 0.0 ? terms.choice / sum : vec4(0.0);
}

// The terms for a viewer.
BsdfTerms bsdf_terms(Material material, Surface surface, vec3 to_viewer) {
    // Textures of floats can have any value.
    material.kd = clamp(material.kd, 0.0, 1.0);
    material.sheen_colour = clamp(material.sheen_colour, 0.0, 1.0);
    BsdfTerms terms;
    // The viewer is on the front of the triangle, but may be behind an interpolated normal.
    bool is_behind = dot(surface.shading, to_viewer) < LEAST_COSINE;
    terms.frame = frame_around(is_behind ? surface.geometric : surface.shading);
    terms.to_viewer = to_local(terms.frame, to_viewer);
    terms.to_viewer.z = max(terms.to_viewer.z, LEAST_COSINE);
    terms.material = material;
    terms.width = interface_width(material);
    terms.coat_roughness = clearcoat_roughness(material);
    terms.sheen_roughness = clamp(material.sheen_roughness, LEAST_SHEEN_ROUGHNESS, 1.0);
    terms.is_solid = (material.flags & MATERIAL_SOLID) != 0u && passing_share(material) > 0.0;
    terms.eta = surface.from_inside ? material.ni : 1.0 / material.ni;
    if (!terms.is_solid || abs(material.ni - 1.0) < LEAST_INDEX_STEP) terms.eta = 1.0;
    terms.has_interface = largest_of(material.ks) > 0.0 || material.metallic > 0.0 || material.transmission > 0.0;
    float roughness = sqrt(terms.width);
    GgxAlbedo albedo = NO_ALBEDO;
    if (terms.has_interface) albedo = ggx_albedo(terms.to_viewer.z, roughness);
    bool has_gain = (material.flags & MATERIAL_SINGLE_SCATTERING) == 0u && !terms.is_solid;
    terms.clear_gain = has_gain ? 1.0 / (1.0 - albedo.loss) : 1.0;
    set_lambert(terms, albedo, roughness);
    set_layers(terms, albedo);
    if ((material.flags & MATERIAL_UNLIT) != 0u) terms.choice = vec4(0.0);
    return terms;
}

// Adds the interface's reflection.
void add_reflection(BsdfTerms terms, vec3 to_light, vec3 half_vector, inout BsdfValue sum) {
    if (terms.width == 0.0 || !terms.has_interface) return;
    float lobe = evaluate_reflection(terms.to_viewer, to_light, half_vector, terms.width);
    InterfaceSplit split = split_at(terms, dot(terms.to_viewer, half_vector));
    sum.value += terms.base_share * split.reflected * lobe;
    if (passes_straight(terms)) split = split_at(terms, terms.to_viewer.z);
    float choice = terms.choice.x * reflected_choice(split);
    sum.density += choice * reflection_density(terms.to_viewer, half_vector, terms.width);
}

// Adds the reflection of the clear layer.
void add_clearcoat(BsdfTerms terms, vec3 to_light, vec3 half_vector, inout BsdfValue sum) {
    if (!(terms.material.clearcoat > 0.0) || terms.coat_roughness == 0.0) return;
    float width = terms.coat_roughness * terms.coat_roughness;
    float lobe = evaluate_reflection(terms.to_viewer, to_light, half_vector, width);
    sum.value += terms.material.clearcoat * clearcoat_fresnel(dot(terms.to_viewer, half_vector)) * lobe;
    sum.density += terms.choice.z * reflection_density(terms.to_viewer, half_vector, width);
}

// Adds the Lambertian lobe.
void add_lambert(BsdfTerms terms, vec3 to_light, inout BsdfValue sum) {
    GgxAlbedo albedo = NO_ALBEDO;
    if (terms.has_interface) albedo = ggx_albedo(to_light.z, sqrt(terms.width));
    float left = max(1.0 - dielectric_albedo(terms.dielectric, albedo), 0.0);
    vec3 reflectance = terms.below * left + terms.between * albedo.loss;
    sum.value += terms.base_share * evaluate_lambert(reflectance, to_light);
    sum.density += terms.choice.y * lambert_density(to_light);
}

// Adds the sheen.
void add_sheen(BsdfTerms terms, vec3 to_light, inout BsdfValue sum) {
    if (!(largest_of(terms.material.sheen_colour) > 0.0)) return;
    float lobe = evaluate_sheen(terms.to_viewer, to_light, terms.sheen_roughness) * terms.sheen_bound;
    sum.value += terms.sheen_share * terms.material.sheen_colour * lobe;
    sum.density += terms.choice.w * sheen_density(to_light);
}

// Adds the light that passes through the interface.
void add_transmission(BsdfTerms terms, vec3 to_light, inout BsdfValue sum) {
    if (terms.width == 0.0 || passes_straight(terms)) return;
    vec3 mirrored = vec3(to_light.xy, -to_light.z);
    vec3 half_vector = terms.is_solid
        ? refracting_normal(terms.to_viewer, to_light, terms.eta)
        : normalize(terms.to_viewer + mirrored);
    if (terms.is_solid && !refracts_between(terms.to_viewer, to_light, half_vector)) return;
    InterfaceSplit split = split_at(terms, dot(terms.to_viewer, half_vector));
    float lobe, density;
    if (terms.is_solid) {
        lobe = evaluate_refraction(terms.to_viewer, to_light, half_vector, terms.width, terms.eta);
        density = refraction_density(terms.to_viewer, to_light, half_vector, terms.width, terms.eta);
    } else {
        lobe = evaluate_reflection(terms.to_viewer, mirrored, half_vector, terms.width);
        density = reflection_density(terms.to_viewer, half_vector, terms.width);
    }
    sum.value += terms.base_share * split.transmitted * lobe;
    sum.density += terms.choice.x * (1.0 - reflected_choice(split)) * density;
}

// The sum of all lobes but the delta lobes. to_light: in the frame of the surface.
BsdfValue value_of(BsdfTerms terms, vec3 to_light) {
    BsdfValue sum = BsdfValue(vec3(0.0), 0.0);
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

// Whether a direction is on the same side of the triangle and of the surface's frame. local: in this frame.
bool is_consistent(Surface surface, vec3 direction, vec3 local) {
    return dot(surface.geometric, direction) * local.z > 0.0;
}

// The sum of all lobes but the delta lobes, at a surface.
BsdfValue value_at(BsdfTerms terms, Surface surface, vec3 to_light) {
    vec3 local = to_local(terms.frame, to_light);
    if (terms.choice == vec4(0.0) || !is_consistent(surface, to_light, local)) return BsdfValue(vec3(0.0), 0.0);
    return value_of(terms, local);
}

// A sample of a delta lobe. local: in the frame of the surface.
BsdfSample delta_sample(BsdfTerms terms, Surface surface, vec3 local, vec3 share, float probability) {
    vec3 side = local.z < 0.0 ? -surface.geometric : surface.geometric;
    vec3 direction = keep_side(to_world(terms.frame, local), side);
    if (!(probability > 0.0)) return BSDF_ABSORBED;
    return BsdfSample(direction, share / probability, probability, true);
}

// A sample of a lobe with a density. local: in the frame of the surface. is_above: whether the lobe is on the viewer's
// side.
BsdfSample rough_sample(BsdfTerms terms, Surface surface, vec3 local, bool is_above) {
    vec3 direction = to_world(terms.frame, local);
    bool is_on_side = is_above ? local.z > 0.0 : local.z < 0.0;
    if (!is_on_side || !is_consistent(surface, direction, local)) return BSDF_ABSORBED;
    BsdfValue found = value_of(terms, local);
    if (!(found.density > 0.0)) return BSDF_ABSORBED;
    return BsdfSample(direction, found.value / found.density, found.density, false);
}

// A sample of the interface.
BsdfSample sample_interface(BsdfTerms terms, Surface surface, vec3 u) {
    vec3 half_vector = vec3(0.0, 0.0, 1.0);
    if (terms.width > 0.0) half_vector = sample_ggx(terms.to_viewer, terms.width, u.xy);
    float cosine = dot(terms.to_viewer, half_vector);
    // Light that passes straight tells nothing of a microfacet, so the surface's normal decides.
    InterfaceSplit split = split_at(terms, passes_straight(terms) ? terms.to_viewer.z : cosine);
    float choice = reflected_choice(split);
    bool is_reflected = u.z < choice;
    float probability = terms.choice.x * (is_reflected ? choice : 1.0 - choice);
    if (is_reflected) {
        vec3 local = reflected_by(terms.to_viewer, half_vector);
        if (terms.width > 0.0) return rough_sample(terms, surface, local, true);
        return delta_sample(terms, surface, local, terms.base_share * split.reflected, probability);
    }
    if (passes_straight(terms)) {
        return delta_sample(terms, surface, -terms.to_viewer, terms.base_share * split.transmitted, probability);
    }
    if (!terms.is_solid) {
        vec3 mirrored = reflected_by(terms.to_viewer, half_vector);
        return rough_sample(terms, surface, vec3(mirrored.xy, -mirrored.z), false);
    }
    // A black sample of total reflection.
    if (refraction_cosine(cosine, terms.eta) <= 0.0) return BSDF_ABSORBED;
    vec3 local = refracted_by(terms.to_viewer, half_vector, terms.eta);
    if (terms.width > 0.0) return rough_sample(terms, surface, local, false);
    vec3 share = terms.base_share * terms.eta * terms.eta * split.transmitted;
    return delta_sample(terms, surface, local, share, probability);
}

// A sample of the clear layer.
BsdfSample sample_clearcoat(BsdfTerms terms, Surface surface, vec2 u) {
    vec3 half_vector = vec3(0.0, 0.0, 1.0);
    float width = terms.coat_roughness * terms.coat_roughness;
    if (width > 0.0) half_vector = sample_ggx(terms.to_viewer, width, u);
    vec3 local = reflected_by(terms.to_viewer, half_vector);
    if (width > 0.0) return rough_sample(terms, surface, local, true);
    vec3 share = vec3(terms.material.clearcoat * clearcoat_fresnel(terms.to_viewer.z));
    return delta_sample(terms, surface, local, share, terms.choice.z);
}

// A direction from which light is scattered to the viewer. u: random numbers in [0, 1). u.z selects the lobe, and
// within the interface between reflection and transmission.
BsdfSample sample_bsdf(BsdfTerms terms, Surface surface, vec3 u) {
    vec4 choice = terms.choice;
    if (choice == vec4(0.0)) return BSDF_ABSORBED;
    if (u.z < choice.x) {
        return sample_interface(terms, surface, vec3(u.xy, min(u.z / choice.x, 0.99999994)));
    }
    if (u.z < choice.x + choice.y) return rough_sample(terms, surface, sample_lambert(u.xy), true);
    if (u.z < choice.x + choice.y + choice.z) return sample_clearcoat(terms, surface, u.xy);
    if (choice.w > 0.0) return rough_sample(terms, surface, sample_sheen(u.xy), true);
    return BSDF_ABSORBED;
}

#endif
