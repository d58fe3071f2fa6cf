//! Meshes that are compressed by Draco: KHR_draco_mesh_compression.
//!
//! The accessors of such a primitive say how many elements there are, and of which type. The elements are in Draco's
//! data instead of a buffer. Each buffer view is decoded once, before meshes are made.

#[cfg(test)]
mod tests;

use std::{collections::BTreeMap, fmt::Display};

use draco_core::{DataType, DecodeLimits, DecoderBuffer, Mesh, MeshDecoder, PointAttribute, PointIndex};
use gltf::{
    Semantic,
    json::{
        Index,
        accessor::{self, ComponentType, GenericComponentType},
        mesh::{Mode, Primitive},
        validation::Checked::Valid,
    },
};
use hashbrown::{HashMap, HashSet};
use rayon::prelude::*;

use super::document::{Document, item};
use crate::{scene::model::error::Checked, util::memory::require};

const NAME: &str = "KHR_draco_mesh_compression";
/// What to do with a file whose data is not read.
const REMEDY: &str = "Blender, for example, may read the file and save it without Draco";

/// The most faces, and the most vertices, of a byte of data. A flat grid has 14 faces a byte.
const MAX_PER_BYTE: u64 = 1024;
/// Bytes of an attribute of a vertex: up to four numbers.
const ATTRIBUTE_BYTES: u64 = 16;
/// Attributes that the data may have beside those that the primitive names.
const N_FURTHER: u64 = 4;
/// How many times the size of its attributes the decoder may hold at once: as values, as whole numbers, as elements.
const WORKING_COPIES: u64 = 3;
/// Bytes that the decoder needs for the connectivity of a face.
const FACE_BYTES: u64 = 256;

/// The decoded data of a document.
#[derive(Default)]
pub(super) struct Decoded {
    /// Elements of accessors, without gaps.
    elements: HashMap<Key, Checked<Vec<u8>>>,
    /// JSON paths of the primitives all of whose elements there are.
    primitives: HashSet<String>,
}

#[derive(Clone, Copy, PartialEq, Eq, Hash)]
struct Key {
    view_ix: usize,
    /// Number of the attribute in Draco's data. The indices of the faces have none.
    attribute: Option<u32>,
    /// A [`ComponentType`], which cannot be hashed.
    kind: u8,
}

/// A primitive of triangles whose data is compressed.
struct Part<'a> {
    primitive: &'a Primitive,
    view_ix: usize,
    /// JSON path of the primitive.
    path: String,
    /// Names of attributes, and their numbers in Draco's data.
    attributes: Vec<(String, u32, Index<accessor::Accessor>)>,
}

/// Draco's data, and the sizes that the accessors state.
#[derive(Clone, Copy)]
struct Stream<'a> {
    bytes: &'a [u8],
    n_points: u64,
    n_faces: u64,
    n_attributes: u64,
}

impl Decoded {
    /// Decodes the data of all primitives of a document. Data that cannot be read is left out.
    ///
    /// # Errors
    /// The data needs more memory than there is.
    pub fn of(document: &Document) -> Checked<Self> {
        let mut parts = Vec::new();
        for (mesh_ix, mesh) in document.root.meshes.iter().enumerate() {
            for (ix, primitive) in mesh.primitives.iter().enumerate() {
                let path = format!("meshes[{mesh_ix}].primitives[{ix}]");
                let part = Part::of(primitive, path.clone()).map_err(|what| failed(&path, what));
                parts.extend(document.or_left_out(part).flatten());
            }
        }
        let mut streams = BTreeMap::new();
        for part in &parts {
            let stream = part.stream(document).map_err(|what| failed(&part.path, what));
            if let Some(stream) = document.or_left_out(stream) {
                // The sizes of all primitives that share the data count: one of them may be wrong.
                let (_, shared) = streams.entry(part.view_ix).or_insert((part, stream));
                shared.n_points = shared.n_points.max(stream.n_points);
                shared.n_faces = shared.n_faces.max(stream.n_faces);
                shared.n_attributes = shared.n_attributes.max(stream.n_attributes);
            }
        }
        let n_bytes = streams.values().map(|(_, stream)| stream.working_bytes()).fold(0, u64::saturating_add);
        require("decoding the data of Draco", n_bytes)?;
        let decode = |(view_ix, (part, stream)): (&usize, &(&Part, Stream))| {
            let decoded = stream.decode().map(|mesh| (*view_ix, mesh));
            decoded.map_err(|what| failed(&part.path, format!("{what}. {REMEDY}")))
        };
        let meshes: Vec<_> = streams.par_iter().map(decode).collect();
        let meshes: HashMap<_, _> = meshes.into_iter().filter_map(|mesh| document.or_left_out(mesh)).collect();
        let mut decoded = Self::default();
        for part in &parts {
            let Some(mesh) = meshes.get(&part.view_ix) else { continue };
            let added = decoded.add(document, part, mesh).map_err(|what| failed(&part.path, what));
            decoded.primitives.extend(document.or_left_out(added).map(|()| part.path.clone()));
        }
        Ok(decoded)
    }

