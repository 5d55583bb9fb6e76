//! Files on the ground floor: what a run writes, how it is read back, and by whom it was made.
//!
//! [`npz`] and [`parquet`] are the two kinds of feature file, [`layout`] the members of ours and
//! [`table`] the rows that both hold; [`outcome`] and [`provenance`] say what became of each input
//! and how the file was made. [`draft`] makes files appear only when they are whole, [`identity`]
//! tells whether an input is still the one that was read. Whatever a file is called, its content
//! decides how it is read: [`feature_file::FeatureFile`] opens any, [`feature_file::FeatureTable`] the
//! outputs of this tool.
//!
//! ```
//! use corsmal_files::feature_file::FeatureTable;
//! use corsmal_files::layout;
//! use corsmal_files::npz::{Compression, NpzFile, NpzWriter};
//! use corsmal_files::outcome::{Outcome, Status};
//! use corsmal_files::provenance::Provenance;
//! use corsmal_files::shard::Shard;
//! use corsmal_files::table::Table;
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! # let folder = tempfile::tempdir()?;
//! # let path = folder.path().join("feats.npz");
//! // A recording of 2 channels, 3 coefficients and 1 frame, and its row of statistics.
//! let mut writer = NpzWriter::create(&path, Compression::Stored)?;
//! writer.floats("kitchen/1", &[2, 3, 1], &[0.1, 0.2, 0.3, 0.4, 0.5, 0.6])?;
//! let mut table = Table::new(vec!["room".into()])?;
//! table.name_features(&["loudness".into()])?;
//! let outcome = Outcome::new("kitchen/1", "kitchen/1.wav", Status::Ok, "");
//! table.push(outcome, &[("room".into(), "kitchen".into())], &[0.35])?;
//! let made = Provenance::new("{}".into(), "hash".into(), "inputs".into(), Shard::default());
//! layout::write_table(&mut writer, &table, &made)?;
//! writer.finish()?;
//!
//! assert_eq!(NpzFile::open(&path)?.f32("kitchen/1")?[[1, 2, 0]], 0.6);
//! let read = FeatureTable::open(&path)?;
//! assert_eq!(read.table.values()[[0, 0]], 0.35);
//! assert_eq!(read.provenance, made);
//! # Ok(())
//! # }
//! ```

pub mod content;
pub mod csv_text;
pub mod draft;
pub mod feature_file;
pub mod format;
mod growth;
pub mod identity;
pub mod layout;
pub mod memory;
pub mod npy;
pub mod npz;
pub mod outcome;
pub mod parquet;
pub mod partition;
pub mod provenance;
pub mod quote;
pub mod sealed;
pub mod settings;
pub mod shard;
pub mod shield;
pub mod spelling;
pub mod statistic;
pub mod table;
pub mod workplace;
