//! A camera for scenes without one: its picture is filled by the scene.

use glam::{DVec2, DVec3, Vec3};
use rayon::prelude::*;

use super::near::NearPart;
use crate::scene::model::{Camera, Instance, Projection, Scene, mesh::corners_of};

/// Vertical field of view unless the user states one, degrees.
pub(crate) const VERTICAL_FOV_DEGREES: f32 = 40.0;
/// Factor on the half width and half height of the picture that the scene may fill.
pub(super) const FILLED: f64 = 0.95;

/// Least half diagonal of a box, in steps of single precision at its coordinates. The eye's coordinates are rounded to
/// such steps, so from nearer a small scene far from the origin could be out of the picture.
const LEAST_STEPS: f64 = 16.0;

/// The direction from which a scene is usually seen, degrees: from the front, the right and above.
const USUAL: Direction = Direction { azimuth: 24, elevation: 18 };
/// The direction in place of the usual one for boxes about as high as wide, whose top would not be seen.
const HIGHER: Direction = Direction { azimuth: 30, elevation: 28 };
/// The top is seen if the eye is above the middle by this many half heights. From its own height, it is a line.
const SEES_TOP: f64 = 1.25;
/// Boxes whose height exceeds this many widths are seen from the usual direction, as a standing person is.
const AS_HIGH_AS_WIDE: f64 = 1.25;
/// Elevations of the other directions, degrees.
const ELEVATIONS: [u32; 5] = [18, 26, 34, 42, 50];
/// The usual direction is taken if it shows this share of what the best direction shows.
const USUAL_IS_ENOUGH: f64 = 0.7;
/// Of the other directions, those that show this share of what the best one shows count as equal.
const EQUALS_BEST: f64 = 0.95;

/// The directions of a world: unit vectors to its right, to its front and up.
#[derive(Clone, Copy, Debug)]
pub(crate) struct WorldAxes {
    pub right: DVec3,
    pub front: DVec3,
    pub up: DVec3,
}

impl WorldAxes {
    /// Returns the axes of a world whose +x is to the right. `up` is +y or +z.
    pub fn with_up(up: Vec3) -> Self {
        let (right, up) = (DVec3::X, up.as_dvec3());
        Self { right, front: right.cross(up), up }
    }
}

/// Direction from a scene towards its viewer, whole degrees: `azimuth` is from the front to the right, `elevation` is
/// upwards.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Direction {
    azimuth: u32,
    elevation: u32,
}

impl Direction {
    /// Returns the unit vector.
    fn vector(self, axes: &WorldAxes) -> DVec3 {
        let (azimuth, elevation) = (f64::from(self.azimuth).to_radians(), f64::from(self.elevation).to_radians());
        let horizontal = axes.front * azimuth.cos() + axes.right * azimuth.sin();
        horizontal * elevation.cos() + axes.up * elevation.sin()
    }

    /// Returns all directions but the usual one. Those beyond the right would show mirror images of the same boxes.
    fn others() -> impl Iterator<Item = Self> {
        let row = |elevation| (0..=90).step_by(2).map(move |azimuth| Self { azimuth, elevation });
        ELEVATIONS.into_iter().flat_map(row)
    }

    /// Returns how far the direction is from the usual one, in degrees of azimuth. A degree of elevation counts as two.
    fn strangeness(self) -> u32 {
        self.azimuth.abs_diff(USUAL.azimuth) + 2 * self.elevation.abs_diff(USUAL.elevation)
    }
}

/// The conditions for a new camera: the axes of the world, the shape of the picture and the field of view.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ViewSpec {
    pub axes: WorldAxes,
    /// Width of the picture divided by its height.
    pub aspect: f64,
    pub vertical_fov_degrees: f32,
}

