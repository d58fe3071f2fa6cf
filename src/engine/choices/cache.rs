//! What was measured in earlier runs, a small JSON file each, in the folder that the system has for such things.
//!
//! A file that cannot be read, or does not hold what it should, counts as none; one that cannot be written is left out.

use std::{
    env,
    fs::{self, File},
    hash::{BuildHasher, Hasher},
    io::{self, Read, Write},
    path::{Path, PathBuf},
};

use foldhash::quality::FixedState;
use serde::{Deserialize, Serialize};
use tempfile::NamedTempFile;

use super::Timings;
use crate::{
    accel::{AccelOptions, kdtree::Traversal},
    gpu::DeviceInfo,
    layout::Triangle,
    passes::spirv,
};

/// The environment variable that names another folder, or if it is empty, none.
const FOLDER: &str = "KDRAY_CACHE";
/// Bytes of the longest file that is read.
const MOST_BYTES: u64 = 1 << 16;

/// What a measurement depends on.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Key {
    device: String,
    /// The driver's name and version.
    driver: String,
    /// What was tried.
    subject: String,
    /// A hash of a kernel that was timed.
    kernel: String,
    /// A hash of the scene's triangles.
    triangles: String,
    /// The tree's build options.
    build: String,
}

impl Key {
    /// The key of traversals.
    pub fn new(device: &DeviceInfo, triangles: &[Triangle], accel_options: &AccelOptions) -> Self {
        Self {
            device: device.name.clone(),
            driver: device.driver.clone(),
            subject: "traversals".to_owned(),
            kernel: hash(spirv!("cast.comp").spirv),
            triangles: hash(bytemuck::cast_slice(triangles)),
            build: format!("{accel_options:?}"),
        }
    }

    /// The key of primary visibility in pictures of a size, beside a traversal.
    pub fn of_primaries(&self, (width, height): (u32, u32), traversal: Traversal) -> Self {
        Self { subject: format!("primary rays, {width}x{height}, {traversal}"), ..self.clone() }
    }

    fn file_name(&self) -> String {
        format!("{}.json", hash(&serde_json::to_vec(self).expect("plain words")))
    }
}

/// 16 hexadecimal digits.
fn hash(bytes: &[u8]) -> String {
    let mut hasher = FixedState::with_seed(0).build_hasher();
    hasher.write(bytes);
    format!("{:016x}", hasher.finish())
}

/// A file's contents. The key tells entries apart whose names are the same by chance.
#[derive(Serialize, Deserialize)]
struct Entry {
    #[serde(flatten)]
    key: Key,
    ns: Timings,
}

/// A folder of measurements.
#[derive(Clone, Debug)]
pub struct Cache {
    /// None where the system has no such folder, or the user wants none.
    folder: Option<PathBuf>,
}

impl Cache {
    /// The user's: `$KDRAY_CACHE`, or `kdray` in the system's cache folder (`$XDG_CACHE_HOME` or `~/.cache` on Linux).
    pub fn open() -> Self {
        let folder = match env::var_os(FOLDER) {
            Some(folder) => (!folder.is_empty()).then(|| folder.into()),
            None => dirs::cache_dir().map(|caches| caches.join("kdray")),
        };
        Self { folder }
    }

    /// In a certain folder, which need not be there yet.
    pub fn at(folder: &Path) -> Self {
        Self { folder: Some(folder.to_owned()) }
    }

    /// What was measured, if it was. The words and times are whatever the file says.
    pub fn get(&self, key: &Key) -> Option<Timings> {
        let mut bytes = Vec::new();
        let file = File::open(self.folder.as_ref()?.join(key.file_name())).ok()?;
        file.take(MOST_BYTES).read_to_end(&mut bytes).ok()?;
        let entry: Entry = serde_json::from_slice(&bytes).ok()?;
        (entry.key == *key).then_some(entry.ns)
    }

    /// Keeps what was measured, in place of what was there.
    pub fn put(&self, key: &Key, timings: &Timings) {
        let Some(folder) = &self.folder else { return };
        let entry = Entry { key: key.clone(), ns: timings.clone() };
        if let Err(error) = write(folder, &key.file_name(), &entry) {
            tracing::debug!("{}: not written: {error}", folder.display());
        }
    }
}

/// Whole or not at all.
fn write(folder: &Path, name: &str, entry: &Entry) -> io::Result<()> {
    fs::create_dir_all(folder)?;
    let mut file = NamedTempFile::new_in(folder)?;
    file.write_all(&serde_json::to_vec_pretty(entry)?)?;
    file.persist(folder.join(name))?;
    Ok(())
}
