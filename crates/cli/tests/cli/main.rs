//! `corsmal-feat` from outside, as a user runs it.

// Helper functions of tests may unwrap as tests do.
#![allow(clippy::unwrap_used)]

mod capacity;
mod ccm_commands;
mod command;
mod compare;
mod compat;
#[cfg(target_os = "linux")]
mod devices;
mod drawn_features;
mod extract;
mod formats;
mod fusion;
#[cfg(feature = "nets")]
mod hearing;
mod held_out;
mod hostile;
mod inspect;
mod inspect_kinds;
mod journey;
mod labels;
mod live;
mod models;
mod mutations;
#[cfg(feature = "nets")]
mod networks;
mod onnx;
mod options;
#[cfg(feature = "nets")]
mod pictures;
#[cfg(unix)]
mod processes;
mod scoring;
mod stores;
#[cfg(feature = "nets")]
mod systems;
