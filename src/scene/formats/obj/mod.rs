//! Wavefront OBJ files with their MTL materials.

mod clean;
mod files;
mod maps;
mod model;
mod mtl;
mod polypaint;
mod quick;
mod tiles;

use std::{collections::HashMap, path::Path};

pub(crate) use self::files::named_files;
use self::{
    clean::{CleanObj, clean_obj},
    model::Model,
    polypaint::with_polypaint,
    quick::{QuickObj, quick_obj},
};
use super::mesh_file::{Loaded, Loading};
use crate::{
    scene::{
        meshes::needs::require_for_mesh,
        model::{Material, SceneError, extent::MeshOrigin},
    },
    util::progress::Progress,
};
use glam::DVec3;

/// The content of an OBJ file, without its materials.
pub(crate) struct ObjFile {
    text: String,
    content: ObjContent,
    /// The point of the file that is the origin of the points.
    origin: DVec3,
}

impl ObjFile {
    /// Returns the number of points.
    pub fn n_points(&self) -> usize {
        self.content.clean().size.n_points as usize
    }
}

/// What has been read in one of two ways.
enum ObjContent {
    Quick(QuickObj),
    Careful(CleanObj),
}

impl ObjContent {
    fn clean(&self) -> &CleanObj {
        match self {
            Self::Quick(quick) => &quick.clean,
            Self::Careful(clean) => clean,
        }
    }
}

/// Reads an OBJ file's text, without the files that it names.
pub(crate) fn read_obj(
    path: &Path,
    text: String,
    origin: MeshOrigin,
    progress: &Progress,
) -> Result<ObjFile, SceneError> {
    let text = with_polypaint(text);
    let first = origin.first();
    // The quick way keeps points as they are written.
    let quick = if first == DVec3::ZERO { quick_obj(&text, progress) } else { None };
    let (content, second) = match quick {
        Some(quick) => {
            let second = origin.second(quick.points());
            (ObjContent::Quick(quick), second)
        }
        None => {
            let clean = careful(path, &text, first)?;
            let second = origin.second(&clean.points());
            (ObjContent::Careful(clean), second)
        }
    };
    Ok(match second {
        Some(origin) => ObjFile { content: ObjContent::Careful(careful(path, &text, origin)?), text, origin },
        None => ObjFile { content, text, origin: first },
    })
}

fn careful(path: &Path, text: &str, origin: DVec3) -> Result<CleanObj, SceneError> {
    clean_obj(text, origin).map_err(|(line, what)| SceneError::line(path, line, what))
}

/// Makes a mesh from an OBJ file's content, and reads its materials.
pub(crate) fn obj_mesh(path: &Path, file: ObjFile, loading: &mut Loading) -> Result<Loaded, SceneError> {
    let &mut Loading { shading, n_loaded, access, ref mut images, .. } = loading;
    let ObjFile { text, content, origin } = file;
    let clean = content.clean();
    require_for_mesh(n_loaded as u64, &clean.size).map_err(|what| SceneError::file(path, what))?;
    let (materials, tiles) = mtl::load_libraries(path, &clean.libraries, access, images)?;
    if let Some((line, statement)) = &clean.unknown {
        tracing::warn!("{}:{line}: unknown statement `{}`", path.display(), statement.escape_debug());
    }
    if let Some((line, what)) = &clean.missing {
        tracing::warn!("{}:{line}: {what}; faces that name such normals or texture vertices have none", path.display());
    }
    let by_name = used_materials(path, clean, &materials);
    let (no_material, by_kind) = (materials.len() as u32, (shading, clean.colour_scale));
    let quick_models = match &content {
        ObjContent::Quick(quick) => quick.models(|name| by_name.get(name).copied()),
        ObjContent::Careful(_) => None,
    };
    let (mut mesh, uses_crease) = match quick_models {
        Some(models) => model::mesh(&models, no_material, by_kind),
        None => {
            let cleaned = match content {
                ObjContent::Careful(clean) => clean,
                // The quick way has not found what is wrong with a number. The careful way finds it.
                ObjContent::Quick(_) => careful(path, &text, origin)?,
            };
            if let Some((line, what)) = &cleaned.left_out {
                tracing::warn!("{}:{line}: {what}; such faces are left out", path.display());
            }
            let models = parse(&cleaned, &by_name).map_err(|e| SceneError::file(path, e.to_string()))?;
            let models: Vec<Model> = models.iter().map(Model::of_tobj).collect();
            model::mesh(&models, no_material, by_kind)
        }
    };
    tiles.assign(path, &mut mesh);
    Ok(Loaded { mesh, origin, materials, uses_crease })
}

/// Returns the indices of the used materials in the library. A name that differs from that of one material in the case
/// of letters alone stands for it. Warns of the first such name, and of the first name that no library defines;
/// further ones are not reported.
fn used_materials(path: &Path, clean: &CleanObj, materials: &[Material]) -> HashMap<String, usize> {
    let path = path.display();
    let mut by_lower: HashMap<String, Vec<usize>> = HashMap::new();
    for (ix, material) in materials.iter().enumerate() {
        by_lower.entry(material.name.to_lowercase()).or_default().push(ix);
    }
    let (mut by_name, mut undefined, mut other_case) = (HashMap::new(), None, None);
    // `usemtl` without a name is for faces without a material.
    for (name, line) in clean.used_materials.iter().filter(|(name, _)| !name.is_empty()) {
        let alike = by_lower.get(&name.to_lowercase()).map_or(&[][..], |alike| alike);
        // If several materials have the same name, the last one counts.
        let exact = alike.iter().rev().find(|ix| materials[**ix].name == *name);
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

/// Reads a cleaned file by tobj.
fn parse(clean: &CleanObj, by_name: &HashMap<String, usize>) -> Result<Vec<tobj::Model>, tobj::LoadError> {
    let options = tobj::LoadOptions { ignore_points: true, ignore_lines: true, ..Default::default() };
    // tobj needs the materials only for their names; the materials themselves are in the library.
    let materials = |_: &Path| {
        let by_name = by_name.iter().map(|(name, ix)| (name.clone(), *ix)).collect();
        Ok((vec![tobj::Material::default()], by_name))
    };
    tobj::load_obj_buf(&mut clean.text(), &options, materials).map(|(models, _)| models)
}
