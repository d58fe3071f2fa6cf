//! A picture that is joined from parts, which are drawn one after the other or by several devices.

use bytemuck::{Zeroable, allocation::try_zeroed_vec};

use crate::{
    frame::{Crop, Drawn, Picture, RenderOptions},
    gpu::GpuError,
};

/// The joined picture, with the AOVs and layers of its pixels. Parts that have not been placed are black.
pub struct JoinedPicture {
    whole: Crop,
    pub picture: Picture,
    /// The AOVs and layers. The caller adds times and counts.
    pub drawn: Drawn,
}

impl JoinedPicture {
    /// Makes room for the pixels of `whole`, and for the AOVs and layers that the options ask for.
    ///
    /// # Errors
    /// There is too little memory.
    pub fn new(whole: Crop, options: &RenderOptions) -> Result<Self, GpuError> {
        let n_pixels = whole.width() as usize * whole.height() as usize;
        let picture = Picture {
            width: whole.width(),
            height: whole.height(),
            radiance: room("picture's radiance", n_pixels)?,
            display: room("displayed picture", n_pixels)?,
        };
        let mut drawn = Drawn::default();
        if options.pixel_aovs {
            drawn.pixel_aovs = room("picture's pixel_aovs", n_pixels)?;
        }
        for layer in &mut drawn.layers.0[options.mean_layers()] {
            *layer = room("picture's layers", n_pixels)?;
        }
        Ok(Self { whole, picture, drawn })
    }

    /// Copies a part's pixels to their places.
    pub fn place(&mut self, part: &Crop, picture: &Picture, drawn: &Drawn) {
        self.whole.place(&mut self.picture.radiance, part, &picture.radiance);
        self.whole.place(&mut self.picture.display, part, &picture.display);
        if !drawn.pixel_aovs.is_empty() {
            self.whole.place(&mut self.drawn.pixel_aovs, part, &drawn.pixel_aovs);
        }
        self.drawn.layers.place(&self.whole, part, &drawn.layers);
    }
}

/// Returns `len` elements, or an error if there is no memory for them. The system maps their pages when they are first
/// written.
fn room<T: Zeroable>(object: &'static str, len: usize) -> Result<Vec<T>, GpuError> {
    try_zeroed_vec(len).map_err(|()| GpuError::HostMemory { object, bytes: (len * size_of::<T>()) as u64 })
}
