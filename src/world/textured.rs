//! Textures of a flattened scene, as kernels read them: texels, how materials use them, and the texture coordinates,
//! tangents and colours at the corners of triangles.

use glam::{Vec2, Vec4};
use rayon::prelude::*;

use super::{
    Mismatch,
    corners::{Placed, corner_surfaces, n_triangles_of, uvs},
    instances::Stored,
    mips,
    texture_arrays::{Opacities, TextureArrays, texture_arrays},
};
use crate::{
    layout::{
        CornerSurface, LEAST_SEEN_OPACITY, LEAST_SHADOWING_OPACITY, MAPS_ALPHA_BLEND, MAPS_ALPHA_MASK, MAPS_CLEAR_TEST,
        MAPS_COLOUR_HAS_OPACITY, MAPS_CORNERS_HAVE_OPACITY, MAPS_SHADOW_TEST, MaterialMaps, NO_TEXTURE, Texture,
    },
    scene::{Alpha, Material, Scene},
    util::{Shared, memory},
};

/// Everything that textures need. All of it is empty if the scene has neither textures nor colours at corners.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Textures {
    /// The linear values of the 256 bytes of sRGB, as bits, and the mip levels of the images.
    pub texels: Shared<Vec<u32>>,
    /// The textures, to which the maps refer by index.
    pub textures: Vec<Texture>,
    /// For each material, its textures.
    pub material_maps: Vec<MaterialMaps>,
    /// Texture coordinates of the triangles' corners. Those of the second set, if a texture uses it, follow those of
    /// the first set. Empty if there is no texture.
    pub uvs: Shared<Vec<[Vec2; 3]>>,
    /// Tangents and colours of the triangles' corners. Empty if there are neither.
    pub corners: Shared<Vec<[CornerSurface; 3]>>,
    /// The number of stored triangles.
    pub n_triangles: usize,
}

impl Textures {
    /// Makes the arrays of a scene, whose meshes and instances fit together. `placed`: the meshes as their triangles
    /// are stored.
    ///
    /// # Errors
    /// A texture refers to an image that the scene does not have, or the images need more memory than there is.
    pub(super) fn new(scene: &Scene, placed: &[Placed]) -> Result<Self, Mismatch> {
        let opacities = Opacities::new(&scene.images);
        let (arrays, mut material_maps) = texture_arrays(scene, &opacities)?;
        let TextureArrays { mut texels, textures } = arrays;
        let is_see_through = |corners: &[Vec4; 3]| corners.iter().any(|colour| colour.w < 1.0);
        let corners_have_opacity = scene.meshes.par_iter().any(|mesh| mesh.colours.iter().any(is_see_through));
        for (maps, material) in material_maps.iter_mut().zip(&scene.materials) {
            set_opacity(maps, material, |image_ix| opacities.is_see_through(image_ix), corners_have_opacity);
        }
        let has_colours = scene.meshes.iter().any(|mesh| !mesh.colours.is_empty());
        let has_opacity = material_maps.iter().any(|maps| maps.flags & (MAPS_ALPHA_MASK | MAPS_ALPHA_BLEND) != 0);
        if textures.is_empty() && !has_colours && !has_opacity {
            return Ok(Self::default());
        }
        if texels.is_empty() {
            texels = mips::SRGB.map(f32::to_bits).to_vec();
        }
        let all_textures = || scene.materials.iter().flat_map(|material| material.maps.textures());
        let n_sets = all_textures().map(|texture| texture.uv_set as usize + 1).max().unwrap_or(0).min(2);
        let has_normals = scene.materials.iter().any(|material| material.maps.normal.is_some());
        let has_corners = has_colours || has_normals;
        let n_bytes = n_bytes_of_corners(n_triangles_of(placed), n_sets, has_corners);
        memory::require("texture coordinates, tangents and colours", n_bytes)
            .map_err(|error| Mismatch::Textures(error.to_string()))?;
        Ok(Self {
            texels: texels.into(),
            textures,
            material_maps,
            uvs: uvs(placed, n_sets).into(),
            corners: if has_corners { corner_surfaces(placed) } else { Vec::new() }.into(),
            n_triangles: n_triangles_of(placed),
        })
    }

    /// Returns whether the scene has textures, colours at corners, or opacity that rays have to ask for. Opacity that
    /// only rays of paths ask for does not count.
    pub fn is_in_use(&self) -> bool {
        !self.textures.is_empty() || !self.corners.is_empty() || self.has_shadow_alpha_test()
    }

    /// Returns the memory that the arrays take on a device, bytes.
    pub fn n_bytes(&self) -> u64 {
        let Self { texels, textures, material_maps, uvs, corners, .. } = self;
        let of_textures = size_of_val(&texels[..]) + size_of_val(&textures[..]) + size_of_val(&material_maps[..]);
        (of_textures + size_of_val(&uvs[..]) + size_of_val(&corners[..])) as u64
    }

    /// Returns whether rays of all kinds pass through parts of triangles.
    pub fn has_alpha_masks(&self) -> bool {
        self.material_maps.iter().any(|maps| maps.flags & (MAPS_ALPHA_MASK | MAPS_CLEAR_TEST) != 0)
    }

