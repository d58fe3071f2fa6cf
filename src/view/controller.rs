//! Moves the camera by keys and the mouse, independently of the frame rate.

use std::{
    f32::consts::{FRAC_PI_2, PI},
    ops::RangeInclusive,
};

use glam::{Quat, Vec3};

use super::flight::{Axes, Flight};
use crate::scene::{Camera, Projection};

/// Angle in radians by which a drag over the window's height turns the camera.
const TURN_PER_HEIGHT: f32 = PI;
/// Least angle in radians between the view and straight up or down.
const POLE_MARGIN: f32 = 0.02;
/// Factor on the distance to the target, or on the height of an orthographic picture, for one step of the wheel.
const ZOOM_PER_STEP: f32 = 0.85;
/// Factor on the height of the picture, at any distance, for one step of the keys that widen the view.
const WIDER_PER_STEP: f32 = 1.1;
/// Vertical fields of view that the user can set, degrees.
pub const FOV_DEGREES: RangeInclusive<f32> = 2.0..=150.0;
/// Directions that can point up in the picture, in the order in which a key selects them.
const UP_AXES: [(&str, Vec3); 6] =
    [("+y", Vec3::Y), ("+z", Vec3::Z), ("+x", Vec3::X), ("-y", Vec3::NEG_Y), ("-z", Vec3::NEG_Z), ("-x", Vec3::NEG_X)];
/// Factor on the radius of the scene's bounding sphere when the scene is framed, which leaves a margin around it.
const FRAME_MARGIN: f32 = 1.05;

/// Moves a camera by keys and the mouse.
#[derive(Clone, Debug)]
pub struct Controller {
    camera: Camera,
    start: Camera,
    /// The flight keys and the speed.
    pub flight: Flight,
    /// Centre of the scene's bounds, world space.
    centre: Vec3,
    /// Radius of a sphere around the scene, world units, more than 0.
    radius: f32,
}

impl Controller {
    /// Creates a controller that starts at `camera`. `bounds` are the scene's minimum and maximum corner, world
    /// space.
    pub fn new(camera: Camera, bounds: (Vec3, Vec3)) -> Self {
        let (min, max) = bounds;
        let radius = ((max - min).length() / 2.0).max(1e-6);
        Self { camera, start: camera, flight: Flight::new(radius), centre: (min + max) / 2.0, radius }
    }

    /// Returns the camera.
    pub fn camera(&self) -> &Camera {
        &self.camera
    }

    /// Returns the radius of a sphere around the scene, world units.
    pub fn radius(&self) -> f32 {
        self.radius
    }

    /// Moves the camera for `seconds` by the flight keys that are held.
    pub fn advance(&mut self, seconds: f32) {
        let step = self.flight.velocity(&self.axes()) * seconds;
        self.camera.eye += step;
        self.camera.target += step;
    }

    fn axes(&self) -> Axes {
        let forward = (self.camera.target - self.camera.eye).normalize();
        Axes { forward, right: forward.cross(self.camera.up).normalize(), up: self.camera.up }
    }

    /// Turns the camera about its eye by a drag of `x` to the right and `y` down, in heights of the window.
    pub fn look(&mut self, x: f32, y: f32) {
        let view = self.turned(self.camera.target - self.camera.eye, x, y);
        self.camera.target = self.camera.eye + view;
    }

    /// Moves the camera around its target by a drag of `x` to the right and `y` down, in heights of the window. The
    /// scene follows the drag.
    pub fn orbit(&mut self, x: f32, y: f32) {
        let view = self.turned(self.camera.target - self.camera.eye, x, y);
        self.camera.eye = self.camera.target - view;
    }

    /// Moves the camera sideways, up and down by a drag of `x` to the right and `y` down, in heights of the window.
    /// Points at the target's distance follow the drag.
    pub fn pan(&mut self, x: f32, y: f32) {
        let step = self.across(-x, -y);
        self.camera.eye += step;
        self.camera.target += step;
    }

