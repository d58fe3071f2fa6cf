//! Tests of the kernel path_scatter against its twin: the light at the hits of paths, the shadow rays to lights, and
//! the rays with which they go on.

use std::f32::consts::PI;

use glam::{Vec3, vec3};
use kdray::{
    layout::{
        AREA_DISK, AREA_RECTANGLE, AREA_SPHERE, AreaLight, Batch, MATERIAL_CONDUCTOR, MATERIAL_MICROFACET,
        MATERIAL_SOLID, Material, PathRay, PathState, SCAN_GROUP_SIZE, SHADOW_RAY_NONE, ShadowRay,
    },
    reference::{
        path_compact::counts_of_block,
        path_scatter::{PathBuffers, path_scatter},
    },
    scene::Environment,
    world::FlatScene,
};

use super::{
    path_stage::PathStage,
    stage::{FIRST, RAY_COUNTS, UNTOUCHED_WORD},
};
use crate::support::{compare, meshes, random::Random, scenes};

const NO_SHADOW_RAY: ShadowRay = ShadowRay {
    origin: Vec3::ZERO,
    state: SHADOW_RAY_NONE,
    direction: Vec3::ZERO,
    source_triangle: 0,
    light: Vec3::ZERO,
    t_max: 0.0,
};

/// A path's shadow ray as a ray, so that it can be compared as one.
fn as_ray(shadow_ray: &ShadowRay) -> PathRay {
    PathRay {
        origin: shadow_ray.origin,
        pixel_ix: shadow_ray.state,
        direction: shadow_ray.direction,
        source_triangle: shadow_ray.source_triangle,
        throughput: shadow_ray.light,
        t_max: shadow_ray.t_max,
    }
}

/// Takes the first `n` of the camera's paths a step further at this depth, by the kernel and by its twin, and compares
/// them. Returns how many have a shadow ray to a light, and how many go on.
fn check(stage: &PathStage, depth: u32, n: u32) -> (usize, u32) {
    let (rays, hits) = stage.rays_and_hits();
    let (paths, n_all) = (stage.paths(), rays.len());
    let mut random = Random(5);
    let live: Vec<u32> = (0..n).collect();
    let states: Vec<_> = (0..n_all)
        .map(|ix| PathState { radiance: random.in_box(Vec3::ZERO, Vec3::ONE), pdf: (ix % 2) as f32 })
        .collect();
    let mut list = live.clone();
    list.resize(3 * n_all, u32::MAX);
    list.copy_within(..n_all, n_all);
    let mut rows = vec![(0, 0); depth as usize];
    rows.push((n, 0));
    stage.set_n_paths(&rows);
    stage.resources.queue.rays.upload(&rays).expect("rays");
    stage.resources.queue.hits.upload(&hits).expect("hits");
    stage.resources.queue.child_flags.upload(&vec![UNTOUCHED_WORD; n_all]).expect("child_flags");
    paths.path_states.upload(&states).expect("path_states");
    paths.shadow_rays.upload(&vec![NO_SHADOW_RAY; n_all]).expect("shadow_rays");
    paths.live_paths.upload(&list).expect("live_paths");
    let batch = Batch { n_pixels: 1200, bounce_ix: depth, depth, ..FIRST };
    stage.run(|commands| stage.passes.path_scatter.record(commands, &stage.resources, &batch));

    let (mut rays, mut states, mut shadow_rays) = (rays, states, vec![NO_SHADOW_RAY; n_all]);
    let mut flags = vec![UNTOUCHED_WORD; n_all];
    let mut blocks = vec![[0; 2]; n.div_ceil(SCAN_GROUP_SIZE) as usize];
    let buffers = PathBuffers { rays: &mut rays, states: &mut states, shadow_rays: &mut shadow_rays };
    let counts = (&mut flags[..n as usize], &mut blocks[..]);
    path_scatter(&stage.inputs(), &batch, (&live, &hits), buffers, counts);
    // Where rounding decides which lobe or which light is chosen, a path takes another way.
    let n_outliers = n as usize / 50;
    let queue = &stage.resources.queue;
    let found = queue.child_flags.download().expect("child_flags");
    compare::exact_but_for(n_outliers, &flags, &found).unwrap();
    let sums: Vec<_> = found[..n as usize].chunks(SCAN_GROUP_SIZE as usize).flat_map(counts_of_block).collect();
    compare::exact(&sums, &queue.scan_blocks.download_first(sums.len()).expect("scan_blocks")).unwrap();
    compare::rays(1e-3, n_outliers, &rays, &queue.rays.download().expect("rays")).unwrap();
    let found: Vec<_> = paths.shadow_rays.download().expect("shadow_rays").iter().map(as_ray).collect();
    let expected: Vec<_> = shadow_rays.iter().map(as_ray).collect();
    compare::rays(1e-3, n_outliers, &expected, &found).unwrap();
    let pixels =
        |states: &[PathState]| -> Vec<_> { states.iter().map(|s| s.radiance.extend(s.pdf).to_array()).collect() };
    let found = paths.path_states.download().expect("path_states");
    compare::pixels(1e-3, n_outliers, &pixels(&states), &pixels(&found)).unwrap();
    let n_lit = shadow_rays.iter().filter(|shadow_ray| shadow_ray.state != SHADOW_RAY_NONE).count();
    (n_lit, blocks.iter().map(|[n_going_on, _]| n_going_on).sum())
}

