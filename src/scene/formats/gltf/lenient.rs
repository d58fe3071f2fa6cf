//! The JSON of a glTF file. What the crate `gltf` refuses for one odd value is read again, element by element: values
//! of the wrong type are left out, and required ones that are missing get a value that shows nothing.

use gltf::json::{
    Root, Value, extensions::scene::khr_lights_punctual::Light, mesh::Primitive, validation::Checked::Valid,
};
use serde::de::DeserializeOwned;
use serde_json::{Map, json};
use serde_path_to_error::{Path, Segment};

use super::{deform::MorphTargets, pointers::Pointer};
use crate::{scene::model::error::Checked, util::text::short_line};

/// Most values of one element that are left out. An element with more is left out as a whole.
const MAX_LEFT_OUT: usize = 16;
/// Most elements of a file that are left out as a whole: each takes memory, and a hostile file has one in two bytes.
const MAX_ELEMENTS_LEFT_OUT: usize = 10_000;
/// Most values that are remembered as left out.
const MAX_REMEMBERED: usize = 100;
/// Lists whose elements are named by nobody, so that one of them may be missing. Of others, all are left out.
const LOOSE: [&str; 6] = ["channels", "children", "extensionsRequired", "extensionsUsed", "nodes", "primitives"];

/// The JSON of a file.
pub(super) struct Parsed {
    /// No index in it is checked.
    pub root: Root,
    pub morph_targets: MorphTargets,
    /// The channels of animations that drive what is no part of a node.
    pub pointers: Vec<Pointer>,
    /// JSON paths of the values that are left out, and why.
    pub left_out: Vec<String>,
}

/// What is left out.
#[derive(Default)]
struct LeftOut {
    values: Vec<String>,
    /// Number of elements that are left out as a whole.
    n_elements: usize,
}

impl LeftOut {
    fn push(&mut self, what: String) {
        if self.values.len() < MAX_REMEMBERED {
            self.values.push(what);
        }
    }

    /// Counts an element that is left out as a whole.
    fn count_element(&mut self) -> Checked<()> {
        self.n_elements += 1;
        match self.n_elements > MAX_ELEMENTS_LEFT_OUT {
            true => Err(format!("the JSON: more than {MAX_ELEMENTS_LEFT_OUT} elements cannot be read")),
            false => Ok(()),
        }
    }
}

/// Parses the JSON of a file.
///
/// # Errors
/// It is not JSON, or that of no glTF 2.
pub(super) fn parse(json: &[u8]) -> Checked<Parsed> {
    let parsed = match parse_strictly(json) {
        Some(parsed) => parsed,
        None => parse_leniently(json)?,
    };
    let asset = &parsed.root.asset;
    match asset.min_version.as_ref().unwrap_or(&asset.version) {
        version if version == "2" || version.starts_with("2.") => Ok(parsed),
        version => Err(format!("asset: this is glTF {version}, and only glTF 2 is read")),
    }
}

fn parse_strictly(json: &[u8]) -> Option<Parsed> {
    let root = Root::from_slice(json).ok()?;
    let mut targets = root.meshes.iter().flat_map(|mesh| &mesh.primitives).flat_map(|primitive| &primitive.targets);
    let morph_targets = match targets.next() {
        Some(_) => serde_json::from_slice(json).ok()?,
        None => MorphTargets::default(),
    };
    let has_known_mode = root.materials.iter().all(|material| matches!(material.alpha_mode, Valid(_)));
    // A channel without a node is not read here, so there are no pointers.
    has_known_mode.then_some(Parsed { root, morph_targets, pointers: Vec::new(), left_out: Vec::new() })
}

