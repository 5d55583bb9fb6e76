//! Puts the outputs of all shards of a run together into the file that one run would have written,
//! byte for byte.

use std::path::{Path, PathBuf};

use thiserror::Error;

use crate::ledger::{Header, Ledger, LedgerError, ledger_path};
use corsmal_files::layout::{self, LayoutError};
use corsmal_files::npz::{NpzError, NpzFile, NpzWriter};
use corsmal_files::parquet::{self, ParquetTableError};
use corsmal_files::provenance::Provenance;
use corsmal_files::shard::Shard;
use corsmal_files::table::{Table, TableError};

/// What can go wrong with merging.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum MergeError {
    /// A shard cannot be read.
    #[error(transparent)]
    Layout(#[from] LayoutError),
    /// An archive cannot be read or written.
    #[error(transparent)]
    Npz(#[from] NpzError),
    /// A Parquet file cannot be read or written.
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
    #[error("{path}: must end in .npz or .parquet")]
    Extension {
        /// The output.
        path: PathBuf,
    },
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

/// Merges all shards of a run, given in any order. The kind of output follows from the extension of
/// `out`. As in a run, `out` appears only when it is complete, and nothing else writes it meanwhile.
///
/// # Errors
/// [`MergeError`] names the shard that does not fit.
pub fn merge(shards: &[PathBuf], out: &Path, overwrite: bool) -> Result<(), MergeError> {
    let parquet = match out.extension() {
        Some(e) if e.eq_ignore_ascii_case("parquet") => true,
        Some(e) if e.eq_ignore_ascii_case("npz") => false,
        _ => return Err(MergeError::Extension { path: out.into() }),
    };
    let pending = Ledger::is_pending(out).then(|| ledger_path(out));
    let taken = if out.exists() { Some(out.into()) } else { pending };
    if let Some(path) = taken.filter(|_| !overwrite) {
        return Err(MergeError::Exists { path });
    }
    if parquet { merge_parquet(shards, out) } else { merge_npz(shards, out) }
}

fn merge_parquet(shards: &[PathBuf], out: &Path) -> Result<(), MergeError> {
    let mut read = Vec::new();
    for path in shards {
        let (table, provenance) = parquet::read(path)?;
        read.push(Piece { path: path.clone(), table, provenance, file: () });
    }
    let (_, table, provenance) = join(read, out)?;
    publish(out, &provenance, "parquet", |part| Ok(parquet::write(part, &table, &provenance)?))
}

fn merge_npz(shards: &[PathBuf], out: &Path) -> Result<(), MergeError> {
    let mut read = Vec::new();
    for path in shards {
        let mut file = NpzFile::open(path)?;
        let (table, provenance) = layout::read_table(&mut file)?;
        read.push(Piece { path: path.clone(), table, provenance, file });
    }
    let (mut files, table, provenance) = join(read, out)?;
    let (witness, _) = files[0].raw(layout::COMPRESSION_WITNESS)?;
    publish(out, &provenance, "npz", |part| {
        let mut writer = NpzWriter::create(part, witness.compression)?;
        for file in &mut files {
            let names: Vec<String> =
                file.names().iter().filter(|name| layout::is_frame_level(name)).cloned().collect();
            for name in names {
                let (entry, raw) = file.raw(&name)?;
                writer.copy(&entry, raw)?;
            }
        }
        layout::write_table(&mut writer, &table, &provenance)?;
        Ok(writer.finish()?)
    })
}

/// Has the partial output written under the lock of a ledger, and gives it its name.
fn publish(
    out: &Path,
    provenance: &Provenance,
    format: &str,
    write: impl FnOnce(&Path) -> Result<(), MergeError>,
) -> Result<(), MergeError> {
    let ledger = Ledger::create(out, &Header::new(provenance, format))?;
    match write(&ledger.part()) {
        Ok(()) => Ok(ledger.publish()?),
        Err(error) => {
            // The first error is the one that matters.
            let _ = ledger.discard();
            Err(error)
        }
    }
}

/// One shard.
struct Piece<F> {
    path: PathBuf,
    table: Table,
    provenance: Provenance,
    file: F,
}

/// Orders the shards, checks that they are all of one run, and joins their tables.
fn join<F>(
    mut pieces: Vec<Piece<F>>,
    out: &Path,
) -> Result<(Vec<F>, Table, Provenance), MergeError> {
    let not_one_run = |path: &Path, expected: String, actual: String| MergeError::NotOneRun {
        path: path.into(),
        expected,
        actual,
    };
    pieces.sort_by_key(|piece| piece.provenance.shard.parse::<Shard>().map_or(0, |s| s.index));
    let count = pieces.len();
    let Some(first) = pieces.first().map(|piece| piece.provenance.clone()) else {
        return Err(not_one_run(out, "at least one shard".into(), "none".into()));
    };
    let mut table: Option<Table> = None;
    let mut files = Vec::new();
    for (index, piece) in pieces.into_iter().enumerate() {
        let shard = Shard { index, count }.to_string();
        let expected = Provenance { shard: shard.clone(), ..first.clone() };
        let of = piece.provenance.shard.parse::<Shard>().map_or(count, |s| s.count);
        if of != count {
            let (expected, actual) = (format!("all {of} shards"), format!("{count}"));
            return Err(not_one_run(&piece.path, expected, actual));
        }
        if piece.provenance.shard != shard {
            return Err(not_one_run(&piece.path, format!("shard {shard}"), piece.provenance.shard));
        }
        if piece.provenance != expected {
            let expected = "tool version, configuration and input list of the other shards";
            return Err(not_one_run(&piece.path, expected.into(), "others".into()));
        }
        match &mut table {
            None => table = Some(piece.table),
            Some(table) => table
                .extend(&piece.table)
                .map_err(|source| MergeError::Table { path: piece.path, source })?,
        }
        files.push(piece.file);
    }
    let whole = Provenance { shard: Shard::default().to_string(), ..first };
    Ok((files, table.unwrap_or_default(), whole))
}
