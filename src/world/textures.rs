//! Textures of a flattened scene, as kernels read them: texels, how materials use them, and the texture coordinates,
//! tangents and colours at the corners of triangles.

use glam::{Vec2, Vec4};

use crate::layout::{CornerSurface, MAPS_CUTOUT, MAPS_VEIL, MaterialMaps, Texture};

/// Everything that textures need. All of it is empty if the scene has neither textures nor colours at corners.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Textures {
    /// The linear values of the 256 bytes of sRGB, as bits, and the levels of the images.
    pub texels: Vec<u32>,
    /// The textures, to which the maps refer by index.
    pub textures: Vec<Texture>,
    /// For each material, its textures.
    pub material_maps: Vec<MaterialMaps>,
    /// Texture coordinates of the triangles' corners. Those of the second set, if a texture uses it, follow those of the
    /// first set. Empty if there is no texture.
    pub uvs: Vec<[Vec2; 3]>,
    /// Tangents and colours of the triangles' corners. Empty if there are neither.
    pub corners: Vec<[CornerSurface; 3]>,
    /// The number of triangles.
    pub n_triangles: usize,
}

impl Textures {
    /// Returns whether the scene has textures, colours at corners, or opacity that rays have to ask for.
    pub fn is_in_use(&self) -> bool {
        !self.material_maps.is_empty()
    }

    /// Returns whether some rays pass through parts of triangles.
    pub fn has_cutouts(&self) -> bool {
        self.material_maps.iter().any(|maps| maps.flags & (MAPS_CUTOUT | MAPS_VEIL) != 0)
    }

    /// Returns whether triangles have texture coordinates.
    pub fn has_uvs(&self) -> bool {
        !self.uvs.is_empty()
    }

    /// Returns the texture coordinates of a triangle's corners; 0 if the scene has none.
    pub fn uvs_of(&self, triangle_ix: u32, uv_set: u32) -> [Vec2; 3] {
        let at = uv_set as usize * self.n_triangles + triangle_ix as usize;
        self.uvs.get(at).copied().unwrap_or_default()
    }

    /// Returns the texture coordinates at barycentric weights; 0 if the scene has none.
    pub fn uv_at(&self, triangle_ix: u32, uv_set: u32, u: f32, v: f32) -> Vec2 {
        let [a, b, c] = self.uvs_of(triangle_ix, uv_set);
        (1.0 - u - v) * a + u * b + v * c
    }

    /// Returns the interpolated colour of a triangle's corners; white if the scene has none.
    pub fn corner_colour_at(&self, triangle_ix: u32, u: f32, v: f32) -> Vec4 {
        let Some(corners) = self.corners.get(triangle_ix as usize) else { return Vec4::ONE };
        let [a, b, c] = corners.map(|corner| self.decode_colour(corner.colour));
        (1.0 - u - v) * a + u * b + v * c
    }

    /// Decodes a colour of 8 bits a channel, with sRGB.
    fn decode_colour(&self, colour: u32) -> Vec4 {
        let linear = |byte: u32| f32::from_bits(self.texels[(byte & 255) as usize]);
        Vec4::new(linear(colour), linear(colour >> 8), linear(colour >> 16), (colour >> 24) as f32 * (1.0 / 255.0))
    }
}
