//! MTL files. They are checked and rewritten line by line, read by tobj and converted to materials.
//!
//! A colour of one number is a grey in MTL, but tobj 4.0.5 panics on it; so it is rewritten as three numbers.

use std::{
    collections::{BTreeSet, HashMap, HashSet},
    fmt::Write,
    path::{Path, PathBuf},
};

use super::{
    files::{library_files, own_library},
    maps::{MapKind, MapOptions, Term, set_map},
    statement::{split_keyword, statements, words},
    udim::{TOKEN, UdimMaterials, files_of_map},
};
use crate::{
    scene::{
        files::SourceFile,
        formats::{image_cache::Images, material_spec::MaterialSpec},
        model::{Alpha, Channel, Clearcoat, Material, Microfacet, SceneError, Sheen, error::Checked},
    },
    util::text::{escape_controls, one_line},
};

/// Roughness of a material that states how metallic it is, and nothing about its roughness.
const DEFAULT_ROUGHNESS: f32 = 0.5;

/// Name of a material that has none.
const NAMELESS: &str = "(nameless)";

/// A material as its file describes it.
#[derive(Clone, Debug)]
struct Described {
    spec: MaterialSpec,
    name: String,
    path: PathBuf,
    more: More,
}

/// What tobj does not read of a material.
#[derive(Clone, Debug, Default)]
struct More {
    /// Pr, Pm, Ps, Pc and Pcr by their keywords.
    numbers: HashMap<String, f32>,
    maps: Vec<Map>,
    /// Whether the first statement is `illum`, as Maya writes it.
    begins_with_illum: bool,
}

/// A map of a material, or one tile of it.
#[derive(Clone, Debug)]
struct Map {
    line: usize,
    term: Term,
    options: MapOptions,
    /// Index of the image's file.
    file: usize,
    /// The number of the tile (UDIM) that the image is for, if there are several.
    tile: Option<u32>,
}

/// Reads the materials in the files that the `mtllib` lines of an OBJ file name, relative to its folder. If there is
/// none, and the file uses materials, the one is read that has its own name. If several materials have the same name,
/// the last one counts. Warns of files that do not exist, and of names that leave the folder. Materials whose images
/// are in tiles come with one more material for each tile.
pub fn load_libraries(
    obj: &SourceFile,
    (libraries, uses_materials): (&[(usize, String)], bool),
    images: &mut Images,
) -> Result<(Vec<Material>, UdimMaterials), SceneError> {
    let mut described = Vec::new();
    let mut read = HashSet::new();
    for (line, rest) in libraries {
        for file in library_files(obj, rest) {
            let warn = |what: &str| tracing::warn!("{}:{line}: {what}", obj.path.display());
            match file {
                Err(what) => warn(&format!("mtllib {}", one_line(&what))),
                Ok(file) if !file.is_file() => {
                    warn(&format!("{} does not exist: its materials become the default one", shown(&file.path)));
                }
                Ok(file) => {
                    if file.is_other_case {
                        warn(&format!("mtllib `{}`: {} is taken", rest.escape_debug(), shown(&file.path)));
                    }
                    if read.insert(file.path.clone()) {
                        described.extend(load_library(obj, &file, images)?);
                    }
                }
            }
        }
    }
    let own = if read.is_empty() && uses_materials { own_library(obj) } else { None };
    if let Some(own) = own {
        let (obj_path, own_path) = (obj.path.display(), shown(&own.path));
        tracing::info!("{obj_path}: the materials are those of {own_path}, which it does not name");
        described.extend(load_library(obj, &own, images)?);
    }
    let (described, tiles) = with_tiles(described);
    Ok((materials(described, images)?, tiles))
}