fn parse_leniently(json: &[u8]) -> Checked<Parsed> {
    let failed = |error: &dyn std::fmt::Display| format!("the JSON: {error}");
    let mut value: Value = serde_json::from_slice(json).map_err(|error| failed(&error))?;
    tidy(&mut value);
    let mut lists = Map::new();
    let document = value.as_object_mut().ok_or_else(|| failed(&"is no object"))?;
    for (name, _) in least_elements() {
        lists.extend(document.remove(name).map(|list| (name.to_owned(), list)));
    }
    let mut left_out = LeftOut::default();
    repair_lights(&mut value, &mut left_out)?;
    if let Some(Value::Number(version)) = value.pointer("/asset/version") {
        value["asset"]["version"] = json!(format!("{:.1}", version.as_f64().unwrap_or_default()));
    }
    // Files of glTF 1 have objects in place of lists.
    if value.pointer("/asset/version").is_none_or(|it| !it.is_string())
        && lists.get("meshes").is_some_and(Value::is_array)
    {
        left_out.push("asset.version: is missing (`2.0` is taken)".to_owned());
        value["asset"] = json!({ "version": "2.0" });
    }
    let mut root: Root = repaired(&mut value, "", &mut left_out).map_err(|error| failed(&error))?;
    let mut lists = Lists { lists, left_out };
    lists.read_pointers_to_nodes();
    let pointers = Pointer::of_animations(lists.lists.get("animations"));
    lists.drop_channels_without_node();
    lists.read_words_in_any_case();
    lists.repair_primitives()?;
    root.accessors = lists.read("accessors")?;
    root.animations = lists.read("animations")?;
    root.buffers = lists.read("buffers")?;
    root.buffer_views = lists.read("bufferViews")?;
    root.cameras = lists.read("cameras")?;
    root.images = lists.read("images")?;
    root.materials = lists.read("materials")?;
    root.meshes = lists.read("meshes")?;
    root.nodes = lists.read("nodes")?;
    root.samplers = lists.read("samplers")?;
    root.scenes = lists.read("scenes")?;
    root.skins = lists.read("skins")?;
    root.textures = lists.read("textures")?;
    let Lists { lists, left_out } = lists;
    let morph_targets = serde_json::from_value(Value::Object(lists)).unwrap_or_default();
    Ok(Parsed { root, morph_targets, pointers, left_out: left_out.values })
}

