//! Which stretches of a track are the recording: the edit list, or what iTunes says.

use std::collections::VecDeque;
use std::ops::Range;

use super::boxes::{child, descend, u16_at, u32_at, u64_at};

/// Edits of one list that are read.
const MAX_EDITS: usize = 1 << 16;
/// Seconds of all pauses.
const LONGEST_PAUSE: u64 = 3600;
/// Most samples that an encoder puts before the recording.
const MAX_DELAY: u64 = 1 << 14;

/// Scales that times are counted in, per second.
#[derive(Debug, Clone, Copy)]
pub(super) struct Scales {
    pub(super) movie: u32,
    pub(super) track: u32,
    pub(super) sample_rate: u32,
}

/// `n` units of a scale in frames, rounded.
pub(super) fn frames(n: u64, scale: u32, sample_rate: u32) -> u64 {
    let scale = u128::from(scale.max(1));
    let frames = (u128::from(n) * u128::from(sample_rate) + scale / 2) / scale;
    u64::try_from(frames).unwrap_or(u64::MAX)
}

/// A stretch of the track, in frames, and the gap before it.
#[derive(Debug, Clone, PartialEq, Eq)]
struct Stretch {
    gap: u64,
    frames: Range<u64>,
}

/// The stretches that make the recording, in order.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Timeline {
    stretches: VecDeque<Stretch>,
    /// Frames by which the recording begins late.
    pub(super) late: u64,
}

impl Timeline {
    /// Reads what a track (`trak`) says of its edits; `length` is that of the track in frames where
    /// its table tells, `smpb` what iTunes says of it. Says in words what is not read.
    pub(super) fn parse(
        trak: &[u8],
        scales: Scales,
        length: Option<u64>,
        smpb: Option<(u64, u64)>,
    ) -> Result<Self, String> {
        let list = descend(trak, &[b"edts", b"elst"]).map(edits).unwrap_or_default();
        let is_plain = match &list[..] {
            [] => true,
            [edit] => edit.start == Some(0),
            _ => false,
        };
        if let (true, Some((delay, frames))) = (is_plain, smpb) {
            let stretch = Stretch { gap: 0, frames: delay..delay.saturating_add(frames) };
            return Ok(Self { stretches: [stretch].into(), late: 0 });
        }
        let mut stretches: VecDeque<Stretch> = VecDeque::new();
        let (mut late, mut gap, mut pauses) = (0, 0u64, 0u64);
        let longest = LONGEST_PAUSE * u64::from(scales.sample_rate);
        // Lengths are rounded to the units of the movie.
        let tick = frames(1, scales.movie, scales.sample_rate).max(1);
        for edit in list {
            let span = frames(edit.length, scales.movie, scales.sample_rate);
            let Some(start) = edit.start else {
                gap = gap.saturating_add(span);
                pauses = pauses.saturating_add(span);
                if pauses > longest && !stretches.is_empty() {
                    return Err("MP4 with pauses of more than an hour among its edits".into());
                }
                continue;
            };
            if edit.rate != (1, 0) {
                let (whole, part) = edit.rate;
                let rate = f64::from(whole) + f64::from(part) / 65_536.0;
                return Err(format!("MP4 with an edit that is played at a rate of {rate}"));
            }
            let start = frames(start, scales.track, scales.sample_rate);
            // A fragmented file does not know its length.
            let mut end = if edit.length == 0 { u64::MAX } else { start.saturating_add(span) };
            // The table is finer, where it is sound.
            if let Some(length) = length.filter(|length| end.saturating_add(tick) >= *length) {
                end = if length > start { length } else { u64::MAX };
            }
            if let Some(last) = stretches.back_mut().map(|stretch| &mut stretch.frames) {
                if start.saturating_add(tick) < last.end {
                    return Err("MP4 whose edits repeat or reorder the recording".into());
                }
                last.end = last.end.min(start);
            } else {
                late = std::mem::take(&mut gap);
                pauses = 0;
            }
            stretches.push_back(Stretch { gap: std::mem::take(&mut gap), frames: start..end });
        }
        if stretches.is_empty() {
            stretches.push_back(Stretch { gap: 0, frames: 0..u64::MAX });
        }
        Ok(Self { stretches, late })
    }

