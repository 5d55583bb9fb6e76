//! Tests of the readers as a library user sees them.

// Helper functions of tests may unwrap as tests do.
#![allow(clippy::unwrap_used)]

mod allocations;
mod common;
#[cfg(feature = "symphonia")]
mod compressed;
mod corpus;
mod dialects;
mod mutations;
mod properties;
