//! The frame's constants: one camera for the rasterizer's matrix and for the rays, on GPU and CPU alike.

use glam::{DMat4, DVec3, DVec4};

use crate::{
    frame::{Denoise, RenderOptions},
    kdtree::KdTree,
    layout::Frame,
    scene::{Camera, Scene},
};

/// The near plane lies at this share of the scene's farthest distance from the eye: nothing that can be seen is
/// nearer, and reverse-Z in floating point loses no precision by it.
const NEAR_SHARE: f64 = 1.0 / (1 << 20) as f64;

/// What the kernels know of the frame. `queue_capacity` is left 0: the caller's queues decide.
pub fn frame_constants(scene: &Scene, tree: &KdTree, options: &RenderOptions) -> Frame {
    let image_plane = ImagePlane::new(&scene.camera, options.width as f64 / options.height as f64);
    let eye = scene.camera.eye;
    let reach = (tree.cell_min - eye).abs().max((tree.cell_max - eye).abs()).as_dvec3().length();
    let near = if reach > 0.0 { reach * NEAR_SHARE } else { NEAR_SHARE };
    Frame {
        clip_from_world: image_plane.clip_from_world(eye.as_dvec3(), near).as_mat4(),
        eye,
        width: options.width,
        right: image_plane.right.as_vec3(),
        height: options.height,
        up: image_plane.up.as_vec3(),
        n_triangles: scene.triangles.len() as u32,
        forward: image_plane.forward.as_vec3(),
        n_lights: scene.lights.len() as u32,
        ambient: scene.ambient,
        exposure: options.exposure,
        background: scene.background,
        denoise_threshold: match options.denoise {
            Denoise::Off => f32::INFINITY,
            Denoise::Paper { threshold } => threshold,
        },
        cell_min: tree.cell_min,
        max_depth: options.max_depth,
        cell_max: tree.cell_max,
        queue_capacity: 0,
    }
}

/// The image plane at unit distance: its middle, and from there to its right and its upper edge.
struct ImagePlane {
    forward: DVec3,
    right: DVec3,
    up: DVec3,
}

impl ImagePlane {
    fn new(camera: &Camera, aspect: f64) -> Self {
        let forward = (camera.target.as_dvec3() - camera.eye.as_dvec3()).normalize();
        let right = forward.cross(camera.up.as_dvec3()).normalize();
        let half_height = (f64::from(camera.vertical_fov_degrees).to_radians() / 2.0).tan();
        Self { forward, right: right * (aspect * half_height), up: right.cross(forward) * half_height }
    }

    /// Vulkan's clip space: y down, depth 1 at the near plane and 0 at infinity.
    fn clip_from_world(&self, eye: DVec3, near: f64) -> DMat4 {
        let x = self.right / self.right.length_squared();
        let y = -self.up / self.up.length_squared();
        let row = |axis: DVec3| axis.extend(-axis.dot(eye));
        DMat4::from_cols(row(x), row(y), DVec4::new(0.0, 0.0, 0.0, near), row(self.forward)).transpose()
    }
}
