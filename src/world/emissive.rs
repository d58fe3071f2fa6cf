//! Triangles that emit light, and how much.

use std::f64::consts::PI;

use glam::Vec3;
use rayon::prelude::*;

use super::{
    FlatScene,
    emitters::luminance,
    texture::{sample_texture, uv_set_of},
};
use crate::layout::{INSTANCE_FOR_OTHERS, MATERIAL_UNLIT, Material, NO_TEXTURE, Triangle};

/// The number of parts of each edge of a triangle over whose cells the mean of its emission is taken.
const EMISSION_CELLS: usize = 8;

/// Returns whether a material emits light that reaches other surfaces.
pub(super) fn is_emissive(material: &Material) -> bool {
    material.ke != Vec3::ZERO && material.flags & MATERIAL_UNLIT == 0
}

/// Returns the index and the power of each triangle that emits light. Scattered rays do not find a lamp that is hidden
/// from them, so it lights nothing: samples of it would stand for the half of the estimate that those rays miss.
pub(super) fn emissive_triangles(scene: &FlatScene) -> Vec<(usize, f64)> {
    let emissive: Vec<bool> = scene.materials.iter().map(is_emissive).collect();
    if !emissive.contains(&true) {
        return Vec::new();
    }
    scene.triangles.make();
    scene.textures.corners.make();
    let of_triangle = |ix: usize| {
        let material_ix = scene.material_ix_of(ix) as usize;
        let area = area_of(&scene.triangle(ix));
        let is_met = scene.instances.as_ref().is_none_or(|it| it.of_triangle(ix).1.flags & INSTANCE_FOR_OTHERS != 0);
        let emission = if is_met { mean_emission(scene, ix, material_ix) } else { Vec3::ZERO };
        (ix, 2.0 * PI * area * luminance(emission))
    };
    scene.triangles_with(&emissive).into_par_iter().map(of_triangle).collect()
}

/// Returns the area as kernels see it: 0 if its square underflows.
pub(super) fn area_of(t: &Triangle) -> f64 {
    f64::from((t.v1 - t.v0).cross(t.v2 - t.v0).length()) / 2.0
}

/// Returns the mean radiance that a triangle emits.
fn mean_emission(scene: &FlatScene, triangle_ix: usize, material_ix: usize) -> Vec3 {
    let (textures, ke) = (&scene.textures, scene.materials[material_ix].ke);
    let texture_ix = textures.material_maps.get(material_ix).map_or(NO_TEXTURE, |maps| maps.emission);
    let Some(map) = textures.textures.get(texture_ix as usize) else { return ke };
    let stored = scene.stored(triangle_ix);
    let sum: Vec3 = middles_of_cells()
        .map(|[u, v]| {
            let uv = textures.uv_at(&stored, uv_set_of(map), u, v);
            sample_texture(&textures.texels, map, uv, 0.0).truncate().max(Vec3::ZERO)
        })
        .sum();
    ke * sum / (EMISSION_CELLS * EMISSION_CELLS) as f32
}

/// Returns the barycentric weights of the middles of the equal cells into which lines parallel to the edges cut a
/// triangle.
fn middles_of_cells() -> impl Iterator<Item = [f32; 2]> {
    const N: usize = EMISSION_CELLS;
    let cells = (0..N).flat_map(|i| (0..N - i).map(move |j| (i, j)));
    cells.flat_map(|(i, j)| {
        let place = |offset: f32| [i, j].map(|cell| (cell as f32 + offset) / N as f32);
        // The second cell, which is turned round, does not exist at the long edge.
        [Some(place(1.0 / 3.0)), (i + j + 1 < N).then(|| place(2.0 / 3.0))].into_iter().flatten()
    })
}
