//! Reflection and refraction at the smooth boundary of a dielectric. Twin of `shading/fresnel.glsl`.

use glam::Vec3;

/// Unpolarized Fresnel reflectance of a smooth dielectric; 1 in total internal reflection. `eta`: the refractive
/// index on the ray's side divided by that beyond the surface.
pub fn fresnel(cos_in: f32, cos_out: f32, eta: f32) -> f32 {
    if cos_out <= 0.0 {
        return 1.0;
    }
    let parallel = (cos_in - eta * cos_out) / (cos_in + eta * cos_out);
    let perpendicular = (eta * cos_in - cos_out) / (eta * cos_in + cos_out);
    0.5 * (parallel * parallel + perpendicular * perpendicular)
}

/// Cosine between the refracted ray and the normal by Snell's law; 0 in total internal reflection.
pub fn refraction_cosine(cos_in: f32, eta: f32) -> f32 {
    (1.0 - eta * eta * (1.0 - cos_in * cos_in)).max(0.0).sqrt()
}

/// The direction, mirrored at the surface if it points to the wrong side, which an interpolated normal can cause.
/// `side`: the unit normal that points to the side on which the direction has to be.
pub fn keep_side(direction: Vec3, side: Vec3) -> Vec3 {
    direction - 2.0 * direction.dot(side).min(0.0) * side
}