    /// Whether nothing of the track is left to come.
    pub(super) fn is_over(&self) -> bool {
        self.stretches.is_empty()
    }

    /// Frames of the recording if the track has `length`.
    pub(super) fn length(&self, length: u64) -> u64 {
        let of = |s: &Stretch| {
            let frames = s.frames.end.min(length).saturating_sub(s.frames.start);
            if frames > 0 { frames.saturating_add(s.gap) } else { 0 }
        };
        self.stretches.iter().map(of).fold(0, u64::saturating_add)
    }

    /// The pieces of the next `count` frames of the track, of which the first is `start`, that belong
    /// to the recording: a gap before the piece, and which of the frames.
    pub(super) fn take(&mut self, start: u64, count: u64, mut each: impl FnMut(u64, Range<u64>)) {
        let end = start.saturating_add(count);
        while let Some(stretch) = self.stretches.front_mut() {
            let from = start.max(stretch.frames.start);
            let to = end.min(stretch.frames.end);
            if from < to {
                each(std::mem::take(&mut stretch.gap), from - start..to - start);
            }
            if stretch.frames.end > end {
                break;
            }
            self.stretches.pop_front();
        }
    }
}

/// An entry of the list.
struct Edit {
    /// In units of the movie.
    length: u64,
    /// In units of the track; `None`: nothing is played.
    start: Option<u64>,
    /// Whole and fraction (of 65536).
    rate: (i16, u16),
}

/// ```text
/// 0 u8 version, u24 flags   4 u32 edits   8 each: u32 length, i32 start, i16 and u16 rate
///                                           (version 1: u64 length, i64 start)
/// ```
fn edits(elst: &[u8]) -> Vec<Edit> {
    let is_long = elst.first() == Some(&1);
    let width = if is_long { 20 } else { 12 };
    let claimed = u32_at(elst, 4).unwrap_or(0) as usize;
    let entries = elst.get(8..).unwrap_or_default().chunks_exact(width);
    let read = |entry: &[u8]| {
        let (length, start) = match is_long {
            true => (u64_at(entry, 0)?, u64_at(entry, 8)?.cast_signed()),
            false => (u32_at(entry, 0)?.into(), u32_at(entry, 4)?.cast_signed().into()),
        };
        let rate = (u16_at(entry, width - 4)?.cast_signed(), u16_at(entry, width - 2)?);
        Some(Edit { length, start: u64::try_from(start).ok(), rate })
    };
    entries.take(claimed.min(MAX_EDITS)).filter_map(read).collect()
}

