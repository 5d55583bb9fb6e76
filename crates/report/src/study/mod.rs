//! The report on a classifier for any labelled recordings: what the data are like, how well it does
//! on recordings that it was not trained on, what it relies on, and where to listen.

mod content;
mod data;
mod errors;
mod estimates;
mod report;
mod scores;

pub use content::{
    CalibrationBin, ClassCurve, ClassScore, Importance, LearningPoint, Prediction, Recording,
    Score, Study,
};
pub use estimates::{Estimate, Estimates};
