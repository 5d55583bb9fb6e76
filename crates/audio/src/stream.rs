//! From a decoder that gives what it has to blocks of the size asked for.

use crate::error::AudioError;
use crate::report::ReadReport;
use crate::source::{AudioSpec, BlockSource};

/// Longest gap, in seconds, that is filled with silence.
#[cfg(feature = "symphonia")]
pub(crate) const LONGEST_GAP: u64 = 3600;

/// What a [`Stream`] gives next.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Next {
    /// The samples that were put into the buffer, perhaps none.
    Samples,
    /// So many frames of silence.
    Silence(u64),
    /// Nothing more.
    End,
}

/// A recording as its decoder delivers it, in order of time.
pub(crate) trait Stream: Send {
    /// Replaces the contents of `samples` by the interleaved samples that come next, or says what
    /// comes instead. Notes in `report` what it worked around.
    fn next(&mut self, samples: &mut Vec<f32>, report: &mut ReadReport)
    -> Result<Next, AudioError>;

    /// Whether the input ends where its header says, without decoding. It stays where it is.
    fn ends_as_declared(&mut self) -> Result<bool, AudioError> {
        Ok(false)
    }
}

/// Hands out the samples of a stream.
pub(crate) struct StreamSource<S> {
    /// `None` once the end or an error was met.
    stream: Option<S>,
    spec: AudioSpec,
    /// Decoded samples, interleaved; those from `start` on are not handed out yet.
    block: Vec<f32>,
    start: usize,
    /// Frames of silence that come before anything else.
    silence: u64,
    /// What was met after the samples that were handed out last.
    failed: Option<AudioError>,
    report: ReadReport,
}

impl<S: Stream> StreamSource<S> {
    /// `report` holds what opening found.
    pub(crate) fn new(stream: S, spec: AudioSpec, report: ReadReport) -> Self {
        let (block, start, silence, failed) = (Vec::new(), 0, 0, None);
        Self { stream: Some(stream), spec, block, start, silence, failed, report }
    }

    /// Gets something to hand out; false at the end.
    fn refill(&mut self) -> Result<bool, AudioError> {
        self.start = 0;
        self.block.clear();
        let Some(stream) = self.stream.as_mut() else {
            return Ok(false);
        };
        match stream.next(&mut self.block, &mut self.report) {
            Ok(Next::Samples) => Ok(true),
            Ok(Next::Silence(frames)) => {
                self.block.clear();
                self.silence = frames;
                Ok(true)
            }
            Ok(Next::End) => {
                self.block.clear();
                self.stream = None;
                Ok(false)
            }
            Err(error) => {
                self.block.clear();
                self.stream = None;
                Err(error)
            }
        }
    }

    /// Fills `out` and returns how many of its samples were filled. Samples before an error are handed
    /// out, whatever the length of `out`.
    fn fill(&mut self, out: &mut [f32]) -> Result<usize, AudioError> {
        if let Some(error) = self.failed.take() {
            return Err(error);
        }
        let channels = usize::from(self.spec.channels);
        let mut done = 0;
        while done < out.len() {
            let room = &mut out[done..];
            if self.silence > 0 {
                let frames = ((room.len() / channels) as u64).min(self.silence);
                self.silence -= frames;
                let n = frames as usize * channels;
                room[..n].fill(0.0);
                done += n;
            } else if self.start < self.block.len() {
                let n = (self.block.len() - self.start).min(room.len());
                room[..n].copy_from_slice(&self.block[self.start..self.start + n]);
                self.start += n;
                done += n;
            } else {
                match self.refill() {
                    Ok(true) => {}
                    Ok(false) => break,
                    Err(error) if done == 0 => return Err(error),
                    Err(error) => {
                        self.failed = Some(error);
                        break;
                    }
                }
            }
        }
        Ok(done)
    }
}

impl<S: Stream> BlockSource for StreamSource<S> {
    fn spec(&self) -> &AudioSpec {
        &self.spec
    }

    fn read(&mut self, out: &mut [f32]) -> Result<usize, AudioError> {
        let channels = usize::from(self.spec.channels);
        let wanted = out.len() / channels * channels;
        let frames = self.fill(&mut out[..wanted])? / channels;
        self.report.decoded_frames += frames as u64;
        Ok(frames)
    }

    fn seekable(&self) -> bool {
        false
    }

    fn seek(&mut self, _: u64) -> Result<(), AudioError> {
        Err(AudioError::NotSeekable)
    }

    fn confirmed_frames(&mut self) -> Result<Option<u64>, AudioError> {
        let Some(stream) = self.stream.as_mut() else { return Ok(None) };
        let is_so = stream.ends_as_declared()?;
        Ok(self.spec.declared_frames.filter(|_| is_so))
    }

    fn health(&self) -> &ReadReport {
        &self.report
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::source::SampleEncoding;

    /// Three samples, a gap of two, three samples, then a fault.
    struct Faulty(usize);

    impl Stream for Faulty {
        fn next(&mut self, samples: &mut Vec<f32>, _: &mut ReadReport) -> Result<Next, AudioError> {
            self.0 += 1;
            match self.0 {
                1 | 3 => samples.extend([0.1, 0.2, 0.3]),
                2 => return Ok(Next::Silence(2)),
                _ => return Err(AudioError::corrupt(7, "a fault", "none")),
            }
            Ok(Next::Samples)
        }
    }

    /// Found by fuzzing: those that shared a block with the fault were lost.
    #[test]
    fn samples_before_an_error_do_not_depend_on_the_block() {
        for block in [1, 3, 7, 8, 9, 100] {
            let spec = AudioSpec {
                sample_rate: 8000,
                channels: 1,
                format: "test".into(),
                encoding: SampleEncoding::Lossy,
                declared_frames: None,
            };
            let mut source = StreamSource::new(Faulty(0), spec, ReadReport::default());
            let (mut buffer, mut samples) = (vec![0.0; block], Vec::new());
            let error = loop {
                match source.read(&mut buffer) {
                    Ok(frames) => samples.extend_from_slice(&buffer[..frames]),
                    Err(error) => break error,
                }
                assert!(samples.len() <= 8, "blocks of {block}: no error");
            };
            assert_eq!(samples, [0.1, 0.2, 0.3, 0.0, 0.0, 0.1, 0.2, 0.3], "blocks of {block}");
            assert_eq!((error.offset(), source.health().decoded_frames), (Some(7), 8));
            assert_eq!(source.read(&mut buffer).unwrap(), 0, "the end follows");
        }
    }
}
