//! Morph targets and skins in the pose that the file gives. Animations are not shown.

use std::collections::HashMap;

use glam::{DMat3, DMat4, DVec3, Vec3};
use gltf::{
    Semantic,
    json::{
        Index,
        accessor::Type,
        mesh::{MorphTarget, Primitive},
        validation::Checked::Valid,
    },
};
use serde::Deserialize;

use super::{accessor::Accessor, document::Document, geometry::Attributes};
use crate::scene::model::{error::Checked, transform::normals_of};

/// The morph targets of a primitive whose weight is not 0.
pub(super) struct Morph<'a> {
    targets: Vec<Target<'a>>,
}

/// A morph target: what it adds to positions, normals and tangents.
struct Target<'a> {
    weight: f32,
    added: [Option<Accessor<'a>>; 3],
}

impl<'a> Morph<'a> {
    /// Returns the morph targets of a primitive of `n` vertices, or `None` if none has a weight.
    pub fn new(attributes: &Attributes<'a>, weights: &[f32], n: usize) -> Checked<Option<Self>> {
        let targets = attributes.primitive.targets.iter().flatten().zip(weights).enumerate();
        let targets = targets.filter(|(_, (_, weight))| **weight != 0.0);
        let targets = targets.map(|(ix, (target, weight))| Target::new(attributes, (ix, target), *weight, n));
        let targets: Vec<_> = targets.collect::<Checked<_>>()?;
        Ok((!targets.is_empty()).then_some(Self { targets }))
    }

    /// Returns position, normal and tangent of the vertex with index `ix`.
    pub fn apply(&self, ix: usize, mut vertex: [Vec3; 3]) -> Checked<[Vec3; 3]> {
        for target in &self.targets {
            for (vector, added) in vertex.iter_mut().zip(&target.added) {
                if let Some(added) = added {
                    *vector += target.weight * Vec3::from_array(added.numbers(ix, 0.0)?);
                }
            }
        }
        Ok(vertex)
    }
}

/// What the morph targets of a primitive add to texture coordinates or colours.
#[derive(Default)]
pub(super) struct Added<'a>(Vec<(f32, Accessor<'a>)>);

impl<'a> Added<'a> {
    /// Returns what targets with weights add to an attribute of `n` vertices.
    pub fn new(
        attributes: &Attributes<'a>,
        semantic: &Semantic,
        types: &[Type],
        (weights, n): (&[f32], usize),
    ) -> Checked<Self> {
        let name = semantic.to_string();
        let mut added = Vec::new();
        for (ix, (target, weight)) in attributes.targets.iter().zip(weights).enumerate() {
            let Some(accessor) = target.get(&name).filter(|_| *weight != 0.0) else { continue };
            let path = format!("{}.targets[{ix}].{name}", attributes.path);
            added.push((*weight, attributes.accessor(Index::new(*accessor), types, Some(n), path)?));
        }
        Ok(Self(added))
    }

    /// Returns the value at the vertex with index `ix`, which is `value` without targets.
    pub fn to<const N: usize>(&self, ix: usize, mut value: [f32; N]) -> Checked<[f32; N]> {
        for (weight, accessor) in &self.0 {
            let added: [f32; N] = accessor.numbers(ix, 0.0)?;
            value.iter_mut().zip(added).for_each(|(value, added)| *value += weight * added);
        }
        Ok(value)
    }

    /// Returns the colour at a vertex, as [`Added::to`] does. Colours that targets change are clamped to 0 to 1.
    pub fn to_colour(&self, ix: usize, colour: [f32; 4]) -> Checked<[f32; 4]> {
        let changed = self.to(ix, colour)?;
        Ok(if self.0.is_empty() { changed } else { changed.map(|number| number.clamp(0.0, 1.0)) })
    }
}

/// The attributes of a morph target, as indices of accessors. The crate `gltf` does not read all of them.
pub(super) type TargetAttributes = HashMap<String, u32>;

/// The morph targets of a document, by its meshes and their primitives.
#[derive(Default, Deserialize)]
pub(super) struct MorphTargets {
    #[serde(default)]
    meshes: Vec<OfMesh>,
}

#[derive(Deserialize)]
struct OfMesh {
    #[serde(default)]
    primitives: Vec<OfPrimitive>,
}

#[derive(Deserialize)]
struct OfPrimitive {
    targets: Option<Vec<TargetAttributes>>,
}

impl MorphTargets {
    /// Returns the morph targets of a primitive.
    pub fn of(&self, mesh_ix: usize, primitive_ix: usize) -> &[TargetAttributes] {
        let primitive = self.meshes.get(mesh_ix).and_then(|mesh| mesh.primitives.get(primitive_ix));
        primitive.and_then(|primitive| primitive.targets.as_deref()).unwrap_or_default()
    }
}

