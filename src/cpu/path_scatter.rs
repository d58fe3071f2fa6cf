//! Path scatter: the light at the hits of paths, and the rays with which they go on. It does what the reference's pass
//! does, bit for bit. The random numbers of sixteen paths are computed together, and so are the bounces of paths at
//! [Lambertian](super::lambertian_surfaces) surfaces.

use arrayvec::ArrayVec;
use fearless_simd::{Level, dispatch, f32x16, prelude::*};
use glam::{vec2, vec3};
use rayon::prelude::*;

use super::{
    area_lights::meets_light,
    environment_samples::environment_samples,
    lambertian_scatter::{BounceConstants, Samples, lambertian_scatter},
    lambertian_surfaces::{LambertianHits, lambertian_surfaces},
    lanes::{LANES, LaneMask},
    path_begin::PixelOfBatch,
    sampler::{KeysSoa, PairsSoa, random_pairs},
    soa::RaysSoa,
    vec3x16::Vec3x16,
};
use crate::{
    layout::{AreaLight, Batch, Hit, NO_TRIANGLE, PathRay, PathState, SCAN_GROUP_SIZE, SHADOW_RAY_NONE, ShadowRay},
    reference::{
        emitters::{LightSample, sample_emitter},
        inputs::KernelInputs,
        live_paths::{PathSlice, path_slices},
        maps::colour_at,
        path_compact::{counts_of_block, flags_of_path},
        path_scatter::PathBuffers,
        path_vertex::{HitChoices, PAIRS_OF_HIT, first_pair_of, scatter_past_lights, scatter_path},
        paths::place_of_path,
        sampler::SampleKey,
        search_ray::SearchRay,
    },
    world::Emitters,
};

const BLOCK_SIZE: usize = SCAN_GROUP_SIZE as usize;
/// The number of paths from which on it is faster to scatter them together.
const LEAST_GROUP: usize = 4;

/// The random decisions at the hits of a group of paths.
#[derive(Default)]
struct GroupChoices {
    pairs: [PairsSoa; PAIRS_OF_HIT],
    /// The samples of the environment, if it has a map.
    of_environment: Option<[LightSample; LANES]>,
}

impl GroupChoices {
    fn of_lane(&self, lane: usize) -> HitChoices {
        HitChoices {
            pairs: self.pairs.each_ref().map(|[x, y]| vec2(x[lane], y[lane])),
            of_environment: self.of_environment.as_ref().map(|samples| samples[lane]),
        }
    }
}

/// What all paths of a bounce need.
pub struct BounceOfPaths<'a> {
    pub inputs: &'a KernelInputs<'a>,
    pub batch: &'a Batch,
    /// The pixels of the batch.
    pub pixels: &'a [PixelOfBatch],
    /// Whether each material is Lambertian.
    pub are_lambertian: &'a [bool],
    /// The closest hits of paths.
    pub hits: &'a [Hit],
    pub simd_level: Level,
}

/// The paths of a block, one element each.
struct PathsOfBlock<'a> {
    rays: PathSlice<'a, PathRay>,
    states: PathSlice<'a, PathState>,
    shadow_rays: PathSlice<'a, ShadowRay>,
}

/// Does what [`reference::path_scatter`](crate::reference::path_scatter::path_scatter) does.
pub fn path_scatter(
    bounce: &BounceOfPaths,
    live: &[u32],
    paths: PathBuffers,
    (child_flags, scan_blocks): (&mut [u32], &mut [[u32; 2]]),
) {
    let of_blocks = (live.par_chunks(BLOCK_SIZE), child_flags.par_chunks_mut(BLOCK_SIZE), scan_blocks.par_iter_mut());
    let of_paths = (
        path_slices(paths.rays, live, BLOCK_SIZE),
        path_slices(paths.states, live, BLOCK_SIZE),
        path_slices(paths.shadow_rays, live, BLOCK_SIZE),
    );
    of_blocks.into_par_iter().zip(of_paths).for_each(|(of_block, (rays, states, shadow_rays))| {
        let (live, flags, counts) = of_block;
        bounce.scatter_block(live, flags, &mut PathsOfBlock { rays, states, shadow_rays });
        *counts = counts_of_block(flags);
    });
}

