// Reflection and refraction at the smooth boundary of a dielectric. Twin of src/reference/fresnel.rs.
#ifndef KDRAY_FRESNEL
#define KDRAY_FRESNEL

// Unpolarized Fresnel reflectance of a smooth dielectric; 1 in total internal reflection. cos_in: above 0. cos_out:
// from refraction_cosine. eta: refractive index on the ray's side divided by that beyond the surface.
float fresnel(float cos_in, float cos_out, float eta) {
    if (cos_out <= 0.0) return 1.0;
    float parallel = (cos_in - eta * cos_out) / (cos_in + eta * cos_out);
    float perpendicular = (eta * cos_in - cos_out) / (eta * cos_in + cos_out);
    return 0.5 * (parallel * parallel + perpendicular * perpendicular);
}

// Cosine between the refracted ray and the normal by Snell's law; 0 in total internal reflection.
float refraction_cosine(float cos_in, float eta) {
    return sqrt(max(0.0, 1.0 - eta * eta * (1.0 - cos_in * cos_in)));
}

// The direction, mirrored at the surface if it points to the wrong side, which an interpolated normal can cause.
// side: the unit normal that points to the side on which the direction has to be.
vec3 keep_side(vec3 direction, vec3 side) {
    return direction - 2.0 * min(dot(direction, side), 0.0) * side;
}

#endif
