//! MP4, M4A and QuickTime: packets are found here and decoded by symphonia (AAC-LC, ALAC).
//!
//! The edit list says which of the samples are the recording: what an encoder put before and after
//! it is dropped.

mod boxes;
mod edits;
mod fragments;
mod index;
mod packets;
mod table;
mod track;

use std::collections::VecDeque;

use crate::aac::{LOOKED_AT, refuse_replication};
use crate::codec::{Codec, Decoded, PacketDecoder, Refusal};
use crate::error::AudioError;
use crate::input::Input;
use crate::report::{ReadReport, Repair};
use crate::source::{AudioSpec, BlockSource, SampleEncoding};
use crate::stream::{LONGEST_GAP, Next, Stream, StreamSource};
use boxes::Head;
use edits::Timeline;
use fragments::Fragments;
use index::{data_come_first, hold, index};
use packets::{Found, Source};
use table::{Packet, Packets};
use track::{Coding, Track};

const EXPECTED: &str = "MP4 with AAC-LC of 1 or 2 channels, or ALAC";
/// Bytes of a pipe in which its order is looked for.
const LOOKED_THROUGH: usize = 64 << 10;

/// Boxes that can start a file.
const FIRST: [&[u8; 4]; 8] =
    [b"ftyp", b"moov", b"mdat", b"wide", b"free", b"skip", b"pnot", b"styp"];

/// Whether MP4 or QuickTime starts with these bytes.
pub(crate) fn is_mp4(start: &[u8]) -> bool {
    start.get(4..8).is_some_and(|kind| FIRST.iter().any(|first| kind == *first))
        && Head::parse(start).is_some()
}

/// What comes next.
enum Step {
    Silence(u64),
    Samples(Vec<f32>),
}

struct Mp4Stream {
    input: Input,
    source: Source,
    coding: Coding,
    codec: Codec,
    track_scale: u32,
    timeline: Timeline,
    declared: Option<u64>,
    /// Packets read when the file was opened.
    first: VecDeque<(Packet, Found)>,
    /// The packet that follows, once it was looked at.
    following: Option<Option<Packet>>,
    steps: VecDeque<Step>,
    /// Frames of the track so far.
    position: u64,
    /// Frames at its end that the file does not hold.
    missing: u64,
    /// Frames handed on so far.
    given: u64,
    /// Frames since the last packet that could be decoded.
    silent: u64,
    /// Whether the units of time are shorter than a packet.
    is_fine: bool,
    /// Whether all packets so far last as long as they are.
    is_regular: bool,
    sounds: bool,
    begun: bool,
}

/// Opens MP4 at the position of `input`, where a box begins.
pub(crate) fn open(mut input: Input) -> Result<Box<dyn BlockSource>, AudioError> {
    let base = input.position();
    let refused = |refusal: Refusal| refusal.at(base, EXPECTED);
    if input.len().is_none() && data_come_first(input.peek(LOOKED_THROUGH)?) {
        hold(&mut input)?;
    }
    let (moov, floor) = index(&mut input)?;
    let mut track = Track::parse(&moov).map_err(refused)?;
    drop(moov);
    let is_in_order = track.table.is_in_order(floor - base);
    if !is_in_order && input.len().is_none() {
        hold(&mut input)?;
    }
    let coding = track.coding;
    let frame = coding.frame();
    let declared = track.length.map(|length| track.timeline.length(length));
    let mut report = ReadReport::default();
    if track.timeline.late > 0 {
        report.note(Repair::TimeJump { at: 0, frames: std::mem::take(&mut track.timeline.late) });
    }
    let boundary = input.position();
    let duration = frames_in_scale(frame, coding.sample_rate(), track.scales.track);
    let mut stream = Mp4Stream {
        input,
        source: Source {
            packets: Packets::new(track.table, duration),
            is_in_order,
            floor,
            base,
            fragments: track.fragments.map(|defaults| Fragments::new(defaults, base, boundary)),
        },
        codec: coding.codec().map_err(refused)?,
        track_scale: track.scales.track,
        timeline: track.timeline,
        declared,
        first: VecDeque::new(),
        following: None,
        steps: VecDeque::new(),
        position: 0,
        missing: 0,
        given: 0,
        silent: 0,
        is_fine: edits::frames(1, track.scales.track, coding.sample_rate()) < frame.into(),
        is_regular: track.scales.track == coding.sample_rate(),
        sounds: false,
        begun: false,
        coding,
    };
    stream.look_ahead()?;
    let (name, encoding) = match &stream.coding {
        Coding::Aac(_) => ("mp4 aac", SampleEncoding::Lossy),
        Coding::Alac { .. } => ("mp4 alac", SampleEncoding::Lossless),
    };
    let spec = AudioSpec {
        sample_rate: stream.coding.sample_rate(),
        channels: stream.coding.channels(),
        format: name.into(),
        encoding,
        declared_frames: declared.filter(|frames| *frames < 1 << 40),
    };
    Ok(Box::new(StreamSource::new(stream, spec, report)))
}

