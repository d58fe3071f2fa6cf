//! A glTF file with its buffers: `.gltf`, JSON beside files of data, and `.glb`, one file with both.

use std::{borrow::Cow, cell::RefCell, fmt::Display, ops::Range, path::PathBuf, sync::Arc};

use gltf::json::{self, Index, Root, Value, image};
use hashbrown::{HashMap, HashSet};
use serde::de::DeserializeOwned;
use serde_json::Map;

use super::{
    deform::MorphTargets,
    draco,
    glb::split,
    lenient, meshopt,
    pointers::Pointer,
    uri::{Uri, data},
};
use crate::{
    scene::{files::SourceFile, formats::mesh_file::MeshFile, model::error::Checked},
    util::{memory::require, progress::Progress, text::short_line},
};

/// Extensions that are read. A file that requires another one is refused, unless the other one changes only how
/// surfaces look, such as `KHR_materials_…`.
const SUPPORTED: [&str; 21] = [
    "EXT_mesh_gpu_instancing",
    "EXT_meshopt_compression",
    "EXT_texture_webp",
    "KHR_animation_pointer",
    "KHR_draco_mesh_compression",
    "KHR_lights_punctual",
    "KHR_materials_clearcoat",
    "KHR_materials_emissive_strength",
    "KHR_materials_ior",
    "KHR_materials_pbrSpecularGlossiness",
    "KHR_materials_sheen",
    "KHR_materials_specular",
    "KHR_materials_transmission",
    "KHR_materials_unlit",
    "KHR_materials_volume",
    "KHR_mesh_quantization",
    "KHR_meshopt_compression",
    "KHR_texture_basisu",
    "KHR_texture_transform",
    "KHR_xmp_json_ld",
    "MSFT_texture_dds",
];

/// Extensions that are not read, but change no picture of a file that does not require them.
const WITHOUT_EFFECT: [&str; 3] = ["KHR_materials_variants", "KHR_xmp", "MSFT_packing_normalRoughnessMetallic"];

/// Begins the warning that lists what is left out because it cannot be read.
pub(super) const LEFT_OUT: &str = "parts that cannot be read, which are left out";

/// Returns whether a file that requires an extension can be shown without it, though some surfaces look different.
fn changes_only_looks(extension: &str) -> bool {
    ["KHR_materials_", "KHR_texture_"].iter().any(|start| extension.starts_with(start))
}

/// A glTF file, its buffers, and what is not shown of it.
pub(super) struct Document {
    /// The JSON. No index in it is checked.
    pub root: Root,
    /// The morph targets of the meshes.
    pub morph_targets: MorphTargets,
    /// The channels of animations that drive what is no part of a node.
    pub pointers: Vec<Pointer>,
    pub source: SourceFile,
    buffers: Vec<Buffer>,
    /// Contents of the files that buffers name.
    files: RefCell<HashMap<PathBuf, Arc<Vec<u8>>>>,
    /// Indices of the elements that sparse accessors replace, by the accessor's index.
    replaced: RefCell<HashMap<usize, Checked<Arc<[u32]>>>>,
    /// Contents of the compressed buffer views, by the view's index.
    decoded: HashMap<usize, Vec<u8>>,
    /// What Draco's data holds.
    pub draco: draco::Decoded,
    notes: RefCell<Vec<Notes>>,
    /// Who is told of the progress of loading.
    pub progress: Progress,
}

/// Most things of one kind that a warning lists.
const MAX_LISTED: usize = 8;

/// Things of one kind that are not shown.
struct Notes {
    /// Begins the warning.
    kind: &'static str,
    /// The first of them.
    listed: Vec<String>,
    n: usize,
}

/// A part of a file or of the data in a URI. Several buffers can share a file.
#[derive(Default)]
struct Buffer {
    content: Arc<Vec<u8>>,
    part: Range<usize>,
}