    /// Returns the elements of a primitive's attribute, if they are compressed. `path` is the primitive's JSON path.
    pub fn attribute(&self, (primitive, path): (&Primitive, &str), name: &str, kind: ComponentType) -> Option<&[u8]> {
        let attribute = extension(primitive)?.get("attributes")?.get(name)?.as_u64()?;
        self.elements((primitive, path), Some(u32::try_from(attribute).ok()?), kind)
    }

    /// Returns the indices of a primitive's faces, if they are compressed. `path` is the primitive's JSON path.
    pub fn indices(&self, primitive: (&Primitive, &str), kind: ComponentType) -> Option<&[u8]> {
        self.elements(primitive, None, kind)
    }

    fn elements(
        &self,
        (primitive, path): (&Primitive, &str),
        attribute: Option<u32>,
        kind: ComponentType,
    ) -> Option<&[u8]> {
        let view_ix = extension(primitive)?.get("bufferView")?.as_u64()? as usize;
        if !self.primitives.contains(path) {
            return None;
        }
        self.elements.get(&Key { view_ix, attribute, kind: kind as u8 })?.as_deref().ok()
    }

    /// Adds the elements of a primitive's accessors.
    fn add(&mut self, document: &Document, part: &Part, mesh: &Mesh) -> Checked<()> {
        let indices = part.primitive.indices.ok_or("the primitive has no indices")?;
        let (n, _, kind) = description(document, indices, &"indices")?;
        if n != 3 * mesh.num_faces() as u64 {
            return Err(format!("accessors[{indices}]: count = {n}, but the data has {} faces", mesh.num_faces()));
        }
        self.insert(part.view_ix, None, kind, || {
            faces(mesh, kind).map_err(|it| format!("accessors[{indices}]: {it}"))
        })?;
        for (name, id, index) in &part.attributes {
            let failed = |what: String| format!("attributes.{name}: {what}");
            let (n, n_components, kind) = description(document, *index, name)?;
            let attribute = mesh.attribute_by_unique_id(*id);
            let attribute = attribute.ok_or_else(|| failed(format!("the data has no attribute {id}")))?;
            let found = (mesh.num_points() as u64, usize::from(attribute.num_components()));
            if (n, n_components) != found {
                let stated = format!("accessors[{index}] has {n} elements of {n_components} numbers");
                return Err(failed(format!("{stated}, but the data has {} of {}", found.0, found.1)));
            }
            self.insert(part.view_ix, Some(*id), kind, || values(attribute, mesh.num_points(), kind).map_err(failed))?;
        }
        Ok(())
    }

    fn insert(
        &mut self,
        view_ix: usize,
        attribute: Option<u32>,
        kind: ComponentType,
        elements: impl FnOnce() -> Checked<Vec<u8>>,
    ) -> Checked<()> {
        let key = Key { view_ix, attribute, kind: kind as u8 };
        let elements = self.elements.entry(key).or_insert_with(elements);
        elements.as_ref().map(|_| ()).map_err(String::clone)
    }
}

/// Returns an error at the extension of the primitive at a JSON path.
fn failed(path: &str, what: impl Display) -> String {
    format!("{path}.extensions.{NAME}: {what}")
}

/// Returns whether a primitive's data is compressed.
pub(super) fn is_compressed(primitive: &Primitive) -> bool {
    extension(primitive).is_some()
}

fn extension(primitive: &Primitive) -> Option<&serde_json::Value> {
    primitive.extensions.as_ref()?.others.get(NAME)
}

