//! What a pixel shows and why: its rays, one after the other, by the kernels' twins on the CPU.

use glam::{UVec2, Vec3};

use crate::{
    camera::frame_constants,
    cast::Query,
    cpu::{
        bindings::Bindings,
        primary_hit::camera_ray,
        shade::{LitRays, Shaded, shade},
        steps::{Steps, count_steps},
        trace::trace,
    },
    frame::RenderOptions,
    kdtree::{Extras, KdTree},
    layout::{Hit, NO_TRIANGLE, Ray},
    scene::{Camera, Scene},
};

/// Rays of one level that are followed; a pixel of glass can make more than anyone reads.
const MAX_RAYS: usize = 8;

/// A pixel's rays, level by level.
#[derive(Clone, Debug, PartialEq)]
pub struct Picked {
    /// From the upper left corner.
    pub pixel: UVec2,
    /// The primary ray first.
    pub rays: Vec<PickedRay>,
    /// Rays that were left out.
    pub n_more: usize,
}

/// A ray, and what it hit.
#[derive(Clone, Debug, PartialEq)]
pub struct PickedRay {
    /// 0 for the primary ray.
    pub depth: u32,
    /// What share of its light reaches the pixel, by channel.
    pub throughput: Vec3,
    /// Reads of the way through the tree.
    pub steps: Steps,
    /// None: it left the scene.
    pub hit: Option<PickedHit>,
}

/// Where a ray ended.
#[derive(Clone, Debug, PartialEq)]
pub struct PickedHit {
    pub triangle_ix: u32,
    /// The material's name.
    pub material: String,
    /// From the ray's origin, world units.
    pub distance: f32,
    pub point_world: Vec3,
}

/// Follows the rays of the pixel's middle, as seen from `camera`. `options.width` and `height` are the picture's that the pixel is counted in.
pub fn pick(scene: &Scene, tree: &KdTree, options: &RenderOptions, camera: &Camera, pixel: UVec2) -> Picked {
    let extras = Extras::new(tree, options.traversal);
    let mut frame = frame_constants(scene, tree, options);
    frame.set_view(camera, 0);
    let mut rays = vec![camera_ray(&frame, pixel)];
    let mut picked = Picked { pixel, rays: Vec::new(), n_more: 0 };
    for depth in 0..options.max_depth {
        if rays.is_empty() {
            break;
        }
        frame.queue_capacity = rays.len() as u32;
        let bindings = Bindings::new(scene, tree, &frame).with_extras(&extras);
        let mut hits = vec![Hit::default(); rays.len()];
        trace(&bindings, options.traversal, &rays, &mut hits);
        for (ray, hit) in rays.iter().zip(&hits) {
            let steps = count_steps(&bindings, options.traversal, Query::Closest, &[*ray]);
            picked.rays.push(PickedRay { depth, throughput: ray.throughput, steps, hit: found(scene, ray, hit) });
        }
        let mut children = children(&bindings, depth, &rays, &hits);
        picked.n_more += children.len().saturating_sub(MAX_RAYS);
        children.truncate(MAX_RAYS);
        rays = children;
    }
    picked
}

fn found(scene: &Scene, ray: &Ray, hit: &Hit) -> Option<PickedHit> {
    (hit.triangle_ix != NO_TRIANGLE).then(|| {
        let material_ix = scene.triangle_materials[hit.triangle_ix as usize];
        PickedHit {
            triangle_ix: hit.triangle_ix,
            material: scene.material_names[material_ix as usize].clone(),
            distance: hit.t,
            point_world: ray.origin + hit.t * ray.direction,
        }
    })
}

/// The rays of the next level.
fn children(bindings: &Bindings, depth: u32, rays: &[Ray], hits: &[Hit]) -> Vec<Ray> {
    let dark = vec![0; rays.len() * bindings.lights.len()];
    let mut shaded = Shaded::default();
    shaded.resize(rays.len());
    shade(bindings, depth, LitRays { rays, hits, light_visibility: &dark }, &mut shaded);
    let places = shaded.child_rays.chunks_exact(2).zip(&shaded.child_counts);
    places.flat_map(|(places, &count)| places[..count as usize].to_vec()).collect()
}
