//! Morph targets and skins in the pose that the file gives, or that animations have at a moment.

use std::collections::HashMap;

use glam::{DMat4, DVec3, Vec3};
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
use crate::scene::{
    meshes::needs::require_for_morph_targets,
    model::{
        deformation::{Deformation, Influence, JointMatrix, MorphDelta},
        error::Checked,
    },
};

/// Which morph targets of meshes are read, and with which weights they change texture coordinates and colours.
#[derive(Clone, Copy)]
pub(super) struct Weights<'a> {
    /// Missing ones are 0.
    pub now: &'a [f32],
    /// Whether targets of weight 0 are read, too.
    pub reads_all: bool,
}

/// Morph targets of a primitive.
pub(super) struct Morph<'a> {
    targets: Vec<Target<'a>>,
}

/// A morph target: what it adds to positions, normals and tangents.
struct Target<'a> {
    /// Its index in the mesh.
    ix: u32,
    added: [Option<Accessor<'a>>; 3],
}

impl<'a> Morph<'a> {
    /// Returns the morph targets of a primitive of `n` vertices.
    pub fn new(attributes: &Attributes<'a>, weights: Weights, n: usize) -> Checked<Self> {
        let is_read = |ix: usize| weights.reads_all || weights.now.get(ix).is_some_and(|weight| *weight != 0.0);
        let targets = attributes.primitive.targets.iter().flatten().enumerate().filter(|(ix, _)| is_read(*ix));
        let targets: Checked<_> = targets.map(|(ix, target)| Target::new(attributes, (ix, target), n)).collect();
        Ok(Self { targets: targets? })
    }

    /// Gives a deformation the deltas of its vertices, whose indices in the primitive are `used`. Returns what cannot
    /// be read first: such vertices have no deltas.
    ///
    /// # Errors
    /// The deltas need more memory than there is.
    pub fn add_to(&self, used: &[u32], deformation: &mut Deformation) -> Checked<Option<String>> {
        let Deformation { normals, tangents, deltas, first_deltas, .. } = deformation;
        let is_used = [true, !normals.is_empty(), !tangents.is_empty()];
        require_for_morph_targets(self.targets.len() as u64, used.len() as u64)?;
        let mut wrong = None;
        for ix in used {
            let first = deltas.len();
            first_deltas.push(first as u32);
            for target in &self.targets {
                match target.delta(*ix as usize, is_used) {
                    Ok(delta) => deltas.extend(delta),
                    Err(what) => {
                        wrong.get_or_insert(what);
                        deltas.truncate(first);
                        break;
                    }
                }
            }
        }
        match deltas.is_empty() {
            true => first_deltas.clear(),
            false => first_deltas.push(deltas.len() as u32),
        }
        Ok(wrong)
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

    /// Returns whether targets of a mesh change texture coordinates or colours.
    pub fn change_surfaces(&self, mesh_ix: usize) -> bool {
        let primitives = self.meshes.get(mesh_ix).into_iter().flat_map(|mesh| &mesh.primitives);
        let mut names = primitives.flat_map(|it| it.targets.iter().flatten()).flat_map(|target| target.keys());
        names.any(|name| name.starts_with("TEXCOORD_") || name.starts_with("COLOR_"))
    }
}

impl<'a> Target<'a> {
    fn new(attributes: &Attributes<'a>, (ix, target): (usize, &MorphTarget), n: usize) -> Checked<Self> {
        let MorphTarget { positions, normals, tangents } = target;
        let accessor = |index: &Option<_>, name: &str| {
            let path = format!("{}.targets[{ix}].{name}", attributes.path);
            index.map(|index| attributes.accessor(index, &[Type::Vec3], Some(n), path)).transpose()
        };
        let added = [accessor(positions, "POSITION")?, accessor(normals, "NORMAL")?, accessor(tangents, "TANGENT")?];
        Ok(Self { ix: ix as u32, added })
    }

    /// Returns what the target adds to a vertex, or `None` if that is nothing. `is_used`: whether the vertex has a
    /// position, a normal and a tangent.
    fn delta(&self, ix: usize, is_used: [bool; 3]) -> Checked<Option<MorphDelta>> {
        let mut vectors = [Vec3::ZERO; 3];
        for ((vector, added), is_used) in vectors.iter_mut().zip(&self.added).zip(is_used) {
            if let Some(added) = added {
                let read = Vec3::from_array(added.numbers(ix, 0.0)?);
                *vector = if is_used { read } else { Vec3::ZERO };
            }
        }
        let [position, normal, tangent] = vectors;
        Ok((vectors != [Vec3::ZERO; 3]).then_some(MorphDelta { target: self.ix, position, normal, tangent }))
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
        Ok(Self { path, world_from_mesh })
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

    /// Returns the joint of vertices that the skin does not move: one more than the skin has.
    pub fn at_rest(&self) -> Influence {
        Influence { joint: self.world_from_mesh.len() as u32, weight: 1.0 }
    }

    /// Returns the joints' transforms, which are rounded to single precision in the end. `rest_origin`: the point of
    /// the mesh's space that is the origin of its vertices. `origin`: the point of world space that becomes the origin.
    pub fn joints(&self, rest_origin: DVec3, origin: DVec3) -> Vec<JointMatrix> {
        let all = self.world_from_mesh.iter().copied().chain([DMat4::IDENTITY]);
        let from_rest = DMat4::from_translation(rest_origin);
        all.map(|matrix| JointMatrix::new(matrix * from_rest, origin)).collect()
    }
}

impl Skinning<'_> {
    /// Gives a deformation the influences of its vertices, whose indices in the primitive are `used`. Returns what
    /// cannot be read first: such vertices are not moved.
    pub fn add_to(&self, used: &[u32], deformation: &mut Deformation) -> Option<String> {
        let (mut wrong, mut of_vertices) = (None, Vec::with_capacity(used.len()));
        for ix in used {
            of_vertices.push(self.influences(*ix as usize).unwrap_or_else(|what| {
                wrong.get_or_insert(what);
                vec![self.skin.at_rest()]
            }));
        }
        let n = of_vertices.iter().map(Vec::len).max().unwrap_or(1);
        deformation.n_influences = n;
        deformation.influences = vec![Influence::default(); n * used.len()];
        for (to, found) in deformation.influences.chunks_exact_mut(n).zip(of_vertices) {
            to[..found.len()].copy_from_slice(&found);
        }
        wrong
    }

    /// Returns the joints of a vertex whose weights are not 0. Their weights add up to 1.
    fn influences(&self, ix: usize) -> Checked<Vec<Influence>> {
        let (mut found, mut total) = (Vec::with_capacity(4 * self.sets.len()), 0.0);
        for [joints, weights] in &self.sets {
            for (joint, weight) in joints.integers::<4>(ix).into_iter().zip(weights.numbers::<4>(ix, 0.0)?) {
                if weight == 0.0 {
                    continue;
                }
                if joint as usize >= self.skin.world_from_mesh.len() {
                    return Err(format!(
                        "{}: element {ix} is joint {joint}, which {} lacks",
                        joints.path, self.skin.path
                    ));
                }
                found.push(Influence { joint, weight });
                total += f64::from(weight);
            }
        }
        // A vertex without weights would vanish. Most programs give it to the first joint.
        if !(total > 0.0) {
            return Ok(vec![Influence { joint: 0, weight: 1.0 }]);
        }
        found.iter_mut().for_each(|it| it.weight = (f64::from(it.weight) / total) as f32);
        Ok(found)
    }
}
