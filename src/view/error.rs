//! Why the viewer ends, or does not begin, and what it outlives.

use super::actions::SaveError;
use crate::{gpu::GpuError, output::OutputError};

/// Displays as one line.
#[derive(Debug, thiserror::Error)]
pub enum ViewError {
    #[error("no display to open a window on: {0}")]
    NoDisplay(String),
    #[error("the window: {0}")]
    Window(String),
    #[error(transparent)]
    Device(#[from] GpuError),
    #[error(transparent)]
    Output(#[from] OutputError),
}

impl From<SaveError> for ViewError {
    fn from(error: SaveError) -> Self {
        match error {
            SaveError::Device(error) => Self::Device(error),
            SaveError::Output(error) => Self::Output(error),
        }
    }
}

/// What can go wrong while the window lives on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Topic {
    Device,
    Scene,
    #[cfg(feature = "hot-reload")]
    Shaders,
    Settings,
    File,
}
