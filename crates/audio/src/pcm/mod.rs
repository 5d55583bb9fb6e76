//! Samples that stand side by side, and the containers that hold them: WAV in its dialects, Wave64,
//! AIFF, AU, CAF. Policy: `docs/reading.md`.

mod adpcm;
mod aiff;
mod au;
mod caf;
mod companding;
mod convert;
mod extent;
mod format;
mod header;
mod wav;
mod wave64;

use crate::error::AudioError;
use crate::input::Input;
use crate::report::{ReadReport, Repair};
use crate::source::{AudioSpec, BlockSource};
use crate::stream::StreamSource;
use format::{Encoding, Endian};
use header::Header;

#[cfg(feature = "symphonia")]
pub(crate) use format::{MAX_CHANNELS, MAX_SAMPLE_RATE};

/// A container.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Container {
    Wav,
    Wave64,
    Aiff,
    Au,
    Caf,
}

impl Container {
    /// The one that starts with these (up to 16) bytes.
    pub(crate) fn of(start: &[u8]) -> Option<Self> {
        Some(match start {
            _ if wav::is_wav(start) => Self::Wav,
            _ if wave64::is_wave64(start) => Self::Wave64,
            _ if aiff::is_aiff(start) => Self::Aiff,
            _ if au::is_au(start) => Self::Au,
            _ if caf::is_caf(start) => Self::Caf,
            _ => return None,
        })
    }
}

/// Opens what the container at the position of `input` holds.
pub(crate) fn open(
    mut input: Input,
    container: Container,
) -> Result<Box<dyn BlockSource>, AudioError> {
    let header = match container {
        Container::Wav => wav::read(&mut input)?,
        Container::Wave64 => wave64::read(&mut input)?,
        Container::Aiff => aiff::read(&mut input)?,
        Container::Au => au::read(&mut input)?,
        Container::Caf => caf::read(&mut input)?,
    };
    let format = header.format;
    let declared_frames = header.extent.declared.map(|bytes| format.frames_in(bytes));
    let spec = AudioSpec {
        sample_rate: format.sample_rate,
        channels: format.channels,
        format: format!(
            "{} {}",
            header.container,
            format.encoding.name(header.endian == Endian::Big)
        ),
        encoding: format.encoding.samples(),
        declared_frames,
    };
    let truncated = header.repairs.iter().any(|r| matches!(r, Repair::Truncated { .. }));
    let report = ReadReport { truncated, repairs: header.repairs.clone(), ..ReadReport::default() };
    if let Encoding::Adpcm(adpcm) = format.encoding {
        let left = header.extent.len;
        let more: adpcm::More = |input, size| wav::more_data(input, size, Endian::Little);
        let behind = (header.extent.declared, more);
        let blocks =
            adpcm::Blocks::new(input, adpcm, format.channels, left, behind, declared_frames);
        return Ok(Box::new(StreamSource::new(blocks, spec, report)));
    }
    Ok(Box::new(PcmSource::new(input, &header, spec, report)))
}

/// Streams samples that stand side by side.
struct PcmSource {
    input: Input,
    spec: AudioSpec,
    encoding: Encoding,
    endian: Endian,
    frame_bytes: usize,
    data_start: u64,
    /// Bytes of samples; `None`: to the end of a pipe.
    data_len: Option<u64>,
    declared_len: Option<u64>,
    is_wav: bool,
    /// Bytes of samples handed out or passed by seeking.
    done: u64,
    ended: bool,
    report: ReadReport,
}

impl PcmSource {
    fn new(input: Input, header: &Header, spec: AudioSpec, report: ReadReport) -> Self {
        Self {
            input,
            spec,
            encoding: header.format.encoding,
            endian: header.endian,
            frame_bytes: header.format.unit_bytes() as usize,
            data_start: header.extent.start,
            data_len: header.extent.len,
            declared_len: header.extent.declared,
            is_wav: matches!(header.container, "wav" | "rifx" | "rf64" | "bw64"),
            done: 0,
            ended: false,
            report,
        }
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
            self.report.note_truncated(declared, actual);
        }
        if rest > 0 {
            self.report.note(Repair::PartialFrame { bytes: rest });
        }
        // A pipe may stay open after its samples.
        let Some(size) = self.declared_len.filter(|_| self.seekable()) else {
            return;
        };
        let more = self.input.skip(rest).and_then(|_| match self.done + rest == size {
            true if self.is_wav => wav::more_data(&mut self.input, size, self.endian),
            true => another(&mut self.input),
            false => Ok(None),
        });
        if let Ok(Some(offset)) = more {
            self.report.note(Repair::MoreData { offset });
        }
    }
}

/// The byte at which another recording begins, after no more than padding.
fn another(input: &mut Input) -> Result<Option<u64>, AudioError> {
    const PADDING: usize = 8;
    let at = input.position();
    let shown = input.peek(PADDING + 16)?;
    let zeros = shown.iter().take(PADDING).take_while(|b| **b == 0).count();
    let begins = (0..=zeros).find(|&n| Container::of(&shown[n..]).is_some());
    Ok(begins.map(|n| at + n as u64))
}

impl BlockSource for PcmSource {
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
