//! Helpers that know nothing about rays: names of an option's variants, text that is safe to print, the host's
//! memory, progress, values that are made once, data that clones share.

#[macro_use]
mod named_enum;

pub mod memory;
#[cfg(feature = "files")]
pub(crate) mod npy;
pub(crate) mod once;
pub mod progress;
mod shared;
pub mod text;

pub use self::{named_enum::UnknownWord, shared::Shared};
