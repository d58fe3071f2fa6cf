//! The maps of MTL files: images that vary a material's terms, with the options before their names.

use glam::Vec2;

use super::{statement::split_keyword, udim};
use crate::scene::{
    formats::image_cache::{Images, View},
    model::{Alpha, Channel, Encoding, Material, Texture, Wrap, error::Checked},
};

/// Opacity below which a surface with holes, such as a leaf, has a hole.
const CUTOFF: f32 = 0.5;

/// A term that a map varies.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Term {
    BaseColour,
    Specular,
    Emission,
    Opacity,
    Transparency,
    Exponent,
    Height,
    Normal,
    Roughness,
    Metallic,
}

/// Meaning of a statement's keyword.
pub enum MapKind {
    /// It names the map of a term.
    Shown(Term),
    /// It names a map that is read by no kernel.
    NotShown,
    /// It names no map.
    None,
}

impl MapKind {
    /// Returns what a keyword means. Case does not count, since writers differ in it.
    pub fn of(keyword: &str) -> Self {
        match keyword.to_ascii_lowercase().as_str() {
            "map_kd" => Self::Shown(Term::BaseColour),
            "map_ks" => Self::Shown(Term::Specular),
            "map_ke" | "map_emissive" => Self::Shown(Term::Emission),
            "map_d" => Self::Shown(Term::Opacity),
            "map_tr" => Self::Shown(Term::Transparency),
            "map_ns" => Self::Shown(Term::Exponent),
            "map_bump" | "bump" => Self::Shown(Term::Height),
            "norm" | "map_kn" | "map_norm" => Self::Shown(Term::Normal),
            "map_pr" => Self::Shown(Term::Roughness),
            "map_pm" => Self::Shown(Term::Metallic),
            "map_ka" | "map_ps" | "map_pc" | "map_pcr" | "map_tf" | "disp" | "map_disp" | "decal" | "refl"
            | "map_refl" => Self::NotShown,
            _ => Self::None,
        }
    }
}

/// Options of a map, and the name of its file.
#[derive(Clone, Debug, PartialEq)]
pub struct MapOptions {
    scale: Vec2,
    offset: Vec2,
    clamp: bool,
    /// Factor of heights, or of the slope of normals.
    bump: f32,
    channel: Option<Channel>,
    pub name: String,
}

impl MapOptions {
    /// Parses what follows the keyword.
    pub fn new(statement: &str) -> Checked<Self> {
        let (scale, offset) = (Vec2::ONE, Vec2::ZERO);
        let mut options = Self { scale, offset, clamp: false, bump: 1.0, channel: None, name: String::new() };
        let mut rest = statement.trim();
        while rest.starts_with('-') {
            let (option, after) = split_keyword(rest);
            let Some(after) = options.option(option, after)? else { break };
            rest = after.trim_start();
        }
        options.name = rest.trim_matches('"').trim().to_owned();
        if options.name.is_empty() { Err("names no file".to_owned()) } else { Ok(options) }
    }

    /// Returns whether `-s` or `-o` changes the texture coordinates.
    pub fn is_moved(&self) -> bool {
        (self.scale, self.offset) != (Vec2::ONE, Vec2::ZERO)
    }

    /// Returns the options of the map for a tile, whose image does not repeat. The tiles lie where the coordinates of
    /// the faces say, so that nothing moves them.
    pub fn for_tile(&self, tile: u32) -> Self {
        let (u, v) = udim::corner(tile);
        Self { scale: Vec2::ONE, offset: -Vec2::new(u, v), clamp: true, ..self.clone() }
    }

    /// Reads an option's values. Returns what follows them, or nothing if there is no such option.
    fn option<'a>(&mut self, option: &str, after: &'a str) -> Checked<Option<&'a str>> {
        let word = || split_keyword(after);
        let after = match option.to_ascii_lowercase().as_str() {
            "-s" => vector(option, after, &mut self.scale)?,
            "-o" => vector(option, after, &mut self.offset)?,
            "-t" | "-mm" => vector(option, after, &mut Vec2::default())?,
            "-clamp" => {
                self.clamp = word().0.eq_ignore_ascii_case("on");
                word().1
            }
            "-bm" => {
                self.bump = number(word().0).ok_or_else(|| format!("-bm `{}` is not a finite number", word().0))?;
                word().1
            }
            "-imfchan" => {
                self.channel = Some(channel(word().0)?);
                word().1
            }
            "-blendu" | "-blendv" | "-cc" | "-texres" | "-type" | "-boost" => word().1,
            _ => return Ok(None),
        };
        Ok(Some(after))
    }

    /// Returns the texture of an image. MTL's texture coordinates are turned into `u s + o` with an origin at the lower
    /// left corner of the image; that of kdray is the upper left one.
    fn texture(&self, image_ix: u32, encoding: Encoding, channel: Channel) -> Texture {
        let (scale, offset) = (self.scale, self.offset);
        let wrap = if self.clamp { Wrap::Clamp } else { Wrap::Repeat };
        Texture { encoding, channel, wrap: [wrap; 2], ..Texture::of_image(image_ix) }
            .placed(scale, Vec2::new(offset.x, 1.0 - scale.y - offset.y))
    }
}

fn channel(word: &str) -> Checked<Channel> {
    match word {
        "r" => Ok(Channel::Red),
        "g" => Ok(Channel::Green),
        "b" => Ok(Channel::Blue),
        "m" => Ok(Channel::Alpha),
        "l" => Ok(Channel::Luminance),
        // z is the distance from the eye, which files of images as colours do not have.
        "z" => Err("-imfchan z: the image has no distances".to_owned()),
        _ => Err(format!("-imfchan `{word}` is not one of r, g, b, m, l")),
    }
}

