//! Puts the outputs of all shards of a run together into the file that one run would have written,
//! byte for byte.

use std::fs::File;
use std::path::{Path, PathBuf};

use corsmal_files::draft;
use corsmal_files::feature_file::{FeatureFile, FeatureFileError};
use corsmal_files::format::{FormatError, OutputFormat};
use corsmal_files::identity::{self, Stamp};
use corsmal_files::layout;
use corsmal_files::npz::{Compression, EntryRecord, NpzError, NpzWriter};
use corsmal_files::parquet::{self, FramesWriter, ParquetFile, ParquetTableError};
use corsmal_files::provenance::Provenance;
use corsmal_files::shard::Shard;
use corsmal_files::table::{Table, TableError};
use serde::{Deserialize, Serialize};
use thiserror::Error;

use crate::ledger::{Done, Header, Ledger, LedgerError, ledger_path};
use crate::run::RunError;

/// What can go wrong with merging.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum MergeError {
    /// An output or a shard in a store; says which and why.
    #[error(transparent)]
    Stored(#[from] RunError),
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
    #[error("{path} exists; --overwrite replaces it, --resume continues an interrupted merge")]
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
    /// A shard is no longer the file that was found first.
    #[error("{path} was changed while it was merged; merge again once nothing writes to it")]
    Changed {
        /// The shard.
        path: PathBuf,
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

/// What to do with what stands where the result is to be.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum Existing {
    /// Leave it and refuse.
    #[default]
    Keep,
    /// Go on with an interrupted merge, if there is one.
    Resume,
    /// Replace it.
    Overwrite,
}

/// A shard as it was found.
struct Piece {
    path: PathBuf,
    identity: String,
    stamp: Option<Stamp>,
}

impl Piece {
    /// Takes the identity of a file before anything is read from it.
    fn find(path: &Path) -> Result<Self, MergeError> {
        let io = |e| NpzError::io(path, e);
        let stamp = Stamp::of_path(path).map_err(io)?;
        let identity = identity::of_file(path).map_err(io)?;
        Ok(Self { path: path.into(), identity, stamp })
    }

    /// Refuses what was read where the file is another one by now.
    fn require_same(&self) -> Result<(), MergeError> {
        match Stamp::of_path(&self.path) {
            Ok(now) if now == self.stamp => Ok(()),
            _ => Err(MergeError::Changed { path: self.path.clone() }),
        }
    }
}

/// A shard whose arrays are in the result.
#[derive(Debug, Serialize, Deserialize)]
struct Merged {
    shard: PathBuf,
    identity: String,
    entries: Vec<EntryRecord>,
}

impl Done for Merged {
    fn entries(&self) -> &[EntryRecord] {
        &self.entries
    }
}

/// Merges all shards of a run, given in any order, one after the other. As in a run, `out` appears
/// only when it is complete, nothing else writes it meanwhile, and what was interrupted can go on.
///
/// # Errors
/// [`MergeError`] names the shard that does not fit.
pub fn merge(shards: &[PathBuf], out: &Path, existing: Existing) -> Result<(), MergeError> {
    let mut format = OutputFormat::of_name(out, Compression::Stored)?;
    let out = &draft::destination(out);
    let pending = Ledger::is_pending(out).then(|| ledger_path(out));
    let taken = if out.exists() { Some(out.clone()) } else { pending };
    match (taken, existing) {
        (Some(path), Existing::Keep) => return Err(MergeError::Exists { path }),
        (Some(path), Existing::Resume) if path == *out => return Err(MergeError::Exists { path }),
        _ => {}
    }
    let (shards, provenance) = in_order(shards, out)?;
    if let (OutputFormat::Npz(compression), Some(first)) = (&mut format, shards.first())
        && let FeatureFile::Npz(npz) = &mut FeatureFile::open(&first.path)?
    {
        *compression = layout::compression(npz)?;
    }
    let header = Header::new(&provenance, format_args!("merge of {}, {format}", shards.len()));
    let (ledger, done) = if existing == Existing::Resume {
        let same = |i: usize, done: &Merged| {
            shards.get(i).is_some_and(|s| s.path == done.shard && s.identity == done.identity)
        };
        let (ledger, resumed) = Ledger::resume(out, &header, same)?;
        (ledger, resumed.records)
    } else {
        (Ledger::create(out, &header)?, Vec::new())
    };
    let mut merge = Merge { ledger, shards: &shards, provenance: &provenance, format };
    match merge.write(done) {
        Ok(()) => Ok(merge.ledger.publish()?),
        Err(error) => {
            // The first error is the one that matters. A shard that does not fit never will.
            let _ = merge.ledger.discard();
            Err(error)
        }
    }
}

/// A merge at work.
struct Merge<'a> {
    ledger: Ledger,
    shards: &'a [Piece],
    provenance: &'a Provenance,
    format: OutputFormat,
}

