//! What the user wants to see in place of what a scene's file states or leaves out.

use glam::{DVec3, Vec3};

use super::{
    Camera, Light, MaterialChoice, Projection, Scene, Sky, Up, camera::FOV_DEGREES, error::Checked,
    mesh::MAX_COORDINATE,
};

/// The user's choice of light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum LightChoice {
    /// No light but the ambient light.
    None,
    /// A directional light that travels along this vector, which is finite and has a length above 0.
    Along(Vec3),
}

/// The user's choice of a sky.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SkyChoice {
    /// Angle of the sun above the horizon, 0 to 90 degrees.
    pub elevation: f32,
    /// Azimuth of the sun as of [`Sky::new`], degrees. Where absent, the sun is over the viewer's left shoulder.
    pub azimuth: Option<f32>,
    /// Haziness of the air, 2 to 10.
    pub turbidity: f32,
}

/// The user's choices. Absent ones leave the scene as it is.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Look {
    /// The axis that points up in the picture. Where absent, it is +z for a bare STL file, and else that of the camera.
    pub up: Option<Up>,
    /// The camera's eye in the coordinates of the file: those of world space, unless the scene was moved to the origin.
    pub eye: Option<DVec3>,
    /// The point that the middle of the picture shows, in the same coordinates. With an eye alone, it is the middle of
    /// the scene.
    pub target: Option<DVec3>,
    /// Angle between the picture's lower and upper edge, degrees, 0.1 to 170. It makes a camera perspective.
    pub vertical_fov_degrees: Option<f32>,
    /// The light, which replaces all lights of the scene. Its ambient light stays.
    pub light: Option<LightChoice>,
    /// The sky, which replaces all lights, the ambient light and the environment of the scene.
    pub sky: Option<SkyChoice>,
    /// Radiance of rays that leave the scene, linear RGB, at least 0.
    pub background: Option<Vec3>,
    /// Whether camera rays meet the back faces of single-sided materials, too.
    pub shows_back_faces: bool,
    /// Materials in place of the scene's own. Of several for a material the last one counts.
    pub materials: Vec<MaterialChoice>,
}

/// Irradiance of the user's light.
const IRRADIANCE: f32 = 0.8;

impl Look {
    /// Returns whether a choice concerns the camera.
    pub fn has_camera(&self) -> bool {
        self.up.is_some() || self.eye.is_some() || self.target.is_some() || self.vertical_fov_degrees.is_some()
    }

    /// Changes a scene's camera.
    pub(crate) fn set_camera(&self, scene: &mut Scene) -> Checked<()> {
        if !self.has_camera() {
            return Ok(());
        }
        let centre = || {
            let (min, max) = scene.bounds();
            (min + max) / 2.0
        };
        let Camera { eye, up, projection, .. } = scene.camera;
        let moved = |point: DVec3| (point - scene.origin).as_vec3();
        let target = self.target.map(moved);
        let target = target.unwrap_or_else(|| if self.eye.is_some() { centre() } else { scene.camera.target });
        let fov = self.vertical_fov_degrees;
        if let Some(fov) = fov.filter(|fov| !(FOV_DEGREES.0..=FOV_DEGREES.1).contains(fov)) {
            return Err(format!("a field of view of {fov} degrees is outside {} to {}", FOV_DEGREES.0, FOV_DEGREES.1));
        }
        let camera = Camera {
            eye: self.eye.map_or(eye, moved),
            target,
            up: self.up.map_or(up, Up::vector),
            projection: fov.map_or(projection, |vertical_fov_degrees| Projection::Perspective { vertical_fov_degrees }),
        };
        for (name, point) in [("eye", camera.eye), ("target", camera.target)] {
            let is_inside = point.abs().max_element() <= MAX_COORDINATE;
            if !is_inside {
                return Err(format!("the {name} {:?} is not within {MAX_COORDINATE:e}", point.to_array()));
            }
        }
        if !camera.spans_picture() {
            return Err(format!(
                "the eye {:?}, the target {:?} and up = {:?} span no picture: eye and target coincide, or up points \
                 along the view",
                camera.eye.to_array(),
                camera.target.to_array(),
                camera.up.to_array()
            ));
        }
        scene.camera = camera;
        Ok(())
    }

    /// Puts the chosen sky in place of a scene's light. `up` points to the zenith, and `azimuth` is that of the sun if
    /// the user leaves it out, degrees.
    pub(crate) fn set_sky(&self, scene: &mut Scene, up: Up, azimuth: f32) -> Checked<()> {
        let Some(choice) = self.sky else { return Ok(()) };
        let sky = Sky::new([choice.elevation, choice.azimuth.unwrap_or(azimuth)], up)?;
        scene.sky = Some(sky.with_turbidity(choice.turbidity)?);
        scene.lights = Vec::new();
        (scene.ambient, scene.ground, scene.background) = (Vec3::ZERO, None, Vec3::ZERO);
        scene.environment = None;
        scene.studio = None;
        scene.defaults.is_metered = false;
        Ok(())
    }

    /// Changes a scene's lights and its background.
    pub(crate) fn set_light(&self, scene: &mut Scene) {
        if let Some(light) = self.light {
            scene.lights = match light {
                LightChoice::None => Vec::new(),
                LightChoice::Along(direction) => {
                    let towards = -direction.as_dvec3().normalize().as_vec3();
                    vec![Light::Directional { towards, irradiance: Vec3::splat(IRRADIANCE) }]
                }
            };
            if let Some(sky) = &mut scene.sky {
                sky.has_sun = false;
            }
            // The lights that had physical units are gone.
            scene.defaults.is_metered = false;
            scene.chosen_light = None;
        }
        if let Some(background) = self.background {
            scene.background = background;
        }
    }
}
