//! The textures of a scene as kernels read them: one array of texels, one of textures, and which of the textures each
//! material has.

use std::{cell::OnceCell, collections::HashMap};

use rayon::prelude::*;

use super::{
    Mismatch,
    mips::{self, Coding, Mean},
};
use crate::{
    layout::{
        CHANNEL_ALPHA, CHANNEL_BLUE, CHANNEL_GREEN, CHANNEL_LUMINANCE, CHANNEL_RED, MaterialMaps, NO_TEXTURE,
        TEXTURE_CHANNEL_SHIFT, TEXTURE_HALVES, TEXTURE_NEAREST, TEXTURE_SRGB, TEXTURE_UV_SET, TEXTURE_WRAP_U_SHIFT,
        TEXTURE_WRAP_V_SHIFT, Texture, WRAP_CLAMP, WRAP_MIRROR, WRAP_REPEAT,
    },
    scene::{self, Alpha, Channel, Encoding, Image, Material, Scene, Wrap},
    util::memory,
};

/// The most words of texels: indices of words are words themselves.
const MAX_WORDS: u64 = u32::MAX as u64 - 1;
/// The most texels along a side of an image, whose size is stored in 16 bits.
const MAX_SIDE: u32 = 65_535;

/// The arrays that lookups in textures read. Both are empty if no material has a texture.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct TextureArrays {
    /// The linear values of the bytes that sRGB encodes, as bits of floats. The mip levels of each image follow.
    pub texels: Vec<u32>,
    /// The textures. No two of them are equal.
    pub textures: Vec<Texture>,
}

/// Tells which images of a scene have pixels that are not opaque. It looks at the pixels of an image when it is first
/// asked about that image.
pub struct Opacities<'a> {
    images: &'a [Image],
    known: Vec<OnceCell<bool>>,
}

impl<'a> Opacities<'a> {
    pub fn new(images: &'a [Image]) -> Self {
        Self { images, known: vec![OnceCell::new(); images.len()] }
    }

    /// Returns whether some pixel of the image at the index is not opaque. If there is no such image, none is.
    pub fn is_see_through(&self, image_ix: usize) -> bool {
        self.known.get(image_ix).is_some_and(|known| *known.get_or_init(|| self.images[image_ix].is_see_through()))
    }
}

/// Converts the textures of a scene for kernels, on the current rayon pool. Also returns the textures of each material.
/// Images that no texture shows are left out.
///
/// # Errors
/// A texture names an image or a set of coordinates that does not exist, an image's pixels do not have the number that
/// its size says, or the images are too large together for indices of 32 bits or for the memory.
pub fn texture_arrays(scene: &Scene, opacities: &Opacities) -> Result<(TextureArrays, Vec<MaterialMaps>), Mismatch> {
    let layout = TexelLayout::new(scene, opacities)?;
    let mut textures = Textures::default();
    let maps = scene.materials.iter().map(|material| textures.maps_of(material, scene, &layout)).collect();
    Ok((TextureArrays { texels: layout.texels(), textures: textures.list }, maps))
}

/// How the mip levels of an image are made.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
struct Making {
    image_ix: u32,
    encoding: Encoding,
    mean: Mean,
}

impl Making {
    /// `texture`: one of the material's. `image`: the image that it shows.
    fn of(texture: &scene::Texture, material: &Material, image: &Image, opacities: &Opacities) -> Self {
        let is_colour = material.maps.base_colour.as_ref().is_some_and(|map| std::ptr::eq(map, texture));
        // Elsewhere, the opacity of an image says nothing about its other channels.
        let has_opacity = is_colour && material.alpha != Alpha::Opaque;
        let is_seen_in_part = has_opacity && opacities.is_see_through(texture.image_ix as usize);
        let mean = if is_seen_in_part { Mean::OfSeen } else { Mean::OfAll };
        Self { image_ix: texture.image_ix, encoding: image.encoding(texture.encoding), mean }
    }
}

/// An image's mip levels, and where they are in the array of texels.
struct Stored<'a> {
    image: &'a Image,
    making: Making,
    first_word: u32,
    n_words: usize,
}

/// The images that textures show.
struct TexelLayout<'a> {
    /// In the order of the array.
    list: Vec<Stored<'a>>,
    /// Index into `list`.
    ix_of: HashMap<Making, usize>,
    n_words: usize,
    opacities: &'a Opacities<'a>,
}

