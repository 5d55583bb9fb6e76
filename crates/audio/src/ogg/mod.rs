//! Ogg: pages and packets are read here, their audio is decoded by symphonia (FLAC, most of
//! Vorbis), lewton (the rest of Vorbis) and opus-pure.
//!
//! Positions in the pages say what to drop at both ends and how much is missing in between.

mod lazy;
mod link;
mod opus;
mod order;
mod page;
mod surround;
mod vorbis;

use std::collections::VecDeque;

use crate::codec::Decoded;
use crate::error::AudioError;
use crate::input::Input;
use crate::report::{ReadReport, Repair};
use crate::source::{AudioSpec, BlockSource};
use crate::stream::{LONGEST_GAP, Next, Stream, StreamSource};
use link::{EXPECTED, Link};
use page::Page;

/// What comes next of the pages read so far.
enum Step {
    Silence(u64),
    /// A packet that gives `length` samples per channel, of which the first `kept` are used.
    Packet {
        bytes: Vec<u8>,
        length: u32,
        kept: u32,
    },
}

/// One file of Ogg.
struct OggStream {
    input: Input,
    page: Page,
    link: Link,
    /// The sequence number of the page before, of the current link.
    sequence: u32,
    /// What the pages so far hold of a packet that is not complete.
    partial: Option<Vec<u8>>,
    packets: Vec<Vec<u8>>,
    steps: VecDeque<Step>,
    place: Place,
    /// Samples that the decoder gave before their time: lewton ends a long block before a short one
    /// later than the positions count it.
    ahead: Vec<f32>,
    /// Samples per channel handed out so far.
    given: u64,
}

/// Where the current link is.
#[derive(Default)]
struct Place {
    /// Its position after the pages so far; `None` before the first page that says one.
    position: Option<i64>,
    /// Samples per channel before that page.
    unplaced: u64,
    /// Samples per channel still to be dropped at its start.
    skip: u64,
    /// Samples per channel by which its first position is late: it was cut out of a longer recording.
    late: u64,
    /// Its last page was read.
    is_over: bool,
}

/// Opens Ogg at the position of `input`, where a page begins.
pub(crate) fn open(mut input: Input) -> Result<Box<dyn BlockSource>, AudioError> {
    let at = input.position();
    let mut page = Page::default();
    let mut found = page.read(&mut input)?;
    while found && !page.is_first {
        found = page.read(&mut input)?;
    }
    if !found {
        return Err(AudioError::corrupt(at, "no intact first page of an Ogg stream", EXPECTED));
    }
    let (mut partial, mut packets) = (None, Vec::new());
    let link = Link::open(&mut input, &mut page, &mut partial, &mut packets)?;
    // Positions count what is dropped at the start.
    let declared = page::last_granule(&mut input, link.serial)?
        .and_then(|end| u64::try_from(end).ok()?.checked_sub(link.skip))
        .filter(|frames| *frames < 1 << 40);
    let mut spec = AudioSpec {
        sample_rate: link.sample_rate,
        channels: link.channels,
        format: link.name.into(),
        encoding: link.encoding(),
        declared_frames: declared,
    };
    let sequence = page.sequence;
    let place = Place { skip: link.skip, ..Place::default() };
    let mut stream = OggStream {
        input,
        page,
        link,
        sequence,
        partial,
        packets,
        steps: VecDeque::new(),
        place,
        ahead: Vec::new(),
        given: 0,
    };
    let mut report = ReadReport::default();
    stream.place_packets(false, &mut report);
    if declared.is_some() && stream.place.position.is_none() {
        // The first page with samples says where they begin.
        stream.read_page(&mut report)?;
    }
    spec.declared_frames = declared.and_then(|end| end.checked_sub(stream.place.late));
    Ok(Box::new(StreamSource::new(stream, spec, report)))
}

impl OggStream {
    /// Reads pages until there is something to hand out; false at the end.
    fn read_page(&mut self, report: &mut ReadReport) -> Result<bool, AudioError> {
        if !self.page.read(&mut self.input)? {
            return Ok(false);
        }
        if self.page.is_first {
            if link::is_read(&self.page) {
                self.next_link(report)?;
            }
            return Ok(true);
        }
        if self.page.serial != self.link.serial || self.place.is_over {
            return Ok(true);
        }
        let is_next = self.page.sequence == self.sequence.wrapping_add(1);
        let is_lost = !is_next || self.page.continued != self.partial.is_some();
        if is_lost {
            self.partial = None;
            self.ahead.clear();
            self.link.reset();
        }
        self.sequence = self.page.sequence;
        self.packets.clear();
        self.page.packets(&mut self.partial, &mut self.packets);
        self.place_packets(is_lost, report);
        Ok(true)
    }

    /// Goes on with another link of a chain, whose first page was just read.
    fn next_link(&mut self, report: &mut ReadReport) -> Result<(), AudioError> {
        let at = self.page.offset;
        let (partial, packets) = (&mut self.partial, &mut self.packets);
        let link = Link::open(&mut self.input, &mut self.page, partial, packets)?;
        let kept = (self.link.sample_rate, self.link.channels);
        if (link.sample_rate, link.channels) != kept {
            let actual = format!("change to {} channels at {} Hz", link.channels, link.sample_rate);
            let expected = "one channel count and rate in a recording";
            return Err(AudioError::unsupported(at, actual, expected));
        }
        self.link = link;
        self.ahead.clear();
        report.note(Repair::Concatenated { at: self.given + queued(&self.steps) });
        self.sequence = self.page.sequence;
        self.place = Place { skip: self.link.skip, ..Place::default() };
        self.place_packets(false, report);
        Ok(())
    }

