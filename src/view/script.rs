//! A viewer that is left to itself: a tour, its pictures, and the end.

use std::{path::PathBuf, time::Instant};

use super::{
    actions::{SaveError, save},
    live::Live,
    session::Session,
    tour::Tour,
};

/// Frames along a tour. The last one is seen at rest: it gets all its samples.
pub struct Script {
    tour: Tour,
    frame_ix: u32,
    /// Whether the camera is where the frame is seen from.
    is_placed: bool,
    /// Where the frames' pictures go; each gets all its samples then.
    record: Option<PathBuf>,
    /// Where the last frame's picture goes.
    screenshot: Option<PathBuf>,
}

impl Script {
    pub fn new(tour: Tour, record: Option<PathBuf>, screenshot: Option<PathBuf>) -> Self {
        Self { tour, frame_ix: 0, is_placed: false, record, screenshot }
    }

    /// Moves the camera to where the next frame is seen from. That counts as the user's input.
    pub fn direct(&mut self, session: &mut Session) {
        if std::mem::replace(&mut self.is_placed, true) {
            return;
        }
        let now = Instant::now();
        session.controller.place(self.tour.camera(self.frame_ix));
        session.pace.hear(now);
        if self.is_still() {
            session.pace.rest();
        } else {
            session.pace.moved(now);
        }
    }

    fn is_last(&self) -> bool {
        self.frame_ix + 1 == self.tour.n_frames()
    }

    fn is_still(&self) -> bool {
        self.is_last() || self.record.is_some()
    }

    /// Goes on after a frame was shown; true after the last one.
    ///
    /// # Errors
    /// A picture that cannot be written.
    pub fn shown(&mut self, session: &Session, live: &Live) -> Result<bool, SaveError> {
        if self.is_still() && !session.is_done(live) {
            return Ok(false);
        }
        if let Some(directory) = &self.record {
            save(live, &directory.join(format!("frame.{:04}.png", self.frame_ix)))?;
        }
        if self.is_last() {
            if let Some(path) = &self.screenshot {
                save(live, path)?;
            }
            return Ok(true);
        }
        self.frame_ix += 1;
        self.is_placed = false;
        Ok(false)
    }
}
