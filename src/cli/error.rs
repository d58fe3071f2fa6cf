//! The errors of a command, and their exit codes.

use std::{io, path::PathBuf, time::Duration};

#[cfg(feature = "view")]
use kdray::view::ViewError;
use kdray::{
    cast::RayFileError, engine::LoadError, gpu::GpuError, merge::MergeError, output::OutputError, pack::PackError,
    scene::SceneError, util::memory::OutOfMemory,
};

/// The reason why a command failed. It displays as one line.
#[derive(Debug, thiserror::Error)]
pub enum CliError {
    #[error("{0}")]
    Usage(String),
    #[error(transparent)]
    Scene(#[from] SceneError),
    #[error("`{path}`: cannot be read as a list of scenes: {source}", path = path.display())]
    List { path: PathBuf, source: io::Error },
    /// The scene has no picture when its time is over.
    #[error("nothing was drawn within --time-limit {}: it was still {present}", humantime::format_duration(*limit))]
    TimeLimit { limit: Duration, present: &'static str },
    /// Some of several scenes have failed. `exit_code` is that of the first one.
    #[error("{summary}")]
    Scenes { summary: String, exit_code: u8 },
    #[error(transparent)]
    Rays(#[from] RayFileError),
    #[error(transparent)]
    Merge(#[from] MergeError),
    #[error(transparent)]
    Pack(PackError),
    #[error(transparent)]
    Device(#[from] GpuError),
    #[error(transparent)]
    Memory(#[from] OutOfMemory),
    #[error("{0}; a smaller --size, a --crop or --primary trace takes less")]
    DeviceMemory(GpuError),
    #[error("{0}")]
    NoGpu(String),
    #[cfg(feature = "view")]
    #[error("{0}")]
    Window(String),
    #[error("the validation layer reported {0} message(s)")]
    Validation(usize),
    #[cfg(feature = "bench")]
    #[error("{0}")]
    WrongHits(String),
    #[error("{0}")]
    NoProcessor(String),
    #[error(transparent)]
    Output(#[from] OutputError),
    #[error("cannot write to standard output: {0}")]
    Stdout(io::Error),
}

impl CliError {
    /// Refuses arguments. `what`: a line that names them and says why.
    pub fn refuse<T>(what: impl Into<String>) -> Result<T, Self> {
        Err(Self::Usage(what.into()))
    }

    /// Returns the exit code: 2 for usage; 3 for scene, rays or parts, also if they need more memory or time than there
    /// is; 4 for the device; 5 for output.
    pub fn exit_code(&self) -> u8 {
        match self {
            Self::Usage(_) | Self::Output(OutputError::UnknownEnding { .. }) => 2,
            Self::Scenes { exit_code, .. } => *exit_code,
            Self::List { .. } | Self::TimeLimit { .. } => 3,
            Self::Scene(_) | Self::Rays(_) | Self::Merge(_) | Self::Pack(_) | Self::Memory(_) => 3,
            Self::Device(_) | Self::DeviceMemory(_) | Self::Validation(_) => 4,
            Self::NoProcessor(_) | Self::NoGpu(_) => 4,
            #[cfg(feature = "bench")]
            Self::WrongHits(_) => 4,
            #[cfg(feature = "view")]
            Self::Window(_) => 4,
            Self::Output(_) | Self::Stdout(_) => 5,
        }
    }
}

impl CliError {
    /// Adds hints on how to use less memory to an error of drawing, if the device ran out of memory.
    pub fn of_drawing(self) -> Self {
        match self {
            Self::Device(error) if error.is_out_of_memory() => Self::DeviceMemory(error),
            other => other,
        }
    }
}

impl From<LoadError> for CliError {
    fn from(error: LoadError) -> Self {
        match error {
            LoadError::Scene(error) => Self::Scene(error),
            LoadError::Mismatch(error) => Self::Device(error.into()),
            LoadError::Memory(error) => Self::Memory(error),
            LoadError::Device(error) => Self::Device(error),
        }
    }
}

impl From<PackError> for CliError {
    fn from(error: PackError) -> Self {
        match error {
            PackError::Output(error) => Self::Output(error),
            other => Self::Pack(other),
        }
    }
}

#[cfg(feature = "view")]
impl From<ViewError> for CliError {
    fn from(error: ViewError) -> Self {
        match error {
            ViewError::Device(error) => Self::Device(error),
            ViewError::Output(error) => Self::Output(error),
            ViewError::NoDisplay(_) | ViewError::Window(_) => Self::Window(error.to_string()),
        }
    }
}

impl From<clap::Error> for CliError {
    /// Keeps clap's message and its hints. Leaves out the usage text below them.
    fn from(error: clap::Error) -> Self {
        let text = error.render().to_string();
        let paragraphs = text.trim_start_matches("error:").split("\n\n").map(str::trim);
        let told: Vec<_> = paragraphs
            .filter(|paragraph| !paragraph.starts_with("Usage:") && !paragraph.starts_with("For more information"))
            .collect();
        Self::Usage(told.join("; "))
    }
}

#[cfg(test)]
mod tests {
    use clap::CommandFactory;

    use super::*;
    use crate::cli::args::Args;

    fn usage(arguments: &[&str]) -> String {
        let words = std::iter::once(&"kdray").chain(arguments);
        CliError::from(Args::command().try_get_matches_from(words).unwrap_err()).to_string()
    }

    #[test]
    fn a_picture_that_takes_too_much_memory_can_be_drawn_in_parts() {
        let error = GpuError::HostMemory { object: "displayed picture", bytes: 3 << 30 };
        let error = CliError::Device(error).of_drawing();
        let expected = "memory for the displayed picture (3072.0 MiB): the system has too little; \
                        a smaller --size, a --crop or --primary trace takes less";
        assert_eq!((error.to_string().as_str(), error.exit_code()), (expected, 4));
        let other = CliError::Device(GpuError::NoDriver).of_drawing();
        assert!(matches!(other, CliError::Device(GpuError::NoDriver)));
    }

    #[test]
    fn clap_messages_lose_their_usage_text() {
        assert_eq!(
            usage(&["render", "x.toml", "--sice", "1x1"]).split(';').next(),
            Some("unexpected argument '--sice' found")
        );
        assert!(usage(&["render"]).contains("<SCENE>"));
        for mistake in [&["render"][..], &["reader"], &[], &["render", "x", "--size"]] {
            let message = usage(mistake);
            assert!(!message.is_empty() && !message.contains("Usage:") && !message.contains("--help"), "{message}");
        }
    }
}
