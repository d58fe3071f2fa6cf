//! Unit vectors in 32 bits: octahedral coordinates as two snorm16, the first in the low half.
//!
//! After Cigolle et al., "A Survey of Efficient Representations for Independent Unit Vectors" (JCGT 2014). Largest
//! angular error: below 0.006 degrees.

use glam::{Vec2, Vec3};

/// Encodes a direction as two snorm16, in the layout of GLSL's `packSnorm2x16`. No direction encodes to
/// `FLAT_NORMAL`, since no half is ever 0x8000.
///
/// `n` need not have unit length. A zero vector and one with a NaN encode +z. One with an infinity encodes some unit
/// vector.
pub fn encode_octahedral(n: Vec3) -> u32 {
    let p = n / (n.x.abs() + n.y.abs() + n.z.abs());
    let folded = if p.z >= 0.0 { Vec2::new(p.x, p.y) } else { Vec2::new(fold(p.x, p.y), fold(p.y, p.x)) };
    u32::from(snorm16(folded.x)) | u32::from(snorm16(folded.y)) << 16
}

/// Decodes a unit vector, by the same steps as the kernels.
pub fn decode_octahedral(encoded: u32) -> Vec3 {
    let x = from_snorm16(encoded as u16);
    let y = from_snorm16((encoded >> 16) as u16);
    let z = 1.0 - x.abs() - y.abs();
    let below = (-z).max(0.0);
    Vec3::new(x - below.copysign(x), y - below.copysign(y), z).normalize()
}

/// Folds one coordinate of the lower half over the octahedron's edge. `b` is the other coordinate.
fn fold(a: f32, b: f32) -> f32 {
    (1.0 - b.abs()).copysign(a)
}

/// Maps -1..=1 to -32767..=32767 and returns the bits. A NaN becomes 0.
fn snorm16(x: f32) -> u16 {
    (x.clamp(-1.0, 1.0) * 32767.0).round() as i16 as u16
}

/// Decodes one half as GLSL's `unpackSnorm2x16` does.
fn from_snorm16(bits: u16) -> f32 {
    (f32::from(bits as i16) / 32767.0).clamp(-1.0, 1.0)
}