/// Paths of one pixel have the random numbers of different samples.
#[test]
fn agrees_for_several_samples() {
    let stage = PathStage::new(scenes::mixed(), 2);
    let (n_lit, n_going_on) = check(&stage, 1, 4800);
    assert!(n_lit > 800 && n_going_on > 2000, "{n_lit} lit, {n_going_on} go on");
}

#[test]
fn agrees_with_its_twin() {
    let mut scene = scenes::mixed();
    scenes::add(&mut scene, meshes::torus(6, 5), scenes::emissive(Vec3::new(3.0, 2.0, 1.0)));
    for depth in [0, 1, 3] {
        let stage = PathStage::new(scene.clone(), 0);
        for n in RAY_COUNTS.map(|n| n.min(1200)) {
            let (n_lit, n_going_on) = check(&stage, depth, n);
            let is_last = depth == 3;
            assert!(n < 1000 || is_last || (n_lit > 200 && n_going_on > 500), "{n_lit} lit, {n_going_on} go on");
            assert!(!is_last || (n_lit, n_going_on) == (0, 0));
        }
    }
}

/// Returns a scene of one material, a torus before a part of a dark background, without light.
fn torus_of(material: Material) -> FlatScene {
    let mut scene = scenes::empty();
    scenes::add(&mut scene, meshes::placed(meshes::torus(24, 12), 1.2, Vec3::ZERO), material);
    scene
}

/// Kernels are made without the code for lobes that no material of the scene has.
#[test]
fn agrees_for_each_kind_of_material() {
    let diffuse = Material { flags: MATERIAL_MICROFACET, ..scenes::diffuse(vec3(0.7, 0.5, 0.3)) };
    let smooth = Material { roughness: 0.0, ..diffuse };
    let glossy = Material { ks: Vec3::ONE, ni: 1.5, roughness: 0.4, ..diffuse };
    let metal = Material { metallic: 1.0, roughness: 0.3, ..diffuse };
    let conductor = Material {
        flags: diffuse.flags | MATERIAL_CONDUCTOR,
        conductor_eta: vec3(0.2, 0.9, 1.1),
        conductor_k: vec3(3.9, 2.5, 2.2),
        ..metal
    };
    let sheet = Material { transmission: 0.8, ..glossy };
    let glass = Material { flags: diffuse.flags | MATERIAL_SOLID, transmission: 1.0, ..glossy };
    let clear_glass = Material { roughness: 0.0, ..glass };
    let coated = Material { clearcoat: 0.7, clearcoat_roughness: 0.2, ..diffuse };
    let polished = Material { clearcoat: 0.7, clearcoat_roughness: 0.0, ..diffuse };
    let cloth = Material { sheen_colour: vec3(0.6, 0.5, 0.4), sheen_roughness: 0.5, ..diffuse };
    let all = Material { sheen_colour: cloth.sheen_colour, clearcoat: 0.5, metallic: 0.3, ..sheet };
    let materials = [
        ("diffuse", diffuse),
        ("mirror", Material { metallic: 1.0, ..smooth }),
        ("glossy", glossy),
        ("metal", metal),
        ("conductor", conductor),
        ("sheet", sheet),
        ("glass", glass),
        ("clear glass", clear_glass),
        ("coated", coated),
        ("polished", polished),
        ("cloth", cloth),
        ("all", all),
    ];
    for (name, material) in materials {
        let mut scene = torus_of(material);
        scene.lights = vec![scenes::point_light(vec3(2.0, 2.0, 3.0), Vec3::splat(20.0))];
        scene.background = vec3(0.3, 0.5, 0.7);
        let (n_lit, n_going_on) = check(&PathStage::new(scene, 0), 0, 1200);
        let is_smooth = ["mirror", "clear glass"].contains(&name);
        assert!(n_going_on > 250 && (is_smooth || n_lit > 100), "{name}: {n_lit} lit, {n_going_on} go on");
    }
}

