//! Files on the ground floor: what a run writes, how it is read back, and by whom it was made.
//!
//! [`npz`] and [`parquet`] are the two kinds of feature file, [`layout`] the members of ours and
//! [`table`] the rows that both hold; [`outcome`] and [`provenance`] say what became of each input
//! and how the file was made. [`draft`] makes files appear only when they are whole, [`identity`]
//! tells whether an input is still the one that was read.

pub mod draft;
pub mod feature_file;
pub mod format;
pub mod identity;
pub mod layout;
pub mod npy;
pub mod npz;
pub mod outcome;
pub mod parquet;
pub mod provenance;
pub mod quote;
pub mod shard;
pub mod table;
