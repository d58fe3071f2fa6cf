//! The picture that is drawn while the camera moves, and the kinds of pictures, each of which has a renderer of its
//! own.

use crate::frame::{Denoise, Integrator, RenderOptions};

/// The picture that is drawn while the camera moves.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum InMotion {
    /// The picture of [`Integrator::Whitted`], with ambient light in place of light that only paths show.
    #[default]
    Whitted,
    /// The picture at rest with one sample a pixel.
    Path,
    /// The picture at rest with one sample a pixel, whose noise [`Denoise::Edge`] removes.
    Filtered,
}

named_enum!(InMotion {
    Whitted = "whitted": "quick pictures without noise, with ambient light in place of light that only paths show",
    Path = "path": "the picture at rest with one sample a pixel",
    Filtered = "filtered": "the picture at rest with one sample a pixel, whose noise is removed as by --denoise edge",
});

impl InMotion {
    /// Returns the next picture in the order of [`Self::ALL`], the first one after the last.
    pub fn next(self) -> Self {
        Self::ALL[(self as usize + 1) % Self::ALL.len()]
    }

    /// Returns the kind of the picture in motion. `at_rest`: the options of the one at rest.
    pub fn kind(self, at_rest: &RenderOptions) -> PictureKind {
        match (self, at_rest.integrator) {
            (Self::Whitted, _) | (_, Integrator::Whitted) => PictureKind::Whitted,
            (Self::Filtered, Integrator::Path) => PictureKind::FilteredPath,
            (Self::Path, Integrator::Path) => PictureKind::of(at_rest),
        }
    }
}

/// What makes pictures so different that each kind has a renderer of its own, and takes a time of its own.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PictureKind {
    Whitted,
    Path,
    /// Paths with the filter [`Denoise::Edge`].
    FilteredPath,
}

impl PictureKind {
    /// Number of kinds.
    pub const N: usize = 3;

    /// Returns the kind of pictures with these options.
    pub fn of(options: &RenderOptions) -> Self {
        match (options.integrator, options.denoise) {
            (Integrator::Whitted, _) => Self::Whitted,
            (Integrator::Path, Denoise::Edge) => Self::FilteredPath,
            (Integrator::Path, _) => Self::Path,
        }
    }

    /// Returns the integrator of pictures of this kind.
    pub fn integrator(self) -> Integrator {
        match self {
            Self::Whitted => Integrator::Whitted,
            Self::Path | Self::FilteredPath => Integrator::Path,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pictures_in_motion_are_those_that_the_user_chose() {
        use PictureKind::{FilteredPath, Path, Whitted};
        let of = |integrator, denoise| {
            let at_rest = RenderOptions { integrator, denoise, ..RenderOptions::default() };
            InMotion::ALL.iter().map(|in_motion| in_motion.kind(&at_rest)).collect::<Vec<_>>()
        };
        assert_eq!(of(Integrator::Path, Denoise::Off), [Whitted, Path, FilteredPath]);
        assert_eq!(of(Integrator::Path, Denoise::Edge), [Whitted, FilteredPath, FilteredPath]);
        assert_eq!(of(Integrator::Whitted, Denoise::Edge), [Whitted; 3]);
        assert_eq!(InMotion::Whitted.next().next().next(), InMotion::Whitted);
    }
}