/// Returns a finite number.
fn number(word: &str) -> Option<f32> {
    word.parse().ok().filter(|number: &f32| number.is_finite())
}

/// Reads one to three numbers, the first two of which are for u and v, and returns what follows them.
fn vector<'a>(option: &str, after: &'a str, uv: &mut Vec2) -> Checked<&'a str> {
    let mut after = after;
    for ix in 0..3 {
        let (word, next) = split_keyword(after);
        match (number(word), ix) {
            (Some(number), 0) => uv.x = number,
            (Some(number), 1) => uv.y = number,
            (Some(_), _) => {}
            (None, 0) => return Err(format!("{option} `{word}` is not a finite number")),
            (None, _) => break,
        }
        after = next;
    }
    Ok(after)
}

/// Gives a material a map. `file` has an image.
///
/// # Errors
/// The image that the map needs cannot be made from that of the file. The material has no such map then.
pub fn set_map(
    material: &mut Material,
    term: Term,
    options: &MapOptions,
    images: &mut Images,
    file: usize,
) -> Checked<()> {
    let image = images.get(file)?;
    let grey = options.channel.unwrap_or(Channel::Luminance);
    let (view, channel) = match term {
        Term::Opacity => (View::Plain, options.channel.unwrap_or_else(|| image.opacity_channel())),
        Term::Transparency => (View::Inverted, grey),
        Term::Height if !image.shows_normals() => (View::Heights(grey, options.bump.to_bits()), Channel::Red),
        Term::Exponent | Term::Roughness | Term::Metallic => (View::Plain, grey),
        Term::BaseColour | Term::Specular | Term::Emission | Term::Normal | Term::Height => (View::Plain, Channel::Red),
    };
    let is_cutout = term == Term::Opacity && material.d == 1.0 && image.is_nearly_binary(channel);
    // With microfacets, the map of the roughness counts.
    if term == Term::Exponent && material.microfacet.is_some() {
        return Ok(());
    }
    let is_colour = matches!(term, Term::BaseColour | Term::Specular | Term::Emission);
    let encoding = if is_colour { Encoding::Srgb } else { Encoding::Linear };
    let texture = Some(options.texture(images.show(file, view)?, encoding, channel));
    let maps = &mut material.maps;
    match term {
        Term::BaseColour => maps.base_colour = texture,
        Term::Specular => maps.specular = texture,
        Term::Emission => maps.emission = texture,
        Term::Opacity | Term::Transparency => maps.opacity = texture,
        Term::Exponent | Term::Roughness => maps.roughness = texture,
        Term::Metallic => maps.metallic = texture,
        Term::Height | Term::Normal => {
            maps.normal_scale = if view == View::Plain { options.bump } else { 1.0 };
            maps.normal = texture;
        }
    }
    if is_cutout {
        material.alpha = Alpha::Mask(CUTOFF);
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn options_precede_the_name() {
        let plain = MapOptions::new("a b.png").unwrap();
        assert_eq!((plain.scale, plain.offset, plain.bump), (Vec2::ONE, Vec2::ZERO, 1.0));
        assert_eq!((plain.clamp, plain.channel, plain.name.as_str()), (false, None, "a b.png"));
        let all = "-blendu on -BlendV off -s 2 3 4 -o 0.5 -t 1 2 3 -mm 0 1 -texres 512 -type sphere -boost 3 -cc on \
                   -clamp on -bm 0.25 -imfchan m \"deep\\my -s map.png\"";
        let all = MapOptions::new(all).unwrap();
        assert_eq!((all.scale, all.offset, all.bump), (Vec2::new(2.0, 3.0), Vec2::new(0.5, 0.0), 0.25));
        assert_eq!((all.clamp, all.channel), (true, Some(Channel::Alpha)));
        assert_eq!(all.name, "deep\\my -s map.png");
        assert_eq!(MapOptions::new("-s 2 2.png").unwrap().name, "2.png");
        assert_eq!(MapOptions::new("-leaf.png").unwrap().name, "-leaf.png");
        for (letter, channel) in [("r", Channel::Red), ("g", Channel::Green), ("b", Channel::Blue)] {
            assert_eq!(MapOptions::new(&format!("-imfchan {letter} x")).unwrap().channel, Some(channel));
        }
        for bad in ["", "-s", "-s x.png", "-bm nan x.png", "-imfchan z x.png", "-imfchan q x", "-clamp on", "\"\""] {
            assert!(MapOptions::new(bad).is_err(), "{bad}");
        }
    }

    #[test]
    fn textures_are_scaled_then_moved_from_the_lower_left_corner() {
        let texture = MapOptions::new("-s 2 4 -o 0.25 0.5 -clamp on x").unwrap();
        let texture = texture.texture(3, Encoding::Srgb, Channel::Red);
        // In MTL's coordinates, (1, 1) goes to (2.25, 4.5); v of the upper left origin is 1 - v.
        assert_eq!(texture.transform.transform_point2(Vec2::new(1.0, 0.0)), Vec2::new(2.25, -3.5));
        assert_eq!(texture.transform.transform_point2(Vec2::new(0.0, 1.0)), Vec2::new(0.25, 0.5));
        assert_eq!((texture.image_ix, texture.wrap), (3, [Wrap::Clamp; 2]));
        let plain = MapOptions::new("x").unwrap().texture(0, Encoding::Srgb, Channel::Red);
        assert_eq!(plain, Texture::of_image(0));
    }
}
