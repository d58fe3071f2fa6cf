//! Animations: the nodes of a document at a moment. Each channel of an animation drives one property of one node by
//! keys.

use std::collections::{HashMap, HashSet};

use glam::{DQuat, Mat4};
use gltf::json::{
    Node, Root,
    accessor::Type,
    animation::{Animation, Channel, Interpolation, Property, Sampler},
    scene::UnitQuaternion,
    validation::Checked::Valid,
};

use super::{accessor::Accessor, document::Document, pointers};
use crate::scene::model::{
    AnimationInfo, LoadOptions,
    error::Checked,
    keys::{KeyTimes, KeyValue, Place},
    load_options::{AnimationChoice, Moment},
};

/// Begins the note that lists what a later animation does not drive, since one before it does.
pub(super) const DRIVEN_BEFORE: &str = "parts of animations that an earlier one drives, which counts";
/// Begins the note of a document whose animations are not shown.
const NOT_SHOWN: &str = "animations, which --at SECONDS shows";
/// Most nodes between an animated node and its camera.
const MOST_BETWEEN: usize = 8;

/// Returns the nodes that differ from those of the document, by index. Without a moment, these are the nodes of
/// animated cameras, where their animations begin: the first picture of a film says where its camera is, and the node
/// of such a camera often has no place of its own.
///
/// # Errors
/// The document has no animation of the name that the options choose.
pub(super) fn animated_nodes(document: &Document, options: &LoadOptions) -> Checked<HashMap<usize, Node>> {
    let animations = &document.root.animations;
    let Some(moment) = options.moment() else {
        if options.animation != AnimationChoice::None {
            (0..animations.len()).for_each(|ix| document.note(NOT_SHOWN, name_of(animations, ix)));
        }
        let all: Vec<usize> = (0..animations.len()).collect();
        return Ok(driven(document, &all, f64::NEG_INFINITY, |ix| carries_camera(&document.root, ix)));
    };
    let Moment { seconds, animation } = moment;
    Ok(driven(document, &playing(document, animation)?, seconds, |_| true))
}

/// Returns the indices of the animations that play.
pub(super) fn playing(document: &Document, choice: &AnimationChoice) -> Checked<Vec<usize>> {
    let animations = &document.root.animations;
    let names: Vec<String> = (0..animations.len()).map(|ix| name_of(animations, ix)).collect();
    choice.among(&names.iter().map(String::as_str).collect::<Vec<_>>())
}

pub(super) fn name_of(animations: &[Animation], ix: usize) -> String {
    animations[ix].name.clone().unwrap_or_else(|| format!("animations[{ix}]"))
}

/// Returns the nodes that animations drive, in their states at a time. Channels that are wrong are left out.
fn driven(
    document: &Document,
    animations: &[usize],
    seconds: f64,
    counts: impl Fn(usize) -> bool,
) -> HashMap<usize, Node> {
    let (mut nodes, mut is_driven) = (HashMap::new(), HashSet::new());
    for &animation_ix in animations {
        let animation = &document.root.animations[animation_ix];
        for (channel_ix, channel) in animation.channels.iter().enumerate() {
            let node_ix = channel.target.node.value();
            let Valid(property) = channel.target.path else { continue };
            if !counts(node_ix) {
                continue;
            }
            let path = format!("animations[{animation_ix}].channels[{channel_ix}]");
            if is_driven.contains(&(node_ix, word(property))) {
                let name = name_of(&document.root.animations, animation_ix);
                document.note(DRIVEN_BEFORE, format!("{} of nodes[{node_ix}] in `{name}`", word(property)));
                continue;
            }
            let value = value_at(document, animation, channel, property, (&path, seconds));
            let Some(value) = document.or_left_out(value) else { continue };
            let node = nodes.entry(node_ix).or_insert_with(|| parts_of(&document.root.nodes[node_ix]));
            set(node, property, &value);
            is_driven.insert((node_ix, word(property)));
        }
    }
    nodes
}

fn word(property: Property) -> &'static str {
    match property {
        Property::Translation => "translation",
        Property::Rotation => "rotation",
        Property::Scale => "scale",
        Property::MorphTargetWeights => "weights",
    }
}

/// Returns a node whose transform is in parts, which can be replaced one by one.
fn parts_of(node: &Node) -> Node {
    let mut node = node.clone();
    if let Some(matrix) = node.matrix.take() {
        let (scale, rotation, translation) = Mat4::from_cols_array(&matrix).to_scale_rotation_translation();
        node.scale = Some(scale.to_array());
        node.rotation = Some(UnitQuaternion(rotation.to_array()));
        node.translation = Some(translation.to_array());
    }
    node
}

