//! The frame's constants, the same on GPU and CPU. The rasterizer's matrix and the vectors of camera rays are
//! computed together from one camera, so that they agree.

use glam::{DMat4, DVec2, DVec3, DVec4, Vec3, dvec2};

use crate::{
    frame::{Crop, Denoise, Integrator, PixelFilter, RenderOptions, sampling::sample_offset},
    layout::{FILTER_BOX, FILTER_GAUSSIAN, FILTER_TENT, Frame, WINDOW_OF_NOISE_TILES},
    scene::{Camera, Projection},
};

/// Distance of the near plane from the eye, divided by the distance of the farthest corner of the scene's box. The
/// graphics pipeline clips all that is nearer than this plane, so the camera is assumed to see nothing there.
/// Reverse-Z in floating point loses no precision if the plane is so near.
const NEAR_SHARE: f64 = 1.0 / (1 << 20) as f64;
/// Distance of an orthographic camera's near and far plane from the scene's box, as a multiple of the box's depth and
/// of its farthest coordinate. It is 16 times what rounding adds to the depth of a corner: 2^-22 of these lengths.
const DEPTH_MARGIN: f64 = 1.0 / (1 << 18) as f64;

impl Frame {
    /// Sets the constants that depend on where the world's surfaces are, to those of another frame.
    pub fn set_light_of(&mut self, other: &Self) {
        let &Self { ambient, ambient_tilt, background, .. } = other;
        *self = Self { ambient, ambient_tilt, background, ..*self };
    }

    /// Sets the constants that depend on the options alone. [`Frame::set_view`] must be called afterwards, since it
    /// reads the picture's size.
    ///
    /// # Panics
    /// The crop exceeds the picture, or tiles have a noise filter.
    pub fn set_options(&mut self, options: &RenderOptions) {
        let window = options.window();
        self.picture_width = options.width;
        self.picture_height = options.height;
        (self.window_x, self.window_y) = match options.noise_tiles {
            Some(ref tiles) => {
                assert!(options.integrator == Integrator::Path && options.noise_filter() == Denoise::Off, "tiles");
                (WINDOW_OF_NOISE_TILES, tiles.n_samples())
            }
            None => {
                let Crop { x1, y1, .. } = window;
                assert!(x1 <= options.width && y1 <= options.height, "a crop lies within its picture");
                (window.x0, window.y0)
            }
        };
        (self.width, self.height) = (window.width(), window.height());
        self.max_depth = options.n_bounces() + self.extra_bounces;
        self.pixel_filter = match options.paths.filter {
            PixelFilter::Box => FILTER_BOX,
            PixelFilter::Tent => FILTER_TENT,
            PixelFilter::Gaussian => FILTER_GAUSSIAN,
        };
        self.range_begin = options.paths.range_begin();
        self.clamp = options.paths.clamp;
        self.aperture = options.paths.aperture;
        self.focus = options.paths.focus.unwrap_or(0.0);
        self.focuses_on_target = options.paths.focus.is_none().into();
        self.exposure = options.exposure;
        self.denoise_threshold = match options.denoise {
            Denoise::Off | Denoise::Edge => f32::INFINITY,
            Denoise::Paper { threshold } => threshold,
        };
    }

