// Materials: local light by Phong, mirrors, glass and transparency as in Wavefront MTL, and microfacets
// (microfacet.glsl). Twin of src/reference/material.rs.
#ifndef KDRAY_MATERIAL
#define KDRAY_MATERIAL

#include "layout.glsl"
#include "scene.glsl"
#include "shading/materials.glsl"
#include "shading/surface.glsl"
#include "shading/microfacet.glsl"
#include "shading/fresnel.glsl"

// The directions in which a ray continues from a surface, and the weights by which its throughput is multiplied. A
// weight of zero means that there is no such ray.
struct Scattering {
    vec3 reflected;
    vec3 reflected_weight;
    vec3 transmitted;
    vec3 transmitted_weight;
    // Whether what is transmitted goes straight on through a blended surface.
    bool passes_straight;
};

// Whether the surface shows its colour without any light.
bool is_unlit(Material material) {
    return MICROFACETS && (material.flags & MATERIAL_UNLIT) != 0u;
}

// The weight of the light that the surface itself reflects and emits. A see-through material (d < 1) covers only a
// share d of what is behind it. A material that refracts shows its own light in full.
float local_weight(Material material) {
    if (is_microfacet(material) || is_unlit(material)) return material.d;
    return (material.flags & MATERIAL_REFRACT) != 0u ? 1.0 : material.d;
}

// Whether rays may continue from the surface.
bool scatters_light(Material material) {
    if (is_unlit(material)) return material.d < 1.0;
    if (is_microfacet(material)) {
        return material.d < 1.0 || material.transmission > 0.0 || mirror_share(material) > 0.0;
    }
    return (material.flags & (MATERIAL_REFLECT | MATERIAL_REFRACT)) != 0u || material.d < 1.0;
}

// The reflectance towards the viewer: the diffuse part, which is multiplied by the cosine of the light's direction,
// plus the specular part, which is not. All vectors are unit vectors that point away from the surface.
vec3 phong(Material material, vec3 normal, vec3 to_viewer, vec3 to_light) {
    float cos_light = dot(normal, to_light);
    if (!(cos_light > 0.0)) return vec3(0.0);
    vec3 reflectance = material.kd * cos_light;
    float cos_mirror = dot(reflect(-to_light, normal), to_viewer);
    if ((material.flags & MATERIAL_SPECULAR) != 0u && cos_mirror > 0.0) {
        reflectance += material.ks * pow(cos_mirror, material.ns);
    }
    return reflectance;
}

// The radiance that the surface gives off by itself.
vec3 emitted(Material material) {
    return is_unlit(material) ? material.kd + material.ke : material.ke;
}

// The share of the ambient light that the surface shows.
vec3 ambient_share(Material material, vec3 normal, vec3 to_viewer) {
    if (is_unlit(material)) return vec3(0.0);
    if (is_microfacet(material)) return material.ka * ambient_reflectance(material, normal, to_viewer);
    return material.ka;
}

// The reflectance towards the viewer, times the cosine of the light's direction where the light is reflected
// diffusely or by microfacets. All vectors are unit vectors that point away from the surface.
vec3 reflectance_of(Material material, vec3 normal, vec3 to_viewer, vec3 to_light) {
    if (is_unlit(material)) return vec3(0.0);
    if (is_microfacet(material)) return microfacet_reflectance(material, normal, to_viewer, to_light);
    return phong(material, normal, to_viewer, to_light);
}

// Whether the surface can show a light: whether it reflects towards the viewer more than LEAST_REFLECTANCE, in any
// colour, of the light that comes from the direction to_light.
bool can_show(Material material, vec3 normal, vec3 to_viewer, vec3 to_light) {
    if (is_unlit(material)) return false;
    // The diffuse part alone decides most cases, without the exponentiation of the specular part.
    vec3 diffuse = material.kd * dot(normal, to_light) * local_weight(material);
    if (!is_microfacet(material) && any(greaterThan(diffuse, vec3(LEAST_REFLECTANCE)))) return true;
    vec3 reflectance = reflectance_of(material, normal, to_viewer, to_light) * local_weight(material);
    return any(greaterThan(reflectance, vec3(LEAST_REFLECTANCE)));
}