/// Returns the names of a document's lists, each with the required members of its elements. Elements keep their
/// places, since others name them by index.
fn least_elements() -> [(&'static str, Value); 13] {
    let (perspective, orthographic) = (json!({ "znear": 0 }), json!({ "xmag": 1, "zfar": 1, "znear": 0 }));
    [
        ("accessors", json!({ "componentType": 5126, "count": 0, "type": "SCALAR" })),
        ("animations", json!({ "channels": [], "samplers": [] })),
        ("buffers", json!({ "byteLength": 0 })),
        ("bufferViews", json!({ "buffer": u32::MAX, "byteLength": 0 })),
        ("cameras", json!({ "type": "perspective", "perspective": perspective, "orthographic": orthographic })),
        ("images", json!({})),
        ("materials", json!({})),
        ("meshes", json!({ "primitives": [] })),
        ("nodes", json!({})),
        ("samplers", json!({})),
        ("scenes", json!({ "nodes": [] })),
        ("skins", json!({ "joints": [] })),
        ("textures", json!({})),
    ]
}

/// Removes `extras`, which may be anything, and members without a value, and writes whole numbers as such.
fn tidy(value: &mut Value) {
    match value {
        Value::Object(members) => {
            members.retain(|name, member| name != "extras" && !member.is_null());
            members.values_mut().for_each(tidy);
        }
        Value::Array(items) => items.iter_mut().for_each(tidy),
        Value::Number(number) => {
            let whole = number.as_f64().filter(|it| number.is_f64() && it.fract() == 0.0 && it.abs() < 1e15);
            *number = whole.map_or(number.clone(), |whole| (whole as i64).into());
        }
        _ => {}
    }
}

/// Leaves out what cannot be read of lights. One that cannot be read at all becomes one of no type, so that the indices
/// of the others stay.
fn repair_lights(root: &mut Value, left_out: &mut LeftOut) -> Checked<()> {
    let lights = root.pointer_mut("/extensions/KHR_lights_punctual/lights").and_then(Value::as_array_mut);
    for (ix, light) in lights.into_iter().flatten().enumerate() {
        let path = format!("extensions.KHR_lights_punctual.lights[{ix}]");
        if repaired::<Light>(light, &path, left_out).is_err() {
            *light = json!({ "type": "missing" });
            left_out.count_element()?;
        }
    }
    Ok(())
}

/// The lists of a document.
struct Lists {
    lists: Map<String, Value>,
    left_out: LeftOut,
}

impl Lists {
    /// Reads a list. That of the meshes is kept, as far as it was read.
    fn read<T: DeserializeOwned>(&mut self, name: &str) -> Checked<Vec<T>> {
        let (_, least) = least_elements().into_iter().find(|(other, _)| *other == name).expect("the list is known");
        let mut items = match self.lists.remove(name) {
            Some(Value::Array(items)) => items,
            None => return Ok(Vec::new()),
            Some(_) => {
                self.left_out.push(format!("{name}: is no list"));
                return Ok(Vec::new());
            }
        };
        let mut read = Vec::new();
        for (ix, item) in items.iter_mut().enumerate() {
            let path = format!("{name}[{ix}]");
            fill_in(item, &least, &path, &mut self.left_out);
            if let Ok(element) = repaired(item, &path, &mut self.left_out) {
                read.push(element);
                continue;
            }
            self.left_out.count_element()?;
            *item = least.clone();
            item.as_object_mut().into_iter().for_each(|members| members.retain(|_, member| !member.is_object()));
            read.push(read_value(item).expect("the least element can be read"));
        }
        if name == "meshes" {
            self.lists.insert(name.to_owned(), Value::Array(items));
        }
        Ok(read)
    }

    /// Leaves out what cannot be read of primitives, so that one with many mistakes does not hide the others of its
    /// mesh.
    fn repair_primitives(&mut self) -> Checked<()> {
        let meshes = self.lists.get_mut("meshes").and_then(Value::as_array_mut);
        for (mesh_ix, mesh) in meshes.into_iter().flatten().enumerate() {
            let Some(Value::Array(primitives)) = mesh.get_mut("primitives") else { continue };
            let mut kept = Vec::new();
            for (ix, mut primitive) in std::mem::take(primitives).into_iter().enumerate() {
                let path = format!("meshes[{mesh_ix}].primitives[{ix}]");
                match repaired::<Primitive>(&mut primitive, &path, &mut self.left_out) {
                    Ok(_) => kept.push(primitive),
                    Err(_) => self.left_out.count_element()?,
                }
            }
            *primitives = kept;
        }
        Ok(())
    }

    /// Makes channels with pointers to nodes, such as `/nodes/3/rotation`, channels of these nodes.
    fn read_pointers_to_nodes(&mut self) {
        let animations = self.lists.get_mut("animations").and_then(Value::as_array_mut);
        let channels = animations.into_iter().flatten().filter_map(|it| it.get_mut("channels")?.as_array_mut());
        for target in channels.flatten().filter_map(|channel| channel.get_mut("target")) {
            let pointer = target.pointer("/extensions/KHR_animation_pointer/pointer").and_then(Value::as_str);
            let of_node = pointer.and_then(|pointer| pointer.strip_prefix("/nodes/")?.split_once('/'));
            let Some((Ok(node), path)) = of_node.map(|(node, path)| (node.parse::<u32>(), path)) else { continue };
            if ["translation", "rotation", "scale", "weights"].contains(&path) {
                *target = json!({ "node": node, "path": path });
            }
        }
    }

    /// Drops the channels of animations that move no node but, for example, a material: there can be thousands.
    fn drop_channels_without_node(&mut self) {
        let animations = self.lists.get_mut("animations").and_then(Value::as_array_mut);
        for animation in animations.into_iter().flatten() {
            if let Some(channels) = animation.get_mut("channels").and_then(Value::as_array_mut) {
                channels.retain(|channel| channel.pointer("/target/node").is_some());
            }
        }
    }

    /// Writes the modes of alpha in capitals.
    fn read_words_in_any_case(&mut self) {
        let materials = self.lists.get_mut("materials").and_then(Value::as_array_mut);
        for (ix, material) in materials.into_iter().flatten().enumerate() {
            let Some(Value::String(mode)) = material.get_mut("alphaMode") else { continue };
            let capitals = mode.to_ascii_uppercase();
            let is_known = ["OPAQUE", "MASK", "BLEND"].contains(&&capitals[..]);
            if !is_known || *mode != capitals {
                let taken = if is_known { &capitals } else { "OPAQUE" };
                self.left_out.push(short_line(&format!("materials[{ix}].alphaMode: `{mode}` (`{taken}` is taken)")));
                *mode = taken.to_owned();
            }
        }
    }
}

/// Adds the members of `least` that an element at `path` lacks. Objects in `least` are added to only.
fn fill_in(element: &mut Value, least: &Value, path: &str, left_out: &mut LeftOut) {
    let (Value::Object(members), Value::Object(least)) = (element, least) else { return };
    for (name, value) in least {
        let path = format!("{path}.{name}");
        match members.get_mut(name) {
            Some(member) => fill_in(member, value, &path, left_out),
            None if value.is_object() => {}
            None => {
                // A scene without nodes is empty.
                if name != "nodes" {
                    left_out.push(format!("{path}: is missing"));
                }
                members.insert(name.clone(), value.clone());
            }
        }
    }
}

/// Reads an element. Whatever reads the crate's types from values calls this function: each other way to do so would be
/// compiled for all of them once more.
pub(super) fn read_value<T: DeserializeOwned>(
    json: &Value,
) -> Result<T, serde_path_to_error::Error<serde_json::Error>> {
    serde_path_to_error::deserialize(json)
}

/// Reads an element, and removes what cannot be read. `path` is its JSON path.
///
/// # Errors
/// The element as a whole cannot be read.
fn repaired<T: DeserializeOwned>(element: &mut Value, path: &str, left_out: &mut LeftOut) -> Checked<T> {
    for _ in 0..=MAX_LEFT_OUT {
        let error = match read_value(element) {
            Ok(read) => return Ok(read),
            Err(error) => error,
        };
        let is_removed = remove(element, error.path());
        let place = if is_removed { format!("{path}.{}", error.path()) } else { path.to_owned() };
        let what = short_line(&format!("{}: {}", place.trim_start_matches('.'), error.inner()));
        if !is_removed {
            left_out.push(what);
            return Err(error.inner().to_string());
        }
        left_out.push(what);
    }
    let what = "has too many values that cannot be read";
    left_out.push(format!("{path}: {what}"));
    Err(what.to_owned())
}

/// Removes a part of an element, with the list that it is in if the places in that have a meaning. Returns false if it
/// is the element itself.
fn remove(element: &mut Value, path: &Path) -> bool {
    let steps: Vec<&Segment> = path.iter().take_while(|step| !matches!(step, Segment::Unknown)).collect();
    let steps = match &steps[..] {
        [.., Segment::Map { key }, Segment::Seq { .. }] if !LOOSE.contains(&key.as_str()) => &steps[..steps.len() - 1],
        steps => steps,
    };
    let Some((last, steps)) = steps.split_last() else { return false };
    let parent = steps.iter().try_fold(element, |at, step| match step {
        Segment::Seq { index } => at.get_mut(*index),
        Segment::Map { key } => at.get_mut(key),
        _ => Some(at),
    });
    match (parent, last) {
        (Some(Value::Object(members)), Segment::Map { key }) => members.remove(key).is_some(),
        (Some(Value::Array(items)), Segment::Seq { index }) if *index < items.len() => {
            items.remove(*index);
            true
        }
        _ => false,
    }
}

#[cfg(test)]
mod tests {
    use gltf::json::material::AlphaMode;

    use super::*;

    fn parsed(json: Value) -> Parsed {
        parse(json.to_string().as_bytes()).unwrap()
    }

    #[test]
    fn odd_values_are_left_out_and_elements_keep_their_places() {
        let Parsed { root, left_out, .. } = parsed(json!({
            "asset": { "version": "2", "extras": 7 },
            "scenes": [{ "extras": "x" }, { "nodes": [0, 1] }],
            "nodes": [{ "name": 5, "mesh": 1.0 }, "node", { "mesh": 0, "scale": [1, "2", 3], "children": null }],
            "materials": [{
                "pbrMetallicRoughness": {
                    "roughnessFactor": null, "metallicFactor": "shiny", "baseColorFactor": [1, 1],
                },
                "extensions": { "KHR_materials_ior": { "ior": [] }, "KHR_materials_unlit": {} },
                "alphaMode": "blend",
            }],
            "accessors": [{ "componentType": 5126, "count": 3 }],
            "cameras": [{ "type": "perspective", "perspective": { "yfov": 0.7 } }],
            "meshes": [{}, { "primitives": [{ "attributes": { "POSITION": 0, "NORMAL": -1 } }, 7] }],
        }));
        assert_eq!((root.scenes.len(), root.nodes.len(), root.meshes.len()), (2, 3, 2));
        assert!(root.scenes[0].nodes.is_empty() && root.nodes[1].mesh.is_none());
        assert_eq!(root.nodes[0].mesh.map(|mesh| mesh.value()), Some(1));
        assert_eq!((root.nodes[2].mesh.map(|mesh| mesh.value()), root.nodes[2].scale), (Some(0), None));
        let material = &root.materials[0];
        assert!(matches!(material.alpha_mode, Valid(AlphaMode::Blend)));
        assert_eq!(material.pbr_metallic_roughness.roughness_factor.0, 1.0);
        let extensions = material.extensions.as_ref().unwrap();
        assert!(extensions.unlit.is_some() && extensions.ior.as_ref().is_some_and(|ior| ior.ior.0 == 1.5));
        assert_eq!(root.meshes[1].primitives[0].attributes.len(), 1);
        assert_eq!(root.cameras[0].perspective.as_ref().unwrap().yfov, 0.7);
        let left_out = left_out.join("\n");
        for place in [
            "nodes[0].name: ",
            "nodes[1]: ",
            "nodes[2].scale",
            "materials[0].pbrMetallicRoughness.metallicFactor: ",
            "materials[0].pbrMetallicRoughness.baseColorFactor: ",
            "materials[0].extensions.KHR_materials_ior",
            "materials[0].alphaMode: `blend` (`BLEND` is taken)",
            "accessors[0].type: is missing",
            "cameras[0].perspective.znear: is missing",
            "meshes[0].primitives: is missing",
            "meshes[1].primitives[0].attributes.NORMAL: ",
            "meshes[1].primitives[1]: ",
        ] {
            assert!(left_out.contains(place), "{place} is not in\n{left_out}");
        }
    }

    #[test]
    fn what_is_no_gltf_is_refused() {
        for (json, what) in [
            ("[]", "is no object"),
            ("{}", "missing field `asset`"),
            (r#"{ "asset": { "version": "1.0" } }"#, "asset: this is glTF 1.0"),
            (r#"{ "asset": { "version": "1.0" }, "scene": "defaultScene", "nodes": {} }"#, "asset: this is glTF 1.0"),
        ] {
            let error = parse(json.as_bytes()).err().unwrap();
            assert!(error.contains(what), "{json}: {error}");
        }
    }

    /// Each repair parses the element again, so the number of repairs is bounded.
    #[test]
    fn an_element_of_nothing_but_mistakes_is_left_out() {
        let attributes: Map<String, Value> = (0..1000).map(|ix| (format!("_{ix}"), json!("x"))).collect();
        let meshes = json!([{ "primitives": [{ "attributes": attributes }] }]);
        let Parsed { root, left_out, .. } = parsed(json!({ "asset": { "version": "2.0" }, "meshes": meshes }));
        assert!(root.meshes[0].primitives.is_empty());
        assert_eq!(left_out.len(), MAX_LEFT_OUT + 2);
    }

    #[test]
    fn a_primitive_of_many_mistakes_does_not_hide_its_neighbours() {
        let primitive = json!({ "attributes": { "POSITION": 0 }, "material": -1 });
        let meshes = json!([{ "primitives": vec![primitive; 20] }]);
        let Parsed { root, left_out, .. } = parsed(json!({ "asset": { "version": 2.0 }, "meshes": meshes }));
        assert_eq!((root.meshes[0].primitives.len(), left_out.len()), (20, 20));
    }

    /// Their elements are named by their places, or belong to those of another list.
    #[test]
    fn lists_in_which_places_have_a_meaning_are_left_out_whole() {
        let lights = json!([null, { "type": 5 }, { "type": "point", "color": [1, 1, 1, 1] }]);
        let Parsed { root, .. } = parsed(json!({
            "asset": { "version": "2.0" },
            "extensions": { "KHR_lights_punctual": { "lights": lights } },
            "skins": [{ "joints": [1, "x", 3] }],
            "meshes": [{ "primitives": [], "weights": [0.5, "x", 1] }],
            "scenes": [{ "nodes": [0, "x", 1] }],
        }));
        assert!(root.skins[0].joints.is_empty() && root.meshes[0].weights.is_none());
        assert_eq!(root.scenes[0].nodes.len(), 2);
        let lights = &root.extensions.unwrap().khr_lights_punctual.unwrap().lights;
        assert_eq!(lights.len(), 3);
        assert!(matches!(lights[2].type_, Valid(_)) && !matches!(lights[1].type_, Valid(_)));
    }

    /// Odd values of any number of elements are passed over, but not any number of elements.
    #[test]
    fn a_file_of_nothing_but_mistakes_is_refused() {
        let list = "1,".repeat(20_000);
        let lights = format!(r#""extensions": {{ "KHR_lights_punctual": {{ "lights": [{list}1] }} }}"#);
        for lists in [format!(r#""accessors": [{list}1]"#), lights] {
            let json = format!(r#"{{ "asset": {{ "version": "2.0" }}, {lists} }}"#);
            assert!(parse(json.as_bytes()).err().unwrap().contains("more than 10000 elements cannot be read"));
        }
        let nodes = vec![json!({ "mesh": 0, "skin": -1 }); 20_000];
        let Parsed { root, left_out, .. } = parsed(json!({ "asset": { "version": "2.0" }, "nodes": nodes }));
        assert_eq!((root.nodes.len(), left_out.len()), (20_000, MAX_REMEMBERED));
    }
}
