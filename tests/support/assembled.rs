//! Worlds, options and rays that a program might assemble, from bytes: a small valid scene with every kind of array, of
//! which the bytes change some words. Whatever they are, an engine returns pictures and hits, or errors of one line.
//! The fuzz target `world` and `tests/door.rs` share it.

#[path = "textured.rs"]
#[allow(dead_code)] // only the parts of the base scene are used
mod textured;

use std::sync::OnceLock;

use bytemuck::Pod;
use glam::{DQuat, DVec3, Vec3, vec3};
use kdray::{
    accel::{
        AccelOptions, Query,
        grid::{GridLevels, GridOptions},
        kdtree::{BuildOptions, Traversal},
    },
    cast::Ray,
    engine::{Engine, NoiseGoal},
    frame::{Crop, Denoise, Goal, Integrator, PathOptions, Primary, RenderOptions, SampleRange},
    scene::{Alpha, Camera, Channel, Environment, Light, Maps, Material, Texture, Transform},
    world::{FlatScene, World},
};
use textured::{add, add_image, empty, placed, rough, sphere, square};

/// What became of some bytes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Outcome {
    /// Whether they were a world.
    pub is_world: bool,
    /// Whether a picture was drawn.
    pub is_drawn: bool,
}

/// Assembles a world of the bytes, draws 8 x 8 pixels of it and casts some rays.
///
/// # Panics
/// An error is not one line, or a result has another size than was asked for.
pub fn check(engine: &Engine, bytes: &[u8]) -> Outcome {
    let mut bytes = Bytes(bytes);
    let (mut scene, accel) = (base().clone(), accel_options(&mut bytes));
    (0..bytes.below(5)).for_each(|_| change(&mut scene, &mut bytes));
    let Some(world) = line(World::with_accel(scene, &accel)) else { return Outcome::default() };
    cast(engine, &world, &mut bytes);
    Outcome { is_world: true, is_drawn: draw(engine, &world, &mut bytes).is_some() }
}

/// Returns the value. Of an error, checks the text.
fn line<T, E: std::fmt::Display>(result: Result<T, E>) -> Option<T> {
    result.map_err(|error| assert_eq!(error.to_string().lines().count(), 1, "{error}")).ok()
}

/// Bytes that are taken one after the other. When none are left, they are 0.
struct Bytes<'a>(&'a [u8]);

impl Bytes<'_> {
    fn byte(&mut self) -> u8 {
        let Some((first, rest)) = self.0.split_first() else { return 0 };
        self.0 = rest;
        *first
    }

    fn below(&mut self, n: usize) -> usize {
        usize::from(self.byte()) % n
    }

    fn any_word(&mut self) -> u32 {
        u32::from_le_bytes([(); 4].map(|()| self.byte()))
    }

    /// A word that is `old`, near to it, or at some limit.
    fn word(&mut self, old: u32) -> u32 {
        const SPECIAL: [u32; 8] = [0, 1, 2, 16, 255, 1 << 31, u32::MAX - 1, u32::MAX];
        match self.below(8) {
            0 => old.wrapping_add(1),
            1 => old.wrapping_sub(1),
            2 => old ^ 1 << self.below(32),
            3 => self.float(f32::from_bits(old)).to_bits(),
            4 => self.any_word(),
            _ => SPECIAL[self.below(SPECIAL.len())],
        }
    }

    fn float(&mut self, usual: f32) -> f32 {
        const SPECIAL: [f32; 12] =
            [0.0, -0.0, 1.0, -1.0, 0.5, f32::NAN, f32::INFINITY, f32::NEG_INFINITY, 1e-45, f32::MAX, f32::MIN, 1e9];
        match self.below(16) {
            ix if ix < SPECIAL.len() => SPECIAL[ix],
            12 => f32::from_bits(self.any_word()),
            _ => usual,
        }
    }

    fn vector(&mut self, usual: Vec3) -> Vec3 {
        Vec3::from_array(usual.to_array().map(|x| self.float(x)))
    }

    /// A float that is the usual one most times.
    fn seldom(&mut self, usual: f32) -> f32 {
        if self.below(8) == 7 { self.float(usual) } else { usual }
    }
}