/// Returns a camera that sees the near part of a scene, which mostly is the whole scene, from outside, and that is as
/// close as it can be. If the bounding box is long or flat, it is seen from a direction that shows much of its sides.
pub(crate) fn camera(scene: &Scene, near: &NearPart, spec: &ViewSpec) -> Camera {
    let bounds = BoundingBox::new(near.bounds);
    let (usual_direction, usual) = usual(&bounds, spec);
    let others: Vec<_> =
        Direction::others().map(|direction| (direction, View::new(&bounds, direction, spec))).collect();
    let best = others.iter().map(|(_, view)| view.shown).fold(usual.shown, f64::max);
    let is_equal = |(_, view): &&(Direction, View)| view.shown >= EQUALS_BEST * best;
    let nearest = others.iter().filter(is_equal).min_by_key(|(direction, _)| direction.strangeness());
    let (direction, view) = match nearest {
        Some((direction, view)) if usual.shown < USUAL_IS_ENOUGH * best => (*direction, view),
        _ => (usual_direction, &usual),
    };
    // The box's own corners are mostly empty.
    let of_scene = |directions| support(scene, near, bounds.centre, directions);
    if bounds.is_enlarged { view.camera(spec) } else { View::around(&bounds, direction, spec, of_scene).camera(spec) }
}

/// Returns the view of a box from the usual direction, or from a higher one if that shows its top.
fn usual(bounds: &BoundingBox, spec: &ViewSpec) -> (Direction, View) {
    let WorldAxes { right, front, up } = spec.axes;
    let half = |axis: DVec3| bounds.half.dot(axis.abs());
    let is_high = half(up) > AS_HIGH_AS_WIDE * half(right).max(half(front));
    let view = View::new(bounds, USUAL, spec);
    let sees_top = (view.eye - bounds.centre).dot(up) >= SEES_TOP * half(up);
    if is_high || sees_top { (USUAL, view) } else { (HIGHER, View::new(bounds, HIGHER, spec)) }
}

/// Returns how far the triangles of a scene's near part reach from a point in some directions, in lengths of each.
pub(super) fn support(scene: &Scene, near: &NearPart, from: DVec3, directions: [DVec3; 4]) -> [f64; 4] {
    const NOTHING: [f64; 4] = [f64::NEG_INFINITY; 4];
    let most = |a: [f64; 4], b: [f64; 4]| std::array::from_fn(|ix| a[ix].max(b[ix]));
    let corners: Vec<Vec<Vec3>> =
        scene.meshes.par_iter().map(|mesh| corners_of(&mesh.faces, &mesh.positions)).collect();
    let of_instance = |Instance { mesh_ix, transform, .. }: &Instance| {
        let object = directions.map(|direction| transform.height_in_object_space(direction, from));
        let of_corner = |p: &Vec3| object.map(|(direction, constant)| direction.dot(p.as_dvec3()) + constant);
        let is_near = |p: &&Vec3| near.is_whole() || near.contains(transform.point(**p));
        corners[*mesh_ix].par_iter().filter(is_near).map(of_corner).reduce(|| NOTHING, most)
    };
    scene.instances.par_iter().map(of_instance).reduce(|| NOTHING, most)
}

/// Returns a camera that sees a whole bounding box horizontally from outside: from the front, or from an `azimuth` to
/// the right of it, in degrees.
pub(crate) fn horizontal_camera(bounds: (Vec3, Vec3), azimuth: u32, spec: &ViewSpec) -> Camera {
    View::new(&BoundingBox::new(bounds), Direction { azimuth, elevation: 0 }, spec).camera(spec)
}

/// A bounding box.
struct BoundingBox {
    centre: DVec3,
    /// Half of its extents.
    half: DVec3,
    /// Whether it is larger than the box of the scene.
    is_enlarged: bool,
}

impl BoundingBox {
    fn new((min, max): (Vec3, Vec3)) -> Self {
        let (min, max) = (min.as_dvec3(), max.as_dvec3());
        let (centre, mut half) = ((min + max) / 2.0, (max - min) / 2.0);
        let least = LEAST_STEPS * f64::from(f32::EPSILON) * centre.abs().max_element();
        let is_enlarged = half.length() < least;
        if is_enlarged {
            half *= least / half.length();
        }
        Self { centre, half, is_enlarged }
    }

    /// Returns the corner whose coordinates have the given signs.
    fn corner(&self, signs: DVec3) -> DVec3 {
        self.centre + self.half * signs
    }

    fn corners(&self) -> [DVec3; 8] {
        let sign = |ix: usize, axis: usize| if ix >> axis & 1 == 0 { -1.0 } else { 1.0 };
        std::array::from_fn(|ix| self.corner(DVec3::new(sign(ix, 0), sign(ix, 1), sign(ix, 2))))
    }
}

