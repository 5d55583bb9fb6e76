//! Outputs as Parquet files: column `id`, the label columns (text), then the summary, one 32-bit
//! float column per statistic, or the frames, a column of nested lists per feature. Configuration,
//! provenance and outcomes are in the file's key-value metadata.

mod error;
mod fields;
mod frames;
mod keys;
mod levels;
mod limits;
mod numeric;
mod reader;
mod seal;
mod thrift;
mod writer;

pub use error::ParquetTableError;
pub use frames::{Frames, FramesWriter, MAX_FRAMES, entries};
pub use limits::{MAX_PAGE, MAX_TEXT, MAX_VALUES, MAX_VALUES_A_BYTE};
pub use numeric::NumericTable;
pub use reader::ParquetFile;
pub use writer::{write, write_over};