fn set(node: &mut Node, property: Property, value: &[f32]) {
    let three = || [value[0], value[1], value[2]];
    match property {
        Property::Translation => node.translation = Some(three()),
        Property::Rotation => node.rotation = Some(UnitQuaternion([value[0], value[1], value[2], value[3]])),
        Property::Scale => node.scale = Some(three()),
        Property::MorphTargetWeights => node.weights = Some(value.to_vec()),
    }
}

fn value_at(
    document: &Document,
    animation: &Animation,
    channel: &Channel,
    property: Property,
    (path, seconds): (&str, f64),
) -> Checked<Vec<f32>> {
    let node_ix = channel.target.node.value();
    let node = document.root.nodes.get(node_ix).ok_or_else(|| format!("{path}: there is no nodes[{node_ix}]"))?;
    let sampler_ix = channel.sampler.value();
    let sampler = animation.samplers.get(sampler_ix).ok_or_else(|| format!("{path}: there is no such sampler"))?;
    let (type_, n) = match property {
        Property::Translation | Property::Scale => (Type::Vec3, 3),
        Property::Rotation => (Type::Vec4, 4),
        Property::MorphTargetWeights => (Type::Scalar, n_targets(&document.root, node)),
    };
    let keys = Keys::new(document, sampler, path, Driven { type_, n, turns: property == Property::Rotation })?;
    let value = keys.at(seconds)?;
    Ok(value.into_iter().map(|number| number as f32).collect())
}

fn n_targets(root: &Root, node: &Node) -> usize {
    let mesh = node.mesh.and_then(|mesh| root.meshes.get(mesh.value()));
    let of_primitives = mesh.into_iter().flat_map(|mesh| &mesh.primitives);
    of_primitives.filter_map(|primitive| Some(primitive.targets.as_ref()?.len())).max().unwrap_or_default()
}

/// What the keys of a sampler are values of.
#[derive(Clone, Copy)]
pub(super) struct Driven {
    /// The type of the accessor.
    pub type_: Type,
    /// Numbers of a value.
    pub n: usize,
    /// Whether the values are quaternions.
    pub turns: bool,
}

/// The keys of a sampler.
pub(super) struct Keys<'a> {
    path: &'a str,
    /// The times of the keys, seconds, ascending. There is at least one.
    times: Vec<f64>,
    values: Accessor<'a>,
    interpolation: Interpolation,
    /// Whether the values are quaternions.
    turns: bool,
    /// Numbers of a value.
    n: usize,
}

/// What a key has at its place in the values of a cubic spline.
#[derive(Clone, Copy)]
enum Part {
    InTangent,
    Value,
    OutTangent,
}

impl<'a> Keys<'a> {
    pub fn new(
        document: &'a Document,
        sampler: &Sampler,
        path: &'a str,
        Driven { type_, n, turns }: Driven,
    ) -> Checked<Self> {
        let Valid(interpolation) = sampler.interpolation else {
            return Err(format!("{path}: its interpolation is unknown"));
        };
        let times = times(document, sampler, path)?;
        let values = Accessor::of_numbers(document, sampler.output, type_, format!("{path}: output"))?;
        let n_parts = if interpolation == Interpolation::CubicSpline { 3 } else { 1 };
        let n_elements = n_parts * if type_ == Type::Scalar { n } else { 1 };
        if values.n < times.len().saturating_mul(n_elements) {
            return Err(format!("{path}: {} keys have {} values", times.len(), values.n / n_elements.max(1)));
        }
        Ok(Self { path, times, values, interpolation, turns, n })
    }

    /// Returns a part of a key.
    fn part(&self, key_ix: usize, part: Part) -> Checked<Vec<f64>> {
        let place = match (self.interpolation, part) {
            (Interpolation::CubicSpline, Part::InTangent) => 3 * key_ix,
            (Interpolation::CubicSpline, Part::Value) => 3 * key_ix + 1,
            (Interpolation::CubicSpline, Part::OutTangent) => 3 * key_ix + 2,
            _ => key_ix,
        };
        if self.values.n_components == 1 {
            let number = |ix| Ok(f64::from(self.values.numbers::<1>(place * self.n + ix, 0.0)?[0]));
            return (0..self.n).map(number).collect();
        }
        Ok(self.values.numbers::<4>(place, 0.0)?[..self.n].iter().map(|number| f64::from(*number)).collect())
    }

