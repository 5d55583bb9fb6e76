//! FLAC: frames are found and checked here and decoded by symphonia.
//!
//! A frame counts if its checksums are right. What lies between two such frames is damage, whose
//! length in time the numbers of the frames tell, or does not belong to the audio.

mod codec;
mod frame;
mod info;

use symphonia::core::checksum::Crc16Ansi;
use symphonia::core::io::Monitor;

use crate::codec::{Decoded, PacketDecoder, Refusal};
use crate::error::AudioError;
use crate::input::Input;
use crate::report::{ReadReport, Repair};
use crate::source::{AudioSpec, BlockSource, SampleEncoding};
use crate::stream::{LONGEST_GAP, Next, Stream, StreamSource};
pub(crate) use codec::FlacCodec;
use frame::{Header, Number};
use info::Info;

const EXPECTED: &str = "FLAC frames with right checksums";
/// Ends of a frame that are tried where no frame follows.
const MAX_ENDS: usize = 16;
/// Bytes that may be searched in vain for each byte of the file.
const PATIENCE: u64 = 64;
/// Parts of a file between which its frames are looked at.
const PROBES: u64 = 5;
/// Shortest frame: header of 6 bytes, a constant of 2, checksum of 2.
const MIN_FRAME: usize = 10;
/// Bytes of a frame that are looked at first; most frames fit.
const FIRST_LOOK: usize = 24 << 10;
/// Bytes searched for the next frame at a time.
const SEARCH: usize = 16 << 10;

/// One file of FLAC.
struct FlacStream {
    input: Input,
    info: Info,
    codec: FlacCodec,
    /// A frame that comes after the silence before it.
    waiting: Vec<f32>,
    /// Samples per channel so far.
    given: u64,
    part: Part,
    /// Bytes searched in vain.
    searched: u64,
}

/// One of the recordings in a file; there is more than one where files were concatenated.
#[derive(Default)]
struct Part {
    /// Samples per channel before it, of the parts before.
    begin: u64,
    /// Samples per channel of all frames but the last, where frames are counted.
    block: Option<u32>,
    /// The sample that comes next by the recording's own count; `None` before the first frame.
    next: Option<u64>,
    /// Bytes before the first frame that belong to none.
    foreign: u64,
    /// What looked like a frame and could not be read was met last.
    is_broken: bool,
    /// It may be a frame that the end of the file cuts off.
    is_cut: bool,
}

/// What the search for a frame came to.
enum Candidate {
    /// A frame, now decoded, of so many bytes.
    Frame(Header, usize),
    /// The magic number of another recording.
    Part,
    End,
}

/// Opens FLAC at the position of `input`, where its magic number is.
pub(crate) fn open(mut input: Input) -> Result<Box<dyn BlockSource>, AudioError> {
    let at = input.position();
    let info = info::read(&mut input)?;
    let spec = AudioSpec {
        sample_rate: info.sample_rate,
        channels: info.channels,
        format: "flac".into(),
        encoding: SampleEncoding::Lossless,
        declared_frames: info.declared,
    };
    let codec = FlacCodec::new(&info).map_err(|refusal| refusal.at(at, EXPECTED))?;
    let stream = FlacStream {
        input,
        info,
        codec,
        waiting: Vec::new(),
        given: 0,
        part: Part::default(),
        searched: 0,
    };
    Ok(Box::new(StreamSource::new(stream, spec, ReadReport::default())))
}

/// Whether FLAC starts here.
pub(crate) fn is_flac(bytes: &[u8]) -> bool {
    info::starts(bytes)
}

/// Samples per channel of a frame; `None` where there is none.
pub(crate) fn block_of(frame: &[u8]) -> Option<u32> {
    Header::parse(frame).map(|header| header.block)
}

/// A decoder for the stream that starts here, with its channels and its sample rate.
pub(crate) fn codec_of(start: &[u8]) -> Option<Result<(FlacCodec, u16, u32), Refusal>> {
    let info = Info::parse(start.strip_prefix(b"fLaC")?.get(4..)?)?;
    let codec = FlacCodec::new(&info);
    Some(codec.map(|codec| (codec, info.channels, info.sample_rate)))
}

impl FlacStream {
    /// Goes to the next frame and decodes it into `samples`.
    fn find(&mut self, samples: &mut Vec<f32>) -> Result<Candidate, AudioError> {
        loop {
            let shown = self.input.peek(info::SHOWN)?;
            if info::continues(shown) {
                return Ok(Candidate::Part);
            }
            if let Some(header) = Header::parse(shown).filter(|h| self.info.admits(h)) {
                if let Some(length) = self.measure(&header, samples)? {
                    self.part.is_broken = false;
                    return Ok(Candidate::Frame(header, length));
                }
                self.part.is_broken = true;
            }
            let shown = self.input.peek(SEARCH)?;
            if shown.len() <= info::SHOWN {
                return Ok(Candidate::End);
            }
            let mut places = 1..shown.len() - 1;
            let is_start = |at: usize| frame::may_start(&shown[at..]) || info::starts(&shown[at..]);
            let step = places.find(|&at| is_start(at)).unwrap_or(shown.len() - info::SHOWN);
            self.input.consume(step);
            if self.part.next.is_none() {
                self.part.foreign += step as u64;
            }
        }
    }

