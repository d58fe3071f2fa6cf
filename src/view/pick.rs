//! Follows the rays of a clicked pixel on the CPU, with the CPU twins of the kernels.

use glam::{UVec2, Vec3};

use crate::{
    accel::{Query, kdtree::TraversalLinks},
    cpu::trace,
    frame::RenderOptions,
    layout::{Hit, NO_TRIANGLE, PathRay},
    reference::{
        children::{child_flags_of, children_of},
        counting::steps::{Steps, count_steps},
        inputs::KernelInputs,
        primary_hit::camera_ray,
    },
    scene::Camera,
    world::{FlatScene, TriangleOrigin, World},
};

/// Most rays of one level that are followed. A pixel of glass can have more rays than anyone reads.
const MAX_RAYS: usize = 8;

/// A pixel's rays, level by level.
#[derive(Clone, Debug, PartialEq)]
pub struct Picked {
    /// The pixel, counted from the picture's upper left corner.
    pub pixel: UVec2,
    /// The rays that were followed, the primary ray first.
    pub rays: Vec<PickedRay>,
    /// Number of rays that were left out. Their own child rays are not counted.
    pub n_more: usize,
}

/// A ray, and what it hit.
#[derive(Clone, Debug, PartialEq)]
pub struct PickedRay {
    /// Level of the ray; 0 for the primary ray.
    pub depth: u32,
    /// Share of the ray's light that reaches the pixel, by colour channel.
    pub throughput: Vec3,
    /// Steps of the ray's search through the acceleration structure.
    pub steps: Steps,
    /// The hit; none if the ray left the scene.
    pub hit: Option<PickedHit>,
}

/// Where a ray ended.
#[derive(Clone, Debug, PartialEq)]
pub struct PickedHit {
    /// The triangle's instance, mesh and face.
    pub origin: TriangleOrigin,
    /// The material's name.
    pub material: String,
    /// Distance from the ray's origin, world units.
    pub distance: f32,
    /// The point that was hit, world space.
    pub point_world: Vec3,
}

/// Follows the rays through the middle of a pixel, as seen from `camera`. `options.width` and `options.height` are
/// the size of the picture in which the pixel is counted.
pub fn pick(world: &World, options: &RenderOptions, camera: &Camera, pixel: UVec2) -> Picked {
    let scene = world.scene();
    let links = TraversalLinks::of(world.accel(), &world.scene().triangles, options.traversal);
    let mut frame = world.frame_constants(options);
    frame.set_view(camera, world.bounds(), 0);
    let bindings = KernelInputs::new(world, &frame).with_links(&links);
    let mut rays = vec![camera_ray(&frame, pixel)];
    let mut picked = Picked { pixel, rays: Vec::new(), n_more: 0 };
    for depth in 0..frame.max_depth {
        let bindings = if depth == 0 { bindings.of_camera() } else { bindings };
        if rays.is_empty() {
            break;
        }
        let mut hits = vec![Hit::default(); rays.len()];
        trace(&bindings, options.traversal.into(), &rays, &mut hits);
        for (ray, hit) in rays.iter().zip(&hits) {
            let steps = count_steps(&bindings, options.traversal, Query::Closest, &[*ray]);
            picked.rays.push(PickedRay { depth, throughput: ray.throughput, steps, hit: found(scene, ray, hit) });
        }
        if depth + 1 == frame.max_depth {
            break;
        }
        rays = next_rays(&bindings, &rays, &hits);
        picked.n_more += rays.len().saturating_sub(MAX_RAYS);
        rays.truncate(MAX_RAYS);
    }
    picked
}

fn found(scene: &FlatScene, ray: &PathRay, hit: &Hit) -> Option<PickedHit> {
    (hit.triangle_ix != NO_TRIANGLE).then(|| {
        let material_ix = scene.material_ix_of(hit.triangle_ix as usize);
        PickedHit {
            origin: scene.origin_of(hit.triangle_ix),
            material: scene.material_names[material_ix as usize].clone(),
            distance: hit.t,
            point_world: ray.origin + hit.t * ray.direction,
        }
    })
}

/// Returns the rays of the next level: the reflected and refracted rays at the hits.
fn next_rays(bindings: &KernelInputs, rays: &[PathRay], hits: &[Hit]) -> Vec<PathRay> {
    let of_ray = |(ray, hit)| children_of(bindings, ray, hit, child_flags_of(bindings, ray, hit));
    rays.iter().zip(hits).flat_map(of_ray).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{accel::kdtree::BuildOptions, scene::Scene};

    /// A click finds what the camera sees, behind back faces that it does not see.
    #[test]
    fn a_click_passes_back_faces() {
        let disc = |name: &str, y: f32| {
            format!(
                "[[mesh]]\ngenerator = 'disc'\nradius = 1\nsegments = 8\nmaterial = '{name}'\n\
                 transform = {{ translate = [0, {y}, 0] }}\n[materials.{name}]\n"
            )
        };
        let text = format!("[camera]\neye = [0, -4, 1]\ntarget = [0, 0, 0]\n{}{}", disc("near", 0.0), disc("far", 1.0));
        let mut scene = Scene::of_text("discs.toml", &text).unwrap();
        let options = RenderOptions { width: 8, height: 8, ..RenderOptions::default() };
        for (is_double_sided, seen) in [(true, "near"), (false, "far")] {
            let near = scene.materials.iter_mut().find(|it| it.name == "near");
            near.unwrap().is_double_sided = is_double_sided;
            let world = World::new(&scene, &BuildOptions::default()).unwrap();
            let picked = pick(&world, &options, &scene.camera, UVec2::new(4, 4));
            assert_eq!(picked.rays[0].hit.as_ref().map(|hit| &*hit.material), Some(seen));
        }
    }
}