impl<'a> TexelLayout<'a> {
    fn new(scene: &'a Scene, opacities: &'a Opacities<'a>) -> Result<Self, Mismatch> {
        let (mut list, mut ix_of) = (Vec::new(), HashMap::new());
        let mut n_words = mips::SRGB.len() as u64;
        for (material_ix, material) in scene.materials.iter().enumerate() {
            for texture in material.maps.textures() {
                let image = image_of(scene, material_ix, texture)?;
                let making = Making::of(texture, material, image, opacities);
                if ix_of.contains_key(&making) {
                    continue;
                }
                let n_mip_words = mips::n_words(image, Coding::of(image, making.encoding));
                let stored = Stored { image, making, first_word: n_words as u32, n_words: n_mip_words as usize };
                n_words += n_mip_words;
                if n_words > MAX_WORDS {
                    return Err(Mismatch::Textures(format!("they need more than {MAX_WORDS} words")));
                }
                ix_of.insert(making, list.len());
                list.push(stored);
            }
        }
        if list.is_empty() {
            n_words = 0;
        }
        memory::require("the array of texels", 4 * n_words).map_err(|error| Mismatch::Textures(error.to_string()))?;
        Ok(Self { list, ix_of, n_words: n_words as usize, opacities })
    }

    /// Returns the array of texels.
    fn texels(&self) -> Vec<u32> {
        let mut texels = vec![0; self.n_words];
        if self.list.is_empty() {
            return texels;
        }
        let (table, mut rest) = texels.split_at_mut(mips::SRGB.len());
        table.iter_mut().zip(*mips::SRGB).for_each(|(word, value)| *word = value.to_bits());
        let mut parts = Vec::with_capacity(self.list.len());
        for stored in &self.list {
            let (part, after) = rest.split_at_mut(stored.n_words);
            parts.push((stored, part));
            rest = after;
        }
        parts.into_par_iter().for_each(|(stored, words)| {
            let Making { encoding, mean, .. } = stored.making;
            mips::write(stored.image, encoding, mean, words, stored.first_word);
        });
        texels
    }
}

/// Checks a texture and returns its image.
fn image_of<'a>(scene: &'a Scene, material_ix: usize, texture: &scene::Texture) -> Result<&'a Image, Mismatch> {
    let wrong = |what: String| Mismatch::Texture { material: material_ix, what };
    let &scene::Texture { image_ix, uv_set, .. } = texture;
    if uv_set > 1 {
        return Err(wrong(format!("it uses texture coordinates {uv_set}, which is not 0 or 1")));
    }
    let n_images = scene.images.len();
    let image = scene.images.get(image_ix as usize);
    let image = image.ok_or_else(|| wrong(format!("it shows image {image_ix}, but there are {n_images} images")))?;
    let &Image { width, height, ref pixels, ref name, .. } = image;
    let n_pixels = pixels.len();
    let is_size = (1..=MAX_SIDE).contains(&width) && (1..=MAX_SIDE).contains(&height);
    if !is_size || u64::from(width) * u64::from(height) != n_pixels as u64 {
        let what = format!("its size is {width} x {height}, and it has {n_pixels} pixels");
        return Err(Mismatch::Image { image: image_ix as usize, name: name.clone(), what });
    }
    Ok(image)
}

/// Textures that are listed once.
#[derive(Default)]
struct Textures {
    list: Vec<Texture>,
    /// Index into `list` for the words of each texture.
    ix_of: HashMap<[u32; 12], u32>,
}

impl Textures {
    /// Returns the textures of a material, and lists those that are new.
    fn maps_of(&mut self, material: &Material, scene: &Scene, layout: &TexelLayout) -> MaterialMaps {
        let mut index = |texture: &Option<scene::Texture>| match texture {
            Some(texture) => self.index_of(texture_of(texture, material, scene, layout)),
            None => NO_TEXTURE,
        };
        let maps = &material.maps;
        MaterialMaps {
            base_colour: index(&maps.base_colour),
            opacity: index(&maps.opacity),
            specular: index(&maps.specular),
            specular_factor: index(&maps.specular_factor),
            emission: index(&maps.emission),
            normal: index(&maps.normal),
            roughness: index(&maps.roughness),
            metallic: index(&maps.metallic),
            transmission: index(&maps.transmission),
            occlusion: index(&maps.occlusion),
            normal_scale: maps.normal_scale,
            occlusion_strength: maps.occlusion_strength,
            alpha_cutoff: if let Alpha::Mask(cutoff) = material.alpha { cutoff } else { 0.0 },
            opacity_factor: material.d,
            flags: 0,
            coverage: 1.0,
        }
    }

