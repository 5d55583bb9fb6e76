//! Feature files with labels, as training takes them.
//!
//! [`LabelledTable::read`] reads an `.npz` or `.parquet` of `extract` with statistics, or any `.npz`
//! with a matrix; labels are its own columns, those of a [`LabelFile`], or the names of the folders in
//! which the recordings lie. [`LabelledTable::dataset`] gives linfa's data set.

mod doubts;
mod error;
mod foreign;
mod ids;
mod label_file;
mod reading;
mod table;

pub use error::{DatasetError, Result};
pub use foreign::MemberNames;
pub use label_file::{LabelFile, LabelSource};
pub use table::LabelledTable;