    /// Magnifies the picture by steps of the wheel; negative steps reduce it. A perspective camera moves nearer to the
    /// target or away from it, an orthographic one shows less or more height. The point at the target's distance that
    /// is `x` to the right of the window's middle and `y` below it, in heights of the window, stays in place.
    pub fn zoom(&mut self, steps: f32, x: f32, y: f32) {
        let Camera { eye, target, .. } = self.camera;
        let point = target + self.across(x, y);
        match &mut self.camera.projection {
            Projection::Perspective { .. } => {
                let share = zoom_share((target - eye).length(), steps, self.radius);
                self.camera.eye = point + (eye - point) * share;
                self.camera.target = point + (target - point) * share;
            }
            Projection::Orthographic { height } => {
                let share = zoom_share(*height, steps, self.radius);
                *height *= share;
                let step = (point - target) * (1.0 - share);
                self.camera.eye += step;
                self.camera.target += step;
            }
        }
    }

    /// Widens the view by steps without moving the camera; negative steps narrow it. A perspective camera's field of
    /// view grows, or the height that an orthographic one shows.
    pub fn widen(&mut self, steps: f32) {
        let projection = match self.camera.projection {
            Projection::Perspective { vertical_fov_degrees: degrees } => {
                let half_height = (degrees.to_radians() / 2.0).tan() * WIDER_PER_STEP.powf(steps);
                // A scene's own camera may be beyond the limits. From there steps only lead back.
                let (least, most) = (degrees.min(*FOV_DEGREES.start()), degrees.max(*FOV_DEGREES.end()));
                let degrees = (2.0 * half_height.atan().to_degrees()).clamp(least, most);
                Projection::Perspective { vertical_fov_degrees: degrees }
            }
            Projection::Orthographic { height } => {
                let steps_of_zoom = steps * WIDER_PER_STEP.ln() / ZOOM_PER_STEP.ln();
                Projection::Orthographic { height: height * zoom_share(height, steps_of_zoom, self.radius) }
            }
        };
        self.camera.projection = projection;
    }

    /// Replaces the camera's projection.
    pub fn set_projection(&mut self, projection: Projection) {
        self.camera.projection = projection;
    }

    /// Makes the next of +y, +z, +x, -y, -z and -x point up in the picture, or +y if none of them does. The camera is
    /// turned about its target together with that axis. Returns the axis's name.
    pub fn change_up(&mut self) -> &'static str {
        let Camera { eye, target, up, .. } = self.camera;
        let now = UP_AXES.iter().position(|(_, axis)| axis.dot(up) > 0.999);
        let (name, axis) = UP_AXES[now.map_or(0, |ix| (ix + 1) % UP_AXES.len())];
        self.camera.eye = target + Quat::from_rotation_arc(up, axis) * (eye - target);
        self.camera.up = axis;
        name
    }

    /// Returns the world-space vector at the target's distance that spans `x` to the right and `y` down, in heights
    /// of the window.
    fn across(&self, x: f32, y: f32) -> Vec3 {
        let Axes { forward, right, .. } = self.axes();
        let distance = (self.camera.target - self.camera.eye).length();
        (right * x - right.cross(forward) * y) * self.camera.height_at(distance)
    }

    /// Returns the vector from eye to target, turned by a drag of `x` to the right and `y` down, in heights of the
    /// window. The result is at least [`POLE_MARGIN`] away from straight up and down, unless `view` is closer
    /// already.
    fn turned(&self, view: Vec3, x: f32, y: f32) -> Vec3 {
        let up = self.camera.up;
        let yawed = Quat::from_axis_angle(up, -x * TURN_PER_HEIGHT) * view;
        let right = yawed.cross(up).normalize();
        let elevation = FRAC_PI_2 - yawed.angle_between(up);
        let most = FRAC_PI_2 - POLE_MARGIN;
        // A scene's own camera may look closer to a pole than drags can go. From there drags only lead away.
        let (least, most) = (elevation.min(-most), elevation.max(most));
        let pitch = (elevation - y * TURN_PER_HEIGHT).clamp(least, most) - elevation;
        Quat::from_axis_angle(right, pitch) * yawed
    }

    /// Moves the camera, without turning it, so that the scene is in the middle and fills the picture. `aspect` is
    /// the picture's width divided by its height.
    pub fn frame_scene(&mut self, aspect: f32) {
        let Axes { forward, .. } = self.axes();
        let radius = FRAME_MARGIN * self.radius;
        let distance = match &mut self.camera.projection {
            Projection::Perspective { .. } => {
                let narrower = (self.camera.height_at(1.0) / 2.0 * aspect.min(1.0)).atan();
                radius / narrower.sin()
            }
            Projection::Orthographic { height } => {
                *height = 2.0 * radius / aspect.min(1.0);
                // Any distance shows the same, as long as the scene is in front of the eye.
                2.0 * radius
            }
        };
        self.camera.target = self.centre;
        self.camera.eye = self.centre - forward * distance;
    }

    /// Moves the camera back to where it started.
    pub fn go_home(&mut self) {
        self.camera = self.start;
    }

    /// Replaces the camera.
    pub fn place(&mut self, camera: Camera) {
        self.camera = camera;
    }

    /// Moves the start. A camera that is there, since the user has not moved it, moves with it.
    pub fn move_start(&mut self, start: Camera) {
        if self.camera == self.start {
            self.camera = start;
        }
        self.start = start;
    }

    /// Takes over another scene's start and bounds. The camera and the flight stay; `moved` is the way by which a point
    /// of the file has moved in world space.
    pub fn set_scene(&mut self, start: Camera, bounds: (Vec3, Vec3), moved: Vec3) {
        let Self { camera: Camera { eye, target, .. }, flight, .. } = *self;
        let camera = Camera { eye: eye + moved, target: target + moved, ..self.camera };
        *self = Self { camera, ..Self::new(start, bounds) };
        self.flight = flight.around(self.radius);
    }
}