    /// Returns whether shadow rays pass through parts of triangles.
    pub fn has_shadow_alpha_test(&self) -> bool {
        self.material_maps.iter().any(|maps| maps.flags & (MAPS_ALPHA_MASK | MAPS_CLEAR_TEST | MAPS_SHADOW_TEST) != 0)
    }

    /// Returns whether some surfaces are blended.
    pub(crate) fn has_blended(&self) -> bool {
        self.material_maps.iter().any(|maps| maps.flags & MAPS_ALPHA_BLEND != 0)
    }

    /// Returns whether rays of paths pass through parts of triangles, or through triangles at random.
    pub fn has_path_alpha_test(&self) -> bool {
        self.material_maps.iter().any(|maps| maps.flags & (MAPS_ALPHA_MASK | MAPS_ALPHA_BLEND) != 0)
    }

    /// Returns whether triangles have texture coordinates.
    pub fn has_uvs(&self) -> bool {
        !self.uvs.is_empty()
    }

    /// Returns the texture coordinates of a triangle's corners; 0 if the scene has none.
    pub fn uvs_of(&self, at: &Stored, uv_set: u32) -> [Vec2; 3] {
        let ix = uv_set as usize * self.n_triangles + at.row;
        at.corners(self.uvs.get(ix).copied().unwrap_or_default())
    }

    /// Returns the texture coordinates at barycentric weights; 0 if the scene has none.
    pub fn uv_at(&self, at: &Stored, uv_set: u32, u: f32, v: f32) -> Vec2 {
        let [a, b, c] = self.uvs_of(at, uv_set);
        (1.0 - u - v) * a + u * b + v * c
    }

    /// Returns the interpolated colour of a triangle's corners; white if the scene has none.
    pub fn corner_colour_at(&self, at: &Stored, u: f32, v: f32) -> Vec4 {
        let Some(corners) = self.corners.get(at.row) else { return Vec4::ONE };
        let [a, b, c] = at.corners(*corners).map(|corner| self.decode_colour(corner.colour));
        (1.0 - u - v) * a + u * b + v * c
    }

    /// Decodes a colour of 8 bits a channel, with sRGB.
    fn decode_colour(&self, colour: u32) -> Vec4 {
        let linear = |byte: u32| f32::from_bits(self.texels[(byte & 255) as usize]);
        Vec4::new(linear(colour), linear(colour >> 8), linear(colour >> 16), (colour >> 24) as f32 * (1.0 / 255.0))
    }
}

/// Returns the size of all that is stored for each corner of each triangle, bytes.
fn n_bytes_of_corners(n_triangles: usize, n_uv_sets: usize, has_corners: bool) -> u64 {
    let of_uvs = n_uv_sets * size_of::<[Vec2; 3]>();
    let of_corners = if has_corners { size_of::<[CornerSurface; 3]>() } else { 0 };
    n_triangles as u64 * (of_uvs + of_corners) as u64
}

/// Sets how a material's opacity acts on rays. `is_see_through` returns whether the image at an index is not opaque.
/// `corners_have_opacity` says whether some colour at a corner of the scene's meshes is not opaque.
fn set_opacity(
    maps: &mut MaterialMaps,
    material: &Material,
    is_see_through: impl Fn(usize) -> bool,
    corners_have_opacity: bool,
) {
    let is_microfacet = material.microfacet.is_some();
    maps.coverage = material.d;
    if material.alpha != Alpha::Opaque {
        // Of MTL's materials, only a masked one without an opacity map of its own takes that of the colours.
        let takes_colours = matches!(material.alpha, Alpha::Mask(_)) && material.maps.opacity.is_none();
        maps.flags |= if is_microfacet || takes_colours { MAPS_COLOUR_HAS_OPACITY } else { 0 };
        maps.flags |= if corners_have_opacity { MAPS_CORNERS_HAVE_OPACITY } else { 0 };
    }
    match material.alpha {
        Alpha::Opaque => maps.opacity = NO_TEXTURE,
        Alpha::Mask(cutoff) => {
            maps.flags |= MAPS_ALPHA_MASK;
            maps.alpha_cutoff = cutoff;
        }
        Alpha::Blend => {
            let is_glass = material.lobes.reflection || material.lobes.refraction;
            let colours = material.maps.base_colour.as_ref().filter(|_| is_microfacet);
            let by_colour = colours.is_some_and(|map| is_see_through(map.image_ix as usize));
            let by_map = material.maps.opacity.is_some() || by_colour || corners_have_opacity;
            // What refracts shows itself in full.
            let refracts = !is_microfacet && material.lobes.refraction;
            let can_be_clear = material.d < LEAST_SEEN_OPACITY || by_map;
            maps.flags |= if (material.d < 1.0 || by_map) && !refracts { MAPS_ALPHA_BLEND } else { 0 };
            maps.flags |= if can_be_clear && !refracts { MAPS_CLEAR_TEST } else { 0 };
            if is_microfacet {
                maps.flags |= if material.d < 1.0 || by_colour || corners_have_opacity { MAPS_SHADOW_TEST } else { 0 };
            } else if !is_glass && (corners_have_opacity || material.maps.opacity.is_some()) {
                // MTL's own transparency `d` casts whole shadows, as in the paper.
                maps.flags |= MAPS_SHADOW_TEST;
                maps.opacity_factor = 1.0;
            }
            maps.alpha_cutoff = LEAST_SHADOWING_OPACITY;
        }
    }
}
