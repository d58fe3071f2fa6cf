//! Emitters: the tables from which the path tracer samples lights (glsl/shared/emitters).

use std::f64::consts::PI;

use glam::{DVec3, Vec3};

use super::{
    FlatScene,
    alias::{AliasEntry, alias_table, probabilities},
    emissive::emissive_triangles,
    environment_map::EnvironmentMap,
    light_bounds::LightBounds,
    light_tree::{TreeLight, light_tree},
};
use crate::{
    layout::{
        AREA_SUN, AccelConstants, AreaLight, EMITTER_AREA, EMITTER_ENVIRONMENT, EMITTER_LIGHT, EMITTER_SUN,
        EMITTER_TREE, EMITTER_TRIANGLE, EMITTERS_MAP, EMITTERS_SHAPE, Emitter, LIGHT_DIRECTIONAL, LIGHT_NODE_LEAF,
        LIGHT_SPOT, Light, LightNode,
    },
    scene::{Ground, Up},
};

/// The number of lights from which on they are sampled by a tree. The environment, directional lights and suns do not
/// count.
const LEAST_TREE_LIGHTS: usize = 256;

/// Everything that emits light, as the path tracer samples it.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Emitters {
    /// An alias table, and the lights of the tree. Without a tree: point, spot and directional lights, area lights,
    /// suns, triangles in their order, and the environment. What has no power has no entry.
    pub entries: Vec<Emitter>,
    /// The number of entries of the alias table. With a tree, these are directional lights, suns, the environment and,
    /// as the last entry, the tree.
    pub n_sampled: usize,
    /// The light tree; empty if the scene has few lights.
    pub light_nodes: Vec<LightNode>,
    /// Rectangles, disks and spheres. The suns follow.
    pub area_lights: Vec<AreaLight>,
    /// The number of suns.
    pub n_suns: usize,
    /// The map of the environment.
    pub environment: Option<EnvironmentMap>,
    /// Probability with which the environment is sampled.
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
    /// Makes the tables of a scene on the current rayon pool. `bounds`: those of its triangles.
    pub(super) fn new(scene: &FlatScene, bounds: (Vec3, Vec3)) -> Self {
        let disk = bounding_disk(bounds);
        let ground = scene.ground.unwrap_or(Ground { ambient: scene.ambient, up: Up::Y });
        // Directions are sampled as if the brighter half of the ambient light came from everywhere.
        let ambient = scene.ambient.max(ground.ambient);
        let environment = scene.environment.as_ref().map(|map| EnvironmentMap::new(map, ambient));
        // Who has no entry is never sampled, whatever the scene says: the leaf ends a loop of the kernels.
        let unsampled = |light: &AreaLight| AreaLight { probability: 0.0, leaf_ix: 0, ..*light };
        let mut area_lights: Vec<AreaLight> = scene.area_lights.iter().map(unsampled).collect();
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
        let triangle = |(ix, power)| Weighed { kind: EMITTER_TRIANGLE, ix, power };
        weighed.extend(emissive_triangles(scene).into_iter().map(triangle));
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
        made.set_entries(scene, weighed);
        made
    }

    /// Makes the alias table and the tree, and notes the probabilities of area lights, suns and the environment.
    fn set_entries(&mut self, scene: &FlatScene, mut weighed: Vec<Weighed>) {
        // Infinite powers would leave no room for others.
        weighed.retain(|emitter| emitter.power > 0.0 && emitter.power.is_finite());
        let is_in_tree = |emitter: &Weighed| match emitter.kind {
            EMITTER_LIGHT => scene.lights[emitter.ix].kind != LIGHT_DIRECTIONAL,
            kind => kind == EMITTER_AREA || kind == EMITTER_TRIANGLE,
        };
        let n_in_tree = weighed.iter().filter(|emitter| is_in_tree(emitter)).count();
        if n_in_tree >= LEAST_TREE_LIGHTS {
            let (lights, others) = weighed.into_iter().partition(is_in_tree);
            self.set_table_with_tree(others, &lights);
            self.set_tree(scene, &lights);
        } else {
            self.entries = table_of(&weighed);
            self.n_sampled = self.entries.len();
        }
        let n_shapes = self.area_lights.len() - self.n_suns;
        for emitter in &self.entries {
            match emitter.kind {
                EMITTER_AREA => self.area_lights[emitter.ix as usize].probability = emitter.probability,
                EMITTER_SUN => self.area_lights[n_shapes + emitter.ix as usize].probability = emitter.probability,
                EMITTER_ENVIRONMENT => self.environment_probability = emitter.probability,
                _ => {}
            }
        }
        let all = &self.entries;
        let triangle = all.iter().position(|emitter| emitter.kind == EMITTER_TRIANGLE);
        let n_triangles = all.iter().filter(|emitter| emitter.kind == EMITTER_TRIANGLE).count();
        self.triangle_entries = (triangle.unwrap_or(0), n_triangles);
    }

    /// Makes the alias table of a tree and of the emitters that are in none, and the entries of the tree's lights.
    fn set_table_with_tree(&mut self, mut others: Vec<Weighed>, lights: &[Weighed]) {
        let power = lights.iter().map(|light| light.power).sum();
        others.push(Weighed { kind: EMITTER_TREE, ix: 0, power });
        self.entries = table_of(&others);
        self.n_sampled = self.entries.len();
        let probability = self.entries[self.n_sampled - 1].probability;
        let entry =
            |light: &Weighed| Emitter { probability, kind: light.kind, ix: light.ix as u32, ..Emitter::default() };
        self.entries.extend(lights.iter().map(entry));
    }

    /// Builds the tree, and notes the leaf of each light.
    fn set_tree(&mut self, scene: &FlatScene, lights: &[Weighed]) {
        let of_light = |(ix, light): (usize, &Weighed)| TreeLight {
            bounds: match light.kind {
                EMITTER_LIGHT => LightBounds::of_light(&scene.lights[light.ix]),
                EMITTER_AREA => LightBounds::of_area_light(&scene.area_lights[light.ix]),
                _ => LightBounds::of_triangle(&scene.triangle(light.ix), light.power / (2.0 * PI)),
            },
            emitter_ix: (self.n_sampled + ix) as u32,
        };
        self.light_nodes = light_tree(lights.iter().enumerate().map(of_light).collect());
        for (leaf_ix, node) in self.light_nodes.iter().enumerate() {
            if node.flags & LIGHT_NODE_LEAF != 0 {
                let emitter = &mut self.entries[node.next as usize];
                emitter.alias_ix = leaf_ix as u32;
                if emitter.kind == EMITTER_AREA {
                    self.area_lights[emitter.ix as usize].leaf_ix = leaf_ix as u32;
                }
            }
        }
    }

    /// Returns the rectangles, disks and spheres.
    pub fn shapes(&self) -> &[AreaLight] {
        &self.area_lights[..self.area_lights.len() - self.n_suns]
    }

    /// Returns the suns.
    pub fn suns(&self) -> &[AreaLight] {
        &self.area_lights[self.area_lights.len() - self.n_suns..]
    }

    /// Returns whether a tree samples the lights, and not the alias table alone.
    pub fn has_tree(&self) -> bool {
        !self.light_nodes.is_empty()
    }

    /// Returns the kinds of emitters as bits: `1 << EMITTER_AREA` and its like, `EMITTERS_MAP`, and
    /// `EMITTERS_SHAPE << AREA_DISK` and its like.
    pub fn kinds(&self) -> u32 {
        let of_entries = self.entries.iter().map(|emitter| 1 << emitter.kind);
        // Rays meet area lights, suns and the map even if they are never sampled.
        let of_shapes = self.shapes().iter().map(|light| 1 << EMITTER_AREA | EMITTERS_SHAPE << light.kind);
        let of_suns = self.suns().iter().map(|_| 1 << EMITTER_SUN);
        let of_map = self.environment.iter().map(|_| EMITTERS_MAP);
        of_entries.chain(of_shapes).chain(of_suns).chain(of_map).fold(0, |kinds, kind| kinds | kind)
    }

    /// Returns the number of all that can be sampled: lights, emitting triangles, suns and the environment.
    pub fn n_lights(&self) -> usize {
        // One entry of the table is the tree itself, which is no light.
        self.entries.len() - usize::from(self.has_tree())
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
            n_emitters: self.n_sampled as u32,
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

/// Returns the alias table of emitters.
fn table_of(weighed: &[Weighed]) -> Vec<Emitter> {
    let powers: Vec<f64> = weighed.iter().map(|emitter| emitter.power).collect();
    let table = alias_table(&powers);
    let found = probabilities(&table);
    let entry = |((emitter, entry), probability): ((&Weighed, AliasEntry), f64)| Emitter {
        threshold: entry.threshold,
        alias_ix: entry.alias_ix,
        probability: probability as f32,
        kind: emitter.kind,
        ix: emitter.ix as u32,
    };
    weighed.iter().zip(table).zip(found).map(entry).collect()
}

/// Returns the luminance of linear RGB.
pub(super) fn luminance(colour: Vec3) -> f64 {
    colour.as_dvec3().dot(DVec3::new(0.2126, 0.7152, 0.0722))
}

/// Returns the area of the disk that the scene's bounding sphere covers, square world units.
fn bounding_disk((min, max): (Vec3, Vec3)) -> f64 {
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
