//! The interface of every reader.

use serde::Serialize;

use crate::error::AudioError;
use crate::report::ReadReport;

/// How the samples of a recording are stored.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum SampleEncoding {
    /// Unsigned integers of 8 bits.
    Unsigned8,
    /// Signed integers.
    Signed {
        /// Bytes per sample, 1 to 8.
        bytes: u8,
    },
    /// IEEE floating point.
    Float {
        /// Bytes per sample, 4 or 8.
        bytes: u8,
    },
    /// ITU-T G.711 A-law.
    ALaw,
    /// ITU-T G.711 µ-law.
    MuLaw,
    /// Differences of 4 bits.
    Adpcm,
    /// Compressed without loss, to integers.
    Lossless,
    /// Compressed with loss.
    Lossy,
}

impl SampleEncoding {
    /// Whether NaN and infinities can come out of the reader.
    pub fn may_be_non_finite(self) -> bool {
        matches!(self, Self::Float { .. } | Self::Lossy)
    }
}

/// What a recording is, known before its samples are read.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct AudioSpec {
    /// Frames per second, 1 to 768 000 Hz.
    pub sample_rate: u32,
    /// Channels, 1 to 64.
    pub channels: u16,
    /// Container and encoding, such as `wav pcm_s16le` or `ogg vorbis`.
    pub format: String,
    /// How the samples are stored.
    pub encoding: SampleEncoding,
    /// Frames according to the header (after repair of a wrapped size), where it says so.
    pub declared_frames: Option<u64>,
}

/// Samples read at a time where they are only passed, all channels together.
const PASSED: usize = 1 << 16;

/// Samples of one recording, block by block.
pub trait BlockSource: Send {
    /// Format, rate, channels.
    fn spec(&self) -> &AudioSpec;

    /// Fills `out` with up to `out.len() / channels` frames of interleaved samples and returns how
    /// many frames; 0 means the end (or an `out` shorter than one frame). Integer samples are
    /// scaled to [-1, 1) as libsndfile does (16 bits: divided by 32768); float samples come
    /// unchanged, NaN and infinities included.
    ///
    /// # Errors
    /// Reading failed or the data are undecodable; later calls return the end.
    fn read(&mut self, out: &mut [f32]) -> Result<usize, AudioError>;

    /// Whether [`BlockSource::seek`] can be used.
    fn seekable(&self) -> bool;

    /// Continues at `frame`, counted from the start; beyond the end, `read` then returns 0.
    ///
    /// # Errors
    /// The source cannot seek, or the system refuses.
    fn seek(&mut self, frame: u64) -> Result<(), AudioError>;

    /// Continues at `frame`, as [`seek`](Self::seek) or by reading what lies before it.
    ///
    /// # Errors
    /// Reading or seeking failed; the frame was passed in a source that cannot seek.
    fn go_to(&mut self, frame: u64) -> Result<(), AudioError> {
        let read = self.health().decoded_frames;
        if self.seekable() {
            // Nothing that was fetched with the header is fetched again.
            return if frame == 0 && read == 0 { Ok(()) } else { self.seek(frame) };
        }
        let mut left = frame.checked_sub(read).ok_or(AudioError::NotSeekable)?;
        let channels = usize::from(self.spec().channels);
        let most = left.min((PASSED / channels) as u64);
        let mut block = vec![0.0; most as usize * channels];
        while left > 0 {
            let wanted = left.min(most) as usize * channels;
            match self.read(&mut block[..wanted])? {
                0 => break,
                frames => left -= frames as u64,
            }
        }
        Ok(())
    }

    /// Frames that are there at most, as far as known without reading them: what the header says,
    /// and where the format allows it no more than the file has bytes for.
    fn most_frames(&self) -> Option<u64> {
        self.spec().declared_frames
    }

    /// Frames of the recording, where the end of the file bears out what its header says; `None` where
    /// only decoding tells. Nothing is decoded, and the place stays.
    ///
    /// # Errors
    /// Reading or seeking failed.
    fn confirmed_frames(&mut self) -> Result<Option<u64>, AudioError> {
        Ok(self.most_frames().filter(|_| self.seekable()))
    }

    /// The byte of the file at which `frame` begins, where frames lie side by side in it.
    fn byte_of(&self, _frame: u64) -> Option<u64> {
        None
    }

    /// Repairs, truncation and frames read so far; complete once `read` has returned 0.
    fn health(&self) -> &ReadReport;
}
