//! Draws the frames of a film on several devices. Each device draws whole frames, and takes the next one as soon as it
//! has drawn its last.

use std::{
    slice,
    sync::{
        Arc,
        atomic::{AtomicBool, Ordering},
    },
    time::{Duration, Instant},
};

use super::{
    Member, open_members, share,
    work_queue::{Chunking, WorkQueue},
};
use crate::{
    engine::Renderer,
    frame::{RenderOptions, Watcher},
    gpu::{Context, GpuError},
    world::World,
};

/// Renderers of one world on several devices, each of which draws whole frames.
pub struct FilmRenderer {
    members: Vec<Member<Timed>>,
    frames: WorkQueue,
}

/// A renderer, and the time that it has drawn.
struct Timed {
    renderer: Renderer,
    drawing: Duration,
}

impl FilmRenderer {
    /// Uploads the scene to all devices and creates the pipelines, on all devices at the same time.
    ///
    /// # Errors
    /// The scene or a row of the picture is beyond the limits or the memory of a device.
    pub(in crate::engine) fn new(
        contexts: &[Arc<Context>],
        world: &World,
        options: &RenderOptions,
    ) -> Result<Self, GpuError> {
        let open = |context: &Arc<Context>| {
            let renderer = Renderer::new(slice::from_ref(context), world, options)?;
            Ok(Timed { renderer, drawing: Duration::ZERO })
        };
        let frames = WorkQueue::new(contexts.len(), Chunking::Single);
        Ok(Self { members: open_members(contexts, open)?, frames })
    }

    /// Draws the frames 0 to `n_frames` - 1 and returns what `finish` makes of each, in their order. `draw` draws a
    /// frame on a device, and calls its last argument for each sample of each band. `finish` gets what `draw` returned,
    /// for example to write it to a file. The watcher is told of the samples of all frames together.
    ///
    /// If `draw` fails on a device, a warning says so, another device draws the frame, and the device draws nothing
    /// more.
    ///
    /// # Errors
    /// `draw` has failed on all devices. Or `finish` has failed: frames that are being drawn are finished then, no
    /// further ones are begun, and the error is that of the first frame that has one.
    pub fn draw<D, T: Send, E: From<GpuError> + Send>(
        &mut self,
        n_frames: u32,
        watcher: &mut impl Watcher,
        draw: impl Fn(&mut Renderer, u32, &dyn Fn()) -> Result<D, GpuError> + Sync,
        finish: impl Fn(u32, D) -> Result<T, E> + Sync,
    ) -> Result<Vec<T>, E> {
        let stops = AtomicBool::new(false);
        let frames = share(&mut self.members, &mut self.frames, 0..n_frames, watcher, |member, frame, tell| {
            if stops.load(Ordering::Relaxed) {
                return Ok(None);
            }
            let (begin, share) = (Instant::now(), 1.0 / f64::from(member.renderer.n_bands()));
            let drawn = draw(&mut member.renderer, frame.start, &|| tell(share))?;
            member.drawing += begin.elapsed();
            let finished = finish(frame.start, drawn);
            stops.fetch_or(finished.is_err(), Ordering::Relaxed);
            Ok(Some(finished))
        })?;
        frames.into_iter().filter_map(|(_, finished)| finished).collect()
    }

    /// Returns the time that the device that has drawn longest has drawn.
    pub fn longest_drawing(&self) -> Duration {
        self.members.iter().map(|member| member.renderer.drawing).max().unwrap_or_default()
    }
}
