//! Options of loading a scene.

use super::{Look, error::Checked};
use crate::{frame::Integrator, util::progress::Progress};

/// Options of loading a scene.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct LoadOptions {
    /// The scene of a glTF file by its name or its index, counted from 0. Where absent, it is the file's default scene.
    pub scene: Option<String>,
    /// The camera of the scene's file by its name or its index, counted from 0. Where absent, it is the file's default
    /// camera.
    pub camera: Option<String>,
    /// Whether the scene's files may name files that do not lie below their own folders.
    pub allow_outside: bool,
    /// Width of the picture divided by its height, which a camera is made for where the file has none. Where absent, it
    /// is that of [`Scene::defaults`](super::Scene::defaults).
    pub aspect: Option<f32>,
    /// The integrator that the user asks for. Like that of a scene file, it decides whether emissive surfaces count as
    /// lamps.
    pub integrator: Option<Integrator>,
    /// Whether a scene is moved to the origin if its coordinates are so large that single precision loses details.
    /// [`Scene::origin`](super::Scene::origin) says by how much. Cameras and lights of the file and of `look` are moved
    /// with it.
    pub recentre: bool,
    /// The moment at which animations are shown, seconds. Where absent, animated things stand as the file has them at
    /// rest, unless `animation` names one: that one is shown at 0 s.
    pub at: Option<f64>,
    /// Which animations are shown.
    pub animation: AnimationChoice,
    /// What replaces parts of the scene.
    pub look: Look,
    /// Who is told of the progress: of mesh files that are read, and of images that are decoded.
    pub progress: Progress,
}

/// Which animations of a file are shown.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub enum AnimationChoice {
    /// All of them together. What several drive, the first one does.
    #[default]
    All,
    /// None.
    None,
    /// The one of this name, or else of this index, counted from 0.
    Named(String),
}

/// Returns the index of the first thing that has a name, or else of the thing whose index the name is. An error lists
/// what there is; `none` says that there is nothing.
pub(crate) fn find_named(kind: &str, name: &str, names: &[Option<&str>], none: &str) -> Checked<usize> {
    let named = names.iter().position(|other| *other == Some(name));
    let found = named.or_else(|| name.parse().ok().filter(|ix| *ix < names.len()));
    found.ok_or_else(|| {
        let listed = |(ix, name): (usize, &Option<&str>)| name.map_or(ix.to_string(), |name| format!("{ix} `{name}`"));
        match names.is_empty() {
            true => format!("there is no {kind} `{name}`: {none}"),
            false => {
                let all = names.iter().enumerate().map(listed).collect::<Vec<_>>().join(", ");
                format!("there is no {kind} `{name}`, but {all}")
            }
        }
    })
}

impl AnimationChoice {
    /// Returns the indices of the animations that are shown, of those with these names.
    ///
    /// # Errors
    /// None has the name or index.
    pub(crate) fn among(&self, names: &[&str]) -> Checked<Vec<usize>> {
        let name = match self {
            Self::All => return Ok((0..names.len()).collect()),
            Self::None => return Ok(Vec::new()),
            Self::Named(name) => name,
        };
        let names: Vec<_> = names.iter().map(|name| Some(*name)).collect();
        find_named("animation", name, &names, "the file has none").map(|ix| vec![ix])
    }
}

/// A moment of a file's animations.
pub(crate) struct Moment<'a> {
    pub seconds: f64,
    pub animation: &'a AnimationChoice,
}

impl LoadOptions {
    /// Returns the moment that is shown, if one is.
    pub(crate) fn moment(&self) -> Option<Moment<'_>> {
        let seconds = match (&self.animation, self.at) {
            (AnimationChoice::None, _) | (AnimationChoice::All, None) => return None,
            (AnimationChoice::Named(_), at) => at.unwrap_or_default(),
            (AnimationChoice::All, Some(at)) => at,
        };
        Some(Moment { seconds, animation: &self.animation })
    }
}

/// What is known of an animation of a file.
#[derive(Clone, Debug, PartialEq)]
pub struct AnimationInfo {
    /// Its name, or `animations[i]`.
    pub name: String,
    /// Time of its first key, seconds.
    pub begin: f64,
    /// Time of its last key, seconds.
    pub end: f64,
    /// Frames per second, if the times of the keys have even distances.
    pub fps: Option<f64>,
    /// Number of nodes that it moves, or of meshes of a scene file.
    pub n_moved: usize,
    /// Number of nodes whose morph targets it weighs.
    pub n_morphed: usize,
    /// Number of lights, cameras and materials that it changes.
    pub n_changed: usize,
}

#[cfg(any(feature = "bench", feature = "view"))]
impl AnimationChoice {
    /// Returns the index of the animation that is shown alone, if one is and the file has it.
    pub(crate) fn index_in(&self, animations: &[AnimationInfo]) -> Option<usize> {
        let names: Vec<_> = animations.iter().map(|animation| animation.name.as_str()).collect();
        let Self::Named(_) = self else { return None };
        self.among(&names).ok()?.first().copied()
    }
}

#[cfg(any(feature = "bench", feature = "view"))]
impl AnimationInfo {
    /// Returns the first and the last moment of animations that are shown together, seconds. The first is 0 or, if a
    /// key is before that, the first key's.
    pub(crate) fn range(shown: &[Self]) -> (f64, f64) {
        shown.iter().fold((0.0, 0.0), |(begin, end), it| (it.begin.min(begin), it.end.max(end)))
    }
}
