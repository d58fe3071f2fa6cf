//! Rectangles that shine to one side. Twin of `emitters/rectangle.glsl`.

use glam::{Vec2, Vec3};

use super::light_sample::{LightSample, sample_of_point, towards};
use crate::layout::AreaLight;

/// Distance at which a ray meets the front of a plane, in lengths of its direction; infinity if it does not.
pub(super) fn hit_plane(light: &AreaLight, origin: Vec3, direction: Vec3) -> f32 {
    let cosine = light.axis.dot(direction);
    let t = (light.position - origin).dot(light.axis) / cosine;
    if cosine < 0.0 && t > 0.0 { t } else { f32::INFINITY }
}

/// Distance at which a ray meets the rectangle's front, in lengths of its direction; infinity if it does not.
pub(super) fn hit_rectangle(light: &AreaLight, origin: Vec3, direction: Vec3) -> f32 {
    let t = hit_plane(light, origin, direction);
    let from_centre = origin + t * direction - light.position;
    let u = from_centre.dot(light.edge_u) / light.edge_u.dot(light.edge_u);
    let v = from_centre.dot(light.edge_v) / light.edge_v.dot(light.edge_v);
    if u.abs() <= 1.0 && v.abs() <= 1.0 { t } else { f32::INFINITY }
}

/// Pdf per steradian of a direction in which a flat light is seen at a distance, if its points are sampled
/// uniformly.
pub(super) fn flat_pdf(light: &AreaLight, direction: Vec3, distance: f32) -> f32 {
    let facing = -light.axis.dot(direction) * light.area;
    if facing > 0.0 { distance * distance / facing } else { 0.0 }
}

/// The distance up to which directions are sampled by solid angle, as a multiple of half the diagonal.
const NEAR_DIAGONALS: f32 = 4.0;
/// The least solid angle by which directions are sampled, steradians.
const LEAST_SOLID_ANGLE: f32 = 1e-3;

/// A rectangle as a point sees it. The twin says what a turn is.
#[derive(Default)]
struct SeenRectangle {
    /// The ends along `edge_u`, from the foot of the point in the rectangle's plane, world units.
    x: [f32; 2],
    /// The ends along `edge_v`.
    y: [f32; 2],
    /// Distance of the point in front of the plane, world units.
    height: f32,
    /// The turn at the first end along `edge_u`.
    first_turn: f32,
    /// The solid angle that the rectangle fills, steradians. It is 0 if directions are not sampled by solid angle.
    solid_angle: f32,
}

/// The arc tangent of x y / (height sqrt(x^2 + y^2 + height^2)).
fn angle_of(x: f32, y: f32, height: f32) -> f32 {
    let squared = height * height;
    let both = ((x * x + squared) * (y * y + squared)).sqrt();
    let half_tangent = x * y / (height * (x * x + y * y + squared).sqrt() + both);
    let tangent = half_tangent / (1.0 + (1.0 + half_tangent * half_tangent).sqrt());
    let s = tangent * tangent;
    let series = 1.0 + s * (-0.333_327_86 + s * (0.199_740_83 + s * (-0.138_484_9 + s * 0.079_762_92)));
    4.0 * tangent * series
}

fn seen_rectangle(light: &AreaLight, point_world: Vec3) -> SeenRectangle {
    let to_centre = light.position - point_world;
    let height = -to_centre.dot(light.axis);
    let (u_squared, v_squared) = (light.edge_u.length_squared(), light.edge_v.length_squared());
    let most_squared = NEAR_DIAGONALS * NEAR_DIAGONALS * (u_squared + v_squared);
    // The condition is not `<=`, so that NaN is none.
    if !(height > 0.0) || to_centre.length_squared() > most_squared {
        return SeenRectangle::default();
    }
    let ends = |edge: Vec3, half: f32| [to_centre.dot(edge) / half - half, to_centre.dot(edge) / half + half];
    let (x, y) = (ends(light.edge_u, u_squared.sqrt()), ends(light.edge_v, v_squared.sqrt()));
    let [first_turn, last_turn] = x.map(|x| angle_of(x, y[1], height) - angle_of(x, y[0], height));
    let solid_angle = last_turn - first_turn;
    let solid_angle = if solid_angle > LEAST_SOLID_ANGLE { solid_angle } else { 0.0 };
    SeenRectangle { x, y, height, first_turn, solid_angle }
}

/// The vector from the point to a point of the rectangle. All directions to the rectangle are equally likely (Urena,
/// Fajardo, King: An Area-Preserving Parametrization for Spherical Rectangles, 2013). `u`: in [0, 1).
fn vector_to_rectangle(light: &AreaLight, seen: &SeenRectangle, u: Vec2) -> Vec3 {
    let ([x0, x1], [y0, y1]) = (seen.x, seen.y);
    let turn = seen.first_turn + u.x * seen.solid_angle;
    let (squared, sine) = (seen.height * seen.height, turn.sin());
    // Cosines between the plane's normal and those of the planes through the point and the edges y0 and y1.
    let (b0, b1) = (-y0 / (y0 * y0 + squared).sqrt(), y1 / (y1 * y1 + squared).sqrt());
    let n = turn.cos() * b0 + b1;
    // 1 - b0^2 without cancellation.
    let rest = squared / (y0 * y0 + squared);
    let root = (n * n - rest * sine * sine).max(1e-20).sqrt();
    let sign = if n > 0.0 { 1.0 } else { -1.0 };
    let x = (seen.height * sine * sign / root).max(x0).min(x1);
    let across = x * x + squared;
    let [low, high] = [y0, y1].map(|y| y / (across + y * y).sqrt());
    let at = low + u.y * (high - low);
    let y = (at * (across / (1.0 - at * at).max(1e-20)).sqrt()).max(y0).min(y1);
    x * light.edge_u.normalize() + y * light.edge_v.normalize() - seen.height * light.axis
}

/// Pdf per steradian with which [`sample_rectangle`] samples a direction in which the rectangle is seen at a distance,
/// without the probability of the light.
pub(super) fn rectangle_pdf(light: &AreaLight, point_world: Vec3, direction: Vec3, distance: f32) -> f32 {
    let seen = seen_rectangle(light, point_world);
    if seen.solid_angle > 0.0 { 1.0 / seen.solid_angle } else { flat_pdf(light, direction, distance) }
}

pub(super) fn sample_rectangle(light: &AreaLight, point_world: Vec3, u: Vec2) -> LightSample {
    let seen = seen_rectangle(light, point_world);
    if seen.solid_angle > 0.0 {
        let way = towards(Vec3::ZERO, vector_to_rectangle(light, &seen, u));
        return sample_of_point(way, light.radiance, light.probability / seen.solid_angle);
    }
    let point = light.position + (2.0 * u.x - 1.0) * light.edge_u + (2.0 * u.y - 1.0) * light.edge_v;
    let way = towards(point_world, point);
    let pdf = light.probability * flat_pdf(light, way.direction, way.distance);
    sample_of_point(way, light.radiance, pdf)
}
