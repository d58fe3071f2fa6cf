//! Ambient light in place of light that only paths show, for quick pictures by [`Integrator::Whitted`].
//!
//! [`Integrator::Whitted`]: crate::frame::Integrator::Whitted

use std::f64::consts::PI;

use glam::{DVec3, Vec3};
use rayon::prelude::*;

use super::{
    FlatScene,
    emissive::{area_of, is_emissive},
};
use crate::scene::{Environment, Up};

/// Factor on the light of surfaces and lights with an area: others reflect half of it again and again.
const REFLECTED: f64 = 2.0;
/// Shares of that light that surfaces receive which face up, and which face down, so that shapes can be seen.
const SHARES: [f64; 2] = [1.35, 0.65];
/// Height above the horizon up to which the environment gives the background, as a sine.
const HORIZON: f64 = 0.5;

/// Ambient light, and what is seen beyond the scene.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct AmbientApproximation {
    /// Irradiance of surfaces that face up, which is added to that of the scene.
    pub sky: Vec3,
    /// Irradiance of surfaces that face down, likewise.
    pub ground: Vec3,
    /// Radiance of rays that leave the scene, in place of the scene's own.
    pub background: Option<Vec3>,
}

impl AmbientApproximation {
    /// Adds up the light of a scene on the current rayon pool. `bounds`: those of its triangles. `up`: the axis that
    /// points up.
    pub fn new(scene: &FlatScene, bounds: impl FnOnce() -> (Vec3, Vec3), up: Up) -> Self {
        let around = scene.environment.as_ref().map(|environment| Around::new(environment, up));
        let [sky, ground] = around.as_ref().map_or([DVec3::ZERO; 2], |around| around.irradiance);
        let flux = if is_lit_within(scene) { reflected(scene, bounds()) } else { DVec3::ZERO };
        Self {
            sky: (sky + flux * SHARES[0]).as_vec3(),
            ground: (ground + flux * SHARES[1]).as_vec3(),
            background: around.map(|around| around.horizon.as_vec3()),
        }
    }
}

/// Whether surfaces or lights with an area shine in a scene.
pub(super) fn is_lit_within(scene: &FlatScene) -> bool {
    !scene.area_lights.is_empty() || scene.materials.iter().any(is_emissive)
}

/// Returns the mean irradiance in a closed room, the light over the area of the walls, with what they reflect.
fn reflected(scene: &FlatScene, (min, max): (Vec3, Vec3)) -> DVec3 {
    let size = (max - min).as_dvec3();
    let walls = 2.0 * (size.x * size.y + size.y * size.z + size.z * size.x);
    if walls > 0.0 && walls.is_finite() { flux(scene) * (REFLECTED / (PI * walls)) } else { DVec3::ZERO }
}

/// Returns the light that all surfaces and lights with an area give off: radiance times area times steradians.
fn flux(scene: &FlatScene) -> DVec3 {
    let of_lights: DVec3 =
        scene.area_lights.iter().map(|light| light.radiance.as_dvec3() * (PI * f64::from(light.area))).sum();
    let emission: Vec<Option<DVec3>> =
        scene.materials.iter().map(|material| is_emissive(material).then(|| material.ke.as_dvec3())).collect();
    let is_emissive: Vec<bool> = emission.iter().map(Option::is_some).collect();
    let of_triangle = |ix: usize| {
        let Some(ke) = emission[scene.material_ix_of(ix) as usize] else { return DVec3::ZERO };
        // Both sides shine.
        ke * (2.0 * PI * area_of(&scene.triangle(ix)))
    };
    of_lights + scene.triangles_with(&is_emissive).into_iter().map(of_triangle).sum::<DVec3>()
}

/// Sums over an environment.
struct Around {
    /// Irradiance of surfaces that face up and down, in the units of scene files: that of white surfaces is their
    /// radiance.
    irradiance: [DVec3; 2],
    /// Mean radiance above the horizon.
    horizon: DVec3,
}

