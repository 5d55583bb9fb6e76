//! The CORSMAL Containers Manipulation (CCM) benchmark: data set, labels, splits, submissions,
//! scores, synthetic recordings, the published results and the report.
//!
//! Facts about the data set and the official evaluators are documented where they are used;
//! `docs/ccm.md` gives the overview.
//!
//! A submission for the public test part, written in the official format and read again:
//!
//! ```
//! use corsmal_ccm::dataset::{SequenceName, Subset};
//! use corsmal_ccm::submission::{Format, Submission, official_rows, pseudo_random};
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! # let folder = tempfile::tempdir()?;
//! # let path = folder.path().join("random.csv");
//! let recordings = official_rows(Subset::Public, Format::Y2022);
//! let estimates = pseudo_random(&recordings, 7);
//! Submission::write(&path, Format::Y2022, &estimates, &recordings)?;
//!
//! let submission = Submission::read(&path)?;
//! assert_eq!(submission.keys.len(), 228);
//! assert!(submission.capacity.addressed());
//!
//! let name = SequenceName::parse("s0_fi3_fu2_b0_l1_audio.wav").expect("a name of the data set");
//! assert_eq!(name.filling.name(), "water full");
//! # Ok(())
//! # }
//! ```

pub mod benchmark;
pub mod capacity;
pub mod citation;
pub mod crop;
pub mod dataset;
pub mod decision;
pub mod error;
mod folders;
pub mod fused;
pub mod paper;
pub mod predictions;
pub mod scores;
pub mod submission;
pub mod synth;
mod table;

pub use error::{CcmError, Result};