/// Where the bytes of an image are.
#[derive(Clone, PartialEq, Eq, Hash)]
pub(super) enum ImageSource {
    /// They are in the URI of the image at this index.
    Uri(usize),
    File(SourceFile),
    View(usize),
}

/// The part of a buffer that a buffer view shows.
#[derive(Clone, Copy)]
pub(super) struct View<'a> {
    pub bytes: &'a [u8],
    /// Distance of elements in bytes, if the view has one.
    pub stride: Option<usize>,
}

impl Document {
    /// Reads a glTF file from its content, and its buffers.
    pub fn read(source: SourceFile, bytes: Vec<u8>) -> Checked<Self> {
        let (json, chunk) = split(&bytes)?;
        let lenient::Parsed { root, morph_targets, pointers, left_out } = lenient::parse(&bytes[json])?;
        let (buffers, files, replaced) = (Vec::new(), RefCell::default(), RefCell::default());
        let (decoded, notes, progress) = (HashMap::new(), RefCell::default(), Progress::default());
        let draco = draco::Decoded::default();
        let mut document =
            Self { root, morph_targets, pointers, source, buffers, files, replaced, decoded, draco, notes, progress };
        left_out.into_iter().for_each(|what| document.note(LEFT_OUT, what));
        document.check_extensions()?;
        let chunk = chunk.map(|part| Buffer { content: Arc::new(bytes), part });
        let shown = document.shown_buffers();
        for ix in 0..document.root.buffers.len() {
            let buffer =
                document.buffer(ix, (chunk.as_ref(), &shown)).map_err(|what| format!("buffers[{ix}]: {what}"))?;
            document.buffers.push(buffer);
        }
        document.decode_views();
        document.draco = draco::Decoded::of(&document)?;
        Ok(document)
    }

    fn check_extensions(&self) -> Checked<()> {
        let is_needed = |name: &&String| !SUPPORTED.contains(&name.as_str()) && !changes_only_looks(name);
        let refused: Vec<_> = self.root.extensions_required.iter().filter(is_needed).collect();
        if !refused.is_empty() {
            let names: Vec<_> = refused.iter().map(|name| format!("`{name}`")).collect();
            return Err(format!("extensionsRequired: the file needs {}, which is not read", names.join(", ")));
        }
        let is_known = |name: &str| SUPPORTED.contains(&name) || WITHOUT_EFFECT.contains(&name);
        for name in self.root.extensions_used.iter().filter(|name| !is_known(name)) {
            self.note("extensions that are not read, so the picture may differ", name);
        }
        Ok(())
    }

    /// Returns the content of a buffer. Buffers that only stand in for compressed views, and those without content, are
    /// empty. One that is too short ends where its content ends.
    fn buffer(&self, ix: usize, (chunk, shown): (Option<&Buffer>, &HashSet<usize>)) -> Checked<Buffer> {
        let buffer = &self.root.buffers[ix];
        let extensions = buffer.extensions.as_ref();
        if extensions.is_some_and(|extensions| meshopt::is_fallback(&extensions.others)) {
            return Ok(Buffer::default());
        }
        let Buffer { content, part } = match (&buffer.uri, chunk) {
            (Some(uri), _) => self.fetch(uri).map(|content| Buffer { part: 0..content.len(), content })?,
            (None, Some(chunk)) if ix == 0 => Buffer { content: chunk.content.clone(), part: chunk.part.clone() },
            (None, _) => {
                if shown.contains(&ix) {
                    self.note(LEFT_OUT, format!("buffers[{ix}]: has no uri, and there is no binary chunk for it"));
                }
                return Ok(Buffer::default());
            }
        };
        let n_bytes = buffer.byte_length.0;
        if (part.len() as u64) < n_bytes {
            self.note(LEFT_OUT, format!("buffers[{ix}]: has {} bytes, but byteLength = {n_bytes}", part.len()));
        }
        let n_bytes = n_bytes.min(part.len() as u64) as usize;
        Ok(Buffer { content, part: part.start..part.start + n_bytes })
    }

