//! The extension KHR_materials_pbrSpecularGlossiness, which many older files have: a dielectric whose reflectance along
//! the normal is stated. A metal has a high reflectance and a black diffuse colour. The image of glossiness is turned
//! into one of roughness.

use half::f16;

use crate::scene::model::Pixels;

/// Factor that makes of the reflectance along the normal the factor of the 0.04 that the index 1.5 stands for.
pub(super) const SPECULAR_SCALE: f32 = 25.0;

/// Turns the opacity of an image, which is its glossiness, into greys of the roughness: 1 - `factor` times opacity.
pub(super) fn turn_into_roughness(pixels: &mut Pixels, factor: f32) {
    match pixels {
        Pixels::Bytes(pixels) => {
            for pixel in pixels {
                let rough = (255.0 - factor * f32::from(pixel[3])).round() as u8;
                *pixel = [rough, rough, rough, 255];
            }
        }
        Pixels::Halves(pixels) => {
            for pixel in pixels {
                let rough = f16::from_f32(1.0 - factor * f16::from_bits(pixel[3]).to_f32().clamp(0.0, 1.0)).to_bits();
                *pixel = [rough, rough, rough, f16::ONE.to_bits()];
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_glossy_is_not_rough() {
        let mut bytes = Pixels::Bytes(vec![[9, 8, 7, 255], [0, 0, 0, 0], [1, 1, 1, 51]]);
        turn_into_roughness(&mut bytes, 0.5);
        assert_eq!(bytes, Pixels::Bytes(vec![[128, 128, 128, 255], [255; 4], [230, 230, 230, 255]]));
        let half = |value: f32| f16::from_f32(value).to_bits();
        let mut halves = Pixels::Halves(vec![[half(0.3), 0, 0, half(0.25)]]);
        turn_into_roughness(&mut halves, 1.0);
        assert_eq!(halves, Pixels::Halves(vec![[half(0.75), half(0.75), half(0.75), half(1.0)]]));
    }
}
