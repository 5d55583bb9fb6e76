//! Standard input and pipes whose reader does not wait when it is asked to stop.

use std::fs::File;
use std::io::{self, Read};
use std::path::{Path, PathBuf};
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
    /// the pipe that the bytes come from, where it has a name
    pipe: Option<PathBuf>,
}

impl Live {
    /// The stream of a pipe or device.
    pub fn of_pipe(path: PathBuf, stop: Arc<AtomicBool>) -> Self {
        let bytes = Pipe { path: path.clone(), opened: None, stop: stop.clone() };
        Self { pipe: Some(path), ..Self::new(bytes, stop) }
    }

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
        Self { parts, part: Vec::new(), taken: 0, stop, pipe: None }
    }
}

fn interrupted() -> io::Error {
    io::Error::other("interrupted")
}

/// A pipe that is opened when it is read: opening it waits for whoever writes to it.
struct Pipe {
    path: PathBuf,
    opened: Option<File>,
    stop: Arc<AtomicBool>,
}

impl Read for Pipe {
    fn read(&mut self, into: &mut [u8]) -> io::Result<usize> {
        let file = match self.opened.take() {
            Some(file) => file,
            None => File::open(&self.path)?,
        };
        // What comes from now on is for another run, and this is no end of the recording.
        if self.stop.load(Ordering::Relaxed) {
            return Err(interrupted());
        }
        self.opened.insert(file).read(into)
    }
}

/// Ends the wait of whoever opens a named pipe, by being a writer for a moment: a thread left waiting would take
/// the first bytes of the next run.
#[cfg(unix)]
fn end_wait(pipe: &Path) {
    use std::os::unix::fs::FileTypeExt;
    if std::fs::metadata(pipe).is_ok_and(|meta| meta.file_type().is_fifo()) {
        // For both, since opening it for writing alone would wait for a reader.
        let _ = File::options().read(true).write(true).open(pipe);
    }
}

#[cfg(not(unix))]
fn end_wait(_: &Path) {}

impl Read for Live {
    fn read(&mut self, into: &mut [u8]) -> io::Result<usize> {
        while self.taken == self.part.len() {
            if self.stop.load(Ordering::Relaxed) {
                if let Some(pipe) = self.pipe.take() {
                    end_wait(&pipe);
                }
                return Err(interrupted());
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

    /// The thread that opens it was left waiting, and took what the next run was sent.
    #[cfg(unix)]
    #[test]
    fn nobody_waits_for_a_pipe_after_the_stop() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("pipe");
        assert!(std::process::Command::new("mkfifo").arg(&path).status().unwrap().success());
        let stop = Arc::new(AtomicBool::new(false));
        let mut first = Live::of_pipe(path.clone(), stop.clone());
        std::thread::sleep(2 * LOOK);
        stop.store(true, Ordering::Relaxed);
        assert!(first.read(&mut [0; 8]).is_err());
        // Time for the thread to end.
        std::thread::sleep(2 * LOOK);
        let all = vec![7; 100_000];
        let writer = std::thread::spawn({
            let (path, all) = (path.clone(), all.clone());
            move || std::fs::write(path, all)
        });
        let mut read = Vec::new();
        Live::of_pipe(path, Arc::default()).read_to_end(&mut read).unwrap();
        writer.join().unwrap().unwrap();
        assert_eq!(read, all);
    }

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
