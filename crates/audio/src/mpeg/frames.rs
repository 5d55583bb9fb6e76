//! Frames as they follow each other, and what stands between them.

use super::header::{HEADER, Header, MAX_FRAME};
use super::sync::{self, WINDOW};
use super::tag::Tag;
use crate::error::AudioError;
use crate::input::Input;
use crate::report::{ReadReport, Repair};
use crate::stream::LONGEST_GAP;
use crate::tags;

/// Frames whose mean size tells how many are missing: rates of MP3 vary slowly.
const RECENT: usize = 8;

/// Frames as they follow each other.
pub(super) struct Frames {
    pub(super) input: Input,
    /// Bytes of a frame of free format without padding; 0 in other recordings.
    pub(super) free: usize,
    /// The header of the first frame with audio.
    pub(super) first: Option<Header>,
    /// The frame that ends where the input stands.
    pub(super) before: Option<Header>,
    /// Frames that went missing before the one found last.
    pub(super) missing: u64,
    /// What stands before the one found last may have been frames.
    pub(super) is_gap: bool,
    /// Bytes of the frames decoded last, in no order.
    pub(super) recent: Vec<usize>,
    /// Frames decoded.
    pub(super) count: usize,
}

impl Frames {
    /// Goes to the next whole frame, which the input then shows; `None` at the end.
    pub(super) fn next(&mut self, report: &mut ReadReport) -> Result<Option<Header>, AudioError> {
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
            let format = first.and_then(|f| sync::find_other_format(shown, is_end, &f, free));
            if let Some((at, size)) = format.filter(|(at, _)| next.is_none_or(|next| *at < next)) {
                return self.change_format(at, size, offset, report);
            }
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
        // Another recording may begin after other bytes, which then took no time.
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

    /// Goes on with frames of another format, `at` bytes from here: another recording.
    fn change_format(
        &mut self,
        at: usize,
        free: usize,
        offset: u64,
        report: &mut ReadReport,
    ) -> Result<Option<Header>, AudioError> {
        self.input.consume(at);
        let bytes = self.input.position() - offset;
        if bytes > 0 {
            report.note(Repair::ForeignBytes { offset, bytes });
        }
        self.free = free;
        self.first = Header::parse(self.input.peek(HEADER)?).map(|header| header.sized(free));
        // What the decoder holds of the frames before does not fit.
        self.is_gap = true;
        self.next(report)
    }

    /// Remembers the size of a frame that was decoded.
    pub(super) fn decoded(&mut self, size: usize) {
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
