//! Mesh files: glTF, OBJ, PLY and STL. A file's content says which of them it is; its name counts only if the content
//! does not tell.

use std::path::Path;

use glam::{DVec3, Vec3};

use super::{
    image_cache::Images,
    obj::{ObjFile, obj_mesh, read_obj},
    ply::{PlyMesh, ply_mesh},
    scan_colours,
    stl::{is_binary_stl, is_stl_text, parse_stl},
};
use crate::{
    scene::{
        files::{SourceFile, lossy_text, without_bom},
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
    fn of(path: &Path, bytes: &[u8]) -> Self {
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
    [&b"glTF"[..], b"ply\n", b"ply\r"].iter().any(|first| head.starts_with(first))
}

/// Returns whether a file is glTF: a GLB file, or a JSON object with the key `asset`.
fn is_gltf(bytes: &[u8]) -> bool {
    const KEY: &[u8] = b"\"asset\"";
    let text = bytes.trim_ascii_start();
    bytes.starts_with(b"glTF") || text.starts_with(b"{") && text.windows(KEY.len()).any(|part| part == KEY)
}

/// The content of a mesh file.
pub(crate) struct MeshFile {
    pub source: SourceFile,
    pub format: MeshFormat,
    /// Without a byte order mark.
    pub bytes: Vec<u8>,
}

impl MeshFile {
    /// Takes the content of a file, which is read here.
    pub fn read(source: &SourceFile) -> Result<Self, SceneError> {
        let is_text = !matches!(MeshFormat::of_name(&source.path), Some(MeshFormat::Ply | MeshFormat::Gltf));
        let bytes = source.scene_bytes(is_text)?;
        // The comment of a binary STL file may begin with anything.
        let bytes = if is_binary_stl(&bytes) { bytes } else { without_bom(bytes) };
        Ok(Self { source: source.clone(), format: MeshFormat::of(&source.path, &bytes), bytes })
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
    file: SourceFile,
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

impl ShapeKind {
    fn points(&self) -> &[Vec3] {
        match self {
            Self::Obj(content) => content.elements.points(),
            Self::Ply(ply) => &ply.mesh.positions,
            Self::Stl(mesh, _) => &mesh.positions,
        }
    }
}

impl Shape {
    /// Reads a file's content. `n_loaded`: the number of triangles that the scene has already.
    pub fn parse(
        MeshFile { source: file, format, bytes }: MeshFile,
        (shading, origin): (Shading, MeshOrigin),
        (n_loaded, progress): (usize, &Progress),
    ) -> Result<Self, SceneError> {
        match format {
            MeshFormat::Gltf => return Err(file.error("is glTF, which is a whole scene")),
            MeshFormat::Obj => {
                let content = read_obj(&file.path, lossy_text(bytes), origin, progress)?;
                return Ok(Self { file, kind: ShapeKind::Obj(content), origin: origin.first() });
            }
            MeshFormat::Ply | MeshFormat::Stl => {}
        }
        let parse = |origin: DVec3| {
            let how = (shading, origin);
            let kind = match format {
                MeshFormat::Ply => ply_mesh(&bytes, how, n_loaded, progress).map(ShapeKind::Ply),
                _ => parse_stl(&bytes, how, (n_loaded, progress)).map(|(mesh, what)| ShapeKind::Stl(mesh, what)),
            };
            Ok((origin, kind.map_err(|what| file.error(what))?))
        };
        let first = parse(origin.first())?;
        let (origin, kind) = origin.second(first.1.points()).map_or(Ok(first), parse)?;
        Ok(Self { file, kind, origin })
    }

    /// Reads the materials, and makes the mesh if that has not been done.
    pub fn loaded(self, loading: &mut Loading) -> Result<Loaded, SceneError> {
        let Self { file, kind, origin } = self;
        let path = &*file.path;
        let n_points = kind.points().len();
        // An OBJ file's polygons are separated before they are cut into triangles.
        let is_obj = matches!(kind, ShapeKind::Obj(_));
        let mut loaded = match kind {
            ShapeKind::Obj(content) => obj_mesh(&file, content, loading)?,
            ShapeKind::Ply(ply) => Loaded { origin, ..ply.with_materials(&file, loading.images) },
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
            (true, 0) => Err(file.error("has no triangles")),
            (true, n) => {
                let what = "points but no triangles: clouds of points, lines and curves are not shown";
                Err(file.error(format!("has {n} {what}")))
            }
        }
    }
}

/// Makes a mesh from the content of a file that is not glTF, and reads the materials that it names.
pub(crate) fn parse_mesh(file: MeshFile, loading: &mut Loading) -> Result<Loaded, SceneError> {
    let progress = loading.images.progress().clone();
    let place = (loading.shading, loading.origin);
    Shape::parse(file, place, (loading.n_loaded, &progress))?.loaded(loading)
}
