//! Transforms that place a mesh in the world.

use std::fmt::Debug;

use glam::{DMat3, DMat4, DQuat, DVec3, Vec3};
use serde::Deserialize;

use super::{
    error::Checked,
    keys::{KeyValue, Track},
};

/// A transform as a scene file describes it: the mesh is scaled, then rotated, then translated.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct TransformSpec {
    translate: Option<[f32; 3]>,
    rotate: Option<RotationSpec>,
    scale: Option<ScaleSpec>,
}

#[derive(Clone, Debug, Deserialize)]
#[serde(untagged, expecting = "expected [x, y, z] in degrees or { axis = [x, y, z], angle = degrees }")]
enum RotationSpec {
    /// Rotations about x, then y, then z, degrees.
    Euler([f32; 3]),
    AxisAngle(AxisAngle),
}

#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct AxisAngle {
    axis: [f32; 3],
    /// Angle of the rotation in degrees.
    angle: f32,
}

#[derive(Clone, Debug, Deserialize)]
#[serde(untagged, expecting = "expected a number or [x, y, z]")]
enum ScaleSpec {
    Uniform(f32),
    Axes([f32; 3]),
}

/// A transform from object space to world space: an invertible linear map, then a translation.
///
/// It is applied in f64, so that the identity changes no coordinate.
#[derive(Clone, Debug, PartialEq)]
pub struct Transform {
    linear: DMat3,
    translation: DVec3,
    /// The inverse transpose of `linear`, up to a positive factor.
    normals: DMat3,
    /// Whether `linear` is a reflection.
    mirrors: bool,
}

impl Default for Transform {
    /// The identity.
    fn default() -> Self {
        Self::IDENTITY
    }
}

impl Transform {
    /// The identity, which changes no coordinate.
    pub const IDENTITY: Self =
        Self { linear: DMat3::IDENTITY, translation: DVec3::ZERO, normals: DMat3::IDENTITY, mirrors: false };

    /// Makes the transform that scales a mesh along its axes, then rotates it, then moves it. A negative factor of
    /// `scale` reflects the mesh.
    ///
    /// # Errors
    /// A factor of `scale` is 0, or a number is not finite. The error is a message for people.
    pub fn new(scale: DVec3, rotation: DQuat, translation: DVec3) -> Result<Self, String> {
        if !(scale.is_finite() && rotation.is_finite() && translation.is_finite()) {
            return Err("the transform has a number that is not finite".to_owned());
        }
        if scale.abs().min_element() == 0.0 {
            return Err(format!("scale = {:?} flattens the mesh: no factor may be 0", scale.to_array()));
        }
        let rotation = DMat3::from_quat(rotation);
        // The inverse is multiplied by the smallest factor's size, so that it does not overflow for tiny scales.
        let inverse_scale = scale.abs().min_element() / scale;
        Ok(Self {
            linear: rotation * DMat3::from_diagonal(scale),
            translation,
            normals: rotation * DMat3::from_diagonal(inverse_scale),
            mirrors: scale.x * scale.y * scale.z < 0.0,
        })
    }

    /// Makes the transform of an affine matrix, which may shear a mesh. The last row of the matrix is ignored.
    ///
    /// # Errors
    /// The matrix flattens the mesh, or a number is not finite. The error is a message for people.
    pub fn of_affine(world_from_object: DMat4) -> Result<Self, String> {
        if !world_from_object.is_finite() {
            return Err("the transform has a number that is not finite".to_owned());
        }
        let linear = DMat3::from_mat4(world_from_object);
        // Each of the determinant's six products is rounded to 2^-53 of at most the product of the columns' lengths.
        let DMat3 { x_axis, y_axis, z_axis } = scaled_to_one(linear);
        let noise = 6.0 * f64::EPSILON * x_axis.length() * y_axis.length() * z_axis.length();
        let determinant = scaled_to_one(linear).determinant();
        if !(determinant.abs() > noise) {
            return Err("the transform flattens the mesh".to_owned());
        }
        let translation = world_from_object.w_axis.truncate();
        Ok(Self { linear, translation, normals: normals_of(linear), mirrors: determinant < 0.0 })
    }

