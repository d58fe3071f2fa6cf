//! Colours of points beside an image that shows the same colours. Programs that make meshes of photographs write both,
//! for readers that show only one of them. The product of both would be too dark, so the image counts alone.

use std::path::Path;

use glam::{Vec3, Vec4};

use super::{image_cache::Images, mesh_file::Loaded};
use crate::scene::model::{Encoding, Material, Mesh, Texture, Wrap, texture::linear_of_srgb};

/// Number of faces that are looked at. It is odd, so that they are not all in one column of a grid.
const N_FACES: usize = 2047;
/// Greatest mean difference between the colours and the image, with colours as the eye perceives them, 0 to 1.
const GREATEST_DIFFERENCE: f32 = 0.15;
/// The colours are also nearer to the image than to white, by this factor. White ones do not matter.
const NEARER: f32 = 2.0;

/// Takes the colours from a mesh if its images show the same ones, with a warning.
pub(crate) fn leave_out(path: &Path, loaded: &mut Loaded, images: &Images) {
    let Loaded { mesh, materials, .. } = loaded;
    if mesh.colours.is_empty() || !are_repeated(mesh, materials, images) {
        return;
    }
    tracing::warn!("{}: the colours of the points are those of the images: only the images are shown", path.display());
    for (colours, slot) in mesh.colours.iter_mut().zip(&mesh.slots) {
        if base_colour(materials, *slot).is_some() {
            *colours = colours.map(|colour| Vec3::ONE.extend(colour.w));
        }
    }
}

fn base_colour(materials: &[Material], slot: u32) -> Option<&Texture> {
    materials.get(slot as usize)?.maps.base_colour.as_ref()
}

/// Returns whether the colours of faces with images are nearly those of the images.
fn are_repeated(mesh: &Mesh, materials: &[Material], images: &Images) -> bool {
    let (mut from_image, mut from_white, mut n) = (0.0, 0.0, 0);
    for ix in (0..mesh.faces.len()).step_by(mesh.faces.len().div_ceil(N_FACES).max(1)) {
        let Some(shown) = base_colour(materials, mesh.slots[ix]).and_then(|map| texel(mesh, ix, map, images)) else {
            continue;
        };
        let colour = perceived(mesh.colours[ix][0]);
        from_image += (colour - shown).abs().element_sum() / 3.0;
        from_white += (1.0 - colour).abs().element_sum() / 3.0;
        n += 1;
    }
    n > 0 && from_image <= GREATEST_DIFFERENCE * n as f32 && NEARER * from_image < from_white
}

/// Returns the colour of a linear one with equal steps for the eye, about as sRGB.
fn perceived(linear: Vec4) -> Vec3 {
    linear.truncate().max(Vec3::ZERO).map(f32::sqrt)
}

/// Returns the perceived colour of an image at the first corner of a face.
fn texel(mesh: &Mesh, face_ix: usize, map: &Texture, images: &Images) -> Option<Vec3> {
    let image = images.shown_image(map.image_ix)?;
    let uv = map.transform.transform_point2(mesh.uvs[map.uv_set as usize].get(face_ix)?[0]);
    let place = |x: f32, wrap: Wrap, n: u32| {
        let x = if wrap == Wrap::Clamp { x.clamp(0.0, 1.0) } else { x - x.floor() };
        ((x * n as f32) as usize).min(n as usize - 1)
    };
    let (column, row) = (place(uv.x, map.wrap[0], image.width), place(uv.y, map.wrap[1], image.height));
    let pixel = Vec4::from_array(image.pixels.get(row * image.width as usize + column));
    let is_srgb = image.encoding(map.encoding) == Encoding::Srgb;
    Some(perceived(if is_srgb { pixel.map(linear_of_srgb) } else { pixel }))
}
