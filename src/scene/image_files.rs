//! Files that the files of a scene name, found below a folder, and the images among them.

use std::{
    collections::HashMap,
    fs,
    path::{Component, Path, PathBuf},
};

use super::{
    error::Checked,
    image::{Encoded, decode_all, normals_of_heights},
    needs::require_for_bytes,
    read::read_bytes,
    texture::{Channel, Image, Pixels},
};

/// A file that another one names.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct NamedFile {
    /// Its path, whether it exists or not.
    pub path: PathBuf,
    /// Whether its name on disk differs from the stated one in the case of letters.
    pub is_other_case: bool,
}

/// Returns the file of a name that is relative to `folder`. It must lie in or below the folder `root`, links resolved.
/// Backslashes count as separators, as in files from Windows. Where no file has the name, the only one whose name
/// differs in the case of letters is taken.
pub(super) fn named_file(root: &Path, folder: &Path, name: &str) -> Checked<NamedFile> {
    let leaves = || format!("`{name}` leaves the folder of the scene's file: it is not read");
    let name = name.replace('\\', "/");
    if name.starts_with('/') || name.chars().nth(1) == Some(':') {
        return Err(leaves());
    }
    let mut found = NamedFile { path: folder.to_owned(), is_other_case: false };
    for part in name.split('/').filter(|part| !matches!(*part, "" | ".")) {
        if part == ".." {
            let ends_in_name = matches!(found.path.components().next_back(), Some(Component::Normal(_)));
            if !ends_in_name || !found.path.pop() || !found.path.starts_with(root) {
                return Err(leaves());
            }
            continue;
        }
        let exact = found.path.join(part);
        match exact.exists() {
            true => found.path = exact,
            false => match only_other_case(&found.path, part) {
                Some(other) => found = NamedFile { path: other, is_other_case: true },
                None => found.path = exact,
            },
        }
    }
    // A file that does not exist has no links to resolve.
    let canonical = |path: &Path| fs::canonicalize(if path.as_os_str().is_empty() { Path::new(".") } else { path });
    match (canonical(root), canonical(&found.path)) {
        (Ok(root), Ok(path)) if !path.starts_with(&root) => Err(leaves()),
        _ => Ok(found),
    }
}

/// Returns the only entry of a folder whose name differs from `name` in the case of letters alone.
fn only_other_case(folder: &Path, name: &str) -> Option<PathBuf> {
    let folder_or_here = if folder.as_os_str().is_empty() { Path::new(".") } else { folder };
    let lower = name.to_lowercase();
    let names = fs::read_dir(folder_or_here).ok()?.flatten().map(|entry| entry.file_name());
    let mut same = names.filter(|entry| entry.to_str().is_some_and(|entry| entry.to_lowercase() == lower));
    match (same.next(), same.next()) {
        (Some(only), None) => Some(folder.join(only)),
        _ => None,
    }
}

/// Image files, each of which is read once.
#[derive(Debug, Default)]
pub(super) struct ImageFiles {
    paths: Vec<PathBuf>,
    by_path: HashMap<PathBuf, usize>,
}

impl ImageFiles {
    /// Returns the index of a file.
    pub fn add(&mut self, path: PathBuf) -> usize {
        *self.by_path.entry(path).or_insert_with_key(|path| {
            self.paths.push(path.clone());
            self.paths.len() - 1
        })
    }

    /// Reads and decodes all files. An error is a message that names the file.
    pub fn decode(self) -> Vec<Checked<Image>> {
        let read = |path: &PathBuf| {
            require_for_bytes(path).map_err(|what| format!("{}: {what}", path.display()))?;
            let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
            let bytes = read_bytes(path).map_err(|error| error.to_string())?;
            Ok(Encoded { name, bytes })
        };
        let mut encoded = Vec::new();
        let read: Vec<Checked<()>> = self.paths.iter().map(|path| read(path).map(|file| encoded.push(file))).collect();
        let mut decoded = decode_all(encoded).into_iter();
        let mut next = || decoded.next().expect("each image is decoded or refused");
        let named = |(read, path): (Checked<()>, &PathBuf)| {
            read.and_then(|()| next().map_err(|what| format!("{}: {what}", path.display())))
        };
        read.into_iter().zip(&self.paths).map(named).collect()
    }
}

/// What a texture shows of an image file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum View {
    /// The image itself.
    Plain,
    /// The normal map of the heights in a channel. The bits of the heights' factor follow.
    Heights(Channel, u32),
    /// 1 - x for each colour x.
    Inverted,
}

