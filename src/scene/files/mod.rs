//! The files that a scene is read from, on disk or in a pack: which names may be followed, and the one place that opens
//! them.

mod foreign;
pub(crate) mod pack;
mod source_file;
mod store;
mod text;

pub(crate) use self::{
    source_file::SourceFile,
    store::canonical,
    text::{lossy_text, without_bom},
};
