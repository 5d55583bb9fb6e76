//! `corsmal-feat extract` from outside.

// Helper functions of tests may unwrap as tests do.
#![allow(clippy::unwrap_used)]

mod bad_recordings;
mod crashes;
mod long;
mod outputs;
mod projection;
mod refusals;
mod streams;
mod support;
