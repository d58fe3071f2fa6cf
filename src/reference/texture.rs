//! TEMPORARY
use crate::layout::Texture;
use glam::{Vec2, Vec4};
pub fn uv_set_of(t: &Texture) -> u32 {
    t.flags >> 4 & 1
}
pub fn sample_texture(texels: &[u32], t: &Texture, uv: Vec2, lod: f32) -> Vec4 {
    Vec4::new(uv.x, uv.y, lod, texels[t.first_texel as usize] as f32)
}
pub fn scalar_of(_t: &Texture, v: Vec4) -> f32 {
    v.x
}
