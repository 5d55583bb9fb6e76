//! Puts the outputs of all shards of a run together into the file that one run would have written,
//! byte for byte.

use std::path::{Path, PathBuf};

use corsmal_files::feature_file::{FeatureFile, FeatureFileError};
use corsmal_files::format::{FormatError, OutputFormat};
use corsmal_files::layout;
use corsmal_files::npz::{Compression, NpzError, NpzWriter};
use corsmal_files::parquet::{self, ParquetTableError};
use corsmal_files::provenance::Provenance;
use corsmal_files::shard::Shard;
use corsmal_files::table::{Table, TableError};
use thiserror::Error;

use crate::ledger::{Header, Ledger, LedgerError, ledger_path};

/// What can go wrong with merging.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum MergeError {
    /// A shard cannot be read.
    #[error(transparent)]
    Shard(#[from] FeatureFileError),
    /// A member of a shard cannot be read, or the result not be written.
    #[error(transparent)]
    Npz(#[from] NpzError),
    /// The Parquet result cannot be written.
    #[error(transparent)]
    Parquet(#[from] ParquetTableError),
    /// The result cannot be put in its place.
    #[error(transparent)]
    Ledger(#[from] LedgerError),
    /// The result is there already, or an interrupted run that was to write it.
    #[error("{path} exists; --overwrite replaces it")]
    Exists {
        /// The output or its ledger.
        path: PathBuf,
    },
    /// The result must have another name.
    #[error(transparent)]
    Name(#[from] FormatError),
    /// The files are not the shards of one run.
    #[error("{path}: expected {expected}, found {actual}")]
    NotOneRun {
        /// The file that does not fit.
        path: PathBuf,
        /// What would fit.
        expected: String,
        /// What it is.
        actual: String,
    },
    /// The tables of two shards do not fit together.
    #[error("{path}: {source}")]
    Table {
        /// The file that does not fit the ones before.
        path: PathBuf,
        /// Why.
        source: TableError,
    },
}

/// Merges all shards of a run, given in any order, one after the other. As in a run, `out` appears
/// only when it is complete, and nothing else writes it meanwhile.
///
/// # Errors
/// [`MergeError`] names the shard that does not fit.
pub fn merge(shards: &[PathBuf], out: &Path, overwrite: bool) -> Result<(), MergeError> {
    let mut format = OutputFormat::of_name(out, Compression::Stored)?;
    let pending = Ledger::is_pending(out).then(|| ledger_path(out));
    let taken = if out.exists() { Some(out.into()) } else { pending };
    if let Some(path) = taken.filter(|_| !overwrite) {
        return Err(MergeError::Exists { path });
    }
    let (shards, provenance) = in_order(shards, out)?;
    if let (OutputFormat::Npz(compression), Some(FeatureFile::Npz(first))) =
        (&mut format, shards.first().map(|path| FeatureFile::open(path)).transpose()?.as_mut())
    {
        *compression = layout::compression(first)?;
    }
    let ledger = Ledger::create(out, &Header::new(&provenance, format))?;
    match write(&shards, &provenance, format, &ledger.part()) {
        Ok(()) => Ok(ledger.publish()?),
        Err(error) => {
            // The first error is the one that matters.
            let _ = ledger.discard();
            Err(error)
        }
    }
}

/// Writes what the shards hold together.
fn write(
    shards: &[PathBuf],
    provenance: &Provenance,
    format: OutputFormat,
    part: &Path,
) -> Result<(), MergeError> {
    let mut writer = match format {
        OutputFormat::Npz(compression) => Some(NpzWriter::create(part, compression)?),
        OutputFormat::Parquet => None,
    };
    let mut joined: Option<Table> = None;
    for path in shards {
        let mut file = FeatureFile::open(path)?;
        let shard = file.table()?;
        if shard.format != format {
            return Err(not_one_run(path, format.to_string(), shard.format.to_string()));
        }
        match &mut joined {
            None => joined = Some(shard.table),
            Some(joined) => joined
                .extend(&shard.table)
                .map_err(|source| MergeError::Table { path: path.clone(), source })?,
        }
        if let (Some(writer), FeatureFile::Npz(npz)) = (&mut writer, &mut file) {
            let names: Vec<String> =
                npz.names().iter().filter(|name| layout::is_frame_level(name)).cloned().collect();
            for name in names {
                let (entry, raw) = npz.raw(&name)?;
                writer.copy(&entry, raw)?;
            }
        }
    }
    let table = joined.unwrap_or_default();
    match writer {
        Some(mut writer) => {
            layout::write_table(&mut writer, &table, provenance)?;
            Ok(writer.finish()?)
        }
        None => Ok(parquet::write(part, &table, provenance)?),
    }
}

/// Brings the shards into order, checks that they are all of one run, and says how that was made.
fn in_order(shards: &[PathBuf], out: &Path) -> Result<(Vec<PathBuf>, Provenance), MergeError> {
    let mut pieces = Vec::with_capacity(shards.len());
    for path in shards {
        pieces.push((path.clone(), FeatureFile::open(path)?.provenance()?));
    }
    pieces.sort_by_key(|(_, made)| made.shard.parse::<Shard>().map_or(0, |s| s.index));
    let count = pieces.len();
    let Some((_, first)) = pieces.first().cloned() else {
        return Err(not_one_run(out, "at least one shard".into(), "none".into()));
    };
    let mut paths = Vec::with_capacity(count);
    for (index, (path, made)) in pieces.into_iter().enumerate() {
        let shard = Shard { index, count }.to_string();
        let of = made.shard.parse::<Shard>().map_or(count, |s| s.count);
        if of != count {
            return Err(not_one_run(&path, format!("all {of} shards"), format!("{count}")));
        }
        if made.shard != shard {
            return Err(not_one_run(&path, format!("shard {shard}"), made.shard));
        }
        let fields = |p: &Provenance| {
            [
                ("layout version", p.layout_version.to_string()),
                ("tool version", p.tool_version.clone()),
                ("configuration", p.config_hash.clone()),
                ("input list", p.inputs_hash.clone()),
                ("configuration text", p.config.clone()),
            ]
        };
        let both = fields(&first).into_iter().zip(fields(&made));
        if let Some(((field, expected), (_, found))) = both.into_iter().find(|(a, b)| a != b) {
            return Err(not_one_run(&path, format!("{field} {expected}"), found));
        }
        paths.push(path);
    }
    Ok((paths, Provenance { shard: Shard::default().to_string(), ..first }))
}

fn not_one_run(path: &Path, expected: String, actual: String) -> MergeError {
    MergeError::NotOneRun { path: path.into(), expected, actual }
}