impl Merge<'_> {
    /// Writes what the shards hold together; the arrays of those that are `done` are there.
    fn write(&mut self, done: Vec<Merged>) -> Result<(), MergeError> {
        let (part, path) = self.ledger.part()?;
        let ready = done.len();
        let mut writer = match self.format {
            OutputFormat::Npz(compression) => {
                let entries = done.into_iter().flat_map(|done| done.entries).collect();
                Some(NpzWriter::resume(
                    part.try_clone().map_err(|e| NpzError::io(&path, e))?,
                    &path,
                    compression,
                    entries,
                )?)
            }
            OutputFormat::Parquet => None,
        };
        let mut joined: Option<Table> = None;
        let mut frames = false;
        for (index, piece) in self.shards.iter().enumerate() {
            let shard = &piece.path;
            let mut file = FeatureFile::open(shard)?;
            let read = file.table()?;
            if read.format != self.format {
                return Err(not_one_run(shard, self.format.to_string(), read.format.to_string()));
            }
            match &mut joined {
                None => joined = Some(read.table),
                Some(joined) => joined
                    .extend(&read.table)
                    .map_err(|source| MergeError::Table { path: shard.clone(), source })?,
            }
            if let FeatureFile::Parquet(parquet) = &file {
                frames |= !parquet.frame_features().is_empty();
            }
            if index < ready {
                piece.require_same()?;
                continue;
            }
            let mut entries = Vec::new();
            if let (Some(writer), FeatureFile::Npz(npz)) = (&mut writer, &mut file) {
                let frames = npz.names().iter().filter(|name| layout::is_frame_level(name));
                for name in frames.cloned().collect::<Vec<_>>() {
                    let (entry, raw) = npz.raw(&name)?;
                    entries.push(writer.copy(&entry, raw)?);
                }
            }
            piece.require_same()?;
            let identity = piece.identity.clone();
            self.ledger.append(&Merged { shard: shard.clone(), identity, entries })?;
        }
        let table = joined.unwrap_or_default();
        match writer {
            Some(mut writer) => {
                layout::write_table(&mut writer, &table, self.provenance)?;
                Ok(writer.finish()?)
            }
            None if frames => self.write_frames(part, &path, &table),
            None => Ok(parquet::write_over(part, &path, &table, self.provenance)?),
        }
    }

    /// Writes the frames of all shards, grouped as those of one run.
    fn write_frames(&self, part: File, path: &Path, table: &Table) -> Result<(), MergeError> {
        let mut writer = FramesWriter::over(part, path, table, self.provenance)?;
        let features = self.provenance.features();
        for piece in self.shards {
            let mut file = ParquetFile::open(&piece.path)?;
            for row in 0..file.table()?.0.ids().len() {
                let frames = features.iter().map(|feature| file.frames(row, feature));
                writer.push(frames.collect::<Result<_, _>>()?)?;
            }
            piece.require_same()?;
        }
        Ok(writer.finish()?)
    }
}

/// Brings the shards into order, checks that they are all of one run, and says how that was made.
fn in_order(shards: &[PathBuf], out: &Path) -> Result<(Vec<Piece>, Provenance), MergeError> {
    let mut pieces = Vec::with_capacity(shards.len());
    for path in shards {
        let piece = Piece::find(path)?;
        pieces.push((piece, FeatureFile::open(path)?.provenance()?));
    }
    pieces.sort_by_key(|(_, made)| made.shard.parse::<Shard>().map_or(0, |s| s.index));
    let count = pieces.len();
    let Some(first) = pieces.first().map(|(_, made)| made.clone()) else {
        return Err(not_one_run(out, "at least one shard".into(), "none".into()));
    };
    let mut ordered = Vec::with_capacity(count);
    for (index, (piece, made)) in pieces.into_iter().enumerate() {
        let path = &piece.path;
        let shard = Shard { index, count }.to_string();
        let of = made.shard.parse::<Shard>().map_or(count, |s| s.count);
        if of != count {
            return Err(not_one_run(path, format!("all {of} shards"), format!("{count}")));
        }
        if made.shard != shard {
            return Err(not_one_run(path, format!("shard {shard}"), made.shard));
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
            return Err(not_one_run(path, format!("{field} {expected}"), found));
        }
        ordered.push(piece);
    }
    Ok((ordered, Provenance { shard: Shard::default().to_string(), ..first }))
}

