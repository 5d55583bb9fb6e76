//! Standard input and pipes whose reader does not wait when it is asked to stop.

use std::fs::File;
use std::io::{self, Read};
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, sync_channel};
use std::time::Duration;

/// Bytes handed over at a time, at most.
const PART: usize = 1 << 16;
/// Parts that wait to be taken.
const AHEAD: usize = 4;
/// How often a reader that waits looks whether it should stop.
const LOOK: Duration = Duration::from_millis(50);

/// Bytes of a live stream. They are read by a thread of its own, since a read of a silent pipe
/// cannot be called off.
pub struct Live {
    parts: Receiver<io::Result<Vec<u8>>>,
    part: Vec<u8>,
    taken: usize,
    stop: Arc<AtomicBool>,
}

impl Live {
    /// A stream that ends when `bytes` does, and fails when `stop` is set.
    pub fn new(mut bytes: impl Read + Send + 'static, stop: Arc<AtomicBool>) -> Self {
        let (send, parts) = sync_channel(AHEAD);
        std::thread::spawn(move || {
            let mut part = vec![0; PART];
            loop {
                let read = match bytes.read(&mut part) {
                    Ok(0) => return,
                    Err(e) if e.kind() == io::ErrorKind::Interrupted => continue,
                    read => read.map(|n| part[..n].to_vec()),
                };
                let failed = read.is_err();
                if send.send(read).is_err() || failed {
                    return;
                }
            }
        });
        Self { parts, part: Vec::new(), taken: 0, stop }
    }
}

/// A pipe that is opened when it is read: opening it waits for whoever writes to it.
pub struct Pipe {
    /// where it is
    pub path: PathBuf,
    /// once it is
    pub opened: Option<File>,
}

impl Read for Pipe {
    fn read(&mut self, into: &mut [u8]) -> io::Result<usize> {
        let file = match self.opened.take() {
            Some(file) => file,
            None => File::open(&self.path)?,
        };
        self.opened.insert(file).read(into)
    }
}

impl Read for Live {
    fn read(&mut self, into: &mut [u8]) -> io::Result<usize> {
        while self.taken == self.part.len() {
            if self.stop.load(Ordering::Relaxed) {
                return Err(io::Error::other("interrupted"));
            }
            match self.parts.recv_timeout(LOOK) {
                Ok(part) => (self.part, self.taken) = (part?, 0),
                Err(RecvTimeoutError::Timeout) => {}
                Err(RecvTimeoutError::Disconnected) => return Ok(0),
            }
        }
        let read = (&self.part[self.taken..]).read(into)?;
        self.taken += read;
        Ok(read)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gives_the_bytes_and_fails_while_nothing_comes() {
        let stop = Arc::new(AtomicBool::new(false));
        let all: Vec<u8> = (0..300_000_u32).map(|i| (i % 251) as u8).collect();
        let mut read = Vec::new();
        Live::new(io::Cursor::new(all.clone()), stop.clone()).read_to_end(&mut read).unwrap();
        assert_eq!(read, all);

        let (silent, writer) = io::pipe().unwrap();
        let mut live = Live::new(silent, stop.clone());
        let reader = std::thread::spawn(move || live.read(&mut [0; 8]));
        stop.store(true, Ordering::Relaxed);
        assert!(reader.join().unwrap().is_err());
        drop(writer);
    }
}
