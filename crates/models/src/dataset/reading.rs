//! Reading a labelled table.

use std::path::Path;

use corsmal_files::feature_file::{FeatureFile, FeatureTable};
use corsmal_files::layout;

use super::error::{DatasetError, Result};
use super::foreign::{self, MemberNames};
use super::table::LabelledTable;

impl LabelledTable {
    /// Reads an `.npz` or `.parquet` of `extract` or of another program.
    ///
    /// # Errors
    /// [`DatasetError`] for a file that cannot be read or has no matrix of features.
    pub fn read(path: &Path, members: &MemberNames) -> Result<Self> {
        match FeatureFile::open(path)? {
            FeatureFile::Npz(mut npz) if !layout::is_ours(&npz) => {
                foreign::read(path, &mut npz, members)
            }
            FeatureFile::Parquet(parquet) if !parquet.is_ours() => {
                foreign::read_parquet(path, &parquet, members)
            }
            mut ours => {
                if ours.is_ours() && *members != MemberNames::default() {
                    return Err(DatasetError::content(
                        path,
                        "is of `extract`, which names its own features and ids: --x and --ids are \
                         for files from other programs",
                    ));
                }
                let FeatureTable { table, provenance, .. } = ours.table()?;
                let config = serde_json::from_str(&provenance.config)
                    .map_err(|e| DatasetError::content(path, format!("its configuration: {e}")))?;
                Self::of_extraction(path, &table, config, provenance.config_hash)
            }
        }
    }
}
