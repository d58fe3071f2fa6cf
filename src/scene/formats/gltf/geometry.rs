//! Meshes from primitives: triangles, strips and fans with their attributes.

use glam::{Vec2, Vec3, Vec4};
use gltf::{
    Semantic,
    json::{
        Index,
        accessor::Type,
        mesh::{Mode, Primitive},
        validation::Checked::Valid,
    },
};
use rayon::prelude::*;

use super::{
    accessor::Accessor,
    deform::{Added, Morph, Skin, TargetAttributes, Weights},
    document::{Document, LEFT_OUT},
    draco, has_targets,
    rest_pose::Rest,
};
use crate::scene::{
    meshes::needs::{self, MeshSize, require_for_mesh},
    model::{Mesh, deformation::Deformation, error::Checked},
};

/// How a mesh is read.
#[derive(Clone, Copy)]
pub(super) struct Reading<'a> {
    pub weights: Weights<'a>,
    pub skin: Option<&'a Skin>,
    /// Whether the order of the faces' corners is reversed.
    pub is_turned: bool,
}

/// A primitive of a mesh.
pub(super) struct Part<'a> {
    pub primitive: &'a Primitive,
    /// Its morph targets.
    pub targets: &'a [TargetAttributes],
    /// Its JSON path.
    pub path: String,
    /// The slot of its faces.
    pub slot: u32,
    /// What the faces of the whole mesh have.
    pub whole: needs::Attributes,
}

/// Returns the attributes that some primitive of a mesh has.
pub(super) fn attributes_of(primitives: &[Primitive]) -> needs::Attributes {
    let some_has = |semantic| {
        let semantic = Valid(semantic);
        primitives.iter().any(|primitive| primitive.attributes.contains_key(&semantic))
    };
    needs::Attributes {
        n_uv_sets: [0, 1].into_iter().filter(|set| some_has(Semantic::TexCoords(*set))).count() as u64,
        has_colours: some_has(Semantic::Colors(0)),
        has_tangents: some_has(Semantic::Tangents),
    }
}

/// Returns the mesh of a primitive, or `None` for points and lines and for what cannot be read. `n_read` is the number
/// of triangles that have been read already, and those of the primitive are added. The faces without area that join
/// strips count: they are in no mesh, but a short file can state any number of them.
///
/// # Errors
/// The mesh needs more memory than there is.
pub(super) fn mesh(document: &Document, part: &Part, reading: Reading, n_read: &mut u64) -> Checked<Option<Rest>> {
    let &Part { primitive, targets, ref path, slot, .. } = part;
    let mode = match primitive.mode {
        Valid(mode @ (Mode::Triangles | Mode::TriangleStrip | Mode::TriangleFan)) => mode,
        Valid(_) => {
            document.note("points and lines, which are not shown", path);
            return Ok(None);
        }
        _ => {
            document.note(LEFT_OUT, format!("{path}: its mode is none of 0 to 6"));
            return Ok(None);
        }
    };
    let attributes = Attributes { document, primitive, targets, path };
    let Some((positions, indices)) = document.or_left_out(attributes.positions_and_indices()) else { return Ok(None) };
    let mut faces = attributes.faces(mode, (indices, positions.n), (part.whole, n_read))?;
    let (used, places) = attributes.places(&positions, &mut faces);
    let (deformation, is_skinned) = attributes.deformation(places, (&used, positions.n), reading)?;
    if reading.is_turned {
        faces.iter_mut().for_each(|face| face.swap(1, 2));
    }
    let mut mesh = Mesh { slots: vec![slot; faces.len()], ..Mesh::default() };
    for (set, uvs) in mesh.uvs.iter_mut().enumerate() {
        let semantic = Semantic::TexCoords(set as u32);
        let Some(found) = attributes.readable(semantic.clone(), &[Type::Vec2], positions.n) else { continue };
        let added = Added::new(&attributes, &semantic, &[Type::Vec2], (reading.weights.now, positions.n));
        let added = document.or_left_out(added).unwrap_or_default();
        let uv = |ix| added.to(ix, found.numbers(ix, 0.0)?).map(Vec2::from_array);
        let found = read(document, &used, Vec2::ZERO, uv);
        *uvs = corners(&faces, &found).unwrap_or_default();
    }
    let (semantic, types) = (Semantic::Colors(0), [Type::Vec3, Type::Vec4]);
    if let Some(found) = attributes.readable(semantic.clone(), &types, positions.n) {
        let added = Added::new(&attributes, &semantic, &types, (reading.weights.now, positions.n));
        let added = document.or_left_out(added).unwrap_or_default();
        let colour = |ix| added.to_colour(ix, found.numbers(ix, 1.0)?).map(Vec4::from_array);
        let found = read(document, &used, Vec4::ONE, colour);
        mesh.colours = corners(&faces, &found).unwrap_or_default();
    }
    mesh.faces = faces;
    let (deformation, has_targets) = (deformation.into(), has_targets(primitive));
    Ok(Some(Rest { mesh, deformation, is_skinned, has_targets, ..Rest::default() }))
}

