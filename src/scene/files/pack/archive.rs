//! The ZIP archive of a pack, from which files are decompressed.

use std::{
    fs::File,
    io::{self, Read},
    path::PathBuf,
    sync::{Mutex, PoisonError},
};

use flate2::read::DeflateDecoder;
use zip::{CompressionMethod, ZipArchive};

use crate::{scene::model::error::Checked, util::memory::require};

/// An open archive.
pub struct Archive {
    pub path: PathBuf,
    zip: Mutex<ZipArchive<File>>,
}

impl Archive {
    /// Reads the list of files. An error is a message for people.
    pub fn new(path: PathBuf, file: File) -> Checked<Self> {
        let zip = ZipArchive::new(file).map_err(|error| format!("is no pack: {error}"))?;
        Ok(Self { path, zip: Mutex::new(zip) })
    }

    /// Returns the content of a file. The content may be damaged: no checksum is compared.
    ///
    /// # Errors
    /// There is no such file, it cannot be read or decompressed, or its content has more than `most` bytes.
    pub fn content(&self, name: &str, most: u64) -> io::Result<Vec<u8>> {
        let (method, compressed) = self.compressed(name)?;
        let content = match method {
            CompressionMethod::Stored => compressed,
            CompressionMethod::Deflated => read_at_most(most.saturating_add(1), DeflateDecoder::new(&compressed[..]))?,
            method => return Err(io::Error::other(format!("files packed by {method} are not read"))),
        };
        if content.len() as u64 > most { Err(io::Error::other("it is larger than stated")) } else { Ok(content) }
    }

    /// Returns the bytes of a file as the archive has them, and how they are compressed. Several threads can decompress
    /// at the same time, since the archive is in use only while this function runs.
    fn compressed(&self, name: &str) -> io::Result<(CompressionMethod, Vec<u8>)> {
        let mut zip = self.zip.lock().unwrap_or_else(PoisonError::into_inner);
        let ix = zip.index_for_name(name).ok_or(io::ErrorKind::NotFound)?;
        let file = zip.by_index_raw(ix)?;
        // The size that the archive states may be wrong.
        let n_bytes = self.path.metadata()?.len().min(file.compressed_size());
        require("reading a pack", n_bytes).map_err(io::Error::other)?;
        Ok((file.compression(), read_at_most(n_bytes, file)?))
    }
}

/// Reads to the end, but not more than `most` bytes. Takes no more memory than that: a vector that grows while it is
/// read would take up to thrice as much, and end the process if that is more than there is.
fn read_at_most(most: u64, reader: impl Read) -> io::Result<Vec<u8>> {
    let mut bytes = Vec::new();
    bytes.try_reserve_exact(usize::try_from(most).map_err(io::Error::other)?).map_err(io::Error::other)?;
    reader.take(most).read_to_end(&mut bytes)?;
    Ok(bytes)
}

#[cfg(test)]
mod tests {
    use std::io::Write;

    use tempfile::TempDir;
    use zip::{ZipWriter, write::SimpleFileOptions};

    use super::*;

    #[test]
    fn a_file_takes_no_more_memory_than_it_has_bytes() {
        let directory = TempDir::new().unwrap();
        let path = directory.path().join("a.zip");
        let content = vec![7; 3_000_000];
        let mut writer = ZipWriter::new(File::create(&path).unwrap());
        for method in [CompressionMethod::Stored, CompressionMethod::Deflated] {
            writer.start_file(method.to_string(), SimpleFileOptions::DEFAULT.compression_method(method)).unwrap();
            writer.write_all(&content).unwrap();
        }
        writer.finish().unwrap();
        let archive = Archive::new(path.clone(), File::open(&path).unwrap()).unwrap();
        for name in ["Stored", "Deflated"] {
            let found = archive.content(name, 3_000_000).unwrap();
            assert!(found == content && found.capacity() <= 3_000_001, "{name}: {} bytes", found.capacity());
            let error = archive.content(name, 2_999_999).unwrap_err();
            assert_eq!(error.to_string(), "it is larger than stated");
        }
        assert_eq!(archive.content("none", 1).unwrap_err().kind(), io::ErrorKind::NotFound);
    }
}
