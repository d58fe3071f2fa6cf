//! Colours of facets in the attribute bytes of binary STL files. The format leaves these bytes without a meaning. Two
//! programs gave them one, and others followed: Materialise Magics, which says so in the header, and VisCAM with
//! SolidView, which mark each colour by its highest bit.

use glam::Vec3;

use crate::scene::model::texture::linear_of_srgb;

/// Begins the colour of the whole object, four bytes, in the header of Magics.
const MAGICS: &[u8] = b"COLOR=";
/// The bit that marks a colour in the attributes of VisCAM, and the object's colour in those of Magics.
const MARK: u16 = 1 << 15;
/// Least share of the facets that have the mark, in a file of VisCAM. Half of random numbers have it.
const LEAST_MARKED: f64 = 0.9;

/// Returns a linear colour for each facet, or nothing if the file has none. Facets of VisCAM without a colour are
/// white.
pub(super) fn of_attributes(header: &[u8], attributes: &[u16]) -> Vec<Vec3> {
    let place = header.windows(MAGICS.len()).position(|part| part == MAGICS);
    let of_object = place.and_then(|at| header[at + MAGICS.len()..].first_chunk());
    if let Some([r, g, b, _]) = of_object {
        let of_object = linear([*r, *g, *b].map(|part| f32::from(part) / 255.0));
        // 0 would be black, but programs also write it for facets that have the colour of the object.
        let is_own = |bits: u16| bits & MARK == 0 && bits != 0;
        return attributes.iter().map(|bits| if is_own(*bits) { low_bits_red(*bits) } else { of_object }).collect();
    }
    let n_marked = attributes.iter().filter(|bits| **bits & MARK != 0).count();
    // Memory that was never written is filled with one byte: 0xcd, 0xff.
    let is_filled =
        attributes.iter().all(|bits| *bits == attributes[0] && bits.to_le_bytes()[0] == bits.to_be_bytes()[0]);
    if n_marked == 0 || (n_marked as f64) < LEAST_MARKED * attributes.len() as f64 || is_filled {
        return Vec::new();
    }
    let colour = |bits: &u16| match bits & MARK {
        0 => Vec3::ONE,
        _ => {
            let [b, g, r] = low_bits_red(*bits).to_array();
            Vec3::new(r, g, b)
        }
    };
    attributes.iter().map(colour).collect()
}

/// Returns a linear colour of three times five bits, the lowest of which are red.
fn low_bits_red(bits: u16) -> Vec3 {
    linear([0, 5, 10].map(|shift| f32::from(bits >> shift & 31) / 31.0))
}

fn linear(srgb: [f32; 3]) -> Vec3 {
    Vec3::from_array(srgb.map(linear_of_srgb))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_two_programs_count_from_opposite_ends() {
        let red_of_viscam = MARK | 31 << 10;
        assert_eq!(of_attributes(b"", &[red_of_viscam, MARK | 31]), [Vec3::X, Vec3::Z]);
        let header = b"abc COLOR=\xff\xff\x00\xff,MATERIAL=";
        let of_magics = of_attributes(header, &[31, 31 << 10, MARK | 31, 0]);
        let yellow = Vec3::new(1.0, 1.0, 0.0);
        assert_eq!(of_magics, [Vec3::X, Vec3::Z, yellow, yellow]);
        // The header ends in the middle of the colour.
        assert_eq!(of_attributes(b"COLOR=\xff\xff", &[0]), []);
    }

    #[test]
    fn other_attributes_are_no_colours() {
        let random: Vec<u16> = (0..200_u32).map(|ix| (ix.wrapping_mul(2_654_435_761) >> 16) as u16).collect();
        for attributes in [&random[..], &[0; 9], &[0xcdcd; 9], &[0xffff; 9], &[7; 9], &[]] {
            assert_eq!(of_attributes(b"solid", attributes), [], "{attributes:?}");
        }
        let mut marked = [MARK | 5; 20];
        marked[3] = 0;
        assert_eq!(of_attributes(b"", &marked)[3], Vec3::ONE);
        marked[..3].fill(0);
        assert_eq!(of_attributes(b"", &marked), [], "a fifth has no mark");
    }
}