/// `n` frames in units of a track's time scale.
fn frames_in_scale(n: u32, sample_rate: u32, scale: u32) -> u32 {
    u32::try_from(edits::frames(n.into(), sample_rate, scale)).unwrap_or(u32::MAX)
}

impl Mp4Stream {
    /// Reads the first packets, which tell whether AAC is more than it says.
    fn look_ahead(&mut self) -> Result<(), AudioError> {
        let Coding::Aac(config) = self.coding else { return Ok(()) };
        while self.first.len() < LOOKED_AT {
            let Some(packet) = self.source.next(&mut self.input)? else { break };
            let found = self.source.bytes(&mut self.input, &packet)?;
            self.first.push_back((packet, found));
        }
        let packets = self.first.iter().map(|(_, found)| match found {
            Found::Bytes(bytes) => bytes.as_slice(),
            Found::Senseless | Found::Missing => &[],
        });
        refuse_replication(packets, &config)
            .map_err(|refusal| refusal.at(self.source.floor, EXPECTED))
    }

    fn next_packet(&mut self) -> Result<Option<(Packet, Found)>, AudioError> {
        if let Some(first) = self.first.pop_front() {
            return Ok(Some(first));
        }
        let packet = match self.following.take() {
            Some(packet) => packet,
            None => self.source.next(&mut self.input)?,
        };
        let Some(packet) = packet else { return Ok(None) };
        let found = self.source.bytes(&mut self.input, &packet)?;
        Ok(Some((packet, found)))
    }

    /// Whether no packet follows.
    fn is_last(&mut self) -> Result<bool, AudioError> {
        if !self.first.is_empty() {
            return Ok(false);
        }
        if self.following.is_none() {
            self.following = Some(self.source.next(&mut self.input)?);
        }
        Ok(self.following == Some(None))
    }

    /// Appends the next `count` frames of the track, as far as they belong to the recording:
    /// `samples`, or silence where there are none.
    fn place(&mut self, count: u64, mut samples: Vec<f32>) {
        let channels = usize::from(self.coding.channels());
        let is_silent = samples.is_empty();
        let (steps, given) = (&mut self.steps, &mut self.given);
        self.timeline.take(self.position, count, |gap, range| {
            if gap > 0 {
                steps.push_back(Step::Silence(gap));
            }
            let frames = range.end - range.start;
            *given += gap + frames;
            steps.push_back(if is_silent {
                Step::Silence(frames)
            } else if frames == count {
                Step::Samples(std::mem::take(&mut samples))
            } else {
                let range = range.start as usize * channels..range.end as usize * channels;
                Step::Samples(samples[range].to_vec())
            });
        });
        self.position = self.position.saturating_add(count);
    }

    /// Silence instead of `count` frames of the track.
    fn lose(&mut self, count: u64, report: &mut ReadReport) {
        let first = self.given;
        self.place(count, Vec::new());
        if self.given > first {
            report.note(Repair::LostFrames { first, count: self.given - first });
        }
    }

    /// Goes to the time at which a packet begins, where that is said.
    fn jump(&mut self, time: u64, report: &mut ReadReport) {
        let time = edits::frames(time, self.track_scale, self.coding.sample_rate());
        let ahead = time.saturating_sub(self.position);
        if !self.begun {
            if time > 0 {
                report.note(Repair::TimeJump { at: 0, frames: time });
            }
            self.position = time;
        } else if ahead >= u64::from(self.coding.frame()) && self.is_fine {
            self.skip(ahead, report);
        }
    }