    /// Sets the camera and the frame's sample, whose index counts from 0. In a frame of paths, which draws several
    /// samples, it is the first of them. `bounds`: the least and the greatest corner of a box that contains the scene,
    /// world units.
    pub fn set_view(&mut self, camera: &Camera, bounds: [Vec3; 2], sample_ix: u32) {
        let size = dvec2(self.picture_width.into(), self.picture_height.into());
        let offset = sample_offset(sample_ix);
        let image_plane = ImagePlane::new(camera, size.x / size.y);
        let eye = camera.eye;
        let [least, greatest] = bounds;
        let reach = (least - eye).abs().max((greatest - eye).abs()).as_dvec3().length();
        let near = if reach > 0.0 { reach * NEAR_SHARE } else { NEAR_SHARE };
        let projection = match camera.projection {
            Projection::Perspective { .. } => image_plane.clip_from_world(eye.as_dvec3(), near),
            Projection::Orthographic { .. } => {
                let depths = image_plane.depths(eye.as_dvec3(), bounds, near);
                image_plane.clip_from_world_in_parallel(eye.as_dvec3(), depths)
            }
        };
        self.clip_from_world = (moved_by(-2.0 * offset / size) * projection).as_mat4();
        self.is_orthographic = camera.is_orthographic().into();
        self.eye = eye;
        self.right = image_plane.right.as_vec3();
        self.up = image_plane.up.as_vec3();
        self.forward = image_plane.forward.as_vec3();
        [self.sample_x, self.sample_y] = (offset + 0.5).as_vec2().to_array();
        self.first_sample = self.range_begin + sample_ix;
        self.n_samples = sample_ix + (1 << self.samples_log2);
        self.samples_reciprocal = 1.0 / self.n_samples as f32;
        if self.focuses_on_target == 1 {
            self.focus = eye.distance(camera.target);
        }
    }
}

/// Returns the matrix that moves the image by `step`, in units of half the picture's width and height. The viewport
/// cannot be moved instead: a device need not support viewports at fractions of a pixel.
fn moved_by(step: DVec2) -> DMat4 {
    DMat4::from_cols(DVec4::X, DVec4::Y, DVec4::Z, step.extend(0.0).extend(1.0))
}

/// The picture's rectangle in the world. It is at unit distance from the eye of a perspective camera. Its middle is the
/// eye of an orthographic camera. `forward`: the direction of the view. `right`, `up`: the vectors from
/// the rectangle's centre to its right and to its upper edge, world space.
pub(crate) struct ImagePlane {
    pub forward: DVec3,
    pub right: DVec3,
    pub up: DVec3,
}

impl ImagePlane {
    pub fn new(camera: &Camera, aspect: f64) -> Self {
        let forward = (camera.target.as_dvec3() - camera.eye.as_dvec3()).normalize();
        let right = forward.cross(camera.up.as_dvec3()).normalize();
        let half_height = match camera.projection {
            Projection::Perspective { vertical_fov_degrees } => {
                (f64::from(vertical_fov_degrees).to_radians() / 2.0).tan()
            }
            Projection::Orthographic { height } => f64::from(height) / 2.0,
        };
        Self { forward, right: right * (aspect * half_height), up: right.cross(forward) * half_height }
    }

    /// Returns the projection to Vulkan's clip space: y down, depth 1 at the near plane and 0 at infinity.
    fn clip_from_world(&self, eye: DVec3, near: f64) -> DMat4 {
        let x = self.right / self.right.length_squared();
        let y = -self.up / self.up.length_squared();
        let row = |axis: DVec3| axis.extend(-axis.dot(eye));
        DMat4::from_cols(row(x), row(y), DVec4::new(0.0, 0.0, 0.0, near), row(self.forward)).transpose()
    }

    /// Returns the least and the greatest depth that an orthographic camera draws: those of the scene's box with a
    /// margin, so that the depth buffer tells apart what is near together, however far away the eye is. `near` bounds
    /// the least depth from below.
    fn depths(&self, eye: DVec3, [least, greatest]: [Vec3; 2], near: f64) -> [f64; 2] {
        let (low, high) = (least.as_dvec3() - eye, greatest.as_dvec3() - eye);
        let (a, b) = (low * self.forward, high * self.forward);
        let (first, last) = (a.min(b).element_sum(), a.max(b).element_sum());
        let margin = DEPTH_MARGIN * (last - first + least.abs().max(greatest.abs()).as_dvec3().length());
        let nearest = near.max(first - margin);
        // All of the scene may be behind the eye. Then nothing is drawn, whatever is farthest.
        [nearest, (last + margin).max(nearest + near)]
    }

