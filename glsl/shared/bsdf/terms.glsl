// What all lobes need that depends on the material and the viewer: the lobes' shares, and the probabilities with which
// the lobes are chosen. Twin of src/reference/bsdf/terms.rs.
#ifndef KDRAY_BSDF_TERMS
#define KDRAY_BSDF_TERMS

#include "layout.glsl"
#include "shading/maps.glsl"
#include "shading/surface.glsl"
#include "shading/microfacet.glsl"
#include "shading/fresnel.glsl"
#include "bsdf/albedo.glsl"
#include "bsdf/clearcoat.glsl"
#include "bsdf/lobes.glsl"
#include "bsdf/local_frame.glsl"
#include "bsdf/multiple_scattering.glsl"
#include "bsdf/sheen.glsl"
#include "bsdf/solid_loss.glsl"

// What all lobes need that depends on the material and the viewer.
struct BsdfTerms {
    Material material;
    LocalFrame frame;
    vec3 to_viewer;
    // Width of the interface's distribution of normals. It is 0 if the interface is perfectly smooth.
    float width;
    // Roughness of the clear coat. It is 0 if the coat is perfectly smooth.
    float coat_roughness;
    float sheen_roughness;
    // Index of refraction on the viewer's side, divided by that of the other side. 1: light passes unbent.
    float eta;
    bool is_solid;
    // Whether there is an interface. Without one, the base is Lambertian.
    bool has_interface;
    // Share of the light that the lobes above leave to the sheen, and to the interface.
    float sheen_share;
    float base_share;
    float sheen_bound;
    // Factor on what a sheet or a solid reflects and transmits, for the light that bounces between microfacets.
    float clear_gain;
    // Largest channels of what the dielectric reflects: along the normal, at grazing angles, and after light has
    // bounced between microfacets. They give its albedo.
    vec3 dielectric;
    // Reflectance of the Lambertian surface and of the light that bounces between microfacets, apart from the factor
    // that depends on the light's direction.
    vec3 below;
    vec3 between;
    // Probability that the interface's light is sampled as reflected if it passes straight, whatever the microfacet.
    float straight_choice;
    // Probabilities of the lobes: interface, Lambertian, clear coat, sheen. Their sum is 1, or 0 for a black surface.
    vec4 choice;
};

// The shares of light that a microfacet of the interface reflects and lets pass.
struct InterfaceSplit {
    vec3 reflected;
    vec3 transmitted;
};

// What a microfacet of the interface does with light. cosine: between the microfacet's normal and the viewer.
InterfaceSplit split_at(BsdfTerms terms, float cosine) {
    Material material = terms.material;
    cosine = clamp(cosine, 0.0, 1.0);
    vec3 opaque = dielectric_reflectance(material, cosine);
    vec3 clear = opaque;
    if (terms.is_solid) clear = vec3(fresnel(cosine, refraction_cosine(cosine, terms.eta), terms.eta));
    vec3 reflected = mix(opaque, terms.clear_gain * clear, material.transmission);
    reflected = with_metal(material, reflected, metal_fresnel(material, cosine));
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
        vec3 share = with_metal(material, (1.0 - material.transmission) * later, later_metal);
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
    return with_metal(material, (1.0 - material.transmission) * opaque, metal);
}

// Sets the shares and the probabilities of the lobes.
void set_shares(inout BsdfTerms terms, GgxAlbedo albedo) {
    Material material = terms.material;
    float cosine = terms.to_viewer.z;
    float coat = 0.0, sheen = 0.0;
    if (has_clearcoat(material)) coat = material.clearcoat * clearcoat_albedo(cosine, terms.coat_roughness);
    if (has_sheen(material)) sheen = sheen_albedo(cosine, terms.sheen_roughness);
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
    terms.straight_choice = reflected_choice(split);
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

// The share of light that a sheet or the boundary of a solid would lose between microfacets.
float clear_loss(BsdfTerms terms, GgxAlbedo albedo) {
    if ((terms.material.flags & MATERIAL_SINGLE_SCATTERING) != 0u) return 0.0;
    if (!terms.is_solid) return albedo.loss;
    // Light passes the boundary straight, or the boundary is perfectly smooth.
    if (!scene_has_lobe(LOBE_TRANSMISSION) || terms.eta == 1.0 || terms.width == 0.0) return 0.0;
    return solid_loss(terms.to_viewer.z, sqrt(terms.width), terms.eta);
}

// The mapped normal, turned towards the interpolated one just as far that no mirror image of the viewer is below the
// surface. It is then half-way between the viewer, seen in the plane in which the normal turns, and the horizon there.
vec3 mirroring_normal(Surface surface, vec3 to_viewer) {
    vec3 up = surface.interpolated, normal = surface.shading;
    up = normalize(up + max(LEAST_COSINE - dot(up, to_viewer), 0.0) * to_viewer);
    float cosine = dot(normal, to_viewer);
    if (cosine > 0.0 && dot(up, 2.0 * cosine * normal - to_viewer) >= 0.0) return normal;
    vec3 horizon = normalize(normal - dot(normal, up) * up);
    return normalize(normalize(dot(to_viewer, up) * up + dot(to_viewer, horizon) * horizon) + horizon);
}

// The normal around which the lobes are. The viewer is on the front of the triangle, but may be behind an interpolated
// normal, or behind that of a map. Lambertian surfaces look alike from everywhere, so their mapped normal stays.
vec3 normal_of_lobes(Material material, Surface surface, vec3 to_viewer) {
    if (is_bent(surface)) {
        bool is_lambertian = !has_interface(material) && !has_clearcoat(material) && !has_sheen(material);
        return is_lambertian ? surface.shading : mirroring_normal(surface, to_viewer);
    }
    return dot(surface.shading, to_viewer) < LEAST_COSINE ? surface.geometric : surface.shading;
}

// The terms for a viewer.
BsdfTerms bsdf_terms(Material material, Surface surface, vec3 to_viewer) {
    // Textures of floats can have any value.
    material.kd = clamp(material.kd, 0.0, 1.0);
    material.sheen_colour = clamp(material.sheen_colour, 0.0, 1.0);
    BsdfTerms terms;
    terms.frame = frame_around(normal_of_lobes(material, surface, to_viewer));
    terms.to_viewer = to_local(terms.frame, to_viewer);
    terms.to_viewer.z = max(terms.to_viewer.z, LEAST_COSINE);
    terms.material = material;
    terms.width = interface_width(material);
    terms.coat_roughness = clearcoat_roughness(material);
    terms.sheen_roughness = clamp(material.sheen_roughness, LEAST_SHEEN_ROUGHNESS, 1.0);
    terms.is_solid = (material.flags & MATERIAL_SOLID) != 0u && passing_share(material) > 0.0;
    terms.eta = surface.from_inside ? material.ni : 1.0 / material.ni;
    if (!terms.is_solid || abs(material.ni - 1.0) < LEAST_INDEX_STEP) terms.eta = 1.0;
    terms.has_interface = has_interface(material);
    float roughness = sqrt(terms.width);
    GgxAlbedo albedo = NO_ALBEDO;
    if (terms.has_interface) albedo = ggx_albedo(terms.to_viewer.z, roughness);
    terms.clear_gain = 1.0 / (1.0 - clear_loss(terms, albedo));
    set_lambert(terms, albedo, roughness);
    set_shares(terms, albedo);
    if ((material.flags & MATERIAL_UNLIT) != 0u) terms.choice = vec4(0.0);
    return terms;
}

#endif
