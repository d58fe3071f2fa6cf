//! KTX2 files with textures of Basis Universal: ETC1S in BasisLZ, and UASTC, plain or in Zstandard. Mip 0 is read.
//!
//! The decoder trusts a file's header: it allocates what the header states, and panics on some wrong offsets. So each
//! number that it uses is checked here first.

#[cfg(test)]
mod tests;

use std::ops::Range;

use basisu::{DecodeFlags, TargetFormat, Transcoder};

use super::{Format, Header};
use crate::scene::model::{Pixels, error::Checked};

/// The first bytes of each file.
pub(super) const MARK: &[u8] = b"\xabKTX 20\xbb\r\n\x1a\n";
/// What to do with a file that is not read.
const REMEDY: &str = "`gltf-transform ktxdecompress IN OUT` makes PNG of it in a glTF file";

/// Bytes of the header, and of an entry in the list of mip levels behind it.
const HEADER_BYTES: usize = 80;
const LEVEL_BYTES: usize = 24;
/// Where the header has offset and size of the list of keys and values.
const KEYS: Range<usize> = 56..64;
/// The most mip levels that the decoder reads.
const MAX_LEVELS: u32 = 16;
/// Bytes before the descriptors of images in the data that all of them share, and of a descriptor.
const SHARED_BYTES: usize = 20;
const IMAGE_BYTES: u64 = 20;
/// Bytes of a UASTC block of 4 x 4 pixels.
const BLOCK_BYTES: u64 = 16;
/// Colour models in the data format descriptor.
const ETC1S: u8 = 163;
const UASTC: u8 = 166;
/// How levels are compressed once more.
const NOT: u32 = 0;
const BASIS_LZ: u32 = 1;
const ZSTANDARD: u32 = 2;

/// Reads and checks the header. The sizes of the image are not checked.
pub(super) fn header_of(bytes: &[u8]) -> Checked<Header> {
    let file = File { bytes };
    if bytes.len() < HEADER_BYTES + LEVEL_BYTES {
        return Err(format!("ends within the header of KTX2, after {} bytes", bytes.len()));
    }
    let [vulkan_format, width, height, depth] = [12, 20, 24, 28].map(|at| file.u32(at));
    let [n_layers, n_faces, n_levels, scheme] = [32, 36, 40, 44].map(|at| file.u32(at));
    if depth > 0 || n_layers > 1 || n_faces != 1 {
        return Err(format!("is KTX2 with layers, faces or depth, which is not read: {REMEDY}"));
    }
    // The descriptor has its own size, and its header, before the colour model.
    let descriptor = file.part("data format descriptor", u64::from(file.u32(48)), u64::from(file.u32(52)))?;
    let model = descriptor.get(12).copied();
    match (vulkan_format, model, scheme) {
        (0, Some(ETC1S), BASIS_LZ) => file.check_shared(n_levels)?,
        (0, Some(UASTC), NOT | ZSTANDARD) => file.check_level((width, height), scheme)?,
        _ => return Err(format!("is KTX2 without a texture of Basis Universal, which is not read: {REMEDY}")),
    }
    if !(1..=MAX_LEVELS).contains(&n_levels) {
        return Err(format!("has {n_levels} mip levels, not 1 to {MAX_LEVELS}"));
    }
    // Beside its pixels, the decoder holds the blocks that were compressed once more, one byte a pixel.
    Ok(Header { format: Format::Ktx2, width, height, decoder_bytes: 5, pixel_bytes: 4, is_linear: false })
}

/// Decodes a file whose header has been checked.
pub(super) fn decode(bytes: &[u8]) -> Checked<Pixels> {
    // The key/value list does not affect mip 0, and the decoder panics on some malformed lists.
    let mut bytes = bytes.to_vec();
    bytes[KEYS].fill(0);
    let failed = |_| format!("has spoilt data of Basis Universal, or a variant that is not read: {REMEDY}");
    let transcoder = Transcoder::new(&bytes).map_err(failed)?;
    let pixels = transcoder.transcode(0, TargetFormat::Rgba32, DecodeFlags::NONE).map_err(failed)?;
    Ok(Pixels::Bytes(pixels.as_chunks().0.to_vec()))
}

/// A file that is not shorter than its header and one mip level's entry.
struct File<'a> {
    bytes: &'a [u8],
}

impl<'a> File<'a> {
    fn u32(&self, at: usize) -> u32 {
        u32::from_le_bytes(self.bytes[at..at + 4].try_into().expect("four bytes"))
    }

    fn u64(&self, at: usize) -> u64 {
        u64::from_le_bytes(self.bytes[at..at + 8].try_into().expect("eight bytes"))
    }

    fn part(&self, name: &str, offset: u64, n_bytes: u64) -> Checked<&'a [u8]> {
        let end = offset.checked_add(n_bytes).filter(|end| *end <= self.bytes.len() as u64);
        let end = end.ok_or_else(|| format!("ends before its {name}: {n_bytes} bytes from byte {offset} on"))?;
        Ok(&self.bytes[offset as usize..end as usize])
    }

    /// Returns the bytes of mip 0 as they are stored.
    fn level(&self) -> Checked<&'a [u8]> {
        self.part("mip level 0", self.u64(HEADER_BYTES), self.u64(HEADER_BYTES + 8))
    }

    /// Checks the data that ETC1S images share: palettes and tables.
    fn check_shared(&self, n_levels: u32) -> Checked<()> {
        self.level()?;
        let shared = self.part("shared data", self.u64(64), self.u64(72))?;
        let Some((head, rest)) = shared.split_at_checked(SHARED_BYTES) else {
            return Err("ends within its shared data".to_owned());
        };
        let sizes = head[4..16].as_chunks().0.iter().map(|word| u64::from(u32::from_le_bytes(*word)));
        let needed = sizes.sum::<u64>() + u64::from(n_levels) * IMAGE_BYTES;
        if needed > rest.len() as u64 {
            return Err(format!("needs {needed} bytes of shared data, but has {}", rest.len()));
        }
        Ok(())
    }

    /// Checks the sizes of mip 0 of UASTC blocks.
    fn check_level(&self, (width, height): (u32, u32), scheme: u32) -> Checked<()> {
        let n_blocks = u64::from(width.div_ceil(4)) * u64::from(height.div_ceil(4));
        let needed = n_blocks.saturating_mul(BLOCK_BYTES);
        let n_bytes = match scheme {
            ZSTANDARD => self.u64(HEADER_BYTES + 16),
            _ => self.u64(HEADER_BYTES + 8),
        };
        self.level()?;
        if n_bytes != needed {
            return Err(format!(
                "{width} x {height} pixels of UASTC have {needed} bytes, but mip level 0 has {n_bytes}"
            ));
        }
        Ok(())
    }
}
