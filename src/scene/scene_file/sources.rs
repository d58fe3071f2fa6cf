//! The files that a scene is made from.

use std::path::{Path, PathBuf};

use toml::{Table, Value};

use crate::scene::{
    files::{SourceFile, lossy_text, pack::pack_of},
    formats::{
        gltf,
        material_spec::MAP_KEYS,
        mesh_file::{MeshFile, MeshFormat},
        obj::named_files,
        ply::named_images,
    },
    model::LoadOptions,
};

/// Returns the sorted paths of the scene file, the mesh files that it names, the material libraries and buffers that
/// the mesh files name, and the images that any of them names. The files need not exist. A file that cannot be read
/// contributes no names. Names that are refused when the scene is loaded are left out. The only source of a scene in a
/// pack is the pack.
pub fn source_files(path: &Path) -> Vec<PathBuf> {
    source_files_with(path, &LoadOptions::default())
}

/// Returns the files as [`source_files`] does, of a scene that is loaded with options.
pub fn source_files_with(path: &Path, options: &LoadOptions) -> Vec<PathBuf> {
    if let Some(pack) = pack_of(path) {
        return vec![pack.to_owned()];
    }
    let scene = SourceFile::new(path, options);
    let (meshes, others) = if is_scene_file(path) { named(&scene) } else { (vec![scene.clone()], Vec::new()) };
    let libraries: Vec<_> = meshes.iter().flat_map(libraries).collect();
    let files = [vec![scene], meshes, others, libraries].into_iter().flatten();
    let mut files: Vec<PathBuf> = files.map(|file| file.path).collect();
    files.sort();
    files.dedup();
    files
}

/// Returns the meshes that a scene file names, and the other files: images and arrays.
fn named(scene: &SourceFile) -> (Vec<SourceFile>, Vec<SourceFile>) {
    let mut table: Table = scene.text().ok().and_then(|text| text.parse().ok()).unwrap_or_default();
    let (mut meshes, mut others) = (Vec::new(), Vec::new());
    for (is_mesh, name) in names_of_files(&mut table) {
        let list = if is_mesh { &mut meshes } else { &mut others };
        list.extend(scene.exact(name));
    }
    (meshes, others)
}

/// Returns the names of files in the table of a scene file, each with whether the file is that of a mesh.
pub(super) fn names_of_files(table: &mut Table) -> Vec<(bool, &mut String)> {
    let mut names = Vec::new();
    for (key, value) in table.iter_mut() {
        match (key.as_str(), value) {
            ("mesh", Value::Array(meshes)) => {
                let keys = meshes.iter_mut().filter_map(Value::as_table_mut).flatten();
                let files = keys.filter(|(key, _)| ["file", "instances"].contains(&key.as_str()));
                names.extend(files.map(|(key, name)| (key == "file", name)));
            }
            ("environment", Value::Table(environment)) => {
                names.extend(environment.get_mut("file").map(|name| (false, name)));
            }
            ("materials", Value::Table(materials)) => {
                let materials = materials.iter_mut().filter_map(|(_, material)| material.as_table_mut()).flatten();
                let maps = materials.filter(|(key, _)| MAP_KEYS.contains(&key.as_str()));
                names.extend(maps.filter_map(|(_, map)| match map {
                    Value::Table(map) => Some((false, map.get_mut("file")?)),
                    name => Some((false, name)),
                }));
            }
            _ => {}
        }
    }
    let text = |(is_mesh, value)| match value {
        &mut Value::String(ref mut name) => Some((is_mesh, name)),
        _ => None,
    };
    names.into_iter().filter_map(text).collect()
}

/// Returns whether a file's name is that of a scene file in TOML.
pub(crate) fn is_scene_file(path: &Path) -> bool {
    path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("toml"))
}

/// Returns the files that a mesh file names.
fn libraries(file: &SourceFile) -> Vec<SourceFile> {
    // Content that names no files need not be read.
    if MeshFormat::of_name(&file.path) == Some(MeshFormat::Stl) {
        return Vec::new();
    }
    let Ok(mesh) = MeshFile::read(file) else { return Vec::new() };
    match mesh.format {
        MeshFormat::Gltf => gltf::named_files(&mesh),
        MeshFormat::Ply => named_images(file, &mesh.bytes),
        MeshFormat::Stl => Vec::new(),
        MeshFormat::Obj => named_files(file, &lossy_text(mesh.bytes)),
    }
}

#[cfg(test)]
mod tests {
    use std::fs;

    use tempfile::TempDir;

    use super::*;

    /// Old programs write comments in the encoding of their system.
    #[test]
    fn images_of_ply_files_are_named_whatever_the_headers_encoding_is() {
        let directory = TempDir::new().unwrap();
        let path = |name: &str| directory.path().join(name);
        for header in [&b"ply\nformat ascii 1.0\ncomment caf\xe9\n"[..], b"ply\rformat ascii 1.0\r"] {
            let line_end = &header[3..4];
            let lines = [&b"comment TextureFile a.png"[..], b"element vertex 0", b"property float x", b"end_header"];
            let rest = lines.map(|line| [line, line_end].concat()).concat();
            fs::write(path("m.ply"), [header, &rest].concat()).unwrap();
            assert_eq!(source_files(&path("m.ply")), [path("a.png"), path("m.ply")]);
        }
    }

    #[test]
    fn a_scene_names_its_meshes_and_they_their_libraries() {
        let directory = TempDir::new().unwrap();
        let path = |name: &str| directory.path().join(name);
        fs::create_dir(path("parts")).unwrap();
        let scene =
            "[[mesh]]\nfile = \"parts/a.obj\"\n[[mesh]]\nfile = \"none.obj\"\n[[mesh]]\ngenerator = \"plane\"\n";
        fs::write(path("x.toml"), scene).unwrap();
        fs::write(path("parts/a.obj"), "# a\nmtllib a.mtl\nv 0 0 0\n").unwrap();
        let expected = [path("none.obj"), path("parts/a.mtl"), path("parts/a.obj"), path("x.toml")];
        assert_eq!(source_files(&path("x.toml")), expected);
        assert_eq!(source_files(&path("parts/a.obj")), [path("parts/a.mtl"), path("parts/a.obj")]);
        // Statements as the loader reads them: tabs, several names, names with spaces, continued lines, backslashes.
        fs::write(path("parts/with space.mtl"), "").unwrap();
        let obj = "mtllib\tone.mtl two.mtl\nmtllib with space.mtl\nmtllib \\\n deep\\three.mtl\nmtllib ../out.mtl\n";
        fs::write(path("parts/a.obj"), obj).unwrap();
        let names = ["parts/a.obj", "parts/deep/three.mtl", "parts/one.mtl", "parts/two.mtl", "parts/with space.mtl"];
        assert_eq!(source_files(&path("parts/a.obj")), names.map(path));
        fs::write(path("x.toml"), "[[mesh\n").unwrap();
        assert_eq!(source_files(&path("x.toml")), [path("x.toml")]);
    }
}
