//! Fills in what a scene's file lacks, by all guesses: a camera, lights, a ground under a sky. It also applies the
//! user's `Look`.

use std::path::Path;

use glam::Vec3;

use super::{
    framing::{self, ViewSpec, WorldAxes},
    interior,
    lamps::Lamplight,
    near::NearPart,
};
use crate::{
    frame::Integrator,
    scene::model::{ChosenLight, Ground, Light, LoadOptions, Scene, Up, error::Checked, lacks::Lacks},
};

/// Outside, the main light comes over the left shoulder of the viewer, and a weaker one from the right fills its
/// shadows.
const KEY: StandardLight = StandardLight { azimuth: -50.0, elevation: 45.0, irradiance: 0.75 };
const FILL: StandardLight = StandardLight { azimuth: 60.0, elevation: 20.0, irradiance: 0.22 };
/// Irradiance of the ambient light on surfaces that face up, and on those that face down. The mean is grey, so walls
/// have their own colours.
const AMBIENT: [Vec3; 2] = [Vec3::new(0.25, 0.26, 0.28), Vec3::new(0.15, 0.14, 0.12)];
const AMBIENT_OF_INTERIORS: [Vec3; 2] = [Vec3::splat(0.4), Vec3::splat(0.3)];
/// Factor on the ambient light and the background beside lamps, whose light shows best in the dark.
const BESIDE_LAMPS: f32 = 0.5;
/// In an interior, the irradiance of the light in its middle, at a distance of a mean half extent.
const MIDDLE_IRRADIANCE: f32 = 0.35;
/// Height of that light above the middle, in half extents.
const MIDDLE_HEIGHT: f32 = 0.3;
/// In an interior, the irradiance of the light beside the eye, at the distance of the middle.
const EYE_IRRADIANCE: f32 = 0.25;
const BACKGROUND: Vec3 = Vec3::new(0.32, 0.36, 0.42);

/// Gives a scene what its file lacks, and what the user has chosen. `path` is the scene's file.
pub(crate) fn fill_in(path: &Path, scene: &mut Scene, lacks: Lacks, options: &LoadOptions) -> Checked<()> {
    let look = &options.look;
    let up = look.up.unwrap_or(lacks.up);
    let axes = WorldAxes::with_up(up.vector());
    let lacks_light = lacks.light && look.sky.is_none();
    let needs_ground = lacks.description && look.sky.is_some();
    let needs_bounds = lacks.camera || lacks_light || needs_ground;
    let near = if needs_bounds { NearPart::of(scene, &scene.instances) } else { NearPart::default() };
    let bounds = near.bounds;
    let evidence = if needs_bounds { interior::evidence(scene, (path, up.vector()), bounds) } else { None };
    let is_interior = evidence.is_some();
    if lacks.camera {
        let aspect = options.aspect.unwrap_or(scene.defaults.width as f32 / scene.defaults.height as f32);
        let fov = |standard| look.vertical_fov_degrees.unwrap_or(standard);
        let spec = |standard| ViewSpec { axes, aspect: f64::from(aspect), vertical_fov_degrees: fov(standard) };
        let (outside, inside) = (spec(framing::VERTICAL_FOV_DEGREES), spec(interior::VERTICAL_FOV_DEGREES));
        let of_interior = if is_interior { interior::camera(scene, bounds, [&outside, &inside]) } else { None };
        if let (Some(evidence), Some(_), None) = (&evidence, of_interior, look.eye) {
            tracing::info!("{}: is shown as a room: it has {evidence}; --eye shows it from elsewhere", path.display());
        }
        scene.camera = of_interior.unwrap_or_else(|| framing::camera(scene, &near, &outside));
        scene.chosen_camera = true;
        if look.eye.is_none() {
            near.warn_of_far(path, scene);
        }
    }
    look.set_camera(scene)?;
    if look.sky.is_some() {
        let up = [Up::Y, Up::Z].into_iter().find(|up| up.vector() == scene.camera.up).unwrap_or(up);
        look.set_sky(scene, up, azimuth_of_key(scene, up))?;
        if needs_ground && !is_interior {
            scene.add_ground(bounds, up)?;
        }
    }
    let stated = options.integrator.or((!lacks.integrator).then_some(scene.defaults.integrator));
    let lamplight = if lacks_light { scene.lamplight(is_interior, stated) } else { None };
    // Surfaces that only glow light nothing else. `Whitted` shows them, sooner and without noise.
    let only_glows = lacks_light && lamplight.is_none();
    if lacks.integrator && scene.needs_path() && !only_glows {
        scene.defaults.integrator = Integrator::Path;
    }
    match lamplight {
        Some(lamplight) => set_lamplight(path, scene, lamplight, (lacks, up, look.light.is_some())),
        None if lacks_light => set_lights(scene, lacks, (is_interior, bounds), (&axes, up)),
        None => {}
    }
    look.set_light(scene);
    Ok(())
}