/// Adds a copy of a material for each tile of its images. The copies have its name and precede it. Since the last of
/// several materials with one name counts, the name means the material itself, which shows no image in tiles.
fn with_tiles(described: Vec<Described>) -> (Vec<Described>, UdimMaterials) {
    let (mut all, mut tiles) = (Vec::new(), UdimMaterials::default());
    for Described { spec, name, path, more } in described {
        let numbers: BTreeSet<u32> = more.maps.iter().filter_map(|map| map.tile).collect();
        let base = all.len() + numbers.len();
        let copy = |tile: Option<u32>| {
            let is_shown = |map: &&Map| map.tile.is_none() || map.tile == tile;
            let placed = |map: &Map| Map {
                options: map.tile.map_or_else(|| map.options.clone(), |tile| map.options.for_tile(tile)),
                ..map.clone()
            };
            let maps = more.maps.iter().filter(is_shown).map(placed).collect();
            let more = More { maps, numbers: more.numbers.clone(), ..more };
            Described { spec: spec.clone(), name: name.clone(), path: path.clone(), more }
        };
        for tile in numbers {
            tiles.add(base, tile, all.len());
            all.push(copy(Some(tile)));
        }
        all.push(copy(None));
    }
    (all, tiles)
}

fn load_library(obj: &SourceFile, mtl: &SourceFile, images: &mut Images) -> Result<Vec<Described>, SceneError> {
    let (path, text) = (&*mtl.path, mtl.lossy_text()?);
    let (clean, left_out) = clean_mtl(&text);
    for (line, what) in left_out {
        tracing::warn!("{}:{line}: {}; the statement is left out", shown(path), one_line(&what));
    }
    let more = read_more(obj, path, &text, images);
    let (materials, _) = tobj::load_mtl_buf(&mut clean.as_bytes()).map_err(|e| mtl.error(e.to_string()))?;
    let described = |(material, more): (tobj::Material, More)| Described {
        spec: spec(&material),
        name: material.name,
        path: path.to_owned(),
        more,
    };
    let mut described: Vec<_> = materials.into_iter().zip(more).map(described).collect();
    as_meant(path, &mut described);
    Ok(described)
}

/// Changes terms that exporters write without meaning them. Warns once for each kind of change that could hide what a
/// person has meant.
fn as_meant(path: &Path, described: &mut [Described]) {
    let (mut invisible, mut no_glass) = (Vec::new(), Vec::new());
    for Described { spec, name, more, .. } in described {
        if spec.ka.is_some_and(is_exporters_ambient) {
            spec.ka = None;
        }
        // Nothing would pass such a filter, so it says nothing of what passes.
        if spec.tf == Some([0.0; 3]) {
            spec.tf = None;
        }
        if more.begins_with_illum {
            take_opacity_of_maya(spec);
        }
        if matches!(spec.illum, Some(4 | 6 | 9)) && !is_transparent(spec, more) {
            // The default of `illum` depends on `Ks`.
            spec.illum = None;
            no_glass.push(name.as_str());
        }
        if spec.d == Some(0.0) || spec.tr == Some(1.0) {
            (spec.d, spec.tr) = (None, None);
            invisible.push(name.as_str());
        }
        tint_glass(spec, more);
    }
    let warn = |names: &[&str], what: &str| {
        let Some(first) = names.first() else { return };
        let others = if names.len() > 1 { format!(" and {} more", names.len() - 1) } else { String::new() };
        tracing::warn!("{}: material `{}`{others} {what}", shown(path), first.escape_debug());
    };
    warn(&invisible, "would be invisible by `d 0` or `Tr 1`: shown opaque");
    warn(&no_glass, "would be glass by `illum`, but no other term says so: shown opaque; `Ni 1.5` would make it glass");
}

/// Reads the opacity of a material of Maya, which writes `illum 4`, `Ni 1.00`, no `d`, and 1 minus the transparency as
/// `Tf`: an opaque material has `Tf 1 1 1`. Glass of Maya has an `Ni` that is not 1.
fn take_opacity_of_maya(spec: &mut MaterialSpec) {
    let is_thin = spec.illum == Some(4) && spec.ni == Some(1.0) && spec.d.is_none_or(|d| d == 1.0);
    if let (true, Some(tf)) = (is_thin, spec.tf)
        && tf.iter().all(|x| *x <= 1.0)
        && tf != [1.0; 3]
    {
        let opacity = tf.iter().sum::<f32>() / 3.0;
        (spec.illum, spec.tf, spec.d) = (None, None, Some(opacity));
    }
}

