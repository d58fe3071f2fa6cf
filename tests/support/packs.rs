//! Mends packs that were changed, so that a reader goes on behind the hashes in them.

use std::io::Read;

use flate2::read::DeflateDecoder;
use serde::{Deserialize, Serialize};

/// Bytes with which the header of a file begins in an archive.
const FILE_HEADER: [u8; 4] = *b"PK\x03\x04";
/// Bytes with which an entry of the archive's directory begins.
const DIRECTORY_ENTRY: [u8; 4] = *b"PK\x01\x02";
/// Bytes with which the end of the archive's directory begins.
const DIRECTORY_END: [u8; 4] = *b"PK\x05\x06";
/// Number of bytes of a file's header without its name.
const N_HEADER_BYTES: usize = 30;
/// The archive's number for files that are not compressed, and for deflated ones.
const STORED: u16 = 0;
const DEFLATED: u16 = 8;
/// The most bytes that are decompressed of a file.
const MOST_BYTES: u64 = 1 << 20;

/// A file of an archive.
pub struct PackFile {
    /// It need not be UTF-8.
    name: Vec<u8>,
    /// How the bytes are compressed.
    method: u16,
    bytes: Vec<u8>,
}

/// The manifest of a pack, as kdray writes it: the hash is that of these properties in this order.
#[derive(Serialize, Deserialize)]
struct Manifest {
    hash: String,
    format: u32,
    version: String,
    scene: String,
    #[serde(skip_serializing_if = "Option::is_none", default)]
    scene_name: Option<String>,
    #[serde(skip_serializing_if = "Option::is_none", default)]
    camera: Option<String>,
    #[serde(skip_serializing_if = "Option::is_none", default)]
    path: Option<String>,
    #[serde(skip_serializing_if = "Option::is_none", default)]
    folder: Option<String>,
    files: Vec<Described>,
}

/// What the manifest says of a file.
#[derive(Serialize, Deserialize)]
struct Described {
    name: String,
    n_bytes: u64,
    blake3: String,
}

impl PackFile {
    /// Returns the decompressed content, or `None` if it cannot be decompressed.
    pub fn content(&self) -> Option<Vec<u8>> {
        match self.method {
            STORED => Some(self.bytes.clone()),
            DEFLATED => {
                let mut content = Vec::new();
                DeflateDecoder::new(&self.bytes[..]).take(MOST_BYTES).read_to_end(&mut content).ok()?;
                Some(content)
            }
            _ => None,
        }
    }
}

/// Returns the files of an archive in which anything may be wrong: a file ends where the next one or the directory
/// begins, whatever the archive says of its size and its place.
pub fn files_of(archive: &[u8]) -> Vec<PackFile> {
    let begins = |at: usize, mark: [u8; 4]| archive[at..].starts_with(&mark);
    let is_end = |at: usize| begins(at, FILE_HEADER) || begins(at, DIRECTORY_ENTRY) || begins(at, DIRECTORY_END);
    let file_at = |at: usize| {
        let number = |offset: usize| Some(u16::from_le_bytes(*archive.get(at + offset..)?.first_chunk()?));
        let name = at + N_HEADER_BYTES..at + N_HEADER_BYTES + usize::from(number(26)?);
        let begin = name.end + usize::from(number(28)?);
        let end = (at + 1..archive.len()).find(|end| is_end(*end)).unwrap_or(archive.len());
        Some(PackFile {
            name: archive.get(name)?.to_vec(),
            method: number(8)?,
            bytes: archive.get(begin..end.max(begin))?.to_vec(),
        })
    };
    (0..archive.len()).filter(|at| begins(*at, FILE_HEADER)).filter_map(file_at).collect()
}

/// Returns a pack of the files, whose manifest states their sizes and hashes, and its own hash. A file that the
/// manifest does not describe, or that cannot be decompressed, is left as it is, and so is a manifest that cannot be
/// read.
pub fn resealed(mut files: Vec<PackFile>) -> Vec<u8> {
    let manifest = files.iter().position(|file| file.name == b"kdpack.json");
    let sealed = manifest.and_then(|ix| sealed(&files[ix].content()?, &files));
    if let Some((ix, json)) = manifest.zip(sealed) {
        (files[ix].method, files[ix].bytes) = (STORED, json);
    }
    archive_of(&files)
}

/// Returns the manifest with the sizes and the hashes of the files.
fn sealed(json: &[u8], files: &[PackFile]) -> Option<Vec<u8>> {
    let mut manifest: Manifest = serde_json::from_slice(json).ok()?;
    for described in &mut manifest.files {
        let file = files.iter().find(|file| file.name == described.name.as_bytes());
        if let Some(content) = file.and_then(PackFile::content) {
            described.n_bytes = content.len() as u64;
            described.blake3 = blake3::hash(&content).to_hex().to_string();
        }
    }
    manifest.hash.clear();
    manifest.hash = blake3::hash(&serde_json::to_vec(&manifest).ok()?).to_hex()[..32].to_owned();
    serde_json::to_vec_pretty(&manifest).ok()
}

/// Returns a ZIP archive of the files. Their checksums are 0, since kdray compares the hashes of the manifest instead.
fn archive_of(files: &[PackFile]) -> Vec<u8> {
    let (mut archive, mut directory) = (Vec::new(), Vec::new());
    for PackFile { name, method, bytes } in files {
        let n_content_bytes = if *method == STORED { bytes.len() } else { MOST_BYTES as usize };
        // Version of the format, flags, method, time, date, checksum, both sizes, length of the name and of extra data.
        let mut common = [20_u16.to_le_bytes(), [0; 2], method.to_le_bytes(), [0; 2], 33_u16.to_le_bytes()].concat();
        common.extend([[0; 4], (bytes.len() as u32).to_le_bytes(), (n_content_bytes as u32).to_le_bytes()].concat());
        common.extend([(name.len() as u16).to_le_bytes(), [0; 2]].concat());
        directory.extend([&DIRECTORY_ENTRY[..], &20_u16.to_le_bytes(), &common, &[0; 10]].concat());
        directory.extend([&(archive.len() as u32).to_le_bytes()[..], name].concat());
        archive.extend([&FILE_HEADER[..], &common, name, bytes].concat());
    }
    let (n_files, begin) = ((files.len() as u16).to_le_bytes(), archive.len() as u32);
    let n_directory_bytes = directory.len() as u32;
    archive.extend(directory);
    archive.extend([&DIRECTORY_END[..], &[0; 4], &n_files, &n_files].concat());
    archive.extend([&n_directory_bytes.to_le_bytes()[..], &begin.to_le_bytes(), &[0; 2]].concat());
    archive
}
