//! Lookups in textures, whose texels are words of the array `texels`. Positions within an image and weights of texels
//! are multiples of 1/256, so all devices blend alike. Twin of `shading/texture.glsl`.

use glam::{IVec2, Vec2, Vec4};
use half::f16;

use crate::layout::{
    CHANNEL_ALPHA, CHANNEL_LUMINANCE, TEXTURE_CHANNEL_MASK, TEXTURE_CHANNEL_SHIFT, TEXTURE_HALVES,
    TEXTURE_MAX_COORDINATE, TEXTURE_NEAREST, TEXTURE_SRGB, TEXTURE_UV_SET, TEXTURE_WRAP_MASK, TEXTURE_WRAP_U_SHIFT,
    TEXTURE_WRAP_V_SHIFT, Texture, WRAP_CLAMP, WRAP_MIRROR,
};

/// Returns which of a triangle's sets of texture coordinates the texture uses, 0 or 1.
pub fn uv_set_of(map: &Texture) -> u32 {
    u32::from(map.flags & TEXTURE_UV_SET != 0)
}

/// Returns the width and the height of a mip level, texels.
pub fn size_of_mip(map: &Texture, mip: u32) -> [u32; 2] {
    [map.size & 0xffff, map.size >> 16].map(|size| (size >> mip).max(1))
}

/// Returns the wrap along an axis, `WRAP_REPEAT` and its like. `shift`: [`TEXTURE_WRAP_U_SHIFT`] or
/// [`TEXTURE_WRAP_V_SHIFT`].
fn wrap_of(map: &Texture, shift: u32) -> u32 {
    (map.flags >> shift) & TEXTURE_WRAP_MASK
}

/// Returns a texel: linear colour, and opacity.
pub fn texel(texels: &[u32], map: &Texture, mip: u32, x: u32, y: u32) -> Vec4 {
    let load = |word_ix: u32| texels[word_ix as usize];
    let texel_ix = y * size_of_mip(map, mip)[0] + x;
    let first = load(map.first_texel + mip);
    if map.flags & TEXTURE_HALVES != 0 {
        let word_ix = first + 2 * texel_ix;
        let [low, high] = [load(word_ix), load(word_ix + 1)];
        let half = |bits: u32| f16::from_bits(bits as u16).to_f32();
        return Vec4::new(half(low), half(low >> 16), half(high), half(high >> 16));
    }
    let bytes = load(first + texel_ix).to_le_bytes();
    let linear = Vec4::from_array(bytes.map(f32::from)) * (1.0 / 255.0);
    if map.flags & TEXTURE_SRGB == 0 {
        return linear;
    }
    let [r, g, b, _] = bytes.map(|byte| f32::from_bits(load(u32::from(byte))));
    Vec4::new(r, g, b, linear.w)
}

/// Returns the coordinate within one period of the image: 0..2 if every second copy is mirrored, otherwise 0..1.
fn folded(coordinate: f32, wrap: u32) -> f32 {
    const MOST: f32 = TEXTURE_MAX_COORDINATE;
    // NaN becomes 0.
    let bounded = if coordinate > 0.0 {
        coordinate.min(MOST)
    } else if coordinate < 0.0 {
        coordinate.max(-MOST)
    } else {
        0.0
    };
    match wrap {
        WRAP_CLAMP => bounded.clamp(0.0, 1.0),
        WRAP_MIRROR => bounded - 2.0 * (0.5 * bounded).floor(),
        _ => bounded - bounded.floor(),
    }
}

/// Returns the column or row of an image of `n` that is shown at an index. `index`: at most one outside of the period.
fn wrapped(mut index: i32, n: u32, wrap: u32) -> u32 {
    let size = n as i32;
    let period = if wrap == WRAP_MIRROR { 2 * size } else { size };
    if wrap == WRAP_CLAMP {
        index = index.clamp(0, size - 1);
    } else {
        if index < 0 {
            index += period;
        }
        if index >= period {
            index -= period;
        }
        if index >= size {
            index = period - 1 - index;
        }
    }
    // This holds anyway. It keeps the index in range on devices that have other rules for NaN.
    (index as u32).min(n - 1)
}