    /// Returns the transform that applies `inner`, then this one.
    pub(crate) fn after(&self, inner: &Self) -> Self {
        // The identity must not even round the normals.
        if *self == Self::IDENTITY {
            return inner.clone();
        }
        Self {
            linear: self.linear * inner.linear,
            translation: self.linear * inner.translation + self.translation,
            normals: scaled_to_one(self.normals * inner.normals),
            mirrors: self.mirrors != inner.mirrors,
        }
    }

    /// Returns the transform that is followed by a translation.
    pub(crate) fn moved(&self, by: DVec3) -> Self {
        Self { translation: self.translation + by, ..self.clone() }
    }

    /// Returns a point of object space in world space.
    pub fn point(&self, p: Vec3) -> Vec3 {
        (self.linear * p.as_dvec3() + self.translation).as_vec3()
    }

    /// Returns a normal and an offset such that `normal.dot(p) + offset` is the height of a point p of object space
    /// above the point `above` of world space. `direction` says where up is, and its length scales the height.
    pub(crate) fn height_in_object_space(&self, direction: DVec3, above: DVec3) -> (DVec3, f64) {
        (self.linear.transpose() * direction, direction.dot(self.translation - above))
    }

    /// Returns the linear map from object space to world space.
    pub(crate) fn linear(&self) -> DMat3 {
        self.linear
    }

    /// Returns where the origin of object space is in world space.
    pub(crate) fn translation(&self) -> DVec3 {
        self.translation
    }

    /// Returns a surface normal of object space in world space: unit length, or zero if `n` is zero.
    pub fn normal(&self, n: Vec3) -> Vec3 {
        (self.normals * n.as_dvec3()).normalize_or_zero().as_vec3()
    }

    /// Returns a tangent of object space in world space: unit length, or zero if `t` is zero.
    pub fn tangent(&self, t: Vec3) -> Vec3 {
        (self.linear * t.as_dvec3()).normalize_or_zero().as_vec3()
    }

    /// Returns whether the transform is a reflection. A reflection reverses the winding of triangles, so two of a
    /// triangle's corners must be swapped for its outside to stay outside.
    pub fn mirrors(&self) -> bool {
        self.mirrors
    }
}

/// Returns a linear map divided by its largest coefficient's size, so that products of three coefficients neither
/// overflow nor underflow.
fn scaled_to_one(linear: DMat3) -> DMat3 {
    let largest = linear.to_cols_array().into_iter().fold(0.0, |largest: f64, x| largest.max(x.abs()));
    if largest > 0.0 { linear * largest.recip().min(f64::MAX) } else { linear }
}

/// Returns the inverse transpose of a linear map up to a positive factor. Unlike the inverse, it exists for all maps.
pub(crate) fn normals_of(linear: DMat3) -> DMat3 {
    let DMat3 { x_axis, y_axis, z_axis } = scaled_to_one(linear);
    let cofactors = DMat3::from_cols(y_axis.cross(z_axis), z_axis.cross(x_axis), x_axis.cross(y_axis));
    if linear.determinant() < 0.0 { -cofactors } else { cofactors }
}

/// The components of a transform that are stated.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Components {
    translation: Option<DVec3>,
    rotation: Option<DQuat>,
    scale: Option<DVec3>,
}

impl Components {
    fn transform(&self) -> Checked<Transform> {
        let Self { translation, rotation, scale } = *self;
        Transform::new(scale.unwrap_or(DVec3::ONE), rotation.unwrap_or_default(), translation.unwrap_or_default())
    }
}

/// A transform that changes with time.
#[derive(Clone, Debug, Default)]
pub(crate) struct MovingTransform {
    /// What is stated beside the keys.
    rest: Components,
    translation: Track<DVec3>,
    rotation: Track<DQuat>,
    scale: Track<DVec3>,
    /// The times of the keys, ascending.
    times: Vec<f64>,
}

