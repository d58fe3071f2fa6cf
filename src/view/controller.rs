//! The camera in the user's hands: keys and the mouse to places, whatever the frame rate.

use std::f32::consts::{FRAC_PI_2, PI};

use glam::{Quat, Vec3};

use crate::scene::Camera;

/// Radians that the camera turns for a drag over the window's height.
const TURN_A_HEIGHT: f32 = PI;
/// Factor on the speed for one step of the wheel.
const SPEED_A_STEP: f32 = 1.25;
/// Factor on the speed while a key for it is held.
const HASTE: f32 = 4.0;
/// The view keeps this far, radians, from looking straight up or down.
const POLE_MARGIN: f32 = 0.02;
/// Room around the scene's bounding sphere when it is framed.
const FRAME_MARGIN: f32 = 1.05;

/// A way to fly while its key is held.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Fly {
    Forward,
    Back,
    Left,
    Right,
    Up,
    Down,
}

/// Keys that are held.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct Held {
    /// By [`Fly`].
    ways: [bool; 6],
    faster: bool,
    slower: bool,
}

/// Moves a camera by keys and the mouse.
#[derive(Clone, Debug)]
pub struct Controller {
    camera: Camera,
    start: Camera,
    /// World units a second.
    speed: f32,
    held: Held,
    centre: Vec3,
    /// Of a sphere around the scene, more than 0.
    radius: f32,
}

impl Controller {
    /// Starts at `camera`; `bounds`: the scene's smallest and largest coordinates.
    pub fn new(camera: Camera, bounds: (Vec3, Vec3)) -> Self {
        let (min, max) = bounds;
        let radius = ((max - min).length() / 2.0).max(1e-6);
        Self { camera, start: camera, speed: radius / 2.0, held: Held::default(), centre: (min + max) / 2.0, radius }
    }

    pub fn camera(&self) -> &Camera {
        &self.camera
    }

    /// Of a sphere around the scene, world units.
    pub fn radius(&self) -> f32 {
        self.radius
    }

    /// World units a second.
    pub fn speed(&self) -> f32 {
        self.speed
    }

    /// Whether a key is held that moves the camera.
    pub fn is_flying(&self) -> bool {
        self.direction() != Vec3::ZERO
    }

    /// A key for a way to fly goes down or up.
    pub fn hold(&mut self, way: Fly, is_down: bool) {
        self.held.ways[way as usize] = is_down;
    }

    /// The keys that make it faster and slower.
    pub fn hurry(&mut self, faster: bool, slower: bool) {
        (self.held.faster, self.held.slower) = (faster, slower);
    }

    /// Lets go of all keys: the window has lost them.
    pub fn release(&mut self) {
        self.held = Held::default();
    }

    /// The wheel: steps up make it faster for good.
    pub fn wheel(&mut self, steps: f32) {
        let speed = self.speed * SPEED_A_STEP.powf(steps);
        self.speed = speed.clamp(self.radius * 1e-4, self.radius * 1e3);
    }

    /// Flies for `seconds` with the keys that are held.
    pub fn advance(&mut self, seconds: f32) {
        let haste = match (self.held.faster, self.held.slower) {
            (true, false) => HASTE,
            (false, true) => 1.0 / HASTE,
            _ => 1.0,
        };
        let step = self.direction() * (self.speed * haste * seconds);
        self.camera.eye += step;
        self.camera.target += step;
    }

    /// World-space direction of the held keys, of unit length or zero.
    fn direction(&self) -> Vec3 {
        let along = |ahead: Fly, back: Fly| {
            f32::from(u8::from(self.held.ways[ahead as usize])) - f32::from(u8::from(self.held.ways[back as usize]))
        };
        let (forward, right) = self.axes();
        let sum = along(Fly::Forward, Fly::Back) * forward
            + along(Fly::Right, Fly::Left) * right
            + along(Fly::Up, Fly::Down) * self.camera.up;
        sum.normalize_or_zero()
    }

    /// Unit vectors to where the camera looks and to its right.
    fn axes(&self) -> (Vec3, Vec3) {
        let forward = (self.camera.target - self.camera.eye).normalize();
        (forward, forward.cross(self.camera.up).normalize())
    }

    /// Turns the head: a drag by `x` to the right and `y` down, in heights of the window.
    pub fn look(&mut self, x: f32, y: f32) {
        let view = self.turned(self.camera.target - self.camera.eye, x, y);
        self.camera.target = self.camera.eye + view;
    }

    /// Goes around the target: a drag by `x` to the right and `y` down, in heights of the window, takes the scene along.
    pub fn orbit(&mut self, x: f32, y: f32) {
        let view = self.turned(self.camera.target - self.camera.eye, x, y);
        self.camera.eye = self.camera.target - view;
    }

    /// The view, turned to the right and down about the camera's axes, kept off the poles.
    fn turned(&self, view: Vec3, x: f32, y: f32) -> Vec3 {
        let up = self.camera.up;
        let yawed = Quat::from_axis_angle(up, -x * TURN_A_HEIGHT) * view;
        let right = yawed.cross(up).normalize();
        let elevation = FRAC_PI_2 - yawed.angle_between(up);
        let most = FRAC_PI_2 - POLE_MARGIN;
        // A scene may look closer to a pole than drags can go: from there they only lead away.
        let (least, most) = (elevation.min(-most), elevation.max(most));
        let pitch = (elevation - y * TURN_A_HEIGHT).clamp(least, most) - elevation;
        Quat::from_axis_angle(right, pitch) * yawed
    }

