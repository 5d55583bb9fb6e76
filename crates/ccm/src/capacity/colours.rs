//! The colour frames of a view: images, or else a video.

use corsmal_vision::{Pictures, Rgb, Video};

use super::frames::Frame;
use super::problem::Problem;

/// The colour frames of a view.
pub struct Colours<'v>(pub(super) Source<'v>);

pub(super) enum Source<'v> {
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