// How a ray of this direction continues from a surface of microfacets. What is transmitted is not spread, however rough
// the surface is.
Scattering scatter_by_microfacets(Material material, Surface surface, vec3 direction) {
    Scattering s = Scattering(vec3(0.0), vec3(0.0), direction, vec3(0.0), material.d < 1.0);
    float through = material.transmission * (1.0 - material.metallic);
    bool is_solid = (material.flags & MATERIAL_SOLID) != 0u && through > 0.0;
    float eta = surface.from_inside ? material.ni : 1.0 / material.ni;
    float cos_in = max(dot(surface.shading, -direction), LEAST_COSINE);
    float cos_out = refraction_cosine(cos_in, eta);
    bool total = is_solid && cos_out <= 0.0;
    vec3 dielectric = is_solid ? vec3(fresnel(cos_in, cos_out, eta)) : dielectric_reflectance(material, cos_in);
    vec3 reflected = mix(dielectric, metal_reflectance(material, cos_in), material.metallic);
    s.reflected = keep_side(normalize(direction + 2.0 * cos_in * surface.shading), surface.geometric);
    s.reflected_weight = material.d * (total ? 1.0 : mirror_share(material)) * reflected;
    // A ray through a solid is tinted twice, where it enters and where it leaves.
    vec3 tint = is_solid ? sqrt(material.kd) : material.kd;
    s.transmitted_weight = material.d * through * (1.0 - largest_of(dielectric)) * tint + (1.0 - material.d);
    if (is_solid && !total) {
        vec3 refracted = eta * direction + (eta * cos_in - cos_out) * surface.shading;
        s.transmitted = keep_side(normalize(refracted), -surface.geometric);
        s.passes_straight = false;
    }
    return s;
}

// The transmittance of a ray, which may have come through a solid (Beer and Lambert). t: the ray's length, world
// units.
vec3 transmittance(Material material, Surface surface, float t) {
    bool is_absorbed = is_microfacet(material) && (material.flags & MATERIAL_SOLID) != 0u && surface.from_inside;
    return is_absorbed ? exp(-material.absorption * t) : vec3(1.0);
}

// How a ray of this direction continues from a surface.
Scattering scatter(Material material, Surface surface, vec3 direction) {
    if (is_unlit(material)) return Scattering(vec3(0.0), vec3(0.0), direction, vec3(1.0 - material.d), true);
    if (is_microfacet(material)) return scatter_by_microfacets(material, surface, direction);
    Scattering s = Scattering(vec3(0.0), vec3(0.0), direction, vec3(0.0), false);
    bool reflects = (material.flags & MATERIAL_REFLECT) != 0u;
    bool refracts = (material.flags & MATERIAL_REFRACT) != 0u;
    if (!reflects && !refracts) {
        s.transmitted_weight = vec3(1.0 - material.d);
        s.passes_straight = true;
        return s;
    }
    float eta = surface.from_inside ? material.ni : 1.0 / material.ni;
    // An interpolated normal can turn away from the viewer. The ray then counts as grazing.
    float cos_in = max(dot(surface.shading, -direction), LEAST_COSINE);
    float cos_out = refraction_cosine(cos_in, eta);
    bool total = refracts && cos_out <= 0.0;
    bool has_fresnel = (material.flags & MATERIAL_FRESNEL) != 0u;
    vec3 share = has_fresnel ? vec3(fresnel(cos_in, cos_out, eta)) : (total ? vec3(1.0) : material.ks);
    if (reflects) {
        s.reflected = keep_side(normalize(direction + 2.0 * cos_in * surface.shading), surface.geometric);
        s.reflected_weight = has_fresnel && !refracts ? share * material.ks : share;
    }
    if (refracts && !total) {
        vec3 through = eta * direction + (eta * cos_in - cos_out) * surface.shading;
        s.transmitted = keep_side(normalize(through), -surface.geometric);
        s.transmitted_weight = reflects ? (1.0 - share) * material.tf : material.tf;
    }
    return s;
}

#endif
