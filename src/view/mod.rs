//! The interactive viewer: the user moves the camera, samples accumulate while it rests, and a panel shows the times
//! of the passes.

mod actions;
mod app;
pub mod budget;
pub mod controller;
mod display;
mod error;
pub mod flight;
pub mod history;
mod input;
mod live;
pub mod loaded;
mod mouse;
mod overlay;
mod pace;
pub mod panel;
pub mod pick;
mod reload;
mod script;
mod session;
#[cfg(feature = "hot-reload")]
mod shaders;
pub mod tour;
mod ui;
pub mod watch;

pub use self::{
    display::{Display, PaceReport, ViewOptions, ViewReport},
    error::ViewError,
    loaded::{LoadOptions, Loaded},
    panel::Settings,
    tour::Tour,
};
