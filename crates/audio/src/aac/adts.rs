//! AAC in frames that each have a header: ADTS (ISO 13818-7, 6.2).

use super::config::{self, Config, FRAME};
use super::sbr;
use crate::codec::{Codec, Decoded, PacketDecoder, Refusal};
use crate::error::AudioError;
use crate::input::Input;
use crate::report::{ReadReport, Repair};
use crate::source::{AudioSpec, BlockSource, SampleEncoding};
use crate::stream::{LONGEST_GAP, Next, Stream, StreamSource};
use crate::tags;

const EXPECTED: &str = "ADTS with AAC-LC of 1 or 2 channels";
/// Bytes of a header without checksum.
const HEADER: usize = 7;
/// Frames that must follow each other for the first one to be believed.
const CHAIN: usize = 3;
/// Largest frame: its length has 13 bits.
const MAX_FRAME: usize = 1 << 13;
/// Bytes that show such a chain wherever it begins in the first half of them.
pub(crate) const WINDOW: usize = 2 * (CHAIN + 1) * MAX_FRAME;

/// What a frame header says.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Header {
    /// Object type of MPEG-4.
    object: u32,
    rate_index: u32,
    layout: u32,
    /// Bytes of the header.
    head: usize,
    /// Bytes of the frame with its header.
    size: usize,
    /// Blocks of 1024 samples per channel.
    blocks: u32,
}

impl Header {
    /// ```text
    /// 12 bits of ones, 1 version, 2 layer (0), 1 no checksum, 2 object type - 1, 4 sample rate,
    /// 1 private, 3 channels, 4 others, 13 bytes of the frame, 11 fullness, 2 blocks - 1
    /// ```
    fn parse(bytes: &[u8]) -> Option<Self> {
        let &[b0, b1, b2, b3, b4, b5, b6] = bytes.first_chunk::<HEADER>()?;
        if b0 != 0xff || b1 & 0xf6 != 0xf0 {
            return None;
        }
        let head = if b1 & 1 == 1 { HEADER } else { HEADER + 2 };
        let size = usize::from(b3 & 3) << 11 | usize::from(b4) << 3 | usize::from(b5 >> 5);
        let header = Self {
            object: u32::from(b2 >> 6) + 1,
            rate_index: u32::from(b2 >> 2 & 15),
            layout: u32::from(b2 & 1) << 2 | u32::from(b3 >> 6),
            head,
            size,
            blocks: u32::from(b6 & 3) + 1,
        };
        (config::rate_of(header.rate_index) > 0 && size > head).then_some(header)
    }

    fn continues(&self, other: &Self) -> bool {
        let key = |h: &Self| (h.object, h.rate_index, h.layout);
        key(self) == key(other)
    }

    fn config(&self) -> Result<Config, Refusal> {
        if self.object != 2 {
            return Err(Refusal::Unsupported(config::name(self.object)));
        }
        Config::new(config::rate_of(self.rate_index), self.layout)
    }
}

/// Whether frames follow each other from byte `at` on: [`CHAIN`] of them, or at least `least` up to
/// the end of the file (`is_end`: the buffer holds it) or to a tag.
fn is_chain(buffer: &[u8], at: usize, is_end: bool, least: usize) -> bool {
    let Some(first) = buffer.get(at..).and_then(Header::parse) else { return false };
    let (mut at, mut count) = (at + first.size, 1);
    while count < CHAIN {
        let Some(rest) = buffer.get(at..) else { return is_end && count > least };
        if rest.len() < HEADER || tags::starts(rest) {
            return (is_end || rest.len() >= HEADER) && count >= least;
        }
        match Header::parse(rest).filter(|h| h.continues(&first)) {
            Some(header) => at += header.size,
            None => return false,
        }
        count += 1;
    }
    true
}

/// The first byte of `buffer` at which a chain of frames begins, of at least `least` frames where it
/// ends with the file.
pub(crate) fn find(buffer: &[u8], is_end: bool, least: usize) -> Option<usize> {
    let last = if is_end { buffer.len() } else { buffer.len().saturating_sub(WINDOW / 2) };
    (0..last).find(|&at| buffer[at] == 0xff && is_chain(buffer, at, is_end, least))
}

/// One file of ADTS.
struct AdtsStream {
    input: Input,
    first: Header,
    codec: Codec,
    channels: usize,
    sample_rate: u32,
    /// Frames and bytes so far, which tell how many frames fit between two.
    count: u64,
    bytes: u64,
    /// Frames of silence that come next.
    missing: u64,
    /// Samples per channel handed out so far.
    given: u64,
    /// Frames since the last one that could be decoded.
    silent: u64,
    sounds: bool,
}

