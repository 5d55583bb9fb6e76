//! placeholder

pub mod identity;
pub mod npy;
pub mod npz;
pub mod outcome;