impl MovingTransform {
    /// Joins keys in the order of their times, seconds. Each may state some components of the transform. Errors name
    /// the key.
    pub fn new(rest: &TransformSpec, keys: &[(f64, TransformSpec)]) -> Checked<Self> {
        let mut moving = Self { rest: rest.components()?, ..Self::default() };
        moving.rest.transform()?;
        for (number, (time, spec)) in (1..).zip(keys) {
            let checked = spec.components().and_then(|components| components.transform().map(|_| components));
            let components = checked.map_err(|what| format!("key {number}: {what}"))?;
            let is_turned = |scale: DVec3, before: DVec3| scale.signum() != before.signum();
            if components.scale.zip(moving.scale.0.last()).is_some_and(|(scale, (_, before))| is_turned(scale, *before))
            {
                return Err(format!("key {number}: its scale mirrors the mesh, which would be flat before this key"));
            }
            moving.translation.0.extend(components.translation.map(|it| (*time, it)));
            moving.rotation.0.extend(components.rotation.map(|it| (*time, it)));
            moving.scale.0.extend(components.scale.map(|it| (*time, it)));
            moving.times.push(*time);
        }
        Ok(moving)
    }

    /// Returns the transform at a moment, seconds: what no key states is as at rest. Without a moment, returns the
    /// transform at rest: what is not stated there is as the first key has it.
    ///
    /// Coordinates between keys are rounded to single precision, as those in a file are.
    pub fn at(&self, seconds: Option<f64>) -> Checked<Transform> {
        let single = |vector: DVec3| vector.as_vec3().as_dvec3();
        let components = Components {
            translation: at(&self.translation, self.rest.translation, seconds).map(single),
            rotation: at(&self.rotation, self.rest.rotation, seconds),
            scale: at(&self.scale, self.rest.scale, seconds).map(single),
        };
        components.transform()
    }

    /// Returns the times of the keys, ascending. A transform without keys does not move.
    pub fn times(&self) -> &[f64] {
        &self.times
    }
}

fn at<T: KeyValue>(track: &Track<T>, rest: Option<T>, seconds: Option<f64>) -> Option<T> {
    match seconds {
        Some(seconds) => track.at(seconds).or(rest),
        None => rest.or_else(|| track.at(f64::NEG_INFINITY)),
    }
}

impl TransformSpec {
    fn components(&self) -> Checked<Components> {
        let scale = self.scale.as_ref().map(|scale| match *scale {
            ScaleSpec::Uniform(factor) => [factor; 3],
            ScaleSpec::Axes(factors) => factors,
        });
        Ok(Components {
            translation: self.translate.map(|translate| finite("translate", translate)).transpose()?,
            rotation: self.rotate.as_ref().map(RotationSpec::rotation).transpose()?,
            scale: scale.map(|scale| finite("scale", scale)).transpose()?,
        })
    }
}

impl RotationSpec {
    fn rotation(&self) -> Checked<DQuat> {
        match self {
            Self::Euler(degrees) => {
                let [x, y, z] = finite("rotate", *degrees)?.to_array().map(f64::to_radians);
                Ok(DQuat::from_rotation_z(z) * DQuat::from_rotation_y(y) * DQuat::from_rotation_x(x))
            }
            Self::AxisAngle(AxisAngle { axis, angle }) => {
                let direction = finite("rotate.axis", *axis)?.try_normalize();
                let direction = direction.ok_or_else(|| format!("rotate.axis = {axis:?} has no direction"))?;
                let angle = finite("rotate.angle", [*angle, 0.0, 0.0])?.x;
                Ok(DQuat::from_axis_angle(direction, angle.to_radians()))
            }
        }
    }
}

/// Checks that three numbers are finite.
pub(crate) fn finite<T: Copy + Debug + Into<f64>>(name: &str, value: [T; 3]) -> Checked<DVec3> {
    let vector = DVec3::from_array(value.map(Into::into));
    if vector.is_finite() { Ok(vector) } else { Err(format!("{name} = {value:?} is not finite")) }
}
