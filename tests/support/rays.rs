//! Rays at a mesh: ordinary ones, and those on which traversals are likely to fail. The latter are *nasty*.

use std::{collections::BTreeMap, sync::Mutex};

use glam::{DVec3, Vec3};
use kdray::{
    accel::{Query, kdtree::Node},
    cast::{GpuCaster, Ray, StreamHit, StreamRay},
    layout::{NO_TRIANGLE, PathRay, Triangle},
};

use super::{MeshWithTree, random::Random};

/// Returns a ray without an end, from no triangle.
pub fn ray(origin: Vec3, direction: Vec3) -> PathRay {
    PathRay {
        origin,
        pixel_ix: 0,
        direction,
        source_triangle: NO_TRIANGLE,
        throughput: Vec3::ONE,
        t_max: f32::INFINITY,
    }
}

fn corner(random: &mut Random, triangles: &[Triangle]) -> Vec3 {
    let t = random.of(triangles);
    *random.of(&[t.v0, t.v1, t.v2])
}

/// Returns the middle of an edge, or a point elsewhere on it.
fn edge_point(random: &mut Random, triangles: &[Triangle]) -> Vec3 {
    let t = random.of(triangles);
    let (a, b) = *random.of(&[(t.v0, t.v1), (t.v1, t.v2), (t.v2, t.v0)]);
    let share = if random.below(2) == 0 { 0.5 } else { random.unit() };
    a + share * (b - a)
}

fn axis_direction(random: &mut Random) -> Vec3 {
    let axis = *random.of(&Vec3::AXES);
    if random.below(2) == 0 { axis } else { -axis }
}

/// Moves `point` into a split plane of the tree, along the plane's axis. Returns it with the axis.
fn split_plane_point(random: &mut Random, world: &MeshWithTree, point: Vec3) -> (Vec3, usize) {
    let mut point = point;
    for _ in 0..100 {
        if let Node::Split { axis, position, .. } = world.tree().node(random.below(world.tree().nodes().len()) as u32) {
            point[axis] = position;
            return (point, axis);
        }
    }
    (point, 0)
}

/// Returns a ray of one of the kinds below, selected by `kind` modulo `N_KINDS`. Some rays end early, and some come
/// from a triangle.
pub fn nasty_ray(random: &mut Random, world: &MeshWithTree, kind: usize) -> PathRay {
    let far = world.centre() + 3.0 * world.radius() * random.direction();
    let within = random.in_box(world.tree().box_min(), world.tree().box_max());
    let vertex = corner(random, &world.triangles);
    let edge = edge_point(random, &world.triangles);
    let (on_plane, axis) = split_plane_point(random, world, within);
    let mut in_plane = random.direction();
    in_plane[axis] = 0.0;
    let almost_in_plane = in_plane + 1e-5 * random.direction();
    let (origin, towards) = match kind % N_KINDS {
        0 => (far, within - far),
        1 => (within, random.direction()),
        2 => (far, vertex - far),
        3 => (far, edge - far),
        4 => (vertex, random.direction()),
        5 => (edge, within - edge),
        6 => (within, axis_direction(random)),
        7 => (vertex, axis_direction(random)),
        8 => (vertex - 3.0 * world.radius() * Vec3::X, Vec3::X),
        9 => (on_plane, in_plane),
        10 => (on_plane, almost_in_plane),
        11 => (on_plane, random.direction()),
        12 => (vertex, edge - vertex),
        _ => (within, vertex - within),
    };
    let towards = if towards.length_squared() > 0.0 { towards.normalize() } else { Vec3::Y };
    let mut ray = ray(origin, towards);
    if random.below(4) == 0 {
        ray.t_max = 2.0 * world.radius() * random.unit();
    }
    if random.below(8) == 0 {
        ray.source_triangle = random.below(world.triangles.len()) as u32;
    }
    ray
}

/// Number of kinds of rays that `nasty_ray` makes.
pub const N_KINDS: usize = 14;

/// Returns a ray from inside a convex mesh around 0 to a corner or a point of an edge.
pub fn outward_ray(random: &mut Random, triangles: &[Triangle]) -> PathRay {
    let t = *random.of(triangles);
    let target = if random.below(2) == 0 { t.v0 } else { edge_point(random, triangles) };
    let origin = if random.below(4) == 0 { Vec3::ZERO } else { 0.5 * random.unit() * random.direction() };
    ray(origin, (target - origin).normalize())
}

/// Returns the indices of the triangles that a ray meets in double precision, by their t. None if it comes near an
/// edge or a plane's end, or if the order of two is not clear.
pub fn met_in_double_precision(triangles: &[Triangle], ray: &Ray) -> Option<Vec<u32>> {
    const NEAR: f64 = 1e-4;
    let (origin, direction) = (ray.origin.as_dvec3(), ray.direction.as_dvec3());
    let mut met: Vec<(f64, u32)> = Vec::new();
    for (triangle_ix, triangle) in (0..).zip(triangles) {
        let corners: [DVec3; 3] = [triangle.v0, triangle.v1, triangle.v2].map(|v| v.as_dvec3() - origin);
        let volume = |i: usize, j: usize| direction.dot(corners[i].cross(corners[j]));
        let edges = [volume(1, 2), volume(2, 0), volume(0, 1)];
        let normal = (corners[1] - corners[0]).cross(corners[2] - corners[0]);
        let sum = direction.dot(normal);
        let shares = edges.map(|edge| edge / sum);
        let least = shares.into_iter().fold(f64::INFINITY, f64::min);
        let t = corners[0].dot(normal) / sum;
        if sum.abs() < NEAR * normal.length() || least.abs() < NEAR || t.abs() < NEAR {
            return None;
        }
        if least > 0.0 && t > 0.0 {
            met.push((t, triangle_ix));
        }
    }
    met.sort_by(|a, b| a.0.total_cmp(&b.0));
    let is_clear = met.windows(2).all(|pair| pair[1].0 - pair[0].0 > NEAR);
    is_clear.then(|| met.into_iter().map(|(_, triangle_ix)| triangle_ix).collect())
}

/// Returns the hits of a stream of rays, whose parts come in any order.
pub fn streamed<R: StreamRay, H: StreamHit>(caster: &mut GpuCaster, rays: &[R], query: Query) -> Vec<H> {
    let parts = Mutex::new(BTreeMap::new());
    let make = |first: usize, part: &mut [R]| part.copy_from_slice(&rays[first..][..part.len()]);
    let take = |first: usize, hits: &[H]| assert!(parts.lock().unwrap().insert(first, hits.to_vec()).is_none());
    caster.cast_stream(rays.len(), query, make, take).expect("a stream");
    parts.into_inner().unwrap().into_values().flatten().collect()
}