/// Gives a scene what it needs beside its lamps. The exposure is measured for a mesh file, whose lamps have the units
/// of its program, and for a scene file whose surfaces count as lamps only because it states the integrator `path`.
/// Outside, a mesh file gets the standard ambient light and background in the units of its lamps, but less of them than
/// beside the standard lights. Without them, shadows would be black, and things could not be told from what is beyond.
fn set_lamplight(
    path: &Path,
    scene: &mut Scene,
    lamplight: Lamplight,
    (lacks, up, has_users_light): (Lacks, Up, bool),
) {
    scene.chosen_light = Some(ChosenLight::Surfaces);
    if lamplight.is_stated && !has_users_light {
        tracing::info!(
            "{}: the surfaces that shine are its only light, since the integrator `path` is stated, though they light \
             little of what is seen; `ambient = [0.3, 0.3, 0.3]` in a scene file adds some",
            path.display()
        );
    }
    scene.defaults.is_metered |= lacks.exposure && (lacks.description || lamplight.is_stated);
    // With the user's light, the exposure is not measured. A file with a camera shows what its maker saw.
    if lacks.description && lacks.camera && !has_users_light && lamplight.mean > 0.0 {
        tracing::info!(
            "{}: its lamps light it, with half of the standard ambient light; `--integrator path` leaves that out",
            path.display()
        );
        let scale = BESIDE_LAMPS * lamplight.mean;
        let [sky, ground] = AMBIENT.map(|ambient| ambient * scale);
        (scene.ambient, scene.ground) = (sky, Some(Ground { ambient: ground, up }));
        scene.background = BACKGROUND * scale;
    }
}

/// Gives a scene the standard lights, and a background if it lacks one.
fn set_lights(
    scene: &mut Scene,
    lacks: Lacks,
    (is_interior, bounds): (bool, (Vec3, Vec3)),
    (axes, up): (&WorldAxes, Up),
) {
    let lights = if is_interior { lights_inside(scene, bounds) } else { lights_outside(scene, axes) };
    let [sky, ground] = if is_interior { AMBIENT_OF_INTERIORS } else { AMBIENT };
    scene.chosen_light = Some(if is_interior { ChosenLight::Inside } else { ChosenLight::Outside });
    (scene.ambient, scene.ground) = (sky, Some(Ground { ambient: ground, up }));
    scene.lights = lights.to_vec();
    if lacks.background {
        scene.background = BACKGROUND;
    }
    if !is_interior && scene.has_mirrors() {
        let horizontal = StandardLight { azimuth: 0.0, elevation: 0.0, irradiance: 0.0 };
        scene.studio = Some(light_towards(scene, axes, &horizontal));
    }
}

/// A directional light. Its direction is relative to the viewer: `azimuth` to the right, `elevation` upwards, degrees.
struct StandardLight {
    azimuth: f32,
    elevation: f32,
    irradiance: f32,
}

/// Returns the azimuth of the main light of a scene that is seen from outside, as of [`Sky::new`], degrees.
fn azimuth_of_key(scene: &Scene, up: Up) -> f32 {
    let axes = WorldAxes::with_up(up.vector());
    let towards = light_towards(scene, &axes, &KEY);
    let north = match up {
        Up::Y => -towards.z,
        Up::Z => towards.y,
    };
    towards.x.atan2(north).to_degrees()
}

/// Returns the lights of a scene that is seen from outside.
fn lights_outside(scene: &Scene, axes: &WorldAxes) -> [Light; 2] {
    [KEY, FILL].map(|light| Light::Directional {
        towards: light_towards(scene, axes, &light),
        irradiance: Vec3::splat(light.irradiance),
    })
}

/// Returns the direction towards a standard light, world space.
fn light_towards(scene: &Scene, axes: &WorldAxes, light: &StandardLight) -> Vec3 {
    let up = axes.up.as_vec3();
    let towards_eye = (scene.camera.eye - scene.camera.target).reject_from_normalized(up);
    let towards_eye = towards_eye.try_normalize().unwrap_or(axes.front.as_vec3());
    let right = up.cross(towards_eye);
    let (azimuth, elevation) = (light.azimuth.to_radians(), light.elevation.to_radians());
    let horizontal = towards_eye * azimuth.cos() + right * azimuth.sin();
    (horizontal * elevation.cos() + up * elevation.sin()).normalize()
}

/// Returns the lights of an interior: one in its middle, and one at the eye, whose shadows the eye does not see.
fn lights_inside(scene: &Scene, (min, max): (Vec3, Vec3)) -> [Light; 2] {
    let (centre, half) = ((min + max) / 2.0, (max - min) / 2.0);
    let up = scene.camera.up;
    let mean = (half.x * half.y * half.z).cbrt();
    let light = |position: Vec3, irradiance: f32, distance: f32| Light::Point {
        position,
        intensity: Vec3::splat(irradiance * distance * distance),
    };
    let eye = scene.camera.eye;
    [
        light(centre + half * MIDDLE_HEIGHT * up, MIDDLE_IRRADIANCE, mean),
        light(eye, EYE_IRRADIANCE, eye.distance(centre)),
    ]
}
