//! Asks by a few rays of the scene's camera what its picture will show, and warns if that is nothing, if back faces are
//! left out, or if see-through surfaces hide what is behind them.

use glam::Vec3;

use crate::{
    accel::{Query, kdtree::Traversal},
    cast::{Hit, NO_TRIANGLE, Ray, cast_on_cpu},
    cpu,
    frame::{Integrator, RenderOptions},
    layout::{LEAST_SEEN_OPACITY, MAPS_ALPHA_BLEND, Triangle},
    reference::{
        alpha_test::{fails_alpha_test, opacity_at},
        inputs::KernelInputs,
    },
    scene::guess::few_rays::{self, view_rays},
    world::{FlatScene, World},
};

/// Number of rays, across and down.
const N_RAYS: (usize, usize) = (32, 24);
/// A picture is almost empty if fewer of the rays meet a surface.
const LEAST_SEEN: usize = 4;
/// Most surfaces that a ray follows.
const MOST_SURFACES: u32 = RenderOptions::MOST_DEPTH + RenderOptions::EXTRA_BOUNCES;

/// Warns of what the picture of a world with a kd-tree will lack.
pub(super) fn warn(world: &World, options: &RenderOptions) {
    let scene = world.scene();
    let aspect = options.width as f32 / options.height as f32;
    let ray =
        |ray: few_rays::Ray| Ray { origin: ray.origin, t_min: 0.0, direction: ray.direction, t_max: f32::INFINITY };
    let rays: Vec<Ray> = view_rays(&scene.camera, aspect, N_RAYS).into_iter().map(ray).collect();
    let hits = seen(world, &rays);
    let (n_seen, name) = (hits.iter().filter(|hit| is_hit(hit)).count(), &scene.name);
    if n_seen < LEAST_SEEN {
        let has_area = |triangle: &Triangle| (triangle.v1 - triangle.v0).cross(triangle.v2 - triangle.v0) != Vec3::ZERO;
        let why = match scene.triangles.iter().any(has_area) {
            true => "--eye and --target, or --camera, place the camera",
            false => "no triangle has an area",
        };
        tracing::warn!("{name}: {n_seen} of {} rays of the camera meet a surface: {why}", rays.len());
    }
    if options.integrator == Integrator::Whitted {
        warn_of_hidden(world, options.max_depth + RenderOptions::EXTRA_BOUNCES, (rays, hits));
    }
}

/// Returns the hits of camera rays, which pass through back faces of single-sided materials. Warns if some do.
fn seen(world: &World, rays: &[Ray]) -> Vec<Hit> {
    let (scene, nearest) = (world.scene(), cast(world, rays));
    if !scene.has_single_sided() {
        return nearest;
    }
    let inputs = KernelInputs::of_geometry(world.geometry());
    let (triangle_materials, materials) = (&scene.triangle_materials[..], &scene.materials[..]);
    let inputs = KernelInputs { triangle_materials, materials, ..inputs }.of_camera();
    let mut hits = nearest.clone();
    cpu::cast(&inputs, Traversal::Stack.into(), Query::Closest, rays, &mut hits);
    let n_passed = nearest.iter().zip(&hits).filter(|(a, b)| a.triangle_ix != b.triangle_ix).count();
    if n_passed > 0 {
        tracing::warn!(
            "{}: {n_passed} of {} rays of the camera pass through back faces of materials that are not doubleSided; \
             --cull off shows these faces",
            scene.name,
            rays.len()
        );
    }
    hits
}

/// Warns if rays end at see-through surfaces, since they have none of the `n_bounces` left.
fn warn_of_hidden(world: &World, n_bounces: u32, (mut rays, mut hits): (Vec<Ray>, Vec<Hit>)) {
    let (scene, n_rays) = (world.scene(), rays.len());
    if !scene.textures.has_blended() {
        return;
    }
    let mut n_met: Vec<u32> = vec![0; n_rays];
    let (mut n_hidden, mut most) = (0, 0);
    for _ in 0..MOST_SURFACES {
        let mut kept = Vec::new();
        for (ix, hit) in hits.iter().enumerate().filter(|(_, hit)| is_hit(hit)) {
            let Some(is_clear) = clear(scene, hit) else { continue };
            let n = n_met[ix] + u32::from(!is_clear);
            n_hidden += usize::from(n == n_bounces && !is_clear);
            most = most.max(n);
            kept.push((Ray { t_min: hit.t, ..rays[ix] }, n));
        }
        if kept.is_empty() {
            break;
        }
        (rays, n_met) = kept.into_iter().unzip();
        hits = cast(world, &rays);
    }
    if n_hidden > 0 {
        tracing::warn!(
            "{}: {n_hidden} of {n_rays} rays of the camera meet {n_bounces} see-through surfaces or more, and show \
             nothing behind them; --max-depth {} shows more",
            scene.name,
            (most + 1).min(MOST_SURFACES) - RenderOptions::EXTRA_BOUNCES
        );
    }
}

/// Returns whether a see-through surface is completely clear at a hit. Returns `None` if it hides what is behind it.
fn clear(scene: &FlatScene, hit: &Hit) -> Option<bool> {
    let (textures, triangle_ix) = (&scene.textures, hit.triangle_ix as usize);
    let (at, material_ix) = (scene.stored(triangle_ix), scene.material_ix_of(triangle_ix));
    if fails_alpha_test(textures, material_ix, (hit, &at), false, None) {
        return Some(true);
    }
    let maps = &textures.material_maps[material_ix as usize];
    let opacity = || opacity_at(textures, maps, maps.coverage, &at, [hit.u, hit.v]);
    (maps.flags & MAPS_ALPHA_BLEND != 0 && opacity() <= 1.0 - LEAST_SEEN_OPACITY).then_some(false)
}

fn cast(world: &World, rays: &[Ray]) -> Vec<Hit> {
    cast_on_cpu(world.geometry(), Traversal::Stack, rays, Query::Closest)
}

fn is_hit(hit: &Hit) -> bool {
    hit.triangle_ix != NO_TRIANGLE
}