    /// Fills a gap in the time of the track.
    fn skip(&mut self, count: u64, report: &mut ReadReport) {
        if count <= LONGEST_GAP * u64::from(self.coding.sample_rate()) {
            self.lose(count, report);
        } else {
            report.note(Repair::TimeJump { at: self.given, frames: count });
        }
    }

    /// Handles the next packet; false where there is none.
    fn step(&mut self, report: &mut ReadReport) -> Result<bool, AudioError> {
        let longest = LONGEST_GAP * u64::from(self.coding.sample_rate());
        let Some((packet, found)) = self.next_packet()? else { return Ok(false) };
        if let Some(time) = packet.time {
            self.jump(time, report);
        }
        self.begun = true;
        let frame = u64::from(self.coding.frame());
        let (rate, scale) = (self.coding.sample_rate(), self.track_scale);
        let lasts = edits::frames(packet.duration.into(), scale, rate);
        let whole = match self.coding {
            Coding::Alac { .. } if scale == rate && (1..frame).contains(&lasts) => lasts,
            _ => frame,
        };
        let mut samples = Vec::new();
        let frames = match found {
            Found::Missing => {
                self.missing = self.missing.saturating_add(whole);
                // What follows in order is missing, too.
                return Ok(!self.source.is_in_order && self.missing <= longest);
            }
            Found::Senseless => None,
            Found::Bytes(bytes) => {
                let decoded = self.codec.decode(&bytes, &mut samples);
                match decoded.map_err(|refusal| refusal.at(packet.offset, EXPECTED))? {
                    Decoded::Frames(frames) if frames > 0 => Some(frames as u64),
                    _ => None,
                }
            }
        };
        let missing = std::mem::take(&mut self.missing);
        if missing > 0 {
            self.lose(missing, report);
        }
        let Some(frames) = frames else {
            if !self.sounds {
                // The decoder takes the channels from the first packet, and keeps them.
                self.codec = self.coding.codec().map_err(|r| r.at(packet.offset, EXPECTED))?;
            }
            self.silent += whole;
            if self.silent > longest {
                let what = "hardly any decodable packet";
                return Err(AudioError::corrupt(packet.offset, what, EXPECTED));
            }
            self.lose(whole, report);
            return Ok(true);
        };
        (self.sounds, self.silent) = (true, 0);
        if let Some(order) = self.coding.order() {
            for frame in samples.chunks_exact_mut(order.len()) {
                let mut ordered = [0.0; 8];
                ordered.iter_mut().zip(order).for_each(|(to, from)| *to = frame[*from]);
                frame.copy_from_slice(&ordered[..order.len()]);
            }
        }
        let mut kept = frames;
        if lasts > 0 && lasts < frames && self.is_regular && self.is_last()? {
            // The padding of an encoder.
            kept = lasts;
            samples.truncate(kept as usize * usize::from(self.coding.channels()));
        }
        self.is_regular &= lasts == frames;
        self.place(kept, samples);
        if self.is_fine && lasts >= frames.saturating_add(frame) && !self.is_last()? {
            self.skip(lasts - frames, report);
        }
        Ok(true)
    }

    fn finish(&mut self, report: &mut ReadReport) -> Result<(), AudioError> {
        if self.missing > 0 {
            report.note_truncated(self.declared, self.given);
        } else if !self.sounds && self.begun {
            let at = self.input.position();
            return Err(AudioError::corrupt(at, "no decodable packet", EXPECTED));
        }
        Ok(())
    }
}

impl Stream for Mp4Stream {
    fn next(
        &mut self,
        samples: &mut Vec<f32>,
        report: &mut ReadReport,
    ) -> Result<Next, AudioError> {
        loop {
            match self.steps.pop_front() {
                Some(Step::Silence(frames)) => return Ok(Next::Silence(frames)),
                Some(Step::Samples(mut decoded)) => {
                    std::mem::swap(samples, &mut decoded);
                    return Ok(Next::Samples);
                }
                None if self.timeline.is_over() => return Ok(Next::End),
                None if self.step(report)? => {}
                None => {
                    self.finish(report)?;
                    return Ok(Next::End);
                }
            }
        }
    }
}
