//! Choices with their reasons, as reports show them.

use std::fmt::{self, Display};

use serde::{Serialize, Serializer, ser::SerializeStruct};

use super::{ChosenAccel, Timings, TreeKind};
use crate::{
    accel::{AccelKind, kdtree::Traversal},
    frame::{Primary, RenderOptions},
};

/// The reason for a choice.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Reason {
    /// The user specified it.
    Pinned,
    /// A rule gave it, from the device and from sizes.
    Rule,
    /// A measurement of this run decided.
    Measured,
    /// A measurement of an earlier run decided.
    Cached,
}

named_enum!(Reason { Pinned = "pinned", Rule = "rule", Measured = "measured", Cached = "cached" });

/// A choice and its reason.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Chosen<T> {
    /// What was chosen.
    pub value: T,
    /// Why it was chosen.
    pub by: Reason,
}

impl<T> Chosen<T> {
    /// Returns what the user specified, or else what the rule gives.
    pub(super) fn pinned_or(pinned: Option<T>, rule: impl FnOnce() -> T) -> Self {
        match pinned {
            Some(value) => Self { value, by: Reason::Pinned },
            None => Self { value: rule(), by: Reason::Rule },
        }
    }
}

impl<T: Display> Display for Chosen<T> {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        write!(f, "{} ({})", self.value, self.by)
    }
}

impl<T: Display> Serialize for Chosen<T> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut words = serializer.serialize_struct("Chosen", 2)?;
        words.serialize_field("value", &self.value.to_string())?;
        words.serialize_field("by", &self.by.to_string())?;
        words.end()
    }
}

/// The methods by which rays are traced.
#[derive(Clone, Debug, PartialEq)]
pub struct Methods {
    /// The algorithm that traverses the kd-tree.
    pub traversal: Chosen<Traversal>,
    /// How primary rays find their triangles.
    pub primary: Chosen<Primary>,
    /// Nanoseconds per ray of each traversal, if these times decided.
    pub traversal_ns: Option<Timings>,
    /// Nanoseconds per pixel of each kind of primary visibility, if these times decided. They are the times of whole
    /// frames of primary rays and their shadow rays.
    pub primary_ns: Option<Timings>,
}

impl Methods {
    /// Returns the options with these methods.
    pub fn apply(&self, options: &RenderOptions) -> RenderOptions {
        RenderOptions { traversal: self.traversal.value, primary: self.primary.value, ..options.clone() }
    }
}

/// All that was chosen, for reports.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Choices {
    /// The kind of the acceleration structure.
    #[serde(serialize_with = "as_word")]
    pub accel: AccelKind,
    /// Which kd-tree is built; none for grids.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub build: Option<Chosen<TreeKind>>,
    /// The algorithm that traverses the kd-tree; none for grids.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub traversal: Option<Chosen<Traversal>>,
    /// How primary rays find their triangles; none for rays without a picture.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub primary: Option<Chosen<Primary>>,
    /// See [`Methods::traversal_ns`].
    #[serde(skip_serializing_if = "Option::is_none")]
    pub traversal_ns: Option<Timings>,
    /// See [`Methods::primary_ns`].
    #[serde(skip_serializing_if = "Option::is_none")]
    pub primary_ns: Option<Timings>,
}

/// Serializes a value as the word that it displays as.
fn as_word<S: Serializer>(value: &impl Display, serializer: S) -> Result<S::Ok, S::Error> {
    serializer.collect_str(value)
}

impl Choices {
    /// Returns the choices for pictures.
    pub fn of_pictures(accel: ChosenAccel, methods: Methods) -> Self {
        let Methods { traversal, primary, traversal_ns, primary_ns } = methods;
        let build = accel.tree_kind();
        let traversal = build.map(|_| traversal);
        Self { accel: accel.kind(), build, traversal, primary: Some(primary), traversal_ns, primary_ns }
    }

    /// Returns the choices for rays without a picture, which have no primary visibility.
    pub fn of_rays(accel: ChosenAccel, methods: Methods) -> Self {
        Self { primary: None, ..Self::of_pictures(accel, methods) }
    }
}

impl Display for Choices {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        let Self { accel, build, traversal, primary, traversal_ns, primary_ns } = self;
        match (build, traversal) {
            (Some(build), Some(traversal)) => write!(f, "chosen: tree {build}, traversal {traversal}")?,
            _ => write!(f, "chosen: {}", accel.name())?,
        }
        if let Some(primary) = primary {
            write!(f, ", primary rays {primary}")?;
        }
        if let Some(timings) = traversal_ns {
            write!(f, "; {timings} ns a ray")?;
        }
        primary_ns.as_ref().map_or(Ok(()), |timings| write!(f, "; {timings} ns a pixel"))
    }
}
