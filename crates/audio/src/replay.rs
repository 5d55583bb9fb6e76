//! Goes back a little in a recording whose format cannot seek.

use std::ops::Range;

use crate::error::AudioError;
use crate::report::ReadReport;
use crate::source::{AudioSpec, BlockSource};

/// Keeps the last samples of a source, so that stretches that overlap are decoded once.
pub struct Replay {
    source: Box<dyn BlockSource>,
    /// Interleaved; after them the source goes on.
    kept: Vec<f32>,
    /// The frame that is read next.
    position: u64,
    /// Whether the source was asked for more than it has.
    ended: bool,
    /// What was met after the frames that were given last.
    failed: Option<AudioError>,
}

impl Replay {
    /// Most samples kept (16 MiB).
    pub const MOST: usize = 1 << 22;

    /// Reads `source`, of which nothing was read.
    pub fn new(source: Box<dyn BlockSource>) -> Self {
        Self { source, kept: Vec::new(), position: 0, ended: false, failed: None }
    }

    /// The first frame that was never read.
    pub fn reached(&self) -> u64 {
        self.source.health().decoded_frames
    }

    /// Whether a stretch can be read as by a reader that begins: it can be gone to, and
    /// [`health`](BlockSource::health) will know what reading this far tells, and no more.
    pub fn serves(&self, stretch: &Range<u64>) -> bool {
        let known = if self.ended { self.reached() + 1 } else { self.reached() };
        self.failed.is_none() && self.oldest() <= stretch.start && known <= stretch.end
    }

    /// The first frame to which it can go back.
    fn oldest(&self) -> u64 {
        self.reached() - (self.kept.len() / self.channels()) as u64
    }

    /// Room that is taken by what is kept, in samples.
    pub fn kept(&self) -> usize {
        self.kept.capacity()
    }

    /// Keeps nothing of what was read: only stretches after it are served.
    pub fn forget(&mut self) {
        self.kept = Vec::new();
        self.position = self.reached();
    }

    fn channels(&self) -> usize {
        usize::from(self.source.spec().channels)
    }

    fn keep(&mut self, samples: &[f32]) {
        let channels = self.channels();
        let room = Self::MOST / channels * channels;
        if self.kept.len() + samples.len() > room {
            // Half of them at once, so that the rest is seldom moved.
            let excess = (self.kept.len() + samples.len()).saturating_sub(room / 2);
            self.kept.drain(..excess.div_ceil(channels).min(self.kept.len() / channels) * channels);
        }
        let samples = &samples[samples.len().saturating_sub(room)..];
        let needed = self.kept.len() + samples.len();
        if needed > self.kept.capacity() {
            self.kept.reserve_exact((2 * needed).min(room) - self.kept.len());
        }
        self.kept.extend_from_slice(samples);
    }
}

impl BlockSource for Replay {
    fn spec(&self) -> &AudioSpec {
        self.source.spec()
    }

    fn read(&mut self, out: &mut [f32]) -> Result<usize, AudioError> {
        if let Some(error) = self.failed.take() {
            return Err(error);
        }
        let channels = self.channels();
        let whole = out.len() / channels * channels;
        let out = &mut out[..whole];
        let again = (self.reached() - self.position) as usize * channels;
        let (old, new) = out.split_at_mut(again.min(out.len()));
        let begin = self.kept.len() - again;
        old.copy_from_slice(&self.kept[begin..begin + old.len()]);
        // Blocks are as long as those of a reader that begins.
        let read = if new.is_empty() { Ok(0) } else { self.source.read(new) };
        let frames = match read {
            Ok(frames) => {
                self.ended |= frames < new.len() / channels;
                self.keep(&new[..frames * channels]);
                frames
            }
            Err(error) if old.is_empty() => return Err(error),
            Err(error) => {
                self.failed = Some(error);
                0
            }
        };
        let frames = old.len() / channels + frames;
        self.position += frames as u64;
        Ok(frames)
    }

    fn seekable(&self) -> bool {
        false
    }

    fn seek(&mut self, _: u64) -> Result<(), AudioError> {
        Err(AudioError::NotSeekable)
    }

    /// Goes back to a frame that is kept, or on; what lies before it is forgotten.
    fn go_to(&mut self, frame: u64) -> Result<(), AudioError> {
        let oldest = self.oldest();
        if frame < oldest {
            return Err(AudioError::NotSeekable);
        }
        self.position = frame.min(self.reached());
        self.kept.drain(..(self.position - oldest) as usize * self.channels());
        if frame > self.position {
            let gone = self.source.go_to(frame);
            self.position = self.reached();
            self.ended |= self.position < frame;
            gone?;
        }
        Ok(())
    }

    fn most_frames(&self) -> Option<u64> {
        self.source.most_frames()
    }

    fn byte_of(&self, frame: u64) -> Option<u64> {
        self.source.byte_of(frame)
    }

