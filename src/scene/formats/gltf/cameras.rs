//! Cameras of a scene's nodes.

use std::cell::OnceCell;

use glam::{DMat4, DVec3, Vec3};
use gltf::json::{self, camera::Type, validation::Checked::Valid};

use super::{
    document::{Document, item},
    nodes::Nodes,
};
use crate::scene::model::{
    Camera, Projection,
    camera::{FOV_DEGREES, HEIGHTS},
    error::Checked,
    material::within,
    mesh::MAX_COORDINATE,
};

/// Returns the cameras of a scene's nodes with their names. Each looks at the middle of the scene, whose bounds are
/// those that a function returns, or at a point as far away. `origin` is the point of the file that is the origin of
/// world space.
pub(super) fn cameras(
    document: &Document,
    nodes: &Nodes,
    (bounds, origin): (impl Fn() -> (Vec3, Vec3), DVec3),
) -> Vec<(String, Camera)> {
    let mut cameras = Vec::new();
    let known_bounds = OnceCell::new();
    for &ix in &nodes.shown {
        let node = &document.root.nodes[ix];
        let Some(index) = node.camera else { continue };
        let json = item(&document.root.cameras, "cameras", index.value(), &format_args!("nodes[{ix}].camera"));
        let Some(json) = document.or_left_out(json) else { continue };
        let name = node.name.clone().or_else(|| json.name.clone());
        let name = name.unwrap_or_else(|| format!("camera {}", cameras.len() + 1));
        let view = nodes.world_from_node(ix).and_then(|world_from_node| {
            View::new(DMat4::from_translation(-origin) * world_from_node, *known_bounds.get_or_init(&bounds))
        });
        let Some(view) = view else {
            document.note("cameras whose nodes flatten them or lie too far away, which are left out", name);
            continue;
        };
        let projection = projection(json).map_err(|what| format!("cameras[{index}]: {what}"));
        let Some(projection) = document.or_left_out(projection) else { continue };
        let View { eye, target, up } = view;
        cameras.push((name, Camera { eye, target, up, projection }));
    }
    cameras
}

/// Where a camera stands.
struct View {
    eye: Vec3,
    target: Vec3,
    up: Vec3,
}

impl View {
    /// Returns the view of a node's camera, or `None` if its directions span no picture.
    fn new(world_from_node: DMat4, (min, max): (Vec3, Vec3)) -> Option<Self> {
        let eye = world_from_node.w_axis.truncate();
        let forward = world_from_node.transform_vector3(DVec3::NEG_Z).try_normalize()?;
        let up = world_from_node.transform_vector3(DVec3::Y).try_normalize()?;
        let (min, max) = (min.as_dvec3(), max.as_dvec3());
        // The distance must exceed the rounding of the eye's coordinates.
        let least = ((max - min).length() / 2.0).max(eye.abs().max_element()) * 1e-3;
        let depth = ((min + max) / 2.0 - eye).dot(forward);
        let distance = if depth > least { depth } else { (max - min).length().max(least) };
        let target = eye + distance * forward;
        let is_inside = |p: DVec3| p.abs().max_element() <= f64::from(MAX_COORDINATE);
        let spans = forward.cross(up).length() > 1e-3 && is_inside(eye) && is_inside(target);
        spans.then(|| Self { eye: eye.as_vec3(), target: target.as_vec3(), up: up.as_vec3() })
    }
}

/// Returns a camera's projection. The picture's own shape replaces `aspectRatio` and `xmag`. Values beyond the limits
/// become the limit.
fn projection(json: &json::Camera) -> Checked<Projection> {
    match (&json.type_, &json.perspective, &json.orthographic) {
        (Valid(Type::Perspective), Some(perspective), _) => {
            let fov = within("perspective.yfov", perspective.yfov, f32::MIN_POSITIVE, std::f32::consts::PI)?;
            let vertical_fov_degrees = fov.to_degrees().clamp(FOV_DEGREES.0, FOV_DEGREES.1);
            Ok(Projection::Perspective { vertical_fov_degrees })
        }
        (Valid(Type::Orthographic), _, Some(orthographic)) => {
            // Some exporters mirror the picture by negative factors.
            let half = within("orthographic.ymag", orthographic.ymag.abs(), f32::MIN_POSITIVE, f32::MAX)?;
            Ok(Projection::Orthographic { height: (2.0 * half).clamp(HEIGHTS.0, HEIGHTS.1) })
        }
        (Valid(_), ..) => Err("it lacks the object that its type names".to_owned()),
        _ => Err("its type is neither perspective nor orthographic".to_owned()),
    }
}
