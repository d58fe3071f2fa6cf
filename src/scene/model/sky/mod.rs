//! The sky with its sun, for the path tracer: a model that gives the radiance of each direction from the sun's place
//! and the haze. It becomes an [`Environment`] and a [`Light::Sun`].

mod colour;
mod preetham;
mod sun;

use std::f64::consts::PI;

use glam::{DVec3, Vec3};
use rayon::prelude::*;

use self::preetham::Distribution;
use super::{environment::Environment, error::Checked, light::Light, material::within, up::Up};

/// Haziness of the air for which the model holds. 2 is very clear, 3 clear, 6 hazy.
const TURBIDITIES: (f32, f32) = (2.0, 10.0);
/// Angle between opposite edges of the sun, degrees.
const SUN_DEGREES: f32 = 0.53;
/// Illuminance that is the irradiance 1 of scene files, kilolux: that of the ground on a clear day with a high sun.
const KILOLUX: f64 = 100.0;
/// Size of the environment's image, pixels. A pixel is a third of a degree wide.
const SIZE: [u32; 2] = [1024, 512];
/// Numbers of directions, by height and by azimuth, over which the sky's irradiance is summed.
const N_DIRECTIONS: [usize; 2] = [128, 256];

/// A clear sky with the sun. It lights the scene in place of [`Scene::environment`](super::Scene::environment). Below
/// the horizon is the ground, a plain that sky and sun light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sky {
    /// Unit vector towards the sun, world space. It is not below the horizon.
    pub towards_sun: Vec3,
    /// The axis of the world that points to the zenith.
    pub up: Up,
    /// Haziness of the air, 2 to 10: how much more light all of it scatters than the air without haze does.
    pub turbidity: f32,
    /// Share of the light that the ground reflects, linear RGB.
    pub ground_albedo: Vec3,
    /// Factor on all radiance. With 1, a white surface that receives 100,000 lux has the radiance 1.
    pub strength: f32,
    /// Whether the sun itself shines. Without it, a surface is lit as in a cloud's shadow. The ground is lit by both.
    pub has_sun: bool,
}

impl Sky {
    /// The turbidity of a clear day.
    pub const TURBIDITY: f32 = 3.0;
    /// The albedo of grass and earth.
    pub const GROUND_ALBEDO: f32 = 0.2;

    /// Makes a clear sky. `elevation`: of the sun above the horizon, degrees. `azimuth`: degrees from -z clockwise as
    /// seen from above, so that +x is at 90 degrees; from +y, if +z points up.
    ///
    /// # Errors
    /// The sun is not 0 to 90 degrees above the horizon. The error is a message for people.
    pub fn new([elevation, azimuth]: [f32; 2], up: Up) -> Result<Self, String> {
        let elevation = f64::from(within("elevation", elevation, 0.0, 90.0)?).to_radians();
        let azimuth = f64::from(within("azimuth", azimuth, -3600.0, 3600.0)?).to_radians();
        let (east, north) = (elevation.cos() * azimuth.sin(), elevation.cos() * azimuth.cos());
        let towards_sun = from_compass(DVec3::new(east, north, elevation.sin()), up).as_vec3();
        Ok(Self {
            towards_sun,
            up,
            turbidity: Self::TURBIDITY,
            ground_albedo: Vec3::splat(Self::GROUND_ALBEDO),
            strength: 1.0,
            has_sun: true,
        })
    }

    /// Returns the sky with another turbidity.
    ///
    /// # Errors
    /// The model does not hold for it. The error is a message for people.
    pub fn with_turbidity(self, turbidity: f32) -> Result<Self, String> {
        Ok(Self { turbidity: within("turbidity", turbidity, TURBIDITIES.0, TURBIDITIES.1)?, ..self })
    }

    /// Returns the radiance of a direction of the sky without the sun's disk, linear RGB. Directions below the horizon
    /// have that of the horizon.
    pub fn radiance(&self, direction: Vec3) -> Vec3 {
        (self.radiance_of(&self.distribution(), direction.as_dvec3()) * f64::from(self.strength)).as_vec3()
    }

    /// Returns the light of the sun, whether the sun shines or not.
    pub fn sun(&self) -> Light {
        let irradiance = self.sun_irradiance() * f64::from(self.strength);
        Light::Sun { towards: self.towards_sun, irradiance: irradiance.as_vec3(), angle_degrees: SUN_DEGREES }
    }

