//! Constants of a frame of a world, as the kernels read them.

use crate::{
    frame::{Integrator, RenderOptions},
    layout::Frame,
    scene::{Ground, Up},
    world::{World, ambient_approximation::AmbientApproximation},
};

impl World {
    /// Returns the constants of a frame that shows the first sample of each pixel from the scene's own camera.
    /// `queue_capacity` is left 0; the code that makes the queues sets it.
    ///
    /// # Panics
    /// The crop exceeds the picture, or tiles have a noise filter ([`RenderOptions::check`]).
    #[doc(hidden)]
    pub fn frame_constants(&self, options: &RenderOptions) -> Frame {
        let scene = self.scene();
        let ground = scene.ground.unwrap_or(Ground { ambient: scene.ambient, up: Up::Y });
        let approximation = match options.approximates_ambient && options.integrator == Integrator::Whitted {
            true => self.ambient_approximation(ground.up),
            false => AmbientApproximation::default(),
        };
        let (sky, ground_ambient) = (scene.ambient + approximation.sky, ground.ambient + approximation.ground);
        let passes_blended = options.integrator == Integrator::Whitted && scene.has_blended();
        let mut frame = Frame {
            n_triangles: scene.n_triangles() as u32,
            n_lights: scene.lights.len() as u32,
            // Equal colours give this colour and no tilt, without any rounding.
            ambient: sky + (ground_ambient - sky) / 2.0,
            ambient_tilt: (sky - ground_ambient) / 2.0,
            up_axis: if ground.up == Up::Z { 2 } else { 1 },
            background: approximation.background.unwrap_or(scene.background),
            to_viewer: scene.studio.unwrap_or_default(),
            has_studio: scene.studio.is_some().into(),
            extra_bounces: if passes_blended { RenderOptions::EXTRA_BOUNCES } else { 0 },
            ..Frame::default()
        };
        frame.set_options(options);
        frame.set_view(&scene.camera, self.bounds(), 0);
        frame
    }
}
