//! The renderer in a window: a camera in the user's hands, samples that add up while it rests, and where the time goes.

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
