//! Emitters: the tables from which the path tracer picks lights (glsl/shared/emitters).

use std::f64::consts::PI;

use glam::{DVec3, Vec3};
use rayon::prelude::*;

use super::{
    FlatScene,
    alias::{AliasEntry, alias_table, probabilities},
    environment_map::EnvironmentMap,
};
use crate::{
    layout::{
        AREA_SUN, AccelConstants, AreaLight, EMITTER_AREA, EMITTER_ENVIRONMENT, EMITTER_LIGHT, EMITTER_SUN,
        EMITTER_TRIANGLE, Emitter, LIGHT_DIRECTIONAL, LIGHT_SPOT, Light, MATERIAL_UNLIT, Material, NO_TEXTURE,
        Triangle,
    },
    reference::texture::{sample_texture, uv_set_of},
    scene::{Ground, Up},
};

/// The number of parts of each edge of a triangle over whose cells the mean of its emission is taken.
const EMISSION_CELLS: usize = 8;

/// Everything that emits light, as the path tracer picks it.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Emitters {
    /// An alias table: point, spot and directional lights, area lights, suns, triangles in their order, and the
    /// environment. What has no power has no entry.
    pub entries: Vec<Emitter>,
    /// Rectangles, disks and spheres. The suns follow.
    pub area_lights: Vec<AreaLight>,
    /// The number of suns.
    pub n_suns: usize,
    /// The map of the environment.
    pub environment: Option<EnvironmentMap>,
    /// Probability with which the environment is picked.
    pub environment_probability: f32,
    /// Radiance of the environment if it has no map.
    pub background: Vec3,
    /// Radiance that surfaces get from all directions in addition.
    pub ambient: Vec3,
    /// The same from below.
    pub ground_ambient: Vec3,
    /// Index of the coordinate that points up.
    pub up_axis: usize,
    /// The index and the number of the entries of triangles.
    triangle_entries: (usize, usize),
}

/// An emitter and its power.
struct Weighed {
    kind: u32,
    ix: usize,
    power: f64,
}

impl Emitters {
    /// Makes the tables of a scene on the current rayon pool.
    pub(super) fn new(scene: &FlatScene) -> Self {
        let disk = bounding_disk(scene);
        let ground = scene.ground.unwrap_or(Ground { ambient: scene.ambient, up: Up::Y });
        // Directions are picked as if the brighter half of the ambient light came from everywhere.
        let ambient = scene.ambient.max(ground.ambient);
        let environment = scene.environment.as_ref().map(|map| EnvironmentMap::new(map, ambient));
        let mut area_lights = scene.area_lights.clone();
        let (lights, suns) = lights_and_suns(&scene.lights, disk);
        let of_areas = area_lights.iter().enumerate().map(|(ix, light)| Weighed {
            kind: EMITTER_AREA,
            ix,
            power: PI * f64::from(light.area) * luminance(light.radiance),
        });
        let mut weighed: Vec<Weighed> = lights.into_iter().chain(of_areas).collect();
        weighed.extend(suns.iter().enumerate().map(|(ix, sun)| Weighed {
            kind: EMITTER_SUN,
            ix,
            power: f64::from(sun.area) * luminance(sun.radiance) * disk,
        }));
        let n_suns = suns.len();
        area_lights.extend(suns);
        weighed.extend(triangles(scene));
        let mean = environment.as_ref().map_or(luminance(scene.background), EnvironmentMap::mean_luminance);
        let power = (mean + luminance(ambient)) * 4.0 * PI * disk;
        weighed.push(Weighed { kind: EMITTER_ENVIRONMENT, ix: 0, power });
        let mut made = Self {
            area_lights,
            n_suns,
            environment,
            background: scene.background,
            ambient: scene.ambient,
            ground_ambient: ground.ambient,
            up_axis: if ground.up == Up::Z { 2 } else { 1 },
            ..Self::default()
        };
        made.set_entries(weighed);
        made
    }

