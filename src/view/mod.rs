//! The interactive viewer: the user moves the camera, samples accumulate while it rests, and a panel shows the times
//! of the passes.

mod actions;
mod app;
mod away;
pub mod budget;
pub mod controller;
mod display;
mod error;
pub mod flight;
mod gpu_session;
pub mod history;
mod in_motion;
mod input;
pub mod loaded_scene;
mod message;
mod mouse;
mod opened;
mod overlay;
mod pace;
pub mod panel;
pub mod pick;
mod reload;
mod renderer;
mod saver;
mod screen;
mod script;
mod session;
mod shaders;
mod timeline;
#[cfg(test)]
mod timeline_tests;
pub mod tour;
mod ui;
pub mod watch;

pub use self::{
    display::{Display, PaceReport, ViewOptions, ViewReport},
    error::ViewError,
    in_motion::InMotion,
    loaded_scene::{LoadSettings, LoadedScene},
    opened::Opener,
    panel::Settings,
    tour::Tour,
};
