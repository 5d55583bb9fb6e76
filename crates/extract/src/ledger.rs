//! The record of an unfinished run, beside its output.
//!
//! While a run works on `feats.npz`, two files stand beside it: `feats.npz.part`, the archive so
//! far, and `feats.npz.ledger`, JSON lines: a header that says what run this is, then one record per
//! input that is done, in the order of the inputs. A record is written after the data it speaks of,
//! so whatever the moment of a kill, the records that can be read back and whose data is intact are
//! finished work. [`Ledger::publish`] gives the output its name and removes the ledger, in this
//! order. An advisory lock on the ledger keeps two runs from writing the same output.

use std::fs::{self, File, OpenOptions, TryLockError};
use std::io::{self, BufRead, BufReader, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};
use thiserror::Error;

use corsmal_files::format::OutputFormat;
use corsmal_files::npz::{EntryRecord, intact_entries};
use corsmal_files::outcome::Outcome;
use corsmal_files::provenance::Provenance;

/// Layout of the ledger; a run continues only ledgers of its own.
pub const VERSION: u32 = 1;

/// Longest line that is read back (256 MiB): a wide summary row takes 8 characters per value.
const MAX_LINE: u64 = 1 << 28;

/// What a ledger can refuse.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum LedgerError {
    /// The operating system refused.
    #[error("{path}: {source}")]
    Io {
        /// The file or folder.
        path: PathBuf,
        /// Its reason.
        source: io::Error,
    },
    /// Another run holds the lock.
    #[error("{path}: another run is writing this output")]
    Locked {
        /// The ledger.
        path: PathBuf,
    },
    /// The ledger belongs to a different run.
    #[error(
        "{path}: the interrupted run had {field} {found}, this one has {expected}; \
         finish it with the same settings or start anew"
    )]
    Differs {
        /// The ledger.
        path: PathBuf,
        /// Which field of the header differs.
        field: &'static str,
        /// Value of the interrupted run.
        found: String,
        /// Value of this run.
        expected: String,
    },
    /// The first line is not a ledger header.
    #[error("{path}: not a ledger of this tool: {reason}; remove the file to start anew")]
    Header {
        /// The ledger.
        path: PathBuf,
        /// What is wrong.
        reason: String,
    },
}

/// First line of a ledger: which run it belongs to.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Header {
    /// [`VERSION`].
    pub ledger_version: u32,
    /// Version of the tool.
    pub tool_version: String,
    /// Hash of the effective configuration.
    pub config_hash: String,
    /// [`crate::inputs::list_hash`] of all inputs, before sharding.
    pub inputs_hash: String,
    /// The shard as `i/n`; `0/1` is the whole list.
    pub shard: String,
    /// Kind and compression of the output, as `npz stored`.
    pub format: String,
}

impl Header {
    /// The run that makes an output of this provenance in this format.
    pub fn new(provenance: &Provenance, format: OutputFormat) -> Self {
        Self {
            ledger_version: VERSION,
            tool_version: provenance.tool_version.clone(),
            config_hash: provenance.config_hash.clone(),
            inputs_hash: provenance.inputs_hash.clone(),
            shard: provenance.shard.clone(),
            format: format.to_string(),
        }
    }

    fn fields(&self) -> [(&'static str, String); 6] {
        [
            ("ledger version", self.ledger_version.to_string()),
            ("tool version", self.tool_version.clone()),
            ("configuration", self.config_hash.clone()),
            ("input list", self.inputs_hash.clone()),
            ("shard", self.shard.clone()),
            ("format", self.format.clone()),
        ]
    }

    fn check(&self, found: &Self, path: &Path) -> Result<(), LedgerError> {
        for ((field, expected), (_, found)) in self.fields().into_iter().zip(found.fields()) {
            if expected != found {
                return Err(LedgerError::Differs { path: path.into(), field, found, expected });
            }
        }
        Ok(())
    }
}

/// One input that is done.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Record {
    /// What became of it.
    pub outcome: Outcome,
    /// Its entries in the partial archive.
    pub entries: Vec<EntryRecord>,
    /// Its row of the summary table, if it has one.
    #[serde(default, with = "row")]
    pub row: Option<Vec<f32>>,
    /// Names of the columns of the table, in the first record that has a row.
    #[serde(default)]
    pub names: Option<Vec<String>>,
}

/// The open ledger of a run.
#[derive(Debug)]
pub struct Ledger {
    file: File,
    out: PathBuf,
    path: PathBuf,
}

impl Ledger {
    /// Starts a run that will write `out`; an earlier interrupted run is forgotten.
    ///
    /// # Errors
    /// [`LedgerError::Locked`] while another run writes `out`, [`LedgerError::Io`] when the ledger
    /// cannot be written there.
    pub fn create(out: &Path, header: &Header) -> Result<Self, LedgerError> {
        let mut ledger = Self::lock(out)?;
        ledger.start(header)?;
        Ok(ledger)
    }

