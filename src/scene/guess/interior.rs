//! Interiors: scenes whose outer walls are made to be seen from inside. Seen from outside, they would show the backs of
//! their walls, or nothing but these. Rays from the middle tell them from bodies: a body's outermost surface turns its
//! front outwards, that of a room without thickness turns it inwards, and walls with thickness have a front on the
//! inside as well. A plain box whose sides face outwards has walls, too, if there are things in it, which nobody would
//! see from outside. What speaks for a room then tells rooms from hollow things ([`room`](super::room)).

use std::{f32::consts::PI, path::Path};

use glam::Vec3;

use super::{
    few_rays::{Hit, Hits, Ray, hits, view_rays},
    framing::{self, ViewSpec},
    room::{LEAST_HITS_OF_THINGS, Walls},
};
use crate::scene::model::{Camera, Projection, Scene};

/// Number of rays from the middle.
const N_RAYS: usize = 64;
/// Number of those rays that come first. A scene is no interior if fewer than half of them meet a wall.
const N_FIRST_RAYS: usize = 4;
/// A ray meets a wall if its last hit, or its first one, lies beyond this share of the way to the bounding box. Other
/// shapes than rooms, such as an inside-out sphere, are smaller in most directions.
const WALLS_BEGIN: f32 = 0.85;
/// Least share of the rays that meet a wall, in an interior. A missing side of a cube leaves 5 of 6.
const ENCLOSED: f32 = 0.7;

/// Places of the eye in an interior, in half extents from the middle: to the right and to the front. The front comes
/// first, so that it is taken where others are as good.
const EYES: [(f32, f32); 8] =
    [(0.0, 0.8), (0.7, 0.8), (-0.7, 0.8), (0.8, 0.0), (-0.8, 0.0), (0.0, -0.8), (0.7, -0.8), (-0.7, -0.8)];
/// Height of the eye and of its target above the middle, in half extents.
const EYE_HEIGHT: f32 = 0.0;
const TARGET_HEIGHT: f32 = -0.1;
/// Field of view in an interior, degrees: wider than outside, since walls limit the distance.
pub(crate) const VERTICAL_FOV_DEGREES: f32 = 60.0;
/// Numbers of rays of a view, across and down.
const VIEW_RAYS: (usize, usize) = (6, 4);
/// Least share of a view's rays that meet the fronts of surfaces. Where there are fewer, the eye is in a body.
const FREE: f32 = 0.5;

/// Places of a side of the box, in half extents from its middle, through which rays tell whether it is open.
const PLACES_OF_SIDE: [(f32, f32); 5] = [(0.0, 0.0), (0.5, 0.5), (0.5, -0.5), (-0.5, 0.5), (-0.5, -0.5)];

/// A hit is on the bounding box if it lies beyond this share of the ray's way to it.
const ON_BOX: f32 = 0.999;
/// Ratio of the distances of a wall's two sides, where they stand for one face. Those with a material for each side
/// have been moved apart.
const THICKEST_SHELL: f32 = 1.0001;
/// Returns the evidence for an interior, in words, if walls surround the middle of a scene and it is no hollow thing.
/// `path` is the scene's file, `up` a unit vector.
pub(crate) fn evidence(scene: &Scene, (path, up): (&Path, Vec3), bounds @ (min, max): (Vec3, Vec3)) -> Option<String> {
    let (centre, half) = ((min + max) / 2.0, (max - min) / 2.0);
    if half.min_element() <= 0.0 {
        return None;
    }
    let ray = |ix: usize| Ray { origin: centre, direction: on_sphere(ix) * half };
    // Few rays are enough to tell most bodies, of which some have millions of triangles.
    let few: Vec<Ray> = (0..N_RAYS).step_by(N_RAYS / N_FIRST_RAYS).map(ray).collect();
    let hits_of_few = hits(scene, &few);
    let may_be_closed = hides_things(half, &few, &hits_of_few, 0);
    if n_walls(half, &few, &hits_of_few) < N_FIRST_RAYS / 2 && !may_be_closed {
        return None;
    }
    let rays: Vec<Ray> = (0..N_RAYS).map(ray).collect();
    let to_top = PLACES_OF_SIDE.map(|place| ray_to_side(centre, half, up, up.any_orthonormal_vector(), place));
    let mut hits = hits(scene, &[&rays[..], &to_top].concat());
    let is_open_above = is_open(&hits.split_off(N_RAYS));
    let has_walls = n_walls(half, &rays, &hits) as f32 >= ENCLOSED * N_RAYS as f32 && !is_empty_shell(&hits)
        || may_be_closed && hides_things(half, &rays, &hits, LEAST_HITS_OF_THINGS);
    let is_thing = |(ray, hits): &(&Ray, &Hits)| hits.first.is_some_and(|hit| hit.t < WALLS_BEGIN * exit(ray, half));
    let n_things = rays.iter().zip(&hits).filter(is_thing).count();
    let walls = Walls { scene, path, bounds, up, hits: &hits, n_things, is_open_above };
    if has_walls { walls.room() } else { None }
}

