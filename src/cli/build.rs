//! Which tree to build: how much work pays for the rays that will be traced.

use clap::ValueEnum;
use kdray::{gpu::Context, kdtree::BuildOptions};

/// `--build`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Build {
    /// The quicker of the two, by the number of rays
    Auto,
    /// A small tree, built in half of the time; rays take up to a tenth longer on the CPU, up to twice as long on a GPU
    Fast,
    /// The tree that traces fastest
    Best,
}

/// Rays a triangle from which on the best tree pays: it takes about a microsecond a triangle longer to build, with slabs
/// a third of one more, and spares a ray some 10 to 25 ns on the CPU's threads and half of one to one on a GPU.
const RAYS_A_TRIANGLE_ON_CPU: u64 = 40;
const RAYS_A_TRIANGLE_ON_GPU: u64 = 1000;

impl Build {
    /// For so many rays on a device, or without one on the CPU.
    pub fn options(self, context: Option<&Context>, n_triangles: usize, n_rays: u64) -> BuildOptions {
        let is_software = context.is_some_and(|context| context.is_software());
        let on_gpu = context.is_some() && !is_software;
        let rays_a_triangle = if on_gpu { RAYS_A_TRIANGLE_ON_GPU } else { RAYS_A_TRIANGLE_ON_CPU };
        let is_fast = match self {
            Self::Fast => true,
            Self::Best => false,
            Self::Auto => n_rays / rays_a_triangle < n_triangles as u64,
        };
        if is_fast { BuildOptions::fast() } else { BuildOptions { slabs: !is_software, ..BuildOptions::default() } }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn few_rays_get_a_fast_tree_and_many_the_best() {
        assert_eq!(Build::Auto.options(None, 1000, 39_999), BuildOptions::fast());
        let best = BuildOptions::default();
        assert_eq!(Build::Auto.options(None, 1000, 40_000), best);
        assert_eq!(Build::Best.options(None, 1000, 0), best);
        assert_eq!(Build::Fast.options(None, 0, u64::MAX), BuildOptions::fast());
    }
}
