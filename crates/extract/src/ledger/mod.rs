//! The record of an unfinished run, beside its output.
//!
//! While a run works on `feats.npz`, two files stand beside it: `feats.npz.part`, the archive so
//! far, and `feats.npz.ledger`: a header that says what run this is, then one record per input that
//! is done, in the order of the inputs. Each line carries a check sum over all lines up to it, and a
//! record the check sums of the bytes of the archive that it speaks of. A record is written after
//! its data, so whatever the moment of a kill, the records that hold are finished work; what does
//! not hold is not, and is done again. [`Ledger::publish`] gives the output its name and removes the
//! ledger, in this order.
//!
//! A run holds both files open and locked, so that no other run writes the same output; and it
//! publishes nothing once one of the two is no longer the file that it holds.

mod error;
mod header;
mod lines;
mod look;
mod record;

use std::fs::{self, File, OpenOptions, TryLockError};
use std::io::{self, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};
use std::thread;
use std::time::Duration;

use corsmal_files::draft;
use corsmal_files::npz::{EntryRecord, intact_entries};
use serde::Serialize;

use lines::{Chain, Lines, Next};

pub use error::LedgerError;
pub use header::{Header, VERSION};
pub use look::look;
pub use record::{Done, Record};

/// What an interrupted run has left.
#[derive(Debug)]
pub struct Resumed<R> {
    /// Finished work, from the first record on.
    pub records: Vec<R>,
    /// Why what follows is done again, where more was recorded.
    pub dropped: Option<String>,
}

