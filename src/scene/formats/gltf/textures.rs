//! Textures of materials, and the images that they use.

use glam::{Affine2, Vec2};
use gltf::json::{
    self, Index,
    extensions::texture::TextureTransform,
    texture::{MagFilter, Sampler, WrappingMode},
    validation::Checked::{self as Word, Valid},
};
use hashbrown::HashMap;
use serde_json::Map;

use super::{
    document::{Document, ImageSource, LEFT_OUT, item},
    glossiness::turn_into_roughness,
    uri::is_data,
};
use crate::scene::{
    formats::image::{Encoded, decode_all, has_header},
    model::{Channel, Encoding, Image, Material, Texture, Wrap, error::Checked},
};

/// A reference to a texture.
pub(super) struct TextureUse {
    index: Index<json::Texture>,
    uv_set: u32,
    transform: Option<TextureTransform>,
}

impl TextureUse {
    pub fn of(info: &json::texture::Info) -> Self {
        let transform = info.extensions.as_ref().and_then(|extensions| extensions.texture_transform.clone());
        Self { index: info.index, uv_set: info.tex_coord, transform }
    }
}

/// The images that textures use, in the order in which they are met first.
pub(super) struct Textures<'a> {
    document: &'a Document,
    encoded: Vec<Encoded<'a>>,
    /// Index into `encoded` by the place of the image's bytes, which several images can share; `None` if they cannot be
    /// read.
    known: HashMap<ImageSource, Option<u32>>,
    /// The same by the index of the image in the document.
    known_images: HashMap<usize, Option<u32>>,
    /// Index into `encoded` of the images of roughness, by the index of the image of glossiness and the bits of the
    /// factor of glossiness.
    rough: HashMap<(u32, u32), u32>,
}

impl<'a> Textures<'a> {
    pub fn new(document: &'a Document) -> Self {
        let (encoded, known, known_images, rough) = Default::default();
        Self { document, encoded, known, known_images, rough }
    }

    /// Returns a texture of normals or of occlusion, whose extensions the crate `gltf` does not read.
    pub fn of_data(
        &mut self,
        (index, uv_set): (Index<json::Texture>, u32),
        extensions: Option<&Map<String, json::Value>>,
        path: &str,
    ) -> Option<Texture> {
        let transform = extensions.and_then(|it| self.document.extension(it, "KHR_texture_transform", path));
        self.texture(&TextureUse { index, uv_set, transform }, path, Some(Channel::Red))
    }

    /// Returns a texture: of the linear numbers of a channel, or without a channel of sRGB colours. `path` is the JSON
    /// path of its use. Returns `None` if it cannot be read, which a note tells.
    pub fn texture(&mut self, used: &TextureUse, path: &str, channel: Option<Channel>) -> Option<Texture> {
        let read = self.read(used, path, channel);
        self.document.or_left_out(read).flatten()
    }

    fn read(&mut self, used: &TextureUse, path: &str, channel: Option<Channel>) -> Checked<Option<Texture>> {
        let root = &self.document.root;
        let json = item(&root.textures, "textures", used.index.value(), &path)?;
        let Some(image_ix) = self.image(json, used.index.value())? else { return Ok(None) };
        let mut texture = Texture::of_image(image_ix);
        if let Some(channel) = channel {
            (texture.encoding, texture.channel) = (Encoding::Linear, channel);
        }
        if let Some(index) = json.sampler {
            let from = format!("textures[{}].sampler", used.index);
            let sampler = item(&root.samplers, "samplers", index.value(), &from);
            let sampled = sampler
                .and_then(|sampler| sample(&mut texture, sampler).map_err(|what| format!("samplers[{index}]: {what}")));
            self.document.or_left_out(sampled);
        }
        texture.uv_set = used.uv_set;
        if let Some(transform) = &used.transform {
            texture.uv_set = transform.tex_coord.unwrap_or(used.uv_set);
            texture.transform = affine(transform);
            if !texture.transform.is_finite() {
                self.document
                    .note(LEFT_OUT, format!("{path}.extensions.KHR_texture_transform: a number is not finite"));
                texture.transform = Affine2::IDENTITY;
            }
        }
        if texture.uv_set > 1 {
            self.document.note("textures that use TEXCOORD_2 or above and are shown with TEXCOORD_0", path);
            texture.uv_set = 0;
        }
        Ok(Some(texture))
    }

    /// Returns a texture of roughness, from one whose opacity is the glossiness.
    pub fn roughness(&mut self, used: &TextureUse, path: &str, factor: f32) -> Option<Texture> {
        let texture = self.texture(used, path, Some(Channel::Red))?;
        let known = self.rough.entry((texture.image_ix, factor.to_bits())).or_insert_with(|| {
            let Encoded { name, bytes } = &self.encoded[texture.image_ix as usize];
            self.encoded.push(Encoded { name: name.clone(), bytes: bytes.clone() });
            (self.encoded.len() - 1) as u32
        });
        Some(Texture { image_ix: *known, ..texture })
    }