/// Returns the colour of a mip level at a place, with the texture's transform applied.
fn sample_mip(texels: &[u32], map: &Texture, mip: u32, place: Vec2) -> Vec4 {
    let [width, height] = size_of_mip(map, mip);
    let wrap_u = wrap_of(map, TEXTURE_WRAP_U_SHIFT);
    let wrap_v = wrap_of(map, TEXTURE_WRAP_V_SHIFT);
    let at = Vec2::new(folded(place.x, wrap_u), folded(place.y, wrap_v)) * Vec2::new(width as f32, height as f32);
    if map.flags & TEXTURE_NEAREST != 0 {
        let nearest = at.floor().as_ivec2();
        return texel(texels, map, mip, wrapped(nearest.x, width, wrap_u), wrapped(nearest.y, height, wrap_v));
    }
    // The centre of the first texel is 0.
    let steps = (at * 256.0 + 0.5).floor().as_ivec2() - 128;
    let low: IVec2 = steps >> 8;
    let weight = (steps & 255).as_vec2() * (1.0 / 256.0);
    let x0 = wrapped(low.x, width, wrap_u);
    let x1 = wrapped(low.x + 1, width, wrap_u);
    let y0 = wrapped(low.y, height, wrap_v);
    let y1 = wrapped(low.y + 1, height, wrap_v);
    let upper_left = texel(texels, map, mip, x0, y0);
    let lower_left = texel(texels, map, mip, x0, y1);
    let upper = upper_left + (texel(texels, map, mip, x1, y0) - upper_left) * weight.x;
    let lower = lower_left + (texel(texels, map, mip, x1, y1) - lower_left) * weight.x;
    upper + (lower - upper) * weight.y
}

/// Returns the linear colour and the opacity of a texture. `lod`: the mip level, of which a fraction blends two mip
/// levels. It is bounded to the texture's mip levels, and NaN is 0.
pub fn sample_texture(texels: &[u32], map: &Texture, uv: Vec2, lod: f32) -> Vec4 {
    let u = map.m00 * uv.x + map.m01 * uv.y + map.offset_u;
    let v = map.m10 * uv.x + map.m11 * uv.y + map.offset_v;
    let steps = if lod > 0.0 { (lod.min((map.n_mips - 1) as f32) * 256.0 + 0.5) as u32 } else { 0 };
    let mip = steps >> 8;
    let fine = sample_mip(texels, map, mip, Vec2::new(u, v));
    if steps & 255 == 0 {
        return fine;
    }
    let coarse = sample_mip(texels, map, mip + 1, Vec2::new(u, v));
    fine + (coarse - fine) * ((steps & 255) as f32 * (1.0 / 256.0))
}

/// Returns the number that a texture of one number shows. `value`: from [`sample_texture`].
pub fn scalar_of(map: &Texture, value: Vec4) -> f32 {
    let channel = (map.flags >> TEXTURE_CHANNEL_SHIFT) & TEXTURE_CHANNEL_MASK;
    if channel == CHANNEL_LUMINANCE {
        return 0.2126 * value.x + 0.7152 * value.y + 0.0722 * value.z;
    }
    value[channel.min(CHANNEL_ALPHA) as usize]
}

#[cfg(test)]
mod tests {
    use glam::{Affine2, vec2};

    use super::*;
    use crate::{
        scene::{self, Channel, Encoding, Image, Material, Pixels, Wrap},
        world::{TextureArrays, arrays_of, scene_of},
    };

    /// Returns the arrays of a scene with one material, which has one texture.
    fn arrays(image: (u32, u32, Pixels), texture: scene::Texture) -> TextureArrays {
        let (width, height, pixels) = image;
        let image = Image { name: "image".to_owned(), width, height, pixels, is_linear: false };
        let mut material = Material::default();
        material.maps.base_colour = Some(texture);
        arrays_of(&scene_of(vec![image], vec![material])).unwrap().0
    }

    /// Samples the only texture.
    fn sample(arrays: &TextureArrays, u: f32, v: f32, lod: f32) -> Vec4 {
        sample_texture(&arrays.texels, &arrays.textures[0], vec2(u, v), lod)
    }