/// Returns the number of an accessor's elements, the number of numbers that an element has, and their type.
fn description(
    document: &Document,
    index: Index<accessor::Accessor>,
    from: &dyn Display,
) -> Checked<(u64, usize, ComponentType)> {
    let accessor = item(&document.root.accessors, "accessors", index.value(), from)?;
    match (&accessor.type_, &accessor.component_type) {
        (Valid(type_), Valid(GenericComponentType(kind))) => Ok((accessor.count.0, type_.multiplicity(), *kind)),
        _ => Err(format!("accessors[{index}]: its type or componentType is unknown")),
    }
}

impl<'a> Part<'a> {
    /// Returns a primitive if it has triangles that are compressed. Points and lines are not shown.
    fn of(primitive: &'a Primitive, path: String) -> Checked<Option<Self>> {
        let Some(extension) = extension(primitive) else { return Ok(None) };
        match primitive.mode {
            Valid(Mode::Triangles) => {}
            Valid(Mode::TriangleStrip | Mode::TriangleFan) => {
                return Err(format!("strips and fans are not read from Draco's data. {REMEDY}"));
            }
            _ => return Ok(None),
        }
        let view_ix = extension.get("bufferView").and_then(serde_json::Value::as_u64);
        let view_ix = view_ix.and_then(|ix| u32::try_from(ix).ok());
        let view_ix = view_ix.ok_or("bufferView is no index")? as usize;
        let mut attributes = Vec::new();
        for (semantic, index) in &primitive.attributes {
            // Attributes of other programs are not shown.
            let Valid(semantic) = semantic else { continue };
            let name = semantic.to_string();
            let Some(id) = extension.get("attributes").and_then(|it| it.get(&name)) else { continue };
            let id = id.as_u64().and_then(|id| u32::try_from(id).ok());
            let id = id.ok_or_else(|| format!("attributes.{name} is no index"))?;
            attributes.push((name, id, *index));
        }
        Ok(Some(Self { primitive, view_ix, path, attributes }))
    }

    /// Returns the data of the primitive, whose stated sizes are in proportion to it.
    fn stream<'d>(&self, document: &'d Document) -> Checked<Stream<'d>> {
        let indices = self.primitive.indices.ok_or("the primitive has no indices")?;
        let positions = self.primitive.attributes.get(&Valid(Semantic::Positions));
        let positions = *positions.ok_or("the primitive has no POSITION")?;
        let bytes = document.view(Index::new(self.view_ix as u32), &"bufferView")?.bytes;
        let n_points = description(document, positions, &"POSITION")?.0;
        let n_faces = description(document, indices, &"indices")?.0 / 3;
        if n_points.max(n_faces) / MAX_PER_BYTE > bytes.len() as u64 {
            return Err(format!("{n_points} vertices and {n_faces} faces are more than {} bytes hold", bytes.len()));
        }
        Ok(Stream { bytes, n_points, n_faces, n_attributes: self.attributes.len() as u64 + N_FURTHER })
    }
}

impl Stream<'_> {
    fn attribute_bytes(&self) -> u64 {
        self.n_points.saturating_mul(self.n_attributes * ATTRIBUTE_BYTES)
    }

    fn working_bytes(&self) -> u64 {
        let of_faces = self.n_faces.saturating_mul(FACE_BYTES);
        self.attribute_bytes().saturating_mul(WORKING_COPIES).saturating_add(of_faces)
    }

    /// Decodes the data, if it is not larger than the accessors say.
    fn decode(&self) -> Checked<Mesh> {
        let limits = DecodeLimits::default().with_max_points(self.n_points).with_max_faces(self.n_faces);
        let limits = limits.with_max_decoded_bytes(self.attribute_bytes());
        let mut mesh = Mesh::new();
        let decoded = MeshDecoder::new().decode(&mut DecoderBuffer::new(self.bytes).with_limits(limits), &mut mesh);
        decoded.map_err(|error| format!("the data cannot be decoded: {error}"))?;
        Ok(mesh)
    }
}

/// Returns the indices of a mesh's faces as elements of an accessor.
fn faces(mesh: &Mesh, kind: ComponentType) -> Checked<Vec<u8>> {
    let mut bytes = Vec::with_capacity(3 * mesh.num_faces() * kind.size());
    for ix in mesh.faces().iter().flatten() {
        push_number(&mut bytes, f64::from(ix.0), kind)?;
    }
    Ok(bytes)
}

