//! Check of a flattened scene. Kernels read its arrays without bounds checks, and the host indexes them, so every
//! length, index and kind is checked before a world is made. Numbers that are only computed with, such as colours, may
//! be anything: no address and no end of a loop depends on them.

use glam::Vec3;
use rayon::prelude::*;

use super::{FlatScene, Instances, Mismatch, Textures, flat::bounds_of, mips};
use crate::{
    frame::Integrator,
    layout::{
        AREA_SPHERE, LIGHT_SPOT, MaterialMaps, N_MAPS, NO_TEXTURE, SRGB_TABLE_SIZE, SUSPENDED, TEXTURE_HALVES,
        TEXTURE_UV_SET, Texture, Triangle,
    },
    scene::{
        MOST_TRIANGLES,
        mesh::{MAX_COORDINATE, box_corners},
    },
};

// Indices of triangles are no marks of suspended rays.
const _: () = assert!(MOST_TRIANGLES <= SUSPENDED as u64);

/// Checks that all parts of a scene fit together, in one pass over each array.
///
/// # Errors
/// The first mismatch.
pub(super) fn check(scene: &FlatScene) -> Result<(), Mismatch> {
    check_materials(scene)?;
    let FlatScene { triangles, materials, material_names, lights, area_lights, camera, defaults, .. } = scene;
    check_len("material_names", material_names.len(), (materials.len(), "materials"))?;
    let is_near = |p: Vec3| p.is_finite() && p.abs().max_element() <= MAX_COORDINATE;
    let is_far = |t: &Triangle| ![t.v0, t.v1, t.v2].into_iter().all(is_near);
    if let Some(ix) = triangles.par_iter().position_first(is_far) {
        return Err(scene_error(format!("triangles: a corner of triangle {ix} lies beyond {MAX_COORDINATE:e}")));
    }
    check_textures(scene)?;
    if let Some(ix) = lights.iter().position(|light| light.kind > LIGHT_SPOT) {
        return Err(scene_error(format!("lights: light {ix} is of kind {}, not 0 to {LIGHT_SPOT}", lights[ix].kind)));
    }
    if let Some(ix) = area_lights.iter().position(|light| light.kind > AREA_SPHERE) {
        let kind = area_lights[ix].kind;
        return Err(scene_error(format!("area_lights: light {ix} is of kind {kind}, not 0 to {AREA_SPHERE}")));
    }
    camera.check().map_err(|what| scene_error(format!("camera: {what}")))?;
    for integrator in [Integrator::Whitted, Integrator::Path] {
        let of_integrator = defaults.for_integrator(Some(integrator));
        of_integrator.options().check().map_err(|error| scene_error(format!("defaults: {error}")))?;
    }
    Ok(())
}

/// Checks that every triangle has a material, in one pass over `triangle_materials`.
fn check_materials(scene: &FlatScene) -> Result<(), Mismatch> {
    let (triangle_materials, triangles) = (scene.triangle_materials.len(), scene.triangles.len());
    if triangle_materials != triangles {
        return Err(Mismatch::TriangleMaterials { triangle_materials, triangles });
    }
    let materials = scene.materials.len();
    let is_missing = |(_, material): &(usize, &u32)| **material as usize >= materials;
    let words = match &scene.instances {
        Some(instances) => {
            check_instances(instances, scene)?;
            &instances.materials
        }
        None => &scene.triangle_materials,
    };
    match words.iter().enumerate().find(is_missing) {
        Some((triangle, &material)) => Err(Mismatch::Material { triangle, material, materials }),
        None => Ok(()),
    }
}

/// Checks that instances follow one another, that each has a geometry, and that the slots of its triangles have
/// materials.
fn check_instances(instances: &Instances, scene: &FlatScene) -> Result<(), Mismatch> {
    let Instances { ranges, list, materials, .. } = instances;
    check_len("n_slots", instances.n_slots.len(), (ranges.len(), "geometries"))?;
    let mut first_row = 0;
    for (ix, range) in ranges.iter().enumerate() {
        let end = first_row + range.n_triangles as usize;
        if range.first_row as usize != first_row || end > scene.triangles.len() {
            return Err(scene_error(format!("instances: geometry {ix} does not follow the one before")));
        }
        let last_slot = scene.triangle_materials[first_row..end].par_iter().max();
        let (n_slots, stated) = (last_slot.map_or(0, |slot| *slot as usize + 1), instances.n_slots[ix]);
        if n_slots != stated as usize {
            return Err(scene_error(format!("n_slots: geometry {ix} has {n_slots} slots, not {stated}")));
        }
        first_row = end;
    }
    check_len("triangles", scene.triangles.len(), (first_row, "triangles of geometries"))?;
    let boxes: Vec<(Vec3, Vec3)> = ranges.par_iter().map(|range| bounds_of(range.of(&scene.triangles))).collect();
    let mut first_triangle = 0_usize;
    for (ix, instance) in list.iter().enumerate() {
        let wrong = |what: &str| Err(scene_error(format!("instances: instance {ix} {what}")));
        let Some(range) = ranges.get(instance.geometry_ix as usize) else { return wrong("has no geometry") };
        if [instance.first_row, instance.n_triangles] != [range.first_row, range.n_triangles] {
            return wrong("is not of its geometry");
        }
        if instance.first_triangle as usize != first_triangle {
            return wrong("does not follow the one before");
        }
        if instance.first_material as usize + instances.n_slots[instance.geometry_ix as usize] as usize
            > materials.len()
        {
            return wrong("lacks materials");
        }
        let corners = [instance.axis_x, instance.axis_y, instance.axis_z, instance.translation];
        let rows = [instance.local_x, instance.local_y, instance.local_z];
        if !(corners.iter().chain(&rows).all(|v| v.is_finite()) && instance.condition >= 1.0) {
            return wrong("has a number that is not finite");
        }
        if instance.n_triangles > 0 {
            let (min, max) = boxes[instance.geometry_ix as usize];
            let is_near = |p: Vec3| p.is_finite() && p.abs().max_element() <= 1.001 * MAX_COORDINATE;
            if !box_corners(min, max).into_iter().all(|p| is_near(instance.point(p))) {
                return wrong(&format!("lies beyond {MAX_COORDINATE:e}"));
            }
        }
        first_triangle += instance.n_triangles as usize;
    }
    if first_triangle == 0 || first_triangle as u64 > MOST_TRIANGLES {
        return Err(scene_error(format!("instances: they have {first_triangle} triangles, not 1 to {MOST_TRIANGLES}")));
    }
    Ok(())
}