    /// Returns the indices of the buffers that views show. Others stand in for views that are compressed, though they
    /// do not say so.
    fn shown_buffers(&self) -> HashSet<usize> {
        let is_packed = |view: &&json::buffer::View| {
            view.extensions.as_ref().is_some_and(|extensions| meshopt::packed(&extensions.others).is_some())
        };
        self.root.buffer_views.iter().filter(|view| !is_packed(view)).map(|view| view.buffer.value()).collect()
    }

    /// Decodes the compressed buffer views.
    fn decode_views(&mut self) {
        let mut n_total = 0;
        for (ix, view) in self.root.buffer_views.iter().enumerate() {
            let Some(packed) = view.extensions.as_ref().and_then(|it| meshopt::packed(&it.others)) else { continue };
            let decoded = packed.and_then(|packed| self.decoded_view(&packed, &mut n_total));
            let decoded = decoded.map_err(|what| format!("bufferViews[{ix}].extensions: meshopt_compression: {what}"));
            let decoded = self.or_left_out(decoded);
            self.decoded.extend(decoded.map(|bytes| (ix, bytes)));
        }
    }

    /// Decodes a buffer view. `n_total` is the number of bytes of all so far.
    fn decoded_view(&self, packed: &meshopt::Packed, n_total: &mut u64) -> Checked<Vec<u8>> {
        *n_total = packed.n_bytes()?.saturating_add(*n_total);
        require("decoding the buffer views", *n_total)?;
        let buffer = item(&self.buffers, "buffers", packed.buffer, &"buffer")?;
        packed.decode(part(buffer.bytes(), packed.byte_offset, packed.byte_length)?)
    }

    /// Returns what a buffer's URI stands for. A file that several buffers name is read once.
    fn fetch(&self, uri: &str) -> Checked<Arc<Vec<u8>>> {
        let name = match Uri::new(uri)? {
            Uri::Data => return data(uri).map(Arc::new),
            Uri::File(name) => name,
        };
        let file = self.named(&name)?;
        if let Some(content) = self.files.borrow().get(&file.path) {
            return Ok(content.clone());
        }
        let content = Arc::new(file.bytes().map_err(|error| error.to_string())?);
        self.files.borrow_mut().insert(file.path, content.clone());
        Ok(content)
    }

    /// Returns a file that the document names. Notes a name whose case is that of no file.
    fn named(&self, name: &str) -> Checked<SourceFile> {
        let mut file = self.source.exact_or_alike(name)?;
        // All names of a file count as one.
        if std::mem::take(&mut file.is_other_case) {
            let taken = format!("`{name}` ({} is taken)", file.path.display());
            self.note("names of files that differ from those on disk in the case of letters", taken);
        }
        Ok(file)
    }

    /// Returns the indices of the elements that the sparse accessor at an index replaces. `read` reads them at the
    /// first call.
    pub fn replaced(&self, accessor_ix: usize, read: impl FnOnce() -> Checked<Arc<[u32]>>) -> Checked<Arc<[u32]>> {
        if let Some(known) = self.replaced.borrow().get(&accessor_ix) {
            return known.clone();
        }
        let replaced = read();
        self.replaced.borrow_mut().insert(accessor_ix, replaced.clone());
        replaced
    }

    /// Returns where the bytes of an image are. `from` is the JSON path that names the image.
    pub fn image_source(&self, index: Index<image::Image>, from: &dyn Display) -> Checked<ImageSource> {
        let image = item(&self.root.images, "images", index.value(), from)?;
        let failed = |what: String| format!("images[{index}]: {what}");
        match (&image.uri, image.buffer_view) {
            (Some(uri), _) => match Uri::new(uri).map_err(failed)? {
                Uri::Data => Ok(ImageSource::Uri(index.value())),
                Uri::File(name) => self.named(&name).map(ImageSource::File).map_err(failed),
            },
            (None, Some(view)) => Ok(ImageSource::View(view.value())),
            (None, None) => Err(failed("has neither uri nor bufferView".to_owned())),
        }
    }

