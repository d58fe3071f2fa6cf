//! Writes pixels to a file, whole or not at all.
//!
//! A file is written beside its destination under a temporary name, then synchronized and renamed. Its contents are
//! encoded in memory first, unless they are too large ([`write_with`]). So if the disk is full, the earlier file
//! stays as it was, and no truncated or temporary file is left. A signal that ends the process leaves none either, if
//! its handler calls [`remove_temporaries`].

use std::{
    error::Error,
    ffi::OsString,
    fs::{self, File, OpenOptions},
    io::{self, Seek, Write},
    path::{Path, PathBuf},
};

use image::{
    ImageError,
    error::{ParameterError, ParameterErrorKind},
};
use tempfile::SpooledTempFile;
use tracing::info_span;

pub(crate) use self::layers::sum_prefix;
use self::{destination::Destination, temporary::Temporary};
pub use self::{
    destination::regular_file,
    film::{FilmFile, FilmFormat},
    heat_map::HeatMap,
    layers::{Layers, write_layers, write_with_channels},
    record::{PathRecord, RECORD_ATTRIBUTE, Record, WholeRecord},
    temporary::remove_temporaries,
};
use crate::frame::Picture;

mod destination;
mod film;
mod heat_map;
mod layers;
mod record;
mod temporary;

/// Size beyond which a spool goes to disk, bytes.
const SPOOL_IN_MEMORY: usize = 64 << 20;

/// The reason why a file was not written.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum OutputError {
    /// The file's name does not tell the format in which to write it.
    #[error("cannot write `{path}`: a picture's name must end in .png or .exr")]
    UnknownEnding {
        /// The file.
        path: PathBuf,
    },
    /// The file's folder does not exist.
    #[error("cannot write `{path}`: `{directory}` is not a directory")]
    NoDirectory {
        /// The file.
        path: PathBuf,
        /// The folder.
        directory: PathBuf,
    },
    /// The file's name is that of a folder.
    #[error("cannot write `{path}`: it is a directory")]
    IsDirectory {
        /// The file.
        path: PathBuf,
    },
    /// The pixels cannot be encoded.
    #[error("cannot encode `{path}`: {source}")]
    Encode {
        /// The file.
        path: PathBuf,
        /// The encoder's error.
        source: Box<dyn Error + Send + Sync>,
    },
    /// The file cannot be written.
    #[error("cannot write `{path}`: {source}")]
    Write {
        /// The file.
        path: PathBuf,
        /// The system's error.
        source: io::Error,
    },
}

impl OutputError {
    fn encode(path: &Path, source: impl Error + Send + Sync + 'static) -> Self {
        Self::Encode { path: path.to_owned(), source: Box::new(source) }
    }
}

/// Format of a picture's file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Format {
    /// 8 bits a channel, sRGB: [`Picture::display`].
    Png,
    /// Linear 32-bit floats, before exposure: [`Picture::radiance`].
    Exr,
}

impl Format {
    /// Returns the format that a file's ending names, in upper or lower case.
    ///
    /// # Errors
    /// The ending names no format.
    pub fn of(path: &Path) -> Result<Self, OutputError> {
        let ending = path.extension().unwrap_or_default();
        if ending.eq_ignore_ascii_case("png") {
            Ok(Self::Png)
        } else if ending.eq_ignore_ascii_case("exr") {
            Ok(Self::Exr)
        } else {
            Err(OutputError::UnknownEnding { path: path.to_owned() })
        }
    }
}

/// Returns a file name without ending for pictures of a scene. `-` replaces control characters and path separators,
/// so the name is that of a file in the working directory.
pub fn stem_of(scene_name: &str) -> String {
    let name = scene_name.replace(|c: char| std::path::is_separator(c) || c.is_control(), "-");
    if name.is_empty() { "picture".to_owned() } else { name }
}

/// Checks that a file can be created or replaced at `path`, before minutes are spent on its contents.
///
/// # Errors
/// No file can be created or replaced there.
pub fn check(path: &Path) -> Result<(), OutputError> {
    match Destination::at(path)? {
        Destination::Stream => Ok(()),
        Destination::File { directory, .. } => Temporary::create_in(&directory)
            .map(drop)
            .map_err(|source| OutputError::Write { path: path.to_owned(), source }),
    }
}

/// Writes a picture in the format that the file's ending names. Both formats hold exactly the picture's RGB values.
pub fn write_picture(path: &Path, picture: &Picture) -> Result<(), OutputError> {
    write_recorded(path, picture, None)
}

/// Writes a picture as [`write_picture`] does, with its record.
pub fn write_recorded(path: &Path, picture: &Picture, record: Option<&Record>) -> Result<(), OutputError> {
    if Format::of(path)? == Format::Exr {
        return write_layers(path, picture, &Layers { record, ..Layers::default() });
    }
    let bytes = info_span!("encode picture").in_scope(|| encode_png(picture, record));
    let _writing = info_span!("write picture").entered();
    write(path, &bytes.map_err(|source| OutputError::encode(path, source))?)
}

