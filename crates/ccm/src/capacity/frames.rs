//! The images of a view, one for each frame.

use std::path::{Path, PathBuf};

use super::problem::Problem;

/// Frames that are listed of one view at most.
const MAX_FRAMES: usize = 100_000;

/// Kinds of images of a view.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// Depth in mm.
    Depth,
    /// Colour.
    Rgb,
    /// Which pixels show the container.
    Masks,
}

impl Kind {
    /// Name of its folder.
    pub(super) fn folder(self) -> &'static str {
        match self {
            Self::Depth => "depth",
            Self::Rgb => "rgb",
            Self::Masks => "masks",
        }
    }
}

/// A frame of a view.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Frame {
    /// Its number in the video, from 0.
    pub number: u32,
    /// The image.
    pub path: PathBuf,
}

/// The frames in a folder, in their order.
pub(super) fn list(folder: &Path) -> Result<Vec<Frame>, Problem> {
    let unreadable = |e| Problem::Damaged(format!("{}: {e}", folder.display()));
    let mut frames = Vec::new();
    for entry in std::fs::read_dir(folder).map_err(unreadable)? {
        let path = entry.map_err(unreadable)?.path();
        let extension = path.extension().map(|e| e.to_string_lossy().to_lowercase());
        let image = matches!(extension.as_deref(), Some("png" | "jpg" | "jpeg"));
        let number = path.file_stem().and_then(|s| s.to_string_lossy().parse().ok());
        if let (true, Some(number)) = (image, number) {
            frames.push(Frame { number, path });
        }
        if frames.len() > MAX_FRAMES {
            let folder = folder.display();
            return Err(Problem::Damaged(format!("{folder}: more than {MAX_FRAMES} frames")));
        }
    }
    frames.sort_by(|a, b| (a.number, &a.path).cmp(&(b.number, &b.path)));
    match frames.windows(2).find(|pair| pair[0].number == pair[1].number) {
        None => Ok(frames),
        Some(pair) => {
            let [one, other] = [&pair[0], &pair[1]].map(|frame| frame.path.display());
            Err(Problem::Damaged(format!("{one} and {other} are images of the same frame")))
        }
    }
}
