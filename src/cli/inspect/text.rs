//! The contents of a scene as tables.

use serde_json::{Map, Value};

use super::{
    LightUse, MaterialUse,
    contents::{AnimationUse, CameraUse, Contents, ImageUse, MeshUse, SkyUse, TextureMemory},
    vector,
};
use crate::cli::table::table;

/// Maps that can vary the opacity of a surface.
const OF_OPACITY: [&str; 2] = ["base colour", "opacity"];
/// Rows of a table beyond which it is cut.
const MAX_ROWS: usize = 40;
/// Characters of a name or a list beyond which it is cut.
const MAX_CHARS: usize = 48;

/// Returns a table, which ends in the number of rows that it leaves out.
pub fn cut_table<const N: usize, T>(header: [&str; N], items: &[T], row: impl Fn(usize, &T) -> [String; N]) -> String {
    let rows: Vec<_> = items.iter().take(MAX_ROWS).enumerate().map(|(ix, item)| row(ix, item)).collect();
    let mut text = table(header, &rows);
    if items.len() > MAX_ROWS {
        text += &format!("… and {} more\n", items.len() - MAX_ROWS);
    }
    text
}

/// Returns a name from a file, without characters that a terminal would obey, and not too long for a table.
pub fn shortened(name: &str) -> String {
    let escaped: String = name.escape_debug().collect();
    match escaped.char_indices().nth(MAX_CHARS) {
        Some((end, _)) => format!("{}…", &escaped[..end]),
        None => escaped,
    }
}

/// Returns the tables of what the scene consists of.
pub fn contents(contents: &Contents, materials: &[MaterialUse], lights: &[LightUse], memory: &TextureMemory) -> String {
    let mut tables = vec![
        cut_table(["mesh", "name", "triangles", "instances", "has"], &contents.meshes, mesh_row),
        cut_table(["look of material", "model", "opacity", "seen from", "terms", "maps"], materials, material_row),
    ];
    if !contents.images.is_empty() {
        tables.push(cut_table(["image", "size", "channels", "bytes", "used by"], &contents.images, image_row));
    }
    let spots: Vec<_> = lights.iter().filter(|light| light.direction.is_some()).collect();
    if !spots.is_empty() {
        tables.push(cut_table(["spot light at", "direction", "inner angle", "outer angle"], &spots, spot_row));
    }
    tables.push(cameras(contents));
    if !contents.animations.is_empty() {
        let header = ["animation", "name", "from s", "to s", "frames/s", "moves", "morphs", "changes"];
        tables.push(cut_table(header, &contents.animations, animation_row));
    }
    tables.extend(contents.sky.iter().map(|sky| table(["sky", ""], &sky_rows(sky))));
    tables.push(memory_table(memory));
    tables.join("\n")
}

fn mesh_row(ix: usize, mesh: &MeshUse) -> [String; 5] {
    let parts = [
        (mesh.uv_sets == 1, "texture coordinates"),
        (mesh.uv_sets == 2, "2 sets of texture coordinates"),
        (mesh.has_colors, "colours"),
        (mesh.has_tangents, "tangents"),
    ];
    let parts: Vec<_> = parts.into_iter().filter_map(|(is_there, part)| is_there.then_some(part)).collect();
    let (triangles, instances) = (mesh.triangles.to_string(), mesh.instances.to_string());
    [ix.to_string(), shortened(&mesh.name), triangles, instances, parts.join(", ")]
}

fn material_row(_: usize, material: &MaterialUse) -> [String; 6] {
    let details = &material.details;
    let sides = if details.double_sided { "both sides" } else { "the front" };
    // Without a term or a map that says otherwise, a surface covers what is behind it.
    let is_covered = !details.terms.contains_key("d") && !details.maps.keys().any(|term| OF_OPACITY.contains(&&**term));
    let opacity = match details.opacity {
        "blend" if is_covered => "opaque",
        "blend" => "blended",
        "mask" => "cut out",
        other => other,
    };
    let term = |(key, value): (&String, &Value)| format!("{key} {}", plain(value));
    let map = |(term, image): (&String, &Value)| format!("{term} {}", shortened(image.as_str().unwrap_or_default()));
    [
        shortened(&material.name),
        details.model.to_owned(),
        opacity.to_owned(),
        sides.to_owned(),
        details.terms.iter().map(term).collect::<Vec<_>>().join(", "),
        listed(&details.maps, map),
    ]
}

