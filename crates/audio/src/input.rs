//! Bytes of a file or a pipe: a buffer with an absolute position.

use std::io::{self, Cursor, Read, Seek, SeekFrom};

use crate::error::AudioError;

/// Large enough to make system calls rare, small enough to stay in the second-level cache.
const BUFFER: usize = 128 << 10;
/// What of a pipe is held back at most: the largest block of metadata in FLAC.
const MOST_HELD: usize = 16 << 20;
/// Holds the largest frame (64 channels of 8 bytes) and whatever a header peeks at.
const MIN_BUFFER: usize = 1 << 10;

/// Where bytes come from.
pub(crate) trait Medium: Read + Send {
    /// Total bytes; `None` for a pipe, which cannot be repositioned either.
    fn byte_len(&self) -> Option<u64>;
    /// Continues at the absolute byte `offset`.
    fn jump(&mut self, offset: u64) -> io::Result<()>;
}

/// Anything that can seek, with its length.
pub(crate) struct Seekable<R> {
    inner: R,
    len: u64,
}

impl<R: Read + Seek> Seekable<R> {
    /// Measures the length and rewinds.
    pub(crate) fn new(mut inner: R) -> io::Result<Self> {
        let len = inner.seek(SeekFrom::End(0))?;
        inner.seek(SeekFrom::Start(0))?;
        Ok(Self { inner, len })
    }
}

impl<R: Read> Read for Seekable<R> {
    fn read(&mut self, out: &mut [u8]) -> io::Result<usize> {
        self.inner.read(out)
    }
}

impl<R: Read + Seek + Send> Medium for Seekable<R> {
    fn byte_len(&self) -> Option<u64> {
        Some(self.len)
    }

    fn jump(&mut self, offset: u64) -> io::Result<()> {
        self.inner.seek(SeekFrom::Start(offset)).map(|_| ())
    }
}

/// A pipe.
pub(crate) struct Stream<R>(pub(crate) R);

impl<R: Read> Read for Stream<R> {
    fn read(&mut self, out: &mut [u8]) -> io::Result<usize> {
        self.0.read(out)
    }
}

impl<R: Read + Send> Medium for Stream<R> {
    fn byte_len(&self) -> Option<u64> {
        None
    }

    fn jump(&mut self, _: u64) -> io::Result<()> {
        Err(io::ErrorKind::Unsupported.into())
    }
}

/// What a pipe still held, from the absolute byte `start` on.
struct Held {
    bytes: Cursor<Vec<u8>>,
    start: u64,
}

impl Read for Held {
    fn read(&mut self, out: &mut [u8]) -> io::Result<usize> {
        self.bytes.read(out)
    }
}

impl Medium for Held {
    fn byte_len(&self) -> Option<u64> {
        Some(self.start + self.bytes.get_ref().len() as u64)
    }

    fn jump(&mut self, offset: u64) -> io::Result<()> {
        let offset = offset.checked_sub(self.start).ok_or(io::ErrorKind::InvalidInput)?;
        self.bytes.set_position(offset);
        Ok(())
    }
}

/// Buffered bytes with the absolute position of the next one.
pub(crate) struct Input {
    medium: Box<dyn Medium>,
    buffer: Vec<u8>,
    start: usize,
    end: usize,
    position: u64,
}

impl Input {
    pub(crate) fn new(medium: Box<dyn Medium>) -> Self {
        let whole = medium.byte_len().and_then(|len| usize::try_from(len).ok());
        let size = whole.map_or(BUFFER, |len| len.clamp(MIN_BUFFER, BUFFER));
        let buffer = vec![0; size];
        Self { medium, buffer, start: 0, end: 0, position: 0 }
    }

    /// Absolute offset of the next byte.
    pub(crate) fn position(&self) -> u64 {
        self.position
    }

    /// Total bytes, where known.
    pub(crate) fn len(&self) -> Option<u64> {
        self.medium.byte_len()
    }

