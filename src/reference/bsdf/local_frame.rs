//! A frame around a normal, in which the lobes of surfaces are computed. Twin of `bsdf/local_frame.glsl`.

use glam::Vec3;

/// An orthonormal frame whose z axis is the normal.
#[derive(Clone, Copy, Debug)]
pub struct LocalFrame {
    pub tangent: Vec3,
    pub bitangent: Vec3,
    pub normal: Vec3,
}

/// Returns a frame around a unit normal.
pub fn frame_around(n: Vec3) -> LocalFrame {
    let side = if n.z >= 0.0 { 1.0 } else { -1.0 };
    let a = -1.0 / (side + n.z);
    let b = n.x * n.y * a;
    let tangent = Vec3::new(1.0 + side * n.x * n.x * a, side * b, -side * n.x);
    LocalFrame { tangent, bitangent: Vec3::new(b, side + n.y * n.y * a, -n.y), normal: n }
}

/// Returns a direction of the world in the frame.
pub fn to_local(frame: &LocalFrame, direction: Vec3) -> Vec3 {
    Vec3::new(direction.dot(frame.tangent), direction.dot(frame.bitangent), direction.dot(frame.normal))
}

/// Returns a direction of the frame in the world.
pub fn to_world(frame: &LocalFrame, direction: Vec3) -> Vec3 {
    direction.x * frame.tangent + direction.y * frame.bitangent + direction.z * frame.normal
}
