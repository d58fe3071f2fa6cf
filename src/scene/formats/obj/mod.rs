//! Wavefront OBJ files with their MTL materials.

mod content;
mod elements;
mod faces;
mod files;
mod maps;
mod model;
mod mtl;
mod polypaint;
mod statement;
mod udim;

use std::{collections::HashMap, path::Path};

pub(crate) use self::{content::ObjFile, files::named_files};
use self::{polypaint::with_polypaint, statement::comments};
use super::mesh_file::{Loaded, Loading};
use crate::{
    scene::{
        files::SourceFile,
        meshes::needs::require_for_mesh,
        model::{Material, SceneError, extent::MeshOrigin},
    },
    util::progress::Progress,
};
use glam::DVec3;

/// Reads an OBJ file's text, without the files that it names.
pub(crate) fn read_obj(
    path: &Path,
    text: String,
    origin: MeshOrigin,
    progress: &Progress,
) -> Result<ObjFile, SceneError> {
    let text = with_polypaint(text);
    let read = |origin: DVec3| {
        ObjFile::read(&text, origin, progress).map_err(|(line, what)| SceneError::line(path, line, what))
    };
    let file = read(origin.first())?;
    origin.second(file.elements.points()).map_or(Ok(file), read)
}

/// Makes a mesh from an OBJ file's content, and reads its materials.
pub(crate) fn obj_mesh(obj: &SourceFile, file: ObjFile, loading: &mut Loading) -> Result<Loaded, SceneError> {
    let &mut Loading { shading, n_loaded, ref mut images, .. } = loading;
    let path = &*obj.path;
    require_for_mesh(n_loaded as u64, &file.size).map_err(|what| obj.error(what))?;
    let uses_materials = file.used_materials.iter().any(|(name, _)| !name.is_empty());
    let (materials, tiles) = mtl::load_libraries(obj, (&file.libraries, uses_materials), images)?;
    if let Some((line, statement)) = &file.unknown {
        tracing::warn!("{}:{line}: unknown statement `{}`", path.display(), statement.escape_debug());
    }
    if let Some((line, what)) = &file.missing {
        tracing::warn!("{}:{line}: {what}; faces that name such normals or texture vertices have none", path.display());
    }
    let by_name = used_materials(path, &file, &materials);
    if let Some((line, what)) = &file.left_out {
        tracing::warn!("{}:{line}: {what}; such faces are left out", path.display());
    }
    let material_ix = |name: &str| by_name.get(name).copied();
    let (mut mesh, uses_crease) = model::mesh(&file, material_ix, materials.len() as u32, shading);
    tiles.assign(path, &mut mesh);
    Ok(Loaded { mesh, origin: file.origin, materials, uses_crease })
}

/// Returns the indices of the used materials in the library. A name that differs from that of one material in the case
/// of letters alone stands for it. Warns of the first such name, and of the first name that no library defines;
/// further ones are not reported.
fn used_materials(path: &Path, file: &ObjFile, materials: &[Material]) -> HashMap<String, usize> {
    let path = path.display();
    let mut by_lower: HashMap<String, Vec<usize>> = HashMap::new();
    for (ix, material) in materials.iter().enumerate() {
        by_lower.entry(material.name.to_lowercase()).or_default().push(ix);
    }
    let (mut by_name, mut undefined, mut other_case) = (HashMap::new(), None, None);
    // `usemtl` without a name is for faces without a material.
    for (name, line) in file.used_materials.iter().filter(|(name, _)| !name.is_empty()) {
        let find = |name: &str| by_lower.get(&name.to_lowercase());
        // A comment may follow the name, which may have `#`, too.
        let shorter = comments(name).rev().map(|at| name[..at].trim_end());
        let stated = std::iter::once(&**name).chain(shorter).find(|name| find(name).is_some()).unwrap_or(name);
        let alike = find(stated).map_or(&[][..], |alike| alike);
        // If several materials have the same name, the last one counts.
        let exact = alike.iter().rev().find(|ix| materials[**ix].name == stated);
        let Some(ix) = exact.or(alike.last()) else {
            undefined = undefined.or(Some((name, line)));
            continue;
        };
        let found = &materials[*ix].name;
        if exact.is_none() && alike.iter().any(|ix| materials[*ix].name != *found) {
            undefined = undefined.or(Some((name, line)));
            continue;
        }
        if exact.is_none() {
            other_case = other_case.or(Some((name, line, found)));
        }
        by_name.insert(name.clone(), *ix);
    }
    if let Some((name, line)) = undefined {
        let name = name.escape_debug();
        tracing::warn!("{path}:{line}: no library defines material `{name}`: it becomes the default one");
    }
    if let Some((name, line, found)) = other_case {
        let (name, found) = (name.escape_debug(), found.escape_debug());
        tracing::warn!("{path}:{line}: no library defines material `{name}`: `{found}` is taken");
    }
    by_name
}