/// Returns the factor on a distance or a height for steps of the wheel. The wheel ends at 1e-4 and 1e3 times the
/// scene's radius. A scene's own camera may be beyond these limits. From there the wheel only leads back.
fn zoom_share(from: f32, steps: f32, radius: f32) -> f32 {
    let (least, most) = (from.min(1e-4 * radius), from.max(1e3 * radius));
    (from * ZOOM_PER_STEP.powf(steps)).clamp(least, most) / from
}

#[cfg(test)]
mod tests {
    use glam::vec3;

    use super::*;
    use crate::view::flight::Fly;

    fn controller() -> Controller {
        let camera = Camera {
            eye: vec3(1.0, 2.0, 8.0),
            target: vec3(0.0, 1.0, 0.0),
            up: Vec3::Y,
            projection: Projection::Perspective { vertical_fov_degrees: 40.0 },
        };
        Controller::new(camera, (Vec3::splat(-2.0), Vec3::splat(2.0)))
    }

    fn orthographic() -> Controller {
        let camera = Camera { projection: Projection::Orthographic { height: 3.0 }, ..controller().camera };
        Controller::new(camera, (Vec3::splat(-2.0), Vec3::splat(2.0)))
    }

    /// Returns the larger of the distances between two cameras' eyes and between their targets.
    fn apart(a: &Camera, b: &Camera) -> f32 {
        (a.eye - b.eye).length().max((a.target - b.target).length())
    }

    /// Returns the camera after two seconds of flight with a turn in between, each second in `n_steps` equal steps.
    fn flown(n_steps: u32) -> Camera {
        let mut controller = controller();
        controller.flight.hold(Fly::Forward, true);
        controller.flight.hold(Fly::Up, true);
        controller.flight.hurry(true, false);
        (0..n_steps).for_each(|_| controller.advance(1.0 / n_steps as f32));
        controller.look(0.3, -0.2);
        controller.flight.hold(Fly::Up, false);
        (0..n_steps).for_each(|_| controller.advance(1.0 / n_steps as f32));
        *controller.camera()
    }

    #[test]
    fn the_way_flown_is_the_same_at_every_frame_rate() {
        let once = flown(1);
        for n_steps in [2, 7, 60, 1000] {
            assert!(apart(&once, &flown(n_steps)) < 1e-3, "{n_steps} steps");
        }
        assert!(apart(&once, controller().camera()) > 1.0);
    }

    #[test]
    fn a_drag_is_the_same_in_parts() {
        for turn in [Controller::look, Controller::orbit] {
            let (mut whole, mut parts) = (controller(), controller());
            turn(&mut whole, 0.0, 0.25);
            turn(&mut whole, 0.4, 0.0);
            (0..10).for_each(|_| turn(&mut parts, 0.0, 0.025));
            (0..10).for_each(|_| turn(&mut parts, 0.04, 0.0));
            assert!(apart(whole.camera(), parts.camera()) < 1e-4);
            assert!(apart(whole.camera(), controller().camera()) > 0.5);
        }
    }