    /// Returns the orthographic projection to Vulkan's clip space: y down, depth 1 at the nearest depth and 0 at the
    /// farthest.
    fn clip_from_world_in_parallel(&self, eye: DVec3, [nearest, farthest]: [f64; 2]) -> DMat4 {
        let x = self.right / self.right.length_squared();
        let y = -self.up / self.up.length_squared();
        let row = |axis: DVec3| axis.extend(-axis.dot(eye));
        let depth = row(-self.forward / (farthest - nearest)) + DVec4::W * (farthest / (farthest - nearest));
        DMat4::from_cols(row(x), row(y), depth, DVec4::W).transpose()
    }
}

#[cfg(test)]
mod tests {
    use glam::{UVec2, Vec3, uvec2, vec3};

    use super::*;
    use crate::reference::camera::{camera_direction, camera_origin, in_picture};

    /// Returns the constants of a view of a scene around the camera's target.
    fn frame(camera: Camera, width: u32, height: u32) -> Frame {
        part(camera, RenderOptions { width, height, ..RenderOptions::default() }, 0)
    }

    fn part(camera: Camera, options: RenderOptions, sample_ix: u32) -> Frame {
        let reach = Vec3::splat(3.0 * (camera.target - camera.eye).length());
        let mut frame = Frame::default();
        frame.set_options(&options);
        frame.set_view(&camera, [camera.target - reach, camera.target + reach], sample_ix);
        frame
    }

    fn views() -> Vec<Frame> {
        let camera = |eye, target, up, vertical_fov_degrees| {
            let projection = Projection::Perspective { vertical_fov_degrees };
            Camera { eye, target, up, projection }
        };
        let parallel = |camera, height| Camera { projection: Projection::Orthographic { height }, ..camera };
        let [straight, oblique] = [
            camera(vec3(0.0, 0.0, 5.0), Vec3::ZERO, Vec3::Y, 45.0),
            camera(vec3(1.0, 2.0, 3.0), vec3(-2.0, 0.5, 0.1), vec3(0.6, 0.8, 0.0), 100.0),
        ];
        let crop = Some(Crop { x0: 600, y0: 31, x1: 640, y1: 480 });
        let cropped = RenderOptions { width: 640, height: 480, crop, ..RenderOptions::default() };
        vec![
            frame(straight, 1024, 768),
            frame(oblique, 640, 480),
            frame(camera(vec3(-0.3, 40.0, 0.2), vec3(0.1, -7.0, 0.3), Vec3::X, 10.0), 333, 777),
            frame(camera(vec3(1e-4, 2e-4, -3e-4), Vec3::ZERO, Vec3::Z, 60.0), 8, 8),
            part(oblique, cropped.clone(), 0),
            part(oblique, cropped.clone(), 5),
            frame(parallel(straight, 3.0), 1024, 768),
            part(parallel(oblique, 7.0), cropped.clone(), 0),
            part(parallel(oblique, 7.0), cropped, 5),
        ]
    }

    /// Returns x and y of a point after Vulkan's viewport transform, px from the upper left corner, and its depth.
    fn project(frame: &Frame, point: DVec3) -> (f64, f64, f64) {
        let clip = frame.clip_from_world.as_dmat4() * point.extend(1.0);
        let ndc = clip.truncate() / clip.w;
        let (width, height) = (f64::from(frame.picture_width), f64::from(frame.picture_height));
        ((ndc.x + 1.0) / 2.0 * width, (ndc.y + 1.0) / 2.0 * height, ndc.z)
    }