    fn index_of(&mut self, texture: Texture) -> u32 {
        *self.ix_of.entry(bytemuck::cast(texture)).or_insert_with(|| {
            self.list.push(texture);
            (self.list.len() - 1) as u32
        })
    }
}

/// Returns a texture of a material as kernels read it.
fn texture_of(texture: &scene::Texture, material: &Material, scene: &Scene, layout: &TexelLayout) -> Texture {
    let image = &scene.images[texture.image_ix as usize];
    let making = Making::of(texture, material, image, layout.opacities);
    let stored = &layout.list[layout.ix_of[&making]];
    let (matrix, offset) = (texture.transform.matrix2, texture.transform.translation);
    Texture {
        m00: matrix.x_axis.x,
        m01: matrix.y_axis.x,
        offset_u: offset.x,
        first_texel: stored.first_word,
        m10: matrix.x_axis.y,
        m11: matrix.y_axis.y,
        offset_v: offset.y,
        size: image.width | image.height << 16,
        flags: flags_of(texture, Coding::of(image, making.encoding)),
        n_mips: mips::sizes(image.width, image.height).count() as u32,
        reserved0: 0,
        reserved1: 0,
    }
}

/// Returns the flags of a [`Texture`].
fn flags_of(texture: &scene::Texture, coding: Coding) -> u32 {
    let flag = |is_set: bool, flag: u32| if is_set { flag } else { 0 };
    let [wrap_u, wrap_v] = texture.wrap.map(|wrap| match wrap {
        Wrap::Repeat => WRAP_REPEAT,
        Wrap::Mirror => WRAP_MIRROR,
        Wrap::Clamp => WRAP_CLAMP,
    });
    let channel = match texture.channel {
        Channel::Red => CHANNEL_RED,
        Channel::Green => CHANNEL_GREEN,
        Channel::Blue => CHANNEL_BLUE,
        Channel::Alpha => CHANNEL_ALPHA,
        Channel::Luminance => CHANNEL_LUMINANCE,
    };
    wrap_u << TEXTURE_WRAP_U_SHIFT
        | wrap_v << TEXTURE_WRAP_V_SHIFT
        | channel << TEXTURE_CHANNEL_SHIFT
        | flag(texture.uv_set == 1, TEXTURE_UV_SET)
        | flag(coding == Coding::Srgb, TEXTURE_SRGB)
        | flag(coding == Coding::Halves, TEXTURE_HALVES)
        | flag(!texture.is_smooth, TEXTURE_NEAREST)
}

#[cfg(test)]
pub(crate) mod tests {
    use std::path::Path;

    use super::*;
    use crate::{
        layout::{SRGB_TABLE_SIZE, TEXTURE_WRAP_MASK},
        scene::Pixels,
    };

    fn image(width: u32, height: u32) -> Image {
        let pixels = Pixels::Bytes(vec![[255, 0, 0, 255]; (width * height) as usize]);
        Image { name: "image".to_owned(), width, height, pixels, is_linear: false }
    }

    /// Returns a scene without triangles.
    pub(crate) fn scene_of(images: Vec<Image>, materials: Vec<Material>) -> Scene {
        Scene { images, materials, ..Scene::empty(Path::new("scene")) }
    }

    pub(crate) fn arrays_of(scene: &Scene) -> Result<(TextureArrays, Vec<MaterialMaps>), Mismatch> {
        texture_arrays(scene, &Opacities::new(&scene.images))
    }

    fn with(change: impl FnOnce(&mut Material)) -> Material {
        let mut material = Material::default();
        change(&mut material);
        material
    }

    #[test]
    fn a_scene_without_textures_has_no_texels() {
        let scene = scene_of(vec![image(4, 4)], vec![with(|it| (it.alpha, it.d) = (Alpha::Mask(0.25), 0.5))]);
        let (arrays, maps) = arrays_of(&scene).unwrap();
        assert_eq!(arrays, TextureArrays::default());
        assert_eq!((maps[0].base_colour, maps[0].occlusion), (NO_TEXTURE, NO_TEXTURE));
        assert_eq!((maps[0].alpha_cutoff, maps[0].opacity_factor), (0.25, 0.5));
    }