    /// Makes the alias table, and notes the probabilities of area lights, suns and the environment.
    fn set_entries(&mut self, mut weighed: Vec<Weighed>) {
        // Infinite powers would leave no room for others.
        weighed.retain(|emitter| emitter.power > 0.0 && emitter.power.is_finite());
        let powers: Vec<f64> = weighed.iter().map(|emitter| emitter.power).collect();
        let table = alias_table(&powers);
        let entry = |((emitter, entry), probability): ((&Weighed, AliasEntry), f64)| Emitter {
            threshold: entry.threshold,
            alias_ix: entry.alias_ix,
            probability: probability as f32,
            kind: emitter.kind,
            ix: emitter.ix as u32,
        };
        let found = probabilities(&table);
        self.entries = weighed.iter().zip(table).zip(found).map(entry).collect();
        let n_shapes = self.area_lights.len() - self.n_suns;
        for emitter in &self.entries {
            match emitter.kind {
                EMITTER_AREA => self.area_lights[emitter.ix as usize].probability = emitter.probability,
                EMITTER_SUN => self.area_lights[n_shapes + emitter.ix as usize].probability = emitter.probability,
                EMITTER_ENVIRONMENT => self.environment_probability = emitter.probability,
                _ => {}
            }
        }
        let first = self.entries.partition_point(|emitter| emitter.kind < EMITTER_TRIANGLE);
        let end = self.entries.partition_point(|emitter| emitter.kind <= EMITTER_TRIANGLE);
        self.triangle_entries = (first, end - first);
    }

    /// Returns the rectangles, disks and spheres.
    pub fn shapes(&self) -> &[AreaLight] {
        &self.area_lights[..self.area_lights.len() - self.n_suns]
    }

    /// Returns the suns.
    pub fn suns(&self) -> &[AreaLight] {
        &self.area_lights[self.area_lights.len() - self.n_suns..]
    }

    /// Returns the entries of triangles.
    pub fn triangles(&self) -> &[Emitter] {
        let (first, n) = self.triangle_entries;
        &self.entries[first..first + n]
    }

    /// Returns the constants of the emitters, without the indices at which the tables begin on a device.
    pub fn constants(&self) -> AccelConstants {
        let map = self.environment.as_ref();
        let [environment_width, environment_height] = map.map_or([0; 2], |map| map.size);
        AccelConstants {
            background: self.background,
            environment_probability: self.environment_probability,
            ambient: self.ambient,
            ground_ambient: self.ground_ambient,
            up_axis: self.up_axis as u32,
            n_emitters: self.entries.len() as u32,
            first_triangle_emitter: self.triangle_entries.0 as u32,
            n_triangle_emitters: self.triangle_entries.1 as u32,
            n_area_lights: self.shapes().len() as u32,
            n_suns: self.n_suns as u32,
            environment_width,
            environment_height,
            environment_turn: map.map_or(0.0, |map| map.turn),
            ..AccelConstants::default()
        }
    }
}

/// Returns the luminance of linear RGB.
pub(super) fn luminance(colour: Vec3) -> f64 {
    colour.as_dvec3().dot(DVec3::new(0.2126, 0.7152, 0.0722))
}

/// Returns the area of the disk that the scene's bounding sphere covers, square world units.
fn bounding_disk(scene: &FlatScene) -> f64 {
    let (min, max) = scene.bounds();
    let squared = (max - min).as_dvec3().length_squared() / 4.0;
    if squared.is_finite() && squared > 0.0 { PI * squared } else { PI }
}

/// Returns the lights without a size, and the suns.
fn lights_and_suns(lights: &[Light], disk: f64) -> (Vec<Weighed>, Vec<AreaLight>) {
    let (mut weighed, mut suns) = (Vec::new(), Vec::new());
    for (ix, light) in lights.iter().enumerate() {
        let is_directional = light.kind == LIGHT_DIRECTIONAL;
        if is_directional && light.outer_cos > 0.0 && light.outer_cos < 1.0 {
            suns.push(sun(light));
            continue;
        }
        let share = match light.kind {
            LIGHT_DIRECTIONAL => disk,
            LIGHT_SPOT => {
                let [inner, outer] = [light.inner_cos, light.outer_cos].map(f64::from);
                2.0 * PI * ((1.0 - inner) + (inner - outer) / 3.0)
            }
            _ => 4.0 * PI,
        };
        // The irradiance of the physical light is pi times that of the scene file's.
        weighed.push(Weighed { kind: EMITTER_LIGHT, ix, power: PI * luminance(light.intensity) * share });
    }
    (weighed, suns)
}

