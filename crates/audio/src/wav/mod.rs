//! WAV in its dialects: RIFF, RIFX, RF64, BW64. Policy: `docs/wav-policy.md`.

mod companding;
mod convert;
mod encoding;
mod header;

use crate::error::AudioError;
use crate::input::Input;
use crate::report::{ReadReport, Repair};
use crate::source::{AudioSpec, BlockSource};
use encoding::{Encoding, Endian};
use header::Header;

#[cfg(feature = "symphonia")]
pub(crate) use encoding::{MAX_CHANNELS, MAX_SAMPLE_RATE};
pub(crate) use header::is_wav;

/// Streams the samples of one WAV.
pub(crate) struct WavSource {
    input: Input,
    spec: AudioSpec,
    encoding: Encoding,
    endian: Endian,
    frame_bytes: usize,
    data_start: u64,
    /// Bytes of samples; `None`: to the end of a pipe.
    data_len: Option<u64>,
    declared_len: Option<u64>,
    /// Bytes of samples handed out or passed by seeking.
    done: u64,
    ended: bool,
    report: ReadReport,
}

impl WavSource {
    /// Reads the header from the start of `input`.
    pub(crate) fn new(mut input: Input) -> Result<Self, AudioError> {
        let header = Header::read(&mut input)?;
        let format = header.format;
        let frame_bytes = format.frame_bytes() as usize;
        let container = match &header.form {
            b"RF64" => "rf64",
            b"BW64" => "bw64",
            b"RIFX" => "rifx",
            _ => "wav",
        };
        let big = header.endian == Endian::Big;
        let spec = AudioSpec {
            sample_rate: format.sample_rate,
            channels: format.channels,
            format: format!("{container} {}", format.encoding.name(big)),
            encoding: format.encoding.samples(),
            declared_frames: header.declared_len.map(|n| n / frame_bytes as u64),
        };
        let truncated = header.repairs.iter().any(|r| matches!(r, Repair::Truncated { .. }));
        let report = ReadReport { decoded_frames: 0, truncated, repairs: header.repairs };
        Ok(Self {
            input,
            spec,
            encoding: format.encoding,
            endian: header.endian,
            frame_bytes,
            data_start: header.data_start,
            data_len: header.data_len,
            declared_len: header.declared_len,
            done: 0,
            ended: false,
            report,
        })
    }

    /// Bytes of samples not yet handed out, as far as known.
    fn remaining(&self) -> u64 {
        self.data_len.map_or(u64::MAX, |len| len.saturating_sub(self.done))
    }

    /// Notes why no whole frame is left; `rest` bytes of one are.
    fn end(&mut self, rest: u64) {
        self.ended = true;
        if let Some(declared) = self.declared_len
            && self.done + rest < declared
            && !self.report.truncated
        {
            let frame = self.frame_bytes as u64;
            let (declared, actual) = (Some(declared / frame), self.done / frame);
            self.note(Repair::Truncated { declared, actual });
            self.report.truncated = true;
        }
        if rest > 0 {
            self.note(Repair::PartialFrame { bytes: rest });
        }
    }

    fn note(&mut self, repair: Repair) {
        if !self.report.repairs.contains(&repair) {
            self.report.repairs.push(repair);
        }
    }
}

impl BlockSource for WavSource {
    fn spec(&self) -> &AudioSpec {
        &self.spec
    }

    fn read(&mut self, out: &mut [f32]) -> Result<usize, AudioError> {
        let channels = usize::from(self.spec.channels);
        let wanted = out.len() / channels;
        let mut frames = 0;
        while frames < wanted && !self.ended {
            let remaining = self.remaining();
            let least = self.frame_bytes.min(usize::try_from(remaining).unwrap_or(usize::MAX));
            let bytes = match self.input.peek(least) {
                Ok(bytes) => bytes,
                Err(error) => {
                    self.ended = true;
                    return Err(error);
                }
            };
            let usable = (bytes.len() as u64).min(remaining) as usize;
            let n = (usable / self.frame_bytes).min(wanted - frames);
            if n == 0 {
                self.end(usable as u64);
                break;
            }
            let used = n * self.frame_bytes;
            let block = &mut out[frames * channels..(frames + n) * channels];
            convert::convert(self.encoding, self.endian, &bytes[..used], block);
            self.input.consume(used);
            self.done += used as u64;
            frames += n;
        }
        self.report.decoded_frames += frames as u64;
        Ok(frames)
    }

    fn seekable(&self) -> bool {
        self.input.len().is_some()
    }

    fn seek(&mut self, frame: u64) -> Result<(), AudioError> {
        if !self.seekable() {
            return Err(AudioError::NotSeekable);
        }
        let whole = self.data_len.unwrap_or(0) / self.frame_bytes as u64;
        let target = frame.min(whole) * self.frame_bytes as u64;
        self.input.seek(self.data_start + target)?;
        self.done = target;
        self.ended = false;
        Ok(())
    }

    fn most_frames(&self) -> Option<u64> {
        self.data_len.map(|len| len / self.frame_bytes as u64)
    }

    fn byte_of(&self, frame: u64) -> Option<u64> {
        frame.checked_mul(self.frame_bytes as u64)?.checked_add(self.data_start)
    }

    fn health(&self) -> &ReadReport {
        &self.report
    }
}