/// Opens ADTS at the position of `input`, where a frame begins.
pub(crate) fn open(mut input: Input) -> Result<Box<dyn BlockSource>, AudioError> {
    let at = input.position();
    let refused = |refusal: Refusal| refusal.at(at, EXPECTED);
    let shown = input.peek(WINDOW)?;
    let shown = &shown[..shown.len().min(WINDOW)];
    let Some(first) = Header::parse(shown) else {
        return Err(AudioError::corrupt(at, "no whole frame of AAC", EXPECTED));
    };
    let config = first.config().map_err(refused)?;
    if first.blocks > 1 {
        return Err(AudioError::unsupported(at, "ADTS with several blocks in a frame", EXPECTED));
    }
    let mut rest = shown;
    let packets = std::iter::from_fn(|| {
        let header = Header::parse(rest).filter(|h| h.continues(&first))?;
        let (frame, more) = rest.split_at_checked(header.size)?;
        rest = more;
        frame.get(header.head..)
    });
    sbr::refuse(packets, &config).map_err(refused)?;
    let spec = AudioSpec {
        sample_rate: config.sample_rate,
        channels: config.channels,
        format: "adts aac".into(),
        encoding: SampleEncoding::Lossy,
        declared_frames: None,
    };
    let stream = AdtsStream {
        input,
        first,
        codec: config.codec().map_err(refused)?,
        channels: config.channels.into(),
        sample_rate: config.sample_rate,
        count: 0,
        bytes: 0,
        missing: 0,
        given: 0,
        silent: 0,
        sounds: false,
    };
    Ok(Box::new(StreamSource::new(stream, spec, ReadReport::default())))
}

impl AdtsStream {
    /// Goes to the next whole frame, which the input then shows; `None` at the end.
    fn find(&mut self, report: &mut ReadReport) -> Result<Option<Header>, AudioError> {
        let offset = self.input.position();
        let mut foreign = 0u64;
        loop {
            tags::skip(&mut self.input)?;
            let header = Header::parse(self.input.peek(HEADER)?);
            if let Some(header) = header.filter(|h| h.continues(&self.first)) {
                let shown = self.input.peek(header.size)?.len();
                if shown < header.size {
                    report.note(Repair::PartialFrame { bytes: shown as u64 });
                    return Ok(None);
                }
                // Frames have no common size: as many as fit on average.
                let average = self.bytes.checked_div(self.count).unwrap_or(0).max(1);
                self.missing = if self.count > 0 { (foreign + average / 2) / average } else { 0 };
                if foreign > 0 && self.count > 0 && self.missing == 0 {
                    report.note(Repair::ForeignBytes { offset, bytes: foreign });
                }
                return Ok(Some(header));
            }
            let shown = self.input.peek(WINDOW)?;
            let is_end = shown.len() < WINDOW;
            let step = match find(shown, is_end, 1) {
                Some(at)
                    if !Header::parse(&shown[at..]).is_some_and(|h| h.continues(&self.first)) =>
                {
                    let at = self.input.position() + at as u64;
                    let expected = "one configuration in a recording";
                    return Err(AudioError::unsupported(
                        at,
                        "a change of rate or channels",
                        expected,
                    ));
                }
                Some(at) => at,
                None if is_end => return Ok(None),
                None => shown.len() - WINDOW / 2,
            };
            self.input.consume(step);
            foreign += step as u64;
        }
    }
}

impl Stream for AdtsStream {
    fn next(
        &mut self,
        samples: &mut Vec<f32>,
        report: &mut ReadReport,
    ) -> Result<Next, AudioError> {
        let Some(header) = self.find(report)? else {
            if !self.sounds {
                let at = self.input.position();
                return Err(AudioError::corrupt(at, "no decodable frame", EXPECTED));
            }
            return Ok(Next::End);
        };
        if self.missing > 0 {
            let frames =
                (self.missing * u64::from(FRAME)).min(LONGEST_GAP * u64::from(self.sample_rate));
            self.missing = 0;
            report.note(Repair::LostFrames { first: self.given, count: frames });
            self.given += frames;
            // The frame itself follows: what the input shows has no foreign bytes before it.
            return Ok(Next::Silence(frames));
        }
        let at = self.input.position();
        let frame = &self.input.peek(header.size)?[header.head..header.size];
        let decoded = match header.blocks {
            1 => self.codec.decode(frame, samples),
            _ => Ok(Decoded::Damaged),
        };
        let decoded = decoded.map_err(|refusal| refusal.at(at, EXPECTED))?;
        self.input.consume(header.size);
        self.count += 1;
        self.bytes += header.size as u64;
        let frames = u64::from(FRAME * header.blocks);
        self.silent += frames;
        if decoded == Decoded::Frames(frames as usize) {
            (self.sounds, self.silent) = (true, 0);
        } else {
            if !self.sounds {
                // The decoder takes the channels from the first frame, and keeps them.
                let config = self.first.config();
                let codec = config.and_then(|config| config.codec());
                self.codec = codec.map_err(|refusal| refusal.at(at, EXPECTED))?;
            }
            samples.clear();
            samples.resize(frames as usize * self.channels, 0.0);
            report.note(Repair::LostFrames { first: self.given, count: frames });
        }
        if self.silent > LONGEST_GAP * u64::from(self.sample_rate) {
            return Err(AudioError::corrupt(at, "hardly any decodable frame", EXPECTED));
        }
        self.given += frames;
        Ok(Next::Samples)
    }
}