    /// Returns the index of a texture's image among those that are used.
    fn image(&mut self, texture: &json::Texture, texture_ix: usize) -> Checked<Option<u32>> {
        let path = format!("textures[{texture_ix}]");
        let (further, own) = sources(texture);
        let Some(last) = own.or(further) else {
            self.document.note("textures without an image of a known format, which are left out", path);
            return Ok(None);
        };
        // An image of a further format that cannot be read has another one beside it.
        if let Some(image) = further.filter(|_| own.is_some()) {
            let found = self.encoded_image(image, &path).filter(|ix| has_header(&self.encoded[*ix as usize]));
            if found.is_some() {
                return Ok(found);
            }
        }
        Ok(self.encoded_image(last, &path))
    }

    /// Returns the index of an image, which the texture at a JSON path names, and reads it at the first call. Returns
    /// `None` if it cannot be read.
    fn encoded_image(&mut self, image: Index<json::Image>, path: &str) -> Option<u32> {
        if let Some(known) = self.known_images.get(&image.value()) {
            return *known;
        }
        let source = self.document.image_source(image, &format_args!("{path}.source"));
        let image_ix = self.document.or_left_out(source).and_then(|source| self.image_at(image, source));
        self.known_images.insert(image.value(), image_ix);
        image_ix
    }

    /// Returns the index of an image by the place of its bytes.
    fn image_at(&mut self, image: Index<json::Image>, source: ImageSource) -> Option<u32> {
        if let Some(known) = self.known.get(&source) {
            return *known;
        }
        let bytes = self.document.or_left_out(self.document.image(image.value(), &source)).flatten();
        let json = &self.document.root.images[image.value()];
        let file = json.uri.as_ref().filter(|uri| !is_data(uri));
        let name = file.or(json.name.as_ref()).cloned().unwrap_or_else(|| format!("images[{image}]"));
        let image_ix = bytes.map(|bytes| {
            self.encoded.push(Encoded { name, bytes });
            (self.encoded.len() - 1) as u32
        });
        self.known.insert(source, image_ix);
        image_ix
    }

    /// Decodes the images and returns them. Textures of those that cannot be decoded are removed from the materials.
    /// `n_pixels`: the number of pixels that the scene has already.
    pub fn decode(self, materials: &mut [Material], n_pixels: u64) -> Vec<Image> {
        let names: Vec<_> = self.encoded.iter().map(|image| image.name.clone()).collect();
        let factors: HashMap<u32, f32> =
            self.rough.iter().map(|((_, bits), ix)| (*ix, f32::from_bits(*bits))).collect();
        let (mut images, mut new_ix) = (Vec::new(), Vec::new());
        for (name, decoded) in names.into_iter().zip(decode_all(self.encoded, n_pixels, &self.document.progress)) {
            match decoded {
                Ok(mut image) => {
                    if let Some(factor) = factors.get(&(new_ix.len() as u32)) {
                        turn_into_roughness(&mut image.pixels, *factor);
                        image.is_linear = true;
                    }
                    new_ix.push(Some(images.len() as u32));
                    images.push(image);
                }
                Err(what) => {
                    let note = format!("`{name}` ({what})");
                    self.document.note("images that cannot be decoded, without which materials are shown", note);
                    new_ix.push(None);
                }
            }
        }
        for maps in materials.iter_mut().map(|material| &mut material.maps) {
            maps.keep_each(|texture| new_ix[texture.image_ix as usize].is_some());
            maps.change_each(|texture| texture.image_ix = new_ix[texture.image_ix as usize].unwrap_or_default());
        }
        images
    }
}

/// Returns a texture's images: that of an extension for further formats, which comes first, and the texture's own.
fn sources(texture: &json::Texture) -> (Option<Index<json::Image>>, Option<Index<json::Image>>) {
    let others = texture.extensions.as_ref().map(|extensions| &extensions.others);
    let of_extension = |name| others?.get(name)?.get("source")?.as_u64();
    let further = ["KHR_texture_basisu", "EXT_texture_webp", "MSFT_texture_dds"].into_iter().find_map(of_extension);
    let further = further.and_then(|ix| u32::try_from(ix).ok()).map(Index::new);
    // The crate `gltf` gives a texture without an image this index.
    (further, (texture.source.value() != u32::MAX as usize).then_some(texture.source))
}

fn sample(texture: &mut Texture, sampler: &Sampler) -> Checked<()> {
    let wrap = |mode: &Word<WrappingMode>| match mode {
        Valid(WrappingMode::Repeat) => Ok(Wrap::Repeat),
        Valid(WrappingMode::MirroredRepeat) => Ok(Wrap::Mirror),
        Valid(WrappingMode::ClampToEdge) => Ok(Wrap::Clamp),
        _ => Err("its wrapS or wrapT is unknown"),
    };
    texture.wrap = [wrap(&sampler.wrap_s)?, wrap(&sampler.wrap_t)?];
    texture.is_smooth = !matches!(sampler.mag_filter, Some(Valid(MagFilter::Nearest)));
    Ok(())
}

/// Returns the transform of texture coordinates. They are scaled, then rotated about (0, 0), then moved.
///
/// Since v points down in an image, a rotation that is counter-clockwise there, as the extension's text and its test
/// model have it, is one by the negative angle. The listing in the specification has the other sign.
fn affine(transform: &TextureTransform) -> Affine2 {
    let (scale, offset) = (Vec2::from_array(transform.scale.0), Vec2::from_array(transform.offset.0));
    Affine2::from_scale_angle_translation(scale, -transform.rotation.0, offset)
}