    fn health(&self) -> &ReadReport {
        self.source.health()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::source::SampleEncoding;
    use crate::stream::{Next, Stream, StreamSource};

    /// Two channels that count frames, in packets of 5.
    struct Counting(u64);

    impl Stream for Counting {
        fn next(&mut self, samples: &mut Vec<f32>, _: &mut ReadReport) -> Result<Next, AudioError> {
            let end = (self.0 + 5).min(LENGTH);
            samples.extend((self.0..end).flat_map(|frame| [frame as f32, -(frame as f32)]));
            self.0 = end;
            Ok(if samples.is_empty() { Next::End } else { Next::Samples })
        }
    }

    const LENGTH: u64 = 3_000_000;

    fn replay() -> Replay {
        let spec = AudioSpec {
            sample_rate: 8000,
            channels: 2,
            format: "test".into(),
            encoding: SampleEncoding::Lossy,
            declared_frames: None,
        };
        Replay::new(Box::new(StreamSource::new(Counting(0), spec, ReadReport::default())))
    }

    /// Reads frames `from..from + frames` in blocks and checks them; how many there were.
    fn read(replay: &mut Replay, from: u64, frames: u64, block: usize) -> u64 {
        let (mut buffer, mut read) = (vec![0.0; 2 * block], 0);
        while read < frames {
            let wanted = (frames - read).min(block as u64) as usize;
            // A sample that makes no frame is left alone.
            let n = replay.read(&mut buffer[..(2 * wanted + 1).min(2 * block)]).unwrap();
            for (i, pair) in (from + read..).zip(buffer[..2 * n].chunks(2)) {
                assert_eq!(pair, [i as f32, -(i as f32)]);
            }
            read += n as u64;
            if n == 0 {
                break;
            }
        }
        read
    }

    #[test]
    fn stretches_that_overlap_are_decoded_once() {
        let mut replay = replay();
        for begin in (0..1000).step_by(30) {
            replay.go_to(begin).unwrap();
            assert_eq!(read(&mut replay, begin, 100, 7), 100);
            assert_eq!((replay.oldest(), replay.reached()), (begin, begin + 100));
            assert!(replay.serves(&(begin + 7..begin + 100)));
            assert!(!replay.serves(&(begin..begin + 99)));
            assert!(begin == 0 || !replay.serves(&(begin - 1..begin + 200)));
        }
        // Further than what was read, then back within the stretch only.
        replay.go_to(5000).unwrap();
        assert_eq!(read(&mut replay, 5000, 10, 100), 10);
        replay.go_to(5000).unwrap();
        assert_eq!(read(&mut replay, 5000, 20, 3), 20);
        assert!(matches!(replay.go_to(4999), Err(AudioError::NotSeekable)));
    }

    /// How many samples of a block are not finite is told, so blocks count.
    #[test]
    fn blocks_are_full_across_the_border_of_what_is_kept() {
        let mut replay = replay();
        let mut block = vec![0.0; 2 * 64];
        assert_eq!(replay.read(&mut block).unwrap(), 64);
        replay.go_to(50).unwrap();
        assert_eq!(replay.read(&mut block).unwrap(), 64);
        assert_eq!((block[0], block[126]), (50.0, 113.0));
        assert_eq!((replay.reached(), replay.oldest()), (114, 50));
        replay.forget();
        assert_eq!((replay.kept(), replay.oldest()), (0, 114));
        replay.go_to(120).unwrap();
        assert_eq!(read(&mut replay, 120, 9, 4), 9);
    }

    #[test]
    fn the_end_comes_again() {
        let mut replay = replay();
        for begin in [LENGTH - 50, LENGTH - 20, LENGTH - 1] {
            replay.go_to(begin).unwrap();
            assert_eq!(read(&mut replay, begin, 100, 16), LENGTH - begin);
        }
        replay.go_to(LENGTH + 7).unwrap();
        assert_eq!(read(&mut replay, LENGTH, 1, 1), 0);
        assert_eq!(replay.reached(), LENGTH);
        // Another reader would not know yet that this is the end.
        assert!(!replay.serves(&(LENGTH..LENGTH)) && replay.serves(&(LENGTH..LENGTH + 1)));
    }

    /// Five frames, then a fault.
    struct Faulty(bool);

    impl Stream for Faulty {
        fn next(&mut self, samples: &mut Vec<f32>, _: &mut ReadReport) -> Result<Next, AudioError> {
            if std::mem::replace(&mut self.0, true) {
                return Err(AudioError::corrupt(7, "a fault", "none"));
            }
            samples.extend([0.0; 10]);
            Ok(Next::Samples)
        }
    }

    #[test]
    fn frames_before_a_fault_are_given_first() {
        let spec = replay().spec().clone();
        let source = StreamSource::new(Faulty(false), spec, ReadReport::default());
        let mut replay = Replay::new(Box::new(source));
        let mut block = [0.0; 12];
        assert_eq!(replay.read(&mut block[..10]).unwrap(), 5);
        replay.go_to(2).unwrap();
        assert_eq!(replay.read(&mut block).unwrap(), 3);
        assert!(!replay.serves(&(2..9)), "the fault is not told yet");
        assert_eq!(replay.read(&mut block).unwrap_err().offset(), Some(7));
        assert_eq!(replay.read(&mut block).unwrap(), 0);
    }

    #[test]
    fn what_is_kept_is_bounded() {
        let mut replay = replay();
        // A length that does not divide the room.
        assert_eq!(read(&mut replay, 0, LENGTH, 30_105), LENGTH);
        assert!(replay.kept() <= Replay::MOST && replay.kept.len() >= Replay::MOST / 4);
        let oldest = replay.oldest();
        assert!(replay.go_to(oldest - 1).is_err());
        replay.go_to(oldest).unwrap();
        assert_eq!(read(&mut replay, oldest, LENGTH, 1 << 15), LENGTH - oldest);
        // One read of more than is kept.
        let mut replay = self::replay();
        let mut all = vec![0.0; 2 * LENGTH as usize];
        assert_eq!(replay.read(&mut all).unwrap() as u64, LENGTH);
        assert_eq!(replay.kept.len(), Replay::MOST);
        assert_eq!(replay.kept[Replay::MOST - 1], -((LENGTH - 1) as f32));
    }
}
