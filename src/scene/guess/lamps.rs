//! The rule that tells surfaces which light a scene, as lamps do, from those which only glow, as the lights of a car
//! do.
//!
//! A file without lights that has lamps is shown in their light. So they have to light most of the picture: what is
//! left would be nearly black. A scene file that states an integrator has decided already: only paths show such light.

use std::f32::consts::PI;

use glam::Vec3;

use super::few_rays::{Hit, Ray, hits, view_rays};
use crate::{
    frame::Integrator,
    scene::model::{Instance, Material, Scene, lighting::N_PLACES},
};

/// Least power of all lamps of a scene for its whole area, in units of white paper in full light. In an interior, the
/// walls send the light on, and the exposure is measured: the lamp of a Cornell box has less than a hundredth of its
/// surface.
const LEAST_LAMPLIGHT: f64 = 0.1;
const LEAST_LAMPLIGHT_INSIDE: f64 = 0.01;
/// Numbers of places in the picture whose light is estimated, across and down.
const N_SEEN: (usize, usize) = (12, 8);
/// Number of points on lamps that stand for all of them.
const N_LAMP_POINTS: usize = 64;
/// A place is lit if its irradiance is more than this share of the mean of all places. The exposure is measured, so
/// that only the ratio counts.
const LEAST_IRRADIANCE: f32 = 0.2;
/// Least share of the places that are lit, where lamps light a scene.
const LEAST_LIT: f32 = 0.75;

/// A point on a lamp.
struct LampPoint {
    position: Vec3,
    /// Unit normal of its triangle.
    normal: Vec3,
}

/// A triangle of a scene, world space.
struct Triangle {
    corners: [Vec3; 3],
    area: f32,
    normal: Vec3,
}

/// The light of lamps.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Lamplight {
    /// Mean radiance of white paper at the places that the camera sees, as if nothing cast shadows. It is 0 in
    /// interiors, if the camera sees nothing but lamps, and if the integrator `path` is stated.
    pub mean: f32,
    /// Whether surfaces count as lamps only because the integrator `path` is stated.
    pub is_stated: bool,
}

/// The triangles that give off light, each with the sum of all powers up to its own, and the indices of its instance
/// and its face.
type Lamps = Vec<(f64, (usize, usize))>;

impl Scene {
    /// Returns the light of surfaces if they light the scene as lamps do. Some are brighter than white paper in full
    /// light, and together they give off so much light that other surfaces get some of it. In an interior that is
    /// enough, since its walls send the light everywhere. Outside, the lamps must reach most of what the camera sees.
    ///
    /// `stated`: the integrator that the file or the user states. `Path` shows the light of all bright surfaces, and
    /// that is why it is stated; `Whitted` shows none.
    pub(crate) fn lamplight(&self, is_interior: bool, stated: Option<Integrator>) -> Option<Lamplight> {
        let is_bright = self.materials.iter().any(|material| material.ke.max_element() > 1.0);
        if !is_bright || stated == Some(Integrator::Whitted) {
            return None;
        }
        let emission: Vec<f32> = self.materials.iter().map(|material| self.mean_emission(material)).collect();
        let (area, lamps) = self.lamps(&emission);
        let (power, _) = *lamps.last()?;
        let least = if is_interior { LEAST_LAMPLIGHT_INSIDE } else { LEAST_LAMPLIGHT };
        let by_rule = match is_interior {
            _ if power < least * area => None,
            true => Some(0.0),
            // Asked for paths, somebody wants to see the light of the lamps, and it alone.
            false if stated.is_some() => self.even_lamplight(&emission, &lamps).map(|_| 0.0),
            false => self.even_lamplight(&emission, &lamps),
        };
        match (by_rule, stated) {
            (Some(mean), _) => Some(Lamplight { mean, is_stated: false }),
            (None, Some(_)) => Some(Lamplight { mean: 0.0, is_stated: true }),
            (None, None) => None,
        }
    }

    /// Returns the area of all triangles, and the lamps.
    fn lamps(&self, emission: &[f32]) -> (f64, Lamps) {
        let (mut area, mut power, mut lamps) = (0.0, 0.0, Vec::new());
        for (instance_ix, instance) in self.instances.iter().enumerate() {
            for face_ix in 0..self.meshes[instance.mesh_ix].faces.len() {
                let triangle = self.triangle(instance, face_ix);
                let of_face = f64::from(triangle.area * emission[self.material_ix(instance, face_ix)]);
                area += f64::from(triangle.area);
                if of_face > 0.0 {
                    power += of_face;
                    lamps.push((power, (instance_ix, face_ix)));
                }
            }
        }
        (area, lamps)
    }

