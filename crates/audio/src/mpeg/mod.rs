//! MPEG audio, layers 1 to 3: frames are found here and decoded by symphonia.
//!
//! The recording ends where the data do, whatever a header says of its length. LAME's tag says how
//! many samples to drop at both ends.

mod free;
mod header;
mod sync;
mod tag;

use crate::codec::{Codec, Decoded, PacketDecoder};
use crate::error::AudioError;
use crate::input::Input;
use crate::report::{ReadReport, Repair};
use crate::source::{AudioSpec, BlockSource, SampleEncoding};
use crate::stream::{LONGEST_GAP, Next, Stream, StreamSource};
use crate::tags;
use free::Repacker;
use header::{HEADER, Header, MAX_FRAME};
use tag::Tag;

pub(crate) use sync::{WINDOW, find, free_size};

const EXPECTED: &str = "MPEG audio of layers 1 to 3";

/// Frames whose mean size tells how many are missing: rates of MP3 vary slowly.
const RECENT: usize = 8;

/// Whether the bytes are those of a frame header.
pub(crate) fn is_header(bytes: &[u8]) -> bool {
    Header::parse(bytes).is_some()
}

/// Frames as they follow each other.
struct Frames {
    input: Input,
    /// Bytes of a frame of free format without padding; 0 in other recordings.
    free: usize,
    /// The header of the first frame with audio.
    first: Option<Header>,
    /// The frame that ends where the input stands.
    before: Option<Header>,
    /// Frames that went missing before the one found last.
    missing: u64,
    /// What stands before the one found last may have been frames.
    is_gap: bool,
    /// Bytes of the frames decoded last, in no order.
    recent: Vec<usize>,
    /// Frames decoded.
    count: usize,
}

impl Frames {
    /// Goes to the next whole frame, which the input then shows; `None` at the end.
    fn next(&mut self, report: &mut ReadReport) -> Result<Option<Header>, AudioError> {
        tags::skip(&mut self.input)?;
        let offset = self.input.position();
        let (first, free) = (self.first, self.free);
        let parse = |bytes: &[u8]| Header::parse(bytes).map(|header| header.sized(free));
        let continues = |h: &Header| h.size > HEADER && first.is_none_or(|f| h.continues(&f));
        let mut header = parse(self.input.peek(HEADER)?).filter(continues);
        let mut foreign = Foreign::default();
        while header.is_none() {
            let position = self.input.position();
            let shown = self.input.peek(WINDOW)?;
            let shown = &shown[..shown.len().min(WINDOW)];
            let is_end = shown.len() < WINDOW;
            // Behind other bytes a single header may be chance.
            let next = sync::find_where(shown, is_end, 1, free, continues);
            let other = sync::find_where(shown, is_end, sync::CHAIN, free, |h| !continues(h));
            if let Some(at) = other.filter(|at| next.is_none_or(|next| *at < next)) {
                return Err(changed(position + at as u64, &shown[at..]));
            }
            if next.is_none() && is_end {
                return Ok(None);
            }
            let step = next.unwrap_or(WINDOW / 2);
            header = next.and_then(|at| parse(&shown[at..]));
            foreign.add(&shown[..step]);
            self.input.consume(step);
        }
        let Some(header) = header else { return Ok(None) };
        let shown = self.input.peek(header.size)?;
        if shown.len() < header.size {
            let bytes = shown.len() as u64;
            report.note(Repair::PartialFrame { bytes });
            return Ok(None);
        }
        // Another recording may begin behind other bytes, which then took no time.
        let is_tag = foreign.bytes > 0 && Tag::parse(&shown[..header.size], &header).is_some();
        self.missing = if is_tag { 0 } else { self.missing_in(&foreign, &header) };
        if foreign.bytes > 0 && first.is_some() {
            // So many bytes may have been frames.
            let is_large = foreign.bytes >= header.size as u64;
            self.is_gap = !is_tag && (self.missing > 0 || is_large);
            if self.missing == 0 {
                report.note(Repair::ForeignBytes { offset, bytes: foreign.bytes });
                report.truncated |= self.is_gap;
            }
        }
        self.before = Some(header);
        Ok(Some(header))
    }

