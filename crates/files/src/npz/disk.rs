//! Brings written data to the disk while more is computed, so that the end of a run does not wait for
//! all of it.

use std::fs::File;
use std::io;
use std::thread::{self, JoinHandle};

/// Bytes written between two beginnings.
const EVERY: u64 = 16 << 20;

#[derive(Debug, Default)]
pub(super) struct DiskSync {
    unsynced: u64,
    running: Option<JoinHandle<io::Result<()>>>,
    failed: Option<io::Error>,
}

impl DiskSync {
    /// Takes note of `bytes` written to `file`.
    pub fn written(&mut self, file: &File, bytes: u64) {
        self.unsynced += bytes;
        if self.unsynced < EVERY || self.running.as_ref().is_some_and(|run| !run.is_finished()) {
            return;
        }
        self.unsynced = 0;
        self.join();
        // Without a second handle the end of the run waits longer, nothing else.
        if let Ok(file) = file.try_clone() {
            self.running = thread::Builder::new().spawn(move || file.sync_data()).ok();
        }
    }

    /// Waits, and reports a disk that failed: the system tells of that only once.
    ///
    /// # Errors
    /// What an earlier synchronisation met.
    pub fn settle(&mut self) -> io::Result<()> {
        self.join();
        self.failed.take().map_or(Ok(()), Err)
    }

    fn join(&mut self) {
        if let Some(Ok(Err(error))) = self.running.take().map(JoinHandle::join) {
            self.failed.get_or_insert(error);
        }
    }
}