    /// Returns the bytes of the image at an index, or `None` with a note if its file cannot be read.
    pub fn image(&self, ix: usize, source: &ImageSource) -> Checked<Option<Cow<'_, [u8]>>> {
        let place = format!("images[{ix}]");
        match source {
            ImageSource::Uri(ix) => {
                let bytes = data(self.root.images[*ix].uri.as_deref().unwrap_or_default());
                bytes.map(|bytes| Some(bytes.into())).map_err(|what| format!("{place}: {what}"))
            }
            ImageSource::View(view) => Ok(Some(self.view(Index::new(*view as u32), &place)?.bytes.into())),
            ImageSource::File(file) => {
                let bytes = file.bytes().map_err(|error| match file.exists() {
                    false => {
                        let path = file.path.display();
                        self.note("image files that do not exist, without which materials are shown", path);
                    }
                    true => self.note("images that cannot be read, without which materials are shown", error),
                });
                Ok(bytes.ok().map(Cow::from))
            }
        }
    }

    /// Returns the part of a buffer that a view shows. `from` is the JSON path that names the view.
    pub fn view(&self, index: Index<json::buffer::View>, from: &dyn Display) -> Checked<View<'_>> {
        let ix = index.value();
        let view = item(&self.root.buffer_views, "bufferViews", ix, from)?;
        let stride = view.byte_stride.map(|stride| stride.0);
        if let Some(bytes) = self.decoded.get(&ix) {
            return Ok(View { bytes, stride });
        }
        let place = format!("bufferViews[{ix}]");
        let buffer = item(&self.buffers, "buffers", view.buffer.value(), &place)?;
        let offset = view.byte_offset.unwrap_or_default().0;
        let bytes = part(buffer.bytes(), offset, view.byte_length.0).map_err(|what| format!("{place}: {what}"))?;
        Ok(View { bytes, stride })
    }

    /// Returns what could be read, or remembers that it is left out.
    pub fn or_left_out<T>(&self, read: Checked<T>) -> Option<T> {
        read.map_err(|what| self.note(LEFT_OUT, what)).ok()
    }

    /// Reads an extension that the crate `gltf` does not know. `path` is the JSON path of the object that has it.
    pub fn extension<T: DeserializeOwned>(&self, all: &Map<String, Value>, name: &str, path: &str) -> Option<T> {
        let read = json::deserialize::from_value(all.get(name)?.clone());
        self.or_left_out(read.map_err(|error| format!("{path}.extensions.{name}: {error}")))
    }

    /// Returns the first thing that is left out because it cannot be read.
    pub fn first_left_out(&self) -> Option<String> {
        let notes = self.notes.borrow();
        notes.iter().find(|notes| notes.kind == LEFT_OUT).and_then(|notes| notes.listed.first().cloned())
    }

    /// Returns the nearest number from `min` to `max`, and remembers that it is not the file's. NaN becomes `min`.
    pub fn clamped(&self, path: &str, name: &str, value: f32, (min, max): (f32, f32)) -> f32 {
        if (min..=max).contains(&value) {
            return value;
        }
        let taken = if value.is_nan() { min } else { value.clamp(min, max) };
        self.note("numbers out of range, which are clamped", format!("{path}.{name} = {value} (to {taken})"));
        taken
    }

    /// Remembers that something is not shown. `kind` begins the warning, in which things of one kind are listed.
    pub fn note(&self, kind: &'static str, what: impl Display) {
        let mut all = self.notes.borrow_mut();
        let known = all.iter().position(|notes| notes.kind == kind);
        let ix = known.unwrap_or_else(|| {
            all.push(Notes { kind, listed: Vec::new(), n: 0 });
            all.len() - 1
        });
        let notes = &mut all[ix];
        notes.n += 1;
        if notes.listed.len() < MAX_LISTED {
            notes.listed.push(short_line(&what.to_string()));
        }
    }

    /// Returns the number of notes.
    pub fn n_notes(&self) -> usize {
        self.notes.borrow().iter().map(|notes| notes.n).sum()
    }

    /// Returns a warning for each kind of thing that is not shown.
    pub fn warnings(&self) -> Vec<String> {
        let warning = |Notes { kind, listed, n }: Notes| {
            let more = if n > listed.len() { format!(" and {} more", n - listed.len()) } else { String::new() };
            format!("{}: {kind}: {}{more}", self.source.path.display(), listed.join(", "))
        };
        self.notes.take().into_iter().map(warning).collect()
    }
}

