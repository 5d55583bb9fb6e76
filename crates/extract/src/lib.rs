//! placeholder

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
pub mod provenance;
pub mod table;
