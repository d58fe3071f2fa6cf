//! A tent, which falls from its middle to both sides. Twin of `tent.glsl`.

/// The offset from the middle of a tent of radius 1 that has the share `u` of the tent to its left. `u`: in [0, 1).
pub(super) fn tent(u: f32) -> f32 {
    if u < 0.5 { (2.0 * u).sqrt() - 1.0 } else { 1.0 - (2.0 * (1.0 - u)).sqrt() }
}