    /// Returns the largest distance, px, between the projection of a point on a camera ray and the centre of the
    /// ray's pixel. The matrix moves the image by the sample's offset, so points are projected to the centre in each
    /// sample.
    fn worst_distance(frame: &Frame) -> f64 {
        let pixels = (0..50).map(|i| uvec2(i * 7919 % frame.width, i * 104_729 % frame.height));
        let corners = [UVec2::ZERO, uvec2(frame.width - 1, frame.height - 1)];
        let distance = |pixel: UVec2, scale: f64| {
            let (origin, direction) = (camera_origin(frame, pixel), camera_direction(frame, pixel));
            let (x, y, _) = project(frame, origin.as_dvec3() + scale * direction.as_dvec3());
            let centre = in_picture(frame, pixel).as_dvec2() + 0.5;
            (x - centre.x).hypot(y - centre.y)
        };
        let scale = frame.eye.as_dvec3().length();
        // With the distance, the rounding of parallel directions grows in the picture.
        let farthest = if frame.is_orthographic == 1 { 1.5 } else { 30.0 };
        let scales = [0.5, 1.0, farthest];
        pixels.chain(corners).flat_map(|pixel| scales.map(|t| distance(pixel, t * scale))).fold(0.0, f64::max)
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
    fn a_sample_lies_where_it_is_said_to() {
        let projections =
            [Projection::Perspective { vertical_fov_degrees: 45.0 }, Projection::Orthographic { height: 4.0 }];
        for projection in projections {
            let camera = Camera { eye: vec3(0.0, 0.0, 5.0), target: Vec3::ZERO, up: Vec3::Y, projection };
            let options = RenderOptions { width: 90, height: 60, ..RenderOptions::default() };
            let [first, seventh] = [0, 6].map(|sample_ix| part(camera, options.clone(), sample_ix));
            let point = vec3(0.3, -0.2, 1.0).as_dvec3();
            let ((x, y, _), (moved_x, moved_y, _)) = (project(&first, point), project(&seventh, point));
            let offset = sample_offset(6);
            assert!((x - moved_x - offset.x).abs() < 1e-4 && (y - moved_y - offset.y).abs() < 1e-4);
            assert_eq!([seventh.sample_x, seventh.sample_y], (offset + 0.5).as_vec2().to_array());
            assert_eq!([first.sample_x, first.sample_y, seventh.n_samples as f32], [0.5, 0.5, 7.0]);
        }
    }

    #[test]
    fn depth_falls_from_the_near_plane_on_and_stays_above_zero() {
        for frame in views().into_iter().filter(|frame| frame.is_orthographic == 0) {
            let reach = frame.eye.as_dvec3().length();
            let depth = |t: f64| project(&frame, frame.eye.as_dvec3() + t * reach * frame.forward.as_dvec3()).2;
            assert!(depth(1e-3) < 1.0 && depth(1e-3) > depth(1.0) && depth(1.0) > depth(1e6) && depth(1e6) > 0.0);
        }
    }

    /// An orthographic camera's depths are spread over the scene, wherever the eye is, and nothing behind it is drawn.
    #[test]
    fn depths_of_an_orthographic_camera_are_those_of_the_scene() {
        let corners: Vec<Vec3> = (0..8)
            .map(|i| Vec3::from_array([0, 1, 2].map(|axis| if i >> axis & 1 == 0 { -1.0 } else { 1.0 })))
            .collect();
        let forward = vec3(1.0, 2.0, -3.0).normalize();
        for distance in [-4.0, -0.5, 0.0, 0.7, 5.0, 1e5] {
            let projection = Projection::Orthographic { height: 4.0 };
            let eye = -distance * forward;
            let camera = Camera { eye, target: eye + distance.abs().max(1.0) * forward, up: Vec3::Y, projection };
            let mut frame = Frame::default();
            frame.set_options(&RenderOptions::default());
            frame.set_view(&camera, [Vec3::NEG_ONE, Vec3::ONE], 0);
            let depth = |p: &Vec3| project(&frame, p.as_dvec3()).2;
            for corner in &corners {
                let is_in_front = (corner - eye).dot(forward) > 0.0;
                assert_eq!((0.0..=1.0).contains(&depth(corner)), is_in_front, "{corner} from {distance}");
                assert!(is_in_front || depth(corner) > 1.0);
            }
            let [nearest, farthest] = [-1.0, 1.0].map(|side| depth(&vec3(side, side, -side)));
            assert!(distance < 3.0 || (nearest > 0.9999 && farthest < 0.0001), "{distance}: {nearest} {farthest}");
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

    #[test]
    fn the_edges_of_an_orthographic_picture_are_its_height_apart() {
        let frame = &views()[6];
        assert_eq!((frame.is_orthographic, frame.right, frame.up), (1, vec3(2.0, 0.0, 0.0), vec3(0.0, 1.5, 0.0)));
    }
}
