//! Tests hits of needles and other narrow triangles. Their t, and the points that their weights give, are within the
//! bounds that the documentation of `reference::triangle` proves.

use crate::support::{
    MeshWithTree, compare, device,
    meshes::triangle,
    packets::{simd_levels, traced},
    random::Random,
    rays::ray,
    with_lanes,
};
use glam::{DVec3, Vec3};
use kdray::{
    accel::{Query, kdtree::Traversal},
    cast::{GpuCaster, Ray, cast_on_cpu},
    layout::{Hit, NO_TRIANGLE, PathRay, Triangle},
    reference::triangle::Shear,
};

/// Half of the distance between 1 and the next float.
const U: f64 = 1.0 / (1 << 24) as f64;

const SHORT_EDGES: [f32; 6] = [1e-1, 1e-2, 1e-3, 1e-4, 1e-5, 1e-6];
const N_NEEDLES: usize = 50_000;
/// The least cosine between a ray and a normal, and the least distance, for which `PLAIN_BOUND` applies.
const LEAST_COSINE: f64 = 0.2;
const LEAST_DISTANCE: f64 = 0.5;
/// Bound of the error along the ray, as a share of the hit's distance.
const PLAIN_BOUND: f64 = 2e-6;

fn corners(triangle: &Triangle) -> [DVec3; 3] {
    [triangle.v0, triangle.v1, triangle.v2].map(|v| v.as_dvec3())
}

/// A ray's exact hit of a triangle's plane, and what bounds the error of a computed hit.
struct Exact {
    t: f64,
    length: f64,
    cosine: f64,
    /// The D of the proof.
    reach: f64,
    /// The L of the proof.
    span: f64,
}

impl Exact {
    fn of(ray: &PathRay, triangle: &Triangle) -> Self {
        let (origin, direction) = (ray.origin.as_dvec3(), ray.direction.as_dvec3());
        let [v0, v1, v2] = corners(triangle);
        let normal = (v1 - v0).cross(v2 - v0);
        let greatest = |vectors: [DVec3; 3]| vectors.map(|v| v.abs().max_element()).into_iter().fold(0.0, f64::max);
        Self {
            t: normal.dot(v0 - origin) / normal.dot(direction),
            length: direction.length(),
            cosine: normal.dot(direction).abs() / (normal.length() * direction.length()),
            reach: greatest([v0 - origin, v1 - origin, v2 - origin]),
            span: greatest([v1 - v0, v2 - v1, v0 - v2]),
        }
    }

    /// Returns the error of a hit along the ray, in world units.
    fn error(&self, hit: &Hit) -> f64 {
        (f64::from(hit.t) - self.t).abs() * self.length
    }

    fn is_steep(&self) -> bool {
        self.cosine > LEAST_COSINE
    }

    fn distance(&self) -> f64 {
        self.t * self.length
    }

    /// Returns the bound of the proof. For a steep ray from far enough away, it is also at most a share of the
    /// distance.
    fn bound(&self) -> f64 {
        let proven = U * ((7.0 * self.reach + 5.0 * self.span) / self.cosine + 13.0 * self.reach + 20.0 * self.span);
        let is_plain = self.is_steep() && self.distance() >= LEAST_DISTANCE;
        if is_plain { proven.min(PLAIN_BOUND * self.distance()) } else { proven }
    }
}

/// Returns the greatest coordinate of the difference between the point at t and the point that the weights give.
fn gap(ray: &PathRay, triangle: &Triangle, hit: &Hit) -> f64 {
    let [v0, v1, v2] = corners(triangle);
    let [t, u, v] = [hit.t, hit.u, hit.v].map(f64::from);
    let at_weights = v0 + u * (v1 - v0) + v * (v2 - v0);
    (ray.origin.as_dvec3() + t * ray.direction.as_dvec3() - at_weights).abs().max_element()
}

/// Says why a hit is wrong, if it is.
fn fault(ray: &PathRay, triangle: &Triangle, hit: &Hit) -> Option<String> {
    let exact = Exact::of(ray, triangle);
    let (error, gap) = (exact.error(hit), gap(ray, triangle, hit));
    // The bound for the proof's point Q, and 8 u L more for the weights.
    let gap_bound = U * (11.5 * exact.reach + 22.0 * exact.span);
    let is_within = hit.u >= 0.0 && hit.v >= 0.0 && f64::from(hit.u) + f64::from(hit.v) <= 1.0 + 16.0 * U;
    // A triangle without area has no plane.
    let is_right = is_within && gap <= gap_bound && (error <= exact.bound() || exact.cosine.is_nan());
    (!is_right).then(|| format!("{error:e} along {ray:?}, {gap:e} off {triangle:?}: {hit:?}, not {}", exact.t))
}

