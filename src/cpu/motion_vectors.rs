//! The layer `motion`: where the points that pixels show are in the next frame. It is computed on the host, in double
//! precision, from the triangles that pixels show: devices that find the same triangles have the same vectors.

use glam::{DVec2, DVec3, dvec2};
use rayon::prelude::*;

use crate::{
    frame::{Crop, ImagePlane},
    layout::{NO_TRIANGLE, PixelAovs, Triangle},
    scene::Camera,
    world::World,
};

/// Returns for each pixel of a crop the way of the point that the ray through its centre hits, from one moment to
/// another: pixels to the right and upwards. Where the ray hits nothing, that is the way of a point infinitely far away
/// in its direction. It is 0 where the other camera does not have the point before it, and for what is infinitely far
/// from an orthographic camera. `views`: the worlds and cameras of both moments. `size`: of the whole picture, pixels.
///
/// # Panics
/// The worlds differ in their numbers of triangles, or there is not an entry of `pixel_aovs` for each pixel.
pub fn motion_vectors(
    views: [(&World, &Camera); 2],
    (width, height): (u32, u32),
    crop: &Crop,
    pixel_aovs: &[PixelAovs],
) -> Vec<[f32; 2]> {
    let worlds = views.map(|(world, _)| world.scene());
    assert_eq!(worlds[0].n_triangles(), worlds[1].n_triangles(), "triangles of both moments");
    assert_eq!(pixel_aovs.len(), crop.width() as usize * crop.height() as usize, "pixels of the crop");
    let views = views.map(|(_, camera)| View::new(camera, dvec2(width.into(), height.into())));
    let vector = |(pixel_ix, aovs): (usize, &PixelAovs)| {
        let (x, y) = (pixel_ix as u32 % crop.width() + crop.x0, pixel_ix as u32 / crop.width() + crop.y0);
        let ray = views[0].ray(dvec2(x.into(), y.into()) + 0.5);
        let places = match aovs.triangle_ix {
            NO_TRIANGLE => views.each_ref().map(|view| view.place_of_direction(ray.1)),
            triangle_ix => {
                let corners = worlds.map(|world| corners(&world.triangle(triangle_ix as usize)));
                let weights = weights(&corners[0], ray);
                let point = |corners: &[DVec3; 3]| -> DVec3 { (0..3).map(|ix| weights[ix] * corners[ix]).sum() };
                [0, 1].map(|ix| views[ix].place(point(&corners[ix])))
            }
        };
        let way = match places {
            [Some(from), Some(to)] if (to - from).is_finite() => to - from,
            _ => DVec2::ZERO,
        };
        // Zero has no sign.
        [way.x as f32, 0.0 - way.y as f32]
    };
    worlds.iter().for_each(|world| world.triangles.make());
    pixel_aovs.par_iter().enumerate().map(vector).collect()
}

fn corners(&Triangle { v0, v1, v2, .. }: &Triangle) -> [DVec3; 3] {
    [v0, v1, v2].map(|corner| corner.as_dvec3())
}

/// Returns the weights of a triangle's corners at the point in which a ray meets its plane, or at the triangle's edge
/// beside it. If the ray lies in the plane, they are those of some point of the triangle, or NaN.
fn weights([a, b, c]: &[DVec3; 3], (origin, direction): (DVec3, DVec3)) -> [f64; 3] {
    let (edges, offset) = ([b - a, c - a], origin - a);
    let p = direction.cross(edges[1]);
    let determinant = edges[0].dot(p);
    let u = (offset.dot(p) / determinant).clamp(0.0, 1.0);
    let v = direction.dot(offset.cross(edges[0])) / determinant;
    let v = v.max(0.0).min(1.0 - u);
    [1.0 - u - v, u, v]
}

/// A camera and its picture.
struct View {
    eye: DVec3,
    plane: ImagePlane,
    is_orthographic: bool,
    /// Pixels.
    size: DVec2,
}

impl View {
    fn new(camera: &Camera, size: DVec2) -> Self {
        let plane = ImagePlane::new(camera, size.x / size.y);
        Self { eye: camera.eye.as_dvec3(), plane, is_orthographic: camera.is_orthographic(), size }
    }

    /// Returns origin and direction of the ray through a place of the picture, pixels from its upper left corner.
    fn ray(&self, place: DVec2) -> (DVec3, DVec3) {
        let ImagePlane { forward, right, up } = self.plane;
        let at = 2.0 * place / self.size - 1.0;
        let offset = at.x * right - at.y * up;
        if self.is_orthographic { (self.eye + offset, forward) } else { (self.eye, forward + offset) }
    }

    /// Returns where a point is in the picture; none if it is not before the eye.
    fn place(&self, point: DVec3) -> Option<DVec2> {
        let offset = point - self.eye;
        self.place_of_offset(offset, if self.is_orthographic { 1.0 } else { offset.dot(self.plane.forward) })
    }

    /// Returns where the points of a direction are that are infinitely far away.
    fn place_of_direction(&self, direction: DVec3) -> Option<DVec2> {
        let depth = if self.is_orthographic { 0.0 } else { direction.dot(self.plane.forward) };
        self.place_of_offset(direction, depth)
    }

    /// `depth`: what divides the offset from the eye.
    fn place_of_offset(&self, offset: DVec3, depth: f64) -> Option<DVec2> {
        let ImagePlane { right, up, .. } = self.plane;
        let at = dvec2(offset.dot(right) / right.length_squared(), -offset.dot(up) / up.length_squared()) / depth;
        (depth > 0.0).then(|| (at + 1.0) / 2.0 * self.size)
    }
}