    /// Makes the image of the sky without the sun's disk, and of the ground, on the current rayon pool.
    pub fn environment(&self) -> Environment {
        let distribution = self.distribution();
        let to_sun = self.sun_direction();
        // White ground shows the irradiance in the units of scene files.
        let of_sun = self.sun_irradiance() * to_sun.z.max(0.0);
        let ground = self.ground_albedo.as_dvec3() * (self.sky_irradiance(&distribution) / PI + of_sun);
        let [width, height] = SIZE.map(|n| n as usize);
        let colour = |ix: usize| {
            let (x, y) = (ix % width, ix / width);
            let polar = PI * (y as f64 + 0.5) / height as f64;
            let azimuth = 2.0 * PI * ((x as f64 + 0.5) / width as f64 - 0.5);
            let (sine, cosine) = polar.sin_cos();
            let direction = DVec3::new(sine * azimuth.sin(), cosine, -sine * azimuth.cos());
            let is_sky = to_compass(direction, self.up).z >= 0.0;
            let radiance = if is_sky { self.radiance_of(&distribution, direction) } else { ground };
            (radiance * f64::from(self.strength)).as_vec3()
        };
        let colours = (0..width * height).into_par_iter().map(colour).collect();
        Environment::new(SIZE, colours, (0.0, 1.0)).expect("the image has its size").0
    }

    /// Returns the irradiance of level ground from the sky without the sun, radiance times steradians, for strength 1.
    fn sky_irradiance(&self, distribution: &Distribution) -> DVec3 {
        let [n_rows, n_columns] = N_DIRECTIONS;
        let of_row = |row: usize| -> DVec3 {
            // Rows of equal height have equal parts of the projected hemisphere.
            let squared_sine = (row as f64 + 0.5) / n_rows as f64;
            let (sine, cosine) = (squared_sine.sqrt(), (1.0 - squared_sine).sqrt());
            let of_column = |column: usize| {
                let (east, north) = (2.0 * PI * (column as f64 + 0.5) / n_columns as f64).sin_cos();
                let direction = from_compass(DVec3::new(sine * east, sine * north, cosine), self.up);
                self.radiance_of(distribution, direction)
            };
            (0..n_columns).map(of_column).sum()
        };
        let rows: Vec<DVec3> = (0..n_rows).into_par_iter().map(of_row).collect();
        rows.into_iter().sum::<DVec3>() * (PI / (n_rows * n_columns) as f64)
    }

    /// Returns the irradiance of the sun on a surface that faces it, in the units of scene files, for strength 1.
    fn sun_irradiance(&self) -> DVec3 {
        let zenith_angle = self.sun_direction().z.clamp(0.0, 1.0).acos();
        let squared_sine = f64::from(SUN_DEGREES / 2.0).to_radians().sin().powi(2);
        let luminance = sun::luminance(f64::from(self.turbidity), zenith_angle);
        colour::rgb_of_xyz(luminance) * (PI * squared_sine / KILOLUX)
    }

    fn distribution(&self) -> Distribution {
        Distribution::new(f64::from(self.turbidity), self.sun_direction().z.clamp(0.0, 1.0).acos())
    }

    /// Returns the direction towards the sun: east, north, up.
    fn sun_direction(&self) -> DVec3 {
        to_compass(self.towards_sun.as_dvec3(), self.up)
    }

    /// Returns the radiance of a direction for strength 1.
    fn radiance_of(&self, distribution: &Distribution, direction: DVec3) -> DVec3 {
        let cosine = to_compass(direction, self.up).z.max(0.0);
        let sun_angle = direction.angle_between(self.towards_sun.as_dvec3());
        colour::rgb_of_xyy(distribution.at(cosine, sun_angle)) * (PI / KILOLUX)
    }
}

/// Returns a vector of world space as its parts to the east, to the north and up.
fn to_compass(v: DVec3, up: Up) -> DVec3 {
    match up {
        Up::Y => DVec3::new(v.x, -v.z, v.y),
        Up::Z => v,
    }
}

/// Returns a vector of world space from its parts to the east, to the north and up.
fn from_compass(v: DVec3, up: Up) -> DVec3 {
    match up {
        Up::Y => DVec3::new(v.x, v.z, -v.y),
        Up::Z => v,
    }
}

/// Checks a direction towards the sun, a unit vector.
pub(crate) fn above_horizon(towards_sun: Vec3, up: Up) -> Checked<Vec3> {
    let height = towards_sun.dot(up.vector());
    if height >= 0.0 {
        return Ok(towards_sun);
    }
    let degrees = f64::from(height).asin().to_degrees();
    Err(format!("the sun is {:.1} degrees below the horizon; the sky is known for 0 to 90 degrees above it", -degrees))
}

#[cfg(test)]
mod tests;
