//! Mesh files: glTF, OBJ, PLY and STL. A file's content says which of them it is; its name counts only if the content
//! does not tell.

use std::path::Path;

use glam::DVec3;

use super::{
    image_files::Images,
    obj::{ObjFile, obj_mesh, read_obj},
    ply::{PlyMesh, ply_mesh},
    scan_colours,
    stl::{is_binary_stl, is_stl_text, parse_stl},
};
use crate::{
    scene::{
        files::{
            foreign,
            source_file::Access,
            store::{require_for_bytes, require_for_text},
            text::{lossy_text, read_bytes},
        },
        meshes::{coincident, smooth::Shading},
        model::{Material, Mesh, SceneError, extent::MeshOrigin},
    },
    util::progress::Progress,
};

/// Format of a mesh file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum MeshFormat {
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
        if is_gltf(bytes) {
            Self::Gltf
        } else if is_certain(bytes) {
            Self::Ply
        } else if is_binary_stl(bytes) || is_stl_text(bytes) {
            Self::Stl
        } else {
            Self::of_name(path).unwrap_or(Self::Obj)
        }
    }
}

/// Returns whether a file's first bytes are those of a GLB or a PLY file, whatever its name is: avatars in `.vrm`
/// files, for example, are GLB.
pub(crate) fn is_certain(head: &[u8]) -> bool {
    let text = head.strip_prefix(b"\xef\xbb\xbf").unwrap_or(head);
    head.starts_with(b"glTF") || [b"ply\n", b"ply\r"].iter().any(|first| text.starts_with(*first))
}

/// Returns whether a file is glTF: a GLB file, or a JSON object with the key `asset`.
fn is_gltf(bytes: &[u8]) -> bool {
    const KEY: &[u8] = b"\"asset\"";
    let text = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes).trim_ascii_start();
    bytes.starts_with(b"glTF") || text.starts_with(b"{") && text.windows(KEY.len()).any(|part| part == KEY)
}

/// Reads a mesh file, unless it is too large for the memory.
pub(crate) fn read_mesh(path: &Path) -> Result<Vec<u8>, SceneError> {
    let required = match MeshFormat::of_name(path) {
        Some(MeshFormat::Ply | MeshFormat::Gltf) => require_for_bytes(path),
        _ => require_for_text(path),
    };
    required.map_err(|what| SceneError::file(path, what))?;
    let bytes = read_bytes(path)?;
    match foreign::what_it_is(&bytes) {
        Some(what) => Err(SceneError::file(path, what)),
        None => Ok(bytes),
    }
}

/// How a mesh file is loaded.
pub(crate) struct Loading<'a> {
    pub shading: Shading,
    /// The point of the file that becomes the origin of the mesh. It is subtracted before coordinates are rounded to
    /// single precision.
    pub origin: MeshOrigin,
    /// Number of triangles that the scene has already.
    pub n_loaded: usize,
    /// Which files the mesh file may name.
    pub access: Access,
    /// The images of the scene, to which those of the mesh file are added.
    pub images: &'a mut Images,
}

/// What a mesh file that is not glTF gives.
pub(crate) struct Loaded {
    /// The mesh. The slot of a face is an index into `materials`, or `materials.len()` for a face without a material,
    /// or with one that no library defines.
    pub mesh: Mesh,
    /// The point of the file that is the origin of the mesh.
    pub origin: DVec3,
    pub materials: Vec<Material>,
    /// Whether normals depend on the crease angle.
    pub uses_crease: bool,
}

/// The content of a file that is not glTF, as far as it needs no other files. Several can be read at the same time.
pub(crate) struct Shape {
    kind: ShapeKind,
    /// The point of the file that is the origin of a PLY or STL file's mesh.
    origin: DVec3,
}

enum ShapeKind {
    Obj(ObjFile),
    Ply(PlyMesh),
    /// The mesh, and what is to be warned of.
    Stl(Mesh, Option<String>),
}

impl Shape {
    /// Reads a file's content. `n_loaded`: the number of triangles that the scene has already.
    pub fn parse(
        path: &Path,
        bytes: Vec<u8>,
        (shading, origin): (Shading, MeshOrigin),
        (n_loaded, progress): (usize, &Progress),
    ) -> Result<Self, SceneError> {
        let format = MeshFormat::of(path, &bytes);
        match format {
            MeshFormat::Gltf => return Err(SceneError::file(path, "is glTF, which is a whole scene")),
            MeshFormat::Obj => {
                let file = read_obj(path, lossy_text(bytes), origin, progress)?;
                return Ok(Self { kind: ShapeKind::Obj(file), origin: origin.first() });
            }
            MeshFormat::Ply | MeshFormat::Stl => {}
        }
        let parse = |bytes: Vec<u8>, origin: DVec3| {
            let made = match format {
                MeshFormat::Ply => ply_mesh(&bytes, (shading, origin), n_loaded, progress).map(ShapeKind::Ply),
                _ => {
                    let made = parse_stl(bytes, (shading, origin), (n_loaded, progress));
                    made.map(|(mesh, warning)| ShapeKind::Stl(mesh, warning))
                }
            };
            made.map(|kind| Self { kind, origin }).map_err(|what| SceneError::file(path, what))
        };
        let made = parse(bytes, origin.first())?;
        let mesh = match &made.kind {
            ShapeKind::Ply(ply) => ply.mesh(),
            ShapeKind::Stl(mesh, _) => mesh,
            ShapeKind::Obj(_) => return Ok(made),
        };
        match origin.second(&mesh.positions) {
            Some(nearer) => parse(read_mesh(path)?, nearer),
            None => Ok(made),
        }
    }

    /// Reads the materials, and makes the mesh if that has not been done.
    pub fn loaded(self, path: &Path, loading: &mut Loading) -> Result<Loaded, SceneError> {
        let Self { kind, origin } = self;
        let n_points = match &kind {
            ShapeKind::Obj(file) => file.n_points(),
            ShapeKind::Ply(ply) => ply.mesh().positions.len(),
            ShapeKind::Stl(mesh, _) => mesh.positions.len(),
        };
        // An OBJ file's polygons are separated before they are cut into triangles.
        let is_obj = matches!(kind, ShapeKind::Obj(_));
        let mut loaded = match kind {
            ShapeKind::Obj(file) => obj_mesh(path, file, loading)?,
            ShapeKind::Ply(ply) => Loaded { origin, ..ply.with_materials(path, loading.access, loading.images) },
            ShapeKind::Stl(mesh, warning) => {
                warning.iter().for_each(|warning| tracing::warn!("{}: {warning}", path.display()));
                Loaded { mesh, origin, materials: Vec::new(), uses_crease: loading.shading.smooth }
            }
        };
        scan_colours::leave_out(path, &mut loaded, loading.images);
        if !is_obj {
            coincident::separate(&mut loaded.mesh);
        }
        match (loaded.mesh.faces.is_empty(), n_points) {
            (false, _) => Ok(loaded),
            (true, 0) => Err(SceneError::file(path, "has no triangles")),
            (true, n) => Err(SceneError::file(
                path,
                format!("has {n} points but no triangles: clouds of points, lines and curves are not shown"),
            )),
        }
    }
}

/// Makes a mesh from the content of a file that is not glTF, and reads the materials that it names.
pub(crate) fn parse_mesh(path: &Path, bytes: Vec<u8>, loading: &mut Loading) -> Result<Loaded, SceneError> {
    let progress = loading.images.progress().clone();
    let place = (loading.shading, loading.origin);
    Shape::parse(path, bytes, place, (loading.n_loaded, &progress))?.loaded(path, loading)
}
