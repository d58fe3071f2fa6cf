//! Nodes whose mesh is there many times (EXT_mesh_gpu_instancing).

use glam::{DMat4, Quat};
use gltf::json::{Index, accessor::Type};

use super::{accessor::Accessor, document::Document, nodes::matrix_of};
use crate::scene::model::error::Checked;

const NAME: &str = "EXT_mesh_gpu_instancing";

/// The places of a mesh, relative to its node. What the file leaves out moves, turns and scales nothing.
pub(super) struct Places<'a> {
    /// Number of places.
    pub n: usize,
    translation: Option<Accessor<'a>>,
    rotation: Option<Accessor<'a>>,
    scale: Option<Accessor<'a>>,
}

/// Returns the places of a node's mesh, or `None` if the node does not have the extension.
pub(super) fn places(document: &Document, node_ix: usize) -> Checked<Option<Places<'_>>> {
    let extensions = document.root.nodes[node_ix].extensions.as_ref();
    let Some(extension) = extensions.and_then(|extensions| extensions.others.get(NAME)) else { return Ok(None) };
    let find = |name: &str, kind: Type| {
        let ix = extension.get("attributes").and_then(|attributes| attributes.get(name)?.as_u64());
        let path = || format!("nodes[{node_ix}].extensions.{NAME}.attributes.{name}");
        // A larger index is that of no accessor either.
        ix.map(|ix| Accessor::new(document, Index::new(ix.min(u64::from(u32::MAX)) as u32), &[kind], path()))
            .transpose()
    };
    let (translation, rotation, scale) =
        (find("TRANSLATION", Type::Vec3)?, find("ROTATION", Type::Vec4)?, find("SCALE", Type::Vec3)?);
    let all = || [&translation, &rotation, &scale].into_iter().flatten();
    // Attributes of other names alone leave the mesh where it is.
    let n = all().map(|accessor| accessor.n).max().unwrap_or(1);
    if let Some(other) = all().find(|accessor| accessor.n != n) {
        return Err(format!("{}: has {} elements, but another attribute has {n}", other.path, other.n));
    }
    Ok(Some(Places { n, translation, rotation, scale }))
}

impl Places<'_> {
    /// Returns one of the places.
    pub fn node_from_instance(&self, ix: usize) -> Checked<DMat4> {
        let scale = numbers(&self.scale, ix, [1.0; 3])?;
        let rotation = numbers(&self.rotation, ix, Quat::IDENTITY.to_array())?;
        Ok(matrix_of(scale, rotation, numbers(&self.translation, ix, [0.0; 3])?))
    }
}

fn numbers<const N: usize>(accessor: &Option<Accessor>, ix: usize, or: [f32; N]) -> Checked<[f32; N]> {
    accessor.as_ref().map_or(Ok(or), |accessor| accessor.numbers(ix, 0.0))
}