    /// Decodes the frame that the input shows and returns its length in bytes, or `None` if it is
    /// damaged or no frame. It ends where its checksum is right and another frame begins; before
    /// anything else, where its checksum is right and it can be decoded.
    fn measure(
        &mut self,
        header: &Header,
        samples: &mut Vec<f32>,
    ) -> Result<Option<usize>, AudioError> {
        let at = self.input.position();
        let limit = self.info.max_frame(header.block);
        let most = limit + info::SHOWN;
        let mut wanted = FIRST_LOOK.min(most);
        let mut crc = Crc16Ansi::new(0);
        let (mut checked, mut from) = (0, MIN_FRAME);
        loop {
            let shown = self.input.peek(wanted)?;
            let is_end = shown.len() < wanted;
            // A mark is judged once all of it is shown.
            let last = if is_end { shown.len() } else { shown.len() - info::SHOWN };
            let last = last.min(limit);
            while from <= last {
                let rest = &shown[from..];
                if rest.is_empty() || frame::may_start(rest) || info::starts(rest) {
                    crc.process_buf_bytes(&shown[checked..from]);
                    checked = from;
                    let follows = rest.is_empty()
                        || info::continues(rest)
                        || Header::parse(rest).is_some_and(|h| self.info.admits(&h));
                    if crc.crc() == 0 && follows {
                        let decoded = self.codec.decode(&shown[..from], samples);
                        let decoded = decoded.map_err(|refusal| refusal.at(at, EXPECTED))?;
                        let is_whole = decoded == Decoded::Frames(header.block as usize);
                        return Ok(is_whole.then_some(from));
                    }
                }
                from += 1;
            }
            if is_end || wanted == most {
                break;
            }
            wanted = (4 * wanted).min(most);
        }
        self.last_frame(header, limit, samples)
    }

    /// As `measure`, where no other frame follows.
    fn last_frame(
        &mut self,
        header: &Header,
        limit: usize,
        samples: &mut Vec<f32>,
    ) -> Result<Option<usize>, AudioError> {
        let at = self.input.position();
        let shown = self.input.peek(1)?;
        let shown = &shown[..shown.len().min(limit)];
        self.searched += 2 * shown.len() as u64;
        if self.searched > PATIENCE * (at + (1 << 20)) {
            return Err(AudioError::corrupt(at, "hardly any intact frame", EXPECTED));
        }
        let mut crc = Crc16Ansi::new(0);
        let mut tried = 0;
        for (index, &byte) in shown.iter().enumerate() {
            crc.process_byte(byte);
            let length = index + 1;
            if crc.crc() != 0 || length < MIN_FRAME {
                continue;
            }
            let decoded = self.codec.decode(&shown[..length], samples);
            let decoded = decoded.map_err(|refusal| refusal.at(at, EXPECTED))?;
            if decoded == Decoded::Frames(header.block as usize) {
                return Ok(Some(length));
            }
            tried += 1;
            if tried == MAX_ENDS {
                break;
            }
        }
        self.part.is_cut = shown.len() < limit;
        samples.clear();
        Ok(None)
    }

    /// The first sample of a frame, after which the input stands, by its own count.
    fn start(&mut self, header: &Header) -> Result<u64, AudioError> {
        let number = match header.number {
            Number::Sample(n) => return Ok(n),
            Number::Frame(n) => n,
        };
        let block = match self.part.block {
            Some(block) => block,
            // All frames but the last are equal: where none follows, only the stream information
            // says how long the others were.
            None if number > 0 && self.info.block > header.block => {
                let next = Header::parse(self.input.peek(info::SHOWN)?);
                if next.is_some_and(|next| self.info.admits(&next)) {
                    header.block
                } else {
                    self.info.block
                }
            }
            None => header.block,
        };
        self.part.block = Some(block);
        Ok(number * u64::from(block))
    }