/// Takes the diffuse and the ambient light from glass. Its `Kd` is the colour in which things are seen through it. A
/// ray passes two boundaries, so each has the square root of that colour. Glass with an image keeps its `Kd`, since the
/// image would be lost.
fn tint_glass(spec: &mut MaterialSpec, more: &More) {
    let is_glass = matches!(spec.illum, Some(4 | 6 | 7 | 9)) && !is_physically_based(more);
    let has_image = more.maps.iter().any(|map| map.term == Term::BaseColour);
    let kd = spec.kd.unwrap_or([0.0; 3]);
    let is_in_range = kd.iter().all(|x| *x >= 0.0);
    if !is_glass || has_image || !is_in_range {
        return;
    }
    if spec.tf.is_none_or(|tf| tf == [1.0; 3]) && kd != [0.0; 3] {
        spec.tf = Some(kd.map(|x| x.min(1.0).sqrt()));
    }
    (spec.kd, spec.ka) = (Some([0.0; 3]), Some([0.0; 3]));
}

/// Returns whether a material is one of microfacets.
fn is_physically_based(more: &More) -> bool {
    more.numbers.contains_key("Pr")
        || more.numbers.contains_key("Pm")
        || more.maps.iter().any(|map| matches!(map.term, Term::Roughness | Term::Metallic))
}

/// Returns the path of a file that another one names, without characters that a terminal would obey.
fn shown(path: &Path) -> String {
    escape_controls(&path.display().to_string()).into_owned()
}

/// Returns whether a `Ka` is one that exporters write for all materials, whatever their colours are: black or white.
fn is_exporters_ambient(ka: [f32; 3]) -> bool {
    ka == [0.0; 3] || ka == [1.0; 3]
}

/// Returns whether a term beside `illum` says that light passes through a material. Maya writes `illum 4`, `Tf 1 1 1`
/// and `Ni 1` for opaque ones.
fn is_transparent(spec: &MaterialSpec, more: &More) -> bool {
    let has_opacity = more.maps.iter().any(|map| matches!(map.term, Term::Opacity | Term::Transparency));
    has_opacity
        || spec.d.is_some_and(|d| d != 1.0)
        || spec.tr.is_some_and(|tr| tr != 0.0)
        || spec.tf.is_some_and(|tf| tf != [1.0; 3])
        || spec.ni.is_some_and(|ni| ni != 1.0 && ni != 0.0)
}

