//! Animated numbers of cameras, lights and materials (KHR_animation_pointer). Their channels name them by pointers into
//! the JSON.

use std::collections::HashSet;

use gltf::json::{Value, accessor::Type};
use serde::{Serialize, de::DeserializeOwned};
use serde_json::json;

use super::{
    animation::{DRIVEN_BEFORE, Driven, Keys, name_of, playing},
    document::{Document, item},
    lenient::read_value,
};
use crate::scene::model::{LoadOptions, error::Checked};

const NAME: &str = "KHR_animation_pointer";
/// Begins the warning that lists pointers to what is not animated.
const NOT_SHOWN: &str = "animated properties, which stay as the file has them at rest";

/// A channel that drives what is no part of a node.
#[derive(Clone, Debug)]
pub(super) struct Pointer {
    animation_ix: usize,
    channel_ix: usize,
    /// The index of a sampler of the animation.
    pub sampler: usize,
    pointer: String,
}

/// A list of the JSON whose elements are animated.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) enum List {
    Cameras,
    Lights,
    Materials,
}

/// A number of an element of a list, or several numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) struct Target {
    pub list: List,
    pub ix: usize,
    /// Pointer from the element on.
    member: &'static str,
    /// How many numbers there are.
    n: usize,
}

type Members = &'static [(&'static str, usize)];

/// What is animated: a list, the pointer to it, and members of its elements with the numbers that they have.
const KNOWN: [(List, &str, Members); 3] = [
    (List::Cameras, "/cameras/", &[("/perspective/yfov", 1), ("/orthographic/xmag", 1), ("/orthographic/ymag", 1)]),
    (
        List::Lights,
        "/extensions/KHR_lights_punctual/lights/",
        &[("/color", 3), ("/intensity", 1), ("/range", 1), ("/spot/innerConeAngle", 1), ("/spot/outerConeAngle", 1)],
    ),
    (
        List::Materials,
        "/materials/",
        &[
            ("/pbrMetallicRoughness/baseColorFactor", 4),
            ("/emissiveFactor", 3),
            ("/extensions/KHR_materials_emissive_strength/emissiveStrength", 1),
        ],
    ),
];

impl Pointer {
    /// Returns the channels of a list of animations that have pointers.
    pub fn of_animations(animations: Option<&Value>) -> Vec<Self> {
        let list = |value: Option<&Value>| value.and_then(Value::as_array).cloned().unwrap_or_default();
        let of_animation = |(animation_ix, animation): (usize, Value)| {
            let pointer = move |(channel_ix, channel): (usize, Value)| {
                let pointer = channel.pointer("/target/extensions")?.get(NAME)?.get("pointer")?.as_str()?.to_owned();
                let sampler = channel.get("sampler")?.as_u64()?.try_into().ok()?;
                Some(Self { animation_ix, channel_ix, sampler, pointer })
            };
            list(animation.get("channels")).into_iter().enumerate().filter_map(pointer)
        };
        list(animations).into_iter().enumerate().flat_map(of_animation).collect()
    }

    /// Returns what the pointer names, if it is animated.
    pub fn target(&self) -> Option<Target> {
        KNOWN.iter().find_map(|(list, start, members)| {
            let rest = self.pointer.strip_prefix(start)?;
            let (ix, member) = rest.split_at(rest.find('/')?);
            let (member, n) = members.iter().find(|(name, _)| *name == member)?;
            Some(Target { list: *list, ix: ix.parse().ok()?, member, n: *n })
        })
    }
}

/// Gives a document's cameras, lights and materials the numbers that they have at the moment of the options, if there
/// is one. What cannot be animated has a note, and so have channels that are wrong.
pub(super) fn apply(document: &mut Document, options: &LoadOptions) -> Checked<()> {
    let Some(moment) = options.moment() else { return Ok(()) };
    let mut values: Vec<(Target, String, Vec<f64>)> = Vec::new();
    let mut driven = HashSet::new();
    for animation_ix in playing(document, moment.animation)? {
        for pointer in of_animation(document, animation_ix) {
            let Some(target) = pointer.target() else {
                document.note(NOT_SHOWN, &pointer.pointer);
                continue;
            };
            if driven.contains(&target) {
                let name = name_of(&document.root.animations, animation_ix);
                document.note(DRIVEN_BEFORE, format!("{} in `{name}`", pointer.pointer));
                continue;
            }
            if let Some(value) = document.or_left_out(value_at(document, pointer, (target, moment.seconds))) {
                driven.insert(target);
                values.push((target, pointer.pointer.clone(), value));
            }
        }
    }
    for (target, pointer, value) in values {
        let set = set(document, target, &value).map_err(|what| format!("{pointer}: {what}"));
        document.or_left_out(set);
    }
    Ok(())
}

/// Returns the pointers of an animation.
pub(super) fn of_animation(document: &Document, animation_ix: usize) -> &[Pointer] {
    let begin = |ix: usize| document.pointers.partition_point(|pointer| pointer.animation_ix < ix);
    &document.pointers[begin(animation_ix)..begin(animation_ix + 1)]
}

/// Whether animations may change materials.
pub(super) fn change_materials(document: &Document) -> bool {
    document.pointers.iter().filter_map(Pointer::target).any(|target| target.list == List::Materials)
}

fn value_at(document: &Document, pointer: &Pointer, (target, seconds): (Target, f64)) -> Checked<Vec<f64>> {
    let Pointer { animation_ix, channel_ix, sampler, .. } = *pointer;
    let path = format!("animations[{animation_ix}].channels[{channel_ix}]");
    let samplers = &document.root.animations[animation_ix].samplers;
    let sampler = samplers.get(sampler).ok_or_else(|| format!("{path}: there is no such sampler"))?;
    let type_ = match target.n {
        1 => Type::Scalar,
        3 => Type::Vec3,
        _ => Type::Vec4,
    };
    Keys::new(document, sampler, &path, Driven { type_, n: target.n, turns: false })?.at(seconds)
}

fn set(document: &mut Document, target: Target, value: &[f64]) -> Checked<()> {
    let root = &mut document.root;
    let value = match value {
        [number] => json!(*number as f32),
        numbers => json!(numbers.iter().map(|number| *number as f32).collect::<Vec<_>>()),
    };
    let place = (target.ix, target.member, value);
    match target.list {
        List::Cameras => set_in(&mut root.cameras, "cameras", place),
        List::Materials => set_in(&mut root.materials, "materials", place),
        List::Lights => {
            let extension = root.extensions.as_mut().and_then(|extensions| extensions.khr_lights_punctual.as_mut());
            let mut none = Vec::new();
            set_in(extension.map_or(&mut none, |extension| &mut extension.lights), "lights", place)
        }
    }
}

/// Sets a member of an element of a list. The element is written as JSON and read again.
fn set_in<T: Serialize + DeserializeOwned>(
    list: &mut [T],
    name: &str,
    (ix, member, value): (usize, &str, Value),
) -> Checked<()> {
    item(list, name, ix, &NAME)?;
    let mut json = serde_json::to_value(&list[ix]).map_err(|error| error.to_string())?;
    let place = member.split('/').skip(1).fold(&mut json, |json, key| &mut json[key]);
    *place = value;
    list[ix] = read_value(&json).map_err(|error| error.inner().to_string())?;
    Ok(())
}
