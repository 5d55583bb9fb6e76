//! What was odd about a recording that was read nevertheless.

use std::fmt;
use std::ops::Range;

use serde::Serialize;

/// One deviation from the standard that the reader worked around; `docs/reading.md` lists the
/// rules. `name` is stable and meant for tables, `Display` is for people.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(tag = "name", rename_all = "snake_case")]
#[non_exhaustive]
pub enum Repair {
    /// The data size was 0 although samples follow: read to the end.
    DataSizeZero,
    /// The data size was the placeholder of a stream (all bits set): read to the end.
    DataSizeUnknown,
    /// More than 4 GiB of data in a plain RIFF file, whose 32-bit size wrapped around.
    DataSizeWrapped {
        /// Bytes that the header states.
        declared: u64,
        /// Bytes of sample data that the file size implies.
        used: u64,
    },
    /// The file ends before its data: the whole frames that are there were read.
    Truncated {
        /// Frames that the header states; `None` where an Ogg stream just stops.
        declared: Option<u64>,
        /// Whole frames that are there.
        actual: u64,
    },
    /// The data end inside a frame, whose bytes were left out.
    PartialFrame {
        /// Bytes left out.
        bytes: u64,
    },
    /// The block alignment contradicts channels and bits: the latter were used.
    BlockAlign {
        /// Bytes per frame that the header states.
        declared: u64,
        /// Bytes per frame that were used.
        used: u64,
    },
    /// An odd-sized chunk without its padding byte.
    MissingPadding {
        /// Where the padding byte should be.
        offset: u64,
    },
    /// Frames inside a compressed stream that are damaged or missing became silence of the same
    /// length.
    LostFrames {
        /// The first of them, counted from the start of the recording.
        first: u64,
        /// How many there are in all, according to the time stamps.
        count: u64,
    },
    /// The data go on after the length that the header states: read to the end.
    LongerThanDeclared {
        /// Frames that the header states.
        declared: u64,
        /// Frames that are there.
        actual: u64,
    },
    /// Another recording of the same format follows in the file: it was read as well.
    Concatenated {
        /// The first frame of the second recording.
        at: u64,
    },
    /// The time stamps jump although nothing is missing in between: the samples were joined.
    TimeJump {
        /// The frame at which they do.
        at: u64,
        /// By how many frames.
        frames: u64,
    },
    /// Bytes inside the audio that belong to no frame were left out.
    ForeignBytes {
        /// Where the first of them are.
        offset: u64,
        /// How many there are in all.
        bytes: u64,
    },
    /// Behind the samples there are more: a second data chunk, or another file of uncompressed
    /// samples. They were not read.
    MoreData {
        /// Where that chunk or file begins.
        offset: u64,
    },
}

impl Repair {
    /// Stable short code, the one that `docs/reading.md` uses.
    pub fn name(&self) -> &'static str {
        match self {
            Self::DataSizeZero => "data_size_zero",
            Self::DataSizeUnknown => "data_size_unknown",
            Self::DataSizeWrapped { .. } => "data_size_wrapped",
            Self::Truncated { .. } => "truncated",
            Self::PartialFrame { .. } => "partial_frame",
            Self::BlockAlign { .. } => "block_align",
            Self::MissingPadding { .. } => "missing_padding",
            Self::LostFrames { .. } => "lost_frames",
            Self::LongerThanDeclared { .. } => "longer_than_declared",
            Self::Concatenated { .. } => "concatenated",
            Self::TimeJump { .. } => "time_jump",
            Self::ForeignBytes { .. } => "foreign_bytes",
            Self::MoreData { .. } => "more_data",
        }
    }
}

impl fmt::Display for Repair {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::DataSizeZero => write!(f, "data size 0 in the header, read to the end"),
            Self::DataSizeUnknown => write!(f, "no data size in the header, read to the end"),
            Self::DataSizeWrapped { declared, used } => {
                write!(f, "32-bit data size {declared} wrapped around, used {used}")
            }
            Self::Truncated { declared: Some(declared), actual } => {
                write!(f, "the file ends after {actual} of {declared} frames")
            }
            Self::Truncated { declared: None, actual } => {
                write!(f, "the stream stops after {actual} frames without its end mark")
            }
            Self::PartialFrame { bytes } => {
                write!(f, "{bytes} bytes of an incomplete last frame left out")
            }
            Self::BlockAlign { declared, used } => {
                write!(f, "block alignment {declared} contradicts channels and bits, used {used}")
            }
            Self::MissingPadding { offset } => {
                write!(f, "odd-sized chunk without padding at byte {offset}")
            }
            Self::LostFrames { first, count: 1 } => {
                write!(f, "1 damaged or missing frame, frame {first}, is silence")
            }
            Self::LostFrames { first, count } => {
                write!(f, "{count} damaged or missing frames, from frame {first} on, are silence")
            }
            Self::LongerThanDeclared { declared, actual } => {
                write!(f, "the header states {declared} frames, the file has {actual}, all read")
            }
            Self::Concatenated { at } => {
                write!(f, "another recording follows in the file, read from frame {at} on")
            }
            Self::TimeJump { at, frames } => {
                write!(f, "the time stamps jump by {frames} frames at frame {at}, joined there")
            }
            Self::ForeignBytes { offset, bytes } => {
                write!(f, "{bytes} bytes between frames, from byte {offset} on, left out")
            }
            Self::MoreData { offset } => {
                write!(f, "more samples after the first data chunk, at byte {offset}, not read")
            }
        }
    }
}

