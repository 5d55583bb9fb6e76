//! Puts the outputs of all shards of a run together into the file that one run would have written,
//! byte for byte.

mod error;
mod order;
pub mod stored;

use std::fs::File;
use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;

use corsmal_files::draft;
use corsmal_files::feature_file::FeatureFile;
use corsmal_files::format::OutputFormat;
use corsmal_files::layout;
use corsmal_files::npz::{Compression, EntryRecord, NpzError, NpzWriter};
use corsmal_files::parquet::{self, FramesWriter, ParquetFile};
use corsmal_files::provenance::Provenance;
use corsmal_files::table::Table;
use serde::{Deserialize, Serialize};

use crate::ledger::{Done, Header, Ledger, ledger_path};
use crate::run::{RunError, mixed};

use error::go_on;
use order::{Piece, in_order, not_one_run};

pub use error::MergeError;

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

/// A shard whose arrays are in the result.
#[derive(Debug, Serialize, Deserialize)]
struct Merged {
    /// Its path, in words.
    shard: String,
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
/// `stop` ends the merge early, its ledger intact. Gives what is to be warned of.
///
/// # Errors
/// [`MergeError`] names the shard that does not fit.
pub fn merge(
    shards: &[PathBuf],
    out: &Path,
    existing: Existing,
    stop: &AtomicBool,
) -> Result<Option<String>, MergeError> {
    let mut format = OutputFormat::of_name(out, Compression::Stored)?;
    let out = &draft::destination(out);
    if shards.iter().any(|shard| shard == out || draft::same(shard, out)) {
        return Err(MergeError::IsShard { path: out.clone() });
    }
    if out.exists() && !out.is_file() {
        return Err(MergeError::NoFile { path: out.clone() });
    }
    let pending = Ledger::is_pending(out).then(|| ledger_path(out));
    let taken = if out.exists() { Some(out.clone()) } else { pending };
    match (taken, existing) {
        (Some(path), Existing::Keep) => return Err(MergeError::Exists { path }),
        (Some(path), Existing::Resume) if path == *out => return Err(MergeError::Whole { path }),
        _ => {}
    }
    let (shards, provenance) = in_order(shards, out, stop)?;
    if let (OutputFormat::Npz(compression), Some(first)) = (&mut format, shards.first())
        && let FeatureFile::Npz(npz) = &mut FeatureFile::open(&first.path)?
    {
        *compression = layout::compression(npz)?;
    }
    let header = Header::new(&provenance, format_args!("merge of {}, {format}", shards.len()));
    let (ledger, done) = if existing == Existing::Resume {
        let same = |i: usize, done: &Merged| {
            shards.get(i).is_some_and(|shard| {
                shard.path.display().to_string() == done.shard && shard.identity == done.identity
            })
        };
        let (ledger, resumed) = Ledger::resume(out, &header, same)?;
        (ledger, resumed.records)
    } else {
        (Ledger::create(out, &header)?, Vec::new())
    };
    let mut merge = Merge { ledger, shards: &shards, provenance: &provenance, format, stop };
    match merge.write(done) {
        Ok(warning) => {
            merge.ledger.publish()?;
            Ok(warning)
        }
        Err(error @ MergeError::Run(RunError::Interrupted)) => Err(error),
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
    stop: &'a AtomicBool,
}

impl Merge<'_> {
    /// Writes what the shards hold together; the arrays of those that are `done` are there. Gives what is
    /// to be warned of.
    fn write(&mut self, done: Vec<Merged>) -> Result<Option<String>, MergeError> {
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
            go_on(self.stop)?;
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
                    go_on(self.stop)?;
                    let (entry, raw) = npz.raw(&name)?;
                    entries.push(writer.copy(&entry, raw, shard)?);
                }
            }
            piece.require_same()?;
            let identity = piece.identity.clone();
            let shard = shard.display().to_string();
            self.ledger.append(&Merged { shard, identity, entries })?;
        }
        let table = joined.unwrap_or_default();
        match writer {
            Some(mut writer) => {
                layout::write_table(&mut writer, &table, self.provenance)?;
                writer.finish()?;
            }
            None if frames => self.write_frames(part, &path, &table)?,
            None => parquet::write_over(part, &path, &table, self.provenance)?,
        }
        // Each shard has warned of its own recordings at most.
        Ok(mixed(table.outcomes()))
    }

    /// Writes the frames of all shards, grouped as those of one run.
    fn write_frames(&self, part: File, path: &Path, table: &Table) -> Result<(), MergeError> {
        let mut writer = FramesWriter::over(part, path, table, self.provenance)?;
        let features = self.provenance.features();
        for piece in self.shards {
            let mut file = ParquetFile::open(&piece.path)?;
            for row in 0..file.table()?.0.ids().len() {
                go_on(self.stop)?;
                let frames = features.iter().map(|feature| file.frames(row, feature));
                writer.push(frames.collect::<Result<_, _>>()?)?;
            }
            piece.require_same()?;
        }
        Ok(writer.finish()?)
    }
}

#[cfg(test)]
mod tests {
    use corsmal_files::outcome::{Outcome, Status};
    use corsmal_files::provenance::Part;
    use corsmal_files::shard::Shard;

    use super::*;

