//! Tests that what a program assembles is checked before a kernel reads it: each wrong world, option or query gives an
//! error that names what is wrong, on the device and on the CPU.

#![allow(clippy::duplicate_mod, reason = "the fuzz target takes `assembled` without `support`")]

#[path = "support/assembled.rs"]
mod assembled;
mod support;

use std::time::Duration;

use glam::{Vec2, Vec3};
use kdray::{
    accel::{
        Accel, AccelOptions, Query,
        grid::{GridLevels, GridOptions, LazyGrid},
        kdtree::{BuildOptions, KdTree, Traversal},
    },
    cast::{CpuCaster, Ray},
    engine::{Engine, NoiseGoal},
    frame::{Crop, Denoise, Goal, Integrator, NoiseTileSamples, NoiseTiles, RenderOptions, SampleRange},
    gpu::DeviceOverrides,
    layout::{
        AREA_SPHERE, AreaLight, LIGHT_SPOT, MaterialMaps, NO_TEXTURE, TEXTURE_HALVES, TEXTURE_UV_SET, Texture, Triangle,
    },
    scene::{Camera, Environment, Projection},
    world::{FlatScene, Geometry, World},
};
use support::{assert_silent, device, meshes, pretended, random::Random, scenes, textured, world_of};

/// A change of a scene, and the beginning of the error that it leads to.
type Change = (&'static str, fn(&mut FlatScene));

/// Changes of a textured scene, each of which breaks one thing. `#` stands for any number.
const CHANGES: &[Change] = &[
    ("triangle_materials has # entries for # triangles", |it| _ = it.triangle_materials.pop()),
    ("triangle 7 has material 4294967295, but there are # materials", |it| it.triangle_materials[7] = u32::MAX),
    ("material_names has # entries for # materials", |it| _ = it.material_names.pop()),
    ("material_maps has # entries for # materials", |it| {
        it.materials.push(scenes::BLACK);
        it.material_names.push("one more".to_owned());
    }),
    ("material_maps has # entries for # materials", |it| it.textures.material_maps.clear()),
    ("triangles: a corner of triangle 5 lies beyond 1e9", |it| it.triangles[5].v1.y = f32::NAN),
    ("triangles: a corner of triangle 6 lies beyond 1e9", |it| it.triangles[6].v2.z = f32::NEG_INFINITY),
    ("triangles: a corner of triangle 0 lies beyond 1e9", |it| it.triangles[0].v0.x = -1.1e9),
    ("texels has 255 words, but its table of sRGB takes 256", |it| it.textures.texels.truncate(255)),
    ("textures are of # triangles, not of #", |it| it.textures.n_triangles -= 1),
    ("textures are of 4294967296 triangles, not of #", |it| it.textures.n_triangles = 1 << 32),
    ("corners has # entries for # triangles", |it| _ = it.textures.corners.pop()),
    ("uvs has # entries for # triangles", |it| _ = it.textures.uvs.pop()),
    ("uvs has # entries for # triangles", |it| it.textures.uvs.push([Vec2::ZERO; 3])),
    ("textures: texture 0 has 0 x 16 texels", |it| it.textures.textures[0].size &= 0xffff_0000),
    ("textures: texture 1 has # x 0 texels", |it| it.textures.textures[1].size &= 0xffff),
    ("textures: texture 0 has 0 mip levels, not 1 to 5", |it| it.textures.textures[0].n_mips = 0),
    ("textures: texture 0 has 6 mip levels, not 1 to 5", |it| it.textures.textures[0].n_mips = 6),
    ("textures: texture 0 has texels of mip level 0 behind the # words of texels", |it| {
        it.textures.textures[0].first_texel = u32::MAX;
    }),
    ("textures: texture 0 has texels of mip level 0 behind the # words of texels", |it| {
        it.textures.textures[0].size = 0xffff_ffff;
    }),
    ("textures: texture 0 has texels of mip level 2 behind the # words of texels", |it| {
        let mip = it.textures.textures[0].first_texel as usize + 2;
        it.textures.texels[mip] = it.textures.texels.len() as u32 - 15;
    }),
    ("textures: texture # has texels of mip level # behind the # words of texels", |it| {
        it.textures.textures.last_mut().unwrap().flags |= TEXTURE_HALVES;
    }),
    ("textures: texture # has texels of mip level # behind the # words of texels", |it| _ = it.textures.texels.pop()),
    ("textures: texture 2 uses the second set of texture coordinates, but uvs has only the first", |it| {
        it.textures.textures[2].flags |= TEXTURE_UV_SET;
    }),
    ("material_maps: material 3 has texture #, but there are # textures", |it| {
        it.textures.material_maps[3].emission = it.textures.textures.len() as u32;
    }),
    ("material_maps: material 0 has texture 4294967294, but there are # textures", |it| {
        it.textures.material_maps[0].base_colour = NO_TEXTURE - 1;
    }),
    ("material_maps: material 1 has texture 77, but there are # textures", |it| {
        it.textures.material_maps[1].occlusion = 77;
    }),
    ("lights: light 1 is of kind 3, not 0 to 2", |it| it.lights[1].kind = LIGHT_SPOT + 1),
    ("area_lights: light 0 is of kind 3, not 0 to 2", |it| {
        it.area_lights.push(AreaLight { kind: AREA_SPHERE + 1, ..AreaLight::default() });
    }),
    ("camera: eye is [NaN, 0.0, 4.0], which is not finite", |it| it.camera.eye.x = f32::NAN),
    ("camera: up points along the view", |it| it.camera.up = it.camera.eye - it.camera.target),
    ("camera: up points along the view, or eye and target are one point", |it| it.camera.target = it.camera.eye),
    ("camera: vertical_fov_degrees is 180, not above 0 and below 180", |it| {
        it.camera.projection = Projection::Perspective { vertical_fov_degrees: 180.0 };
    }),
    ("camera: height is inf, not a finite number above 0", |it| {
        it.camera.projection = Projection::Orthographic { height: f32::INFINITY };
    }),
    ("defaults: width is 0, not 1 to 16384", |it| it.defaults.width = 0),
    ("defaults: max_depth is 0, not 1 to 64", |it| it.defaults.of_paths.max_depth = 0),
    ("defaults: exposure is NaN, not a finite number above 0", |it| it.defaults.exposure = f32::NAN),
];

/// Replaces each run of digits by `#`.
fn without_numbers(text: &str) -> String {
    let mut out = String::new();
    for c in text.chars() {
        match c {
            '0'..='9' if out.ends_with('#') => {}
            '0'..='9' => out.push('#'),
            c => out.push(c),
        }
    }
    out
}

/// Whether an error begins as expected, whose numbers count unless they are `#`.
fn agrees(error: &str, expected: &str) -> bool {
    let words = |text: &str| text.split(' ').map(str::to_owned).collect::<Vec<_>>();
    let is_alike = |(found, word): (&String, &String)| {
        found == word || (word.contains('#') && without_numbers(found) == *word) || found.starts_with(word.as_str())
    };
    words(error).len() >= words(expected).len() && words(error).iter().zip(&words(expected)).all(is_alike)
}

/// Each broken scene is refused by every way into a world, and the error names the array and the element.
#[test]
fn a_scene_with_one_thing_wrong_is_refused() {
    let (good, options) = (textured::every_kind(), BuildOptions::default());
    assert!(World::of_flat(good.clone(), &options).is_ok());
    let tree = KdTree::build(&good.triangles, &options);
    for (expected, change) in CHANGES {
        let mut scene = good.clone();
        change(&mut scene);
        let errors = [
            World::of_flat(scene.clone(), &options).map(drop),
            World::with_accel(scene.clone(), &AccelOptions::Grid(GridOptions::uniform())).map(drop),
            World::with_tree(scene.clone(), tree.clone(), &options).map(drop),
        ];
        for error in errors {
            let error = error.expect_err(expected).to_string();
            assert!(agrees(&error, expected) && error.lines().count() == 1, "{error}, not {expected}");
        }
    }
    assert!(!agrees("uvs has 3 entries", "uvs has 4 entries") && !agrees("a 1", "a # b"), "the comparison can fail");
}

/// What kernels may read stays allowed: a scene with fewer mip levels, a texture that no material has, both sets of
/// texture coordinates, and colours that are no numbers.
#[test]
fn unusual_scenes_are_drawn() {
    let mut scene = textured::every_kind();
    let textures = &mut scene.textures;
    textures.textures[0].n_mips = 1;
    let second = textures.textures[1];
    textures.textures.push(Texture { flags: TEXTURE_UV_SET | 7 << 8 | 15, ..second });
    textures.uvs.extend_from_within(..);
    textures.uvs[3] = [Vec2::splat(f32::NAN), Vec2::splat(f32::MAX), Vec2::splat(f32::NEG_INFINITY)];
    let last = textures.textures.len() as u32 - 1;
    let maps = MaterialMaps {
        base_colour: last,
        opacity: last,
        specular: last,
        specular_factor: last,
        emission: last,
        normal: last,
        roughness: last,
        metallic: last,
        transmission: last,
        occlusion: last,
        flags: u32::MAX,
        ..textures.material_maps[2]
    };
    textures.material_maps[2] = maps;
    scene.materials[1].flags = u32::MAX;
    scene.materials[2].roughness = f32::NAN;
    scene.materials[3].ke = Vec3::splat(f32::INFINITY);
    scene.lights[0].position = Vec3::NAN;
    scene.lights[1].intensity = Vec3::INFINITY;
    for kind in 0..=AREA_SPHERE {
        let (radiance, edge_u) = (Vec3::splat(f32::MAX), Vec3::NAN);
        scene.area_lights.push(AreaLight { kind, radiance, edge_u, leaf_ix: 9999, ..AreaLight::default() });
    }
    draw_everywhere(&scene);
}

/// A scene with a light tree whose area lights name leaves that do not exist. Those that are never picked have no leaf
/// of their own, and a search for it would not end.
#[test]
fn a_leaf_of_a_light_is_not_taken_from_the_scene() {
    let mut scene = scenes::mixed();
    let lamp = |i: u32| AreaLight {
        kind: AREA_SPHERE,
        position: 2.0 * Vec3::new((i as f32).sin(), 1.0, (i as f32).cos()),
        radius: 0.01,
        radiance: if i.is_multiple_of(3) { Vec3::ZERO } else { Vec3::ONE },
        area: 1e-3,
        leaf_ix: 1 << 20,
        probability: f32::NAN,
        ..AreaLight::default()
    };
    scene.area_lights = (0..600).map(lamp).collect();
    let world = world_of(&scene);
    let emitters = world.emitters();
    assert!(emitters.has_tree());
    let n_nodes = emitters.light_nodes.len() as u32;
    assert!(emitters.shapes().iter().all(|light| light.leaf_ix < n_nodes && light.probability >= 0.0));
    draw_everywhere(&scene);
}

/// Draws a small picture of a scene by both integrators, on the CPU and on a device under validation.
fn draw_everywhere(scene: &FlatScene) {
    let context = device();
    for engine in [Engine::on_cpu(), Engine::on_device(context.clone())] {
        let world = world_of(scene);
        for integrator in [Integrator::Whitted, Integrator::Path] {
            engine.render(&world, &RenderOptions { integrator, ..small() }).expect("a picture");
        }
    }
    assert_silent(&context);
}

fn small() -> RenderOptions {
    RenderOptions { width: 12, height: 9, max_depth: 3, denoise: Denoise::Off, ..RenderOptions::default() }
}

#[test]
fn structures_are_built_by_options_in_range() {
    let scene = scenes::mixed();
    let tree = BuildOptions::default;
    let of_grid = |levels| AccelOptions::Grid(GridOptions { levels, ..GridOptions::uniform() });
    let uniform = |density| of_grid(GridLevels::Uniform { density });
    let two = |upper_density, lower_density| of_grid(GridLevels::Two { upper_density, lower_density });
    let wrong = [
        ("traversal_cost is -1, ", AccelOptions::KdTree(BuildOptions { traversal_cost: -1.0, ..tree() })),
        ("intersection_cost is NaN, ", AccelOptions::KdTree(BuildOptions { intersection_cost: f32::NAN, ..tree() })),
        (
            "intersection_cost is inf, ",
            AccelOptions::KdTree(BuildOptions { intersection_cost: f32::INFINITY, ..tree() }),
        ),
        ("empty_bonus is 1.5, not 0e0 to 1e0", AccelOptions::KdTree(BuildOptions { empty_bonus: 1.5, ..tree() })),
        ("density is NaN, ", uniform(f32::NAN)),
        ("density is 0, ", uniform(0.0)),
        ("density is 1000000, ", uniform(1e6)),
        ("upper_density is -1, ", two(-1.0, 1.0)),
        ("lower_density is inf, ", two(1.0, f32::INFINITY)),
    ];
    for (expected, options) in wrong {
        let error = World::with_accel(scene.clone(), &options).expect_err(expected).to_string();
        assert!(error.starts_with(expected), "{error}, not {expected}");
    }
    let odd = BuildOptions { traversal_cost: 0.0, max_references_per_triangle: u32::MAX, ..tree() };
    assert!(World::with_accel(scene, &AccelOptions::KdTree(odd)).is_ok());
}

/// Structures are built over any triangles, and rays through them end.
#[test]
fn any_triangles_can_be_cast_at() {
    let mut triangles = meshes::soup(60, 3);
    let wrong = [f32::NAN, f32::INFINITY, f32::MAX, f32::MIN, 1e30, 1e-45];
    for (ix, wrong) in wrong.into_iter().enumerate() {
        triangles[3 * ix].v0.x = wrong;
        triangles[3 * ix + 1].v1 = Vec3::splat(wrong);
        let corner = Vec3::splat(wrong);
        triangles[3 * ix + 2] = Triangle { v0: corner, v1: corner, v2: corner, ..Triangle::default() };
    }
    let special = [0.0, 1.0, -1e30, f32::MAX, f32::NAN, f32::INFINITY, f32::NEG_INFINITY];
    let ray = |ix: usize| {
        let at = |place: usize| special[ix / 7_usize.pow(place as u32 % 4) % 7];
        let [origin, direction] = [0, 2].map(|place| Vec3::new(at(place), at(place + 1), 0.5));
        Ray { origin, t_min: at(1), direction, t_max: at(3) }
    };
    let rays: Vec<Ray> = (0..2401).map(ray).collect();
    let tree = Accel::KdTree(KdTree::build(&triangles, &BuildOptions::default()));
    let grids = [GridOptions::uniform(), GridOptions::two_level()];
    let grids = grids.map(|options| Accel::Grid(LazyGrid::new(&triangles, options)));
    for accel in [&tree, &grids[0], &grids[1]] {
        let geometry = Geometry::new(&triangles, accel).expect("a structure of these triangles");
        for query in [Query::Closest, Query::Any] {
            let hits = CpuCaster::new(geometry, Traversal::OF_CPU).cast(&rays, query);
            assert_eq!(hits.len(), rays.len());
        }
    }
}

#[test]
fn an_environment_has_numbers() {
    let made = |rotation, strength| Environment::new([2, 1], vec![Vec3::ONE; 2], (rotation, strength));
    assert!(made(1e9, 0.0).is_ok());
    for (rotation, strength) in
        [(f32::NAN, 1.0), (f32::INFINITY, 1.0), (0.0, f32::NAN), (0.0, -1.0), (0.0, f32::INFINITY)]
    {
        assert!(made(rotation, strength).is_err(), "{rotation}, {strength}");
    }
}

/// What every engine refuses with the same words: a device, several, and the CPU.
#[test]
fn engines_refuse_options_and_cameras() {
    let (context, second) = (device(), device());
    let world = world_of(&scenes::mixed());
    let engines = [
        Engine::on_cpu(),
        Engine::on_device(context.clone()),
        Engine::on_devices(vec![context.clone(), second.clone()]),
        Engine::on_devices(Vec::<kdray::gpu::Device>::new()),
    ];
    for engine in engines {
        let refusal = |options: &RenderOptions| {
            let renderer = engine.renderer(&world, options).map(drop).expect_err("a refusal").to_string();
            let render = engine.render(&world, options).map(drop).expect_err("a refusal").to_string();
            assert_eq!(renderer, render);
            renderer
        };
        assert_eq!(refusal(&RenderOptions { max_depth: 0, ..small() }), "max_depth is 0, not 1 to 64");
        assert_eq!(refusal(&RenderOptions { width: 0, ..small() }), "width is 0, not 1 to 16384");
        let crop = Some(Crop { x0: 4, x1: 2, y0: 0, y1: 1 });
        assert_eq!(refusal(&RenderOptions { crop, ..small() }), "crop is 4,0,2,1, not pixels of a picture of 12x9");
        let mut renderer = engine.renderer(&world, &small()).expect("a renderer");
        let mut draw = |camera: &Camera, goal| renderer.draw(camera, goal, || ()).map(drop).unwrap_err().to_string();
        let camera = world.scene().camera;
        let lost = Camera { eye: Vec3::NAN, ..camera };
        assert!(draw(&lost, Goal::Samples(1)).starts_with("camera: eye is [NaN, NaN, NaN]"));
        assert_eq!(draw(&camera, Goal::Samples(u32::MAX)), "samples is 4294967295, not at most 65536");
        let range = SampleRange { first: 5, end: 9 };
        let error = renderer.draw_range(&camera, range, || ()).map(drop).unwrap_err().to_string();
        assert!(error.starts_with("sample range is 5-9, not samples"), "{error}");
        let goal = NoiseGoal { noise: 0.1, most_samples: 64 };
        let error = renderer.draw_until(&camera, goal, || ()).map(drop).unwrap_err().to_string();
        assert!(error.starts_with("pictures of low noise need the integrator path"), "{error}");
        renderer.draw(&camera, Goal::Samples(1), || ()).expect("a picture after errors");
    }
    assert_silent(&context);
    assert_silent(&second);
}

#[test]
fn goals_of_noise_have_a_range() {
    let goal = |noise, most_samples| NoiseGoal { noise, most_samples }.check();
    assert!(goal(0.01, 32).is_ok() && goal(1e-9, 65_536).is_ok());
    for (noise, most_samples) in [(f32::NAN, 64), (0.0, 64), (-1.0, 64), (f32::INFINITY, 64)] {
        assert!(goal(noise, most_samples).unwrap_err().to_string().starts_with("noise is "));
    }
    for most_samples in [0, 16, 48, 1 << 17, 1 << 31, u32::MAX] {
        let error = goal(0.1, most_samples).unwrap_err().to_string();
        assert!(error.ends_with("not a power of two from 32 to 65536"), "{error}");
    }
}

#[test]
fn tiles_that_do_not_fit_together_are_refused() {
    let tile = |x, first, end| NoiseTileSamples { place: glam::uvec2(x, 0), samples: SampleRange { first, end } };
    assert!(NoiseTiles::new(&[tile(0, 0, 16), tile(4095, 16, 32)]).is_ok());
    let wrong: [&[NoiseTileSamples]; 8] = [
        &[],
        &[tile(0, 0, 0)],
        &[tile(0, 16, 0)],
        &[tile(0, 0, 12)],
        &[tile(0, 8, 24)],
        &[tile(4096, 0, 16)],
        &[tile(0, 0, 16), tile(0, 16, 48)],
        &[tile(0, 0, 16), tile(0, 16 << 8, (16 << 8) + 16)],
    ];
    for tiles in wrong {
        let error = NoiseTiles::new(tiles).expect_err("a refusal").to_string();
        assert!(error.starts_with("noise_tiles: "), "{error}");
    }
    assert!(NoiseTiles::new(&vec![tile(0, 0, 16); NoiseTiles::MOST + 1]).is_err());
}

#[test]
fn casters_refuse_what_is_not_there() {
    let context = device();
    let world = world_of(&scenes::mixed());
    let n = world.scene().triangles.len() as u32;
    for engine in [Engine::on_cpu(), Engine::on_device(context.clone())] {
        let caster = || engine.caster(world.geometry(), Traversal::Stack).expect("a caster");
        let error = caster().hiding(&[0, n]).map(drop).expect_err("a refusal").to_string();
        assert_eq!(error, format!("triangle {n} cannot be hidden: there are {n} triangles"));
        let mut caster = caster().hiding(&[0, n - 1, 0]).expect("a caster");
        let ray = Ray { origin: Vec3::ZERO, t_min: 0.0, direction: Vec3::X, t_max: 1.0 };
        let error = caster.cast(&[ray], Query::Any, u32::MAX).map(drop).expect_err("a refusal").to_string();
        assert_eq!(error, "n_times is 4294967295, not at most 10000");
        assert_eq!(caster.cast(&[ray], Query::Any, 0).expect("hits").hits.len(), 1);
        assert_eq!(caster.cast(&[], Query::Closest, 3).expect("no hits").hits.len(), 0);
    }
    let film = Engine::on_cpu().film_renderer(&world, &small()).map(drop).expect_err("a refusal");
    assert_eq!(film.to_string(), "device `CPU` lacks renderers of films");
    assert_silent(&context);
}

/// A dispatch of shadow rays has a row of workgroups for each light. Paths sample one light at a time.
#[test]
fn more_lights_than_workgroups_are_refused() {
    let context = device();
    let mut scene = scenes::mixed();
    let n = context.limits().n_groups as usize + 1;
    scene.lights = vec![scene.lights[0]; n];
    let (world, engine) = (world_of(&scene), Engine::on_device(context.clone()));
    let error = engine.renderer(&world, &small()).map(drop).expect_err("a refusal").to_string();
    assert!(error.starts_with(&format!("lights of the integrator whitted: {n} is beyond")), "{error}");
    engine.render(&world, &RenderOptions { integrator: Integrator::Path, ..small() }).expect("a picture");
    assert_silent(&context);
}

#[test]
fn a_time_of_any_length_is_a_goal() {
    let world = world_of(&scenes::mixed());
    let mut renderer = Engine::on_cpu().renderer(&world, &small()).expect("a renderer");
    let drawn = renderer.draw(&world.scene().camera, Goal::Time(Duration::ZERO), || ()).expect("a picture");
    assert_eq!(drawn.n_samples, 1);
}

/// Assembles worlds, options and rays from random bytes. Returns how many were a world, and how many were drawn.
fn assemble(engine: &Engine, seeds: std::ops::Range<u64>) -> [u32; 2] {
    let mut counts = [0; 2];
    for seed in seeds {
        let mut random = Random(seed);
        let bytes: Vec<u8> = (0..200).map(|_| random.below(256) as u8).collect();
        let outcome = assembled::check(engine, &bytes);
        counts[0] += u32::from(outcome.is_world);
        counts[1] += u32::from(outcome.is_drawn);
    }
    counts
}

/// The seeds of `assemble`: `KDRAY_DOOR_SEEDS`, as `A-B`, or the first 2000.
fn seeds() -> std::ops::Range<u64> {
    let range = std::env::var("KDRAY_DOOR_SEEDS").unwrap_or_else(|_| "0-2000".to_owned());
    let ends = range.split_once('-').and_then(|(first, end)| Some(first.parse().ok()?..end.parse().ok()?));
    ends.expect("KDRAY_DOOR_SEEDS=A-B")
}

/// A short run of what the fuzz target `world` does for long.
#[test]
fn whatever_is_assembled_ends() {
    let seeds = seeds();
    let n = (seeds.end - seeds.start) as u32;
    let [n_worlds, n_drawn] = assemble(&Engine::on_cpu(), seeds);
    println!("{n} inputs: {n_worlds} worlds, {n_drawn} pictures");
    assert!(n_worlds > n / 4 && n_drawn > n / 10, "of {n}, {n_worlds} were worlds and {n_drawn} were drawn");
}

/// The same on a device that validates, whose kernels have no bounds checks.
#[test]
#[ignore = "compiles kernels for an hour"]
fn whatever_is_assembled_ends_on_a_device() {
    let context = device();
    let [n_worlds, n_drawn] = assemble(&Engine::on_device(context.clone()), seeds());
    println!("{n_worlds} worlds, {n_drawn} pictures");
    assert_silent(&context);
}

/// A device that checks bounds draws the same pictures.
#[test]
fn bounds_checks_change_no_picture() {
    let checked = pretended(DeviceOverrides { bounds_checks: true, ..DeviceOverrides::default() });
    let world = world_of(&textured::every_kind());
    let [a, b] = [device(), checked].map(|context| {
        let picture = Engine::on_device(context.clone()).render(&world, &small()).expect("a picture").picture;
        assert_silent(&context);
        picture
    });
    assert_eq!(a, b);
}
