//! Tests the command `kdray`, a file for each subcommand or for what all of them share.

#[path = "../support/mod.rs"]
mod support;

mod cast;
mod cli;
mod doctor;
mod examples;
mod files;
mod films;
mod merge;
mod messages;
#[cfg(target_os = "linux")]
mod outside;
mod pack;
#[cfg(target_os = "linux")]
mod process;
mod progress_openjd;
mod render;
mod several;
mod size;
