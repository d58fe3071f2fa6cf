//! The renderer in a window: a camera in the user's hands, samples that add up while it rests, and where the time goes.

pub mod budget;
pub mod controller;
pub mod history;
pub mod loaded;
pub mod panel;
pub mod pick;
pub mod tour;
pub mod watch;
