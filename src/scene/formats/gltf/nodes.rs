//! The nodes of a scene, and where they stand in the world.

use std::collections::HashMap;

use glam::{DMat4, DQuat, Mat4, Quat, Vec3};
use gltf::json::{self, Index, Node};

use super::{
    animation::animated_nodes,
    document::{Document, LEFT_OUT, item},
};
use crate::scene::model::{LoadOptions, error::Checked, load_options::find_named};

/// The nodes of a scene, each with its transform.
pub(super) struct Nodes {
    /// Indices of the scene's nodes, parents before their children.
    pub shown: Vec<usize>,
    /// World transforms of the document's nodes, by index. `None` for nodes that belong to nothing.
    world_from_node: Vec<Option<DMat4>>,
    /// The nodes that animations have changed, by index.
    animated: HashMap<usize, Node>,
    /// Whether the user has chosen a moment of the animations.
    pub is_posed: bool,
}

impl Nodes {
    /// Follows the nodes of a scene: the one that the options say by its name or index, else the default one, else the
    /// first. A document without scenes shows all nodes. Animations are shown at the moment that the options state;
    /// without one, animated cameras are where their animations begin.
    ///
    /// A node that does not exist, and the second way to a node, are left out.
    ///
    /// # Errors
    /// There is no such scene, or no such animation.
    pub fn new(document: &Document, options: &LoadOptions) -> Checked<Self> {
        let all = &document.root.nodes[..];
        let animated = animated_nodes(document, options)?;
        let is_posed = options.moment().is_some();
        let mut nodes = Self { shown: Vec::new(), world_from_node: vec![None; all.len()], animated, is_posed };
        let roots = match scene(document, options.scene.as_deref())? {
            Some(ix) => indices(&document.root.scenes[ix].nodes),
            None => parentless(all),
        };
        nodes.shown = nodes.walk(document, all, (roots, true));
        // Joints of skins may hang on nodes that the scene does not show.
        let others = parentless(all).into_iter().filter(|ix| nodes.world_from_node[*ix].is_none()).collect();
        nodes.walk(document, all, (others, false));
        Ok(nodes)
    }

    /// Returns a node as it is shown.
    pub fn node<'a>(&'a self, document: &'a Document, ix: usize) -> &'a Node {
        self.animated.get(&ix).unwrap_or(&document.root.nodes[ix])
    }

    /// Returns a node's transform to world space, if a scene or a parentless node leads to it.
    pub fn world_from_node(&self, ix: usize) -> Option<DMat4> {
        self.world_from_node.get(ix).copied().flatten()
    }

    /// Visits nodes and all below them, and returns them in the order of the visits. Nodes that are not shown may lead
    /// to shown ones: they are left over from editing.
    fn walk(&mut self, document: &Document, all: &[Node], (roots, is_shown): (Vec<usize>, bool)) -> Vec<usize> {
        let mut visited = Vec::new();
        let mut pending: Vec<(usize, Option<usize>)> = roots.into_iter().rev().map(|root| (root, None)).collect();
        while let Some((ix, parent)) = pending.pop() {
            let from = parent.map_or("scenes".to_owned(), |parent| format!("nodes[{parent}].children"));
            let Some(node) = document.or_left_out(item(all, "nodes", ix, &from)) else { continue };
            if self.world_from_node[ix].is_some() {
                if is_shown {
                    document.note(LEFT_OUT, format!("{from}: leads to nodes[{ix}] a second time"));
                }
                continue;
            }
            let world_from_parent = parent.and_then(|parent| self.world_from_node[parent]).unwrap_or_default();
            let shown = self.animated.get(&ix).unwrap_or(node);
            let parent_from_node = document.or_left_out(parent_from_node(shown, ix)).unwrap_or_default();
            self.world_from_node[ix] = Some(world_from_parent * parent_from_node);
            visited.push(ix);
            let children = indices(node.children.as_deref().unwrap_or_default());
            pending.extend(children.into_iter().rev().map(|child| (child, Some(ix))));
        }
        visited
    }
}

/// Returns the index of the scene to show, or `None` if the document has no scenes.
fn scene(document: &Document, name: Option<&str>) -> Checked<Option<usize>> {
    let scenes = &document.root.scenes;
    if let Some(name) = name {
        let names: Vec<_> = scenes.iter().map(|scene| scene.name.as_deref()).collect();
        return find_named("scene", name, &names, "the file has none").map(Some);
    }
    match document.root.scene {
        Some(index) if document.or_left_out(item(scenes, "scenes", index.value(), &"scene")).is_some() => {
            Ok(Some(index.value()))
        }
        _ => Ok((!scenes.is_empty()).then_some(0)),
    }
}

fn indices(nodes: &[Index<Node>]) -> Vec<usize> {
    nodes.iter().map(Index::value).collect()
}

/// Returns the nodes that are no node's child.
fn parentless(all: &[Node]) -> Vec<usize> {
    let mut is_child = vec![false; all.len()];
    for child in all.iter().filter_map(|node| node.children.as_ref()).flatten() {
        if let Some(is_child) = is_child.get_mut(child.value()) {
            *is_child = true;
        }
    }
    (0..all.len()).filter(|ix| !is_child[*ix]).collect()
}

fn parent_from_node(node: &Node, ix: usize) -> Checked<DMat4> {
    let matrix = match node.matrix {
        Some(matrix) => Mat4::from_cols_array(&matrix).as_dmat4(),
        None => {
            let json::scene::UnitQuaternion(rotation) = node.rotation.unwrap_or_default();
            matrix_of(node.scale.unwrap_or([1.0; 3]), rotation, node.translation.unwrap_or_default())
        }
    };
    if matrix.is_finite() { Ok(matrix) } else { Err(format!("nodes[{ix}]: its transform is not finite")) }
}

/// Returns the matrix of a transform in parts. A quaternion of length 0 turns nothing.
pub(super) fn matrix_of(scale: [f32; 3], rotation: [f32; 4], translation: [f32; 3]) -> DMat4 {
    let rotation = Quat::from_array(rotation).as_dquat();
    let rotation = if rotation.length_squared() > 0.0 { rotation.normalize() } else { DQuat::IDENTITY };
    let [scale, translation] = [scale, translation].map(|vector| Vec3::from_array(vector).as_dvec3());
    DMat4::from_scale_rotation_translation(scale, rotation, translation)
}
