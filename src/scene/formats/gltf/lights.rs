//! Punctual lights (KHR_lights_punctual).

use std::f32::consts::{FRAC_PI_2, PI};

use glam::{DMat4, DVec3, Vec3};
use gltf::json::{extensions::scene::khr_lights_punctual as punctual, validation::Checked::Valid};

use super::{
    document::{Document, item},
    nodes::Nodes,
};
use crate::scene::model::{Light, error::Checked, mesh::MAX_COORDINATE};

/// Returns the lights of a scene's nodes.
///
/// An irradiance E on a white diffuse surface gives the radiance E in kdray and E / pi in glTF. So intensities and
/// illuminances are divided by pi.
///
/// `origin` is the point of the file that is the origin of world space.
pub(super) fn lights(document: &Document, nodes: &Nodes, origin: DVec3) -> Vec<Light> {
    let list = document.root.extensions.as_ref().and_then(|extensions| extensions.khr_lights_punctual.as_ref());
    let list = list.map(|extension| &extension.lights[..]).unwrap_or_default();
    let mut lights = Vec::new();
    for &ix in &nodes.shown {
        let extensions = document.root.nodes[ix].extensions.as_ref();
        let Some(extension) = extensions.and_then(|extensions| extensions.khr_lights_punctual.as_ref()) else {
            continue;
        };
        let light_ix = extension.light.value();
        let json = item(list, "lights", light_ix, &format_args!("nodes[{ix}].extensions.KHR_lights_punctual"));
        let Some(json) = document.or_left_out(json) else { continue };
        if json.range.is_some_and(f32::is_finite) {
            let name = json.name.clone().unwrap_or_else(|| format!("lights[{light_ix}]"));
            document.note("ranges of lights, which are ignored, so that they shine further", name);
        }
        let world_from_node = nodes.world_from_node(ix).unwrap_or_default();
        let world_from_node = DMat4::from_translation(-origin) * world_from_node;
        let path = format!("lights[{light_ix}]");
        let light = light(document, (json, &path), world_from_node);
        lights.extend(document.or_left_out(light.map_err(|what| format!("{path} at nodes[{ix}]: {what}"))));
    }
    lights
}

/// Returns a light. `path` is its JSON path.
fn light(document: &Document, (json, path): (&punctual::Light, &str), world_from_node: DMat4) -> Checked<Light> {
    let within = |name: &str, value: f32, min: f32, max: f32| document.clamped(path, name, value, (min, max));
    let position = world_from_node.w_axis.truncate().as_vec3();
    if position.abs().max_element() > MAX_COORDINATE {
        return Err(format!("it lies at {:?}, beyond {MAX_COORDINATE:e}", position.to_array()));
    }
    let towards = || {
        let towards = world_from_node.transform_vector3(DVec3::NEG_Z).try_normalize();
        towards.map(DVec3::as_vec3).ok_or("its node's scale leaves it no direction")
    };
    let colour = Vec3::from_array(json.color.map(|part| within("color", part, 0.0, f32::MAX)));
    let power = colour * within("intensity", json.intensity, 0.0, f32::MAX) / PI;
    if !power.is_finite() {
        return Err("its intensity is not finite".to_owned());
    }
    match json.type_ {
        Valid(punctual::Type::Directional) => Ok(Light::Directional { towards: -towards()?, irradiance: power }),
        Valid(punctual::Type::Point) => Ok(Light::Point { position, intensity: power }),
        Valid(punctual::Type::Spot) => {
            let spot = json.spot.as_ref().ok_or("it lacks `spot`")?;
            let outer = within("outerConeAngle", spot.outer_cone_angle, 0.0, FRAC_PI_2 + 1e-6);
            let inner = within("innerConeAngle", spot.inner_cone_angle, 0.0, outer);
            let (inner_cos, outer_cos) = (inner.cos(), outer.cos().max(0.0));
            Ok(Light::Spot { position, towards: towards()?, intensity: power, inner_cos, outer_cos })
        }
        _ => Err("its type is none of directional, point and spot".to_owned()),
    }
}