/// What iTunes says of delay and length, in frames: `iTunSMPB` among the tags of the movie.
///
/// ```text
/// " 00000000 DDDDDDDD PPPPPPPP NNNNNNNNNNNNNNNN ..." in hexadecimal: delay, padding, frames
/// ```
pub(super) fn smpb(moov: &[u8]) -> Option<(u64, u64)> {
    let meta = descend(moov, &[b"udta", b"meta"])?;
    // Four bytes of version and flags, which QuickTime leaves out.
    let tags = child(meta.get(4..)?, b"ilst").or_else(|| child(meta, b"ilst"))?;
    super::boxes::children(tags).filter(|(kind, _)| kind == b"----").find_map(|(_, tag)| {
        let name = child(tag, b"name")?.get(4..)?;
        let text = std::str::from_utf8(child(tag, b"data")?.get(8..)?).ok()?;
        let mut fields = text.split_ascii_whitespace().skip(1);
        let mut number = || u64::from_str_radix(fields.next()?, 16).ok();
        let (delay, _, frames) = (number()?, number()?, number()?);
        let is_usable = name == b"iTunSMPB" && delay < MAX_DELAY && frames > 0;
        is_usable.then_some((delay, frames))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    const SCALES: Scales = Scales { movie: 1000, track: 44_100, sample_rate: 44_100 };

    fn boxed(kind: &[u8; 4], body: &[u8]) -> Vec<u8> {
        [&(body.len() as u32 + 8).to_be_bytes(), kind.as_slice(), body].concat()
    }

    /// A track with edits: length, start, rate.
    fn track(edits: &[(u32, i32, u32)]) -> Vec<u8> {
        let mut list = vec![0, 0, 0, 0];
        list.extend((edits.len() as u32).to_be_bytes());
        for (length, start, rate) in edits {
            list.extend([*length, start.cast_unsigned(), *rate].map(u32::to_be_bytes).concat());
        }
        boxed(b"edts", &boxed(b"elst", &list))
    }

    fn pieces(edits: &[(u32, i32, u32)], length: u64) -> Vec<(u64, Range<u64>)> {
        let mut timeline =
            Timeline::parse(&track(edits), SCALES, Some(length), None).expect("edits");
        let mut pieces: Vec<(u64, Range<u64>)> = Vec::new();
        let mut at = 0;
        while at < length && !timeline.is_over() {
            let count = (length - at).min(700);
            timeline.take(at, count, |gap, r| match pieces.last_mut() {
                Some((_, last)) if gap == 0 && *last == (last.start..at + r.start) => {
                    last.end = at + r.end;
                }
                _ => pieces.push((gap, at + r.start..at + r.end)),
            });
            at += count;
        }
        pieces
    }

    const ONE: u32 = 0x1_0000;

    #[test]
    fn edits_choose_stretches() {
        assert_eq!(pieces(&[], 5000), [(0, 0..5000)]);
        // 907 ms are 39,999 frames: the end of the track is meant.
        assert_eq!(pieces(&[(907, 1024, ONE)], 41_025), [(0, 1024..41_025)]);
        assert_eq!(pieces(&[(0, 1024, ONE)], 41_025), [(0, 1024..41_025)]);
        // Cut at the end, and in the middle, with a pause.
        assert_eq!(pieces(&[(500, 1024, ONE)], 41_025), [(0, 1024..1024 + 22_050)]);
        let cut = [(100, 0, ONE), (200, -1, ONE), (100, 22_050, ONE)];
        assert_eq!(pieces(&cut, 41_025), [(0, 0..4410), (8820, 22_050..26_460)]);
        // What begins late begins with its first sample.
        let late = Timeline::parse(&track(&[(50, -1, ONE), (907, 0, ONE)]), SCALES, None, None);
        assert_eq!(late.as_ref().map(|t| t.late), Ok(2205));
        assert_eq!(late.map(|t| t.length(1000)), Ok(1000));
    }

    #[test]
    fn edits_that_play_otherwise_are_refused() {
        let refused = |edits: &[(u32, i32, u32)]| {
            Timeline::parse(&track(edits), SCALES, Some(50_000), None).unwrap_err()
        };
        assert!(refused(&[(100, 0, ONE / 2)]).contains("a rate of 0.5"));
        assert!(refused(&[(100, 8820, ONE), (100, 0, ONE)]).contains("reorder"));
        let pause = (2_000_000_000, -1, ONE);
        assert!(refused(&[(10, 0, ONE), pause, (10, 2000, ONE)]).contains("more than an hour"));
    }

    #[test]
    fn itunes_says_delay_and_length_where_no_edit_does() {
        let text = b"\0\0\0\x01\0\0\0\0 00000000 00000840 0000037C 0000000000009C41 00000000";
        let tag =
            [boxed(b"mean", b"\0\0\0\0com.apple.iTunes"), boxed(b"name", b"\0\0\0\0iTunSMPB")];
        let tag = boxed(b"----", &[&tag.concat()[..], &boxed(b"data", text)].concat());
        let meta = [&[0; 4][..], &boxed(b"hdlr", &[0; 25]), &boxed(b"ilst", &tag)].concat();
        let moov = boxed(b"udta", &boxed(b"meta", &meta));
        let found = smpb(&moov);
        assert_eq!(found, Some((2112, 40_001)));
        let length = |edits: &[(u32, i32, u32)]| {
            let timeline = Timeline::parse(&track(edits), SCALES, Some(43_008), found);
            timeline.map(|t| t.length(43_008))
        };
        assert_eq!(length(&[]), Ok(40_001));
        assert_eq!(length(&[(975, 0, ONE)]), Ok(40_001));
        assert_eq!(length(&[(907, 1024, ONE)]), Ok(39_999));
        assert_eq!(smpb(&moov[..40]), None);
    }
}