/// The open ledger of a run.
#[derive(Debug)]
pub struct Ledger {
    file: File,
    part: File,
    out: PathBuf,
    path: PathBuf,
    chain: Chain,
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
    /// records up to the first that does not hold, or whose bytes are not in the archive, or that
    /// `keep` gives up (given its number).
    ///
    /// # Errors
    /// As [`Ledger::create`]; [`LedgerError::Differs`] when the interrupted run is another one;
    /// [`LedgerError::Header`] when the file is not a ledger.
    pub fn resume<R: Done>(
        out: &Path,
        header: &Header,
        keep: impl Fn(usize, &R) -> bool,
    ) -> Result<(Self, Resumed<R>), LedgerError> {
        let mut ledger = Self::lock(out)?;
        let mut lines = Lines::new(&ledger.file);
        let mut dropped = None;
        let mut records: Vec<R> = Vec::new();
        if !ledger.same_run(&mut lines, header)? {
            // Torn before the header was complete: nothing was done yet.
            ledger.start(header)?;
            return Ok((ledger, Resumed { records, dropped }));
        }
        let mut ends = vec![(lines.end, lines.chain)];
        let place =
            |records: &[R]| format!("{}, line {}", ledger.path.display(), records.len() + 2);
        loop {
            let record = match lines.next().map_err(|e| ledger.io(e))? {
                Next::End => break,
                Next::Line(text) => serde_json::from_slice::<R>(text).ok(),
                Next::Wrong(_) => None,
            };
            let Some(record) = record else {
                dropped = Some(format!("{}: its checksum does not match", place(&records)));
                break;
            };
            records.push(record);
            ends.push((lines.end, lines.chain));
        }
        let intact = ledger.intact_records(&records)?;
        if intact < records.len() {
            records.truncate(intact);
            let part = part_path(&ledger.out);
            let what = format!("{} does not match it", part.display());
            dropped = Some(format!("{}: {what}", place(&records)));
        }
        let given_up = records.iter().enumerate().position(|(i, r)| !keep(i, r));
        records.truncate(given_up.unwrap_or(records.len()));
        let (end, chain) = ends[records.len()];
        ledger.cut(end)?;
        ledger.chain = chain;
        Ok((ledger, Resumed { records, dropped }))
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
        locked(&ledger_path(out)).map(drop)
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
            Ok(ledger) => match ledger.same_run(&mut Lines::new(&ledger.file), header) {
                Ok(true) => ledger.discard(),
                Err(error @ LedgerError::Io { .. }) => Err(error),
                _ => ledger.leave(),
            },
            Err(LedgerError::Locked { .. }) => Ok(()),
            Err(error) => Err(error),
        }
    }

    /// The partial output that this run writes.
    ///
    /// # Errors
    /// [`LedgerError::Io`]: no more files can be opened.
    pub fn part(&self) -> Result<(File, PathBuf), LedgerError> {
        let path = part_path(&self.out);
        match self.part.try_clone() {
            Ok(file) => Ok((file, path)),
            Err(source) => Err(LedgerError::Io { path, source }),
        }
    }

    /// The output that this run writes.
    pub fn out(&self) -> &Path {
        &self.out
    }

    /// Records that one more thing is done. Its entries must have been written.
    ///
    /// # Errors
    /// [`LedgerError::Io`]; [`LedgerError::Lost`].
    pub fn append<R: Done>(&mut self, record: &R) -> Result<(), LedgerError> {
        self.require_ours()?;
        self.write_line(record)
    }

    /// Gives the finished partial output its name and forgets the run.
    ///
    /// # Errors
    /// [`LedgerError::Io`]; [`LedgerError::Lost`].
    pub fn publish(self) -> Result<(), LedgerError> {
        self.require_ours()?;
        let io = |path: &Path| {
            let path = path.to_path_buf();
            move |source| LedgerError::Io { path, source }
        };
        fs::rename(part_path(&self.out), &self.out).map_err(io(&self.out))?;
        sync_folder(&self.out).map_err(io(&self.out))?;
        remove(&self.path)
    }

    /// As [`Ledger::publish`], where the output was made of the partial one: `publish` gives it its name,
    /// then the partial output is removed.
    ///
    /// # Errors
    /// As [`Ledger::publish`].
    pub fn publish_made(self, publish: impl FnOnce() -> io::Result<()>) -> Result<(), LedgerError> {
        self.require_ours()?;
        let io = |source| LedgerError::Io { path: self.out.clone(), source };
        publish().map_err(io)?;
        sync_folder(&self.out).map_err(io)?;
        self.discard()
    }

    /// Forgets the run: removes ledger and partial output, if they are still its own.
    ///
    /// # Errors
    /// [`LedgerError::Io`].
    pub fn discard(self) -> Result<(), LedgerError> {
        let part = part_path(&self.out);
        for (file, path) in [(&self.part, &part), (&self.file, &self.path)] {
            if is_still(file, path) {
                remove(path)?;
            }
        }
        Ok(())
    }

    /// Lets go of another run's ledger, without an empty partial output that locking has made.
    fn leave(self) -> Result<(), LedgerError> {
        let part = part_path(&self.out);
        let empty = self.part.metadata().is_ok_and(|meta| meta.len() == 0);
        if empty && is_still(&self.part, &part) { remove(&part) } else { Ok(()) }
    }

    fn lock(out: &Path) -> Result<Self, LedgerError> {
        let path = ledger_path(out);
        let file = locked(&path)?;
        let part = locked(&part_path(out)).inspect_err(|_| {
            // Nothing has begun: no empty ledger stays behind.
            if file.metadata().is_ok_and(|meta| meta.len() == 0) && is_still(&file, &path) {
                let _ = remove(&path);
            }
        })?;
        Ok(Self { file, part, out: out.into(), path, chain: Chain::default() })
    }

    /// Whether the ledger has a header, which must be that of this run.
    fn same_run(&self, lines: &mut Lines<'_>, header: &Header) -> Result<bool, LedgerError> {
        let path = || self.path.clone();
        let (text, whole) = match lines.next().map_err(|e| self.io(e))? {
            Next::End => return Ok(false),
            Next::Line(text) => (text, true),
            Next::Wrong(text) => (text, false),
        };
        let found = serde_json::from_slice::<Header>(text);
        match found {
            // Ledgers of version 1 had no check sums: their header says that they are of another.
            Ok(found) if whole || found.ledger_version != VERSION => {
                header.check(&found, &self.path).map(|()| true)
            }
            Err(e) if whole => Err(LedgerError::Header { path: path(), reason: e.to_string() }),
            _ => {
                let reason = "the checksum of its first line does not match".into();
                Err(LedgerError::Header { path: path(), reason })
            }
        }
    }

    /// How many records, from the first on, have all their entries in the archive.
    fn intact_records<R: Done>(&self, records: &[R]) -> Result<usize, LedgerError> {
        let entries: Vec<EntryRecord> =
            records.iter().flat_map(|record| record.entries().to_vec()).collect();
        let intact = intact_entries(&self.part, &entries)
            .map_err(|source| LedgerError::Io { path: part_path(&self.out), source })?;
        let mut end = 0;
        let whole = |record: &&R| {
            end += record.entries().len();
            end <= intact
        };
        Ok(records.iter().take_while(whole).count())
    }

    /// Refuses to go on where the names belong to other files by now.
    fn require_ours(&self) -> Result<(), LedgerError> {
        let part = part_path(&self.out);
        for (file, path) in [(&self.file, &self.path), (&self.part, &part)] {
            if !is_still(file, path) {
                return Err(LedgerError::Lost { path: path.clone() });
            }
        }
        Ok(())
    }

    fn start(&mut self, header: &Header) -> Result<(), LedgerError> {
        self.cut(0)?;
        self.chain = Chain::default();
        self.write_line(header)
    }

    fn cut(&mut self, end: u64) -> Result<(), LedgerError> {
        let cut = self.file.set_len(end).and_then(|()| self.file.seek(SeekFrom::Start(end)));
        cut.map(drop).map_err(|e| self.io(e))
    }

    fn write_line(&mut self, value: &impl Serialize) -> Result<(), LedgerError> {
        let text = serde_json::to_vec(value).map_err(|e| self.io(e.into()))?;
        let line = self.chain.line(&text);
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

/// Opens a file, which is made where there is none, and locks it.
fn locked(path: &Path) -> Result<File, LedgerError> {
    // A process that is being started holds the locks of its parent for a moment.
    const PATIENCE: u32 = 20;
    let io = |source| LedgerError::Io { path: path.into(), source };
    let mut tries = 0;
    loop {
        let mut options = OpenOptions::new();
        let file = options.read(true).write(true).create(true).truncate(false).open(path);
        let file = file.map_err(io)?;
        match file.try_lock() {
            Ok(()) => {}
            // Some file systems of clusters know no locks; work goes on without.
            Err(TryLockError::Error(e)) if e.kind() == io::ErrorKind::Unsupported => {}
            Err(TryLockError::WouldBlock) if tries < PATIENCE => {
                tries += 1;
                thread::sleep(Duration::from_millis(10));
                continue;
            }
            Err(TryLockError::WouldBlock) => return Err(LedgerError::Locked { path: path.into() }),
            Err(TryLockError::Error(source)) => return Err(io(source)),
        }
        // A run that finished in between has removed or renamed the file that is locked now.
        if is_still(&file, path) {
            return Ok(file);
        }
    }
}

fn remove(path: &Path) -> Result<(), LedgerError> {
    match fs::remove_file(path) {
        Err(source) if source.kind() != io::ErrorKind::NotFound => {
            Err(LedgerError::Io { path: path.into(), source })
        }
        _ => Ok(()),
    }
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
    File::open(draft::folder(out))?.sync_all()
}

#[cfg(not(unix))]
fn sync_folder(_: &Path) -> io::Result<()> {
    Ok(())
}