    /// Turns the packets of a page into steps: the position of the page says how many of their
    /// samples count. `is_lost`: pages or packets are missing before.
    fn place_packets(&mut self, is_lost: bool, report: &mut ReadReport) {
        let mut lengths = Vec::with_capacity(self.packets.len());
        self.packets.retain(|packet| match self.link.length(packet) {
            Some(length) => {
                lengths.push(length);
                true
            }
            None => false,
        });
        self.link.mend(&mut self.packets);
        let total: u64 = lengths.iter().map(|n| u64::from(*n)).sum();
        let mut left = total;
        let place = &mut self.place;
        let samples = i64::try_from(total).unwrap_or(i64::MAX);
        place.is_over = self.page.is_last;
        match (place.position, self.page.granule) {
            (None, None) => place.unplaced += total,
            (Some(position), None) => place.position = Some(position.saturating_add(samples)),
            // A page of headers.
            (None, Some(_)) if total + place.unplaced == 0 => {}
            (None, Some(granule)) => {
                let count = total + place.unplaced;
                let longest = LONGEST_GAP * u64::from(self.link.sample_rate);
                let late =
                    u64::try_from(granule).map_or(0, |granule| granule.saturating_sub(count));
                if is_lost && (1..=longest).contains(&late) {
                    let first = self.given + queued(&self.steps).saturating_sub(place.skip);
                    report.note(Repair::LostFrames { first, count: late });
                    self.steps.push_back(Step::Silence(late));
                } else {
                    place.late = late;
                }
                // Otherwise, what begins later than 0 was cut out of a longer recording.
                let extra =
                    u64::try_from(granule).map_or(0, |granule| count.saturating_sub(granule));
                if self.page.is_last {
                    left = total.saturating_sub(extra);
                } else {
                    place.skip += extra;
                }
                place.position = Some(granule);
            }
            (Some(position), Some(granule)) => {
                let end = position.saturating_add(samples);
                let difference = granule.abs_diff(end);
                let longest = LONGEST_GAP * u64::from(self.link.sample_rate);
                let at = self.given + queued(&self.steps).saturating_sub(place.skip);
                if granule > end && is_lost && difference <= longest {
                    report.note(Repair::LostFrames { first: at, count: difference });
                    self.steps.push_back(Step::Silence(difference));
                } else if granule < end && self.page.is_last {
                    left = total.saturating_sub(difference);
                } else if granule != end {
                    report.note(Repair::TimeJump { at, frames: difference });
                }
                place.position = Some(granule);
            }
        }
        for (bytes, length) in self.packets.drain(..).zip(lengths) {
            let kept = left.min(length.into()) as u32;
            left -= u64::from(kept);
            self.steps.push_back(Step::Packet { bytes, length, kept });
        }
    }

    fn decode(
        &mut self,
        bytes: &[u8],
        (length, kept): (u32, u32),
        samples: &mut Vec<f32>,
        report: &mut ReadReport,
    ) -> Result<(), AudioError> {
        let channels = usize::from(self.link.channels);
        let decoded = self.link.decode(bytes, samples);
        let decoded = decoded.map_err(|refusal| refusal.at(self.page.offset, EXPECTED))?;
        let wanted = length as usize * channels;
        let skip = self.place.skip.min(kept.into());
        if decoded == Decoded::Damaged {
            samples.clear();
            self.ahead.clear();
            if kept > 0 {
                // Where all of it is skipped, what follows may suffer.
                let count = (u64::from(kept) - skip).max(1);
                report.note(Repair::LostFrames { first: self.given, count });
            }
        }
        if samples.len() != wanted || !self.ahead.is_empty() {
            self.ahead.append(samples);
            samples.extend(self.ahead.drain(..wanted.min(self.ahead.len())));
        }
        samples.resize(wanted, 0.0);
        samples.truncate(kept as usize * channels);
        self.place.skip -= skip;
        samples.drain(..skip as usize * channels);
        self.given += u64::from(kept) - skip;
        Ok(())
    }
}

/// Samples per channel that the steps will give.
fn queued(steps: &VecDeque<Step>) -> u64 {
    let of = |step: &Step| match step {
        Step::Silence(frames) => *frames,
        Step::Packet { kept, .. } => u64::from(*kept),
    };
    steps.iter().map(of).sum()
}

impl Stream for OggStream {
    fn ends_as_declared(&mut self) -> Result<bool, AudioError> {
        // The length is that of its last page.
        Ok(true)
    }

    fn next(
        &mut self,
        samples: &mut Vec<f32>,
        report: &mut ReadReport,
    ) -> Result<Next, AudioError> {
        loop {
            match self.steps.pop_front() {
                Some(Step::Silence(frames)) => {
                    self.given += frames;
                    return Ok(Next::Silence(frames));
                }
                Some(Step::Packet { bytes, length, kept }) => {
                    self.decode(&bytes, (length, kept), samples, report)?;
                    return Ok(Next::Samples);
                }
                None if self.read_page(report)? => {}
                None => break,
            }
        }
        if !self.place.is_over {
            report.note_truncated(None, self.given);
        }
        Ok(Next::End)
    }
}
