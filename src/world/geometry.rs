//! Triangles with an acceleration structure over them.

use super::{FlatScene, Instances, Mismatch, World};
use crate::{accel::Accel, layout::Triangle};

/// Borrowed triangles, or geometries and their instances, and the acceleration structure over them. Every index in the
/// structure names one of the triangles.
#[derive(Clone, Copy, Debug)]
pub struct Geometry<'a> {
    triangles: Triangles<'a>,
    accel: &'a Accel,
    instances: Option<&'a Instances>,
}

/// Triangles, or a scene that may make its own when they are first needed.
#[derive(Clone, Copy, Debug)]
enum Triangles<'a> {
    Given(&'a [Triangle]),
    OfScene(&'a FlatScene),
}

impl<'a> Geometry<'a> {
    /// Joins triangles and the structure that was built from them.
    ///
    /// # Errors
    /// The structure was built from more or fewer triangles.
    pub fn new(triangles: &'a [Triangle], accel: &'a Accel) -> Result<Self, Mismatch> {
        match (accel.n_triangles(), triangles.len()) {
            (of_accel, given) if of_accel == given && !matches!(accel, Accel::TwoLevel(_)) => {
                Ok(Self { triangles: Triangles::Given(triangles), accel, instances: None })
            }
            (accel, triangles) => Err(Mismatch::Accel { accel, triangles }),
        }
    }

    pub(super) fn of_world(world: &'a World) -> Self {
        let scene = world.scene();
        Self { triangles: Triangles::OfScene(scene), accel: world.accel(), instances: scene.instances.as_ref() }
    }

    /// The stored triangles: those of the world, or of the instances' geometries.
    pub fn triangles(&self) -> &'a [Triangle] {
        match self.triangles {
            Triangles::Given(triangles) => triangles,
            Triangles::OfScene(scene) => &scene.triangles,
        }
    }

    /// The instances, if there are any.
    pub fn instances(&self) -> Option<&'a Instances> {
        self.instances
    }

    /// The number of triangles in the world.
    pub fn n_triangles(&self) -> usize {
        self.instances.map_or_else(|| self.accel.n_triangles(), Instances::n_triangles)
    }

    /// The acceleration structure over the triangles.
    pub fn accel(&self) -> &'a Accel {
        self.accel
    }
}