/// A camera's place.
struct View {
    eye: DVec3,
    target: DVec3,
    /// How much the view shows of the bounding box. Each visible face adds the square root of the share of the picture
    /// that it covers. So of two views that cover as much, the one that shows several faces has the larger sum.
    shown: f64,
}

impl View {
    /// Returns the view of a box whose eye is as near as the box's corners allow.
    fn new(bounds: &BoundingBox, direction: Direction, spec: &ViewSpec) -> Self {
        let corners = bounds.corners().map(|corner| corner - bounds.centre);
        let most = |direction: DVec3| corners.iter().map(|p| p.dot(direction)).fold(f64::NEG_INFINITY, f64::max);
        Self::around(bounds, direction, spec, |directions| directions.map(most))
    }

    /// Returns the view of points whose eye is as near as they allow. `support` returns how far the points reach from
    /// the centre of their bounding box in some directions, in lengths of each.
    ///
    /// Let x, y and z be the coordinates of a corner to the right, up and forward, and a and b those of the eye to the
    /// right and forward. The corner is in the picture if |x - a| <= t (z - b), where t is the tangent of half the
    /// field of view. So b is at most -(R + L) / 2t, where R is the largest x - t z and L the largest -x - t z. The
    /// middle of the range of a is (R - L) / 2. The vertical works alike, and the smaller of both b counts.
    fn around(
        bounds: &BoundingBox,
        direction: Direction,
        spec: &ViewSpec,
        support: impl Fn([DVec3; 4]) -> [f64; 4],
    ) -> Self {
        let forward = -direction.vector(&spec.axes);
        let right = forward.cross(spec.axes.up).normalize();
        let up = right.cross(forward);
        let tangent = (f64::from(spec.vertical_fov_degrees) / 2.0).to_radians().tan() * FILLED;
        let tangents = DVec2::new(tangent * spec.aspect, tangent);
        let (across, along) = (tangents.x * forward, tangents.y * forward);
        let [to_right, to_left, to_top, to_bottom] =
            support([right - across, -right - across, up - along, -up - along]);
        let fit = |above: f64, below: f64, tangent: f64| ((above - below) / 2.0, -(above + below) / (2.0 * tangent));
        let (x, z_of_width) = fit(to_right, to_left, tangents.x);
        let (y, z_of_height) = fit(to_top, to_bottom, tangents.y);
        let z = z_of_width.min(z_of_height);
        let eye = bounds.centre + x * right + y * up + z * forward;
        let to_picture = |point: DVec3| {
            let from_eye = point - eye;
            DVec2::new(from_eye.dot(right), from_eye.dot(up)) / (tangents * from_eye.dot(forward))
        };
        // The target is as deep as the middle of the box.
        Self { eye, target: eye - z * forward, shown: shown(bounds, eye, to_picture) }
    }

    fn camera(&self, spec: &ViewSpec) -> Camera {
        Camera {
            eye: self.eye.as_vec3(),
            target: self.target.as_vec3(),
            up: spec.axes.up.as_vec3(),
            projection: Projection::Perspective { vertical_fov_degrees: spec.vertical_fov_degrees },
        }
    }
}

/// Returns [`View::shown`]. `to_picture` maps a point to coordinates from -1 to 1.
fn shown(bounds: &BoundingBox, eye: DVec3, to_picture: impl Fn(DVec3) -> DVec2) -> f64 {
    let mut shown = 0.0;
    for (normal, a, b) in
        [(DVec3::X, DVec3::Y, DVec3::Z), (DVec3::Y, DVec3::Z, DVec3::X), (DVec3::Z, DVec3::X, DVec3::Y)]
    {
        let away = (eye - bounds.centre).dot(normal);
        if away.abs() <= bounds.half.dot(normal) {
            continue;
        }
        let normal = normal * away.signum();
        let corners = [-a - b, a - b, a + b, b - a].map(|side| to_picture(bounds.corner(normal + side)));
        let doubled: f64 = (0..4).map(|ix| corners[ix].perp_dot(corners[(ix + 1) % 4])).sum();
        shown += (doubled.abs() / 8.0).sqrt();
    }
    shown
}
