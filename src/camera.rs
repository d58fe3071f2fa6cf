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

#[cfg(test)]
mod tests {
    use glam::{UVec2, Vec3, uvec2, vec3};

    use super::*;
    use crate::{cpu::camera::camera_direction, kdtree::BuildOptions, layout::Triangle, scene::RenderDefaults};

    /// A view of one triangle.
    fn frame(camera: Camera, width: u32, height: u32) -> Frame {
        let corner = |direction| camera.target + 3.0 * (camera.target - camera.eye).length() * direction;
        let triangle = Triangle { v0: corner(Vec3::X), v1: corner(Vec3::Y), v2: corner(Vec3::Z), ..Default::default() };
        let scene = Scene {
            name: String::new(),
            triangles: vec![triangle],
            triangle_materials: vec![0],
            materials: vec![Default::default()],
            material_names: vec![String::new()],
            lights: Vec::new(),
            camera,
            ambient: Vec3::ZERO,
            background: Vec3::ZERO,
            defaults: RenderDefaults::default(),
        };
        let tree = KdTree::build(&scene.triangles, &BuildOptions::default());
        frame_constants(&scene, &tree, &RenderOptions { width, height, ..RenderOptions::default() })
    }

    fn views() -> Vec<Frame> {
        let camera = |eye, target, up, vertical_fov_degrees| Camera { eye, target, up, vertical_fov_degrees };
        vec![
            frame(camera(vec3(0.0, 0.0, 5.0), Vec3::ZERO, Vec3::Y, 45.0), 1024, 768),
            frame(camera(vec3(1.0, 2.0, 3.0), vec3(-2.0, 0.5, 0.1), vec3(0.6, 0.8, 0.0), 100.0), 640, 480),
            frame(camera(vec3(-0.3, 40.0, 0.2), vec3(0.1, -7.0, 0.3), Vec3::X, 10.0), 333, 777),
            frame(camera(vec3(1e-4, 2e-4, -3e-4), Vec3::ZERO, Vec3::Z, 60.0), 8, 8),
        ]
    }

    /// Where Vulkan's viewport transform puts a point, in pixels from the upper left corner, and its depth.
    fn project(frame: &Frame, point: DVec3) -> (f64, f64, f64) {
        let clip = frame.clip_from_world.as_dmat4() * point.extend(1.0);
        let ndc = clip.truncate() / clip.w;
        let (width, height) = (f64::from(frame.width), f64::from(frame.height));
        ((ndc.x + 1.0) / 2.0 * width, (ndc.y + 1.0) / 2.0 * height, ndc.z)
    }

    /// Farthest that a point of a camera ray is projected from its pixel's centre, px.
    fn worst_distance(frame: &Frame) -> f64 {
        let pixels = (0..50).map(|i| uvec2(i * 7919 % frame.width, i * 104_729 % frame.height));
        let corners = [UVec2::ZERO, uvec2(frame.width - 1, frame.height - 1)];
        let distance = |pixel: UVec2, scale: f64| {
            let direction = camera_direction(frame, pixel).as_dvec3();
            let (x, y, _) = project(frame, frame.eye.as_dvec3() + scale * direction);
            (x - f64::from(pixel.x) - 0.5).hypot(y - f64::from(pixel.y) - 0.5)
        };
        let scale = frame.eye.as_dvec3().length();
        pixels.chain(corners).flat_map(|pixel| [0.5, 1.0, 30.0].map(|t| distance(pixel, t * scale))).fold(0.0, f64::max)
    }

    #[test]
    fn points_of_camera_rays_are_projected_to_their_pixels_centre() {
        for frame in views() {
            assert!(worst_distance(&frame) < 1e-4, "{} px in {frame:?}", worst_distance(&frame));
        }
    }

    #[test]
    fn a_ray_beside_its_pixel_is_noticed() {
        for mut frame in views() {
            frame.right *= 1.0 + 4.0 / frame.width as f32 * 1e-3;
            assert!(worst_distance(&frame) > 1e-4);
        }
    }

    #[test]
    fn depth_falls_from_the_near_plane_on_and_stays_above_zero() {
        for frame in views() {
            let reach = frame.eye.as_dvec3().length();
            let depth = |t: f64| project(&frame, frame.eye.as_dvec3() + t * reach * frame.forward.as_dvec3()).2;
            assert!(depth(1e-3) < 1.0 && depth(1e-3) > depth(1.0) && depth(1.0) > depth(1e6) && depth(1e6) > 0.0);
        }
    }

    #[test]
    fn the_pictures_edges_are_the_field_of_views() {
        let frame = &views()[1];
        let (right, up) = (frame.right.as_dvec3(), frame.up.as_dvec3());
        assert!((up.length() - 50f64.to_radians().tan()).abs() < 1e-6);
        assert!((right.length() / up.length() - 640.0 / 480.0).abs() < 1e-6);
        assert!(right.dot(up).abs() < 1e-6 && frame.forward.as_dvec3().dot(right + up).abs() < 1e-6);
    }
}
