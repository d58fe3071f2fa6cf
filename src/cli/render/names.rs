//! The names of the pictures of several scenes.
//!
//! A picture has the name of its scene's file without the ending. Pictures that would have one name get the file's
//! whole name; those that still have one name get folders before it, from the last folder on, until they differ. So the
//! names depend on which scenes there are, and not on their order. Upper and lower case count as equal, as on some file
//! systems.

use std::{
    collections::HashMap,
    path::{self, Component, Path, PathBuf},
};

use kdray::{
    output::{self, Format},
    scene::Scene,
};

use crate::cli::error::CliError;

/// In the name of an output, it stands for the scene's name.
const PLACE: &str = "{}";

/// Returns a name for the picture of each scene, without the ending of its format. No two are equal.
///
/// # Errors
/// Two scenes still have the same name with all of their folders before it.
pub fn picture_names(scenes: &[PathBuf]) -> Result<Vec<String>, CliError> {
    let mut depths = vec![0; scenes.len()];
    loop {
        let names: Vec<String> = scenes.iter().zip(&depths).map(|(scene, depth)| name_at(scene, *depth)).collect();
        let mut groups: HashMap<String, Vec<usize>> = HashMap::new();
        names.iter().enumerate().for_each(|(ix, name)| groups.entry(name.to_lowercase()).or_default().push(ix));
        let equal: Vec<_> = groups.into_values().filter(|group| group.len() > 1).collect();
        if equal.is_empty() {
            return Ok(names);
        }
        for group in &equal {
            let mut scenes_of = group.iter().map(|&ix| (&scenes[ix], depths[ix]));
            if scenes_of.all(|(scene, depth)| name_at(scene, depth + 1) == name_at(scene, depth) && depth > 0) {
                return Err(equal_names(group.iter().map(|&ix| &scenes[ix])));
            }
        }
        equal.iter().flatten().for_each(|&ix| depths[ix] += 1);
    }
}

/// Returns the name of a scene's picture: at depth 0 the file's name without its ending, at depth 1 the whole name, and
/// at depth n with n - 1 folders before it.
fn name_at(scene: &Path, depth: usize) -> String {
    if depth == 0 {
        return output::stem_of(&Scene::name_of(scene));
    }
    let absolute = path::absolute(scene).unwrap_or_else(|_| scene.to_owned());
    let normal =
        |part| if let Component::Normal(name) = part { Some(name.to_string_lossy().into_owned()) } else { None };
    let mut parts: Vec<_> = absolute.components().rev().filter_map(normal).take(depth).collect();
    parts.reverse();
    output::stem_of(&parts.join("-"))
}

fn equal_names<'a>(scenes: impl Iterator<Item = &'a PathBuf>) -> CliError {
    let scenes: Vec<_> = scenes.take(2).map(|scene| format!("`{}`", scene.display())).collect();
    CliError::Usage(format!("the pictures of {} would have the same name", scenes.join(" and ")))
}

/// Returns the pattern of the pictures' files if an output can name several: a folder, or a name with `{}`. Pictures in
/// a folder are named `in_folder`. A folder with the name of a picture needs a separator behind it.
pub fn pattern_of(output: &Path, in_folder: &str) -> Option<PathBuf> {
    let ends_as_folder = output.to_string_lossy().ends_with(path::is_separator);
    if ends_as_folder || output.is_dir() && Format::of(output).is_err() {
        return Some(output.join(in_folder));
    }
    output.file_name()?.to_str()?.contains(PLACE).then(|| output.to_owned())
}

/// Returns the pattern with a scene's name.
pub fn named(pattern: &Path, name: &str) -> PathBuf {
    let file = pattern.file_name().map(|file| file.to_string_lossy().replace(PLACE, name)).unwrap_or_default();
    pattern.with_file_name(file)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(scenes: &[&str]) -> Vec<String> {
        picture_names(&scenes.iter().map(PathBuf::from).collect::<Vec<_>>()).unwrap()
    }

    #[test]
    fn equal_names_are_told_apart_in_any_order() {
        assert_eq!(names(&["/a/x.glb", "/b/y.glb"]), ["x", "y"]);
        assert_eq!(names(&["/a/x.glb", "/b/x.glb", "/b/y.glb"]), ["a-x.glb", "b-x.glb", "y"]);
        assert_eq!(names(&["/b/x.glb", "/b/y.glb", "/a/x.glb"]), ["b-x.glb", "y", "a-x.glb"]);
        assert_eq!(names(&["/a/x.glb", "/a/X.obj"]), ["x.glb", "X.obj"]);
        assert_eq!(names(&["/a/c/x.glb", "/b/c/x.glb", "/c/x.glb"]), ["a-c-x.glb", "b-c-x.glb", "c-x.glb"]);
        // The picture of one scene would get the longer name of another one.
        assert_eq!(names(&["/a/x.glb", "/b/x.glb", "/b/a-x.glb.obj"]), ["a-x.glb", "b-x.glb", "a-x.glb.obj"]);
        assert_eq!(names(&["x/..glb", "/"]), [".", "picture"]);
    }

    #[test]
    fn names_that_stay_equal_are_refused() {
        let scenes = ["/a/x.glb", "/a-x.glb", "/b/x.glb"].map(PathBuf::from);
        assert_eq!(picture_names(&scenes).unwrap(), ["a-x.glb", "a-x", "b-x.glb"]);
        let scenes = ["/r/a-x.glb", "/r-a/x.glb", "/s/a-x.glb", "/s/x.glb"].map(PathBuf::from);
        let error = picture_names(&scenes).unwrap_err().to_string();
        assert!(error.contains("`/r/a-x.glb` and `/r-a/x.glb` would have the same name"), "{error}");
    }

    #[test]
    fn outputs_of_several_pictures() {
        let folder = tempfile::tempdir().unwrap();
        let file = |output: &Path| pattern_of(output, "{}.png").map(|pattern| named(&pattern, "x"));
        assert_eq!(file(folder.path()), Some(folder.path().join("x.png")));
        assert_eq!(file(Path::new("out/")), Some("out/x.png".into()));
        assert_eq!(file(Path::new("out/{}-small.exr")), Some("out/x-small.exr".into()));
        assert_eq!(file(Path::new("out.png")), None);
    }
}
