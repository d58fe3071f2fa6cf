//! Which tree to build: how much work pays for the rays that will be traced.

use super::Processor;
use crate::accel::kdtree::BuildOptions;

/// How much work goes into the tree, as the user says it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum BuildPolicy {
    /// The quicker of the two, with building counted, by the number of rays.
    #[default]
    Auto,
    /// The tree that is built quickly.
    Fast,
    /// The tree that traces fastest.
    Best,
}

named_enum!(BuildPolicy { Auto = "auto", Fast = "fast", Best = "best" });

impl BuildPolicy {
    /// The tree that the user wants, if that is a certain one.
    pub fn pinned(self) -> Option<TreeKind> {
        match self {
            Self::Auto => None,
            Self::Fast => Some(TreeKind::Fast),
            Self::Best => Some(TreeKind::Best),
        }
    }
}

/// A tree to build.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TreeKind {
    /// A small tree, built in half of the time. Rays take up to a tenth longer on the CPU, up to twice as long on a
    /// GPU.
    Fast,
    /// The tree that traces fastest.
    Best,
}

named_enum!(TreeKind { Fast = "fast", Best = "best" });

/// Rays a triangle from which on the best tree pays: it takes about a microsecond a triangle longer to build, with
/// slabs a third of one more, and spares a ray some 10 to 25 ns on the CPU's threads and half of one to one on a GPU.
const RAYS_A_TRIANGLE_ON_CPU: u64 = 40;
const RAYS_A_TRIANGLE_ON_GPU: u64 = 1000;

impl TreeKind {
    /// The tree with which building and so many rays take the least time together.
    pub fn by_rule(processor: Processor, n_triangles: usize, n_rays: u64) -> Self {
        let rays_a_triangle = match processor {
            Processor::Gpu => RAYS_A_TRIANGLE_ON_GPU,
            Processor::Cpu | Processor::SoftwareDriver => RAYS_A_TRIANGLE_ON_CPU,
        };
        if n_rays / rays_a_triangle < n_triangles as u64 { Self::Fast } else { Self::Best }
    }

    /// How it is built for an processor: the kernels that software drivers run look at no slabs.
    pub fn options(self, processor: Processor) -> BuildOptions {
        match self {
            Self::Fast => BuildOptions::fast(),
            Self::Best => BuildOptions { slabs: processor != Processor::SoftwareDriver, ..BuildOptions::default() },
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
