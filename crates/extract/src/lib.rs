//! From recordings to feature tensors and tables.
//!
//! `config` is the one configuration and `features` what can be computed; `inputs` finds recordings,
//! `engine` computes, `npz`, `table` and `parquet` hold what comes out, `ledger` remembers what is
//! done, `run` ties them together.

pub mod compare;
pub mod config;
pub mod draft;
pub mod engine;
pub mod features;
pub mod frontend;
pub mod identity;
pub mod inputs;
pub mod layout;
pub mod ledger;
pub mod manifest;
pub mod merge;
pub mod npy;
pub mod npz;
pub mod outcome;
pub mod parquet;
pub mod projection;
pub mod provenance;
pub mod run;
pub mod summary;
pub mod table;
