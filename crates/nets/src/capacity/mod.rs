//! M2's estimate of a container's capacity from the depth of its region.

mod estimate;
mod network;
mod training;

pub use network::{CapacityNetwork, Header};
pub use training::{Example, recipe, train};
