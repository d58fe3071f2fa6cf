//! The text of a scene file.

use std::fmt::Write;

use glam::{DVec3, Vec3};
use hashbrown::HashMap;

use crate::{
    frame::Denoise,
    scene::{
        formats::material_spec::MaterialSpec,
        meshes::ground,
        model::{
            Camera, Ground, Light, Material, MaterialChoice, Projection, RenderDefaults, Scene, Sky,
            preset::is_replaced,
            scene::{DEFAULT_MATERIAL, GROUND},
        },
        scene_file::{
            overrides::override_terms,
            terms::{Term, TermValue},
        },
    },
    util::text::is_obeyed,
};

/// The `[[mesh]]` table of the input.
pub(super) struct MeshTable {
    pub file: String,
    /// Scene of a glTF file.
    pub scene: Option<String>,
    /// Whether the camera sees the back faces of its single-sided materials.
    pub shows_back_faces: bool,
    /// Which materials of the file are replaced.
    pub replaced: Vec<MaterialChoice>,
}

/// Returns the scene file of a scene that consists of one file.
pub(super) fn scene_file(scene: &Scene, mesh: &MeshTable) -> String {
    let mut text = format!("# {} as a scene of kdray, to be edited.\n\n", quoted(&mesh.file));
    text += &format!("ambient = {}\nbackground = {}\n", ambient(scene), vector(scene.background));
    if let Some(to_viewer) = scene.studio {
        text += &format!("studio = {}\n", vector(to_viewer));
    }
    if mesh.shows_back_faces {
        text += "cull = \"off\"\n";
    }
    if !mesh.replaced.is_empty() {
        let words: Vec<_> = mesh.replaced.iter().map(|choice| quoted(&choice.to_string())).collect();
        text += &format!("replace = [{}]\n", words.join(", "));
    }
    text += &format!("\n[camera]\n{}", camera(&scene.camera, DVec3::ZERO));
    for (name, named) in &scene.cameras {
        text += &format!("\n[[cameras]]\nname = {}\n{}", quoted(name), camera(named, DVec3::ZERO));
    }
    text.extend(scene.lights.iter().map(light));
    text.extend(scene.sky.iter().map(|it| format!("\n[sky]\n{}", sky(it))));
    text += &render(&scene.defaults);
    let materials = materials(scene, &mesh.replaced);
    if !materials.is_empty() {
        text += "\n# Terms that a table leaves out, and maps, are those of the file.\n";
        text += &materials;
    }
    text += &format!("\n[[mesh]]\nfile = {}\n", quoted(&mesh.file));
    if let Some(name) = &mesh.scene {
        text += &format!("scene = {}\n", quoted(name));
    }
    if scene.origin != DVec3::ZERO {
        text += &format!("origin = {:?}    # all other coordinates count from here\n", scene.origin.to_array());
    }
    if !materials.is_empty() {
        text += "override = true\n";
    }
    if let Some(ground::Ground { radius, turn, centre }) = ground::Ground::of(scene) {
        let (albedo, radius, turn) = (vector(Vec3::splat(Sky::GROUND_ALBEDO)), number(radius), number(turn));
        text += &format!(
            "\n[materials.{GROUND:?}]\nKd = {albedo}\n\n[[mesh]]\ngenerator = \"disc\"\nradius = 1.0\nsegments = 64\n\
             material = {GROUND:?}\ntransform = {{ scale = {radius}, rotate = [{turn}, 0.0, 0.0], translate = {} }}\n",
            vector(centre)
        );
    }
    text
}

/// Returns the value of the key `ambient`.
pub(super) fn ambient(scene: &Scene) -> String {
    let sky = vector(scene.ambient);
    match scene.ground {
        Some(Ground { ambient, up }) => format!("{{ sky = {sky}, ground = {}, up = \"{up}\" }}", vector(ambient)),
        None => sky,
    }
}

/// Returns the keys of a camera. `origin` is the point of the file that is the origin of its world space.
pub(crate) fn camera(camera: &Camera, origin: DVec3) -> String {
    let Camera { eye, target, up, projection } = *camera;
    let point = |p: Vec3| match origin {
        DVec3::ZERO => vector(p),
        _ => format!("{:?}", (p.as_dvec3() + origin).to_array()),
    };
    let (eye, target, up) = (point(eye), point(target), vector(up));
    let projection = match projection {
        Projection::Perspective { vertical_fov_degrees } => format!("vertical_fov = {}", number(vertical_fov_degrees)),
        Projection::Orthographic { height } => format!("orthographic_height = {}", number(height)),
    };
    format!("eye = {eye}\ntarget = {target}\nup = {up}\n{projection}\n")
}

