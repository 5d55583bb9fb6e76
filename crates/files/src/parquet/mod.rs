//! The summary table as a Parquet file: column `id`, the label columns (text), one 32-bit float
//! column per feature. Configuration, provenance and outcomes are in the file's key-value metadata.

mod error;
mod keys;
mod limits;
mod numeric;
mod reader;
mod thrift;
mod writer;

pub use error::ParquetTableError;
pub use limits::{MAX_PAGE, MAX_TEXT, MAX_VALUES, MAX_VALUES_A_BYTE};
pub use numeric::NumericTable;
pub use reader::ParquetFile;
pub use writer::{write, write_over};
