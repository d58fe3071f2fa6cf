//! What the kernels are told of a world and of a frame of it.

use crate::{frame::RenderOptions, layout::Frame, world::World};

impl World {
    /// The constants of a frame that shows each pixel's first sample from the scene's own camera. `queue_capacity` is
    /// left 0: who makes the queues sets it.
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
