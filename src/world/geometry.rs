//! Triangles with an acceleration structure over them.

use super::{Mismatch, World};
use crate::{accel::Accel, layout::Triangle};

/// Borrowed triangles and the acceleration structure over them. Every index in the structure names one of the
/// triangles.
#[derive(Clone, Copy, Debug)]
pub struct Geometry<'a> {
    triangles: &'a [Triangle],
    accel: &'a Accel,
}

impl<'a> Geometry<'a> {
    /// Joins triangles and the structure that was built from them.
    ///
    /// # Errors
    /// The structure was built from more or fewer triangles.
    pub fn new(triangles: &'a [Triangle], accel: &'a Accel) -> Result<Self, Mismatch> {
        match (accel.n_triangles(), triangles.len()) {
            (of_accel, given) if of_accel == given => Ok(Self { triangles, accel }),
            (accel, triangles) => Err(Mismatch::Accel { accel, triangles }),
        }
    }

    pub(super) fn of_world(world: &'a World) -> Self {
        Self { triangles: &world.scene().triangles, accel: world.accel() }
    }

    /// World-space triangles.
    pub fn triangles(&self) -> &'a [Triangle] {
        self.triangles
    }

    /// The acceleration structure over the triangles.
    pub fn accel(&self) -> &'a Accel {
        self.accel
    }
}
