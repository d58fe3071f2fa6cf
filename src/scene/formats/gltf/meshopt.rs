//! Compressed buffer views: EXT_meshopt_compression, and its successor KHR_meshopt_compression.

use gltf::json::{self, Value};
use serde::Deserialize;
use serde_json::Map;

use crate::scene::model::error::Checked;

/// The two names of the extension.
const NAMES: [&str; 2] = ["EXT_meshopt_compression", "KHR_meshopt_compression"];

/// A compressed buffer view.
#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct Packed {
    /// Index of the buffer with the compressed data.
    pub buffer: usize,
    #[serde(default)]
    pub byte_offset: u64,
    pub byte_length: u64,
    byte_stride: u64,
    count: u64,
    mode: Mode,
    #[serde(default)]
    filter: Filter,
}

#[derive(Clone, Copy, Deserialize, PartialEq)]
#[serde(rename_all = "UPPERCASE")]
enum Mode {
    Attributes,
    Triangles,
    Indices,
}

#[derive(Clone, Copy, Default, Deserialize, PartialEq)]
#[serde(rename_all = "UPPERCASE")]
enum Filter {
    #[default]
    None,
    Octahedral,
    Quaternion,
    Exponential,
    Color,
}

/// Returns whether a buffer only stands in for views that are compressed.
pub(super) fn is_fallback(extensions: &Map<String, Value>) -> bool {
    let is_set = |extension: &Value| extension.get("fallback").and_then(Value::as_bool) == Some(true);
    NAMES.iter().filter_map(|name| extensions.get(*name)).any(is_set)
}

/// Returns how a buffer view is compressed, if it is.
pub(super) fn packed(extensions: &Map<String, Value>) -> Option<Checked<Packed>> {
    let extension = NAMES.iter().find_map(|name| extensions.get(*name))?;
    Some(json::deserialize::from_value(extension.clone()).map_err(|error| error.to_string()))
}

impl Packed {
    /// Returns the decoded view's size in bytes, once the sizes are known to be those that the decoders accept.
    pub fn n_bytes(&self) -> Checked<u64> {
        let &Self { byte_stride: stride, count, mode, filter, .. } = self;
        let is_stride = match mode {
            Mode::Attributes => stride % 4 == 0 && (4..=256).contains(&stride),
            Mode::Triangles | Mode::Indices => stride == 2 || stride == 4,
        };
        let fits_filter = match filter {
            Filter::None | Filter::Exponential => true,
            Filter::Octahedral | Filter::Color => stride == 4 || stride == 8,
            Filter::Quaternion => stride == 8,
        };
        if !is_stride || !fits_filter {
            return Err(format!("byteStride = {stride} does not fit mode and filter"));
        }
        if mode == Mode::Triangles && count % 3 != 0 {
            return Err(format!("count = {count} is no multiple of 3"));
        }
        if mode != Mode::Attributes && filter != Filter::None {
            return Err("indices have no filter".to_owned());
        }
        // The codecs save a factor of 1024 at most: 256 equal bytes take two bits.
        let n_bytes = stride.checked_mul(count).filter(|n| *n / 4096 <= self.byte_length);
        n_bytes.ok_or_else(|| format!("count = {count} is more than {} bytes hold", self.byte_length))
    }

    /// Decodes the view. `n_bytes` must have accepted the sizes.
    pub fn decode(&self, bytes: &[u8]) -> Checked<Vec<u8>> {
        let (count, is_short) = (self.count as usize, self.byte_stride == 2);
        // The decoders read a header before they look at the size.
        if bytes.is_empty() {
            return Err("there is no data".to_owned());
        }
        let decoded = match (self.mode, is_short) {
            (Mode::Attributes, _) => self.attributes(bytes),
            (Mode::Triangles, true) => meshopt::decode_index_buffer::<u16>(bytes, count).map(shorts),
            (Mode::Triangles, false) => meshopt::decode_index_buffer::<u32>(bytes, count).map(words),
            (Mode::Indices, true) => meshopt::decode_index_sequence::<u16>(bytes, count).map(shorts),
            (Mode::Indices, false) => meshopt::decode_index_sequence::<u32>(bytes, count).map(words),
        };
        decoded.map_err(|error| format!("the data is spoilt: {error}"))
    }

    fn attributes(&self, bytes: &[u8]) -> meshopt::Result<Vec<u8>> {
        let count = self.count as usize;
        // The decoder's elements have a size that is known when it is compiled.
        macro_rules! of_size {
            ($($n_words:literal)*) => {
                match self.byte_stride / 4 {
                    $($n_words => decode::<$n_words>(bytes, count),)*
                    _ => unreachable!("n_bytes accepts no other stride"),
                }
            };
        }
        let mut decoded = of_size!(
            1 2 3 4 5 6 7 8 9 10 11 12 13 14 15 16 17 18 19 20 21 22 23 24 25 26 27 28 29 30 31 32 33 34 35 36 37 38
            39 40 41 42 43 44 45 46 47 48 49 50 51 52 53 54 55 56 57 58 59 60 61 62 63 64
        )?;
        let bytes: &mut [u8] = bytemuck::cast_slice_mut(&mut decoded);
        match (self.filter, self.byte_stride) {
            (Filter::None, _) => {}
            (Filter::Octahedral, 4) => meshopt::decode_filter_oct::<i8>(bytemuck::cast_slice_mut(bytes)),
            (Filter::Octahedral, _) => meshopt::decode_filter_oct::<i16>(bytemuck::cast_slice_mut(bytes)),
            (Filter::Quaternion, _) => meshopt::decode_filter_quat(bytemuck::cast_slice_mut(bytes)),
            // It decodes each word on its own.
            (Filter::Exponential, _) => meshopt::decode_filter_exp::<1>(bytemuck::cast_slice_mut(bytes)),
            (Filter::Color, 4) => meshopt::decode_filter_color::<u8>(bytemuck::cast_slice_mut(bytes)),
            (Filter::Color, _) => meshopt::decode_filter_color::<u16>(bytemuck::cast_slice_mut(bytes)),
        }
        Ok(words(decoded))
    }
}

/// An element of a buffer view.
#[derive(Clone)]
struct Element<const N: usize>([u32; N]);

impl<const N: usize> Default for Element<N> {
    fn default() -> Self {
        Self([0; N])
    }
}

/// Returns the words of all elements. This is compiled once for each size, so it is short.
fn decode<const N: usize>(bytes: &[u8], count: usize) -> meshopt::Result<Vec<u32>> {
    let mut words = Vec::with_capacity(N * count);
    for Element(element) in &meshopt::decode_vertex_buffer::<Element<N>>(bytes, count)? {
        words.extend_from_slice(element);
    }
    Ok(words)
}

fn words(words: Vec<u32>) -> Vec<u8> {
    words.into_iter().flat_map(u32::to_ne_bytes).collect()
}

fn shorts(shorts: Vec<u16>) -> Vec<u8> {
    shorts.into_iter().flat_map(u16::to_ne_bytes).collect()
}
