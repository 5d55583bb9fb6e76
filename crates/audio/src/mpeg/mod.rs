//! MPEG audio, layers 1 to 3: frames are found here and decoded by symphonia.
//!
//! The recording ends where the data do, whatever a header says of its length. LAME's tag says how
//! many samples to drop at both ends.

mod frames;
mod free;
mod header;
mod sync;
mod tag;

use crate::codec::{Codec, Decoded, PacketDecoder};
use crate::error::AudioError;
use crate::input::Input;
use crate::report::{ReadReport, Repair};
use crate::source::{AudioSpec, BlockSource, SampleEncoding};
use crate::stream::{Next, Stream, StreamSource};
use frames::Frames;
use free::Repacker;
use header::{Header, MAX_FRAME};
use tag::Tag;

use sync::free_size;
pub(crate) use sync::{WINDOW, find, find_free};

const EXPECTED: &str = "MPEG audio of layers 1 to 3";

/// Bytes of the shortest frame: 8 kbit/s of layer 3 at 24 kHz.
const SHORTEST: u64 = 24;
/// Bytes of a tag of ID3 version 1, at the end of a file.
const ID3V1: u64 = 128;
/// So many frames of free format may be damaged before their rate is held to be too high.
const MOST_TOO_LARGE: usize = 8;

/// Whether the bytes are those of a frame header.
pub(crate) fn is_header(bytes: &[u8]) -> bool {
    Header::parse(bytes).is_some()
}

/// One of the recordings in a file; there is more than one where files were concatenated.
struct Part {
    tag: Option<Tag>,
    /// Samples per channel still to be dropped at its start.
    skip: usize,
    /// Its frames so far, missing ones included.
    frames: u64,
}

impl Part {
    fn new(tag: Option<Tag>) -> Self {
        Self { tag, skip: tag.map_or(0, |t| t.trim.0 as usize), frames: 0 }
    }

    fn declared(&self) -> Option<u64> {
        self.tag?.frames.map(u64::from)
    }

    /// Samples per channel to drop at its end.
    fn padding(&self) -> usize {
        self.tag.map_or(0, |t| t.trim.1 as usize)
    }

    /// Whether frames are missing at its end, where samples then are no padding.
    fn is_cut(&self) -> bool {
        self.declared().is_some_and(|n| self.frames < n)
    }

    /// Samples per channel in so many frames, without delay and padding.
    fn length(&self, frames: u64, header: &Header) -> u64 {
        let trim = self.tag.map_or(0, |t| u64::from(t.trim.0) + u64::from(t.trim.1));
        frames.saturating_mul(header.samples as u64).saturating_sub(trim)
    }
}

/// One file of MPEG audio.
struct MpegStream {
    frames: Frames,
    first: Header,
    codec: Codec,
    repacker: Repacker,
    /// Frames of free format whose data found no room.
    too_large: usize,
    part: Part,
    /// Decoded samples that are dropped if the part ends with them.
    held: Vec<f32>,
    scratch: Vec<f32>,
    /// Samples per channel handed out so far.
    given: u64,
    /// Samples per channel of silence that come next.
    silence: u64,
    /// Whether any frame could be decoded.
    sounds: bool,
    ended: bool,
    /// Where its first frame is, and the bytes of the frame that holds the tag.
    begin: u64,
    tagged: u64,
}

/// Opens MPEG audio at the position of `input`, where a frame begins.
pub(crate) fn open(mut input: Input) -> Result<Box<dyn BlockSource>, AudioError> {
    let at = input.position();
    let shown = input.peek(WINDOW)?;
    let free = free_size(shown).unwrap_or(0);
    if let Some(layer @ 1..=2) = Header::parse(shown).filter(|h| h.is_free).map(|h| h.layer) {
        let actual = format!("layer {layer} in free format");
        return Err(AudioError::unsupported(at, actual, "layer 3 if the format is free"));
    }
    let mut report = ReadReport::default();
    let no_frame = || AudioError::corrupt(at, "no whole frame of MPEG audio", EXPECTED);
    let mut frames = Frames {
        input,
        free,
        first: None,
        before: None,
        missing: 0,
        is_gap: false,
        recent: Vec::new(),
        count: 0,
    };
    let mut first = frames.next(&mut report)?.ok_or_else(no_frame)?;
    let tag = Tag::parse(&frames.input.peek(first.size)?[..first.size], &first);
    let tagged = if tag.is_some() { first.size as u64 } else { 0 };
    if tag.is_some() {
        frames.input.consume(first.size);
        first = frames.next(&mut report)?.ok_or_else(no_frame)?;
    }
    frames.first = Some(first);
    let codec = Codec::mpeg(first.layer, first.channels.into(), first.sample_rate)
        .map_err(|refusal| refusal.at(at, EXPECTED))?;
    let part = Part::new(tag);
    let declared = part.declared().filter(|frames| *frames > 0);
    let spec = AudioSpec {
        sample_rate: first.sample_rate,
        channels: first.channels,
        format: format!("mp{}", first.layer),
        encoding: SampleEncoding::Lossy,
        declared_frames: declared.map(|frames| part.length(frames, &first)),
    };
    let stream = MpegStream {
        frames,
        first,
        codec,
        repacker: Repacker::default(),
        too_large: 0,
        part,
        held: Vec::new(),
        scratch: Vec::new(),
        given: 0,
        silence: 0,
        sounds: false,
        ended: false,
        begin: at,
        tagged,
    };
    Ok(Box::new(StreamSource::new(stream, spec, report)))
}

impl MpegStream {
    fn channels(&self) -> usize {
        usize::from(self.first.channels)
    }