    /// Backs off, or comes near, until the scene fills the picture; `aspect`: the picture's width by its height.
    pub fn frame_scene(&mut self, aspect: f32) {
        let (forward, _) = self.axes();
        let half_height = (self.camera.vertical_fov_degrees.to_radians() / 2.0).tan();
        let narrower = (half_height * aspect.min(1.0)).atan();
        self.camera.target = self.centre;
        self.camera.eye = self.centre - forward * (FRAME_MARGIN * self.radius / narrower.sin());
    }

    /// Back to where it started.
    pub fn go_home(&mut self) {
        self.camera = self.start;
    }

    /// Puts the camera somewhere.
    pub fn place(&mut self, camera: Camera) {
        self.camera = camera;
    }

    /// Another scene around the same camera.
    pub fn set_scene(&mut self, start: Camera, bounds: (Vec3, Vec3)) {
        let Self { camera, speed, held, .. } = self.clone();
        *self = Self { camera, speed, held, ..Self::new(start, bounds) };
    }
}

/// The camera as a scene file has it.
pub fn to_toml(camera: &Camera) -> String {
    let vector = |v: Vec3| format!("[{:?}, {:?}, {:?}]", v.x, v.y, v.z);
    let Camera { eye, target, up, vertical_fov_degrees } = *camera;
    let (eye, target, up) = (vector(eye), vector(target), vector(up));
    format!("[camera]\neye = {eye}\ntarget = {target}\nup = {up}\nvertical_fov = {vertical_fov_degrees:?}\n")
}

#[cfg(test)]
mod tests {
    use glam::vec3;

    use super::*;

    fn controller() -> Controller {
        let camera =
            Camera { eye: vec3(1.0, 2.0, 8.0), target: vec3(0.0, 1.0, 0.0), up: Vec3::Y, vertical_fov_degrees: 40.0 };
        Controller::new(camera, (Vec3::splat(-2.0), Vec3::splat(2.0)))
    }

    /// Farthest that eye or target of two cameras are apart.
    fn apart(a: &Camera, b: &Camera) -> f32 {
        (a.eye - b.eye).length().max((a.target - b.target).length())
    }

    /// A second of flying and turning in steps of equal length.
    fn flown(n_steps: u32) -> Camera {
        let mut controller = controller();
        controller.hold(Fly::Forward, true);
        controller.hold(Fly::Up, true);
        controller.hurry(true, false);
        (0..n_steps).for_each(|_| controller.advance(1.0 / n_steps as f32));
        controller.look(0.3, -0.2);
        controller.hold(Fly::Up, false);
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
    fn keys_move_along_the_cameras_axes_at_its_speed() {
        let start = *controller().camera();
        let forward = (start.target - start.eye).normalize();
        let right = forward.cross(start.up).normalize();
        let ways = [
            (Fly::Forward, forward),
            (Fly::Back, -forward),
            (Fly::Left, -right),
            (Fly::Right, right),
            (Fly::Up, Vec3::Y),
            (Fly::Down, Vec3::NEG_Y),
        ];
        for (way, direction) in ways {
            let mut controller = controller();
            controller.hold(way, true);
            assert!(controller.is_flying());
            controller.advance(0.5);
            let step = controller.camera().eye - start.eye;
            assert!((step - direction * controller.speed() * 0.5).length() < 1e-5, "{way:?}");
            assert!((controller.camera().target - start.target - step).length() < 1e-5);
            controller.release();
            assert!(!controller.is_flying());
        }
    }

    #[test]
    fn opposite_keys_cancel_each_other() {
        let mut controller = controller();
        controller.hold(Fly::Left, true);
        controller.hold(Fly::Right, true);
        controller.advance(1.0);
        assert!(!controller.is_flying() && apart(controller.camera(), &controller.start) == 0.0);
    }

    #[test]
    fn drags_turn_to_where_the_mouse_goes() {
        let mut looking = controller();
        looking.look(0.1, 0.0);
        let (_, right) = controller().axes();
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
                let (forward, right) = controller.axes();
                let off_pole = forward.cross(Vec3::Y).length();
                assert!((off_pole - POLE_MARGIN.sin()).abs() < 1e-3, "{off_pole}");
                assert!(right.is_finite() && controller.camera().eye.is_finite());
            }
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

    #[test]
    fn the_wheel_changes_the_speed_within_bounds() {
        let mut controller = controller();
        let before = controller.speed();
        controller.wheel(2.0);
        controller.wheel(-2.0);
        assert!((controller.speed() / before - 1.0).abs() < 1e-6);
        controller.wheel(1.0);
        assert!(controller.speed() > before);
        controller.wheel(-1e9);
        assert!(controller.speed() > 0.0);
        controller.wheel(1e9);
        assert!(controller.speed().is_finite());
    }

    #[test]
    fn a_scene_file_reads_the_printed_camera() {
        let directory = tempfile::TempDir::new().unwrap();
        let path = directory.path().join("view.toml");
        let camera = Camera {
            eye: vec3(3.0e8, -2.5e-7, 1.0),
            target: vec3(0.1, 1.0 / 3.0, -7.0),
            up: Vec3::Z,
            vertical_fov_degrees: 39.5,
        };
        let mesh = "[[mesh]]\ngenerator = \"plane\"\nsize = [1.0, 1.0]\n";
        std::fs::write(&path, format!("{}{mesh}", to_toml(&camera))).unwrap();
        assert_eq!(crate::scene::Scene::load(&path).unwrap().camera, camera);
    }
}
