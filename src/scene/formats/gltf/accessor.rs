//! Accessors: typed elements of buffers. Each element is read when it is asked for, and the indices of a sparse
//! accessor once, since a hostile file can name a large accessor many times.

use std::sync::Arc;

use gltf::json::{
    Index,
    accessor::{self, ComponentType, Type, sparse},
    validation::Checked::Valid,
};

use super::document::{Document, View, item};
use crate::scene::model::error::Checked;

/// An accessor whose elements all lie within their buffers.
pub(super) struct Accessor<'a> {
    /// Number of elements.
    pub n: usize,
    /// Number of components of an element.
    pub n_components: usize,
    /// JSON path that names the accessor.
    pub path: String,
    kind: ComponentType,
    is_normalized: bool,
    /// Elements, unless all are 0.
    elements: Option<Elements<'a>>,
    /// Elements that replace others, by their ascending indices.
    replaced: Arc<[u32]>,
    replacements: Option<Elements<'a>>,
}

/// Elements at regular distances.
#[derive(Clone, Copy)]
struct Elements<'a> {
    bytes: &'a [u8],
    stride: usize,
}

impl<'a> Accessor<'a> {
    /// Checks and returns the accessor at `index`, which the JSON path `path` names. `types` are those that are allowed
    /// there.
    pub fn new(
        document: &'a Document,
        index: Index<accessor::Accessor>,
        types: &[Type],
        path: impl Into<String>,
    ) -> Checked<Self> {
        // Indices are scalars, and no attribute of a vertex is.
        let is_allowed = |kind| match kind {
            ComponentType::U32 => types == [Type::Scalar],
            ComponentType::U8 | ComponentType::U16 => true,
            ComponentType::I8 | ComponentType::I16 | ComponentType::F32 => types != [Type::Scalar],
        };
        Self::checked(document, index, (types, &is_allowed), path.into())
    }

    /// Checks and returns an accessor of an animation, whose scalars are no indices.
    pub fn of_numbers(
        document: &'a Document,
        index: Index<accessor::Accessor>,
        type_: Type,
        path: String,
    ) -> Checked<Self> {
        Self::checked(document, index, (&[type_], &|kind| kind != ComponentType::U32), path)
    }

    fn checked(
        document: &'a Document,
        index: Index<accessor::Accessor>,
        (types, is_allowed): (&[Type], &dyn Fn(ComponentType) -> bool),
        path: String,
    ) -> Checked<Self> {
        let json = item(&document.root.accessors, "accessors", index.value(), &path)?;
        let failed = |what: String| format!("{path}: accessors[{index}]: {what}");
        let type_ = match json.type_ {
            Valid(type_) if types.contains(&type_) => type_,
            _ => return Err(failed(format!("its type must be one of {types:?}"))),
        };
        let Valid(accessor::GenericComponentType(kind)) = json.component_type else {
            return Err(failed("its componentType is unknown".to_owned()));
        };
        if !is_allowed(kind) {
            return Err(failed(format!("its componentType, {kind:?}, is not allowed here")));
        }
        let n = u32::try_from(json.count.0).map_err(|_| failed(format!("count = {} is too large", json.count.0)))?;
        let (n, n_components) = (n as usize, type_.multiplicity());
        let size = n_components * kind.size();
        let elements = match json.buffer_view {
            Some(view) => {
                let view = document.view(view, &path)?;
                let offset = json.byte_offset.unwrap_or_default().0;
                Some(Elements::new(view, offset, n, size).map_err(failed)?)
            }
            None => None,
        };
        let is_normalized = json.normalized;
        let (replaced, replacements) = (Arc::default(), None);
        let mut accessor = Self { n, n_components, path, kind, is_normalized, elements, replaced, replacements };
        if let Some(sparse) = &json.sparse {
            accessor
                .replace(document, (index.value(), sparse), size)
                .map_err(|what| format!("{}: accessors[{index}].sparse: {what}", accessor.path))?;
        }
        Ok(accessor)
    }

    /// Returns whether the file has elements, so that not all are 0.
    pub fn has_elements(&self) -> bool {
        self.elements.is_some() || self.replacements.is_some()
    }

    /// Takes the elements from bytes without gaps, if `decoded` has any of the accessor's kind. There are as many as
    /// the accessor has.
    pub fn or_decoded(mut self, decoded: impl FnOnce(ComponentType) -> Option<&'a [u8]>) -> Self {
        let stride = self.n_components * self.kind.size();
        if let Some(bytes) = decoded(self.kind) {
            assert_eq!(bytes.len(), self.n * stride, "the data is checked to be the accessor's");
            self.elements = Some(Elements { bytes, stride });
        }
        self
    }

