//! From recordings to feature tensors and tables.
//!
//! `config` is the one configuration, `features` what can be computed, `engine` computes it from a
//! stream of samples.

pub mod config;
pub mod engine;
pub mod features;
pub mod summary;