/// Returns the values of an attribute as elements of an accessor.
fn values(attribute: &PointAttribute, n_points: usize, kind: ComponentType) -> Checked<Vec<u8>> {
    let (type_, n_components) = (attribute.data_type(), usize::from(attribute.num_components()));
    let (size, is_same) = (type_.byte_length(), kind_of(type_) == Some(kind));
    let unknown = || format!("numbers of the type {type_:?} are not read");
    if size == 0 {
        return Err(unknown());
    }
    let stride = usize::try_from(attribute.byte_stride()).map_err(|_| "the data has a negative stride")?;
    let scale = scale_of(attribute, kind);
    let mut bytes = Vec::with_capacity(n_points * n_components * kind.size());
    for point in 0..n_points as u32 {
        let value_ix = attribute.mapped_index(PointIndex(point)).0 as usize;
        let start = value_ix.checked_mul(stride).and_then(|start| attribute.buffer().data().get(start..));
        let value = start.and_then(|start| start.get(..n_components * size));
        let value = value.ok_or_else(|| format!("the data has no value for vertex {point}"))?;
        if is_same {
            bytes.extend_from_slice(value);
            continue;
        }
        for component in value.chunks_exact(size) {
            let number = number(type_, component).ok_or_else(unknown)?;
            push_number(&mut bytes, number / scale, kind)?;
        }
    }
    Ok(bytes)
}

/// Returns the accessor's type of numbers that is stored as Draco's type is.
fn kind_of(type_: DataType) -> Option<ComponentType> {
    match type_ {
        DataType::Int8 => Some(ComponentType::I8),
        DataType::Uint8 => Some(ComponentType::U8),
        DataType::Int16 => Some(ComponentType::I16),
        DataType::Uint16 => Some(ComponentType::U16),
        DataType::Uint32 => Some(ComponentType::U32),
        DataType::Float32 => Some(ComponentType::F32),
        _ => None,
    }
}

/// Returns the number that stands for 1 in an attribute, if the accessor has floats in place of its integers.
fn scale_of(attribute: &PointAttribute, kind: ComponentType) -> f64 {
    match attribute.data_type() {
        _ if !attribute.normalized() || kind != ComponentType::F32 => 1.0,
        DataType::Int8 => f64::from(i8::MAX),
        DataType::Uint8 => f64::from(u8::MAX),
        DataType::Int16 => f64::from(i16::MAX),
        DataType::Uint16 => f64::from(u16::MAX),
        DataType::Int32 => f64::from(i32::MAX),
        DataType::Uint32 => f64::from(u32::MAX),
        _ => 1.0,
    }
}

fn number(type_: DataType, bytes: &[u8]) -> Option<f64> {
    Some(match (type_, bytes) {
        (DataType::Int8, &[a]) => f64::from(a as i8),
        (DataType::Uint8 | DataType::Bool, &[a]) => f64::from(a),
        (DataType::Int16, &[a, b]) => f64::from(i16::from_le_bytes([a, b])),
        (DataType::Uint16, &[a, b]) => f64::from(u16::from_le_bytes([a, b])),
        (DataType::Int32, &[a, b, c, d]) => f64::from(i32::from_le_bytes([a, b, c, d])),
        (DataType::Uint32, &[a, b, c, d]) => f64::from(u32::from_le_bytes([a, b, c, d])),
        (DataType::Float32, &[a, b, c, d]) => f64::from(f32::from_le_bytes([a, b, c, d])),
        _ => return None,
    })
}

/// Appends a number as a component of an accessor's element. Integers must hold it exactly.
fn push_number(bytes: &mut Vec<u8>, number: f64, kind: ComponentType) -> Checked<()> {
    // Casts of floats saturate, so a number that does not fit differs from its cast.
    macro_rules! push {
        ($int:ty) => {{
            if f64::from(number as $int) != number {
                return Err(format!("{number} does not fit into the accessor's componentType, {kind:?}"));
            }
            bytes.extend((number as $int).to_le_bytes())
        }};
    }
    match kind {
        ComponentType::I8 => push!(i8),
        ComponentType::U8 => push!(u8),
        ComponentType::I16 => push!(i16),
        ComponentType::U16 => push!(u16),
        ComponentType::U32 => push!(u32),
        ComponentType::F32 => bytes.extend((number as f32).to_le_bytes()),
    }
    Ok(())
}