impl Around {
    fn new(environment: &Environment, up: Up) -> Self {
        let [width, height] = environment.size().map(|n| n as usize);
        let turn = 2.0 * PI * f64::from(environment.turn());
        let of_row = |(row, colours): (usize, &[Vec3])| {
            let polar = PI * (row as f64 + 0.5) / height as f64;
            let solid_angle = polar.sin() * (PI / height as f64) * (2.0 * PI / width as f64);
            let mut sums = [DVec3::ZERO; 4];
            for (column, colour) in colours.iter().enumerate() {
                let azimuth = 2.0 * PI * ((column as f64 + 0.5) / width as f64 - 0.5) - turn;
                let sine = match up {
                    Up::Y => polar.cos(),
                    Up::Z => -polar.sin() * azimuth.cos(),
                };
                let light = colour.as_dvec3() * solid_angle;
                sums[usize::from(sine < 0.0)] += light * (sine.abs() / PI);
                if (0.0..HORIZON).contains(&sine) {
                    sums[2] += light;
                    sums[3] += solid_angle;
                }
            }
            sums
        };
        let rows: Vec<[DVec3; 4]> = environment.colours().par_chunks(width).enumerate().map(of_row).collect();
        let sum = |ix: usize| rows.iter().map(|row| row[ix]).sum::<DVec3>();
        let horizon = if sum(3) == DVec3::ZERO { DVec3::ZERO } else { sum(2) / sum(3) };
        Self { irradiance: [sum(0), sum(1)], horizon }
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use glam::vec3;

    use super::*;
    use crate::{
        frame::{Integrator, RenderOptions},
        layout::Frame,
        scene::{self, Ground, Material, Mesh, Scene, Sky, Transform},
        world::World,
    };

    fn made_of(scene: &FlatScene, up: Up) -> AmbientApproximation {
        AmbientApproximation::new(scene, || scene.bounds(), up)
    }

    fn assert_near(a: Vec3, b: Vec3, relative: f32) {
        assert!((a - b).abs().max_element() <= relative * b.abs().max_element(), "{a}, not {b}");
    }

    /// An even environment gives all surfaces its radiance, and is seen itself.
    #[test]
    fn an_even_environment_is_even_ambient_light() {
        let colour = vec3(0.5, 0.25, 2.0);
        let environment = Environment::new([64, 32], vec![colour; 64 * 32], (30.0, 1.0)).unwrap().0;
        let scene = Scene { environment: Some(environment), ..Scene::empty(Path::new("scene")) };
        for up in [Up::Y, Up::Z] {
            let made = made_of(&FlatScene::new(&scene).unwrap(), up);
            // Rows and columns sample the cosine.
            assert_near(made.sky, colour, 5e-3);
            assert_near(made.ground, colour, 5e-3);
            assert_near(made.background.unwrap(), colour, 1e-6);
        }
    }

    /// A sky gives level ground its irradiance, and the ground gives surfaces that face down the light it reflects.
    #[test]
    fn a_sky_is_light_from_above_and_from_below() {
        for up in [Up::Y, Up::Z] {
            let sky = Sky::new([40.0, 70.0], up).unwrap();
            let scene = Scene { sky: Some(sky), ..Scene::empty(Path::new("scene")) };
            let flat = FlatScene::new(&scene).unwrap();
            let made = made_of(&flat, up);
            let scene::Light::Sun { irradiance, towards, .. } = sky.sun() else { panic!("{:?}", sky.sun()) };
            let of_sun = irradiance * towards.dot(up.vector());
            assert_near(made.ground, sky.ground_albedo * (made.sky + of_sun), 0.01);
            let blue = made.background.unwrap();
            assert!(blue.min_element() > 0.05 && made.sky.z > made.sky.x, "{made:?}");
        }
    }

    /// Only whitted shows the ambient light, and only if it is asked to.
    #[test]
    fn constants_have_it_if_they_are_asked_to() {
        let environment = Environment::new([4, 2], vec![Vec3::ONE; 8], (0.0, 1.0)).unwrap().0;
        let scene = Scene {
            environment: Some(environment),
            ambient: Vec3::splat(0.25),
            ground: Some(Ground { ambient: Vec3::ZERO, up: Up::Z }),
            ..Scene::empty(Path::new("scene"))
        };
        let world = World::new(&scene, &Default::default()).unwrap();
        let options = |approximates_ambient, integrator| RenderOptions {
            approximates_ambient,
            integrator,
            ..RenderOptions::default()
        };
        let plain = world.frame_constants(&options(false, Integrator::Whitted));
        let of_paths = world.frame_constants(&options(true, Integrator::Path));
        let light = |frame: &Frame| (frame.ambient, frame.ambient_tilt, frame.background);
        assert_eq!(light(&of_paths), light(&plain));
        let with = world.frame_constants(&options(true, Integrator::Whitted));
        let made = world.ambient_approximation(Up::Z);
        assert_eq!(with.ambient + with.ambient_tilt, Vec3::splat(0.25) + made.sky);
        assert_near(with.ambient - with.ambient_tilt, made.ground, 1e-6);
        assert_eq!((plain.background, Some(with.background)), (Vec3::ZERO, made.background));
    }

    /// The light of a lamp is spread over the walls of a box around the scene.
    #[test]
    fn lamps_light_the_box_around_the_scene() {
        let mut scene = Scene { materials: vec![Material::default()], ..Scene::empty(Path::new("scene")) };
        let mesh = Mesh {
            positions: vec![Vec3::ZERO, 2.0 * Vec3::X, 3.0 * Vec3::Y, 4.0 * Vec3::Z],
            faces: vec![[0, 1, 2], [0, 2, 3]],
            normals: vec![[Vec3::ZERO; 3]; 2],
            slots: vec![0; 2],
            ..Mesh::default()
        };
        scene.push_mesh(mesh, Transform::IDENTITY, vec![0]).unwrap();
        scene.lights = vec![scene::Light::Sphere { position: Vec3::ZERO, radius: 0.5, radiance: Vec3::splat(3.0) }];
        let flat = FlatScene::new(&scene).unwrap();
        let walls = 2.0 * (2.0 * 3.0 + 3.0 * 4.0 + 4.0 * 2.0);
        let made = made_of(&flat, Up::Y);
        // The sphere's area is pi, and its light pi times that times its radiance.
        let mean = 2.0 * 3.0 * PI as f32 / walls;
        assert_near((made.sky + made.ground) / 2.0, Vec3::splat(mean), 1e-3);
        assert!(made.background.is_none() && made.sky.x > made.ground.x);
        // A material that shines on both sides adds to it.
        scene.materials[0].ke = Vec3::ONE;
        assert!(made_of(&FlatScene::new(&scene).unwrap(), Up::Y).sky.x > made.sky.x);
    }
}
