//! Mesh files: glTF, OBJ, PLY and STL. A file's content says which of them it is; its name counts only if the content
//! does not tell.

use std::path::Path;

use glam::DVec3;

use super::{
    error::SceneError,
    image_files::Images,
    material::Material,
    mesh::Mesh,
    needs::{require_for_bytes, require_for_text},
    obj::parse_obj,
    outside::Access,
    ply::{PlyMesh, ply_mesh},
    read::{lossy_text, read_bytes},
    smooth::Shading,
    stl::{is_binary_stl, is_stl_text, parse_stl},
};
use crate::util::progress::Progress;

/// Format of a mesh file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum MeshFormat {
    Gltf,
    Obj,
    Ply,
    Stl,
}

impl MeshFormat {
    /// Returns the format that the name's ending stands for, if it is a mesh file's.
    pub fn of_name(path: &Path) -> Option<Self> {
        match path.extension()?.to_str()?.to_ascii_lowercase().as_str() {
            "gltf" | "glb" => Some(Self::Gltf),
            "obj" => Some(Self::Obj),
            "ply" => Some(Self::Ply),
            "stl" => Some(Self::Stl),
            _ => None,
        }
    }

    /// Returns the format of a file: by its first bytes or its size, else by its name's ending, else OBJ, which is
    /// text without a magic number.
    pub fn of(path: &Path, bytes: &[u8]) -> Self {
        if bytes.starts_with(b"ply\n") || bytes.starts_with(b"ply\r") {
            Self::Ply
        } else if is_gltf(bytes) {
            Self::Gltf
        } else if is_binary_stl(bytes) || is_stl_text(bytes) {
            Self::Stl
        } else {
            Self::of_name(path).unwrap_or(Self::Obj)
        }
    }
}

/// Returns whether a file is glTF: a GLB file, or a JSON object with the key `asset`.
fn is_gltf(bytes: &[u8]) -> bool {
    const KEY: &[u8] = b"\"asset\"";
    let text = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes).trim_ascii_start();
    bytes.starts_with(b"glTF") || text.starts_with(b"{") && text.windows(KEY.len()).any(|part| part == KEY)
}

/// Reads a mesh file, unless it is too large for the memory.
pub(super) fn read_mesh(path: &Path) -> Result<Vec<u8>, SceneError> {
    let required = match MeshFormat::of_name(path) {
        Some(MeshFormat::Ply | MeshFormat::Gltf) => require_for_bytes(path),
        _ => require_for_text(path),
    };
    required.map_err(|what| SceneError::file(path, what))?;
    read_bytes(path)
}

/// How a mesh file is loaded.
pub(super) struct Loading<'a> {
    pub shading: Shading,
    /// The point of the file that becomes the origin of the mesh. It is subtracted before coordinates are rounded to
    /// single precision.
    pub origin: DVec3,
    /// Number of triangles that the scene has already.
    pub n_loaded: usize,
    /// Which files the mesh file may name.
    pub access: Access,
    /// The images of the scene, to which those of the mesh file are added.
    pub images: &'a mut Images,
}

/// What a mesh file that is not glTF gives.
pub(super) struct Loaded {
    /// The mesh. The slot of a face is an index into `materials`, or `materials.len()` for a face without a material,
    /// or with one that no library defines.
    pub mesh: Mesh,
    pub materials: Vec<Material>,
    /// Whether normals depend on the crease angle.
    pub uses_crease: bool,
}

/// The mesh of a file whose materials are not needed to make it. Several can be made at the same time.
pub(super) enum Shape {
    Ply(PlyMesh),
    Stl(Mesh),
}

impl Shape {
    /// Makes the mesh of a PLY or STL file. `n_loaded`: the number of triangles that the scene has already.
    pub fn parse(
        path: &Path,
        bytes: Vec<u8>,
        place: (Shading, DVec3),
        (n_loaded, progress): (usize, &Progress),
    ) -> Result<Self, SceneError> {
        let made = match MeshFormat::of(path, &bytes) {
            MeshFormat::Ply => ply_mesh(&bytes, place, n_loaded, progress).map(Self::Ply),
            _ => parse_stl(bytes, place, n_loaded).map(Self::Stl),
        };
        made.map_err(|what| SceneError::file(path, what))
    }

    /// Reads the materials.
    pub fn loaded(self, path: &Path, loading: &mut Loading) -> Result<Loaded, SceneError> {
        let loaded = match self {
            Self::Ply(ply) => ply.with_materials(path, loading.access, loading.images),
            Self::Stl(mesh) => Loaded { mesh, materials: Vec::new(), uses_crease: loading.shading.smooth },
        };
        match loaded.mesh.faces.is_empty() {
            true => Err(SceneError::file(path, "has no triangles")),
            false => Ok(loaded),
        }
    }
}

/// Makes a mesh from the content of a file that is not glTF, and reads the materials that it names.
pub(super) fn parse_mesh(path: &Path, bytes: Vec<u8>, loading: &mut Loading) -> Result<Loaded, SceneError> {
    let failed = |what: String| SceneError::file(path, what);
    let place = (loading.shading, loading.origin);
    let loaded = match MeshFormat::of(path, &bytes) {
        MeshFormat::Obj => parse_obj(path, &lossy_text(bytes), loading)?,
        MeshFormat::Gltf => return Err(failed("is glTF, which is a whole scene".to_owned())),
        MeshFormat::Ply | MeshFormat::Stl => {
            let progress = loading.images.progress().clone();
            return Shape::parse(path, bytes, place, (loading.n_loaded, &progress))?.loaded(path, loading);
        }
    };
    if loaded.mesh.faces.is_empty() {
        return Err(SceneError::file(path, "has no triangles"));
    }
    Ok(loaded)
}