    #[test]
    fn keys_take_eye_and_target_along_the_cameras_axes() {
        let mut controller = controller();
        let start = *controller.camera();
        controller.flight.hold(Fly::Right, true);
        controller.advance(0.5);
        let right = (start.target - start.eye).cross(start.up).normalize();
        let step = right * (0.5 * controller.flight.speed());
        assert!((controller.camera().eye - start.eye - step).length() < 1e-5);
        assert!((controller.camera().target - start.target - step).length() < 1e-5);
    }

    #[test]
    fn drags_turn_to_where_the_mouse_goes() {
        let mut looking = controller();
        looking.look(0.1, 0.0);
        let right = controller().axes().right;
        assert!((looking.camera().target - looking.start.target).dot(right) > 0.1);
        assert_eq!(looking.camera().eye, looking.start.eye);
        looking.look(0.0, 0.1);
        assert!(looking.camera().target.y < looking.start.target.y);
        let mut orbiting = controller();
        orbiting.orbit(0.0, 0.1);
        assert!(orbiting.camera().eye.y > orbiting.start.eye.y, "the scene is pulled down");
        assert_eq!(orbiting.camera().target, orbiting.start.target);
        let distance = |camera: &Camera| (camera.eye - camera.target).length();
        assert!((distance(orbiting.camera()) - distance(&orbiting.start)).abs() < 1e-5);
    }

    #[test]
    fn no_drag_turns_over_a_pole() {
        for turn in [Controller::look, Controller::orbit] {
            for y in [1.0, -1.0] {
                let mut controller = controller();
                (0..100).for_each(|_| turn(&mut controller, 0.01, y));
                let Axes { forward, right, .. } = controller.axes();
                let off_pole = forward.cross(Vec3::Y).length();
                assert!((off_pole - POLE_MARGIN.sin()).abs() < 1e-3, "{off_pole}");
                assert!(right.is_finite() && controller.camera().eye.is_finite());
            }
        }
    }

    /// Returns where a point is seen: to the right of the window's middle and below it, in heights of the window.
    fn seen_at(controller: &Controller, point: Vec3) -> (f32, f32) {
        let Axes { forward, right, .. } = controller.axes();
        let view = point - controller.camera.eye;
        let height = controller.camera.height_at(view.dot(forward));
        (view.dot(right) / height, -view.dot(right.cross(forward)) / height)
    }

    fn is_near(a: (f32, f32), b: (f32, f32)) -> bool {
        (a.0 - b.0).hypot(a.1 - b.1) < 1e-4
    }

    #[test]
    fn the_wheel_goes_to_what_the_mouse_points_at() {
        for (steps, x, y) in [(1.0, 0.0, 0.0), (3.0, 0.3, -0.2), (-2.5, -0.6, 0.4)] {
            let mut controller = controller();
            let before = *controller.camera();
            let point = before.target + controller.across(x, y);
            assert!(is_near(seen_at(&controller, point), (x, y)));
            controller.zoom(steps, x, y);
            assert!(is_near(seen_at(&controller, point), (x, y)), "{steps} steps");
            let Camera { eye, target, .. } = *controller.camera();
            let share = (target - eye).length() / (before.target - before.eye).length();
            assert!((share - ZOOM_PER_STEP.powf(steps)).abs() < 1e-4);
            assert!((target - eye).angle_between(before.target - before.eye) < 1e-3, "it looks where it looked");
            assert!((target == before.target) == (x == 0.0));
            controller.zoom(-steps, x, y);
            assert!(apart(controller.camera(), &before) < 1e-3, "and back");
        }
    }

    #[test]
    fn the_wheel_magnifies_an_orthographic_picture() {
        for (steps, x, y) in [(1.0, 0.0, 0.0), (3.0, 0.3, -0.2), (-2.5, -0.6, 0.4)] {
            let mut controller = orthographic();
            let before = *controller.camera();
            let point = before.target + controller.across(x, y);
            let elsewhere = before.target + controller.across(0.2, 0.1);
            controller.zoom(steps, x, y);
            assert!(is_near(seen_at(&controller, point), (x, y)), "{steps} steps");
            let moved = seen_at(&controller, elsewhere);
            let factor = ZOOM_PER_STEP.powf(-steps);
            assert!(is_near(moved, (x + (0.2 - x) * factor, y + (0.1 - y) * factor)), "{moved:?}");
            let Camera { eye, target, .. } = *controller.camera();
            assert!(((target - eye) - (before.target - before.eye)).length() < 1e-5, "the distance stays");
            controller.zoom(-steps, x, y);
            assert!(apart(controller.camera(), &before) < 1e-3, "and back");
            assert!((controller.camera().height_at(1.0) - before.height_at(1.0)).abs() < 1e-4);
        }
    }

