//! The scenes that `kdray render` draws: those of the command line, then those of a list.

use std::{
    collections::HashSet,
    fs,
    io::{self, Read},
    path::{self, Path, PathBuf},
};

use crate::cli::{args::RenderArgs, error::CliError};

/// The name of a list that stands for standard input.
const STDIN: &str = "-";

/// Returns the scenes in the order in which they are drawn.
pub fn scenes(args: &RenderArgs) -> Result<Vec<PathBuf>, CliError> {
    let mut scenes = args.scenes.clone();
    if let Some(list) = &args.list {
        let bytes = read(list).map_err(|source| CliError::List { path: list.clone(), source })?;
        scenes.extend(entries(&bytes));
    }
    Ok(scenes)
}

/// Removes scenes that were named before, however they are spelled relative to the working directory. Returns their
/// number.
pub fn remove_repeated(scenes: &mut Vec<PathBuf>) -> usize {
    let (n_all, mut known) = (scenes.len(), HashSet::new());
    scenes.retain(|scene| known.insert(path::absolute(scene).unwrap_or_else(|_| scene.clone())));
    n_all - scenes.len()
}

fn read(list: &Path) -> io::Result<Vec<u8>> {
    if list != Path::new(STDIN) {
        return fs::read(list);
    }
    let mut bytes = Vec::new();
    io::stdin().lock().read_to_end(&mut bytes)?;
    Ok(bytes)
}

/// Returns the paths of a list, one a line, without blank lines and lines that begin with `#`.
fn entries(bytes: &[u8]) -> impl Iterator<Item = PathBuf> {
    let lines = bytes.split(|&byte| byte == b'\n').map(|line| line.strip_suffix(b"\r").unwrap_or(line));
    lines.filter(|line| !line.trim_ascii().is_empty() && !line.starts_with(b"#")).map(path_of)
}

/// Names of files need not be UTF-8.
#[cfg(unix)]
fn path_of(line: &[u8]) -> PathBuf {
    use std::{ffi::OsStr, os::unix::ffi::OsStrExt};
    OsStr::from_bytes(line).into()
}

#[cfg(not(unix))]
fn path_of(line: &[u8]) -> PathBuf {
    String::from_utf8_lossy(line).into_owned().into()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_list_has_one_path_a_line() {
        let found: Vec<_> = entries(b"# parts\na/x.glb\r\n\n  \n b #1.obj\n#c.obj\nlast").collect();
        assert_eq!(found, ["a/x.glb", " b #1.obj", "last"].map(PathBuf::from));
        assert_eq!(entries(b"").count(), 0);
    }

    #[test]
    fn a_scene_is_drawn_once() {
        let mut scenes = ["a/x.glb", "b/x.glb", "./a/x.glb", "a//x.glb"].map(PathBuf::from).to_vec();
        assert_eq!(remove_repeated(&mut scenes), 2);
        assert_eq!(scenes, ["a/x.glb", "b/x.glb"].map(PathBuf::from));
    }
}