/// What reading found; complete once `read` has returned 0.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize)]
pub struct ReadReport {
    /// Frames handed out by `read` so far.
    pub decoded_frames: u64,
    /// The recording ended before what its header declares, or bytes that may have been frames were
    /// left out.
    pub truncated: bool,
    /// Deviations worked around, in the order met, each kind of cause once.
    pub repairs: Vec<Repair>,
    /// The frames of [`Repair::LostFrames`] that were met last.
    #[serde(skip)]
    pub(crate) lost: Vec<Range<u64>>,
}

/// Most ranges of lost frames that are kept.
const MOST_LOST: usize = 1024;

impl ReadReport {
    /// The deviation by which samples are missing, or may be.
    pub fn loss(&self) -> Option<&Repair> {
        self.repairs.iter().find(|repair| self.is_loss(repair))
    }

    fn is_loss(&self, repair: &Repair) -> bool {
        match repair {
            Repair::Truncated { .. } | Repair::LostFrames { .. } => true,
            Repair::ForeignBytes { .. } => self.truncated,
            _ => false,
        }
    }

    /// Whether a deviation concerns a stretch of the recording that was read to its end, and no further.
    pub fn concerns(&self, repair: &Repair, stretch: &Range<u64>) -> bool {
        match repair {
            Repair::Truncated { actual, .. } => stretch.end > *actual,
            Repair::LostFrames { .. } => {
                self.lost.iter().any(|lost| lost.start < stretch.end && stretch.start < lost.end)
            }
            _ => true,
        }
    }

    /// As [`loss`](Self::loss), for such a stretch, and with the frames that it lacks: of very many gaps
    /// inside of it, those that were met last.
    pub fn loss_in(&self, stretch: &Range<u64>) -> Option<Repair> {
        let losses = self.repairs.iter().filter(|repair| self.is_loss(repair));
        losses.filter(|repair| self.concerns(repair, stretch)).find_map(|loss| match *loss {
            Repair::LostFrames { first, count } => self.lost_in(stretch, (first, count)),
            loss => Some(loss),
        })
    }

    /// The part of all lost frames, which begin at `first` and are `count`, that lies in a stretch.
    fn lost_in(&self, stretch: &Range<u64>, (first, count): (u64, u64)) -> Option<Repair> {
        let end = self.lost.last()?.end;
        if stretch.start <= first && end <= stretch.end {
            return Some(Repair::LostFrames { first, count });
        }
        let (mut first, mut count) = (None, 0);
        for lost in &self.lost {
            let inside = lost.start.max(stretch.start)..lost.end.min(stretch.end);
            if !inside.is_empty() {
                first = first.or(Some(inside.start));
                count += inside.end - inside.start;
            }
        }
        Some(Repair::LostFrames { first: first?, count })
    }

    /// Notes a deviation; of its kind the first place and the sum of frames or bytes are kept.
    pub(crate) fn note(&mut self, repair: Repair) {
        if let Repair::LostFrames { first, count } = repair {
            self.lose(first..first.saturating_add(count));
        }
        let kind = std::mem::discriminant(&repair);
        let old = self.repairs.iter_mut().find(|old| std::mem::discriminant(*old) == kind);
        match (old, repair) {
            (None, repair) => self.repairs.push(repair),
            (Some(Repair::LostFrames { count, .. }), Repair::LostFrames { count: more, .. })
            | (
                Some(Repair::ForeignBytes { bytes: count, .. }),
                Repair::ForeignBytes { bytes: more, .. },
            )
            | (
                Some(Repair::TimeJump { frames: count, .. }),
                Repair::TimeJump { frames: more, .. },
            ) => {
                *count = count.saturating_add(more);
            }
            (Some(_), _) => {}
        }
    }

    fn lose(&mut self, frames: Range<u64>) {
        match self.lost.last_mut().filter(|last| last.end == frames.start) {
            Some(last) => last.end = frames.end,
            None => {
                if self.lost.len() == MOST_LOST {
                    self.lost.remove(0);
                }
                self.lost.push(frames);
            }
        }
    }

    /// Notes that the recording stops early.
    pub(crate) fn note_truncated(&mut self, declared: Option<u64>, actual: u64) {
        self.truncated = true;
        self.note(Repair::Truncated { declared, actual });
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_stretch_has_the_losses_that_lie_in_it() {
        let mut report = ReadReport::default();
        for (first, count) in [(100, 10), (110, 5), (300, 50)] {
            report.note(Repair::LostFrames { first, count });
        }
        report.note_truncated(Some(1000), 900);
        let of = |report: &ReadReport, stretch: Range<u64>| report.loss_in(&stretch);
        let lost = |first, count| Some(Repair::LostFrames { first, count });
        assert_eq!(of(&report, 0..100), None);
        assert_eq!(of(&report, 0..101), lost(100, 1));
        assert_eq!(of(&report, 105..320), lost(105, 10 + 20));
        assert_eq!((of(&report, 115..300), of(&report, 350..900)), (None, None));
        assert_eq!(
            of(&report, 350..901),
            Some(Repair::Truncated { declared: Some(1000), actual: 900 })
        );
        assert_eq!(of(&report, 0..u64::MAX), lost(100, 65));
        assert_eq!(report.loss(), lost(100, 65).as_ref());
        for gap in 1..=MOST_LOST as u64 + 1 {
            report.note(Repair::LostFrames { first: 1000 * gap, count: 2 });
        }
        let all = 65 + 2 * (MOST_LOST as u64 + 1);
        assert_eq!(of(&report, 0..u64::MAX), lost(100, all));
        assert_eq!(of(&report, 1_000_000..1_000_001), lost(1_000_000, 1));
    }
}