    /// Samples per channel that are missing before a frame, after which the input stands.
    fn gap(&mut self, header: &Header, report: &mut ReadReport) -> Result<u64, AudioError> {
        let start = self.start(header)?;
        let before = self.part.next.replace(start + u64::from(header.block));
        let expected = before.unwrap_or(0);
        let gap = start.saturating_sub(expected);
        // Where the first frames are missing, bytes and all, the recording was cut.
        let block = u64::from(self.part.block.unwrap_or(header.block));
        let is_cut =
            before.is_none() && self.part.foreign < (gap / block).max(1) * MIN_FRAME as u64;
        let longest = LONGEST_GAP * u64::from(self.info.sample_rate);
        if gap > 0 && (is_cut || gap > longest) || start < expected {
            let frames = start.abs_diff(expected);
            report.note(Repair::TimeJump { at: self.given, frames });
            return Ok(0);
        }
        if gap > 0 {
            report.note(Repair::LostFrames { first: self.given, count: gap });
        }
        Ok(gap)
    }

    /// Goes on with another recording, whose magic number the input shows.
    fn next_part(&mut self, report: &mut ReadReport) -> Result<(), AudioError> {
        let at = self.input.position();
        self.finish(report)?;
        let info = info::read(&mut self.input)?;
        if (info.sample_rate, info.channels) != (self.info.sample_rate, self.info.channels) {
            let actual = format!("change to {} channels at {} Hz", info.channels, info.sample_rate);
            let expected = "one channel count and rate in a recording";
            return Err(AudioError::unsupported(at, actual, expected));
        }
        self.codec = FlacCodec::new(&info).map_err(|refusal| refusal.at(at, EXPECTED))?;
        self.info = info;
        self.part = Part { begin: self.given, ..Part::default() };
        report.note(Repair::Concatenated { at: self.given });
        Ok(())
    }

    /// Samples per channel up to the end of the last frame, if it ends the file and frames in between have
    /// growing numbers: those of joined recordings begin again. `None` for short files, too.
    fn end_by_probes(&mut self, len: u64) -> Result<Option<u64>, AudioError> {
        let (begin, info) = (self.input.position(), self.info);
        let most = info.max_frame(info.block);
        let length = len.saturating_sub(begin);
        if length / PROBES < 2 * most as u64 {
            return Ok(None);
        }
        let start = |header: &Header| match header.number {
            Number::Sample(n) => n,
            Number::Frame(n) => n * u64::from(info.block),
        };
        let mut before = None;
        for probe in 1..PROBES {
            self.input.seek(begin + length / PROBES * probe)?;
            let found = frame::first(self.input.peek(2 * most)?, |header| info.admits(header));
            let Some(found) = found.map(|header| start(&header)) else { return Ok(None) };
            if before.is_some_and(|before| found <= before) {
                return Ok(None);
            }
            before = Some(found);
        }
        self.input.seek(len - most as u64)?;
        let last = frame::last(self.input.peek(most)?).filter(|header| info.admits(header));
        let last = last.filter(|header| before.is_none_or(|before| before <= start(header)));
        Ok(last.map(|header| start(&header) + u64::from(header.block)))
    }

    /// Notes where a part has not the length declared.
    fn finish(&self, report: &mut ReadReport) -> Result<(), AudioError> {
        let begin = self.part.begin;
        let actual = self.part.next.unwrap_or(0).max(self.given - begin);
        match self.info.declared {
            _ if self.part.next.is_none() && self.part.is_broken && !self.part.is_cut => {
                let at = self.input.position();
                return Err(AudioError::corrupt(at, "no intact frame", EXPECTED));
            }
            Some(declared) if actual < declared => {
                report.note_truncated(Some(begin + declared), self.given);
            }
            Some(declared) if actual > declared => {
                report.note(Repair::LongerThanDeclared {
                    declared: begin + declared,
                    actual: begin + actual,
                });
            }
            None if self.part.is_broken => report.note_truncated(None, self.given),
            _ => {}
        }
        Ok(())
    }
}

impl Stream for FlacStream {
    fn next(
        &mut self,
        samples: &mut Vec<f32>,
        report: &mut ReadReport,
    ) -> Result<Next, AudioError> {
        if !self.waiting.is_empty() {
            std::mem::swap(samples, &mut self.waiting);
            self.waiting.clear();
            return Ok(Next::Samples);
        }
        match self.find(samples)? {
            Candidate::Frame(header, length) => {
                self.input.consume(length);
                let gap = self.gap(&header, report)?;
                self.given += gap + u64::from(header.block);
                if gap > 0 {
                    std::mem::swap(samples, &mut self.waiting);
                    return Ok(Next::Silence(gap));
                }
            }
            Candidate::Part => self.next_part(report)?,
            Candidate::End => {
                self.finish(report)?;
                return Ok(Next::End);
            }
        }
        Ok(Next::Samples)
    }

    fn ends_as_declared(&mut self) -> Result<bool, AudioError> {
        let Some((len, declared)) = self.input.len().zip(self.info.declared) else {
            return Ok(false);
        };
        let back = self.input.position();
        let end = self.end_by_probes(len)?;
        self.input.seek(back)?;
        Ok(end == Some(declared))
    }
}