    /// Four texels in a row, whose red is 0, 1/5, 2/5 and 3/5, with a repeated second row of green 1.
    fn row() -> (u32, u32, Pixels) {
        let texel = |i: u8| [51 * (i % 4), 255 * (i / 4), 0, 255];
        (4, 2, Pixels::Bytes((0..8).map(texel).collect()))
    }

    fn data() -> scene::Texture {
        scene::Texture::of_data(0, Channel::Red)
    }

    fn assert_near(found: f32, expected: f32) {
        assert!((found - expected).abs() < 1e-6, "{found} is not {expected}");
    }

    #[test]
    fn a_texel_shows_its_colour_at_its_centre() {
        let arrays = arrays(row(), data());
        for i in 0..8 {
            let (x, y) = (i % 4, i / 4);
            let colour = sample(&arrays, (x as f32 + 0.5) / 4.0, (y as f32 + 0.5) / 2.0, 0.0);
            assert_eq!(colour, Vec4::new(51.0 * x as f32 * (1.0 / 255.0), y as f32, 0.0, 1.0));
        }
        let srgb = super::tests::arrays(row(), scene::Texture { encoding: Encoding::Srgb, ..data() });
        let expected = (((51.0 / 255.0_f64) + 0.055) / 1.055).powf(2.4) as f32;
        assert_eq!(sample(&srgb, 0.375, 0.25, 0.0), Vec4::new(expected, 0.0, 0.0, 1.0));
    }

    #[test]
    fn neighbours_are_blended_by_their_distance() {
        let arrays = arrays(row(), data());
        assert_near(sample(&arrays, 0.5, 0.25, 0.0).x, 0.3);
        // A quarter of the way from texel 1 to texel 2, and half way between the rows.
        let colour = sample(&arrays, (1.5 + 0.25) / 4.0, 0.5, 0.0);
        assert_near(colour.x, 0.25);
        assert_near(colour.y, 0.5);
        let nearest = super::tests::arrays(row(), scene::Texture { is_smooth: false, ..data() });
        assert_near(sample(&nearest, 0.499, 0.25, 0.0).x, 0.2);
        assert_near(sample(&nearest, 0.501, 0.25, 0.0).x, 0.4);
    }

    /// -0.25 is the border between the copy's texels 2 and 3, and 1.25 that between 0 and 1.
    #[test]
    fn an_image_continues_as_its_wrap_says() {
        let cases = [(Wrap::Repeat, 0.5, 0.1), (Wrap::Mirror, 0.1, 0.5), (Wrap::Clamp, 0.0, 0.6)];
        for (wrap, before, after) in cases {
            let arrays = arrays(row(), scene::Texture { wrap: [wrap, Wrap::Repeat], ..data() });
            assert_near(sample(&arrays, -0.25, 0.25, 0.0).x, before);
            assert_near(sample(&arrays, 1.25, 0.25, 0.0).x, after);
        }
        // At the image's edge, a repeated image blends its last texel with its first one; the others show one texel.
        for (wrap, edge) in [(Wrap::Repeat, 0.3), (Wrap::Mirror, 0.6), (Wrap::Clamp, 0.6)] {
            let arrays = arrays(row(), scene::Texture { wrap: [wrap; 2], ..data() });
            assert_near(sample(&arrays, 1.0, 0.25, 0.0).x, edge);
        }
        // Along v, mirrored: 1.25 is 0.75, the second row, and -0.25 is the first one.
        let mirrored = arrays(row(), scene::Texture { wrap: [Wrap::Repeat, Wrap::Mirror], ..data() });
        assert_eq!([sample(&mirrored, 0.5, 1.25, 0.0).y, sample(&mirrored, 0.5, -0.25, 0.0).y], [1.0, 0.0]);
    }

