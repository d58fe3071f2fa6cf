//! Choices with their reasons, as reports tell them.

use std::fmt::{self, Display};

use serde::{Serialize, Serializer, ser::SerializeStruct};

use super::{ChosenAccel, Timings, TreeKind};
use crate::{
    accel::{AccelKind, kdtree::Traversal},
    frame::{Primary, RenderOptions},
};

/// Why something was chosen.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Reason {
    /// The user said so.
    Pinned,
    /// A rule says so, from the device and from sizes.
    Rule,
    /// It was the quickest just now.
    Measured,
    /// It was the quickest when it was measured in an earlier run.
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
    /// What the user asked for, or else what the rule says.
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

/// How rays are traced.
#[derive(Clone, Debug, PartialEq)]
pub struct Methods {
    /// The algorithm by which rays go through the kd-tree.
    pub traversal: Chosen<Traversal>,
    /// How primary rays find their triangles.
    pub primary: Chosen<Primary>,
    /// What the traversals took, nanoseconds a ray, if that decided.
    pub traversal_ns: Option<Timings>,
    /// What frames of primary rays and their shadows took, nanoseconds a pixel, if that decided.
    pub primary_ns: Option<Timings>,
}

impl Methods {
    /// The options with these methods.
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
    /// The algorithm by which rays go through the kd-tree; none for grids.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub traversal: Option<Chosen<Traversal>>,
    /// None for rays without a picture.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub primary: Option<Chosen<Primary>>,
    /// [`Methods::traversal_ns`].
    #[serde(skip_serializing_if = "Option::is_none")]
    pub traversal_ns: Option<Timings>,
    /// [`Methods::primary_ns`].
    #[serde(skip_serializing_if = "Option::is_none")]
    pub primary_ns: Option<Timings>,
}

/// Serializes a value as the word that it is displayed by.
fn as_word<S: Serializer>(value: &impl Display, serializer: S) -> Result<S::Ok, S::Error> {
    serializer.collect_str(value)
}

impl Choices {
    /// The choices for pictures.
    pub fn of_pictures(accel: ChosenAccel, methods: Methods) -> Self {
        let Methods { traversal, primary, traversal_ns, primary_ns } = methods;
        let build = accel.tree_kind();
        let traversal = build.map(|_| traversal);
        Self { accel: accel.kind(), build, traversal, primary: Some(primary), traversal_ns, primary_ns }
    }

    /// Rays without a picture have no primary visibility.
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
