//! Videos: H.264 in MP4. How many frames there are is known without decoding; pictures of them need the Cargo
//! feature `video`.

#[cfg(feature = "video")]
mod colours;
#[cfg(feature = "video")]
mod decoding;
mod mp4;

use std::fs::File;
use std::io::BufReader;
use std::path::{Path, PathBuf};

use crate::error::{Result, VisionError};
use crate::image::Rgb;

/// A video whose frames have been found.
#[derive(Clone, Debug)]
pub struct Video {
    path: PathBuf,
    track: mp4::Track,
}

impl Video {
    /// Finds the frames of the first video track of an MP4 file.
    ///
    /// # Errors
    /// [`VisionError`] when the file cannot be read, is damaged or fragmented.
    pub fn open(path: &Path) -> Result<Self> {
        let file = File::open(path).map_err(|e| VisionError::io(path, e))?;
        let size = file.metadata().map_err(|e| VisionError::io(path, e))?.len();
        let track = mp4::read(&mut BufReader::new(file), size)
            .map_err(|reason| VisionError::file(path, format!("not a readable MP4: {reason}")))?;
        Ok(Self { path: path.into(), track })
    }

    /// Number of frames.
    pub fn len(&self) -> usize {
        self.track.frames.len()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Whether frames are stored in another order than they are shown in, as those that are predicted from later
    /// ones (B-frames) must be: OpenH264 decodes some of these visibly wrong.
    pub fn is_reordered(&self) -> bool {
        self.track.reordered
    }

    /// Whether this program decodes videos.
    pub const DECODES: bool = cfg!(feature = "video");

    /// Begins with its first frame. Colours are those that the stream declares, or else the file; where neither does,
    /// BT.601 of limited range.
    ///
    /// # Errors
    /// [`VisionError`] for another codec, for colours that are none of the usual ones, and where this program was built without the feature.
    pub fn pictures(&self) -> Result<Pictures<'_>> {
        #[cfg(feature = "video")]
        return decoding::Decoding::begin(&self.track, &self.path).map(Pictures);
        #[cfg(not(feature = "video"))]
        Err(VisionError::file(
            &self.path,
            "this program was built without video: extract the frames as PNG or JPEG (docs/vision.md), or build \
             it with `--features video`",
        ))
    }
}

/// The pictures of a video, one after another.
pub struct Pictures<'v>(
    #[cfg(feature = "video")] decoding::Decoding<'v>,
    #[cfg(not(feature = "video"))] std::convert::Infallible,
    #[cfg(not(feature = "video"))] std::marker::PhantomData<&'v Video>,
);

impl Pictures<'_> {
    /// Decodes the next frame as they are shown: its number, from 0, and its picture where that is `wanted`; `None`
    /// after the last.
    ///
    /// # Errors
    /// [`VisionError`] for a damaged frame, and where there are fewer than the index tells of.
    pub fn next(&mut self, wanted: impl Fn(u32) -> bool) -> Result<Option<(u32, Option<Rgb>)>> {
        #[cfg(feature = "video")]
        return self.0.next(&wanted);
        #[cfg(not(feature = "video"))]
        {
            let _ = wanted;
            match self.0 {}
        }
    }
}