/// Returns a needle of length 1. The two corners at one of its ends are `short_edge` apart. The order of corners is
/// random.
fn needle(random: &mut Random, short_edge: f32) -> Triangle {
    let from = random.in_box(Vec3::NEG_ONE, Vec3::ONE);
    let mut corners = [from, from + short_edge * random.direction(), from + random.direction()];
    corners.rotate_left(random.below(3));
    triangle(corners[0], corners[1], corners[2])
}

/// Returns a ray towards a point of the triangle, from a distance of 0.5 to 3.
fn ray_at(random: &mut Random, triangle: &Triangle, direction: Vec3) -> PathRay {
    let (share, along) = (random.unit().sqrt(), random.unit());
    let [v0, v1, v2] = corners(triangle);
    let target = v0 + f64::from(share) * (v1 - v0 + f64::from(along) * (v2 - v1));
    let distance = f64::from(random.between(0.5, 3.0));
    ray((target - distance * direction.as_dvec3()).as_vec3(), direction)
}

/// Returns a ray that meets the triangle's plane at more than the least cosine.
fn steep_ray_at(random: &mut Random, triangle: &Triangle) -> PathRay {
    loop {
        let direction = random.direction();
        let ray = ray_at(random, triangle, direction);
        if Exact::of(&ray, triangle).is_steep() {
            return ray;
        }
    }
}

fn alone(ray: &PathRay, triangle: &Triangle) -> Option<Hit> {
    Shear::of(ray.origin.to_array(), ray.direction.to_array()).intersect_triangle(triangle, 0)
}

/// Returns the hit by rounded edge functions, as in Woop, Benthin and Wald: t is a mean of the corners' depths. The
/// signs of these edge functions are made exact, so the same triangles are hit.
fn by_rounded_edges(ray: &PathRay, triangle: &Triangle) -> Option<Hit> {
    let longest = ray.direction.abs().max_position();
    let last = |v: Vec3| Vec3::from_array([1, 2, 3].map(|i| v[(longest + i) % 3]));
    let direction = last(ray.direction);
    let [a, b, c] = [triangle.v0, triangle.v1, triangle.v2].map(|corner| {
        let p = last(corner) - last(ray.origin);
        Vec3::new(p.x - direction.x / direction.z * p.z, p.y - direction.y / direction.z * p.z, p.z)
    });
    let edges = [[c, b], [a, c], [b, a]].map(|[p, q]| match p.x * q.y - p.y * q.x {
        0.0 => (f64::from(p.x) * f64::from(q.y) - f64::from(p.y) * f64::from(q.x)) as f32,
        rounded => rounded,
    });
    let det = edges[0] + edges[1] + edges[2];
    let is_outside = edges.iter().any(|&edge| edge < 0.0) && edges.iter().any(|&edge| edge > 0.0);
    let depth = edges[0] * a.z + edges[1] * b.z + edges[2] * c.z;
    let t = depth * (1.0 / direction.z) * (1.0 / det);
    (!is_outside && det.abs() > 0.0).then_some(Hit { t, triangle_ix: 0, u: edges[1] / det, v: edges[2] / det })
}

#[test]
fn t_of_needles_is_right() {
    for short_edge in SHORT_EDGES {
        let mut random = Random(short_edge.to_bits().into());
        let (mut n_hits, mut worst, mut worst_before) = (0, 0f64, 0f64);
        while n_hits < N_NEEDLES {
            let needle = needle(&mut random, short_edge);
            let ray = steep_ray_at(&mut random, &needle);
            let (hit, before) = (alone(&ray, &needle), by_rounded_edges(&ray, &needle));
            assert_eq!(hit.is_some(), before.is_some(), "{ray:?}, {needle:?}");
            let (Some(hit), Some(before)) = (hit, before) else { continue };
            assert_eq!(fault(&ray, &needle, &hit), None);
            let exact = Exact::of(&ray, &needle);
            let relative = |hit: &Hit| exact.error(hit) / exact.distance();
            (worst, worst_before) = (worst.max(relative(&hit)), worst_before.max(relative(&before)));
            n_hits += 1;
        }
        println!(
            "short edge {short_edge:e}: {worst:.1e} of the distance, {worst_before:.1e} by rounded edge functions"
        );
        // The check notices the errors that rounded edge functions make.
        assert!(worst_before > PLAIN_BOUND, "{worst_before:e}");
    }
}

/// Returns a triangle whose corners are almost on a line, in any order.
fn collinear(random: &mut Random) -> Triangle {
    let from = random.in_box(Vec3::NEG_ONE, Vec3::ONE);
    let along = random.direction();
    let aside = 10f32.powf(random.between(-7.5, -2.0)) * random.direction();
    let mut corners = [from, from + along, from + random.unit() * along + aside];
    corners.rotate_left(random.below(3));
    triangle(corners[0], corners[1], corners[2])
}

