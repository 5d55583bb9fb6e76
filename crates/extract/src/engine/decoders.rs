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

/// Most decoders that wait, besides one for each thread: recordings whose stretches take turns. Each has its
/// file open.
const MOST: usize = 16;

/// Decoders of a run that wait.
#[derive(Default)]
pub struct Decoders {
    /// Those that have waited longest come first.
    waiting: Mutex<Vec<(Seen, Replay)>>,
}

impl Decoders {
    /// One of the recording that `watch` looks at, for the frames that `stretch` gives for its sample rate:
    /// the one that has come furthest.
    pub fn take(&self, watch: &Watch, stretch: impl Fn(u32) -> Range<u64>) -> Option<Replay> {
        let seen = watch.lasting()?;
        let mut waiting = self.waiting.lock().unwrap_or_else(PoisonError::into_inner);
        let fits = |replay: &Replay| replay.serves(&stretch(replay.spec().sample_rate));
        let usable = waiting.iter().enumerate().filter(|(_, (of, one))| of == seen && fits(one));
        let place = usable.max_by_key(|(_, (_, replay))| replay.reached())?.0;
        Some(waiting.remove(place).1)
    }

    /// Lets the reader of a stretch wait, where it can go on and a change of its file would be seen.
    pub fn put(&self, watch: &Watch, reader: Reader) {
        let (Reader::Again(replay), Some(seen)) = (reader, watch.lasting()) else { return };
        let threads = rayon::current_num_threads();
        let mut waiting = self.waiting.lock().unwrap_or_else(PoisonError::into_inner);
        waiting.push((seen.clone(), replay));
        // Those that nobody has wanted for long make room: most are of recordings that are done.
        let kept =
            |waiting: &[(Seen, Replay)]| waiting.iter().map(|(_, r)| r.kept()).sum::<usize>();
        while waiting.len() > MOST + threads || kept(&waiting) > threads * Replay::MOST {
            waiting.remove(0);
        }
    }
}
