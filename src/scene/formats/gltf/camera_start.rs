//! Where animated cameras begin. An animation is not shown, but the first picture of a film says where its camera is,
//! and the node of such a camera often has no place of its own.

use std::collections::HashMap;

use gltf::json::{
    Node, Root,
    accessor::Type,
    animation::{Animation, Channel, Interpolation, Property},
    scene::UnitQuaternion,
    validation::Checked::Valid,
};

use super::{accessor::Accessor, document::Document};
use crate::scene::model::error::Checked;

/// Most nodes between an animated node and its camera.
const MOST_BETWEEN: usize = 8;

/// Returns the nodes of animated cameras as their animations begin, by index. A node counts that carries a camera and
/// nothing else.
pub(super) fn camera_starts(document: &Document) -> HashMap<usize, Node> {
    let mut starts = HashMap::new();
    for animation in &document.root.animations {
        let mut of_animation: HashMap<usize, Node> = HashMap::new();
        for channel in &animation.channels {
            let ix = channel.target.node.value();
            if starts.contains_key(&ix) || !carries_camera(&document.root, ix) {
                continue;
            }
            let node = of_animation.entry(ix).or_insert_with(|| document.root.nodes[ix].clone());
            // What is wrong with an animation is no reason to refuse the file.
            let _ = begin(document, animation, channel, node);
        }
        starts.extend(of_animation);
    }
    starts
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

/// Gives a node the first value of a channel.
fn begin(document: &Document, animation: &Animation, channel: &Channel, node: &mut Node) -> Checked<()> {
    let sampler = animation.samplers.get(channel.sampler.value()).ok_or("no such sampler")?;
    // The value of a cubic spline's key comes after a tangent.
    let value_ix = usize::from(sampler.interpolation == Valid(Interpolation::CubicSpline));
    let first = |type_: Type| -> Checked<[f32; 4]> {
        let values = Accessor::new(document, sampler.output, &[type_], "animations")?;
        if value_ix < values.n { values.numbers(value_ix, 0.0) } else { Err("no keys".to_owned()) }
    };
    match channel.target.path {
        Valid(Property::Translation) => node.translation = Some(three(first(Type::Vec3)?)),
        Valid(Property::Rotation) => node.rotation = Some(UnitQuaternion(first(Type::Vec4)?)),
        Valid(Property::Scale) => node.scale = Some(three(first(Type::Vec3)?)),
        _ => {}
    }
    Ok(())
}

fn three([x, y, z, _]: [f32; 4]) -> [f32; 3] {
    [x, y, z]
}