/// The attributes of a primitive.
pub(super) struct Attributes<'a> {
    pub document: &'a Document,
    pub primitive: &'a Primitive,
    /// Morph targets of the primitive.
    pub targets: &'a [TargetAttributes],
    /// JSON path of the primitive.
    pub path: &'a str,
}

impl<'a> Attributes<'a> {
    /// Returns an attribute, if the primitive has it. `n`: the number of elements that it must have.
    pub fn find(&self, semantic: Semantic, types: &[Type], n: Option<usize>) -> Checked<Option<Accessor<'a>>> {
        let name = semantic.to_string();
        let Some(index) = self.primitive.attributes.get(&Valid(semantic)) else { return Ok(None) };
        let accessor = self.accessor(*index, types, n, format!("{}.attributes.{name}", self.path))?;
        Ok(Some(accessor.or_decoded(|kind| self.document.draco.attribute((self.primitive, self.path), &name, kind))))
    }

    /// Returns an attribute of `n` vertices, if the primitive has it and it can be read.
    fn readable(&self, semantic: Semantic, types: &[Type], n: usize) -> Option<Accessor<'a>> {
        self.document.or_left_out(self.find(semantic, types, Some(n))).flatten()
    }

    /// Returns what a mesh cannot do without.
    fn positions_and_indices(&self) -> Checked<(Accessor<'a>, Option<Accessor<'a>>)> {
        let positions = self.find(Semantic::Positions, &[Type::Vec3], None)?;
        let positions = positions.ok_or_else(|| format!("{}.attributes: there is no POSITION", self.path))?;
        let path = format!("{}.indices", self.path);
        let indices = self.primitive.indices.map(|index| Accessor::new(self.document, index, &[Type::Scalar], path));
        let indices = indices.transpose()?;
        let indices =
            indices.map(|it| it.or_decoded(|kind| self.document.draco.indices((self.primitive, self.path), kind)));
        // Some files have the data a second time, for readers that do not decode it.
        match draco::is_compressed(self.primitive) && !positions.has_elements() {
            true => Err(format!("{}: its compressed data is not read", self.path)),
            false => Ok((positions, indices)),
        }
    }

    /// Returns an accessor that has an element for each of `n` vertices.
    pub fn accessor(
        &self,
        index: Index<gltf::json::Accessor>,
        types: &[Type],
        n: Option<usize>,
        path: String,
    ) -> Checked<Accessor<'a>> {
        let accessor = Accessor::new(self.document, index, types, path)?;
        match n {
            Some(n) if accessor.n != n => {
                Err(format!("{}: has {} elements, but there are {n} vertices", accessor.path, accessor.n))
            }
            _ => Ok(accessor),
        }
    }

    /// Returns the faces as indices of vertices, without those whose vertices do not exist. `whole`: what the faces of
    /// the mesh have. `n_read`: see [`mesh`].
    fn faces(
        &self,
        mode: Mode,
        (indices, n_vertices): (Option<Accessor>, usize),
        (whole, n_read): (needs::Attributes, &mut u64),
    ) -> Checked<Vec<[u32; 3]>> {
        let n = indices.as_ref().map_or(n_vertices, |indices| indices.n);
        let n_faces = if mode == Mode::Triangles { n / 3 } else { n.saturating_sub(2) };
        let n_points = n_vertices.min(3 * n_faces) as u64;
        require_for_mesh(*n_read, &MeshSize { n_triangles: n_faces as u64, n_points, attributes: whole })?;
        *n_read = n_read.saturating_add(n_faces as u64);
        let vertex = |at: usize| indices.as_ref().map_or(at as u32, |indices| indices.integers::<1>(at)[0]);
        let face = |ix: usize| match mode {
            Mode::TriangleStrip => [ix, ix + 1 + ix % 2, ix + 2 - ix % 2].map(vertex),
            Mode::TriangleFan => [ix + 1, ix + 2, 0].map(vertex),
            _ => [3 * ix, 3 * ix + 1, 3 * ix + 2].map(vertex),
        };
        // Strips are joined by faces without area.
        let is_stitch = |&[a, b, c]: &[u32; 3]| mode == Mode::TriangleStrip && (a == b || b == c || c == a);
        let mut faces: Vec<[u32; 3]> = (0..n_faces).map(face).filter(|face| !is_stitch(face)).collect();
        let is_in = |ix: &u32| (*ix as usize) < n_vertices;
        if let (Some(ix), Some(indices)) = (faces.as_flattened().iter().find(|ix| !is_in(ix)), &indices) {
            self.document.note(LEFT_OUT, format!("{}: {ix}, but there are {n_vertices} vertices", indices.path));
            faces.retain(|face| face.iter().all(is_in));
        }
        Ok(faces)
    }

    /// Renumbers the vertices of faces so that none is left out. Returns the former index and the position of each.
    /// Faces whose positions are not finite are removed.
    fn places(&self, positions: &Accessor, faces: &mut Vec<[u32; 3]>) -> (Vec<u32>, Vec<Vec3>) {
        let place = |ix| positions.numbers(ix, 0.0).map(Vec3::from_array);
        let used = renumber(faces);
        let places = read(self.document, &used, Vec3::NAN, place);
        if places.iter().all(|place| place.is_finite()) {
            return (used, places);
        }
        faces.retain(|face| face.iter().all(|ix| places[*ix as usize].is_finite()));
        faces.as_flattened_mut().iter_mut().for_each(|ix| *ix = used[*ix as usize]);
        let used = renumber(faces);
        let places = read(self.document, &used, Vec3::NAN, place);
        (used, places)
    }

    /// Reads normals and tangents, and what moves them and the positions. `used` are the indices of the vertices, of
    /// which the primitive has `n`. Also returns whether the skin moves them.
    ///
    /// # Errors
    /// The morph targets need more memory than there is.
    fn deformation(
        &self,
        positions: Vec<Vec3>,
        (used, n): (&[u32], usize),
        reading: Reading,
    ) -> Checked<(Deformation, bool)> {
        let document = self.document;
        let mut deformation = Deformation { positions, ..Deformation::default() };
        // Tangents without normals are ignored, as the specification says.
        if let Some(normals) = self.readable(Semantic::Normals, &[Type::Vec3], n) {
            let normal = |ix| Ok(Vec3::from_array(normals.numbers(ix, 0.0)?).normalize_or_zero());
            deformation.normals = read(document, used, Vec3::ZERO, normal);
            if let Some(tangents) = self.readable(Semantic::Tangents, &[Type::Vec4], n) {
                let tangent = |ix| Ok(unit_tangent(Vec4::from_array(tangents.numbers(ix, 0.0)?)));
                deformation.tangents = read(document, used, Vec4::ZERO, tangent);
            }
        }
        if let Some(morph) = document.or_left_out(Morph::new(self, reading.weights, n)) {
            let wrong = morph.add_to(used, &mut deformation)?;
            wrong.into_iter().for_each(|what| document.note(LEFT_OUT, what));
        }
        let Some(skin) = reading.skin else { return Ok((deformation, false)) };
        let skinning = document.or_left_out(skin.of(self, n));
        match &skinning {
            Some(skinning) => {
                let wrong = skinning.add_to(used, &mut deformation);
                wrong.into_iter().for_each(|what| document.note(LEFT_OUT, what));
            }
            None => {
                deformation.n_influences = 1;
                deformation.influences = vec![skin.at_rest(); used.len()];
            }
        }
        Ok((deformation, skinning.is_some()))
    }
}

