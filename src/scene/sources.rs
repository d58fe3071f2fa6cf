//! The files that a scene is made from.

use std::path::{Path, PathBuf};

use toml::{Table, Value};

use super::{
    gltf, is_scene_file,
    mesh_file::MeshFormat,
    obj::named_libraries,
    read::{lossy_text, read_bytes, read_utf8},
};

/// Returns the sorted paths of the scene file, the mesh files that it names, and the material libraries, buffers and
/// images that the mesh files name. The files need not exist. A file that cannot be read contributes no names.
pub fn source_files(path: &Path) -> Vec<PathBuf> {
    let meshes = if is_scene_file(path) { meshes(path) } else { vec![path.to_owned()] };
    let libraries: Vec<_> = meshes.iter().flat_map(|mesh| libraries(mesh)).collect();
    let mut files = [vec![path.to_owned()], meshes, libraries].concat();
    files.sort();
    files.dedup();
    files
}

fn meshes(scene: &Path) -> Vec<PathBuf> {
    let table: Table = read_utf8(scene).ok().and_then(|text| text.parse().ok()).unwrap_or_default();
    let meshes = table.get("mesh").and_then(Value::as_array).into_iter().flatten();
    let names = meshes.filter_map(|mesh| mesh.get("file").and_then(Value::as_str));
    let folder = scene.parent().unwrap_or(Path::new(""));
    names.map(|name| folder.join(name)).collect()
}

/// Returns the files that a mesh file names.
fn libraries(mesh: &Path) -> Vec<PathBuf> {
    // Content that names no files need not be read.
    if matches!(MeshFormat::of_name(mesh), Some(MeshFormat::Ply | MeshFormat::Stl)) {
        return Vec::new();
    }
    let bytes = read_bytes(mesh).unwrap_or_default();
    match MeshFormat::of(mesh, &bytes) {
        MeshFormat::Gltf => gltf::named_files(mesh, &bytes),
        _ => named_libraries(mesh, &lossy_text(bytes)),
    }
}

#[cfg(test)]
mod tests {
    use std::fs;

    use tempfile::TempDir;

    use super::*;

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
