//! Videos: H.264 in MP4. How many frames there are is known without decoding; pictures of them need the Cargo
//! feature `video`.

#[cfg(feature = "video")]
mod decoding;
mod mp4;

use std::fs::File;
use std::io::BufReader;
use std::ops::ControlFlow;
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

    /// Gives each frame that is `wanted` by its number, from 0, in the order in which they are shown, until
    /// `each` breaks off. All frames before one are decoded.
    ///
    /// # Errors
    /// [`VisionError`] for another codec, damaged frames, and where this program was built without the feature.
    #[cfg(not(feature = "video"))]
    pub fn pictures(
        &self,
        _: impl Fn(u32) -> bool,
        _: impl FnMut(u32, Rgb) -> ControlFlow<()>,
    ) -> Result<()> {
        Err(VisionError::file(
            &self.path,
            "this program was built without video: extract the frames as PNG or JPEG (docs/vision.md), or build \
             it with `--features video`",
        ))
    }

    /// Gives each frame that is `wanted` by its number, from 0, in the order in which they are shown, until
    /// `each` breaks off. All frames before one are decoded.
    ///
    /// # Errors
    /// [`VisionError`] for another codec, and damaged frames.
    #[cfg(feature = "video")]
    pub fn pictures(
        &self,
        wanted: impl Fn(u32) -> bool,
        each: impl FnMut(u32, Rgb) -> ControlFlow<()>,
    ) -> Result<()> {
        let mut file = File::open(&self.path).map_err(|e| VisionError::io(&self.path, e))?;
        decoding::pictures(&self.track, &mut file, &self.path, wanted, each)
    }
}
