//! Constants of a frame of a world, as the kernels read them.

use crate::{frame::RenderOptions, layout::Frame, world::World};

impl World {
    /// Returns the constants of a frame that shows the first sample of each pixel from the scene's own camera.
    /// `queue_capacity` is left 0; the code that makes the queues sets it.
    pub fn frame_constants(&self, options: &RenderOptions) -> Frame {
        let scene = self.scene();
        let mut frame = Frame {
            n_triangles: scene.triangles.len() as u32,
            n_lights: scene.lights.len() as u32,
            ambient: scene.ambient,
            background: scene.background,
            ..Frame::default()
        };
        frame.set_options(options);
        frame.set_view(&scene.camera, self.bounds(), 0);
        frame
    }
}