/// Decoded images, and those of them that textures show.
pub(super) struct Images {
    decoded: Vec<Option<Image>>,
    shown: Vec<(usize, View)>,
}

impl Images {
    /// The indices of `decoded` are those of the files. None: the file has no image.
    pub fn new(decoded: Vec<Option<Image>>) -> Self {
        Self { decoded, shown: Vec::new() }
    }

    /// Returns the image of a file.
    pub fn get(&self, file: usize) -> Option<&Image> {
        self.decoded.get(file)?.as_ref()
    }

    /// Returns the index, among the shown images, of a view of a file that has an image.
    pub fn show(&mut self, file: usize, view: View) -> u32 {
        let found = self.shown.iter().position(|shown| *shown == (file, view));
        found.unwrap_or_else(|| {
            self.shown.push((file, view));
            self.shown.len() - 1
        }) as u32
    }

    /// Returns the shown images.
    pub fn finish(mut self) -> Vec<Image> {
        let made = |(file, view): &(usize, View)| {
            let image = self.decoded[*file].as_ref().expect("only images are shown");
            match view {
                View::Plain => None,
                View::Heights(channel, scale) => Some(normals_of_heights(image, *channel, f32::from_bits(*scale))),
                View::Inverted => Some(inverted(image)),
            }
        };
        let made: Vec<Option<Image>> = self.shown.iter().map(made).collect();
        let mut plain = |file: usize| self.decoded[file].take().expect("each plain view is shown once");
        made.into_iter().zip(&self.shown).map(|(image, (file, _))| image.unwrap_or_else(|| plain(*file))).collect()
    }
}

/// Returns the channel that holds the opacity of an image: alpha if it has any, else luminance.
pub(super) fn opacity_channel(image: &Image) -> Channel {
    const ONE: u16 = 0x3c00; // 1 as a half
    let has_alpha = match &image.pixels {
        Pixels::Bytes(pixels) => pixels.iter().any(|pixel| pixel[3] != 255),
        Pixels::Halves(pixels) => pixels.iter().any(|pixel| pixel[3] != ONE),
    };
    if has_alpha { Channel::Alpha } else { Channel::Luminance }
}

/// Returns the image with 1 - x in place of each number x, opacity included.
fn inverted(image: &Image) -> Image {
    let half = |bits: u16| half::f16::from_f32(1.0 - half::f16::from_bits(bits).to_f32()).to_bits();
    let pixels = match &image.pixels {
        Pixels::Bytes(pixels) => {
            Pixels::Bytes(pixels.iter().map(|[r, g, b, a]| [255 - r, 255 - g, 255 - b, 255 - a]).collect())
        }
        Pixels::Halves(pixels) => {
            Pixels::Halves(pixels.iter().map(|[r, g, b, a]| [half(*r), half(*g), half(*b), half(*a)]).collect())
        }
    };
    Image { pixels, ..image.clone() }
}

#[cfg(test)]
mod tests {
    use tempfile::TempDir;

    use super::*;

    #[test]
    fn names_are_found_below_the_folder() {
        let directory = TempDir::new().unwrap();
        let root = directory.path().join("scene");
        fs::create_dir_all(root.join("Maps")).unwrap();
        fs::create_dir_all(root.join("mtl")).unwrap();
        fs::write(root.join("Maps/a b.PNG"), "").unwrap();
        fs::write(directory.path().join("secret.png"), "").unwrap();
        let find = |folder: &str, name: &str| named_file(&root, &root.join(folder), name);
        let path = |name: &str, is_other_case| Ok(NamedFile { path: root.join(name), is_other_case });
        assert_eq!(find("", "Maps/a b.PNG"), path("Maps/a b.PNG", false));
        assert_eq!(find("", "maps\\A B.png"), path("Maps/a b.PNG", true));
        assert_eq!(find("mtl", "..\\.\\Maps/a b.PNG"), path("Maps/a b.PNG", false));
        assert_eq!(find("mtl", "none.png"), path("mtl/none.png", false));
        fs::write(root.join("Maps/A B.png"), "").unwrap();
        assert_eq!(find("", "Maps/a b.png"), path("Maps/a b.png", false), "two names differ in case");
        for name in ["../secret.png", "mtl/../../secret.png", "/secret.png", "\\secret.png", "c:\\secret.png"] {
            assert!(find("", name).unwrap_err().contains("leaves the folder"), "{name}");
        }
        #[cfg(unix)]
        {
            std::os::unix::fs::symlink(directory.path().join("secret.png"), root.join("link.png")).unwrap();
            assert!(find("", "link.png").unwrap_err().contains("leaves the folder"));
        }
    }
}
