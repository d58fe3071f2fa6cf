//! Writes pixels to a file, whole or not at all.
//!
//! A file is encoded in memory, if it fits there, written beside its target under a temporary name, synchronized and
//! renamed. So a full disk leaves what was there before, and no truncated or temporary file. A signal that ends the
//! process leaves none either, if its handler calls [`remove_temporaries`].

use std::{
    error::Error,
    fs::{self, File, OpenOptions},
    io::{self, Cursor, Seek, Write},
    path::{Path, PathBuf},
};

use image::{
    EncodableLayout, ImageBuffer, ImageError, ImageFormat, PixelWithColorType, Primitive, Rgb,
    error::{ParameterError, ParameterErrorKind},
};
use tempfile::SpooledTempFile;
use tracing::info_span;

pub use self::{heat_map::HeatMap, layers::write_layers, target::regular_file, temporary::remove_temporaries};
use self::{target::Target, temporary::Temporary};
use crate::frame::Picture;

mod heat_map;
mod layers;
mod target;
mod temporary;

/// Bytes beyond which a spool goes to disk.
const SPOOL_IN_MEMORY: usize = 64 << 20;

/// Why a file was not written.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum OutputError {
    /// The file's name does not say in which format it is to be written.
    #[error("cannot write `{path}`: a picture's name must end in .png or .exr")]
    UnknownEnding {
        /// The file.
        path: PathBuf,
    },
    /// The file's folder is not there.
    #[error("cannot write `{path}`: `{directory}` is not a directory")]
    NoDirectory {
        /// The file.
        path: PathBuf,
        /// The folder.
        directory: PathBuf,
    },
    /// There is a folder of the file's name.
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

/// What a picture's file holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Format {
    /// 8 bits a channel, sRGB: [`Picture::display`].
    Png,
    /// Linear 32-bit floats, before exposure: [`Picture::radiance`].
    Exr,
}

impl Format {
    /// The format that a file's ending names, in whatever case.
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

/// A file's name without its ending for pictures of a scene, in the working directory.
pub fn stem_of(scene_name: &str) -> String {
    let name = scene_name.replace(|c: char| std::path::is_separator(c) || c.is_control(), "-");
    if name.is_empty() { "picture".to_owned() } else { name }
}

/// Finds out whether a file can be created or replaced at `path`, before minutes are spent on what it shall hold.
pub fn check(path: &Path) -> Result<(), OutputError> {
    match Target::at(path)? {
        Target::Stream => Ok(()),
        Target::File { directory, .. } => Temporary::create_in(&directory)
            .map(drop)
            .map_err(|source| OutputError::Write { path: path.to_owned(), source }),
    }
}

/// Writes a picture in the format that the file's ending names. Both formats hold exactly the picture's RGB values.
pub fn write_picture(path: &Path, picture: &Picture) -> Result<(), OutputError> {
    if Format::of(path)? == Format::Exr {
        return write_layers(path, picture, &[], &[]);
    }
    let bytes = info_span!("encode picture").in_scope(|| encode(picture, rgb(&picture.display), ImageFormat::Png));
    let _writing = info_span!("write picture").entered();
    write(path, &bytes.map_err(|source| OutputError::encode(path, source))?)
}

/// Writes a file whole or not at all. Devices and pipes are written to directly.
///
/// A symbolic link is followed, and a link that leads nowhere gets the file that it names. An existing file must be
/// writable and keeps its permissions; a new one gets those that the umask leaves.
pub fn write(path: &Path, bytes: &[u8]) -> Result<(), OutputError> {
    match Target::at(path)? {
        Target::Stream => open_stream(path).and_then(|mut stream| stream.write_all(bytes)),
        Target::File { directory, file } => replace(&directory, &file, |temporary| temporary.write_all(bytes)),
    }
    .map_err(|source| OutputError::Write { path: path.to_owned(), source })
}

/// As [`write()`], for what is too large to encode in memory: `body` writes the file, and may seek in it.
pub fn write_with(path: &Path, body: impl FnOnce(&mut File) -> io::Result<()>) -> Result<(), OutputError> {
    match Target::at(path)? {
        Target::Stream => write_stream(path, body),
        Target::File { directory, file } => replace(&directory, &file, body),
    }
    .map_err(|source| OutputError::Write { path: path.to_owned(), source })
}

/// A place for what is on its way to the file at `path`: in memory while it is small, then on the same disk.
pub fn spool(path: &Path) -> Result<SpooledTempFile, OutputError> {
    let directory = match Target::at(path)? {
        Target::Stream => std::env::temp_dir(),
        Target::File { directory, .. } => directory,
    };
    Ok(tempfile::spooled_tempfile_in(SPOOL_IN_MEMORY, directory))
}

fn open_stream(path: &Path) -> io::Result<File> {
    OpenOptions::new().write(true).open(path)
}

/// A pipe cannot be sought in: what it gets is put together in a temporary file.
fn write_stream(path: &Path, body: impl FnOnce(&mut File) -> io::Result<()>) -> io::Result<()> {
    let mut whole = tempfile::tempfile()?;
    body(&mut whole)?;
    whole.rewind()?;
    io::copy(&mut whole, &mut open_stream(path)?).map(|_: u64| ())
}

/// Lets `body` write a temporary file, which then takes the place of `file`.
fn replace(directory: &Path, file: &Path, body: impl FnOnce(&mut File) -> io::Result<()>) -> io::Result<()> {
    let mut temporary = Temporary::create_in(directory)?;
    let written = temporary.as_file_mut();
    body(written)?;
    if let Ok(replaced) = fs::metadata(file) {
        written.set_permissions(replaced.permissions())?;
    }
    // Some file systems report a full disk only here.
    written.sync_all()?;
    temporary.persist(file)
}

fn rgb<T: Copy>(rgba: &[[T; 4]]) -> Vec<T> {
    rgba.iter().flat_map(|&[r, g, b, _]| [r, g, b]).collect()
}

/// Encodes a picture's RGB values, three a pixel.
fn encode<T>(picture: &Picture, rgb: Vec<T>, format: ImageFormat) -> Result<Vec<u8>, ImageError>
where
    Rgb<T>: PixelWithColorType<Subpixel = T>,
    [T]: EncodableLayout,
    T: Primitive,
{
    let image =
        ImageBuffer::<Rgb<T>, _>::from_raw(picture.width, picture.height, rgb).ok_or_else(dimension_mismatch)?;
    let mut file = Cursor::new(Vec::new());
    image.write_to(&mut file, format)?;
    Ok(file.into_inner())
}

/// A picture does not have the pixels that its size promises.
fn dimension_mismatch() -> ImageError {
    ImageError::Parameter(ParameterError::from_kind(ParameterErrorKind::DimensionMismatch))
}