impl Buffer {
    fn bytes(&self) -> &[u8] {
        &self.content[self.part.clone()]
    }
}

/// Returns an item of one of the document's lists, or an error that names the JSON path `from`.
pub(super) fn item<'a, T>(list: &'a [T], name: &str, ix: usize, from: &dyn Display) -> Checked<&'a T> {
    list.get(ix).ok_or_else(|| format!("{from}: there is no {name}[{ix}], but only {}", list.len()))
}

/// Returns a part of some bytes, or an error if they end before it does.
pub(super) fn part(bytes: &[u8], offset: u64, n_bytes: u64) -> Checked<&[u8]> {
    let end = offset.checked_add(n_bytes).filter(|end| *end <= bytes.len() as u64);
    match end {
        Some(end) => Ok(&bytes[offset as usize..end as usize]),
        None => Err(format!("{n_bytes} bytes from byte {offset} on reach beyond the {} that there are", bytes.len())),
    }
}

/// Returns the files that a glTF file names: its buffers and images. What cannot be read names nothing.
pub(crate) fn named_files(MeshFile { source, bytes, .. }: &MeshFile) -> Vec<SourceFile> {
    let json = split(bytes).map(|(json, _)| &bytes[json]).unwrap_or_default();
    let root: Value = json::deserialize::from_slice(json).unwrap_or_default();
    let items = ["buffers", "images"].into_iter().filter_map(|list| root.get(list)?.as_array()).flatten();
    let uris = items.filter_map(|item| item.get("uri")?.as_str());
    uris.filter_map(|uri| match Uri::new(uri) {
        Ok(Uri::File(name)) => source.exact_or_alike(&name).ok(),
        _ => None,
    })
    .collect()
}

#[cfg(test)]
mod tests {
    use std::{fs, path::Path};

    use super::*;
    use crate::scene::LoadOptions;

    #[test]
    fn a_file_of_several_buffers_is_read_once() {
        let folder = tempfile::tempdir().unwrap();
        fs::write(folder.path().join("a b.bin"), [7; 12]).unwrap();
        let buffers = r#"[{ "uri": "a%20b.bin", "byteLength": 4 }, { "uri": "./a b.bin", "byteLength": 12 }]"#;
        let json = format!(r#"{{ "asset": {{ "version": "2.0" }}, "buffers": {buffers} }}"#);
        let path = folder.path().join("m.gltf");
        let source = SourceFile::new(&path, &LoadOptions::default());
        let document = Document::read(source, json.into_bytes()).unwrap();
        let [a, b] = &document.buffers[..] else { panic!("two buffers") };
        assert!(Arc::ptr_eq(&a.content, &b.content));
        assert_eq!((a.bytes(), b.bytes()), (&[7; 4][..], &[7; 12][..]));
    }

    #[test]
    fn the_indices_of_a_sparse_accessor_are_read_once() {
        let json = br#"{ "asset": { "version": "2.0" } }"#;
        let source = SourceFile::new(Path::new("m.gltf"), &LoadOptions::default());
        let document = Document::read(source, json.to_vec()).unwrap();
        let first = document.replaced(3, || Ok([1, 5].into())).unwrap();
        let again = document.replaced(3, || Err("it is known".to_owned())).unwrap();
        assert!(Arc::ptr_eq(&first, &again));
        assert!(document.replaced(4, || Err("it is not known".to_owned())).is_err());
    }
}
