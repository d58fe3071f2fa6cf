//! Runs the viewer without a user: follows a camera tour, writes its pictures and ends.

use std::{path::PathBuf, time::Instant};

use super::{
    actions::{SaveError, save},
    gpu_session::GpuSession,
    session::Session,
    tour::Tour,
};

/// Progress along a tour. The camera rests at the last frame, which therefore gets all its samples.
pub struct Script {
    tour: Tour,
    frame_ix: u32,
    /// Whether the camera has been moved to the current frame's place.
    is_placed: bool,
    /// Directory for the pictures of all frames. With it, each frame gets all its samples.
    record: Option<PathBuf>,
    /// File for the picture of the last frame.
    screenshot: Option<PathBuf>,
}

impl Script {
    pub fn new(tour: Tour, record: Option<PathBuf>, screenshot: Option<PathBuf>) -> Self {
        Self { tour, frame_ix: 0, is_placed: false, record, screenshot }
    }

    /// Moves the camera to the place of the current frame, unless it was moved there before. The move counts as an
    /// input of the user. Until the camera rests, it is in motion, however long a frame takes.
    pub fn direct(&mut self, session: &mut Session) {
        let now = Instant::now();
        if self.is_still() {
            session.pace.rest();
        } else {
            session.pace.moved(now);
        }
        if !std::mem::replace(&mut self.is_placed, true) {
            session.controller.place(self.tour.camera(self.frame_ix));
            session.pace.note_input(now);
        }
    }

    fn is_last(&self) -> bool {
        self.frame_ix + 1 == self.tour.n_frames()
    }

    /// Returns whether the camera rests at the current frame, so that the frame gets all its samples.
    fn is_still(&self) -> bool {
        self.is_last() || self.record.is_some()
    }

    /// Handles that a picture of the current frame was shown. Once the frame has all samples that it gets, writes its
    /// picture and goes on to the next frame. Returns true after the last frame.
    ///
    /// # Errors
    /// A picture cannot be written.
    pub fn shown(&mut self, session: &Session, gpu: &GpuSession) -> Result<bool, SaveError> {
        if self.is_still() && !session.is_done(gpu) {
            return Ok(false);
        }
        if let Some(directory) = &self.record {
            save(gpu, &directory.join(format!("frame.{:04}.png", self.frame_ix)))?;
        }
        if self.is_last() {
            if let Some(path) = &self.screenshot {
                save(gpu, path)?;
            }
            return Ok(true);
        }
        self.frame_ix += 1;
        self.is_placed = false;
        Ok(false)
    }
}