/// Reads the maps and the physically based terms, one entry for each material. Warns of terms and maps that are not
/// shown: once for each kind, and once for each file that is missing or has another name.
fn read_more(obj: &SourceFile, path: &Path, text: &str, images: &mut Images) -> Vec<More> {
    let folder = path.parent().unwrap_or(Path::new(""));
    let (mut materials, mut is_replaced, mut is_first): (Vec<More>, bool, bool) = (Vec::new(), false, false);
    let mut told: HashSet<String> = HashSet::new();
    let mut warn = |line: usize, key: &str, what: String| {
        if told.insert(key.to_owned()) {
            tracing::warn!("{}:{line}: {}", shown(path), one_line(&what));
        }
    };
    let maps_colour = statements(text).any(|(_, s)| split_keyword(&s).0.eq_ignore_ascii_case("map_Kd"));
    for (line, statement) in statements(text) {
        let (keyword, rest) = split_keyword(&statement);
        if keyword == "newmtl" {
            materials.push(More::default());
            is_replaced = images.is_replaced(rest);
            is_first = true;
            continue;
        }
        let Some(material) = materials.last_mut() else { continue };
        material.begins_with_illum |= is_first && keyword == "illum";
        is_first = false;
        if matches!(keyword, "Pr" | "Pm" | "Ps" | "Pc" | "Pcr") {
            // A number that is none has been told by `clean_mtl`.
            let Ok(number) = fraction(keyword, rest) else { continue };
            material.numbers.insert(keyword.to_owned(), number);
            // The roughness of the clearcoat says nothing without a clearcoat.
            if matches!(keyword, "Ps" | "Pc") && number > 0.0 {
                warn(line, keyword, format!("`{keyword}` is not shown by the integrator whitted"));
            }
        }
        if keyword == "aniso" && words(rest).next().and_then(|word| word.parse().ok()).is_some_and(|x: f32| x != 0.0) {
            warn(line, keyword, format!("`{keyword}` is not shown"));
        }
        let term = match MapKind::of(keyword) {
            _ if is_replaced => continue,
            MapKind::None => continue,
            // The ambient term has the colours of map_Kd.
            MapKind::NotShown if keyword.eq_ignore_ascii_case("map_Ka") && maps_colour => continue,
            MapKind::NotShown => {
                warn(line, keyword, format!("`{keyword}` is not shown"));
                continue;
            }
            MapKind::Shown(term) => term,
        };
        let options = MapOptions::new(rest);
        let found = options.and_then(|options| Ok((files_of_map(obj, folder, &options.name)?, options)));
        let (files, options) = match found {
            Ok(found) => found,
            Err(what) => {
                warn(line, rest, format!("`{keyword}` is not shown: {what}"));
                continue;
            }
        };
        let has_tiles = files.iter().any(|(tile, _)| tile.is_some());
        if !has_tiles && options.name.to_ascii_uppercase().contains(TOKEN) {
            let what = "stands for the number of a tile, from 1001 on, and there is no such image";
            warn(line, rest, format!("`{keyword}` is not shown: `{TOKEN}` {what}"));
            continue;
        }
        if has_tiles && options.is_moved() {
            warn(line, rest, format!("`-s` and `-o` of `{keyword}` are left out: its image is in tiles"));
        }
        if let Some((_, file)) = files.iter().find(|(_, file)| file.is_other_case) {
            warn(line, &options.name, format!("`{}`: {} is taken", options.name, shown(&file.path)));
        }
        let map = |(tile, file)| Map { line, term, options: options.clone(), file: images.add(file), tile };
        material.maps.extend(files.into_iter().map(map));
    }
    materials
}

/// Returns the first number, clamped to 0 to 1.
fn fraction(keyword: &str, rest: &str) -> Checked<f32> {
    let word = words(rest).next().unwrap_or_default();
    finite(keyword, word).map(|number| number.clamp(0.0, 1.0))
}

/// Decodes the images and makes the materials. Warns of each image that cannot be read.
fn materials(described: Vec<Described>, images: &mut Images) -> Result<Vec<Material>, SceneError> {
    images.decode();
    let mut told = HashSet::new();
    for (path, map) in described.iter().flat_map(|d| d.more.maps.iter().map(|map| (&d.path, map))) {
        if let Err(what) = images.get(map.file)
            && told.insert(map.file)
        {
            warn_of_image(path, map, what);
        }
    }
    let mut materials = Vec::new();
    for described in &described {
        let named = |what| SceneError::file(&described.path, format!("material `{}`: {what}", described.name));
        materials.push(material(described, images).map_err(named)?);
    }
    note_cut_outs(&described, images);
    Ok(materials)
}

/// Tells the user once of materials that are cut out without a statement that says so.
fn note_cut_outs(described: &[Described], images: &Images) {
    let cut_out = |described: &&Described| described.cut_out(images).is_some();
    let Some(first) = described.iter().find(cut_out) else { return };
    // A material whose image is in tiles is there once for each.
    let names: HashSet<&str> = described.iter().filter(cut_out).map(|described| &*described.name).collect();
    let others = match names.len() - 1 {
        0 => String::new(),
        n => format!(" and {n} more"),
    };
    tracing::info!(
        "{}: material `{}`{others}: the image of `map_Kd` is cut out by its opacity, as a leaf is, though no `map_d` \
         says so",
        shown(&first.path),
        first.name.escape_debug()
    );
}

