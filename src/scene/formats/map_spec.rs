//! Maps of materials as scene files describe them.

use glam::Vec2;
use serde::Deserialize;

use super::image_cache::{Images, View};
use crate::scene::model::{Channel, Encoding, Material, Texture, Wrap, error::Checked};

/// A map: the name of an image, relative to the scene file's folder, or a table.
#[derive(Clone, Debug, Deserialize)]
#[serde(
    untagged,
    expecting = "expected the name of an image, or a table with the keys file, scale, offset, wrap, \
                               filter, channel and encoding"
)]
pub(crate) enum MapSpec {
    Name(String),
    Table(MapTable),
}

#[derive(Clone, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct MapTable {
    file: String,
    /// Factors on texture coordinates; 1 and 1 where absent.
    scale: Option<[f32; 2]>,
    /// What is added to the scaled texture coordinates; 0 and 0 where absent.
    offset: Option<[f32; 2]>,
    #[serde(default)]
    wrap: Wrap,
    filter: Option<FilterSpec>,
    channel: Option<Channel>,
    encoding: Option<Encoding>,
}

#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(rename_all = "snake_case")]
enum FilterSpec {
    Linear,
    Nearest,
}

impl MapSpec {
    /// Returns the name of the image's file.
    pub fn file(&self) -> &str {
        match self {
            Self::Name(file) | Self::Table(MapTable { file, .. }) => file,
        }
    }

    /// Gives a material the map of a key. `file` is the map's image among `images`.
    pub fn set(&self, material: &mut Material, key: &str, images: &mut Images, file: usize) -> Checked<()> {
        let image = images.get(file)?;
        let is_colour = matches!(key, "map_Kd" | "map_Ks" | "map_Ke");
        let encoding = if is_colour { Encoding::Srgb } else { Encoding::Linear };
        let channel = match key {
            "map_d" => image.opacity_channel(),
            "map_Ns" | "map_roughness" | "map_metallic" | "map_occlusion" => Channel::Luminance,
            _ => Channel::Red,
        };
        let is_linear = image.image().is_linear;
        let plain = Texture { encoding, channel, ..Texture::of_image(images.show(file, View::Plain)?) };
        let texture = match self {
            Self::Name(_) => plain,
            Self::Table(table) => {
                let texture = table.texture(plain)?;
                table.check_effect(&texture, is_colour || key == "map_normal", is_linear)?;
                texture
            }
        };
        let maps = &mut material.maps;
        let map = match key {
            "map_Kd" => &mut maps.base_colour,
            "map_Ks" => &mut maps.specular,
            "map_Ke" => &mut maps.emission,
            "map_d" => &mut maps.opacity,
            "map_Ns" | "map_roughness" => &mut maps.roughness,
            "map_normal" => &mut maps.normal,
            "map_metallic" => &mut maps.metallic,
            "map_occlusion" => &mut maps.occlusion,
            _ => return Err(format!("{key} is no map")),
        };
        *map = Some(texture);
        Ok(())
    }
}

impl MapTable {
    /// Refuses a channel and an encoding that make no difference to the texture. `is_vector`: the map has several
    /// numbers. `is_linear`: the image's colours are linear, whatever its encoding says.
    fn check_effect(&self, texture: &Texture, is_vector: bool, is_linear: bool) -> Checked<()> {
        if self.channel.is_some() && is_vector {
            return Err("has `channel`, but the map reads all colours".to_owned());
        }
        match self.encoding {
            Some(_) if !is_vector && texture.channel == Channel::Alpha => {
                Err("has `encoding`, but the map reads the opacity, which is always linear".to_owned())
            }
            Some(Encoding::Srgb) if is_linear => {
                Err("has `encoding = \"srgb\"`, but the image's numbers are linear".to_owned())
            }
            _ => Ok(()),
        }
    }

    /// Returns the texture with the stated options in place of its own.
    fn texture(&self, texture: Texture) -> Checked<Texture> {
        let vector = |name: &str, value: Option<[f32; 2]>, default: Vec2| match value.map(Vec2::from_array) {
            Some(value) if !value.is_finite() => Err(format!("{name} is not finite")),
            value => Ok(value.unwrap_or(default)),
        };
        let placed =
            texture.placed(vector("scale", self.scale, Vec2::ONE)?, vector("offset", self.offset, Vec2::ZERO)?);
        let is_smooth = !matches!(self.filter, Some(FilterSpec::Nearest));
        Ok(Texture {
            wrap: [self.wrap; 2],
            channel: self.channel.unwrap_or(placed.channel),
            encoding: self.encoding.unwrap_or(placed.encoding),
            is_smooth,
            ..placed
        })
    }
}