/// Returns an area light above the camera, which shines to the torus.
fn area_light(kind: u32) -> AreaLight {
    let (position, radius, radiance) = (vec3(0.0, 2.5, 3.0), 0.5, vec3(5.0, 4.0, 3.0));
    let (area, edge) = match kind {
        AREA_RECTANGLE => (4.0 * radius * radius, radius),
        AREA_DISK => (PI * radius * radius, 1.0),
        _ => (4.0 * PI * radius * radius, 1.0),
    };
    let axis = -position.normalize();
    let (edge_u, edge_v) = (edge * Vec3::X, edge * axis.cross(Vec3::X));
    AreaLight { position, kind, radiance, radius, axis, area, edge_u, edge_v, ..AreaLight::default() }
}

/// Kernels are made without the code for kinds of emitters that the scene lacks.
#[test]
fn agrees_for_each_kind_of_light() {
    let lit_by = |add: &dyn Fn(&mut FlatScene)| {
        let mut scene = torus_of(scenes::diffuse(vec3(0.7, 0.5, 0.3)));
        add(&mut scene);
        scene
    };
    let by_shape = |kind| lit_by(&|scene| scene.area_lights.push(area_light(kind)));
    let by_direction = |outer_cos| {
        lit_by(&|scene| {
            let light = scenes::directional_light(vec3(0.2, 0.5, 1.0), Vec3::ONE);
            scene.lights.push(kdray::layout::Light { outer_cos, ..light });
        })
    };
    let by_lamps = |n| {
        lit_by(&|scene| {
            let lamp = meshes::placed(meshes::soup(n, 5), 1.0, 4.0 * Vec3::Z);
            scenes::add(scene, lamp, scenes::emissive(Vec3::splat(30.0)));
        })
    };
    let colours = |i: u32| vec3(i as f32, 1.0, 2.0);
    let (map, _) = Environment::new([8, 4], (0..32).map(colours).collect(), (0.0, 1.0)).expect("an environment");
    let scenes = [
        ("point", lit_by(&|scene| scene.lights.push(scenes::point_light(3.0 * Vec3::Z, Vec3::splat(20.0))))),
        ("rectangle", by_shape(AREA_RECTANGLE)),
        ("disk", by_shape(AREA_DISK)),
        ("sphere", by_shape(AREA_SPHERE)),
        ("directional", by_direction(0.0)),
        ("sun", by_direction(0.9)),
        ("background", lit_by(&|scene| scene.background = vec3(0.3, 0.5, 0.7))),
        ("map", lit_by(&|scene| scene.environment = Some(map.clone()))),
        ("few triangles", by_lamps(8)),
        ("tree", by_lamps(400)),
    ];
    for (name, scene) in scenes {
        let (n_lit, n_going_on) = check(&PathStage::new(scene, 0), 0, 1200);
        assert!(n_lit > 100 && n_going_on > 250, "{name}: {n_lit} lit, {n_going_on} go on");
    }
}
