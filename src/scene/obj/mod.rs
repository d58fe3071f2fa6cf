//! Wavefront OBJ files with their MTL materials.

mod clean;
mod files;
mod maps;
mod mtl;
mod quick;

use std::{collections::HashMap, path::Path};

use glam::{DVec3, Vec2, Vec3};

pub(super) use self::files::named_files;
use self::{
    clean::{CleanObj, FaceKind, FaceShading, clean_obj},
    quick::quick_obj,
};
use super::{
    error::SceneError,
    material::Material,
    mesh::Mesh,
    mesh_file::{Loaded, Loading},
    needs::require_for_mesh,
    polygon::Triangulator,
    smooth::{Shading, crease_normals},
    texture::linear_of_srgb,
};

/// Makes a mesh from an OBJ file's text, and reads its materials.
pub(super) fn parse_obj(path: &Path, text: &str, loading: &mut Loading) -> Result<Loaded, SceneError> {
    let &mut Loading { shading, origin, n_loaded, access, ref mut images } = loading;
    let careful = || clean_obj(text, origin).map_err(|(line, what)| SceneError::line(path, line, what));
    // The quick way keeps points as they are written.
    let clean = if origin == DVec3::ZERO { quick_obj(text) } else { None };
    let clean = clean.map_or_else(careful, Ok)?;
    require_for_mesh(n_loaded as u64, &clean.size).map_err(|what| SceneError::file(path, what))?;
    let materials = mtl::load_libraries(path, &clean.libraries, access, images)?;
    if let Some((line, statement)) = &clean.unknown {
        tracing::warn!("{}:{line}: unknown statement `{}`", path.display(), statement.escape_debug());
    }
    if let Some((line, what)) = &clean.missing {
        tracing::warn!("{}:{line}: {what}; faces that name such normals or texture vertices have none", path.display());
    }
    let by_name = used_materials(path, &clean, &materials);
    let models = match parse(&clean, &by_name) {
        Ok(models) if clean.size.n_triangles > 0 && models.iter().all(is_finite) => models,
        // The quick way has not looked at the numbers, so it is the careful way that finds what is wrong with one.
        _ => parse(&careful()?, &by_name).map_err(|e| SceneError::file(path, e.to_string()))?,
    };
    let (mesh, uses_crease) = mesh(&models, materials.len() as u32, (shading, clean.colour_scale));
    Ok(Loaded { mesh, materials, uses_crease })
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
    for (name, line) in &clean.used_materials {
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

fn parse(clean: &CleanObj, by_name: &HashMap<String, usize>) -> Result<Vec<tobj::Model>, tobj::LoadError> {
    let options = tobj::LoadOptions { ignore_points: true, ignore_lines: true, ..Default::default() };
    // tobj needs the materials only for their names; the materials themselves are in the library.
    let materials = |_: &Path| {
        let by_name = by_name.iter().map(|(name, ix)| (name.clone(), *ix)).collect();
        Ok((vec![tobj::Material::default()], by_name))
    };
    tobj::load_obj_buf(&mut clean.text(), &options, materials).map(|(models, _)| models)
}

/// Returns whether all numbers of a model are finite.
fn is_finite(tobj::Model { mesh, .. }: &tobj::Model) -> bool {
    [&mesh.positions, &mesh.normals, &mesh.texcoords].iter().all(|numbers| numbers.iter().all(|it| it.is_finite()))
}

/// Joins all models into one mesh. All faces of a model are of one kind. Also returns whether the crease angle counts.
/// `colour_scale`: the number that stands for 1 in colours.
fn mesh(models: &[tobj::Model], no_material: u32, (shading, colour_scale): (Shading, f32)) -> (Mesh, bool) {
    let mut mesh = Mesh::default();
    let mut to_smooth = Vec::new();
    let mut triangulator = Triangulator::default();
    for tobj::Model { mesh: model, name } in models {
        let kind = FaceKind::of_group(name).unwrap_or(FaceKind { shading: FaceShading::Smooth, has_uvs: false });
        let corners = triangles(model, &mut triangulator);
        let part = part(model, &corners, kind, shading, colour_scale);
        to_smooth.extend(corners.iter().map(|_| shading.smooth && kind.shading == FaceShading::Smooth));
        let slot = model.material_id.map_or(no_material, |ix| ix as u32);
        mesh.append(Mesh { slots: vec![slot; corners.len()], ..part });
    }
    let uses_crease = to_smooth.contains(&true);
    if uses_crease {
        let computed = crease_normals(&mesh.positions, &mesh.faces, &to_smooth, shading.crease);
        for (face, normals) in computed.into_iter().enumerate().filter(|(face, _)| to_smooth[*face]) {
            mesh.normals[face] = normals;
        }
    }
    (mesh, uses_crease)
}

/// Cuts the polygons of a model into triangles. Returns the numbers of their corners in the model's lists of indices.
fn triangles(model: &tobj::Mesh, triangulator: &mut Triangulator) -> Vec<[usize; 3]> {
    let mut triangles = Vec::with_capacity(model.indices.len() / 3);
    let all_triangles = std::iter::repeat_n(3, if model.face_arities.is_empty() { model.indices.len() / 3 } else { 0 });
    let (mut first, mut polygon) = (0, Vec::new());
    for n_corners in all_triangles.chain(model.face_arities.iter().map(|n| *n as usize)) {
        let indices = &model.indices[first..first + n_corners];
        polygon.clear();
        polygon.extend(indices.iter().map(|ix| Vec3::from_slice(&model.positions[*ix as usize * 3..])));
        triangulator.cut(&polygon, |corners| triangles.push(corners.map(|corner| first + corner)));
        first += n_corners;
    }
    triangles
}

/// Makes the mesh of a model without its slots. `corners` are the corners of its triangles.
fn part(model: &tobj::Mesh, corners: &[[usize; 3]], kind: FaceKind, shading: Shading, colour_scale: f32) -> Mesh {
    let point = |corner: usize| model.indices[corner];
    let normal = |corner: usize| {
        let ix = model.normal_indices[corner] as usize;
        Vec3::from_slice(&model.normals[ix * 3..]).normalize_or_zero()
    };
    let uv = |corner: usize| {
        let ix = model.texcoord_indices[corner] as usize;
        // The origin of OBJ's coordinates is the lower left corner of the image.
        Vec2::new(model.texcoords[ix * 2], 1.0 - model.texcoords[ix * 2 + 1])
    };
    let colour = |corner: usize| {
        let colour = Vec3::from_slice(&model.vertex_color[point(corner) as usize * 3..]) / colour_scale;
        Vec3::from_array(colour.to_array().map(linear_of_srgb)).extend(1.0)
    };
    let mut part = Mesh {
        positions: model.positions.as_chunks().0.iter().copied().map(Vec3::from_array).collect(),
        faces: corners.iter().map(|face| face.map(point)).collect(),
        normals: vec![[Vec3::ZERO; 3]; corners.len()],
        ..Mesh::default()
    };
    if shading.smooth && kind.shading == FaceShading::Normals {
        part.normals = corners.iter().map(|face| face.map(normal)).collect();
    }
    if kind.has_uvs {
        part.uvs[0] = corners.iter().map(|face| face.map(uv)).collect();
    }
    if !model.vertex_color.is_empty() {
        part.colours = corners.iter().map(|face| face.map(colour)).collect();
    }
    part
}
