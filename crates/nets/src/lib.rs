//! The networks of the benchmark: architectures, training, weights.
//!
//! Everything of burn stays in this crate. [`layer::Layer`] is what a network is made of,
//! [`network::Network`] an architecture with its numbers, [`networks`] their table.
//!
//! ```
//! use corsmal_nets::networks;
//!
//! // M1's network for two classes, with initial numbers of seed 0, on three items.
//! let network = networks::named("m1")?.build(Some(2), 0)?;
//! let inputs = network.batches(&[(vec![3, 2050], vec![0.5; 3 * 2050])])?;
//! let outputs = network.forward(&inputs)?;
//! assert_eq!((outputs.items(), network.outputs()), (3, 2));
//! # Ok::<(), corsmal_nets::NetError>(())
//! ```
//!
//! [`fit`] trains a network by a [`recipe`], [`cross_validation`] scores it on held-out items,
//! [`weights`] reads and writes PyTorch's numbers.

pub mod batch;
pub mod capacity;
mod checkpoint;
mod course;
pub mod cross_validation;
pub mod dataset;
pub mod device;
mod epochs;
pub mod error;
pub mod fit;
pub mod front_end;
#[cfg(any(test, feature = "gpu"))]
pub mod gpu;
mod history;
mod input;
pub mod items;
mod kernels;
pub mod layer;
pub mod layers;
pub mod loss;
pub mod matrix;
mod memory;
pub mod model;
pub mod network;
pub mod networks;
pub mod optimiser;
mod packed;
pub mod parameters;
pub mod picture;
pub mod random;
pub mod recipe;
mod task;
pub mod trainer;
pub mod weights;

pub use error::{NetError, Result};