/// Returns a scene with every kind of array.
fn base() -> &'static FlatScene {
    static BASE: OnceLock<FlatScene> = OnceLock::new();
    BASE.get_or_init(|| {
        let mut scene = empty();
        let checks = add_image(&mut scene, [4, 2], |x, y| [(60 * x) as u8, (99 * y) as u8, 200, (80 * x) as u8]);
        let colour = Texture::of_image(checks);
        let second = Texture { uv_set: 1, ..Texture::of_data(checks, Channel::Green) };
        let (base_colour, normal) = (Some(colour.clone()), Some(Texture::of_data(checks, Channel::Red)));
        let maps = Maps { base_colour, normal, roughness: Some(second), emission: Some(colour), ..Maps::default() };
        let ke = Vec3::splat(0.2);
        let shining = Material { ke, maps: maps.clone(), alpha: Alpha::Mask(0.3), ..rough(Vec3::ONE) };
        let turned = Transform::new(DVec3::ONE, DQuat::from_rotation_x(-1.0), DVec3::new(0.0, -0.5, 0.0));
        let mut painted = sphere(2);
        painted.colours = painted.normals.iter().map(|n| n.map(|n| n.abs().extend(0.7))).collect();
        add(&mut scene, square(), turned.expect("a transform"), shining);
        add(&mut scene, painted, placed(0.6, DVec3::new(0.3, 0.2, 0.4)), Material { maps, ..rough(Vec3::ONE) });
        let (position, radiance) = (vec3(0.0, 2.0, 1.0), Vec3::ONE);
        scene.lights = vec![
            Light::Point { position, intensity: Vec3::ONE },
            Light::Directional { towards: Vec3::Y, irradiance: Vec3::ONE },
            Light::Sun { towards: Vec3::Z, irradiance: Vec3::ONE, angle_degrees: 3.0 },
            Light::Sphere { position, radius: 0.3, radiance },
            Light::Disk { position, towards: Vec3::NEG_Y, radius: 0.3, radiance },
            Light::Rectangle { position, edge_u: vec3(0.2, 0.0, 0.0), edge_v: vec3(0.0, 0.0, 0.2), radiance },
        ];
        let sky = Environment::new([4, 2], (0..8).map(|i| Vec3::splat(i as f32)).collect(), (20.0, 1.0));
        scene.environment = Some(sky.expect("an environment").0);
        FlatScene::new(&scene).expect("a scene that fits together")
    })
}

/// Changes one thing of a scene.
fn change(scene: &mut FlatScene, bytes: &mut Bytes) {
    let textures = &mut scene.textures;
    match bytes.below(15) {
        0 => change_array(&mut scene.triangles, bytes),
        1 => change_array(&mut scene.triangle_materials, bytes),
        2 => change_array(&mut scene.materials, bytes),
        3 => change_array(&mut scene.lights, bytes),
        4 => change_array(&mut scene.area_lights, bytes),
        5 => change_array(&mut textures.texels, bytes),
        6 => change_array(&mut textures.textures, bytes),
        7 => change_array(&mut textures.material_maps, bytes),
        8 => change_array(&mut textures.uvs, bytes),
        9 => change_array(&mut textures.corners, bytes),
        10 => textures.n_triangles = bytes.word(textures.n_triangles as u32) as usize,
        11 => scene.camera = camera(&scene.camera, bytes),
        12 => {
            (scene.ambient, scene.background) = (bytes.vector(scene.ambient), bytes.vector(scene.background));
            scene.studio = (bytes.below(2) == 1).then(|| bytes.vector(Vec3::Z));
        }
        13 => {
            let size = [bytes.word(4), bytes.word(2)];
            let colours = (0..8).map(|_| bytes.vector(Vec3::ONE)).collect();
            let made = line(Environment::new(size, colours, (bytes.float(0.0), bytes.float(1.0))));
            scene.environment = made.map(|(environment, _)| environment);
        }
        _ => _ = scene.material_names.pop(),
    }
}

/// Changes a word of an array, or its length.
fn change_array<T: Pod>(array: &mut Vec<T>, bytes: &mut Bytes) {
    let Some(last) = array.last().copied() else { return };
    match bytes.below(8) {
        0 => _ = array.pop(),
        1 => array.push(last),
        2 => array.clear(),
        _ => {
            let words: &mut [u32] = bytemuck::cast_slice_mut(array);
            let ix = (bytes.byte() as usize | bytes.below(4) << 8) % words.len();
            words[ix] = bytes.word(words[ix]);
        }
    }
}

fn camera(usual: &Camera, bytes: &mut Bytes) -> Camera {
    let [eye, target, up] = [usual.eye, usual.target, usual.up].map(|point| bytes.vector(point));
    Camera { eye, target, up, ..*usual }
}

fn accel_options(bytes: &mut Bytes) -> AccelOptions {
    let max_references_per_triangle = if bytes.below(8) == 7 { bytes.word(16) } else { 16 };
    match bytes.below(8) {
        0 => {
            let levels = GridLevels::Uniform { density: bytes.seldom(4.0) };
            AccelOptions::Grid(GridOptions { levels, max_references_per_triangle, ..GridOptions::uniform() })
        }
        1 => {
            let levels = GridLevels::Two { upper_density: bytes.seldom(0.1), lower_density: bytes.seldom(2.0) };
            AccelOptions::Grid(GridOptions { levels, max_references_per_triangle, ..GridOptions::uniform() })
        }
        kind => AccelOptions::KdTree(BuildOptions {
            traversal_cost: bytes.seldom(1.0),
            intersection_cost: bytes.seldom(0.5),
            empty_bonus: bytes.seldom(0.0),
            max_depth: (kind == 2).then(|| bytes.word(3)),
            max_references_per_triangle,
            exact_planes: kind != 3,
            slabs: kind != 4,
        }),
    }
}

