//! Reads an object as if it were a file.

use std::collections::VecDeque;
use std::io::{self, Read, Seek, SeekFrom};
use std::ops::Range;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::time::Duration;

use bytes::Bytes;
use object_store::path::Path;
use object_store::{GetOptions, GetRange, ObjectStore, ObjectStoreExt};

use crate::connect;
use crate::error::StoreError;
use crate::object::{Object, Pin, Version};
use crate::runtime::{self, Coming};

/// Bytes of a block (4 MiB). A reader holds two and fetches a third.
pub const BLOCK: u64 = 4 << 20;
/// Bytes of a block where only the header is looked at.
const HEADER: u64 = 64 << 10;
/// Blocks held: the one that is read, and the one before.
const HELD: usize = 2;
/// Tries for a block, after the client's own.
const TRIES: u32 = 5;
/// Time before the second try; each further one waits twice as long.
const PAUSE: Duration = Duration::from_millis(200);

/// What an object is opened for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Purpose {
    /// A look at its header: short blocks, nothing ahead.
    Header,
    /// A part of it, after its header: the first block is short.
    Part,
    /// To be read to its end.
    Content,
}

/// The bytes of an object, or of a stretch of one such as a member of a tar.
pub struct ObjectReader {
    object: Source,
    /// The stretch.
    stretch: Range<u64>,
    purpose: Purpose,
    stop: Arc<AtomicBool>,
    held: VecDeque<(u64, Bytes)>,
    /// The block that comes next, by its number.
    coming: Option<(u64, Coming<Result<Bytes, StoreError>>)>,
    /// From the start of the stretch.
    position: u64,
}

/// Where blocks come from.
#[derive(Clone)]
struct Source {
    store: Arc<dyn ObjectStore>,
    path: Path,
    pin: Pin,
    pause: Duration,
}

impl ObjectReader {
    /// Opens an object: fetches its first block. With `stretch`, only so many bytes from an offset are
    /// there. All bytes are of the version that `pin` keeps. Waiting ends when `stop` is set.
    ///
    /// # Errors
    /// [`StoreError`] as an [`io::Error`].
    pub fn open(
        object: &Object,
        stretch: Option<(u64, u64)>,
        purpose: Purpose,
        (pin, stop): (&Pin, &Arc<AtomicBool>),
    ) -> io::Result<Self> {
        let (store, path) = (connect::store(&object.uri)?, object.uri.path()?);
        let source = Source { store, path, pin: pin.clone(), pause: PAUSE };
        Self::of(source, stretch, purpose, stop)
    }

    fn of(
        object: Source,
        stretch: Option<(u64, u64)>,
        purpose: Purpose,
        stop: &Arc<AtomicBool>,
    ) -> io::Result<Self> {
        let (start, size) = stretch.unwrap_or((0, u64::MAX));
        let stretch = start..start.saturating_add(size);
        let (held, stop) = (VecDeque::new(), stop.clone());
        let mut reader = Self { object, stretch, purpose, stop, held, coming: None, position: 0 };
        if reader.stretch.is_empty() {
            return Ok(reader);
        }
        match reader.fetch(0) {
            Ok(()) => {}
            // A range of an object without bytes is none.
            Err(StoreError::Beyond) => reader.look()?,
            Err(error) => return Err(error.into()),
        }
        let whole = reader.object.pin.version().map_or(0, |version| version.size);
        reader.stretch.end = reader.stretch.end.min(whole).max(start);
        Ok(reader)
    }

    fn look(&self) -> Result<(), StoreError> {
        let Source { store, path, .. } = self.object.clone();
        let head = runtime::spawn(async move { store.head(&path).await });
        let meta = runtime::wait(&head, &self.stop)?;
        self.object.pin.meet(Version::of(&meta?))
    }

    fn size(&self) -> u64 {
        self.stretch.end - self.stretch.start
    }

    /// Bytes of the first block, and of the others.
    fn blocks(&self) -> (u64, u64) {
        match self.purpose {
            Purpose::Header => (HEADER, HEADER),
            Purpose::Part => (HEADER, BLOCK),
            Purpose::Content => (BLOCK, BLOCK),
        }
    }

    /// The number of the block that a position lies in, and where it begins.
    fn number(&self, position: u64) -> (u64, u64) {
        let (first, block) = self.blocks();
        match position.checked_sub(first) {
            None => (0, 0),
            Some(behind) => (1 + behind / block, first + behind / block * block),
        }
    }

