//! Unit vectors in 32 bits: octahedral coordinates as two snorm16, the first in the low half.
//!
//! After Cigolle et al., "A Survey of Efficient Representations for Independent Unit Vectors" (JCGT 2014). Largest
//! angular error: below 0.006 degrees.

use glam::{Vec2, Vec3};

use super::FLAT_NORMAL;

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

/// The largest coordinate from which on a vector has a direction for [`encode_exactly`]: 2^-100.
const LEAST_LENGTH: f32 = f32::from_bits((127 - 100) << 23);

/// Encodes a direction of any length by additions and multiplications alone, which hosts and devices round alike:
/// Newton's iteration takes the place of the division. Returns [`FLAT_NORMAL`] if the vector has no direction. Twin of
/// `encode_exactly` in `glsl/passes/deform_vertices.comp`.
///
/// On the border of the square, two codes stand for each direction. The one with the larger other half is returned.
pub fn encode_exactly(v: Vec3) -> u32 {
    let largest = v.abs().max_element();
    let scaled = v * scale_to_one(largest);
    let sum = scaled.x.abs() + scaled.y.abs() + scaled.z.abs();
    // Devices may flush numbers below 2^-126 to zero. Beside 2^-100, they are below what the code tells apart.
    if !(largest >= LEAST_LENGTH && sum < f32::INFINITY) {
        return FLAT_NORMAL;
    }
    // The first guess is off by an eighth; each iteration squares the error.
    let mut reciprocal = f32::from_bits(0x7ef3_11c7 - sum.to_bits());
    for _ in 0..4 {
        reciprocal *= 2.0 - sum * reciprocal;
    }
    let p = Vec2::new(scaled.x * reciprocal, scaled.y * reciprocal);
    let sign = |a: f32| if a < 0.0 { -1.0 } else { 1.0 };
    let is_below = scaled.z < -f32::EPSILON;
    let folded = Vec2::new((1.0 - p.y.abs()) * sign(p.x), (1.0 - p.x.abs()) * sign(p.y));
    let [x, y] =
        (if is_below { folded } else { p }).to_array().map(|x| (x.clamp(-1.0, 1.0) * 32767.0 + 0.5).floor() as i32);
    let [x, y] = [if y.abs() == 32767 { x.abs() } else { x }, if x.abs() == 32767 { y.abs() } else { y }];
    (x & 0xffff) as u32 | ((y & 0xffff) as u32) << 16
}

/// Decodes what [`encode_exactly`] returns. Both ways of encoding lead from the result back to the code.
pub fn decode_exactly(code: u32) -> Vec3 {
    if code == FLAT_NORMAL {
        return Vec3::ZERO;
    }
    let is_on_border = |half: u32| (half as i16).unsigned_abs() >= 32767;
    let n = decode_octahedral(code);
    // There, rounding decides the sign of a coordinate that is 0.
    Vec3::new(
        if is_on_border(code >> 16) { 0.0 } else { n.x },
        if is_on_border(code & 0xffff) { 0.0 } else { n.y },
        n.z,
    )
}

/// Returns the power of two that scales a positive number to at least 1 and below 2, or nearly so for the largest and
/// the smallest numbers.
pub(crate) fn scale_to_one(largest: f32) -> f32 {
    f32::from_bits((254 - (largest.to_bits() >> 23).clamp(1, 253)) << 23)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns many directions of many lengths, among them those between the octahedron's faces.
    fn directions() -> Vec<Vec3> {
        let mut found = Vec::new();
        let steps = [-1.0, -0.7, -1e-3, -2e-5, -1e-5, -1e-7, -0.0, 0.0, 1e-7, 1e-5, 2e-5, 1e-3, 0.7, 1.0];
        for x in steps {
            found.extend(steps.into_iter().flat_map(|y| steps.map(|z| Vec3::new(x, y, z))));
        }
        let mut state = 1_u64;
        let mut unit = || {
            state = state.wrapping_mul(0x5851_f42d_4c95_7f2d).wrapping_add(0x1405_7b7e_f767_814f);
            (state >> 40) as f32 / (1 << 23) as f32 - 1.0
        };
        found.extend((0..200_000).map(|_| Vec3::new(unit(), unit(), unit())));
        found.into_iter().flat_map(|v| [v, 1e-20 * v, 1e30 * v]).collect()
    }

    #[test]
    fn exact_codes_are_those_of_their_directions() {
        for v in directions().into_iter().filter(|v| v.abs().max_element() > 1e-30) {
            let code = encode_exactly(v);
            let unit = v.as_dvec3().normalize().as_vec3();
            assert!((decode_octahedral(code) - unit).length() < 1.1e-4, "{v}: {code:#x}");
            // Where both ways have the same rounding, the codes are the same but on the border.
            assert!((decode_octahedral(encode_octahedral(unit)) - unit).length() < 1.1e-4, "{v}");
        }
    }

    #[test]
    fn exact_codes_are_found_again() {
        for v in directions() {
            let code = encode_exactly(v);
            let decoded = decode_exactly(code);
            assert_eq!(encode_exactly(decoded), code, "{v}");
            let again = |n: Vec3| if n == Vec3::ZERO { FLAT_NORMAL } else { encode_octahedral(n) };
            assert_eq!(again(decoded.as_dvec3().normalize_or_zero().as_vec3()), code, "{v}");
            // Tangents have the side of the bitangent in the lowest bit.
            if code != FLAT_NORMAL {
                let decoded = decode_exactly(code & !1);
                assert_eq!(encode_octahedral(decoded.as_dvec3().normalize().as_vec3()) & !1, code & !1, "{v}");
            }
        }
    }

    #[test]
    fn vectors_without_a_direction_have_no_code() {
        for v in [Vec3::ZERO, Vec3::NAN, Vec3::new(1.0, f32::NAN, 0.0), Vec3::INFINITY, Vec3::splat(1e-37)] {
            assert_eq!(encode_exactly(v), FLAT_NORMAL, "{v}");
        }
        assert_eq!(decode_exactly(FLAT_NORMAL), Vec3::ZERO);
    }
}
