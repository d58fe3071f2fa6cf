//! Indexed meshes in object space, and their way into world space.

use glam::{DMat3, DQuat, DVec3, Vec3};
use rayon::prelude::*;
use serde::Deserialize;

use super::{error::Checked, normal::encode_octahedral};
use crate::layout::{FLAT_NORMAL, Triangle};

/// World coordinates beyond this are refused: the squared length of a triangle's unnormalized normal, at most
/// (2 sqrt(3) * 1e9)^4 = 1.5e38, must not overflow an f32 (3.4e38).
pub const MAX_COORDINATE: f32 = 1e9;

/// Triangles that share points.
#[derive(Clone, Debug, Default)]
pub struct Mesh {
    /// Object space.
    pub positions: Vec<Vec3>,
    /// Indices into `positions`, counter-clockwise seen from outside.
    pub faces: Vec<[u32; 3]>,
    /// One entry a face: unit shading normals at its corners, zero for the face's own plane.
    pub normals: Vec<[Vec3; 3]>,
    /// One entry a face: which of the mesh's materials it has.
    pub slots: Vec<u32>,
}

impl Mesh {
    /// Adds a face of slot `slot` that is shaded as the plane it is.
    pub fn push_flat(&mut self, face: [u32; 3], slot: u32) {
        self.faces.push(face);
        self.normals.push([Vec3::ZERO; 3]);
        self.slots.push(slot);
    }

    /// Adds a point and returns its index.
    pub fn push_position(&mut self, position: Vec3) -> u32 {
        self.positions.push(position);
        (self.positions.len() - 1) as u32
    }

    /// Adds another mesh, without joining any points.
    pub fn append(&mut self, other: Mesh) {
        let first = self.positions.len() as u32;
        self.positions.extend(other.positions);
        self.faces.extend(other.faces.iter().map(|face| face.map(|ix| first + ix)));
        self.normals.extend(other.normals);
        self.slots.extend(other.slots);
    }

    /// One world-space triangle a face, in their order.
    pub fn to_world(&self, transform: &Transform) -> Checked<Vec<Triangle>> {
        let world: Vec<Vec3> = self.positions.par_iter().map(|p| transform.point(*p)).collect();
        let is_inside = |p: &Vec3| p.is_finite() && p.abs().max_element() <= MAX_COORDINATE;
        if let Some(ix) = world.par_iter().position_first(|p| !is_inside(p)) {
            return Err(format!(
                "a vertex lies at {:?} in world space: beyond {MAX_COORDINATE:e}",
                world[ix].to_array()
            ));
        }
        let triangle = |(face, normals): (&[u32; 3], &[Vec3; 3])| {
            let [a, b, c] = if transform.mirrors { [0, 2, 1] } else { [0, 1, 2] };
            Triangle {
                v0: world[face[a] as usize],
                n0: transform.normal(normals[a]),
                v1: world[face[b] as usize],
                n1: transform.normal(normals[b]),
                v2: world[face[c] as usize],
                n2: transform.normal(normals[c]),
            }
        };
        Ok(self.faces.par_iter().zip(&self.normals).map(triangle).collect())
    }
}

/// How a mesh is placed: scaled, then rotated, then translated.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct TransformSpec {
    translate: Option<[f32; 3]>,
    rotate: Option<RotationSpec>,
    scale: Option<ScaleSpec>,
}

#[derive(Clone, Debug, Deserialize)]
#[serde(untagged, expecting = "expected [x, y, z] in degrees or { axis = [x, y, z], angle = degrees }")]
enum RotationSpec {
    /// Degrees about x, then y, then z.
    Euler([f32; 3]),
    AxisAngle(AxisAngle),
}

#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct AxisAngle {
    axis: [f32; 3],
    /// Degrees.
    angle: f32,
}

#[derive(Clone, Debug, Deserialize)]
#[serde(untagged, expecting = "expected a number or [x, y, z]")]
enum ScaleSpec {
    Uniform(f32),
    Axes([f32; 3]),
}

/// World from object. Computed in f64, so that the identity leaves every bit as it was.
#[derive(Clone, Debug)]
pub struct Transform {
    linear: DMat3,
    translation: DVec3,
    /// The inverse transpose of `linear`, but for a positive factor.
    normals: DMat3,
    /// A reflection: corners change their order so that outside stays outside.
    mirrors: bool,
}

impl Transform {
    pub const IDENTITY: Self =
        Self { linear: DMat3::IDENTITY, translation: DVec3::ZERO, normals: DMat3::IDENTITY, mirrors: false };

    fn point(&self, p: Vec3) -> Vec3 {
        (self.linear * p.as_dvec3() + self.translation).as_vec3()
    }

    /// Encoded; a zero normal is the flat one.
    fn normal(&self, n: Vec3) -> u32 {
        let world = (self.normals * n.as_dvec3()).normalize_or_zero();
        if world == DVec3::ZERO { FLAT_NORMAL } else { encode_octahedral(world.as_vec3()) }
    }
}

impl TransformSpec {
    /// The transform, where it is finite and can be inverted.
    pub fn transform(&self) -> Checked<Transform> {
        let translation = finite("translate", self.translate.unwrap_or_default())?;
        let scale = match self.scale {
            None => [1.0; 3],
            Some(ScaleSpec::Uniform(factor)) => [factor; 3],
            Some(ScaleSpec::Axes(factors)) => factors,
        };
        let scale = finite("scale", scale)?;
        if scale.abs().min_element() == 0.0 {
            return Err(format!("scale = {:?} flattens the mesh: no factor may be 0", scale.to_array()));
        }
        let rotation = DMat3::from_quat(self.rotation()?);
        // Relative to the smallest factor, so that tiny scales do not overflow.
        let inverse_scale = scale.abs().min_element() / scale;
        Ok(Transform {
            linear: rotation * DMat3::from_diagonal(scale),
            translation,
            normals: rotation * DMat3::from_diagonal(inverse_scale),
            mirrors: scale.x * scale.y * scale.z < 0.0,
        })
    }

    fn rotation(&self) -> Checked<DQuat> {
        match &self.rotate {
            None => Ok(DQuat::IDENTITY),
            Some(RotationSpec::Euler(degrees)) => {
                let [x, y, z] = finite("rotate", *degrees)?.to_array().map(f64::to_radians);
                Ok(DQuat::from_rotation_z(z) * DQuat::from_rotation_y(y) * DQuat::from_rotation_x(x))
            }
            Some(RotationSpec::AxisAngle(AxisAngle { axis, angle })) => {
                let direction = finite("rotate.axis", *axis)?.try_normalize();
                let direction = direction.ok_or_else(|| format!("rotate.axis = {axis:?} has no direction"))?;
                let angle = finite("rotate.angle", [*angle, 0.0, 0.0])?.x;
                Ok(DQuat::from_axis_angle(direction, angle.to_radians()))
            }
        }
    }
}

/// Three finite numbers.
pub(super) fn finite(name: &str, value: [f32; 3]) -> Checked<DVec3> {
    let vector = Vec3::from_array(value);
    if vector.is_finite() { Ok(vector.as_dvec3()) } else { Err(format!("{name} = {value:?} is not finite")) }
}