/// Returns the table of a light.
pub(super) fn light(light: &Light) -> String {
    let key = |name: &str, value: Vec3| format!("{name} = {}\n", vector(value));
    let size = |name: &str, value: f32| format!("{name} = {}\n", number(value));
    let (kind, keys) = match *light {
        Light::Point { position, intensity } => {
            ("point", [key("position", position), key("intensity", intensity)].concat())
        }
        Light::Directional { towards, irradiance } => {
            ("directional", [key("direction", -towards), key("irradiance", irradiance)].concat())
        }
        Light::Sun { towards, irradiance, angle_degrees } => {
            let keys = [key("direction", -towards), key("irradiance", irradiance), size("angle", angle_degrees)];
            ("directional", keys.concat())
        }
        Light::Rectangle { position, edge_u, edge_v, radiance } => {
            let direction = edge_u.cross(edge_v).normalize_or(Vec3::NEG_Y);
            let up = key("up", edge_v.normalize_or(Vec3::Y));
            let sides = size("width", 2.0 * edge_u.length()) + &size("height", 2.0 * edge_v.length());
            let keys = [key("position", position), key("direction", direction), up, sides, key("radiance", radiance)];
            ("rectangle", keys.concat())
        }
        Light::Disk { position, towards, radius, radiance } => {
            let placed = key("position", position) + &key("direction", towards);
            ("disk", [placed, size("radius", radius), key("radiance", radiance)].concat())
        }
        Light::Sphere { position, radius, radiance } => {
            ("sphere", [key("position", position), size("radius", radius), key("radiance", radiance)].concat())
        }
        Light::Spot { position, towards, intensity, inner_cos, outer_cos } => {
            let [inner, outer] = [inner_cos, outer_cos].map(|cosine| f64::from(cosine).acos().to_degrees());
            let angles = format!("inner_angle = {inner:?}\nouter_angle = {outer:?}\n");
            let keys = [key("position", position), key("direction", towards), key("intensity", intensity), angles];
            ("spot", keys.concat())
        }
    };
    format!("\n[[light]]\nkind = \"{kind}\"\n{keys}")
}

/// Returns the keys of a sky.
pub(super) fn sky(sky: &Sky) -> String {
    let Sky { towards_sun, up, turbidity, ground_albedo, strength, has_sun } = *sky;
    let (direction, albedo) = (vector(-towards_sun), vector(ground_albedo));
    format!(
        "direction = {direction}\nturbidity = {}\nground_albedo = {albedo}\nstrength = {}\nsun = {has_sun}\n\
         up = \"{up}\"\n",
        number(turbidity),
        number(strength)
    )
}

fn render(defaults: &RenderDefaults) -> String {
    let RenderDefaults {
        width, height, integrator, max_depth, samples, denoise, exposure, is_metered, tonemap, ..
    } = defaults.for_integrator(None);
    let denoise = match denoise {
        Denoise::Off => "denoise = \"off\"\n".to_owned(),
        Denoise::Edge => "denoise = \"edge\"\n".to_owned(),
        Denoise::Paper { threshold } => format!("denoise = \"paper\"\ndenoise_threshold = {}\n", number(threshold)),
    };
    let exposure = if is_metered { "metered = true".to_owned() } else { format!("exposure = {}", number(exposure)) };
    format!(
        "\n[render]\nwidth = {width}\nheight = {height}\nintegrator = \"{integrator}\"\n\
         max_depth = {max_depth}\nsamples = {samples}\n{exposure}\n\
         tonemap = \"{tonemap}\"\n{denoise}"
    )
}

/// Returns the tables of the file's materials that are not replaced, a table for each name.
fn materials(scene: &Scene, replaced: &[MaterialChoice]) -> String {
    let mut by_name: HashMap<&str, Vec<&Material>> = HashMap::new();
    let is_shown = |name: &str| ![DEFAULT_MATERIAL, GROUND].contains(&name) && !is_replaced(replaced, name);
    let of_file = || scene.materials.iter().filter(|material| is_shown(&material.name));
    of_file().for_each(|material| by_name.entry(&material.name).or_default().push(material));
    let tables = of_file().filter_map(|material| {
        let alike = by_name.remove(material.name.as_str())?;
        Some(material_table(scene, material, &alike))
    });
    tables.collect()
}

