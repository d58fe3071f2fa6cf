//! Files that OBJ and MTL files name.

use std::path::Path;

use super::{
    maps::{MapKind, MapOptions},
    statement::{split_keyword, statements, without_comment},
    udim::files_of_map,
};
use crate::scene::{files::SourceFile, model::error::Checked};

/// Returns the files that the `mtllib` statements of an OBJ file's text name, and the images that these name. Names
/// that are refused are left out.
pub fn named_files(obj: &SourceFile, text: &str) -> Vec<SourceFile> {
    let mut files = Vec::new();
    for (_, statement) in statements(text) {
        if let ("mtllib", rest) = split_keyword(&statement) {
            files.extend(library_files(obj, rest).into_iter().flatten());
        }
    }
    if !files.iter().any(SourceFile::is_file) {
        files.extend(own_library(obj));
    }
    let images: Vec<SourceFile> = files.iter().flat_map(|mtl| named_images(obj, mtl)).collect();
    files.into_iter().chain(images).collect()
}

/// Returns the images that an MTL file names.
fn named_images(obj: &SourceFile, mtl: &SourceFile) -> Vec<SourceFile> {
    let text = mtl.lossy_text().unwrap_or_default();
    let folder = mtl.folder();
    let files = |statement: &str| match split_keyword(statement) {
        (keyword, rest) if matches!(MapKind::of(keyword), MapKind::Shown(_)) => {
            let files = MapOptions::new(rest).and_then(|options| files_of_map(obj, folder, &options.name));
            files.unwrap_or_default().into_iter().map(|(_, file)| file).collect()
        }
        _ => Vec::new(),
    };
    statements(&text).flat_map(|(_, statement)| files(&statement)).collect()
}

/// Returns the files that a `mtllib` line names. The rest of the line is one name with spaces, if [`find_file`] finds
/// such a file; otherwise it is a list of names.
pub fn library_files(obj: &SourceFile, rest: &str) -> Vec<Checked<SourceFile>> {
    let find = |name: &str| find_file(obj, obj.folder(), name.trim_matches('"'));
    let whole = find(rest);
    let has_spaces = |file: &SourceFile| file.path.file_name().is_some_and(|name| name.to_string_lossy().contains(' '));
    if exists(&whole) && whole.as_ref().is_ok_and(has_spaces) {
        return vec![whole];
    }
    without_comment(rest).split_whitespace().map(find).collect()
}

/// Returns the MTL file of the OBJ file's own name, which counts where no library is found that the OBJ file names.
pub fn own_library(obj: &SourceFile) -> Option<SourceFile> {
    let name = obj.path.with_extension("mtl").file_name()?.to_str()?.to_owned();
    obj.find(obj.folder(), &name).ok().filter(SourceFile::is_file)
}

/// Returns the file that a name in an OBJ or MTL file stands for. Writers often state absolute names of their own
/// machine: where a name leaves the folder of the OBJ file, the file is taken whose name in `folder` has the most last
/// parts in common with it. A comment may follow the name.
pub fn find_file(obj: &SourceFile, folder: &Path, name: &str) -> Checked<SourceFile> {
    let whole = obj.find(folder, name);
    if exists(&whole) {
        return whole;
    }
    let name = without_comment(name).trim_end_matches('"');
    let (named, confined) = (obj.find(folder, name), obj.confined());
    if exists(&named) || confined.find(folder, name).is_ok() {
        return named;
    }
    let ends = name.match_indices(['/', '\\']).map(|(at, _)| &name[at + 1..]).filter(|end| !end.is_empty());
    ends.map(|end| confined.find(folder, end)).find(exists).unwrap_or(named)
}

fn exists(file: &Checked<SourceFile>) -> bool {
    file.as_ref().is_ok_and(SourceFile::is_file)
}