fn not_one_run(path: &Path, expected: String, actual: String) -> MergeError {
    MergeError::NotOneRun { path: path.into(), expected, actual }
}

#[cfg(test)]
mod tests {
    use corsmal_files::outcome::{Outcome, Status};

    use super::*;

    /// A shard of two recordings.
    fn shard(path: &Path, compression: Compression, shard: Shard) -> Provenance {
        let provenance = Provenance::new("{}".into(), "c0ffee".into(), "beef".into(), shard);
        let mut writer = NpzWriter::create(path, compression).unwrap();
        let mut table = Table::new(Vec::new()).unwrap();
        for i in 0..2 {
            let id = format!("{}/{i}", shard.index);
            writer.floats(&id, &[30], &[(shard.index + i) as f32; 30]).unwrap();
            table.push(Outcome::new(id, "x.wav", Status::Ok, ""), &[], &[]).unwrap();
        }
        layout::write_table(&mut writer, &table, &provenance).unwrap();
        writer.finish().unwrap();
        provenance
    }

    #[test]
    fn an_interrupted_merge_goes_on_to_the_same_bytes() {
        let folder = tempfile::tempdir().unwrap();
        let path = |name: &str| folder.path().join(name);
        for compression in [Compression::Stored, Compression::Deflated] {
            let shards: Vec<PathBuf> = (0..3).map(|i| path(&format!("{i}.npz"))).collect();
            let mut provenance = None;
            for (index, file) in shards.iter().enumerate() {
                provenance = Some(shard(file, compression, Shard { index, count: 3 }));
            }
            let whole = path("whole.npz");
            merge(&shards, &whole, Existing::Overwrite).unwrap();
            let expected = std::fs::read(&whole).unwrap();

            let provenance =
                Provenance { shard: Shard::default().to_string(), ..provenance.unwrap() };
            let out = path("out.npz");
            let _ = std::fs::remove_file(&out);
            for changed in [false, true] {
                let format = OutputFormat::Npz(compression);
                let header = Header::new(&provenance, format_args!("merge of 3, {format}"));
                let ledger = Ledger::create(&out, &header).unwrap();
                let two: Vec<Piece> =
                    shards[..2].iter().map(|path| Piece::find(path).unwrap()).collect();
                let mut two = Merge { ledger, shards: &two, provenance: &provenance, format };
                two.write(Vec::new()).unwrap();
                // As a kill would leave it.
                drop(two);
                if changed {
                    let part = corsmal_files::draft::folder(&out).join("out.npz.part");
                    let mut bytes = std::fs::read(&part).unwrap();
                    bytes[200] ^= 1;
                    std::fs::write(&part, bytes).unwrap();
                }
                let refused = merge(&shards, &out, Existing::Keep).unwrap_err();
                assert!(refused.to_string().contains("out.npz.ledger exists"), "{refused}");
                merge(&shards, &out, Existing::Resume).unwrap();
                assert!(std::fs::read(&out).unwrap() == expected, "{compression:?}");
                let there = merge(&shards, &out, Existing::Resume).unwrap_err();
                assert!(there.to_string().contains("out.npz exists"), "{there}");
                std::fs::remove_file(&out).unwrap();
            }
        }
    }

    #[test]
    fn a_shard_that_changes_after_it_was_found_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("0.npz");
        let provenance = shard(&path, Compression::Stored, Shard::default());
        let out = folder.path().join("out.npz");
        let format = OutputFormat::Npz(Compression::Stored);
        let header = Header::new(&provenance, format_args!("merge of 1, {format}"));
        let pieces = [Piece::find(&path).unwrap()];
        // As another run would replace it: a file of the same size under the same name.
        let other = folder.path().join("other.npz");
        std::fs::copy(&path, &other).unwrap();
        std::fs::rename(&other, &path).unwrap();
        let ledger = Ledger::create(&out, &header).unwrap();
        let mut merge = Merge { ledger, shards: &pieces, provenance: &provenance, format };
        let refused = merge.write(Vec::new()).unwrap_err();
        assert!(refused.to_string().contains("0.npz was changed"), "{refused}");
    }
}
