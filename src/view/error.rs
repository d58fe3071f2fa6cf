//! Errors that end the viewer.

use super::actions::SaveError;
use crate::{gpu::GpuError, output::OutputError};

/// The reason why the viewer could not start, or ended with an error. It displays as one line.
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
