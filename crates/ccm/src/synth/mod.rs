//! Synthetic recordings in the layout and naming of the CCM data set.
//!
//! For demonstration and tests only: scores on them mean nothing about the real data set.

mod annotations;
mod array;
mod files;
mod generate;
mod objects;
mod physics;
mod take;
mod views;

pub use files::NOTICE;
pub use generate::{Summary, generate, generate_with_views};
pub use physics::SAMPLE_RATE;
pub use take::Size;
pub use views::write_views;