    /// The bytes of a block in the object.
    fn range(&self, number: u64) -> Range<u64> {
        let (first, block) = self.blocks();
        let (begin, length) = match number.checked_sub(1) {
            None => (0, first),
            Some(before) => (first.saturating_add(before.saturating_mul(block)), block),
        };
        let start = self.stretch.start.saturating_add(begin);
        start..start.saturating_add(length).min(self.stretch.end.max(start))
    }

    fn start(&mut self, number: u64) {
        let (object, range) = (self.object.clone(), self.range(number));
        self.coming = Some((number, runtime::spawn(async move { object.get(range).await })));
    }

    /// Makes sure that a block is held.
    fn fetch(&mut self, number: u64) -> Result<(), StoreError> {
        if self.coming.as_ref().is_none_or(|(coming, _)| *coming != number) {
            self.start(number);
        }
        let Some((_, coming)) = self.coming.take() else { return Ok(()) };
        let bytes = runtime::wait(&coming, &self.stop)??;
        if self.held.len() == HELD {
            self.held.pop_front();
        }
        self.held.push_back((number, bytes));
        Ok(())
    }

    /// What is left from the position on of the block that it lies in.
    fn rest(&mut self) -> Result<Bytes, StoreError> {
        let (number, begin) = self.number(self.position);
        let held = |reader: &Self| {
            reader.held.iter().find(|(held, _)| *held == number).map(|(_, bytes)| bytes.clone())
        };
        let bytes = match held(self) {
            Some(bytes) => bytes,
            None => {
                self.fetch(number)?;
                held(self).unwrap_or_default()
            }
        };
        let within = usize::try_from(self.position - begin).unwrap_or(usize::MAX);
        // Whoever has read so much of a block will read the next one.
        if self.purpose != Purpose::Header && within >= bytes.len() / 4 {
            self.go_ahead(number + 1);
        }
        Ok(bytes.slice(within.min(bytes.len())..))
    }

    /// Starts to fetch a block, unless it is there or not wanted.
    fn go_ahead(&mut self, number: u64) {
        let is_held = self.held.iter().any(|(held, _)| *held == number);
        let is_coming = self.coming.as_ref().is_some_and(|(coming, _)| *coming == number);
        if !is_held && !is_coming && !self.range(number).is_empty() {
            self.start(number);
        }
    }
}

impl Read for ObjectReader {
    fn read(&mut self, out: &mut [u8]) -> io::Result<usize> {
        if self.position >= self.size() || out.is_empty() {
            return Ok(0);
        }
        let there = self.rest()?;
        let read = there.len().min(out.len());
        out[..read].copy_from_slice(&there[..read]);
        self.position += read as u64;
        Ok(read)
    }
}

impl Seek for ObjectReader {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        let position = match to {
            SeekFrom::Start(at) => Some(at),
            SeekFrom::End(by) => self.size().checked_add_signed(by),
            SeekFrom::Current(by) => self.position.checked_add_signed(by),
        };
        self.position = position.ok_or(io::ErrorKind::InvalidInput)?;
        Ok(self.position)
    }
}

impl Source {
    /// The bytes of a range, those before the end of the object. The whole read is tried again where
    /// any part of it fails.
    async fn get(self, range: Range<u64>) -> Result<Bytes, StoreError> {
        let mut tries = 0;
        loop {
            let error = match self.once(range.clone()).await {
                Ok(bytes) => return Ok(bytes),
                Err(error) => error,
            };
            tries += 1;
            if tries == TRIES || !error.is_worth_another_try() {
                self.pin.note(&error);
                return Err(error);
            }
            tokio::time::sleep(self.pause * 2_u32.pow(tries - 1)).await;
        }
    }

    async fn once(&self, range: Range<u64>) -> Result<Bytes, StoreError> {
        let if_match = self.pin.version().and_then(|version| version.strong_etag());
        let range = Some(GetRange::Bounded(range));
        let options = GetOptions { range, if_match, ..GetOptions::default() };
        let answer = self.store.get_opts(&self.path, options).await?;
        self.pin.meet(Version::of(&answer.meta))?;
        let expected = answer.range.end - answer.range.start;
        let bytes = answer.bytes().await?;
        if bytes.len() as u64 != expected {
            let reason = format!("{} of {expected} bytes arrived", bytes.len());
            return Err(StoreError::Failed(reason));
        }
        Ok(bytes)
    }
}

#[cfg(test)]
mod tests;