    /// Continues an interrupted run, or starts one if there is none, and returns what is done: the
    /// records up to the first that is torn, or whose entries [`intact_entries`] does not find, or
    /// that does not `hold` any more (given its number).
    ///
    /// # Errors
    /// As [`Ledger::create`]; [`LedgerError::Differs`] when the interrupted run is another one;
    /// [`LedgerError::Header`] when the file is no ledger.
    pub fn resume(
        out: &Path,
        header: &Header,
        hold: impl Fn(usize, &Record) -> bool,
    ) -> Result<(Self, Vec<Record>), LedgerError> {
        let mut ledger = Self::lock(out)?;
        let mut lines = Lines::new(&ledger.file);
        let records = match lines.next().map_err(|e| ledger.io(e))? {
            // Torn before the header was complete: nothing was done yet.
            None => Vec::new(),
            Some(first) => {
                let found: Header = serde_json::from_slice(first).map_err(|e| {
                    LedgerError::Header { path: ledger.path.clone(), reason: e.to_string() }
                })?;
                header.check(&found, &ledger.path)?;
                let mut records = Vec::new();
                let mut ends = vec![lines.at];
                while let Some(line) = lines.next().map_err(|e| ledger.io(e))? {
                    let Ok(record) = serde_json::from_slice::<Record>(line) else { break };
                    records.push(record);
                    ends.push(lines.at);
                }
                records.truncate(intact_records(&part_path(out), &records)?);
                let changed = records.iter().enumerate().position(|(i, r)| !hold(i, r));
                records.truncate(changed.unwrap_or(records.len()));
                ledger.cut(ends[records.len()])?;
                return Ok((ledger, records));
            }
        };
        ledger.start(header)?;
        Ok((ledger, records))
    }

    /// Whether an interrupted run stands beside `out`.
    pub fn is_pending(out: &Path) -> bool {
        fs::metadata(ledger_path(out)).is_ok_and(|meta| meta.len() > 0)
    }

    /// Refuses while another run is writing `out`.
    ///
    /// # Errors
    /// [`LedgerError::Locked`], [`LedgerError::Io`].
    pub fn require_idle(out: &Path) -> Result<(), LedgerError> {
        Self::lock(out).map(drop)
    }

    /// Removes what the run of `header` has left beside the complete `out`, unless another run is at
    /// work there; what another run has left stays.
    ///
    /// # Errors
    /// [`LedgerError::Io`].
    pub fn forget(out: &Path, header: &Header) -> Result<(), LedgerError> {
        if !Self::is_pending(out) {
            return Ok(());
        }
        match Self::lock(out) {
            Ok(ledger) => {
                let mut lines = Lines::new(&ledger.file);
                let first = lines.next().map_err(|e| ledger.io(e))?;
                let found = first.and_then(|line| serde_json::from_slice::<Header>(line).ok());
                if found.is_some_and(|found| header.check(&found, &ledger.path).is_ok()) {
                    return ledger.discard();
                }
                Ok(())
            }
            Err(LedgerError::Locked { .. }) => Ok(()),
            Err(error) => Err(error),
        }
    }

    /// The partial output that this run writes.
    pub fn part(&self) -> PathBuf {
        part_path(&self.out)
    }

    /// Records that one more input is done. Its entries must have been written.
    ///
    /// # Errors
    /// [`LedgerError::Io`].
    pub fn append(&mut self, record: &Record) -> Result<(), LedgerError> {
        self.write_line(record)
    }

    /// Gives the finished partial output its name and forgets the run.
    ///
    /// # Errors
    /// [`LedgerError::Io`].
    pub fn publish(self) -> Result<(), LedgerError> {
        let io = |path: &Path| {
            let path = path.to_path_buf();
            move |source| LedgerError::Io { path, source }
        };
        fs::rename(self.part(), &self.out).map_err(io(&self.out))?;
        sync_folder(&self.out).map_err(io(&self.out))?;
        self.discard()
    }

    /// Forgets the run: removes ledger and partial output.
    ///
    /// # Errors
    /// [`LedgerError::Io`].
    pub fn discard(self) -> Result<(), LedgerError> {
        for path in [self.part(), self.path.clone()] {
            match fs::remove_file(&path) {
                Err(source) if source.kind() != io::ErrorKind::NotFound => {
                    return Err(LedgerError::Io { path, source });
                }
                _ => {}
            }
        }
        Ok(())
    }

    fn lock(out: &Path) -> Result<Self, LedgerError> {
        let path = ledger_path(out);
        loop {
            let file = OpenOptions::new()
                .read(true)
                .write(true)
                .create(true)
                .truncate(false)
                .open(&path)
                .map_err(|source| LedgerError::Io { path: path.clone(), source })?;
            match file.try_lock() {
                Ok(()) => {}
                // Some file systems of clusters know no locks; work goes on without.
                Err(TryLockError::Error(e)) if e.kind() == io::ErrorKind::Unsupported => {}
                Err(TryLockError::WouldBlock) => return Err(LedgerError::Locked { path }),
                Err(TryLockError::Error(source)) => return Err(LedgerError::Io { path, source }),
            }
            // A run that finished in between has removed the file that is locked now.
            if is_still(&file, &path) {
                return Ok(Self { file, out: out.into(), path });
            }
        }
    }

