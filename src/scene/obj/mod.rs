//! Wavefront OBJ files with their MTL materials.

mod clean;
mod mtl;

use std::path::Path;

use glam::Vec3;

use self::clean::{CleanObj, NORMALS, SMOOTH, clean_obj};
pub(super) use self::mtl::{Library, named_libraries};
use super::{
    error::SceneError,
    mesh::Mesh,
    needs::require_for_triangles,
    smooth::{Shading, crease_normals},
};

/// Makes a mesh from an OBJ file's text, and reads its materials. A face's slot is an index into the library. A face
/// without a material, or with one that the library lacks, has slot `library.materials.len()`. `n_loaded` is the
/// number of triangles that the scene has already.
pub(super) fn parse_obj(
    path: &Path,
    text: &str,
    shading: Shading,
    n_loaded: usize,
) -> Result<(Mesh, Library), SceneError> {
    let clean = clean_obj(text).map_err(|(line, what)| SceneError::line(path, line, what))?;
    let required = require_for_triangles(n_loaded as u64, clean.n_triangles);
    required.map_err(|what| SceneError::file(path, what))?;
    let library = mtl::load_libraries(path, &clean.libraries)?;
    warn(path, &clean, &library);
    let models = parse(&clean, &library).map_err(|e| SceneError::file(path, e.to_string()))?;
    Ok((mesh(&models, library.materials.len() as u32, shading), library))
}

/// Warns of the first unknown statement, and of the first material, by name, that is used but not defined. Further
/// ones are not reported.
fn warn(path: &Path, clean: &CleanObj, library: &Library) {
    let path = path.display();
    if let Some((line, statement)) = &clean.unknown {
        tracing::warn!("{path}:{line}: unknown statement `{}`", statement.escape_debug());
    }
    if let Some((name, line)) = clean.used_materials.iter().find(|(name, _)| !library.has(name)) {
        tracing::warn!(
            "{path}:{line}: no library defines material `{}`: it becomes the default one",
            name.escape_debug()
        );
    }
}

fn parse(clean: &CleanObj, library: &Library) -> Result<Vec<tobj::Model>, tobj::LoadError> {
    let options =
        tobj::LoadOptions { triangulate: true, ignore_points: true, ignore_lines: true, ..Default::default() };
    let by_name = library.materials.iter().map(|material| material.name.clone()).zip(0..).collect();
    // tobj needs the materials only for their names; the materials themselves are in the library.
    let materials = |_: &Path| Ok((vec![tobj::Material::default()], std::clone::Clone::clone(&by_name)));
    tobj::load_obj_buf(&mut clean.text.as_bytes(), &options, materials).map(|(models, _)| models)
}

/// Joins all models into one mesh. tobj has cut polygons into fans.
fn mesh(models: &[tobj::Model], no_material: u32, shading: Shading) -> Mesh {
    let mut mesh = Mesh::default();
    let mut to_smooth = Vec::new();
    for tobj::Model { mesh: model, name } in models {
        let first = mesh.positions.len() as u32;
        mesh.positions.extend(model.positions.as_chunks().0.iter().copied().map(Vec3::from_array));
        mesh.faces.extend(model.indices.as_chunks::<3>().0.iter().map(|face| face.map(|ix| first + ix)));
        let n_faces = mesh.faces.len();
        mesh.slots.resize(n_faces, model.material_id.map_or(no_material, |ix| ix as u32));
        to_smooth.resize(n_faces, shading.smooth && name == SMOOTH);
        if shading.smooth && name == NORMALS {
            let normal = |ix: u32| Vec3::from_slice(&model.normals[ix as usize * 3..]).normalize_or_zero();
            mesh.normals.extend(model.normal_indices.as_chunks::<3>().0.iter().map(|face| face.map(normal)));
        }
        mesh.normals.resize(n_faces, [Vec3::ZERO; 3]);
    }
    if to_smooth.contains(&true) {
        let computed = crease_normals(&mesh.positions, &mesh.faces, &to_smooth, shading.crease);
        for (face, normals) in computed.into_iter().enumerate().filter(|(face, _)| to_smooth[*face]) {
            mesh.normals[face] = normals;
        }
    }
    mesh
}
