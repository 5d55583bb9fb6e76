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
    /// For this stretch, and those after it.
    Again(Replay),
}

impl Reader {
    /// A source of which nothing was read, and whether it may be wanted for other stretches.
    pub fn new(source: Box<dyn BlockSource>, again: bool) -> Self {
        if again && !source.seekable() {
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
        let gone = make_room(&mut waiting, MOST + threads, threads * Replay::MOST);
        drop(waiting);
        drop(gone);
    }
}

/// Those that nobody has wanted for long make room, as most are of recordings that are done: gives the ones
/// above `most`, and empties others until the rest keeps at most so many samples.
fn make_room(
    waiting: &mut Vec<(Seen, Replay)>,
    most: usize,
    samples: usize,
) -> Vec<(Seen, Replay)> {
    let many = waiting.len().saturating_sub(most);
    let gone = waiting.drain(..many).collect();
    let mut kept: usize = waiting.iter().map(|(_, replay)| replay.kept()).sum();
    for (_, replay) in waiting.iter_mut() {
        if kept <= samples {
            break;
        }
        kept -= replay.kept();
        replay.forget();
    }
    gone
}

#[cfg(test)]
mod tests {
    use std::path::Path;
    use std::time::{Duration, SystemTime};

    use super::*;
    use crate::inputs::{Input, InputSource};

    const OGG: &[u8] = include_bytes!("../../../audio/tests/audio/samples/sines-2ch.ogg");

    fn recording(path: &Path, age: u64) -> Watch {
        std::fs::write(path, OGG).unwrap();
        let file = std::fs::File::options().append(true).open(path).unwrap();
        file.set_modified(SystemTime::now() - Duration::from_secs(age)).unwrap();
        let source = InputSource::File(path.into());
        let id = String::new();
        Watch::begin(&Input { id, source, start: None, end: None, labels: Vec::new() })
    }

    fn read(path: &Path, frames: usize) -> Reader {
        let mut reader = Reader::new(corsmal_audio::open(path).unwrap(), true);
        let channels = usize::from(reader.source().spec().channels);
        assert_eq!(reader.source().read(&mut vec![0.0; frames * channels]).unwrap(), frames);
        reader
    }

    #[test]
    fn the_one_that_has_come_furthest_goes_on() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.ogg");
        let watch = recording(&path, 3600);
        let decoders = Decoders::default();
        for frames in [100, 300, 200] {
            decoders.put(&watch, read(&path, frames));
        }
        let take = |watch: &Watch, stretch: Range<u64>| {
            decoders.take(watch, |_| stretch.clone()).map(|replay| replay.reached())
        };
        assert_eq!(take(&watch, 50..250), Some(200));
        assert_eq!(take(&watch, 50..250), Some(100));
        assert_eq!(take(&watch, 50..250), None, "the one of 300 frames is beyond the end");
        let changed = recording(&path, 7200);
        assert_eq!(take(&changed, 50..400), None, "another content");
        assert_eq!(take(&watch, 50..400), Some(300));
        let fresh = recording(&path, 0);
        decoders.put(&fresh, read(&path, 100));
        assert_eq!(take(&fresh, 50..400), None, "a change could go unseen");
    }

    #[test]
    fn recordings_take_turns_and_few_wait() {
        let folder = tempfile::tempdir().unwrap();
        let decoders = Decoders::default();
        let paths: Vec<_> = (0..MOST).map(|i| folder.path().join(format!("{i}"))).collect();
        let watches: Vec<Watch> = paths.iter().map(|path| recording(path, 3600)).collect();
        for turn in 0..3u64 {
            for (path, watch) in paths.iter().zip(&watches) {
                let stretch = turn * 100..turn * 100 + 100;
                let found = decoders.take(watch, |_| stretch.clone());
                assert_eq!(found.is_some(), turn > 0);
                let mut reader = found.map_or_else(|| read(path, 1), Reader::Again);
                reader.source().go_to(stretch.start).unwrap();
                reader.source().read(&mut [0.0; 200]).unwrap();
                decoders.put(watch, reader);
            }
        }
        let mut waiting = decoders.waiting.into_inner().unwrap();
        assert_eq!(waiting.len(), MOST);
        let oldest = |waiting: &[(Seen, Replay)]| waiting[0].0.0.to_string();
        let first = oldest(&waiting);
        let gone = make_room(&mut waiting, MOST - 2, usize::MAX);
        assert_eq!((gone.len(), waiting.len(), oldest(&gone)), (2, MOST - 2, first));
        let one = waiting[0].1.kept();
        make_room(&mut waiting, MOST, (MOST - 4) * one);
        let kept = waiting.iter().map(|(_, replay)| replay.kept() > 0);
        assert_eq!(kept.collect::<Vec<_>>(), (0..MOST - 2).map(|i| i > 1).collect::<Vec<_>>());
    }
}