    /// The buffered bytes, at least `least` of them unless the end comes first. The buffer grows
    /// where `least` asks for more than it holds: the caller's constants bound it.
    pub(crate) fn peek(&mut self, least: usize) -> Result<&[u8], AudioError> {
        if self.end - self.start < least {
            self.buffer.copy_within(self.start..self.end, 0);
            self.end -= self.start;
            self.start = 0;
            if self.buffer.len() < least {
                self.buffer.resize(least, 0);
            }
            while self.end < least {
                match self.medium.read(&mut self.buffer[self.end..]) {
                    Ok(0) => break,
                    Ok(n) => self.end += n,
                    Err(e) if e.kind() == io::ErrorKind::Interrupted => {}
                    Err(source) => {
                        let offset = self.position.saturating_add(self.end as u64);
                        return Err(AudioError::Io { offset, source });
                    }
                }
            }
        }
        Ok(&self.buffer[self.start..self.end])
    }

    /// Drops `n` bytes that `peek` has shown.
    pub(crate) fn consume(&mut self, n: usize) {
        debug_assert!(n <= self.end - self.start);
        self.start += n;
        self.position += n as u64;
    }

    /// Drops `n` bytes, seen or not; false where the input ends before.
    pub(crate) fn skip(&mut self, n: u64) -> Result<bool, AudioError> {
        let buffered = (self.end - self.start) as u64;
        if n <= buffered {
            self.consume(n as usize);
            return Ok(true);
        }
        let target = self.position.saturating_add(n);
        if let Some(len) = self.len() {
            if target > len {
                return Ok(false);
            }
            self.seek(target)?;
            return Ok(true);
        }
        let mut left = n;
        while left > 0 {
            let seen = self.peek(1)?.len() as u64;
            if seen == 0 {
                return Ok(false);
            }
            let step = seen.min(left);
            self.consume(step as usize);
            left -= step;
        }
        Ok(true)
    }

    /// Drops `n` bytes that may be a wrong claim: false, with nothing dropped, where the input ends
    /// before. A pipe is asked for up to [`MOST_HELD`] of them first.
    ///
    /// # Errors
    /// A pipe that ends after more than that, and before `n`: what it had is lost.
    pub(crate) fn pass(&mut self, n: u64) -> Result<bool, AudioError> {
        if self.len().is_some() {
            return self.skip(n);
        }
        let held = n.min(MOST_HELD as u64) as usize;
        // Grows with what is there, not with what is claimed.
        let mut wanted = held.min(BUFFER);
        loop {
            let shown = self.peek(wanted)?.len();
            if shown >= held {
                break;
            }
            if shown < wanted {
                return Ok(false);
            }
            wanted = held.min(2 * wanted);
        }
        let at = self.position;
        if self.skip(n)? {
            return Ok(true);
        }
        let actual = format!("the end of the stream after {} of {n} bytes", self.position - at);
        Err(AudioError::corrupt(
            at,
            actual,
            "a tag or block as long as it says; read it from a file",
        ))
    }

    /// Keeps all that a pipe still gives, up to `most` bytes: from then on, the input is a file that
    /// begins here. False, with nothing dropped, where there is more.
    pub(crate) fn hold(&mut self, most: usize) -> Result<bool, AudioError> {
        let mut wanted = BUFFER;
        loop {
            let shown = self.peek(wanted)?.len();
            if shown > most {
                return Ok(false);
            }
            if shown < wanted {
                break;
            }
            wanted = (2 * wanted).min(most + 1);
        }
        let mut bytes = std::mem::take(&mut self.buffer);
        bytes.truncate(self.end);
        bytes.drain(..self.start);
        self.buffer = vec![0; bytes.len().clamp(MIN_BUFFER, BUFFER)];
        self.medium = Box::new(Held { bytes: Cursor::new(bytes), start: self.position });
        (self.start, self.end) = (0, 0);
        Ok(true)
    }

    /// Continues at the absolute byte `offset`.
    pub(crate) fn seek(&mut self, offset: u64) -> Result<(), AudioError> {
        self.medium.jump(offset).map_err(|source| AudioError::Io { offset, source })?;
        (self.start, self.end, self.position) = (0, 0, offset);
        Ok(())
    }
}