    /// Remembers the size of a frame that was decoded.
    fn decoded(&mut self, size: usize) {
        match self.recent.get_mut(self.count % RECENT) {
            Some(oldest) => *oldest = size,
            None => self.recent.push(size),
        }
        self.count += 1;
    }

    /// How many frames the `foreign` bytes before a frame were: damaged headers hide frames, one of
    /// any bit rate, or several of a constant one; and where a medium lost its bytes, most of these
    /// are alike. Other bytes were put between the frames.
    fn missing_in(&self, foreign: &Foreign, header: &Header) -> u64 {
        let Some(before) = self.before.filter(|_| foreign.bytes > 0) else { return 0 };
        let bytes = foreign.bytes;
        // Nothing near an overflow is filled in.
        let longest = LONGEST_GAP * u64::from(header.sample_rate) / header.samples as u64;
        if bytes > longest * MAX_FRAME as u64 {
            return 0;
        }
        // Some encoders never pad.
        let plain = before.plain_size().max(1) as u64;
        // With padding, a frame is so many bytes on average, times 8 times the sample rate.
        let scale = 8 * u64::from(before.sample_rate);
        let average = before.samples as u64 * u64::from(before.bit_rate);
        let constant = (bytes * scale + average / 2) / average;
        let rest = (bytes * scale).abs_diff(constant * average);
        let frames = if header.sizes().any(|size| size as u64 == bytes) {
            1
        } else if before.bit_rate == header.bit_rate && bytes.is_multiple_of(plain) {
            bytes / plain
        } else if before.bit_rate == header.bit_rate && rest <= scale {
            constant
        } else if foreign.is_blank() {
            let sum = self.recent.iter().sum::<usize>() as u64;
            (bytes * self.recent.len() as u64 + sum / 2).checked_div(sum).unwrap_or(0)
        } else {
            0
        };
        if frames <= longest { frames } else { 0 }
    }
}

/// Bytes before a frame that belong to none.
#[derive(Default)]
struct Foreign {
    bytes: u64,
    /// The first of them, and how many from there on are the same.
    value: u8,
    alike: u64,
}

impl Foreign {
    fn add(&mut self, bytes: &[u8]) {
        if let (0, Some(&value)) = (self.bytes, bytes.first()) {
            self.value = value;
        }
        if self.alike == self.bytes {
            self.alike += bytes.iter().take_while(|b| **b == self.value).count() as u64;
        }
        self.bytes += bytes.len() as u64;
    }

    /// Whether a medium lost them: most are alike, up to the rest of the last frame.
    fn is_blank(&self) -> bool {
        2 * self.alike >= self.bytes
    }
}

fn changed(offset: u64, frame: &[u8]) -> AudioError {
    let actual = Header::parse(frame).map_or_else(String::new, |h| {
        format!("change to layer {}, {} channels at {} Hz", h.layer, h.channels, h.sample_rate)
    });
    AudioError::unsupported(offset, actual, "one layer, channel count and rate in a recording")
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
}

/// Opens MPEG audio at the position of `input`, where a frame begins.
pub(crate) fn open(mut input: Input) -> Result<Box<dyn BlockSource>, AudioError> {
    let at = input.position();
    let shown = input.peek(WINDOW)?;
    let free = free_size(shown).unwrap_or(0);
    if let Some(layer @ 1..=2) = Header::parse(shown).filter(|h| h.is_free).map(|h| h.layer) {
        let actual = format!("layer {layer} in free format");
        return Err(AudioError::unsupported(at, actual, "layer 3 where the format is free"));
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
        part,
        held: Vec::new(),
        scratch: Vec::new(),
        given: 0,
        silence: 0,
        sounds: false,
        ended: false,
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
                    None => Ok(Decoded::Damaged),
                }
            }
        };
        self.frames.input.consume(header.size);
        self.frames.decoded(header.size);
        self.part.frames += 1;
        if decoded.map_err(|refusal| refusal.at(at, EXPECTED))? == Decoded::Damaged {
            self.scratch.resize(header.samples * self.channels(), 0.0);
            let count = header.samples as u64;
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