    /// Nobody stops the merge.
    static GO: AtomicBool = AtomicBool::new(false);

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
            merge(&shards, &whole, Existing::Overwrite, &GO).unwrap();
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
                let mut two =
                    Merge { ledger, shards: &two, provenance: &provenance, format, stop: &GO };
                two.write(Vec::new()).unwrap();
                // As a kill would leave it.
                drop(two);
                if changed {
                    let part = corsmal_files::draft::folder(&out).join("out.npz.part");
                    let mut bytes = std::fs::read(&part).unwrap();
                    bytes[200] ^= 1;
                    std::fs::write(&part, bytes).unwrap();
                }
                let refused = merge(&shards, &out, Existing::Keep, &GO).unwrap_err();
                assert!(refused.to_string().contains("out.npz.ledger exists"), "{refused}");
                merge(&shards, &out, Existing::Resume, &GO).unwrap();
                assert!(std::fs::read(&out).unwrap() == expected, "{compression:?}");
                let there = merge(&shards, &out, Existing::Resume, &GO).unwrap_err();
                assert!(there.to_string().contains("out.npz is whole: no interrupted"), "{there}");
                std::fs::remove_file(&out).unwrap();
            }
        }
    }

    /// The output was said to be damaged.
    #[test]
    fn a_damaged_shard_is_named() {
        let folder = tempfile::tempdir().unwrap();
        let path = |name: &str| folder.path().join(name);
        let shards: Vec<PathBuf> = (0..2).map(|i| path(&format!("{i}.npz"))).collect();
        for (index, file) in shards.iter().enumerate() {
            shard(file, Compression::Stored, Shard { index, count: 2 });
        }
        let mut bytes = std::fs::read(&shards[1]).unwrap();
        let one = 2f32.to_le_bytes();
        let at = bytes.windows(8).position(|w| w[..4] == one && w[4..] == one).unwrap();
        bytes[at] ^= 1;
        std::fs::write(&shards[1], bytes).unwrap();
        let refused = merge(&shards, &path("out.npz"), Existing::Overwrite, &GO).unwrap_err();
        let refused = refused.to_string();
        assert!(refused.contains("1.npz: member \"1/1") && refused.contains("CRC"), "{refused}");
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
        let mut merge =
            Merge { ledger, shards: &pieces, provenance: &provenance, format, stop: &GO };
        let refused = merge.write(Vec::new()).unwrap_err();
        assert!(refused.to_string().contains("0.npz was changed"), "{refused}");
    }

    /// The merged file took the place of shard 0, which then no merge could use.
    #[test]
    fn a_shard_is_no_output() {
        let folder = tempfile::tempdir().unwrap();
        let path = |name: &str| folder.path().join(name);
        let shards: Vec<PathBuf> = (0..2).map(|i| path(&format!("{i}.npz"))).collect();
        for (index, file) in shards.iter().enumerate() {
            shard(file, Compression::Stored, Shard { index, count: 2 });
        }
        let other_name = folder.path().join(".").join("1.npz");
        for out in [&shards[0], &other_name] {
            let error = merge(&shards, out, Existing::Overwrite, &GO).unwrap_err();
            assert!(error.to_string().contains("is one of the shards"), "{error}");
        }
        merge(&shards, &path("out.npz"), Existing::Keep, &GO).unwrap();
    }

    #[test]
    fn a_merge_that_is_stopped_goes_on_later() {
        let folder = tempfile::tempdir().unwrap();
        let path = |name: &str| folder.path().join(name);
        let shards: Vec<PathBuf> = (0..2).map(|i| path(&format!("{i}.npz"))).collect();
        for (index, file) in shards.iter().enumerate() {
            shard(file, Compression::Stored, Shard { index, count: 2 });
        }
        let (out, whole) = (path("out.npz"), path("whole.npz"));
        merge(&shards, &whole, Existing::Keep, &GO).unwrap();

        let (pieces, provenance) = in_order(&shards, &out, &GO).unwrap();
        let format = OutputFormat::Npz(Compression::Stored);
        let header = Header::new(&provenance, format_args!("merge of 2, {format}"));
        let ledger = Ledger::create(&out, &header).unwrap();
        let stop = AtomicBool::new(true);
        let mut stopped =
            Merge { ledger, shards: &pieces, provenance: &provenance, format, stop: &stop };
        let error = stopped.write(Vec::new()).unwrap_err();
        assert!(matches!(error, MergeError::Run(RunError::Interrupted)), "{error}");
        drop(stopped);
        let error = merge(&shards, &out, Existing::Resume, &stop).unwrap_err();
        assert!(matches!(error, MergeError::Run(RunError::Interrupted)), "{error}");
        assert!(Ledger::is_pending(&out));
        merge(&shards, &out, Existing::Resume, &GO).unwrap();
        assert!(std::fs::read(&out).unwrap() == std::fs::read(&whole).unwrap());
    }

    #[test]
    fn parts_of_a_partitioned_output_are_no_shards() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("part.parquet");
        let mut made = Provenance::new("{}".into(), "c".into(), "i".into(), Shard::default());
        let (label, value) = ("type".into(), "rice".into());
        made.part = Some(Part { label, value, column: 0, inputs: 2, places: vec![1] });
        let mut table = Table::new(Vec::new()).unwrap();
        table.push(Outcome::new("a", "a.wav", Status::Corrupt, ""), &[], &[]).unwrap();
        parquet::write(&file, &table, &made).unwrap();
        let out = folder.path().join("out.parquet");
        let refused = merge(&[file], &out, Existing::Keep, &GO).unwrap_err().to_string();
        assert!(refused.contains("the part type=rice of a partitioned output"), "{refused}");
        assert!(!out.exists());
    }
}
