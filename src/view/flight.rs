//! Flight with keys: direction and speed.

use glam::Vec3;

/// Factor on the speed for one step of the wheel, or one press of a key.
const SPEED_PER_STEP: f32 = 1.25;
/// Factor on the speed while the key for faster flight is held; its reciprocal applies to slower flight.
const HASTE: f32 = 4.0;

/// Direction of flight while its key is held, along the camera's axes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Fly {
    Forward,
    Back,
    Left,
    Right,
    Up,
    Down,
}

/// The camera's axes: unit vectors, world space.
#[derive(Clone, Copy, Debug)]
pub struct Axes {
    pub forward: Vec3,
    pub right: Vec3,
    pub up: Vec3,
}

/// The flight keys that are held, and the speed.
#[derive(Clone, Copy, Debug)]
pub struct Flight {
    /// Whether the key of each [`Fly`] is held.
    held: [bool; 6],
    is_faster: bool,
    is_slower: bool,
    /// World units per second, without the keys for faster and slower flight.
    speed: f32,
    /// Radius of a sphere around the scene, world units.
    radius: f32,
}

impl Flight {
    /// Creates a flight with no key held. `radius` is that of a sphere around the scene, world units. At the initial
    /// speed, crossing the sphere takes four seconds.
    pub fn new(radius: f32) -> Self {
        Self { held: [false; 6], is_faster: false, is_slower: false, speed: radius / 2.0, radius }
    }

    /// Returns the same flight in a scene of another radius. The speed stays; only its limits change.
    pub fn around(self, radius: f32) -> Self {
        Self { radius, ..self }
    }

    /// Notes that the key of a direction goes down or up.
    pub fn hold(&mut self, way: Fly, is_down: bool) {
        self.held[way as usize] = is_down;
    }

    /// Notes whether the keys for faster and slower flight are held.
    pub fn hurry(&mut self, faster: bool, slower: bool) {
        (self.is_faster, self.is_slower) = (faster, slower);
    }

    /// Releases all keys. The speed stays.
    pub fn release(&mut self) {
        *self = Self { speed: self.speed, ..Self::new(self.radius) };
    }

    /// Changes the speed by a number of steps, which may be fractional; negative steps slow down.
    pub fn change_speed(&mut self, steps: f32) {
        let speed = self.speed * SPEED_PER_STEP.powf(steps);
        self.speed = speed.clamp(self.radius * 1e-4, self.radius * 1e3);
    }

    /// Returns the speed in world units per second, without the keys for faster and slower flight.
    pub fn speed(&self) -> f32 {
        self.speed
    }

    /// Returns whether the held keys move the camera: opposite keys cancel each other.
    pub fn is_under_way(&self) -> bool {
        let [forward, back, left, right, up, down] = self.held;
        forward != back || left != right || up != down
    }

    /// Returns the velocity in world units per second.
    pub fn velocity(&self, axes: &Axes) -> Vec3 {
        let haste = match (self.is_faster, self.is_slower) {
            (true, false) => HASTE,
            (false, true) => 1.0 / HASTE,
            _ => 1.0,
        };
        let [forward, back, left, right, up, down] = self.held.map(|is_held| f32::from(u8::from(is_held)));
        let way = (forward - back) * axes.forward + (right - left) * axes.right + (up - down) * axes.up;
        way.normalize_or_zero() * (self.speed * haste)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const AXES: Axes = Axes { forward: Vec3::NEG_Z, right: Vec3::X, up: Vec3::Y };

    #[test]
    fn keys_lead_along_the_axes() {
        let ways = [
            (Fly::Forward, Vec3::NEG_Z),
            (Fly::Back, Vec3::Z),
            (Fly::Left, Vec3::NEG_X),
            (Fly::Right, Vec3::X),
            (Fly::Up, Vec3::Y),
            (Fly::Down, Vec3::NEG_Y),
        ];
        for (way, direction) in ways {
            let mut flight = Flight::new(3.0);
            flight.hold(way, true);
            assert!(flight.is_under_way());
            assert_eq!(flight.velocity(&AXES), direction * 1.5, "{way:?}");
            flight.release();
            assert!(!flight.is_under_way());
        }
    }

    #[test]
    fn opposite_keys_cancel_each_other_and_others_add_up() {
        let mut flight = Flight::new(2.0);
        flight.hold(Fly::Left, true);
        flight.hold(Fly::Right, true);
        assert!(!flight.is_under_way() && flight.velocity(&AXES) == Vec3::ZERO);
        flight.hold(Fly::Up, true);
        flight.hold(Fly::Right, false);
        assert!((flight.velocity(&AXES) - Vec3::new(-1.0, 1.0, 0.0).normalize()).length() < 1e-6);
    }

    #[test]
    fn keys_and_steps_change_the_speed_within_bounds() {
        let mut flight = Flight::new(2.0);
        flight.hold(Fly::Up, true);
        for (faster, slower, speed) in [(true, false, 4.0), (false, true, 0.25), (true, true, 1.0)] {
            flight.hurry(faster, slower);
            assert_eq!(flight.velocity(&AXES), Vec3::Y * speed);
        }
        flight.change_speed(2.0);
        flight.change_speed(-2.0);
        assert!((flight.speed() - 1.0).abs() < 1e-6);
        flight.change_speed(1.0);
        assert_eq!(flight.speed(), SPEED_PER_STEP);
        flight.change_speed(-1e9);
        assert!(flight.speed() > 0.0);
        flight.change_speed(1e9);
        assert!(flight.speed().is_finite());
    }
}