/// Returns whether a side is open: rays to it meet things at most, and no wall.
fn is_open(hits: &[Hits]) -> bool {
    hits.iter().all(|hits| hits.last.is_none_or(|hit| hit.t < WALLS_BEGIN))
}

/// Returns a ray from the middle of a box to a place of one of its sides, where t is 1.
fn ray_to_side(centre: Vec3, half: Vec3, side: Vec3, up: Vec3, (x, y): (f32, f32)) -> Ray {
    Ray { origin: centre, direction: half * (side + x * side.cross(up) + y * up) }
}

/// Returns the number of rays from the middle of a box with half extents that meet a wall.
fn n_walls(half: Vec3, rays: &[Ray], hits: &[Hits]) -> usize {
    let is_wall = |(ray, hits): &(&Ray, &Hits)| {
        let exit = exit(ray, half);
        let is_wall = |hit: Option<Hit>| hit.is_some_and(|hit| hit.is_front && hit.t >= WALLS_BEGIN * exit);
        is_wall(hits.last) || is_wall(hits.first)
    };
    rays.iter().zip(hits).filter(is_wall).count()
}

/// Returns whether nearly all rays from the middle meet nothing but a wall whose faces are there once for each side.
/// Some programs write all bodies so, and nobody would look at an empty room.
fn is_empty_shell(hits: &[Hits]) -> bool {
    let is_shell = |hits: &&Hits| {
        let (Some(first), Some(last), Some(back)) = (hits.first, hits.last, hits.last_back) else { return false };
        first.is_front && last.t.max(back) <= first.t * THICKEST_SHELL && back >= first.t
    };
    hits.iter().filter(is_shell).count() + LEAST_HITS_OF_THINGS > hits.len()
}

/// Returns whether each ray from the middle at last meets the back of the bounding box with half extents, at most meets
/// fronts before, and whether at least `n_things` rays meet such a front.
fn hides_things(half: Vec3, rays: &[Ray], hits: &[Hits], n_things: usize) -> bool {
    let mut n_found = 0;
    for (ray, hits) in rays.iter().zip(hits) {
        let (Some(first), Some(last)) = (hits.first, hits.last) else { return false };
        let is_thing = first.t < WALLS_BEGIN * last.t;
        if last.is_front || last.t < ON_BOX * exit(ray, half) || is_thing && !first.is_front {
            return false;
        }
        n_found += usize::from(is_thing);
    }
    n_found >= n_things
}

/// Returns where a ray from the middle of a box with half extents leaves it.
fn exit(ray: &Ray, half: Vec3) -> f32 {
    // In half extents, its largest coordinate is 1 there.
    (ray.direction / half).abs().max_element().recip()
}