/// Checks the arrays of textures. All of them are empty, or each material has maps.
fn check_textures(scene: &FlatScene) -> Result<(), Mismatch> {
    let Textures { texels, textures, material_maps, uvs, corners, n_triangles } = &*scene.textures;
    if [texels.len(), textures.len(), material_maps.len(), uvs.len(), corners.len()] == [0; 5] {
        return Ok(());
    }
    let of_triangles = (scene.triangles.len(), "triangles");
    check_len("material_maps", material_maps.len(), (scene.materials.len(), "materials"))?;
    if texels.len() < SRGB_TABLE_SIZE as usize {
        let n = texels.len();
        return Err(scene_error(format!("texels has {n} words, but its table of sRGB takes {SRGB_TABLE_SIZE}")));
    }
    if *n_triangles != scene.triangles.len() {
        return Err(scene_error(format!("textures are of {n_triangles} triangles, not of {}", scene.triangles.len())));
    }
    if !corners.is_empty() {
        check_len("corners", corners.len(), of_triangles)?;
    }
    // There may be two sets.
    if !uvs.is_empty() && uvs.len() != 2 * n_triangles {
        check_len("uvs", uvs.len(), of_triangles)?;
    }
    let has_second_set = uvs.len() != *n_triangles || uvs.is_empty();
    for (ix, texture) in textures.iter().enumerate() {
        let what = texture_fault(texture, texels, has_second_set);
        what.map_or(Ok(()), |what| Err(scene_error(format!("textures: texture {ix} {what}"))))?;
    }
    for (ix, maps) in material_maps.iter().enumerate() {
        let is_missing = |map: &u32| *map != NO_TEXTURE && *map as usize >= textures.len();
        if let Some(map) = indices_of(maps).into_iter().find(is_missing) {
            let n = textures.len();
            return Err(scene_error(format!(
                "material_maps: material {ix} has texture {map}, but there are {n} textures"
            )));
        }
    }
    let n_words = scene.textures.n_bytes() / 4;
    if n_words >= u64::from(u32::MAX) {
        return Err(Mismatch::Textures(format!("they and the triangles' corners need {n_words} words")));
    }
    Ok(())
}

/// Returns what is wrong with a texture. Each of its mip levels has a word that says where its texels begin.
fn texture_fault(texture: &Texture, texels: &[u32], has_second_set: bool) -> Option<String> {
    let [width, height] = [texture.size & 0xffff, texture.size >> 16];
    if width == 0 || height == 0 {
        return Some(format!("has {width} x {height} texels"));
    }
    let sizes = mips::sizes(width, height);
    let (n_mips, most) = (texture.n_mips, sizes.clone().count());
    if n_mips == 0 || n_mips as usize > most {
        return Some(format!("has {n_mips} mip levels, not 1 to {most}"));
    }
    if texture.flags & TEXTURE_UV_SET != 0 && !has_second_set {
        return Some("uses the second set of texture coordinates, but uvs has only the first".to_owned());
    }
    let words_per_texel = if texture.flags & TEXTURE_HALVES != 0 { 2 } else { 1 };
    let is_outside = |(level, [width, height]): &(usize, [u32; 2])| {
        let n_words = u64::from(*width) * u64::from(*height) * words_per_texel;
        let first = texels.get(texture.first_texel as usize + level);
        first.is_none_or(|first| u64::from(*first) + n_words > texels.len() as u64)
    };
    let outside = sizes.take(n_mips as usize).enumerate().find(is_outside);
    outside.map(|(level, _)| format!("has texels of mip level {level} behind the {} words of texels", texels.len()))
}

/// Returns the textures of a material: the first members of the struct.
fn indices_of(maps: &MaterialMaps) -> [u32; N_MAPS as usize] {
    let words: [u32; size_of::<MaterialMaps>() / 4] = bytemuck::cast(*maps);
    *words.first_chunk().expect("the maps come first")
}

fn check_len(array: &str, len: usize, (expected, of): (usize, &str)) -> Result<(), Mismatch> {
    if len == expected { Ok(()) } else { Err(scene_error(format!("{array} has {len} entries for {expected} {of}"))) }
}

fn scene_error(what: String) -> Mismatch {
    Mismatch::Scene(what)
}
