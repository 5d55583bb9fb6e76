//! The CORSMAL Containers Manipulation (CCM) benchmark: data set, labels, splits, submissions,
//! scores, synthetic recordings, the published results and the report.
//!
//! Facts about the data set and the official evaluators are documented where they are used;
//! `docs/ccm.md` gives the overview.

pub mod benchmark;
pub mod capacity;
pub mod citation;
pub mod dataset;
pub mod decision;
pub mod error;
pub mod paper;
pub mod predictions;
pub mod scores;
pub mod submission;
pub mod synth;
mod table;

pub use error::{CcmError, Result};
