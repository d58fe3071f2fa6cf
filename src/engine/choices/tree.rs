//! The choice of the kd-tree: how much build work pays off for the rays to be traced.

use super::Processor;
use crate::{accel::kdtree::BuildOptions, layout::KD_WORD_DEPTH};

/// How much work goes into the tree, as the user specifies it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum BuildPolicy {
    /// The kind with which building and tracing are estimated to take the least time together, for the number of
    /// rays.
    #[default]
    Auto,
    /// The tree that is built quickly.
    Fast,
    /// The tree that traces fastest.
    Best,
    /// The tree that each device builds for itself.
    Gpu,
}

named_enum!(BuildPolicy {
    Auto = "auto": "the tree with which building and tracing take the least time together",
    Fast = "fast": "built in half of the time; rays take up to a tenth longer on the CPU, up to twice as long on a GPU",
    Best = "best": "the tree through which rays are fastest",
    Gpu = "gpu": "the device builds its own tree; with kept instances, the trees are those of best",
});

impl BuildPolicy {
    /// Returns the kind of tree that the user specifies, or none for [`BuildPolicy::Auto`].
    pub fn pinned(self) -> Option<TreeKind> {
        match self {
            Self::Auto => None,
            Self::Fast => Some(TreeKind::Fast),
            Self::Best => Some(TreeKind::Best),
            Self::Gpu => Some(TreeKind::Gpu),
        }
    }
}

/// The kind of tree to build.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TreeKind {
    /// A small tree that is built in half the time of the best one. Rays take up to a tenth longer on the CPU, and up
    /// to twice as long on a GPU.
    Fast,
    /// The tree that traces fastest.
    Best,
    /// The tree that each device builds for itself, with costs as low as those of the best one. What the host traces
    /// goes through the best tree, which is built when it is first needed.
    Gpu,
}

named_enum!(TreeKind { Fast = "fast", Best = "best", Gpu = "gpu" });

/// Number of rays per triangle from which the best tree pays off on the CPU. Its build takes longer than that of the
/// fast tree: by about 1 us per triangle, and with slabs by a third of 1 us more. It saves some 10 to 25 ns per ray
/// on the CPU's threads, and 0.5 to 1 ns on a GPU.
const RAYS_PER_TRIANGLE_ON_CPU: u64 = 40;
/// The same number for a GPU.
const RAYS_PER_TRIANGLE_ON_GPU: u64 = 1000;

impl TreeKind {
    /// Returns the kind with which building and `n_rays` rays take the least time together.
    pub fn by_rule(processor: Processor, n_triangles: usize, n_rays: u64) -> Self {
        let rays_per_triangle = match processor {
            Processor::Gpu => RAYS_PER_TRIANGLE_ON_GPU,
            Processor::Cpu | Processor::SoftwareDriver => RAYS_PER_TRIANGLE_ON_CPU,
        };
        if n_rays / rays_per_triangle < n_triangles as u64 { Self::Fast } else { Self::Best }
    }

    /// Returns the options for building the tree for a processor. The kernels that software drivers run use no slabs.
    pub fn options(self, processor: Processor) -> BuildOptions {
        let best = BuildOptions { slabs: processor != Processor::SoftwareDriver, ..BuildOptions::default() };
        match self {
            Self::Fast => BuildOptions::fast(),
            Self::Best => best,
            Self::Gpu => BuildOptions { max_depth: Some(KD_WORD_DEPTH), ..best },
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn few_rays_get_a_fast_tree_and_many_the_best() {
        for (processor, enough) in
            [(Processor::Cpu, 40_000), (Processor::SoftwareDriver, 40_000), (Processor::Gpu, 1_000_000)]
        {
            let kinds = [enough - 1, enough].map(|n_rays| TreeKind::by_rule(processor, 1000, n_rays));
            assert_eq!(kinds, [TreeKind::Fast, TreeKind::Best], "{processor:?}");
        }
    }

    #[test]
    fn only_software_drivers_do_without_slabs() {
        let slabs = [Processor::Cpu, Processor::SoftwareDriver, Processor::Gpu]
            .map(|processor| TreeKind::Best.options(processor).slabs);
        assert_eq!(slabs, [true, false, true]);
        assert_eq!(TreeKind::Fast.options(Processor::Gpu), BuildOptions::fast());
    }
}
