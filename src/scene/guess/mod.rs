//! What nobody has stated: the axis that points up, a camera, lights, whether the scene is an interior.

pub(crate) mod few_rays;
pub(crate) mod framing;
pub(crate) mod interior;
pub(crate) mod lamps;
pub(crate) mod near;
pub(crate) mod standard;
#[cfg(feature = "files")]
pub(crate) mod up_axis;
