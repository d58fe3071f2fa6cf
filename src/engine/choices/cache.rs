//! A cache of earlier runs' measurements: small JSON files in the folder that the system provides for caches.
//!
//! A file that cannot be read or has invalid contents counts as missing. A measurement that cannot be written is not
//! kept.

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
    passes::modules_of,
    world::Instances,
};

/// Environment variable with the path of the cache folder. If its value is empty, nothing is kept.
const FOLDER: &str = "KDRAY_CACHE";
/// Number of bytes of a file that are read at most.
const MOST_BYTES: u64 = 1 << 16;

/// Identifies an entry of the cache by what the measured times depend on. The scene's camera and lights are not part
/// of the key.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Key {
    device: String,
    /// The driver's name and version.
    driver: String,
    /// What was measured: traversals, or primary visibility, with the picture's size and the traversal.
    subject: String,
    /// A hash of the modules of `cast.comp`, the kernel by which traversals are timed. It is also used for measurements
    /// of primary visibility, since their kernels share the traversal code.
    kernel: String,
    /// A hash of the scene's triangles.
    triangles: String,
    /// The build options of the acceleration structure.
    build: String,
}

impl Key {
    /// Returns the key of a measurement of traversals.
    pub fn new(device: &DeviceInfo, triangles: &[Triangle], accel_options: &AccelOptions) -> Self {
        Self {
            device: device.name.clone(),
            driver: device.driver.clone(),
            subject: "traversals".to_owned(),
            kernel: hash(&modules_of("cast").flat_map(|module| module.spirv).copied().collect::<Vec<_>>()),
            triangles: hash(bytemuck::cast_slice(triangles)),
            build: format!("{accel_options:?}"),
        }
    }

    /// Returns the key of a measurement in a world in which the triangles are those of geometries.
    #[must_use]
    pub fn of_instances(self, instances: &Instances) -> Self {
        Self { triangles: self.triangles + &hash(bytemuck::cast_slice(&instances.list)), ..self }
    }

    /// Returns the key of a measurement of primary visibility, in pictures of a size and with a traversal.
    pub fn of_primaries(&self, (width, height): (u32, u32), traversal: Traversal) -> Self {
        Self { subject: format!("primary rays, {width}x{height}, {traversal}"), ..self.clone() }
    }

    fn file_name(&self) -> String {
        format!("{}.json", hash(&serde_json::to_vec(self).expect("plain words")))
    }
}

/// Returns a hash of 16 hexadecimal digits.
fn hash(bytes: &[u8]) -> String {
    let mut hasher = FixedState::with_seed(0).build_hasher();
    hasher.write(bytes);
    format!("{:016x}", hasher.finish())
}

/// The contents of a file. The file's name is a hash of the key, so the whole key is stored to detect collisions.
#[derive(Serialize, Deserialize)]
struct Entry {
    #[serde(flatten)]
    key: Key,
    ns: Timings,
}

/// A folder of measurements.
#[derive(Clone, Debug)]
pub struct Cache {
    /// None if the system has no such folder, or the user disables the cache.
    folder: Option<PathBuf>,
}

impl Cache {
    /// Opens the user's cache: `$KDRAY_CACHE`, or `kdray` in the system's cache folder (`$XDG_CACHE_HOME` or
    /// `~/.cache` on Linux).
    pub fn open() -> Self {
        let folder = match env::var_os(FOLDER) {
            Some(folder) => (!folder.is_empty()).then(|| folder.into()),
            None => dirs::cache_dir().map(|caches| caches.join("kdray")),
        };
        Self { folder }
    }

    /// Uses a given folder, which need not exist yet.
    pub fn at(folder: &Path) -> Self {
        Self { folder: Some(folder.to_owned()) }
    }

    /// Returns the times for a key, if they have been measured. The caller has to check the file's method names and
    /// times by [`Timings::is_sound`].
    pub fn get(&self, key: &Key) -> Option<Timings> {
        let mut bytes = Vec::new();
        let file = File::open(self.folder.as_ref()?.join(key.file_name())).ok()?;
        file.take(MOST_BYTES).read_to_end(&mut bytes).ok()?;
        let entry: Entry = serde_json::from_slice(&bytes).ok()?;
        (entry.key == *key).then_some(entry.ns)
    }

    /// Stores times for a key, in place of earlier ones.
    pub fn put(&self, key: &Key, timings: &Timings) {
        let Some(folder) = &self.folder else { return };
        let entry = Entry { key: key.clone(), ns: timings.clone() };
        if let Err(error) = write(folder, &key.file_name(), &entry) {
            tracing::debug!("{}: not written: {error}", folder.display());
        }
    }
}

/// Writes the whole file or nothing.
fn write(folder: &Path, name: &str, entry: &Entry) -> io::Result<()> {
    fs::create_dir_all(folder)?;
    let mut file = NamedTempFile::new_in(folder)?;
    file.write_all(&serde_json::to_vec_pretty(entry)?)?;
    file.persist(folder.join(name))?;
    Ok(())
}
