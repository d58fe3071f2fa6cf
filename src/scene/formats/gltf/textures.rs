//! Textures of materials, and the images that they use.

use glam::{Affine2, Vec2};
use gltf::json::{
    self, Index,
    extensions::texture::TextureTransform,
    material::{NormalTexture, OcclusionTexture},
    texture::{MagFilter, Sampler, WrappingMode},
    validation::Checked::{self as Word, Valid},
};
use hashbrown::HashMap;

use super::{
    document::{Document, ImageSource, item},
    glossiness::turn_into_roughness,
    uri::is_data,
};
use crate::scene::{
    formats::image::{Encoded, decode_all},
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

    pub fn of_normal(texture: &NormalTexture, path: &str) -> Checked<Self> {
        let transform = raw_transform(texture.extensions.as_ref().map(|extensions| &extensions.others), path)?;
        Ok(Self { index: texture.index, uv_set: texture.tex_coord, transform })
    }

    pub fn of_occlusion(texture: &OcclusionTexture, path: &str) -> Checked<Self> {
        let transform = raw_transform(texture.extensions.as_ref().map(|extensions| &extensions.others), path)?;
        Ok(Self { index: texture.index, uv_set: texture.tex_coord, transform })
    }
}

/// Returns the transform of a texture whose extensions the crate `gltf` does not read.
fn raw_transform(
    extensions: Option<&serde_json::Map<String, json::Value>>,
    path: &str,
) -> Checked<Option<TextureTransform>> {
    let value = extensions.and_then(|extensions| extensions.get("KHR_texture_transform"));
    let read = value.map(|value| json::deserialize::from_value(value.clone())).transpose();
    read.map_err(|error| format!("{path}.extensions.KHR_texture_transform: {error}"))
}

/// The images that textures use, in the order in which they are met first.
pub(super) struct Textures<'a> {
    document: &'a Document,
    encoded: Vec<Encoded<'a>>,
    /// Index into `encoded` by the place of the image's bytes, which several images can share; `None` if they cannot be
    /// read.
    known: HashMap<ImageSource, Option<u32>>,
    /// Index into `encoded` of the images of roughness, by the index of the image of glossiness and the bits of the
    /// factor of glossiness.
    rough: HashMap<(u32, u32), u32>,
}

impl<'a> Textures<'a> {
    pub fn new(document: &'a Document) -> Self {
        Self { document, encoded: Vec::new(), known: HashMap::new(), rough: HashMap::new() }
    }

    /// Returns a texture: of the linear numbers of a channel, or without a channel of sRGB colours. `path` is the JSON
    /// path of its use. Returns `None` if its image cannot be read.
    pub fn texture(&mut self, used: &TextureUse, path: &str, channel: Option<Channel>) -> Checked<Option<Texture>> {
        let root = &self.document.root;
        let json = item(&root.textures, "textures", used.index.value(), &path)?;
        let Some(image_ix) = self.image(json, used.index.value())? else { return Ok(None) };
        let mut texture = Texture::of_image(image_ix);
        if let Some(channel) = channel {
            (texture.encoding, texture.channel) = (Encoding::Linear, channel);
        }
        if let Some(index) = json.sampler {
            let from = format!("textures[{}].sampler", used.index);
            sample(&mut texture, item(&root.samplers, "samplers", index.value(), &from)?)
                .map_err(|what| format!("samplers[{index}]: {what}"))?;
        }
        texture.uv_set = used.uv_set;
        if let Some(transform) = &used.transform {
            texture.uv_set = transform.tex_coord.unwrap_or(used.uv_set);
            texture.transform = affine(transform);
            if !texture.transform.is_finite() {
                return Err(format!("{path}.extensions.KHR_texture_transform: a number is not finite"));
            }
        }
        if texture.uv_set > 1 {
            self.document.note("textures that use TEXCOORD_2 or above and are shown with TEXCOORD_0", path);
            texture.uv_set = 0;
        }
        Ok(Some(texture))
    }

    /// Returns a texture of roughness, from one whose opacity is the glossiness.
    pub fn roughness(&mut self, used: &TextureUse, path: &str, factor: f32) -> Checked<Option<Texture>> {
        let Some(texture) = self.texture(used, path, Some(Channel::Red))? else { return Ok(None) };
        let known = self.rough.entry((texture.image_ix, factor.to_bits())).or_insert_with(|| {
            let Encoded { name, bytes } = &self.encoded[texture.image_ix as usize];
            self.encoded.push(Encoded { name: name.clone(), bytes: bytes.clone() });
            (self.encoded.len() - 1) as u32
        });
        Ok(Some(Texture { image_ix: *known, ..texture }))
    }

    /// Returns the index of a texture's image among those that are used.
    fn image(&mut self, texture: &json::Texture, texture_ix: usize) -> Checked<Option<u32>> {
        let path = format!("textures[{texture_ix}]");
        let Some(image) = source(texture) else {
            let is_ktx = has_extension(texture, "KHR_texture_basisu");
            let what = match is_ktx {
                true => {
                    "textures in KTX2, which are not read (`gltf-transform ktxdecompress IN OUT` makes PNG of them)"
                }
                false => "textures without an image of a known format, which are left out",
            };
            self.document.note(what, path);
            return Ok(None);
        };
        let source = self.document.image_source(image, &format_args!("{path}.source"))?;
        if let Some(known) = self.known.get(&source) {
            return Ok(*known);
        }
        let bytes = self.document.image(image.value(), &source)?;
        let image_ix = bytes.map(|bytes| {
            let json = &self.document.root.images[image.value()];
            let file = json.uri.as_ref().filter(|uri| !is_data(uri));
            let name = file.or(json.name.as_ref()).cloned().unwrap_or_else(|| format!("images[{image}]"));
            self.encoded.push(Encoded { name, bytes });
            (self.encoded.len() - 1) as u32
        });
        self.known.insert(source, image_ix);
        Ok(image_ix)
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

fn has_extension(texture: &json::Texture, name: &str) -> bool {
    texture.extensions.as_ref().is_some_and(|extensions| extensions.others.contains_key(name))
}

/// Returns a texture's image: that of an extension for further formats, else the texture's own.
fn source(texture: &json::Texture) -> Option<Index<json::Image>> {
    let others = texture.extensions.as_ref().map(|extensions| &extensions.others);
    let of_extension = |name| others?.get(name)?.get("source")?.as_u64();
    let further = ["EXT_texture_webp", "MSFT_texture_dds"].into_iter().find_map(of_extension);
    let further = further.and_then(|ix| u32::try_from(ix).ok()).map(Index::new);
    // The crate `gltf` gives a texture without an image this index.
    further.or((texture.source.value() != u32::MAX as usize).then_some(texture.source))
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
