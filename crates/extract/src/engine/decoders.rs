//! Decoders that wait for the next stretch of their recording.
//!
//! Most compressed formats can only be decoded from their start. Stretches of one recording mostly follow each
//! other, so the decoder of one goes on with the next, and the recording is decoded once for each job.

use std::ops::Range;
use std::sync::{Mutex, PoisonError};

use corsmal_audio::{BlockSource, Replay};

use super::watch::{Seen, Watch};

/// A recording that is open.
pub enum Reader {
    /// For one stretch.
    Once(Box<dyn BlockSource>),
    /// For this stretch, and those behind it.
    Again(Replay),
}

impl Reader {
    /// A source of which nothing was read; `is_stretch` says that others of its recording may follow.
    pub fn new(source: Box<dyn BlockSource>, is_stretch: bool) -> Self {
        if is_stretch && !source.seekable() {
            Self::Again(Replay::new(source))
        } else {
            Self::Once(source)
        }
    }

    /// What is read.
    pub fn source(&mut self) -> &mut dyn BlockSource {
        match self {
            Self::Once(source) => source.as_mut(),
            Self::Again(replay) => replay,
        }
    }
}

/// Decoders of a run that wait, one for each thread at most.
#[derive(Default)]
pub struct Decoders {
    waiting: Mutex<Vec<(Seen, Replay)>>,
}

impl Decoders {
    /// One of the recording that `watch` looks at, for the frames that `stretch` gives for its sample rate:
    /// the one that has come furthest. None has gone beyond the end, so that it tells of the recording
    /// what a decoder that begins would tell.
    pub fn take(&self, watch: &Watch, stretch: impl Fn(u32) -> Range<u64>) -> Option<Replay> {
        let seen = watch.lasting()?;
        let mut waiting = self.waiting.lock().unwrap_or_else(PoisonError::into_inner);
        let fits = |replay: &Replay| {
            let Range { start, end } = stretch(replay.spec().sample_rate);
            replay.oldest() <= start && replay.reached() <= end
        };
        let usable = waiting.iter().enumerate().filter(|(_, (of, one))| of == seen && fits(one));
        let place = usable.max_by_key(|(_, (_, replay))| replay.reached())?.0;
        Some(waiting.swap_remove(place).1)
    }

    /// Lets the reader of a stretch wait, where it can go on and a change of its file would be seen.
    pub fn put(&self, watch: &Watch, reader: Reader) {
        let (Reader::Again(replay), Some(seen)) = (reader, watch.lasting()) else { return };
        let mut waiting = self.waiting.lock().unwrap_or_else(PoisonError::into_inner);
        // Those of recordings that are done make room.
        if waiting.len() >= rayon::current_num_threads() {
            let place = waiting.iter().position(|(of, _)| of != seen).unwrap_or(0);
            waiting.remove(place);
        }
        waiting.push((seen.clone(), replay));
    }
}