/// Returns a tangent of unit length whose w is 1 or -1, or zero if the tangent has no direction.
fn unit_tangent(tangent: Vec4) -> Vec4 {
    match tangent.truncate().try_normalize() {
        Some(along) => along.extend(if tangent.w < 0.0 { -1.0 } else { 1.0 }),
        None => Vec4::ZERO,
    }
}

/// Reads a value for each used vertex. Those that cannot be read are `missing`, which is told once.
fn read<T: Copy>(document: &Document, used: &[u32], missing: T, read: impl Fn(usize) -> Checked<T>) -> Vec<T> {
    let mut first = None;
    let mut value = |ix: &u32| {
        read(*ix as usize).unwrap_or_else(|what| {
            first.get_or_insert(what);
            missing
        })
    };
    let values = used.iter().map(&mut value).collect();
    first.into_iter().for_each(|what| document.note(LEFT_OUT, what));
    values
}

/// Returns the values at the corners of faces, or `None` without values.
fn corners<T: Copy>(faces: &[[u32; 3]], values: &[T]) -> Option<Vec<[T; 3]>> {
    (!values.is_empty()).then(|| faces.iter().map(|face| face.map(|ix| values[ix as usize])).collect())
}

/// Renumbers the vertices of faces so that none is left out. Returns the former index of each, ascending.
fn renumber(faces: &mut [[u32; 3]]) -> Vec<u32> {
    let mut used = faces.as_flattened().to_vec();
    used.par_sort_unstable();
    used.dedup();
    let is_whole = used.last().is_none_or(|last| *last as usize + 1 == used.len());
    if !is_whole {
        faces.as_flattened_mut().par_iter_mut().for_each(|ix| {
            *ix = used.binary_search(ix).expect("all vertices are listed") as u32;
        });
    }
    used
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;
    use crate::scene::{LoadOptions, files::SourceFile};

    /// The strip's indices take no bytes in the file, and none of its faces has an area.
    #[test]
    fn faces_that_join_strips_count() {
        let json = br#"{ "asset": { "version": "2.0" }, "accessors": [
            { "componentType": 5126, "count": 3, "type": "VEC3" },
            { "componentType": 5125, "count": 1000, "type": "SCALAR" }
        ], "meshes": [{ "primitives": [{ "attributes": { "POSITION": 0 }, "indices": 1, "mode": 5 }] }] }"#;
        let source = SourceFile::new(Path::new("x.gltf"), &LoadOptions::default());
        let document = Document::read(source, json.to_vec()).unwrap();
        let primitive = &document.root.meshes[0].primitives[0];
        let part = Part { primitive, targets: &[], path: String::new(), slot: 0, whole: Default::default() };
        let mut n_read = 5;
        let weights = Weights { now: &[], reads_all: false };
        let reading = Reading { weights, skin: None, is_turned: false };
        for n in [1003, 2001] {
            let found = mesh(&document, &part, reading, &mut n_read).unwrap().unwrap();
            assert_eq!((found.mesh.faces.len(), n_read), (0, n));
        }
        n_read = u64::MAX;
        assert!(mesh(&document, &part, reading, &mut n_read).is_err());
    }
}
