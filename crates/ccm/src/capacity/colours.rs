//! The colour frames of a view: images, or else a video; and how many a video has.

use corsmal_vision::{Detection, Pictures, Rgb, Video};

use super::frames::{Frame, Kind};
use super::problem::Problem;
use super::views::Views;
use crate::dataset::Recording;
use crate::error::{CcmError, Result};

/// Views of a recording.
const VIEWS: std::ops::RangeInclusive<u8> = 1..=4;

/// The colour frames of a view.
pub struct Colours<'v>(Source<'v>);

enum Source<'v> {
    Images(&'v [Frame]),
    Video(&'v Video),
}

impl<'v> Colours<'v> {
    pub(super) fn of_images(images: &'v [Frame]) -> Self {
        Self(Source::Images(images))
    }

    pub(super) fn of_video(video: &'v Video) -> Self {
        Self(Source::Video(video))
    }

    /// Their numbers, in their order.
    pub fn numbers(&self) -> Vec<u32> {
        match &self.0 {
            Source::Images(images) => images.iter().map(|image| image.number).collect(),
            Source::Video(video) => (0..video.len() as u32).collect(),
        }
    }

    /// Before the first of them.
    ///
    /// # Errors
    /// A video that this program does not decode.
    pub fn read(&self) -> std::result::Result<Reader<'_>, Problem> {
        Ok(Reader(match &self.0 {
            Source::Images(images) => Reading::Images(images.iter()),
            Source::Video(video) => Reading::Video(Box::new(video.pictures()?)),
        }))
    }
}

/// Reads colour frames one after another.
pub struct Reader<'c>(Reading<'c>);

enum Reading<'c> {
    Images(std::slice::Iter<'c, Frame>),
    Video(Box<Pictures<'c>>),
}

impl Reader<'_> {
    /// The number of the next frame, and its picture where that is `wanted`; `None` after the last. Frames of a video
    /// are all decoded, so that the caller may look up in between.
    ///
    /// # Errors
    /// It is damaged.
    pub fn next(
        &mut self,
        wanted: impl Fn(u32) -> bool,
    ) -> std::result::Result<Option<(u32, Option<Rgb>)>, Problem> {
        match &mut self.0 {
            Reading::Video(pictures) => Ok(pictures.next(wanted)?),
            Reading::Images(images) => match images.next() {
                None => Ok(None),
                Some(Frame { number, path }) => {
                    let picture = wanted(*number).then(|| Rgb::read(path)).transpose()?;
                    Ok(Some((*number, picture)))
                }
            },
        }
    }
}

impl Views {
    /// Refuses detections in frames after the last of their view's video and images: they are of another
    /// recording, or count otherwise. Without a video, images may be fewer than the frames that a detector saw.
    pub(super) fn require_frames(
        &self,
        detections: &[Detection],
    ) -> std::result::Result<(), String> {
        for view in VIEWS {
            let of_view = detections.iter().filter(|d| d.view == view);
            let Some(last) = of_view.map(|d| d.frame).max() else { continue };
            // A damaged video is said where its pictures are needed.
            let Ok(Some(video)) = self.video(view) else { continue };
            let shown = |kind| self.frames(kind, view).ok()?.last().map(|frame| frame.number);
            let images = [Kind::Rgb, Kind::Depth, Kind::Masks].into_iter().filter_map(shown).max();
            if last as usize >= video.len() && images.is_none_or(|image| last > image) {
                return Err(format!(
                    "frame {last} of view {view}: its video has {} frames, counted from 0; expected \
                     the table of this recording, with frames counted from 0",
                    video.len()
                ));
            }
        }
        Ok(())
    }

    /// Numbers of the first frame of the side views' video and of the one `from_end` from its end, the last
    /// where there are fewer; `None` where nothing says how long it is.
    ///
    /// The video's frames are the images that both views have: colour, depth, or else masks; then those of both
    /// videos, which may be numbered otherwise; a video that cannot be read says nothing. A table of detections has
    /// no row for a frame in which nothing was found: it counts from 0 to its last frame.
    ///
    /// # Errors
    /// A folder cannot be read.
    pub fn ends(
        &self,
        detections: &[Detection],
        from_end: usize,
    ) -> std::result::Result<Option<(u32, u32)>, Problem> {
        let ends = |numbers: &[u32]| {
            let (first, last) = (numbers.first()?, numbers.last()?);
            let late = numbers.len().checked_sub(from_end).and_then(|at| numbers.get(at));
            Some((*first, *late.unwrap_or(last)))
        };
        for kind in [Kind::Rgb, Kind::Depth, Kind::Masks] {
            let other = self.frames(kind, 2)?;
            let shared = |f: &&Frame| other.binary_search_by_key(&f.number, |o| o.number).is_ok();
            let numbers: Vec<u32> =
                self.frames(kind, 1)?.iter().filter(shared).map(|f| f.number).collect();
            if let Some(found) = ends(&numbers) {
                return Ok(Some(found));
            }
        }
        if let (Ok(Some(one)), Ok(Some(other))) = (self.video(1), self.video(2)) {
            let numbers: Vec<u32> = (0..one.len().min(other.len()) as u32).collect();
            if let Some(found) = ends(&numbers) {
                return Ok(Some(found));
            }
        }
        let last = detections.iter().map(|d| d.frame).max();
        Ok(last.map(|last| (0, (last + 1).checked_sub(from_end as u32).unwrap_or(last))))
    }
}

/// Recordings whose pictures come from videos with B-frames, in words: what the decoder makes of these may be wrong.
pub fn doubtful_colours(recordings: &[Recording]) -> Option<String> {
    let doubtful = |recording: &&Recording| {
        let views = Views::of(recording, None);
        let mut sources = VIEWS.filter_map(|view| match views.colours(view).ok()?.0 {
            Source::Images(_) => None,
            Source::Video(video) => Some(video.is_reordered()),
        });
        sources.any(|reordered| reordered)
    };
    let mut doubtful = recordings.iter().filter(doubtful);
    let first = doubtful.next()?.path.display();
    Some(format!(
        "the videos of {} of {} recordings (the first is {first}) have B-frames, some of which OpenH264 decodes visibly \
         wrong: extract the frames as PNG with ffmpeg (docs/vision.md)",
        1 + doubtful.count(),
        recordings.len()
    ))
}

/// Refuses recordings none of which has a colour frame, and those in videos where this program decodes none.
///
/// # Errors
/// [`CcmError::Request`] that says what was looked for.
pub fn require_colours(recordings: &[Recording]) -> Result<()> {
    for recording in recordings {
        let views = Views::of(recording, None);
        for view in VIEWS {
            match views.colours(view) {
                Ok(colours) if colours.numbers().is_empty() => {}
                Ok(Colours(Source::Video(video))) if !Video::DECODES => {
                    let refusal = video.pictures().err().map(|e| e.to_string());
                    return Err(CcmError::Request(refusal.unwrap_or_default()));
                }
                // What is damaged is said of its recording.
                Ok(_) | Err(_) => return Ok(()),
            }
        }
    }
    Err(CcmError::Request(format!(
        "none of {} recordings has colour frames (rgb/SEQUENCE/c1/0000.png or rgb/SEQUENCE_c1.mp4; see docs/vision.md)",
        recordings.len()
    )))
}
