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
    report: ReadReport,
}

impl<S: Stream> StreamSource<S> {
    /// `report` holds what opening found.
    pub(crate) fn new(stream: S, spec: AudioSpec, report: ReadReport) -> Self {
        Self { stream: Some(stream), spec, block: Vec::new(), start: 0, silence: 0, report }
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

    /// Fills `out` and returns how many of its samples were filled.
    fn fill(&mut self, out: &mut [f32]) -> Result<usize, AudioError> {
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
            } else if !self.refill()? {
                break;
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

    fn health(&self) -> &ReadReport {
        &self.report
    }
}
