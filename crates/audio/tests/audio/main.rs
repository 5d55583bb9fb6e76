//! Tests of the readers as a library user sees them.

// Helper functions of tests may unwrap as tests do.
#![allow(clippy::unwrap_used)]

mod allocations;
#[cfg(feature = "symphonia")]
mod begin;
#[cfg(feature = "symphonia")]
mod cases;
mod common;
#[cfg(feature = "symphonia")]
mod compressed;
mod containers;
mod corpus;
#[cfg(feature = "symphonia")]
mod damage;
mod dialects;
#[cfg(feature = "symphonia")]
mod flac;
#[cfg(feature = "symphonia")]
mod flac_sides;
#[cfg(feature = "symphonia")]
mod mp4;
#[cfg(feature = "symphonia")]
mod mpeg;
mod mutations;
#[cfg(feature = "symphonia")]
mod ogg;
#[cfg(feature = "symphonia")]
mod oracles;
mod properties;