/// Writes a file whole or not at all. Devices and pipes are written to directly.
///
/// A symbolic link is followed. If it leads nowhere, the file that it names is created. An existing file must be
/// writable and keeps its permissions. A new file gets the permissions that the umask leaves.
pub fn write(path: &Path, bytes: &[u8]) -> Result<(), OutputError> {
    match Destination::at(path)? {
        Destination::Stream => open_stream(path).and_then(|mut stream| stream.write_all(bytes)),
        Destination::File { directory, file } => replace(&directory, &file, |temporary| temporary.write_all(bytes)),
    }
    .map_err(|source| OutputError::Write { path: path.to_owned(), source })
}

/// Writes a file as [`write()`] does, for contents that are too large to encode in memory. `body` writes the file and
/// may seek in it.
pub fn write_with(path: &Path, body: impl FnOnce(&mut File) -> io::Result<()>) -> Result<(), OutputError> {
    match Destination::at(path)? {
        Destination::Stream => write_stream(path, body),
        Destination::File { directory, file } => replace(&directory, &file, body),
    }
    .map_err(|source| OutputError::Write { path: path.to_owned(), source })
}

/// Writes a file as [`write_with`] does, and lets `check` read it before it takes its name. The name of the file that
/// is checked ends as `path` does. If the check fails, nothing is written.
pub fn write_checked<E: From<OutputError>>(
    path: &Path,
    body: impl FnOnce(&mut File) -> io::Result<()>,
    check: impl FnOnce(&Path) -> Result<(), E>,
) -> Result<(), E> {
    let failed = |source| OutputError::Write { path: path.to_owned(), source };
    let Destination::File { directory, file } = Destination::at(path)? else {
        return Err(failed(io::Error::other("it is a device or a pipe, from which it cannot be read again")).into());
    };
    let mut suffix = OsString::from(".");
    suffix.push(path.extension().unwrap_or_default());
    let mut temporary = Temporary::create_named(&directory, &suffix).map_err(failed)?;
    body(temporary.as_file_mut()).map_err(failed)?;
    check(temporary.path())?;
    Ok(settle(temporary, &file).map_err(failed)?)
}

/// Makes a spool: a temporary file for data that will be written to the file at `path`. It is in memory while it is
/// small, then on the same disk as the file. For a device or a pipe, it is then in the system's temporary directory.
pub fn spool(path: &Path) -> Result<SpooledTempFile, OutputError> {
    let directory = match Destination::at(path)? {
        Destination::Stream => std::env::temp_dir(),
        Destination::File { directory, .. } => directory,
    };
    Ok(tempfile::spooled_tempfile_in(SPOOL_IN_MEMORY, directory))
}

fn open_stream(path: &Path) -> io::Result<File> {
    OpenOptions::new().write(true).open(path)
}

/// Writes to a device or a pipe by way of a temporary file, because `body` may seek and a pipe cannot.
fn write_stream(path: &Path, body: impl FnOnce(&mut File) -> io::Result<()>) -> io::Result<()> {
    let mut whole = tempfile::tempfile()?;
    body(&mut whole)?;
    whole.rewind()?;
    io::copy(&mut whole, &mut open_stream(path)?).map(|_: u64| ())
}

/// Lets `body` write a temporary file, which then takes the place of `file`.
fn replace(directory: &Path, file: &Path, body: impl FnOnce(&mut File) -> io::Result<()>) -> io::Result<()> {
    let mut temporary = Temporary::create_in(directory)?;
    body(temporary.as_file_mut())?;
    settle(temporary, file)
}

/// Lets a temporary file take the place of `file`.
fn settle(mut temporary: Temporary, file: &Path) -> io::Result<()> {
    let written = temporary.as_file_mut();
    if let Ok(replaced) = fs::metadata(file) {
        written.set_permissions(replaced.permissions())?;
    }
    // Some file systems report a full disk only here.
    written.sync_all()?;
    temporary.persist(file)
}

/// Returns the pixels without alpha, three values each.
fn rgb<T: Copy>(rgba: &[[T; 4]]) -> Vec<T> {
    rgba.iter().flat_map(|&[r, g, b, _]| [r, g, b]).collect()
}

/// Encodes what a display shows of a picture, with its record as text.
fn encode_png(picture: &Picture, record: Option<&Record>) -> Result<Vec<u8>, png::EncodingError> {
    let mut file = Vec::new();
    let mut encoder = png::Encoder::new(&mut file, picture.width, picture.height);
    encoder.set_color(png::ColorType::Rgb);
    encoder.set_compression(png::Compression::Fast);
    if let Some(record) = record {
        encoder.add_text_chunk("Software".to_owned(), concat!("kdray ", env!("CARGO_PKG_VERSION")).to_owned())?;
        encoder.add_text_chunk(RECORD_ATTRIBUTE.to_owned(), record.json())?;
    }
    let mut writer = encoder.write_header()?;
    writer.write_image_data(&rgb(&picture.display))?;
    writer.finish()?;
    Ok(file)
}

/// Returns the error that a picture does not have as many pixels as its size says.
fn dimension_mismatch() -> ImageError {
    ImageError::Parameter(ParameterError::from_kind(ParameterErrorKind::DimensionMismatch))
}
