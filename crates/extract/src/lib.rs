//! From recordings to feature tensors and tables.
//!
//! `config` is the one configuration, `params` what its tables share, and `features` what can be
//! computed; `inputs` finds recordings,
//! `engine` computes, `ledger` remembers what is done, `run` ties them together. What comes out is
//! in the files of `corsmal_files`.

pub mod config;
pub mod cut;
pub mod engine;
pub mod features;
pub mod inputs;
pub mod ledger;
pub mod manifest;
pub mod merge;
pub mod params;
pub mod projection;
pub mod run;
pub mod summary;
pub mod survey;