    /// Reads which elements are replaced. `ix` is the accessor's index.
    fn replace(&mut self, document: &'a Document, (ix, sparse): (usize, &sparse::Sparse), size: usize) -> Checked<()> {
        let n = usize::try_from(sparse.count.0).ok().filter(|n| *n <= self.n);
        let n = n.ok_or_else(|| format!("count = {} is more than the accessor has", sparse.count.0))?;
        let Valid(accessor::IndexComponentType(kind)) = sparse.indices.component_type else {
            return Err("the componentType of its indices is unknown".to_owned());
        };
        self.replaced = document.replaced(ix, || {
            let view = document.view(sparse.indices.buffer_view, &"indices")?;
            let indices = Elements::new(view, sparse.indices.byte_offset.0, n, kind.size())?;
            let replaced: Arc<[u32]> = (0..n).map(|ix| unsigned(kind, indices.of(ix, kind.size()))).collect();
            let is_ascending = replaced.windows(2).all(|pair| pair[0] < pair[1]);
            match !is_ascending || replaced.last().is_some_and(|last| *last as usize >= self.n) {
                true => Err(format!("its indices do not ascend, or are not below {}", self.n)),
                false => Ok(replaced),
            }
        })?;
        let view = document.view(sparse.values.buffer_view, &"values")?;
        self.replacements = Some(Elements::new(view, sparse.values.byte_offset.0, n, size)?);
        Ok(())
    }

    /// Returns an element's bytes. Without any, the element is 0.
    fn bytes(&self, ix: usize) -> Option<&'a [u8]> {
        assert!(ix < self.n, "the element is checked to be there");
        let size = self.n_components * self.kind.size();
        match (self.replacements, self.replaced.binary_search(&(ix as u32))) {
            (Some(replacements), Ok(at)) => Some(replacements.of(at, size)),
            _ => self.elements.map(|elements| elements.of(ix, size)),
        }
    }

    /// Returns an element as finite numbers; components that it lacks are `missing`. Normalized integers become
    /// numbers from -1 to 1.
    pub fn numbers<const N: usize>(&self, ix: usize, missing: f32) -> Checked<[f32; N]> {
        let mut numbers = [missing; N];
        let Some(bytes) = self.bytes(ix) else {
            numbers[..self.n_components.min(N)].fill(0.0);
            return Ok(numbers);
        };
        for (number, component) in numbers.iter_mut().zip(bytes.chunks_exact(self.kind.size())) {
            *number = self.number(component);
        }
        if numbers.iter().all(|number| number.is_finite()) {
            Ok(numbers)
        } else {
            Err(format!("{}: element {ix} is {numbers:?}, which is not finite", self.path))
        }
    }

    fn number(&self, bytes: &[u8]) -> f32 {
        let (value, largest) = match (self.kind, bytes) {
            (ComponentType::I8, &[a]) => (f32::from(a as i8), f32::from(i8::MAX)),
            (ComponentType::I16, &[a, b]) => (f32::from(i16::from_le_bytes([a, b])), f32::from(i16::MAX)),
            (ComponentType::U8, _) => (unsigned(self.kind, bytes) as f32, f32::from(u8::MAX)),
            (ComponentType::U16, _) => (unsigned(self.kind, bytes) as f32, f32::from(u16::MAX)),
            (_, &[a, b, c, d]) => return f32::from_le_bytes([a, b, c, d]),
            _ => unreachable!("components have the size of their kind"),
        };
        if self.is_normalized { (value / largest).max(-1.0) } else { value }
    }

    /// Returns an element of whole numbers.
    pub fn integers<const N: usize>(&self, ix: usize) -> [u32; N] {
        let mut integers = [0; N];
        if let Some(bytes) = self.bytes(ix) {
            for (integer, component) in integers.iter_mut().zip(bytes.chunks_exact(self.kind.size())) {
                *integer = unsigned(self.kind, component);
            }
        }
        integers
    }
}

impl<'a> Elements<'a> {
    /// Makes the list of `n` elements of `size` bytes from `offset` on, unless the view ends before them.
    fn new(view: View<'a>, offset: u64, n: usize, size: usize) -> Checked<Self> {
        let stride = view.stride.unwrap_or(size);
        if stride < size {
            return Err(format!("its view has byteStride = {stride}, but an element has {size} bytes"));
        }
        let needed = if n == 0 { 0 } else { (n as u64 - 1).saturating_mul(stride as u64).saturating_add(size as u64) };
        match offset.checked_add(needed).filter(|end| *end <= view.bytes.len() as u64) {
            Some(_) => Ok(Self { bytes: &view.bytes[offset as usize..], stride }),
            None => Err(format!(
                "{n} elements from byte {offset} on reach beyond the {} bytes of their view",
                view.bytes.len()
            )),
        }
    }

    fn of(&self, ix: usize, size: usize) -> &'a [u8] {
        &self.bytes[ix * self.stride..][..size]
    }
}

/// Returns an unsigned integer. Other kinds are read as if they were unsigned.
fn unsigned(kind: ComponentType, bytes: &[u8]) -> u32 {
    let mut word = [0; 4];
    word[..kind.size()].copy_from_slice(&bytes[..kind.size()]);
    u32::from_le_bytes(word)
}
