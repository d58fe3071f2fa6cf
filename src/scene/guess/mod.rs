//! Guesses where neither the file nor the user states the up axis, a camera or lights, and the test for interiors. Also
//! the cameras of a film round a scene (`turntable`), which frame it as a guessed camera does.

pub(crate) mod few_rays;
pub(crate) mod framing;
pub(crate) mod interior;
pub(crate) mod lamps;
pub(crate) mod near;
pub(crate) mod room;
pub(crate) mod standard;
pub(crate) mod turntable;
#[cfg(feature = "files")]
pub(crate) mod up_axis;