impl Described {
    /// Returns the map of colours if its image is cut out, as that of a leaf, and the material says nothing of opacity.
    /// Many programs leave out `map_d`, and the background of a leaf is not meant to be seen.
    fn cut_out(&self, images: &Images) -> Option<&Map> {
        let Self { spec, more, .. } = self;
        let is_opacity = |map: &Map| matches!(map.term, Term::Opacity | Term::Transparency);
        let is_stated = more.maps.iter().any(is_opacity)
            || spec.d.is_some_and(|d| d != 1.0)
            || spec.tr.is_some_and(|tr| tr != 0.0)
            || matches!(spec.illum, Some(4 | 6 | 7 | 9));
        let is_cut_out =
            |map: &&Map| map.term == Term::BaseColour && images.get(map.file).is_ok_and(|image| image.is_cut_out());
        if is_stated { None } else { more.maps.iter().rev().find(is_cut_out) }
    }
}

fn warn_of_image(path: &Path, map: &Map, what: &str) {
    tracing::warn!("{}:{}: the image is not shown: {}", shown(path), map.line, one_line(what));
}

/// Makes a material. A colour that is stated by its map alone is white. So is a black `Kd` or `Ke` beside its map, as
/// the map would never be seen: Maya writes `Kd 0 0 0` for each material with an image.
fn material(described: &Described, images: &mut Images) -> Checked<Material> {
    let Described { spec, name, path, more } = described;
    let mut spec = spec.clone();
    let maps = || more.maps.iter().filter(|map| images.get(map.file).is_ok());
    let has_map = |term: Term| maps().any(|map| map.term == term);
    let white = |colour: &mut Option<[f32; 3]>, term: Term| {
        let is_black = term != Term::Specular && *colour == Some([0.0; 3]);
        if (colour.is_none() || is_black) && has_map(term) {
            *colour = Some([1.0; 3]);
        }
    };
    white(&mut spec.kd, Term::BaseColour);
    white(&mut spec.ks, Term::Specular);
    white(&mut spec.ke, Term::Emission);
    let (has_roughness, has_metal) = (has_map(Term::Roughness), has_map(Term::Metallic));
    let has_opacity = has_map(Term::Opacity) || has_map(Term::Transparency);
    let mut material = spec.material(name)?;
    let number = |keyword: &str| more.numbers.get(keyword).copied();
    material.clearcoat = Clearcoat { factor: number("Pc").unwrap_or(0.0), roughness: number("Pcr").unwrap_or(0.0) };
    material.sheen = Sheen { colour: glam::Vec3::splat(number("Ps").unwrap_or(0.0)), ..Sheen::default() };
    if number("Pr").is_some() || number("Pm").is_some() || has_roughness || has_metal {
        material.microfacet = Some(Microfacet {
            roughness: number("Pr").unwrap_or(if has_roughness { 1.0 } else { DEFAULT_ROUGHNESS }),
            metallic: number("Pm").unwrap_or(if has_metal { 1.0 } else { 0.0 }),
            transmission: if material.lobes.refraction { 1.0 } else { 0.0 },
            is_solid: material.lobes.refraction,
            ..Microfacet::default()
        });
        material.ks = glam::Vec3::ONE;
        // The opacity of an image of colours is not meant unless map_d names it, or the image is cut out.
        if !has_opacity && material.d == 1.0 {
            material.alpha = Alpha::Opaque;
        }
    }
    for map in &more.maps {
        if images.get(map.file).is_ok() {
            let set = set_map(&mut material, map.term, &map.options, images, map.file);
            set.unwrap_or_else(|what| warn_of_image(path, map, &what));
        }
    }
    if let Some(map) = described.cut_out(images) {
        set_map(&mut material, Term::Opacity, &map.options, images, map.file)?;
    }
    // The image of the base colour has this opacity already.
    let maps = &mut material.maps;
    if let (Some(_), Some(base), Some(opacity)) = (material.microfacet, &maps.base_colour, &maps.opacity)
        && (opacity.image_ix, opacity.channel) == (base.image_ix, Channel::Alpha)
    {
        maps.opacity = None;
    }
    Ok(material)
}