impl<'a> Target<'a> {
    fn new(attributes: &Attributes<'a>, (ix, target): (usize, &MorphTarget), weight: f32, n: usize) -> Checked<Self> {
        let MorphTarget { positions, normals, tangents } = target;
        let accessor = |index: &Option<_>, name: &str| {
            let path = format!("{}.targets[{ix}].{name}", attributes.path);
            index.map(|index| attributes.accessor(index, &[Type::Vec3], Some(n), path)).transpose()
        };
        let added = [accessor(positions, "POSITION")?, accessor(normals, "NORMAL")?, accessor(tangents, "TANGENT")?];
        Ok(Self { weight, added })
    }
}

/// Returns whether a skin can move a primitive.
pub(super) fn has_joints(primitive: &Primitive) -> bool {
    [Semantic::Joints(0), Semantic::Weights(0)].into_iter().all(|it| primitive.attributes.contains_key(&Valid(it)))
}

/// A skin: for each joint the transform of vertices that it moves alone.
pub(super) struct Skin {
    /// JSON path.
    path: String,
    world_from_mesh: Vec<DMat4>,
    /// The point of world space from which the positions count that it gives. It is subtracted before they are rounded
    /// to single precision.
    pub origin: DVec3,
}

/// A skin as it moves a primitive's vertices.
pub(super) struct Skinning<'a> {
    skin: &'a Skin,
    /// Joints and weights, four in each set.
    sets: Vec<[Accessor<'a>; 2]>,
}

impl Skin {
    /// Makes a skin from its joints' transforms. `inverse_bind` is the accessor of the matrices that come before them.
    pub fn new(document: &Document, ix: usize, world_from_joints: Vec<DMat4>) -> Checked<Self> {
        let path = format!("skins[{ix}]");
        let mut world_from_mesh = world_from_joints;
        if let Some(index) = document.root.skins[ix].inverse_bind_matrices {
            let path = format!("{path}.inverseBindMatrices");
            let matrices = Accessor::new(document, index, &[Type::Mat4], path)?;
            if matrices.n < world_from_mesh.len() {
                return Err(format!("{}: has {} of {} matrices", matrices.path, matrices.n, world_from_mesh.len()));
            }
            for (ix, matrix) in world_from_mesh.iter_mut().enumerate() {
                *matrix *= glam::Mat4::from_cols_array(&matrices.numbers(ix, 0.0)?).as_dmat4();
            }
        }
        Ok(Self { path, world_from_mesh, origin: DVec3::ZERO })
    }

    /// Returns the skin as it moves a primitive of `n` vertices.
    pub fn of<'a>(&'a self, attributes: &Attributes<'a>, n: usize) -> Checked<Skinning<'a>> {
        let mut sets = Vec::new();
        for set in 0.. {
            let joints = attributes.find(Semantic::Joints(set), &[Type::Vec4], Some(n))?;
            let weights = attributes.find(Semantic::Weights(set), &[Type::Vec4], Some(n))?;
            let (Some(joints), Some(weights)) = (joints, weights) else { break };
            sets.push([joints, weights]);
        }
        if sets.is_empty() {
            return Err(format!("{}.attributes: a node has a skin, but there are no joints", attributes.path));
        }
        Ok(Skinning { skin: self, sets })
    }
}

impl Skinning<'_> {
    /// Returns position, normal and tangent of the vertex with index `ix` in world space, moved by the skin's origin.
    pub fn apply(&self, ix: usize, [position, normal, tangent]: [Vec3; 3]) -> Checked<[Vec3; 3]> {
        let matrix = self.matrix(ix)?;
        let linear = DMat3::from_mat4(matrix);
        let position = (matrix.transform_point3(position.as_dvec3()) - self.skin.origin).as_vec3();
        let normal = (normals_of(linear) * normal.as_dvec3()).normalize_or_zero().as_vec3();
        let tangent = (linear * tangent.as_dvec3()).normalize_or_zero().as_vec3();
        Ok([position, normal, tangent])
    }

    /// Returns whether the skin mirrors the neighbourhood of the vertex with index `ix`.
    pub fn mirrors(&self, ix: usize) -> Checked<bool> {
        Ok(DMat3::from_mat4(self.matrix(ix)?).determinant() < 0.0)
    }

    /// Returns the weighted mean of the joints' transforms.
    fn matrix(&self, ix: usize) -> Checked<DMat4> {
        let (mut sum, mut total) = (DMat4::ZERO, 0.0);
        for [joints, weights] in &self.sets {
            for (joint, weight) in joints.integers::<4>(ix).into_iter().zip(weights.numbers::<4>(ix, 0.0)?) {
                if weight == 0.0 {
                    continue;
                }
                let matrix = self.skin.world_from_mesh.get(joint as usize).ok_or_else(|| {
                    format!("{}: element {ix} is joint {joint}, which {} lacks", joints.path, self.skin.path)
                })?;
                sum += *matrix * f64::from(weight);
                total += f64::from(weight);
            }
        }
        // A vertex without weights would vanish. Most programs give it to the first joint.
        let first = self.skin.world_from_mesh.first().copied().unwrap_or_default();
        Ok(if total > 0.0 { sum * total.recip() } else { first })
    }
}
