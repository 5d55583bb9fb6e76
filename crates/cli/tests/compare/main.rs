//! `corsmal-feat compare` from outside.

// Helper functions of tests may unwrap as tests do.
#![allow(clippy::unwrap_used)]

mod causes;
mod files;
mod support;