    #[test]
    fn wild_coordinates_stay_in_range() {
        let wild = [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, 1e30, -1e30, 1048576.0, -1e-20, 0.99999994, 1.0, -0.0];
        for wrap in [Wrap::Repeat, Wrap::Mirror, Wrap::Clamp] {
            for is_smooth in [true, false] {
                for image in [row(), (1, 1, Pixels::Bytes(vec![[9; 4]]))] {
                    let arrays = arrays(image, scene::Texture { wrap: [wrap; 2], is_smooth, ..data() });
                    for (u, v, lod) in wild.iter().flat_map(|u| wild.map(|v| (*u, v, *u))) {
                        assert!(sample(&arrays, u, v, lod).is_finite());
                    }
                }
            }
        }
        let clamped = arrays(row(), scene::Texture { wrap: [Wrap::Clamp; 2], ..data() });
        assert_near(sample(&clamped, f32::INFINITY, 0.25, 0.0).x, 0.6);
    }

    /// The row's next mip level has the texels 0.1 and 0.5 (25.5 and 127.5 of 255, rounded up), and one half of green.
    #[test]
    fn mips_are_blended() {
        let arrays = arrays(row(), data());
        assert_eq!(arrays.textures[0].n_mips, 3);
        let [fine, coarse, last] = [0.0, 1.0, 2.0].map(|lod| sample(&arrays, 0.25, 0.25, lod).x);
        assert_near(fine, 0.1);
        assert_near(coarse, 26.0 / 255.0);
        assert_near(last, 77.0 / 255.0);
        assert_near(sample(&arrays, 0.25, 0.25, 1.25).x, coarse + 0.25 * (last - coarse));
        assert_eq!([-3.0, 99.0].map(|lod| sample(&arrays, 0.25, 0.25, lod).x), [fine, last]);
    }

    #[test]
    fn halves_are_kept_and_srgb_is_decoded() {
        let bits = |value: f32| f16::from_f32(value).to_bits();
        let pixels = || Pixels::Halves(vec![[1000.0, -2.0, 0.125, 0.5].map(bits), [0.5, 0.5, 0.5, 1.0].map(bits)]);
        let linear = arrays((2, 1, pixels()), data());
        assert_eq!(sample(&linear, 0.25, 0.5, 0.0), Vec4::new(1000.0, -2.0, 0.125, 0.5));
        // The opacities 0.5 and 1 weight the two colours.
        assert!(
            (sample(&linear, 0.25, 0.5, 1.0) - Vec4::new(333.667, -1.0 / 3.0, 0.375, 0.75)).abs().max_element() < 0.2
        );
        let srgb = arrays((2, 1, pixels()), scene::Texture { encoding: Encoding::Srgb, ..data() });
        let colour = sample(&srgb, 0.75, 0.5, 0.0);
        assert!((colour - Vec4::new(0.21404, 0.21404, 0.21404, 1.0)).abs().max_element() < 1e-4, "{colour}");
    }

    #[test]
    fn coordinates_are_transformed_first() {
        let moved = scene::Texture { transform: Affine2::from_translation(vec2(0.25, 0.5)), ..data() };
        let moved = arrays(row(), moved);
        assert_near(sample(&moved, 0.125, 0.25, 0.0).x, 0.2);
        assert_eq!(sample(&moved, 0.125, 0.25, 0.0).y, 1.0);
        // A quarter turn: u is the old v, and v the old -u.
        let turn = Affine2::from_cols(vec2(0.0, -1.0), vec2(1.0, 0.0), vec2(0.0, 0.0));
        let turned = arrays(row(), scene::Texture { transform: turn, ..data() });
        let colour = sample(&turned, 0.25, 0.625, 0.0);
        assert_near(colour.x, 0.4);
        assert_eq!(colour.y, 1.0);
    }

    #[test]
    fn a_texture_of_one_number_reads_its_channel() {
        let value = Vec4::new(0.5, 0.25, 0.75, 0.125);
        let channels = [
            (Channel::Red, 0.5),
            (Channel::Green, 0.25),
            (Channel::Blue, 0.75),
            (Channel::Alpha, 0.125),
            (Channel::Luminance, 0.2126 * 0.5 + 0.7152 * 0.25 + 0.0722 * 0.75),
        ];
        for (channel, expected) in channels {
            let arrays = arrays(row(), scene::Texture { channel, ..data() });
            assert_near(scalar_of(&arrays.textures[0], value), expected);
        }
    }
}