    #[test]
    fn the_view_widens_and_narrows_and_the_camera_stays() {
        for mut controller in [controller(), orthographic()] {
            let before = *controller.camera();
            controller.widen(3.0);
            let share = controller.camera().height_at(2.0) / before.height_at(2.0);
            assert!((share - WIDER_PER_STEP.powi(3)).abs() < 1e-4, "{share}");
            assert_eq!(apart(controller.camera(), &before), 0.0);
            controller.widen(-3.0);
            assert!((controller.camera().height_at(2.0) / before.height_at(2.0) - 1.0).abs() < 1e-4);
            for steps in [1e3, -1e3] {
                controller.widen(steps);
                let height = controller.camera().height_at(1.0);
                assert!(height.is_finite() && height > 0.0, "{height}");
            }
        }
    }

    #[test]
    fn each_axis_can_point_up() {
        let mut controller = controller();
        let start = *controller.camera();
        let offset = |camera: &Camera| camera.eye - camera.target;
        let names: Vec<_> = (0..6)
            .map(|_| {
                let name = controller.change_up();
                let camera = controller.camera();
                let height = offset(camera).dot(camera.up);
                assert!((height - offset(&start).dot(start.up)).abs() < 1e-4, "as far above the target as before");
                assert!((offset(camera).length() - offset(&start).length()).abs() < 1e-4);
                assert_eq!(camera.target, start.target);
                name
            })
            .collect();
        assert_eq!(names, ["+z", "+x", "-y", "-z", "-x", "+y"]);
        controller.camera.up = vec3(0.6, 0.8, 0.0);
        assert_eq!(controller.change_up(), "+y", "first the axis that most scenes have");
    }

    #[test]
    fn the_wheel_ends_somewhere() {
        for mut controller in [controller(), orthographic()] {
            for steps in [1e9, -1e9] {
                controller.zoom(steps, 0.1, 0.1);
                let camera = *controller.camera();
                let distance = (camera.target - camera.eye).length();
                assert!(distance > 0.0 && distance.is_finite() && controller.axes().right.is_finite());
                assert!(camera.height_at(distance) > 0.0 && camera.height_at(distance).is_finite());
                controller.go_home();
            }
        }
    }

    #[test]
    fn a_pan_takes_the_target_along_with_the_mouse() {
        for mut controller in [controller(), orthographic()] {
            let before = *controller.camera();
            controller.pan(0.25, -0.1);
            let after = *controller.camera();
            assert!(is_near(seen_at(&controller, before.target), (0.25, -0.1)));
            assert!(((after.target - after.eye) - (before.target - before.eye)).length() < 1e-5);
        }
    }

    #[test]
    fn the_framed_scene_fills_an_orthographic_picture() {
        for aspect in [2.0, 1.0, 0.5] {
            let mut controller = orthographic();
            controller.look(1.0, 0.3);
            controller.frame_scene(aspect);
            let camera = *controller.camera();
            assert_eq!(camera.target, Vec3::ZERO);
            assert!((camera.target - camera.eye).length() > controller.radius, "all of the scene is in front");
            let narrower = camera.height_at(1.0) * aspect.min(1.0) / 2.0;
            assert!((0.9..1.0).contains(&(controller.radius / narrower)), "{aspect}: {narrower}");
        }
    }

    #[test]
    fn the_framed_scene_fills_the_picture() {
        for aspect in [2.0, 1.0, 0.5] {
            let mut controller = controller();
            controller.look(1.0, 0.3);
            controller.frame_scene(aspect);
            let Camera { eye, target, .. } = *controller.camera();
            assert_eq!(target, Vec3::ZERO);
            let half_angle = (controller.radius / (eye - target).length()).asin();
            let narrower = (20f32.to_radians().tan() * aspect.min(1.0)).atan();
            assert!(half_angle < narrower && half_angle > 0.9 * narrower, "{half_angle} {narrower}");
            controller.go_home();
            assert_eq!(controller.camera(), &controller.start);
        }
    }
}