/// Returns the disk of a directional light.
fn sun(light: &Light) -> AreaLight {
    let cosine = f64::from(light.outer_cos);
    // The integral of the cosine over the disk is pi times the squared sine, and the irradiance is pi times the stated
    // one.
    let squared_sine = 1.0 - cosine * cosine;
    let (edge_u, edge_v) = light.position.any_orthonormal_pair();
    AreaLight {
        position: light.position,
        kind: AREA_SUN,
        radiance: (light.intensity.as_dvec3() / squared_sine).as_vec3(),
        radius: (1.0 - cosine) as f32,
        axis: light.position,
        area: (2.0 * PI * (1.0 - cosine)) as f32,
        edge_u,
        edge_v,
        ..AreaLight::default()
    }
}

/// Returns whether a material emits light that reaches other surfaces.
pub(super) fn is_emissive(material: &Material) -> bool {
    material.ke != Vec3::ZERO && material.flags & MATERIAL_UNLIT == 0
}

/// Returns the triangles that emit light.
fn triangles(scene: &FlatScene) -> Vec<Weighed> {
    let emissive: Vec<bool> = scene.materials.iter().map(is_emissive).collect();
    if !emissive.contains(&true) {
        return Vec::new();
    }
    let of_triangle = |(ix, material_ix): (usize, &u32)| {
        if !emissive[*material_ix as usize] {
            return None;
        }
        let area = area_of(&scene.triangles[ix]);
        let emission = mean_emission(scene, ix, *material_ix as usize);
        Some(Weighed { kind: EMITTER_TRIANGLE, ix, power: 2.0 * PI * area * luminance(emission) })
    };
    scene.triangle_materials.par_iter().enumerate().filter_map(of_triangle).collect()
}

/// Returns the area as kernels see it: 0 if its square underflows.
fn area_of(t: &Triangle) -> f64 {
    f64::from((t.v1 - t.v0).cross(t.v2 - t.v0).length()) / 2.0
}

/// Returns the mean radiance that a triangle emits.
fn mean_emission(scene: &FlatScene, triangle_ix: usize, material_ix: usize) -> Vec3 {
    let (textures, ke) = (&scene.textures, scene.materials[material_ix].ke);
    let texture_ix = textures.material_maps.get(material_ix).map_or(NO_TEXTURE, |maps| maps.emission);
    let Some(map) = textures.textures.get(texture_ix as usize) else { return ke };
    let sum: Vec3 = middles_of_cells()
        .map(|[u, v]| {
            let uv = textures.uv_at(triangle_ix as u32, uv_set_of(map), u, v);
            sample_texture(&textures.texels, map, uv, 0.0).truncate().max(Vec3::ZERO)
        })
        .sum();
    ke * sum / (EMISSION_CELLS * EMISSION_CELLS) as f32
}

/// Returns the barycentric weights of the middles of the equal cells into which lines parallel to the edges cut a
/// triangle.
fn middles_of_cells() -> impl Iterator<Item = [f32; 2]> {
    const N: usize = EMISSION_CELLS;
    let cells = (0..N).flat_map(|i| (0..N - i).map(move |j| (i, j)));
    cells.flat_map(|(i, j)| {
        let place = |offset: f32| [i, j].map(|cell| (cell as f32 + offset) / N as f32);
        // The second cell, which is turned round, does not exist at the long edge.
        [Some(place(1.0 / 3.0)), (i + j + 1 < N).then(|| place(2.0 / 3.0))].into_iter().flatten()
    })
}
