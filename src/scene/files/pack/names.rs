//! Names of packs, and of files in them. A path leads into a pack if a part of it is the path of a pack.

use std::path::{Component, Path, PathBuf};

/// The ending of a pack's name.
pub const ENDING: &str = "kdpack";

/// Returns whether a file's name is that of a pack.
pub fn is_pack_name(path: &Path) -> bool {
    path.extension().is_some_and(|ending| ending.eq_ignore_ascii_case(ENDING))
}

/// Returns the path of the pack that a path leads into, and the rest of the path. `None` if it leads into no pack.
pub fn split(path: &Path) -> Option<(&Path, &Path)> {
    // What is named like a pack in a pack is a file of the outer one.
    let outermost_first: Vec<&Path> = path.ancestors().collect();
    let pack = outermost_first.into_iter().rev().find(|part| is_pack_name(part) && part.is_file())?;
    Some((pack, path.strip_prefix(pack).expect("an ancestor")))
}

/// Returns the path of the pack that a path leads into. `None` if it leads into no pack.
pub fn pack_of(path: &Path) -> Option<&Path> {
    split(path).map(|(pack, _)| pack)
}

/// Returns the path without `.` and `..`, or `None` if it leads above its beginning.
pub fn normalized(path: &Path) -> Option<PathBuf> {
    let mut plain = PathBuf::new();
    for part in path.components() {
        match part {
            Component::CurDir => (),
            Component::ParentDir => {
                let ends_in_name = matches!(plain.components().next_back(), Some(Component::Normal(_)));
                (ends_in_name && plain.pop()).then_some(())?;
            }
            part => plain.push(part),
        }
    }
    Some(plain)
}

/// Returns the name in a pack that a path relative to the pack stands for. `None` if the path leads out of the pack, is
/// absolute or is not UTF-8.
pub fn name_of(path: &Path) -> Option<String> {
    let plain = normalized(path)?;
    let part = |part| match part {
        Component::Normal(name) => name.to_str(),
        _ => None,
    };
    let parts: Option<Vec<&str>> = plain.components().map(part).collect();
    Some(parts?.join("/"))
}