    /// Returns the mean radiance of white paper where the camera sees it, if lamps light most of that. It is 0 if the
    /// camera sees nothing but lamps. What casts shadows does not count.
    fn even_lamplight(&self, emission: &[f32], lamps: &Lamps) -> Option<f32> {
        let points = self.lamp_points(lamps);
        let power_of_point = lamps.last().map_or(0.0, |(power, _)| *power as f32) / N_LAMP_POINTS as f32;
        let rays = view_rays(&self.camera, self.defaults.width as f32 / self.defaults.height as f32, N_SEEN);
        let hits = hits(self, &rays);
        let irradiance = |(ray, hit): (&Ray, Hit)| {
            let instance = &self.instances[hit.instance_ix as usize];
            let face_ix = hit.face_ix as usize;
            let is_lamp = emission[self.material_ix(instance, face_ix)] > 0.0;
            (!is_lamp).then(|| self.triangle(instance, face_ix).irradiance(ray, hit.t, &points))
        };
        let seen = rays.iter().zip(&hits).filter_map(|(ray, hits)| irradiance((ray, hits.first?)));
        let seen: Vec<f32> = seen.collect();
        let mean = seen.iter().sum::<f32>() / seen.len().max(1) as f32;
        let n_lit = seen.iter().filter(|irradiance| **irradiance > LEAST_IRRADIANCE * mean).count();
        let is_lit = n_lit as f32 >= LEAST_LIT * seen.len() as f32;
        is_lit.then_some(mean * power_of_point / PI)
    }

    /// Returns points on lamps, in proportion to the power of their triangles.
    fn lamp_points(&self, lamps: &Lamps) -> Vec<LampPoint> {
        let power = lamps.last().map_or(0.0, |(power, _)| *power);
        let point = |ix: usize| {
            let at = power * (ix as f64 + 0.5) / N_LAMP_POINTS as f64;
            let lamp_ix = lamps.partition_point(|(power, _)| *power < at).min(lamps.len() - 1);
            let (_, (instance_ix, face_ix)) = lamps[lamp_ix];
            let Triangle { corners: [a, b, c], normal, .. } = self.triangle(&self.instances[instance_ix], face_ix);
            // The R2 sequence, folded into the triangle.
            let [u, v] = [0.754_877_7, 0.569_840_3].map(|step: f32| (ix as f32 * step).fract());
            let [u, v] = if u + v > 1.0 { [1.0 - u, 1.0 - v] } else { [u, v] };
            LampPoint { position: a + u * (b - a) + v * (c - a), normal }
        };
        (0..N_LAMP_POINTS).map(point).collect()
    }

    fn triangle(&self, Instance { mesh_ix, transform, .. }: &Instance, face_ix: usize) -> Triangle {
        let mesh = &self.meshes[*mesh_ix];
        let corners @ [a, b, c] = mesh.faces[face_ix].map(|ix| transform.point(mesh.positions[ix as usize]));
        let cross = (b - a).cross(c - a);
        Triangle { corners, area: cross.length() / 2.0, normal: cross.normalize_or_zero() }
    }

    pub(super) fn material_ix(&self, Instance { mesh_ix, materials, .. }: &Instance, face_ix: usize) -> usize {
        materials[self.meshes[*mesh_ix].slots[face_ix] as usize % materials.len()] as usize
    }

    /// Returns the mean of what a material emits over the image of its emission.
    fn mean_emission(&self, material: &Material) -> f32 {
        let ke = material.ke.max_element();
        let Some(map) = material.maps.emission.as_ref().filter(|_| ke > 0.0) else { return ke };
        let value = |ix: usize| self.colour_of_map(map, (ix as f32 + 0.5) / N_PLACES as f32);
        ke * (0..N_PLACES).map(value).sum::<f32>() / N_PLACES as f32
    }
}

impl Triangle {
    /// Returns the irradiance at the place where a ray hits the triangle at `t`, on the side that the ray meets, as if
    /// nothing cast shadows and each point of a lamp had the power 1.
    fn irradiance(&self, ray: &Ray, t: f32, lamps: &[LampPoint]) -> f32 {
        let position = ray.origin + t * ray.direction;
        let normal = if self.normal.dot(ray.direction) > 0.0 { -self.normal } else { self.normal };
        let from = |lamp: &LampPoint| {
            let to_lamp = lamp.position - position;
            let direction = to_lamp.normalize_or_zero();
            let cosines = normal.dot(direction).max(0.0) * lamp.normal.dot(direction).abs();
            cosines / to_lamp.length_squared().max(f32::MIN_POSITIVE)
        };
        lamps.iter().map(from).sum()
    }
}