/// Returns the statements of the terms that are rendered. Greys are written as three numbers. Maps and all other
/// statements are left out, and so are wrong ones, which are returned with their lines and what is wrong with them.
fn clean_mtl(text: &str) -> (String, Vec<(usize, String)>) {
    let (mut clean, mut left_out) = (String::new(), Vec::new());
    for (line, statement) in statements(text) {
        let (keyword, rest) = split_keyword(&statement);
        let cleaned = match keyword {
            "newmtl" if rest.is_empty() => Ok(NAMELESS.to_owned()),
            "newmtl" => Ok(rest.to_owned()),
            "Ka" | "Kd" | "Ks" | "Ke" | "Tf" => rgb(keyword, rest),
            "Ns" | "Ni" | "d" | "Tr" => number(keyword, rest),
            "illum" => illum(rest),
            "Pr" | "Pm" | "Ps" | "Pc" | "Pcr" => match fraction(keyword, rest) {
                Ok(_) => continue,
                Err(what) => Err(what),
            },
            _ => continue,
        };
        match cleaned {
            Ok(cleaned) => writeln!(clean, "{keyword} {cleaned}").expect("a String takes what it is given"),
            Err(what) => left_out.push((line, what)),
        }
    }
    (clean, left_out)
}

/// Returns `r g b`. One number alone is a grey.
fn rgb(keyword: &str, rest: &str) -> Checked<String> {
    let parts: Vec<&str> = words(rest).collect();
    for part in &parts {
        if finite(keyword, part)? < 0.0 {
            return Err(format!("{keyword} `{part}` is below 0"));
        }
    }
    match parts[..] {
        [grey] => Ok([grey, grey, grey].join(" ")),
        [_, _, _] => Ok(parts.join(" ")),
        _ => Err(format!("{keyword} has {} numbers: it takes 3, or 1 for a grey", parts.len())),
    }
}

fn number(keyword: &str, rest: &str) -> Checked<String> {
    let mut parts = words(rest);
    // `d -halo x` is an opacity that varies with the angle of view; x is its value where the surface faces the eye.
    let word = parts.find(|part| *part != "-halo").unwrap_or_default();
    let number = finite(keyword, word)?;
    let range = match keyword {
        "Ns" => 0.0..=1e6,
        "Ni" if number != 0.0 => 0.001..=100.0,
        _ => 0.0..=1.0,
    };
    match range.contains(&number) {
        true => Ok(word.to_owned()),
        false => Err(format!("{keyword} = {number} is outside {} to {}", range.start(), range.end())),
    }
}

fn illum(rest: &str) -> Checked<String> {
    match words(rest).next().unwrap_or_default().parse::<f32>() {
        Ok(illum) if (0.0..=10.0).contains(&illum) && illum.fract() == 0.0 => Ok(illum.to_string()),
        _ => Err(format!("illum `{rest}` is not one of 0 to 10")),
    }
}

fn finite(keyword: &str, word: &str) -> Checked<f32> {
    match word.parse::<f32>() {
        Ok(number) if number.is_finite() => Ok(number),
        Err(_) if word.replacen(',', ".", 1).parse::<f32>().is_ok() => {
            Err(format!("{keyword} `{word}` is not a number: decimals need a point in place of the comma"))
        }
        _ => Err(format!("{keyword} `{word}` is not a finite number")),
    }
}

/// Converts a material of tobj, which keeps the terms that it does not know (Tf, Tr) as text.
fn spec(material: &tobj::Material) -> MaterialSpec {
    let unknown = |term: &str| -> Option<Vec<f32>> {
        material.unknown_param.get(term).map(|text| text.split_whitespace().flat_map(str::parse).collect())
    };
    MaterialSpec {
        ka: material.ambient,
        kd: material.diffuse,
        ks: material.specular,
        ke: material.emissive,
        tf: unknown("Tf").and_then(|tf| tf.try_into().ok()),
        ns: material.shininess,
        ni: material.optical_density,
        d: material.dissolve,
        // Files often have both; the format documents only d.
        tr: unknown("Tr").filter(|_| material.dissolve.is_none()).and_then(|tr| tr.first().copied()),
        illum: material.illumination_model,
        ..MaterialSpec::default()
    }
}
