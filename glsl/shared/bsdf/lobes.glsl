// Which lobes a material has, whoever looks at it. Twin of src/reference/bsdf/lobes.rs.
//
// What depends on a lobe that no material of the scene has is left out when the driver compiles the kernel. That saves
// registers, and time on drivers that run both sides of a branch. The twin needs no such constant.
#ifndef KDRAY_BSDF_LOBES
#define KDRAY_BSDF_LOBES

#include "layout.glsl"
#include "shading/microfacet.glsl"
#include "bsdf/conductor.glsl"

layout(constant_id = CONSTANT_LOBES) const uint LOBES = 0xffffffffu;

// Whether materials of the scene may have a lobe, `LOBE_INTERFACE` and its like.
bool scene_has_lobe(uint lobe) {
    return (LOBES & lobe) != 0u;
}

// Whether the material has an interface, which reflects light or lets it pass. Otherwise its base is Lambertian.
bool has_interface(Material material) {
    if (!scene_has_lobe(LOBE_INTERFACE)) return false;
    return largest_of(material.ks) > 0.0 || material.metallic > 0.0 || material.transmission > 0.0;
}

bool has_clearcoat(Material material) {
    return scene_has_lobe(LOBE_CLEARCOAT) && material.clearcoat > 0.0;
}

bool has_sheen(Material material) {
    return scene_has_lobe(LOBE_SHEEN) && largest_of(material.sheen_colour) > 0.0;
}

float mean_of(vec3 v) {
    return (v.x + v.y + v.z) / 3.0;
}

// The width of the distribution of the interface's normals; 0 if it is perfectly smooth.
float interface_width(Material material) {
    bool is_of_phong = (material.flags & MATERIAL_PHONG_WIDTH) != 0u;
    float width = is_of_phong ? sqrt(2.0 / (material.ns + 2.0)) : material.roughness * material.roughness;
    return width < LEAST_ROUGH_WIDTH ? 0.0 : min(width, 1.0);
}

// The roughness of the clear coat; 0 if it is perfectly smooth.
float clearcoat_roughness(Material material) {
    float roughness = material.clearcoat_roughness;
    return roughness * roughness < LEAST_ROUGH_WIDTH ? 0.0 : min(roughness, 1.0);
}

// Share of light that passes through the surface, of that which the dielectric and the metal do not reflect.
float passing_share(Material material) {
    if (!scene_has_lobe(LOBE_TRANSMISSION)) return 0.0;
    return material.transmission * (1.0 - material.metallic);
}

// Whether all of the surface's lobes are perfectly smooth. Lights cannot be sampled for it.
bool is_smooth(Material material) {
    if ((material.flags & MATERIAL_UNLIT) != 0u) return true;
    bool has_lambert = largest_of(material.kd) * (1.0 - material.metallic) * (1.0 - material.transmission) > 0.0;
    bool has_rough_coat = has_clearcoat(material) && clearcoat_roughness(material) > 0.0;
    return interface_width(material) == 0.0 && !has_lambert && !has_rough_coat && !has_sheen(material);
}

// Reflectance of the metal where the light's angle to the microfacet's normal has this cosine.
vec3 metal_fresnel(Material material, float cosine) {
    bool is_conductor = scene_has_lobe(LOBE_CONDUCTOR) && (material.flags & MATERIAL_CONDUCTOR) != 0u;
    if (!is_conductor) return metal_reflectance(material, cosine);
    return conductor_reflectance(cosine, material.conductor_eta, material.conductor_k);
}

// The mean of the reflectances of a dielectric and of a metal, weighted as the material is metallic.
vec3 with_metal(Material material, vec3 dielectric, vec3 metal) {
    return scene_has_lobe(LOBE_METAL) ? mix(dielectric, metal, material.metallic) : dielectric;
}

// The albedo of a material of MTL as the integrator whitted reads it: that of the microfacets which it is for paths
// (src/world/path_materials.rs).
vec3 phong_albedo(Material material) {
    float ratio = (material.ni - 1.0) / (material.ni + 1.0);
    if ((material.flags & MATERIAL_REFRACT) != 0u) return material.tf + ratio * ratio;
    bool is_mirror = (material.flags & MATERIAL_REFLECT) != 0u;
    if (is_mirror && (material.flags & MATERIAL_FRESNEL) != 0u) return material.kd + normal_reflectance(material);
    bool reflects = is_mirror || (material.flags & MATERIAL_SPECULAR) != 0u;
    return reflects ? material.kd + material.ks : material.kd;
}

// About the share of light that the surface scatters, by colour: what it reflects along its normal, or lets pass. Of
// metals it is the reflectance, of glass the tint. It is the same for both integrators.
vec3 hit_albedo(Material material) {
    if ((material.flags & MATERIAL_UNLIT) != 0u) return clamp(material.kd, 0.0, 1.0);
    if (!is_microfacet(material)) return clamp(phong_albedo(material), 0.0, 1.0);
    vec3 base = material.kd * (1.0 - material.transmission * (1.0 - material.tf));
    vec3 dielectric = base + normal_reflectance(material);
    return clamp(with_metal(material, dielectric, metal_fresnel(material, 1.0)), 0.0, 1.0);
}

// The albedo of `hit_albedo`, but 1 for a perfectly smooth surface, which shows other surfaces.
vec3 surface_albedo(Material material) {
    return is_smooth(material) ? vec3(1.0) : hit_albedo(material);
}

// How narrow the surface scatters light, 0..1: the share of its albedo that is not Lambertian, less the wider its
// distribution of microfacets is.
float surface_gloss(Material material) {
    float sum = mean_of(surface_albedo(material));
    if (is_smooth(material) || !(sum > 0.0)) return is_smooth(material) ? 1.0 : 0.0;
    float lambertian = mean_of(material.kd) * (1.0 - material.metallic) * (1.0 - material.transmission);
    return (1.0 - interface_width(material)) * clamp(1.0 - lambertian / sum, 0.0, 1.0);
}

#endif