    fn start(&mut self, header: &Header) -> Result<(), LedgerError> {
        self.cut(0)?;
        self.write_line(header)
    }

    fn cut(&mut self, end: u64) -> Result<(), LedgerError> {
        let cut = self.file.set_len(end).and_then(|()| self.file.seek(SeekFrom::Start(end)));
        cut.map(drop).map_err(|e| self.io(e))
    }

    fn write_line(&mut self, value: &impl Serialize) -> Result<(), LedgerError> {
        let mut line = serde_json::to_vec(value).map_err(|e| self.io(e.into()))?;
        line.push(b'\n');
        self.file.write_all(&line).map_err(|e| self.io(e))
    }

    fn io(&self, source: io::Error) -> LedgerError {
        LedgerError::Io { path: self.path.clone(), source }
    }
}

/// `OUT.part`, the output while it is being written.
pub fn part_path(out: &Path) -> PathBuf {
    beside(out, ".part")
}

/// `OUT.ledger`.
pub fn ledger_path(out: &Path) -> PathBuf {
    beside(out, ".ledger")
}

fn beside(out: &Path, suffix: &str) -> PathBuf {
    let mut path = out.as_os_str().to_owned();
    path.push(suffix);
    path.into()
}

/// How many records, from the first on, have all their entries in the archive.
fn intact_records(part: &Path, records: &[Record]) -> Result<usize, LedgerError> {
    let entries: Vec<EntryRecord> = records.iter().flat_map(|r| r.entries.clone()).collect();
    let sound = intact_entries(part, &entries)
        .map_err(|source| LedgerError::Io { path: part.into(), source })?;
    let mut end = 0;
    Ok(records
        .iter()
        .take_while(|record| {
            end += record.entries.len();
            end <= sound
        })
        .count())
}

#[cfg(unix)]
fn is_still(file: &File, path: &Path) -> bool {
    use std::os::unix::fs::MetadataExt;
    match (file.metadata(), fs::metadata(path)) {
        (Ok(ours), Ok(there)) => (ours.dev(), ours.ino()) == (there.dev(), there.ino()),
        _ => false,
    }
}

/// Elsewhere an open file cannot be replaced under its name.
#[cfg(not(unix))]
fn is_still(_: &File, path: &Path) -> bool {
    path.exists()
}

/// Makes a rename survive a power cut.
#[cfg(unix)]
fn sync_folder(out: &Path) -> io::Result<()> {
    let folder = corsmal_files::draft::folder(out);
    File::open(folder)?.sync_all()
}

#[cfg(not(unix))]
fn sync_folder(_: &Path) -> io::Result<()> {
    Ok(())
}

/// Complete lines of a file, with the byte behind the last one returned.
struct Lines<'a> {
    reader: BufReader<&'a File>,
    line: Vec<u8>,
    at: u64,
}

impl<'a> Lines<'a> {
    fn new(file: &'a File) -> Self {
        Self { reader: BufReader::new(file), line: Vec::new(), at: 0 }
    }

    /// `None` at the end, also when the last line has no line feed or is longer than allowed.
    fn next(&mut self) -> io::Result<Option<&[u8]>> {
        self.line.clear();
        let read = io::Read::take(&mut self.reader, MAX_LINE).read_until(b'\n', &mut self.line)?;
        if self.line.last() != Some(&b'\n') {
            return Ok(None);
        }
        self.at += read as u64;
        Ok(Some(&self.line))
    }
}

/// A summary row as hexadecimal little-endian bytes: exact for every value, NaN included.
mod row {
    use serde::{Deserialize, Deserializer, Serialize, Serializer, de::Error};

    pub fn serialize<S: Serializer>(row: &Option<Vec<f32>>, to: S) -> Result<S::Ok, S::Error> {
        let hex = row.as_ref().map(|row| {
            use std::fmt::Write;
            let mut hex = String::with_capacity(row.len() * 8);
            for value in row {
                // Writing to a string cannot fail.
                let _ = write!(hex, "{:08x}", value.to_bits().swap_bytes());
            }
            hex
        });
        hex.serialize(to)
    }

    pub fn deserialize<'de, D: Deserializer<'de>>(from: D) -> Result<Option<Vec<f32>>, D::Error> {
        let Some(hex) = Option::<String>::deserialize(from)? else { return Ok(None) };
        let (groups, rest) = hex.as_bytes().as_chunks::<8>();
        let values = groups.iter().map(|group| {
            let digits = std::str::from_utf8(group).ok()?;
            // `from_str_radix` would take a sign.
            let bits = digits.bytes().all(|b| b.is_ascii_hexdigit()).then_some(digits)?;
            Some(f32::from_bits(u32::from_str_radix(bits, 16).ok()?.swap_bytes()))
        });
        match values.collect::<Option<Vec<f32>>>() {
            Some(values) if rest.is_empty() => Ok(Some(values)),
            _ => Err(D::Error::custom("a summary row is 8 hexadecimal digits per value")),
        }
    }
}