/// Returns a camera for an interior. If a side is open, the camera is outside and sees the whole interior through it.
/// If not, the camera is in one of a few places near the walls, the one that sees farthest. Returns `None` if all of
/// them are in bodies. `outside` and `inside`: the conditions for cameras outside and inside.
pub(crate) fn camera(scene: &Scene, bounds: (Vec3, Vec3), [outside, inside]: [&ViewSpec; 2]) -> Option<Camera> {
    match open_side(scene, bounds, outside) {
        Some(azimuth) => Some(framing::horizontal_camera(bounds, azimuth, outside)),
        None => camera_inside(scene, bounds, inside),
    }
}

/// Returns the azimuth of the first open side, from the front to the right, in degrees.
fn open_side(scene: &Scene, (min, max): (Vec3, Vec3), spec: &ViewSpec) -> Option<u32> {
    let (centre, half) = ((min + max) / 2.0, (max - min) / 2.0);
    let [right, front, up] = [spec.axes.right, spec.axes.front, spec.axes.up].map(|axis| axis.as_vec3());
    let sides = [front, right, -front, -right];
    let to_side = |side: &Vec3| PLACES_OF_SIDE.map(|place| ray_to_side(centre, half, *side, up, place));
    let rays: Vec<Ray> = sides.iter().flat_map(to_side).collect();
    let hits = hits(scene, &rays);
    let side_ix = hits.chunks(PLACES_OF_SIDE.len()).position(is_open)?;
    Some(90 * side_ix as u32)
}

/// Returns the camera that sees farthest of a few in an interior, or `None` if all of them are in bodies.
fn camera_inside(scene: &Scene, (min, max): (Vec3, Vec3), spec: &ViewSpec) -> Option<Camera> {
    let (centre, half) = ((min + max) / 2.0, (max - min) / 2.0);
    let [right, front, up] = [spec.axes.right, spec.axes.front, spec.axes.up].map(|axis| axis.as_vec3());
    let cameras = EYES.map(|(x, z)| Camera {
        eye: centre + half * (x * right + z * front + EYE_HEIGHT * up),
        target: centre + half * TARGET_HEIGHT * up,
        up,
        projection: Projection::Perspective { vertical_fov_degrees: spec.vertical_fov_degrees },
    });
    let rays: Vec<Ray> = cameras.iter().flat_map(|camera| view_rays(camera, spec.aspect as f32, VIEW_RAYS)).collect();
    let hits = hits(scene, &rays);
    let diagonal = 2.0 * half.length();
    let mut best: Option<(f32, Camera)> = None;
    const N: usize = VIEW_RAYS.0 * VIEW_RAYS.1;
    for (camera, (rays, hits)) in cameras.into_iter().zip(rays.chunks(N).zip(hits.chunks(N))) {
        let is_on_box = |p: Vec3| ((p - centre) / half).abs().max_element() >= ON_BOX;
        let is_seen = |ray: &Ray, hit: &Hit| hit.is_front || is_on_box(ray.origin + hit.t * ray.direction);
        let seen = |(ray, hits): (&Ray, &Hits)| hits.first.filter(|hit| is_seen(ray, hit));
        let distances = rays.iter().zip(hits).filter_map(seen).map(|hit| hit.t / diagonal);
        let (n, sum) = distances.fold((0, 0.0), |(n, sum): (usize, f32), distance| (n + 1, sum + distance.min(1.0)));
        if n as f32 >= FREE * hits.len() as f32 && best.is_none_or(|(most, _)| sum > most * 1.01) {
            best = Some((sum, camera));
        }
    }
    best.map(|(_, camera)| camera)
}

/// Returns one of [`N_RAYS`] unit vectors, which are evenly distributed along a spiral.
fn on_sphere(ix: usize) -> Vec3 {
    let y = 1.0 - (2 * ix + 1) as f32 / N_RAYS as f32;
    let angle = ix as f32 * PI * (3.0 - 5.0_f32.sqrt());
    let radius = (1.0 - y * y).sqrt();
    Vec3::new(radius * angle.cos(), y, radius * angle.sin())
}