fn cast(engine: &Engine, world: &World, bytes: &mut Bytes) {
    let ray = |bytes: &mut Bytes| Ray {
        origin: bytes.vector(vec3(0.1, 0.2, 4.0)),
        t_min: bytes.seldom(0.0),
        direction: bytes.vector(Vec3::NEG_Z),
        t_max: bytes.seldom(f32::INFINITY),
    };
    let rays: Vec<Ray> = (0..bytes.below(5)).map(|_| ray(bytes)).collect();
    let query = if bytes.below(2) == 0 { Query::Closest } else { Query::Any };
    let Some(mut caster) = line(engine.caster(world.geometry(), Traversal::Stack)) else { return };
    if bytes.below(4) == 3 {
        let Some(hiding) = line(caster.hiding(&[bytes.word(3)])) else { return };
        caster = hiding;
    }
    let n_times = if bytes.below(32) == 31 { u32::MAX } else { 1 };
    if let Some(cast) = line(caster.cast(&rays, query, n_times)) {
        let n_triangles = world.scene().triangles.len();
        let is_right = |ix: u32| ix == kdray::cast::NO_TRIANGLE || (ix as usize) < n_triangles;
        assert!(cast.hits.len() == rays.len() && cast.hits.iter().all(|hit| is_right(hit.triangle_ix)));
    }
}

fn options(bytes: &mut Bytes) -> RenderOptions {
    let side = |bytes: &mut Bytes| if bytes.below(16) == 15 { [0, 1, 5, u32::MAX][bytes.below(4)] } else { 8 };
    let integrator = if bytes.below(2) == 0 { Integrator::Whitted } else { Integrator::Path };
    let crop = |bytes: &mut Bytes| {
        let [x0, y0, x1, y1] = [0, 0, 8, 8].map(|usual| bytes.word(usual));
        Crop { x0, y0, x1, y1 }
    };
    let denoise = [Denoise::Off, Denoise::Edge, Denoise::Off, Denoise::Paper { threshold: bytes.seldom(0.5) }];
    RenderOptions {
        width: side(bytes),
        height: side(bytes),
        crop: (bytes.below(8) == 7).then(|| crop(bytes)),
        integrator,
        max_depth: if bytes.below(16) == 15 { bytes.word(64).min(65) } else { 3 },
        exposure: bytes.seldom(1.0),
        denoise: denoise[bytes.below(4)],
        primary: if bytes.below(4) == 0 { Primary::Raster } else { Primary::Trace },
        traversal: Traversal::Stack,
        pixel_aovs: bytes.below(8) == 7,
        light_layers: bytes.below(8) == 7,
        surface_layers: bytes.below(8) == 6,
        approximates_ambient: bytes.below(4) == 3,
        paths: PathOptions {
            seed: if bytes.below(16) == 15 { bytes.word(1 << 15) } else { 0 },
            first_sample: if bytes.below(16) == 15 { bytes.word(16) } else { 0 },
            clamp: bytes.seldom(f32::INFINITY),
            aperture: bytes.seldom(0.0),
            focus: (bytes.below(8) == 7).then(|| bytes.float(2.0)),
            ..PathOptions::default()
        },
        profile: false,
        ..RenderOptions::default()
    }
}

/// Draws a picture, a range of samples, or a picture of low noise.
fn draw(engine: &Engine, world: &World, bytes: &mut Bytes) -> Option<()> {
    let options = options(bytes);
    let mut renderer = line(engine.renderer(world, &options))?;
    let view = world.scene().camera;
    let view = if bytes.below(8) == 7 { camera(&view, bytes) } else { view };
    // Many samples take long.
    let few = |n: u32| if n > 64 && n <= SampleRange::MOST { 64 } else { n };
    let n_pixels = |n: usize| {
        let crop = options.crop_or_whole();
        assert_eq!(n, crop.width() as usize * crop.height() as usize);
    };
    match bytes.below(16) {
        14 => {
            let (first, end) = (bytes.word(16), few(bytes.word(32)));
            line(renderer.draw_range(&view, SampleRange { first, end }, || ()))?;
        }
        15 => {
            let goal = NoiseGoal { noise: bytes.float(0.5), most_samples: few(bytes.word(31)) };
            let noisy = line(renderer.draw_until(&view, goal, || ()))?;
            n_pixels(noisy.picture.display.len());
            return Some(());
        }
        n => _ = line(renderer.draw(&view, Goal::Samples([1, 2, 0, u32::MAX][n % 4]), || ()))?,
    }
    n_pixels(line(renderer.picture())?.display.len());
    Some(())
}
