//! The networks of the benchmark: architectures, training, weights.
//!
//! Everything of burn stays in this crate. [`layer::Layer`] is what a network is made of,
//! [`network::Network`] an architecture with its numbers, [`networks`] the published ones.

pub mod batch;
mod checkpoint;
pub mod cross_validation;
pub mod dataset;
pub mod error;
pub mod fit;
mod history;
pub mod items;
mod kernels;
pub mod layer;
pub mod layers;
pub mod loss;
pub mod matrix;
pub mod model;
pub mod network;
pub mod networks;
pub mod optimiser;
pub mod parameters;
pub mod random;
pub mod recipe;
mod task;
pub mod trainer;
pub mod weights;

pub use error::{NetError, Result};
