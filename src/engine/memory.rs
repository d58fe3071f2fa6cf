//! The host memory that pictures and the build of a structure take, checked before it is allocated.

use super::{
    choices::{ChosenAccel, Processor, TreeKind},
    load::Builder,
};
use crate::{
    frame::{Integrator, RenderOptions},
    layout::{PixelAovs, Triangle},
    scene::Scene,
    util::memory::{OutOfMemory, require},
};

// Peak memory of a build in bytes per triangle, without the triangles themselves. Measured on a sphere and a torus
// knot of a million triangles.
const BYTES_OF_FAST_BUILD: u64 = 140;
const BYTES_OF_BEST_BUILD: u64 = 240;
const BYTES_OF_GRID_BUILD: u64 = 240;

/// Bytes of a pixel's radiance as floats.
const RADIANCE: u64 = size_of::<[f32; 4]>() as u64;
/// Bytes of a pixel's colour for display.
const DISPLAY: u64 = size_of::<[u8; 4]>() as u64;
/// Bytes of a pixel while a PNG is written: its RGB colour and its encoded form.
const ENCODED: u64 = 6;

impl Builder {
    /// Refuses pictures that do not fit in the host's memory. `n_at_once`: number of pictures that are drawn at the
    /// same time. The CPU renderer's buffers are counted if the CPU traces the rays.
    ///
    /// # Errors
    /// The host has too little memory.
    pub fn require_for_pictures(
        &self,
        options: &RenderOptions,
        n_samples: u32,
        n_at_once: u32,
    ) -> Result<(), OutOfMemory> {
        let (window, crop) = (options.window(), options.crop_or_whole());
        let n_pixels = |width: u32, height: u32| u64::from(width) * u64::from(height);
        let is_on_cpu = self.processor == Processor::Cpu;
        let n_rendered = if is_on_cpu { n_pixels(window.width(), window.height()) } else { 0 };
        let needed = n_rendered * rendered_bytes(options, n_samples)
            + n_pixels(crop.width(), crop.height())
                * (RADIANCE + DISPLAY + ENCODED + aovs_bytes(options) + layer_bytes(options));
        let pictures = if n_at_once == 1 { "a picture".to_owned() } else { format!("{n_at_once} pictures") };
        let what = format!("{pictures} of {}x{} pixels", crop.width(), crop.height());
        require(&what, u64::from(n_at_once) * needed)
    }

    /// Refuses a scene's triangles and their structure if they, and the build, do not fit in the host's memory.
    pub(super) fn require_for_build(&self, accel: ChosenAccel, scene: &Scene) -> Result<(), OutOfMemory> {
        let bytes = match accel.tree_kind().map(|chosen| chosen.value) {
            Some(TreeKind::Fast) => BYTES_OF_FAST_BUILD,
            Some(TreeKind::Best | TreeKind::Gpu) => BYTES_OF_BEST_BUILD,
            None => BYTES_OF_GRID_BUILD,
        };
        require(&self.describe(scene), self.n_built(scene) as u64 * (size_of::<Triangle>() as u64 + bytes))
    }

    /// Names the build of a scene's structure and the number of triangles in it, for progress and errors. Of meshes
    /// that are stored once, each triangle counts once.
    pub fn describe(&self, scene: &Scene) -> String {
        format!("building the {} of {} triangles", self.request.accel.unwrap_or_default().name(), self.n_built(scene))
    }

    fn n_built(&self, scene: &Scene) -> usize {
        if self.request.instances.keeps(scene) { scene.n_stored() } else { scene.n_triangles() }
    }
}

/// Returns the bytes per pixel of the CPU renderer's buffers: the index of the visible triangle, the sample, the sum
/// of samples, the filtered picture and the picture for display. Layers that are means have samples and sums of their
/// own.
fn rendered_bytes(options: &RenderOptions, n_samples: u32) -> u64 {
    let sums = if n_samples > 1 { RADIANCE } else { 0 };
    let layers = layer_bytes(options) * (1 + sums / RADIANCE);
    size_of::<u32>() as u64 + RADIANCE + sums + RADIANCE + DISPLAY + aovs_bytes(options) + layers
}

/// Returns the bytes of a pixel in the layers that are means.
fn layer_bytes(options: &RenderOptions) -> u64 {
    options.mean_layers().len() as u64 * RADIANCE
}

/// Returns the bytes of a pixel's first hits. Those of paths are kept beside those of the pixel's centre.
fn aovs_bytes(options: &RenderOptions) -> u64 {
    let n_copies = if options.integrator == Integrator::Path { 2 } else { 1 };
    if options.pixel_aovs { n_copies * size_of::<PixelAovs>() as u64 } else { 0 }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use glam::Vec3;

    use super::*;
    use crate::{
        engine::choices::Request,
        scene::{Instance, Mesh},
        world::instances::Instancing,
    };

    #[test]
    fn triangles_that_are_stored_once_are_built_once() {
        let mut scene = Scene::empty(Path::new("thrice"));
        scene.meshes = vec![Mesh::of_triangles(vec![Vec3::ZERO, Vec3::X, Vec3::Y], vec![[0, 1, 2]])];
        scene.instances = vec![Instance::default(); 3];
        let described = [Instancing::Keep, Instancing::Flatten].map(|instances| {
            Builder::new(Processor::Cpu, Request { instances, ..Request::default() }).describe(&scene)
        });
        assert_eq!(described, ["building the kd-tree of 1 triangles", "building the kd-tree of 3 triangles"]);
    }

    #[test]
    fn a_pixel_s_buffers_are_counted_and_a_usual_picture_is_not_refused() {
        let usual = RenderOptions::default();
        Builder::new(Processor::Cpu, Request::default()).require_for_pictures(&usual, 1, 1).unwrap();
        assert_eq!(rendered_bytes(&usual, 1), 40);
        assert_eq!(rendered_bytes(&usual, 2), 56);
        let with_aovs = RenderOptions { pixel_aovs: true, ..usual };
        assert_eq!(rendered_bytes(&with_aovs, 1), 40 + size_of::<PixelAovs>() as u64);
        let integrator = Integrator::Path;
        let with_layers = RenderOptions { light_layers: true, integrator, ..RenderOptions::default() };
        assert_eq!([1, 2].map(|n_samples| rendered_bytes(&with_layers, n_samples)), [40 + 48, 56 + 96]);
    }
}