/// Returns the table of a material. If it does not leave all materials of its name (`alike`) as they are, its lines are
/// comments.
fn material_table(scene: &Scene, material: &Material, alike: &[&Material]) -> String {
    let mut keys = String::new();
    // Ka follows Kd unless it is stated.
    let is_stated = |term: &Term| !(term.is_default && matches!(term.key, "Ka" | "unlit" | "single_scattering"));
    for term in material.terms().into_iter().filter(is_stated) {
        let value = match term.value {
            TermValue::Number(value) if value.is_finite() => number(value),
            TermValue::Number(_) => continue,
            // The key means the colour of Phong's highlight.
            TermValue::Colour(_) if term.key == "Ks" && material.microfacet.is_some() => continue,
            TermValue::Colour(value) => vector(value),
            TermValue::Model(value) => value.to_string(),
            TermValue::Flag(value) => value.to_string(),
        };
        writeln!(keys, "{} = {value}", term.key).expect("a String takes what it is given");
    }
    let header = format!("[materials.{}]\n", quoted(&material.name));
    let maps = material.maps.named().map(|(name, texture)| {
        let image = scene.images.get(texture.image_ix as usize).map_or("", |image| &image.name);
        format!("# {name}: {}\n", quoted(image))
    });
    let maps: String = maps.collect();
    if leaves_as_they_are(&keys, alike) {
        format!("\n{header}{maps}{keys}")
    } else {
        let commented: String = (header + &keys).lines().map(|line| format!("# {line}\n")).collect();
        let why = if alike.len() > 1 { "several materials have this name" } else { "not all terms have keys" };
        format!("\n# Only an example, since {why}:\n{commented}{maps}")
    }
}

/// Returns whether materials that take the terms of a table stay the same.
fn leaves_as_they_are(keys: &str, materials: &[&Material]) -> bool {
    let Ok(spec) = toml::from_str::<MaterialSpec>(keys) else { return false };
    materials.iter().all(|material| {
        let Ok(stated) = spec.material(&material.name) else { return false };
        let mut changed = (*material).clone();
        override_terms(&mut changed, &spec, &stated).is_ok() && changed == **material
    })
}

pub(super) fn vector(v: Vec3) -> String {
    format!("[{}, {}, {}]", number(v.x), number(v.y), number(v.z))
}

/// Returns a number that is read as the same number of single precision.
fn number(value: f32) -> String {
    let short = format!("{value:?}");
    // TOML's numbers are rounded twice, to double and to single precision.
    let is_exact = short.parse::<f64>().is_ok_and(|read| (read as f32).to_bits() == value.to_bits());
    if is_exact { short } else { format!("{:?}", f64::from(value)) }
}

/// Returns a string or a key of TOML on one line, without characters that a terminal would obey.
fn quoted(text: &str) -> String {
    let mut quoted = String::from("\"");
    for c in text.chars() {
        match c {
            '"' | '\\' => quoted.extend(['\\', c]),
            c if is_obeyed(c) => {
                quoted += &format!("\\u{:04x}", u32::from(c));
            }
            c => quoted.push(c),
        }
    }
    quoted.push('"');
    quoted
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_read_as_they_were() {
        for value in [0.1, -0.0, 1.0 / 3.0, 1e-45, f32::MIN_POSITIVE, f32::MAX, 16_777_216.0, 1e16, 1e-7] {
            let table: toml::Table = format!("x = {}", number(value)).parse().unwrap();
            let read = table["x"].as_float().unwrap() as f32;
            assert_eq!(read.to_bits(), value.to_bits(), "{value:?}");
        }
    }

    #[test]
    fn quoted_text_is_read_as_it_was() {
        for text in ["", "a b", "a.b", "\"\\\n\t\u{1b}\u{7f}\u{9b}\u{202e}", "süß 日本"] {
            let table: toml::Table = format!("{} = {}", quoted(text), quoted(text)).parse().unwrap();
            assert_eq!(table[text].as_str(), Some(text));
        }
        assert_eq!(quoted("\u{202e}\n"), "\"\\u202e\\u000a\"");
    }
}