/// Returns a triangle of any shape.
fn any_triangle(random: &mut Random) -> Triangle {
    let [v0, v1, v2] = [0; 3].map(|_| random.in_box(Vec3::NEG_ONE, Vec3::ONE));
    triangle(v0, v1, v2)
}

/// Returns a direction that is almost in the triangle's plane.
fn flat_direction(random: &mut Random, triangle: &Triangle) -> Vec3 {
    let share = random.between(-1.0, 1.0);
    let along = (triangle.v1 - triangle.v0).lerp(triangle.v2 - triangle.v0, share).normalize();
    (along + 10f32.powf(random.between(-9.0, -2.0)) * random.direction()).normalize()
}

/// Where the plane does not determine the hit, the point is still on the triangle, and so between its corners.
#[test]
fn points_of_slivers_and_of_triangles_seen_edge_on_are_on_the_triangle() {
    let mut random = Random(5);
    let mut n_hits = [0; 3];
    for i in 0..300_000 {
        let kind = i % 3;
        let triangle = if kind == 0 { any_triangle(&mut random) } else { collinear(&mut random) };
        let direction = if kind == 1 { random.direction() } else { flat_direction(&mut random, &triangle) };
        let ray = ray_at(&mut random, &triangle, direction);
        let hit = alone(&ray, &triangle);
        assert_eq!(hit.is_some(), by_rounded_edges(&ray, &triangle).is_some(), "{ray:?}, {triangle:?}");
        let Some(hit) = hit else { continue };
        assert_eq!(fault(&ray, &triangle, &hit), None);
        let longest = ray.direction.abs().max_position();
        let depths = corners(&triangle)
            .map(|v| (v[longest] - f64::from(ray.origin[longest])) / f64::from(ray.direction[longest]));
        let Exact { reach, span, .. } = Exact::of(&ray, &triangle);
        let slack = 2.0 * U * (8.0 * reach + 11.0 * span);
        let (least, greatest) =
            depths.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), &t| (a.min(t), b.max(t)));
        let t = f64::from(hit.t);
        assert!(t >= least - slack && t <= greatest + slack, "{t}, not {least} to {greatest}: {ray:?}, {triangle:?}");
        n_hits[kind] += 1;
    }
    assert!(n_hits.iter().all(|&n| n > 10_000), "{n_hits:?}");
}

fn cast_ray(ray: &PathRay) -> Ray {
    Ray { origin: ray.origin, t_min: 0.0, direction: ray.direction, t_max: ray.t_max }
}

/// All traversals find the same hits, and these are right: on a device, on the CPU, alone and in packets.
#[test]
fn needles_in_a_tree_are_hit_where_they_are() {
    const N_RAYS_A_NEEDLE: usize = 25;
    let context = device();
    // This device runs kernels with branches, as GPUs do.
    let with_lanes = with_lanes(5000);
    let ways = [(&context, Traversal::Mask), (&context, Traversal::Stack), (&with_lanes, Traversal::Ropes)];
    for short_edge in SHORT_EDGES {
        let mut random = Random(short_edge.to_bits().into());
        let world =
            MeshWithTree::new((0..N_NEEDLES / N_RAYS_A_NEEDLE).map(|_| needle(&mut random, short_edge)).collect());
        let needles = world.triangles.iter().cycle().take(N_NEEDLES);
        let rays: Vec<PathRay> = needles.map(|needle| steep_ray_at(&mut random, needle)).collect();
        let casts: Vec<Ray> = rays.iter().map(cast_ray).collect();
        let expected = cast_on_cpu(world.geometry(), Traversal::Mask, &casts, Query::Closest);
        check(&world, &rays, &expected);
        for simd_level in simd_levels() {
            compare::exact(&expected, &traced::<false>(&world, simd_level, &rays)).unwrap();
        }
        for (context, traversal) in ways {
            let mut caster = GpuCaster::new(context, world.geometry(), traversal).expect("a caster");
            let found = caster.cast(&casts, Query::Closest, 1).expect("a cast").hits;
            check(&world, &rays, &found);
            // On other devices, divisions are 2.5 units in the last place off.
            if context.is_software() {
                compare::exact(&expected, &found).unwrap();
            }
        }
    }
    for context in [context, with_lanes] {
        assert_eq!(context.validation_messages(), Vec::<String>::new());
    }
}

fn check(world: &MeshWithTree, rays: &[PathRay], hits: &[Hit]) {
    let struck = || rays.iter().zip(hits).filter(|(_, hit)| hit.triangle_ix != NO_TRIANGLE);
    let fault = struck().find_map(|(ray, hit)| fault(ray, &world.triangles[hit.triangle_ix as usize], hit));
    assert_eq!(fault, None);
    assert!(struck().count() > rays.len() / 2, "{} hits", struck().count());
}