    #[test]
    fn images_and_textures_are_stored_once() {
        let colour = scene::Texture::of_image(1);
        let mirrored = scene::Texture { wrap: [Wrap::Repeat, Wrap::Mirror], uv_set: 1, ..colour.clone() };
        let data = scene::Texture::of_data(1, Channel::Blue);
        let first = with(|it| (it.maps.base_colour, it.maps.normal) = (Some(colour.clone()), Some(data.clone())));
        let second = with(|it| {
            (it.maps.base_colour, it.maps.emission, it.maps.roughness) = (Some(colour), Some(mirrored), Some(data));
            it.maps.normal_scale = 2.0;
        });
        let (arrays, maps) = arrays_of(&scene_of(vec![image(9, 9), image(4, 2)], vec![first, second])).unwrap();
        // The image of 8, 2 and 1 texels is stored as sRGB and as linear numbers, the unused one not at all.
        assert_eq!(arrays.texels.len(), SRGB_TABLE_SIZE as usize + 2 * (3 + 8 + 2 + 1));
        assert_eq!((maps[0].base_colour, maps[0].normal, maps[0].emission), (0, 1, NO_TEXTURE));
        assert_eq!((maps[1].base_colour, maps[1].emission, maps[1].roughness, maps[1].normal_scale), (0, 2, 1, 2.0));
        let [colour, data, mirrored] = arrays.textures[..] else { panic!("{:?}", arrays.textures) };
        assert_eq!((colour.first_texel, data.first_texel, mirrored.first_texel), (256, 270, 256));
        assert_eq!((colour.size, colour.n_mips, colour.flags), (4 | 2 << 16, 3, TEXTURE_SRGB));
        assert_eq!(data.flags, CHANNEL_BLUE << TEXTURE_CHANNEL_SHIFT);
        assert_eq!((mirrored.flags >> TEXTURE_WRAP_V_SHIFT) & TEXTURE_WRAP_MASK, WRAP_MIRROR);
        assert_eq!(mirrored.flags & (TEXTURE_UV_SET | TEXTURE_SRGB), TEXTURE_UV_SET | TEXTURE_SRGB);
        assert_eq!(arrays.texels[255], 1.0_f32.to_bits());
        assert_eq!(arrays.texels[256..259], [259, 267, 269]);
    }

    #[test]
    fn only_see_through_colours_are_averaged_by_opacity() {
        let texture = || Some(scene::Texture::of_image(0));
        let leaf = with(|it| {
            (it.maps.base_colour, it.maps.emission, it.alpha) = (texture(), texture(), Alpha::Mask(0.5));
        });
        let bark = with(|it| (it.maps.base_colour, it.alpha) = (texture(), Alpha::Opaque));
        let pixels = Pixels::Bytes(vec![[200, 0, 0, 255], [0, 0, 0, 0]]);
        let (arrays, maps) = arrays_of(&scene_of(vec![Image { pixels, ..image(2, 1) }], vec![leaf, bark])).unwrap();
        let smaller_mip = |map: u32| {
            let first = arrays.textures[map as usize].first_texel as usize;
            arrays.texels[arrays.texels[first + 1] as usize].to_le_bytes()
        };
        assert_eq!(smaller_mip(maps[0].base_colour), [200, 0, 0, 128]);
        assert_eq!(smaller_mip(maps[0].emission), [146, 0, 0, 128]);
        assert_eq!(maps[1].base_colour, maps[0].emission);
    }

    #[test]
    fn what_does_not_fit_together_is_refused() {
        let refusal = |images, texture| {
            let scene = scene_of(images, vec![Material::default(), with(|it| it.maps.metallic = Some(texture))]);
            arrays_of(&scene).unwrap_err().to_string()
        };
        let missing = refusal(vec![image(1, 1)], scene::Texture::of_image(1));
        assert_eq!(missing, "a texture of material 1: it shows image 1, but there are 1 images");
        let set = refusal(vec![image(1, 1)], scene::Texture { uv_set: 2, ..scene::Texture::of_image(0) });
        assert_eq!(set, "a texture of material 1: it uses texture coordinates 2, which is not 0 or 1");
        let short = refusal(vec![Image { width: 2, ..image(1, 1) }], scene::Texture::of_image(0));
        assert_eq!(short, "image 0 of the scene, `image`: its size is 2 x 1, and it has 1 pixels");
        let empty = refusal(vec![image(0, 1)], scene::Texture::of_image(0));
        assert!(empty.contains("its size is 0 x 1"), "{empty}");
    }
}