    /// Returns the value at a time: before the first key that of the first, and behind the last that of the last.
    pub fn at(&self, seconds: f64) -> Checked<Vec<f64>> {
        let place = Place::among(&self.times, |time| *time, seconds);
        let value = match self.interpolation {
            Interpolation::Linear if place.share > 0.0 => self.linear(place)?,
            Interpolation::CubicSpline if place.share > 0.0 => self.cubic(place)?,
            _ => self.part(place.from, Part::Value)?,
        };
        if self.turns { self.unit(&value).map(|unit| unit.to_array().to_vec()) } else { Ok(value) }
    }

    fn linear(&self, Place { from, share, .. }: Place) -> Checked<Vec<f64>> {
        let [a, b] = [self.part(from, Part::Value)?, self.part(from + 1, Part::Value)?];
        if self.turns {
            return Ok(self.unit(&a)?.towards(&self.unit(&b)?, share).to_array().to_vec());
        }
        Ok(a.towards(&b, share))
    }

    fn cubic(&self, place: Place) -> Checked<Vec<f64>> {
        let from = place.from;
        let (a, b) = (self.part(from, Part::Value)?, self.part(from + 1, Part::Value)?);
        let (leaving, arriving) = (self.part(from, Part::OutTangent)?, self.part(from + 1, Part::InTangent)?);
        Ok((0..self.n).map(|ix| place.spline([a[ix], b[ix]], [leaving[ix], arriving[ix]])).collect())
    }

    fn unit(&self, value: &[f64]) -> Checked<DQuat> {
        let length = value.iter().map(|number| number * number).sum::<f64>().sqrt();
        let is_turn = length > 0.0 && length.is_finite();
        let unit = || DQuat::from_xyzw(value[0], value[1], value[2], value[3]) / length;
        is_turn.then(unit).ok_or_else(|| format!("{}: a rotation is {value:?}", self.path))
    }
}

/// Returns the times of a sampler's keys, seconds.
fn times(document: &Document, sampler: &Sampler, path: &str) -> Checked<Vec<f64>> {
    let input = Accessor::of_numbers(document, sampler.input, Type::Scalar, format!("{path}: input"))?;
    let times: Vec<f64> =
        (0..input.n).map(|ix| Ok(f64::from(input.numbers::<1>(ix, 0.0)?[0]))).collect::<Checked<_>>()?;
    if times.is_empty() {
        return Err(format!("{path}: has no keys"));
    }
    match times.windows(2).find(|pair| pair[0] >= pair[1]) {
        Some(pair) => {
            Err(format!("{path}: the time {} s of a key is not before that of the next, {} s", pair[0], pair[1]))
        }
        None => Ok(times),
    }
}

/// Returns what is known of the animations without their values. Channels that are wrong do not count.
pub(super) fn infos(document: &Document) -> Vec<AnimationInfo> {
    let animations = &document.root.animations;
    let info = |(ix, animation): (usize, &Animation)| {
        let mut key_times = KeyTimes::default();
        let mut is_read = HashSet::new();
        let (mut moved, mut morphed) = (HashSet::new(), HashSet::new());
        for channel in &animation.channels {
            let Some(sampler) = animation.samplers.get(channel.sampler.value()) else { continue };
            let Valid(property) = channel.target.path else { continue };
            let kind = if property == Property::MorphTargetWeights { &mut morphed } else { &mut moved };
            kind.insert(channel.target.node.value());
            if !is_read.insert(sampler.input.value()) {
                continue;
            }
            let Ok(times) = times(document, sampler, "") else { continue };
            key_times.add(&times);
        }
        let mut changed = HashSet::new();
        for pointer in pointers::of_animation(document, ix) {
            let Some(target) = pointer.target() else { continue };
            let Some(sampler) = animation.samplers.get(pointer.sampler) else { continue };
            changed.insert((target.list, target.ix));
            key_times.add(&times(document, sampler, "").unwrap_or_default());
        }
        let ((begin, end), fps) = (key_times.ends(), key_times.fps());
        let (n_moved, n_morphed) = (moved.len(), morphed.len());
        AnimationInfo { name: name_of(animations, ix), begin, end, fps, n_moved, n_morphed, n_changed: changed.len() }
    };
    animations.iter().enumerate().map(info).collect()
}

/// Returns whether a node leads to a camera and nothing else.
fn carries_camera(root: &Root, ix: usize) -> bool {
    let mut at = Some(ix);
    for _ in 0..MOST_BETWEEN {
        let Some(node) = at.and_then(|ix| root.nodes.get(ix)).filter(|node| node.mesh.is_none()) else { return false };
        at = match node.children.as_deref().unwrap_or_default() {
            [] => return node.camera.is_some(),
            [child] if node.camera.is_none() => Some(child.value()),
            _ => return false,
        };
    }
    false
}