impl BounceOfPaths<'_> {
    /// Takes the paths of a block one bounce further. Writes to `flags` which of them go on and have a shadow ray.
    fn scatter_block(&self, live: &[u32], flags: &mut [u32], paths: &mut PathsOfBlock) {
        let mut at_lambertian = ArrayVec::<_, BLOCK_SIZE>::new();
        let (mut at_others, mut missed) = (at_lambertian.clone(), at_lambertian.clone());
        for (place, &path_ix) in live.iter().enumerate() {
            let hit = &self.hits[path_ix as usize];
            let list = if hit.triangle_ix == NO_TRIANGLE {
                &mut missed
            } else if self.is_lambertian(hit) {
                &mut at_lambertian
            } else {
                &mut at_others
            };
            list.push((place, path_ix));
        }
        for group in at_lambertian.chunks(LANES) {
            if group.len() < LEAST_GROUP {
                self.scatter_group(group, &self.choices_of(group), flags, paths)
            } else {
                self.scatter_lambertian(group, flags, paths)
            }
        }
        at_others.chunks(LANES).for_each(|group| self.scatter_group(group, &self.choices_of(group), flags, paths));
        // Paths that leave the scene need no random numbers.
        missed.chunks(LANES).for_each(|group| self.scatter_group(group, &Default::default(), flags, paths));
    }

    fn is_lambertian(&self, hit: &Hit) -> bool {
        // The scatter of sixteen rays at a time reads triangles of flat worlds only.
        self.inputs.instanced.is_none()
            && self.are_lambertian[self.inputs.triangle_materials[hit.triangle_ix as usize] as usize]
    }

    fn key_of(&self, path_ix: u32) -> SampleKey {
        let frame = self.inputs.frame();
        self.pixels[place_of_path(frame, path_ix) as usize].key_of_path(frame, path_ix)
    }

    /// Returns the area lights.
    fn shapes(&self) -> &[AreaLight] {
        self.inputs.emitters.map_or(&[], |emitters| emitters.shapes())
    }

    /// Returns the paths of a group whose rays meet an area light before their hits.
    fn before_lights(&self, group: &[(usize, u32)], paths: &mut PathsOfBlock) -> LaneMask {
        let shapes = self.shapes();
        if shapes.is_empty() {
            return 0;
        }
        let mut rays = RaysSoa::default();
        for (lane, &(_, path_ix)) in group.iter().enumerate() {
            let hit = &self.hits[path_ix as usize];
            let t_max = if hit.triangle_ix == NO_TRIANGLE { f32::INFINITY } else { hit.t };
            rays.set(lane, &SearchRay { t_max, ..SearchRay::from(&*paths.rays.of_path(path_ix)) });
        }
        dispatch!(self.simd_level, simd => {
            let (origin, direction) = (Vec3x16::load(simd, &rays.origin), Vec3x16::load(simd, &rays.direction));
            let t_max = f32x16::load_array_ref(simd, &rays.t_max);
            meets_light(shapes, origin, direction, t_max).to_bitmask() as LaneMask
        })
    }

    /// Takes a path one bounce further. Returns its flags: whether it goes on and has a shadow ray.
    fn scatter(&self, path_ix: u32, before_light: bool, choices: HitChoices, paths: &mut PathsOfBlock) -> u32 {
        let (ray, state) = (paths.rays.of_path(path_ix), paths.states.of_path(path_ix));
        let (inputs, depth, hit) = (self.inputs, self.batch.depth, &self.hits[path_ix as usize]);
        let (goes_on, shadow_ray) = match before_light {
            true => scatter_path(inputs, || choices, depth, hit, ray, state),
            false => scatter_past_lights(inputs, || choices, depth, hit, ray, state),
        };
        // A path without a shadow ray has none already.
        if shadow_ray.state != SHADOW_RAY_NONE {
            *paths.shadow_rays.of_path(path_ix) = shadow_ray;
        }
        flags_of_path(goes_on, shadow_ray.state != SHADOW_RAY_NONE)
    }

    /// Makes the random decisions at the hits of a group of paths. The last ray of a path only meets light, so that no
    /// light is sampled at its hit.
    fn choices_of(&self, group: &[(usize, u32)]) -> GroupChoices {
        let mut keys = KeysSoa::default();
        for (lane, &(_, path_ix)) in group.iter().enumerate() {
            keys.set(lane, self.key_of(path_ix));
        }
        let depth = self.batch.depth;
        let pairs: [PairsSoa; PAIRS_OF_HIT] =
            dispatch!(self.simd_level, simd => random_pairs(simd, &keys, first_pair_of(depth)));
        let emitters = self.inputs.emitters.filter(|_| depth + 1 < self.inputs.frame().max_depth);
        let of_map = |emitters: &Emitters| {
            let u = [&pairs[0][1], &pairs[1][0]];
            emitters.environment.as_ref().map(|map| environment_samples(self.simd_level, emitters, map, u))
        };
        GroupChoices { of_environment: emitters.and_then(of_map), pairs }
    }

    /// Takes a group of paths one bounce further, one after the other.
    fn scatter_group(
        &self,
        group: &[(usize, u32)],
        choices: &GroupChoices,
        flags: &mut [u32],
        paths: &mut PathsOfBlock,
    ) {
        let before_lights = self.before_lights(group, paths);
        for (lane, &(place, path_ix)) in group.iter().enumerate() {
            flags[place] = self.scatter(path_ix, before_lights >> lane & 1 == 1, choices.of_lane(lane), paths);
        }
    }

    /// Ends a group of paths at Lambertian surfaces, with the light that their rays meet before.
    fn end_at_lambertian(&self, group: &[(usize, u32)], flags: &mut [u32], paths: &mut PathsOfBlock) {
        let before_lights = self.before_lights(group, paths);
        for (lane, &(place, path_ix)) in group.iter().enumerate() {
            flags[place] = 0;
            if before_lights >> lane & 1 == 1 {
                self.scatter(path_ix, true, Default::default(), paths);
            }
        }
    }

    /// Takes a group of paths at Lambertian surfaces one bounce further. Those that meet a light are taken as all
    /// others.
    fn scatter_lambertian(&self, group: &[(usize, u32)], flags: &mut [u32], paths: &mut PathsOfBlock) {
        let (inputs, frame, depth) = (self.inputs, self.inputs.frame(), self.batch.depth);
        // The last ray of a path only meets light.
        if depth + 1 >= frame.max_depth {
            return self.end_at_lambertian(group, flags, paths);
        }
        let mut hits = LambertianHits::default();
        for (lane, &(_, path_ix)) in group.iter().enumerate() {
            let hit = &self.hits[path_ix as usize];
            hits.set(lane, paths.rays.of_path(path_ix), hit, &inputs.triangles[hit.triangle_ix as usize]);
        }
        let surfaces = dispatch!(self.simd_level, simd => lambertian_surfaces(simd, &hits));
        let choices = self.choices_of(group);
        let mut samples = Samples::default();
        for (lane, &(_, path_ix)) in group.iter().enumerate() {
            let (ray, hit) = (paths.rays.of_path(path_ix), &self.hits[path_ix as usize]);
            hits.set_colour(lane, colour_at(inputs, ray, hit, surfaces.geometric(lane)));
            let HitChoices { pairs: [to_light, choice, ..], of_environment } = choices.of_lane(lane);
            let u = vec3(to_light.x, to_light.y, choice.x);
            samples.set(lane, &sample_emitter(inputs, surfaces.point_world(lane), u, of_environment.as_ref()));
        }
        let bounce = BounceConstants { depth, clamp: frame.clamp, shapes: self.shapes() };
        let samples = (&samples, &choices.pairs);
        let scattered =
            dispatch!(self.simd_level, simd => lambertian_scatter(simd, &bounce, (&hits, &surfaces), samples));
        let before_lights = self.before_lights(group, paths);
        for (lane, &(place, path_ix)) in group.iter().enumerate() {
            if before_lights >> lane & 1 == 1 {
                flags[place] = self.scatter(path_ix, true, choices.of_lane(lane), paths);
                continue;
            }
            let triangle_ix = self.hits[path_ix as usize].triangle_ix;
            let (goes_on, has_shadow_ray) =
                (scattered.go_on >> lane & 1 == 1, scattered.have_shadow_ray >> lane & 1 == 1);
            flags[place] = flags_of_path(goes_on, has_shadow_ray);
            if has_shadow_ray {
                *paths.shadow_rays.of_path(path_ix) = scattered.shadow_ray(lane, triangle_ix);
            }
            if goes_on {
                let ray = paths.rays.of_path(path_ix);
                *ray = scattered.ray(lane, triangle_ix, ray);
                paths.states.of_path(path_ix).pdf = scattered.pdf[lane];
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use bytemuck::Zeroable;
    use glam::Vec3;

    use super::{super::path_begin::pixels_of_batch, *};
    use crate::{
        accel::kdtree::BuildOptions,
        cpu::lambertian_surfaces::lambertian_materials,
        frame::RenderOptions,
        layout::{FLAT_NORMAL, Frame, MATERIAL_MICROFACET, MATERIAL_UNLIT, Material, Triangle},
        reference::{self, chi_square::Uniform},
        scene::{Environment, Light, Scene},
        world::{FlatScene, World},
    };

    /// Lambertian materials first, with a black one, and then others.
    fn materials() -> (usize, Vec<Material>) {
        let diffuse = |kd| Material { kd, ni: 1.5, d: 1.0, ns: 1.0, roughness: 1.0, ..Material::default() };
        let grey = diffuse(Vec3::splat(0.7));
        let lambertian = [grey, diffuse(vec3(0.9, 0.0, 0.1)), diffuse(Vec3::ZERO), diffuse(vec3(2.0, -1.0, 0.5))];
        let others = [
            Material { flags: MATERIAL_MICROFACET, ks: Vec3::ONE, roughness: 0.5, ..grey },
            Material { metallic: 1.0, roughness: 0.3, ..grey },
            Material { transmission: 1.0, ..grey },
            Material { ke: Vec3::X, ..grey },
            Material { clearcoat: 1.0, ..grey },
            Material { sheen_colour: Vec3::ONE, ..grey },
            Material { flags: MATERIAL_UNLIT, ..grey },
        ];
        (lambertian.len(), lambertian.into_iter().chain(others).collect())
    }

    /// A world of triangles of all materials, of which some have normals and some no area.
    fn world(lights: Vec<Light>, environment: Option<Environment>, random: &mut Uniform) -> World {
        let scene = Scene { lights, environment, ..Scene::empty(Path::new("scene")) };
        let mut scene = FlatScene::new(&scene).expect("a scene");
        let mut corner = || 4.0 * random.point() - 2.0;
        let triangle = |i: usize| {
            let v0 = corner();
            let v1 = if i % 31 == 30 { v0 } else { corner() };
            let normals = if i % 5 == 4 { [7, 8, 9] } else { [FLAT_NORMAL; 3] };
            Triangle { v0, v1, v2: corner(), n0: normals[0], n1: normals[1], n2: normals[2] }
        };
        scene.triangles = (0..300).map(triangle).collect::<Vec<_>>().into();
        scene.materials = materials().1;
        scene.material_names = vec![String::new(); scene.materials.len()];
        // Two of three triangles are Lambertian.
        let material_of = |i| if i % 3 < 2 { i % materials().0 } else { i % scene.materials.len() };
        scene.triangle_materials = (0..300).map(|i| material_of(i) as u32).collect::<Vec<_>>().into();
        World::of_flat(scene, &BuildOptions::default()).expect("a world")
    }

    fn sky(random: &mut Uniform) -> Environment {
        let colours = (0..32).map(|_| 2.0 * random.point()).collect();
        Environment::new([8, 4], colours, (30.0, 1.0)).expect("an environment").0
    }

    /// The lights of three scenes: none, one without a size, and area lights.
    fn lights() -> [Vec<Light>; 3] {
        let radiance = vec3(3.0, 2.0, 1.0);
        let areas = [
            Light::Rectangle { position: vec3(0.0, 0.0, 2.0), edge_u: 0.5 * Vec3::Y, edge_v: Vec3::X, radiance },
            Light::Disk { position: vec3(0.0, 2.0, 0.0), towards: Vec3::NEG_Y, radius: 0.7, radiance },
            Light::Sphere { position: vec3(0.5, -1.0, 0.5), radius: 0.4, radiance },
            Light::Sphere { position: vec3(-1.5, 0.0, 0.0), radius: 0.2, radiance },
        ];
        [Vec::new(), vec![Light::Point { position: Vec3::Z, intensity: radiance }], areas.to_vec()]
    }

    /// The buffers that a bounce writes.
    #[derive(Clone, Debug, PartialEq)]
    struct Paths {
        rays: Vec<PathRay>,
        states: Vec<PathState>,
        shadow_rays: Vec<ShadowRay>,
        flags: Vec<u32>,
        blocks: Vec<[u32; 2]>,
    }

    impl Paths {
        fn at_random(n: usize, random: &mut Uniform) -> Self {
            let ray = |random: &mut Uniform| PathRay {
                origin: 4.0 * random.point() - 2.0,
                direction: (random.point() - 0.5).normalize(),
                throughput: random.point(),
                t_max: f32::INFINITY,
                ..PathRay::zeroed()
            };
            Self {
                rays: (0..n).map(|_| ray(random)).collect(),
                states: (0..n).map(|_| PathState { radiance: random.point(), pdf: random.point().x }).collect(),
                shadow_rays: vec![ShadowRay::zeroed(); n],
                flags: vec![9; n],
                blocks: vec![[9; 2]; n.div_ceil(BLOCK_SIZE)],
            }
        }

        fn buffers(&mut self) -> (PathBuffers<'_>, (&mut [u32], &mut [[u32; 2]])) {
            let Self { rays, states, shadow_rays, flags, blocks } = self;
            (PathBuffers { rays, states, shadow_rays }, (flags, blocks))
        }

        /// Returns the bits of all floats, of which those of NaN are not told apart.
        fn bits(&self) -> Vec<u32> {
            let words = [bytemuck::cast_slice(&self.rays), bytemuck::cast_slice(&self.states)];
            let all =
                words.concat().into_iter().chain(bytemuck::cast_slice::<_, u32>(&self.shadow_rays).iter().copied());
            let all = all.chain(self.flags.clone()).chain(self.blocks.concat());
            all.map(|word: u32| if word & 0x7fff_ffff > 0x7f80_0000 { f32::NAN.to_bits() } else { word }).collect()
        }
    }

    fn hit_at_random(random: &mut Uniform, special: bool) -> Hit {
        let (weights, which) = (random.point(), random.point());
        let triangle_ix = if which.y < 0.1 { NO_TRIANGLE } else { (which.x * 300.0) as u32 };
        let sum = weights.x + weights.y + weights.z;
        let (u, v) = if special { (0.0, (which.z * 2.0).floor()) } else { (weights.x / sum, weights.y / sum) };
        Hit { t: 3.0 * which.z, triangle_ix, u, v }
    }

    #[test]
    fn paths_scatter_as_in_the_reference() {
        const N: usize = 3000;
        let mut random = Uniform(1);
        let (mut n_lambertian, mut n_going_on, mut n_shadow_rays) = (0, 0, 0);
        let scenes = lights().into_iter().flat_map(|lights| [0, 2, 3, 4].map(|depth| (lights.clone(), depth)));
        for (i, (lights, depth)) in scenes.enumerate() {
            let environment = (i % 2 == 1).then(|| sky(&mut random));
            let world = world(lights, environment, &mut random);
            let of_picture = world.frame_constants(&RenderOptions { max_depth: 5, ..RenderOptions::default() });
            let frame = Frame { samples_log2: 2, ..of_picture };
            let materials = &world.scene().materials;
            let inputs = &KernelInputs::new(&world, &frame).of_paths(materials, world.emitters());
            let batch = &Batch { n_pixels: N as u32 / 4, depth, ..Batch::default() };
            let mut expected = Paths::at_random(N, &mut random);
            let hits: Vec<_> = (0..N).map(|i| hit_at_random(&mut random, i % 9 == 0)).collect();
            let (pixels, are_lambertian) = (&pixels_of_batch(inputs, batch)[..], &lambertian_materials(inputs)[..]);
            let live: Vec<_> = (0..N as u32).filter(|i| i % 7 != 0).collect();
            expected.flags.truncate(live.len());
            expected.blocks.truncate(live.len().div_ceil(BLOCK_SIZE));
            let begun = expected.clone();
            let (paths, results) = expected.buffers();
            reference::path_scatter::path_scatter(inputs, batch, (&live, &hits), paths, results);
            for simd_level in [Level::new(), Level::baseline()] {
                let mut found = begun.clone();
                let (paths, results) = found.buffers();
                let bounce = BounceOfPaths { inputs, batch, pixels, are_lambertian, hits: &hits, simd_level };
                n_lambertian +=
                    hits.iter().filter(|hit| hit.triangle_ix != NO_TRIANGLE && bounce.is_lambertian(hit)).count();
                path_scatter(&bounce, &live, paths, results);
                assert!(found.bits() == expected.bits(), "depth {depth}");
                n_going_on += found.blocks.iter().map(|[n_going_on, _]| n_going_on).sum::<u32>();
                n_shadow_rays +=
                    found.shadow_rays.iter().filter(|shadow_ray| shadow_ray.state != SHADOW_RAY_NONE).count();
            }
        }
        assert!(
            n_lambertian > 10_000 && n_going_on > 10_000 && n_shadow_rays > 5000,
            "{n_lambertian} {n_going_on} {n_shadow_rays}"
        );
    }

    #[test]
    fn only_lambertian_materials_are_lambertian() {
        let (world, frame) = (world(Vec::new(), None, &mut Uniform(1)), Frame::default());
        let are_lambertian = lambertian_materials(&KernelInputs::new(&world, &frame));
        assert!(
            are_lambertian.iter().enumerate().all(|(i, &is_lambertian)| is_lambertian == (i < materials().0)),
            "{are_lambertian:?}"
        );
    }
}
