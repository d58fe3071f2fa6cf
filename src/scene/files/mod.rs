//! The files that a scene is read from, on disk or in a pack: which names may be followed, and the one place that opens
//! them.

pub(crate) mod foreign;
pub(crate) mod pack;
pub(crate) mod source_file;
pub(crate) mod store;
pub(crate) mod text;