/// Returns a value of a term: a grey as one number.
fn plain(value: &Value) -> String {
    match value.as_array().map(Vec::as_slice) {
        Some([r, g, b]) if r == g && g == b => short(r),
        Some(parts) => format!("({})", parts.iter().map(short).collect::<Vec<_>>().join(", ")),
        None => short(value),
    }
}

fn short(value: &Value) -> String {
    match value.as_f64() {
        // Four digits suffice to tell values apart.
        Some(number) if value.is_f64() => format!("{}", (number * 1e4).round() / 1e4),
        _ => value.to_string(),
    }
}

fn listed(map: &Map<String, Value>, item: impl Fn((&String, &Value)) -> String) -> String {
    map.iter().map(item).collect::<Vec<_>>().join(", ")
}

fn animation_row(ix: usize, animation: &AnimationUse) -> [String; 8] {
    let &AnimationUse { begin, end, fps, moved_nodes, morphed_nodes, changed, .. } = animation;
    [
        ix.to_string(),
        shortened(&animation.name),
        format!("{begin:.3}"),
        format!("{end:.3}"),
        fps.map_or("?".to_owned(), |fps| fps.to_string()),
        moved_nodes.to_string(),
        morphed_nodes.to_string(),
        changed.to_string(),
    ]
}

fn image_row(_: usize, image: &ImageUse) -> [String; 5] {
    let uses = image.used_by.iter().take(3).map(|shown| format!("{} of {}", shown.term, shortened(&shown.material)));
    let mut uses = uses.collect::<Vec<_>>().join(", ");
    if image.used_by.len() > 3 {
        uses += &format!(" and {} more", image.used_by.len() - 3);
    }
    let size = format!("{}x{}", image.width, image.height);
    [shortened(&image.name), size, image.channels.to_owned(), image.bytes.to_string(), uses]
}

fn sky_rows(sky: &SkyUse) -> [[String; 2]; 4] {
    let sun = if sky.sun { "towards the sun" } else { "towards the sun, which is hidden" };
    [
        [sun.to_owned(), vector(sky.towards_sun)],
        ["turbidity".to_owned(), sky.turbidity.to_string()],
        ["ground albedo".to_owned(), vector(sky.ground_albedo)],
        ["strength".to_owned(), sky.strength.to_string()],
    ]
}

fn spot_row(_: usize, light: &&LightUse) -> [String; 4] {
    let angle = |angle: Option<f32>| angle.map_or_else(String::new, |angle| format!("{angle:.1}"));
    let direction = light.direction.map_or_else(String::new, vector);
    [vector(light.position), direction, angle(light.inner_angle), angle(light.outer_angle)]
}

/// Returns the table of the cameras that have names, and of the scene's own.
fn cameras(contents: &Contents) -> String {
    let all: Vec<&CameraUse> = std::iter::once(&contents.camera).chain(&contents.cameras).collect();
    let row = |ix: usize, camera: &&CameraUse| {
        // The first row is the camera that is rendered, and the index of the second one is 0.
        let number = if ix == 0 { "shown".to_owned() } else { (ix - 1).to_string() };
        let name = camera.name.as_deref().map_or_else(String::new, shortened);
        let fov = camera.vertical_fov.map_or_else(String::new, |degrees| format!("{degrees:.1}"));
        let height = camera.orthographic_height.map_or_else(String::new, |height| height.to_string());
        [number, name, vector(camera.eye), vector(camera.target), fov, height]
    };
    cut_table(["camera", "name", "eye", "target", "vertical fov", "orthographic height"], &all, row)
}

fn memory_table(memory: &TextureMemory) -> String {
    let TextureMemory { texels, textures, maps, uvs, corners, total } = *memory;
    let rows = [
        ("texels", texels),
        ("textures", textures),
        ("maps", maps),
        ("texture coordinates", uvs),
        ("tangents, colours", corners),
        ("total", total),
    ];
    let rows = rows.map(|(name, bytes)| [name.to_owned(), bytes.to_string()]);
    table(["textures on a device", "bytes"], &rows)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn long_lists_and_names_are_cut() {
        let numbers: Vec<u32> = (0..45).collect();
        let text = cut_table(["n"], &numbers, |_, n| [n.to_string()]);
        assert!(text.ends_with("39\n… and 5 more\n"), "{text}");
        assert!(!cut_table(["n"], &numbers[..40], |_, n| [n.to_string()]).contains('…'));
        assert_eq!(shortened("a\u{1b}\n\u{202e}"), "a\\u{1b}\\n\\u{202e}");
        assert_eq!(shortened(&"ä".repeat(49)), "ä".repeat(48) + "…");
    }
}