    /// The sample per channel that comes next.
    fn position(&self) -> u64 {
        self.given + (self.held.len() / self.channels()) as u64
    }

    /// Hands out what is held but for the last `kept` samples per channel.
    fn give(&mut self, kept: usize, samples: &mut Vec<f32>) {
        let n = self.held.len().saturating_sub(kept * self.channels());
        samples.extend(self.held.drain(..n));
        self.given += (n / self.channels()) as u64;
    }

    /// Adds decoded samples to those held.
    fn hold(&mut self) {
        let skip = self.part.skip.min(self.scratch.len() / self.channels());
        self.part.skip -= skip;
        self.held.extend_from_slice(&self.scratch[skip * self.channels()..]);
    }

    /// Ends a part: drops its padding, and notes where its length is not the one declared.
    fn finish(&mut self, samples: &mut Vec<f32>, report: &mut ReadReport) {
        let padding = if self.part.is_cut() { 0 } else { self.part.padding() };
        self.give(padding, samples);
        self.held.clear();
        let Some(frames) = self.part.declared() else { return };
        let declared = self.part.length(frames, &self.first);
        if self.part.is_cut() {
            report.note_truncated(Some(declared), self.given);
        } else if frames < self.part.frames {
            let declared = if frames == 0 { 0 } else { declared };
            let actual = self.part.length(self.part.frames, &self.first);
            report.note(Repair::LongerThanDeclared { declared, actual });
        }
    }

    /// Adds the next frame to what is held, unless it is the tag of another part.
    fn decode(
        &mut self,
        header: &Header,
        samples: &mut Vec<f32>,
        report: &mut ReadReport,
    ) -> Result<(), AudioError> {
        let at = self.frames.input.position();
        if std::mem::take(&mut self.frames.is_gap) {
            // What the decoder holds of the frames before does not fit.
            self.codec.reset();
            self.repacker.reset();
        }
        let frame = &self.frames.input.peek(header.size)?[..header.size];
        if let Some(tag) = Tag::parse(frame, header) {
            self.frames.input.consume(header.size);
            self.finish(samples, report);
            report.note(Repair::Concatenated { at: self.given });
            self.codec.reset();
            self.repacker.reset();
            self.part = Part::new(Some(tag));
            return Ok(());
        }
        let decoded = match header.is_free {
            false => self.codec.decode(frame, &mut self.scratch),
            true => {
                let both = self.frames.input.peek(header.size + MAX_FRAME)?;
                let (frame, rest) = both.split_at(header.size);
                let next = Header::parse(rest).map(|next| next.sized(self.frames.free));
                let next = next.filter(|next| next.continues(header));
                let next = next.as_ref().and_then(|next| Some((next, rest.get(..next.size)?)));
                if let Some(primer) = self.repacker.primer(header, frame) {
                    // Its silence belongs to no frame.
                    self.codec.decode(primer, &mut self.scratch).ok();
                }
                match self.repacker.packet(header, frame, next) {
                    Some(packet) => self.codec.decode(packet, &mut self.scratch),
                    None => {
                        self.too_large += 1;
                        Ok(Decoded::Damaged)
                    }
                }
            }
        };
        self.frames.input.consume(header.size);
        if self.too_large > MOST_TOO_LARGE && self.too_large * 4 > self.frames.count {
            let rate = header.bit_rate / 1000;
            let actual = format!("free format of {rate} kbit/s");
            return Err(AudioError::unsupported(at, actual, "as much data as 320 kbit/s allow"));
        }
        self.frames.decoded(header.size);
        self.part.frames += 1;
        if decoded.map_err(|refusal| refusal.at(at, EXPECTED))? == Decoded::Damaged {
            self.scratch.resize(header.samples * self.channels(), 0.0);
            // Where all of it is skipped, what follows may suffer.
            let count = header.samples.saturating_sub(self.part.skip).max(1) as u64;
            report.note(Repair::LostFrames { first: self.position(), count });
        } else {
            self.sounds = true;
        }
        self.hold();
        self.give(self.part.padding(), samples);
        Ok(())
    }
}

impl Stream for MpegStream {
    fn ends_as_declared(&mut self) -> Result<bool, AudioError> {
        let said = self.part.tag.and_then(|tag| tag.bytes).map(u64::from);
        let Some((bytes, len)) = said.zip(self.frames.input.len()) else { return Ok(false) };
        if self.part.declared().is_some_and(|frames| frames > bytes / SHORTEST) {
            return Ok(false);
        }
        // Counted with the frame of the tag or without it, before an ID3 tag or without one.
        let end = self.begin + bytes;
        let ends = [end, end + self.tagged];
        Ok(ends.contains(&len) || ends.contains(&len.saturating_sub(ID3V1)))
    }

    fn next(
        &mut self,
        samples: &mut Vec<f32>,
        report: &mut ReadReport,
    ) -> Result<Next, AudioError> {
        if self.silence > 0 {
            self.given += self.silence;
            return Ok(Next::Silence(std::mem::take(&mut self.silence)));
        }
        if self.ended {
            return Ok(Next::End);
        }
        match self.frames.next(report)? {
            Some(_) if self.frames.missing > 0 => {
                let missing = std::mem::take(&mut self.frames.missing);
                self.part.frames += missing;
                self.silence = missing * self.first.samples as u64;
                self.give(0, samples);
                report.note(Repair::LostFrames { first: self.given, count: self.silence });
            }
            Some(header) => self.decode(&header, samples, report)?,
            None => {
                self.ended = true;
                self.finish(samples, report);
                if !self.sounds {
                    let at = self.frames.input.position();
                    return Err(AudioError::corrupt(at, "no decodable frame", EXPECTED));
                }
            }
        }
        Ok(Next::Samples)
    }
}
