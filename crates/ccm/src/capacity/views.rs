//! The files of a recording's views.
//!
//! Tree of 2020: beside `audio/`, the folders `calib/<sequence>_c1_calib.pickle`,
//! `depth/<sequence>/c1/0000.png`, `rgb/<sequence>/c1/0000.png` (extracted frames; PNG or JPEG) or else
//! the video `rgb/<sequence>_c1.mp4`, `masks/<sequence>/c1/0000.png` and `detections/<sequence>.csv` or `.json`. Flat release:
//! `view1/calib/<id>.pickle`, `view1/depth/<id>/0000.png`, `view1/rgb/<id>/0000.png`,
//! `view1/rgb/<id>.mp4`, `view1/masks/<id>/0000.png`, and `detections/<id>.csv` or `.json`. Calibrations may be `.json`.

use std::path::{Path, PathBuf};
use std::sync::OnceLock;

use corsmal_vision::{Calibration, Camera, Depth, Video};

use super::colours::Colours;
use super::frames::{self, Frame, Kind};
use super::problem::Problem;
use crate::dataset::Recording;

/// Columns and rows of the data set's images.
pub(super) const IMAGE_SIZE: (usize, usize) = (1280, 720);

/// Views of a recording.
pub(super) const VIEWS: std::ops::RangeInclusive<u8> = 1..=4;

/// Where the files of a recording's views are.
#[derive(Clone, Debug)]
pub struct Views {
    /// Folder that holds `audio/`.
    base: PathBuf,
    /// What the recording's files are called.
    stem: String,
    /// Folder of tables of detections, where it is another one.
    detections: Option<PathBuf>,
    /// Its folder among tables of several: the container's number or, where it is not known, the part.
    group: String,
    /// The part, where the container is known: a test part may have had no labels when tables were made.
    part: Option<String>,
    /// Frames by kind and view, once they have been asked for.
    frames: [[Listing; 4]; 3],
    /// The video of each view, once it has been asked for.
    videos: [OnceLock<Result<Option<Video>, Problem>>; 4],
}

/// The frames of a kind and view, listed when they are first asked for.
type Listing = OnceLock<Result<Vec<Frame>, Problem>>;

impl Views {
    /// The views of a recording; `detections` is a folder of tables, with sub-folders by container (by part,
    /// such as `public-test`, where that is not known) or without.
    pub fn of(recording: &Recording, detections: Option<&Path>) -> Self {
        let stem = recording.path.file_stem().unwrap_or_default().to_string_lossy();
        let stem = stem.strip_suffix("_audio").unwrap_or(&stem).to_string();
        let folder = recording.path.parent().unwrap_or(Path::new(""));
        let audio = folder.file_name().is_some_and(|name| name == "audio");
        let base = if audio { folder.parent().unwrap_or(Path::new("")) } else { folder };
        Self {
            base: base.into(),
            stem,
            detections: detections.map(Into::into),
            group: match recording.container {
                Some(container) => container.number().to_string(),
                None => recording.part.slug(),
            },
            part: recording.container.map(|_| recording.part.slug()),
            frames: Default::default(),
            videos: Default::default(),
        }
    }

    /// Where its table of detections is, or will be, among those in a folder.
    pub fn table_in(&self, folder: &Path) -> PathBuf {
        let name = format!("{}.json", self.stem);
        let is_there = |table: &PathBuf| table.is_file() || table.with_extension("csv").is_file();
        let own = folder.join(&self.group).join(&name);
        let of_part = self.part.as_ref().map(|part| folder.join(part).join(&name));
        of_part.filter(|table| is_there(table) && !is_there(&own)).unwrap_or(own)
    }

    /// The colour camera of a view, 1 to 4.
    ///
    /// # Errors
    /// There is no calibration, or it is damaged, or there are different ones.
    pub fn camera(&self, view: u8) -> Result<Camera, Problem> {
        let Self { base, stem, .. } = self;
        let candidates = ["pickle", "json"].into_iter().flat_map(|extension| {
            [
                base.join(format!("calib/{stem}_c{view}_calib.{extension}")),
                base.join(format!("view{view}/calib/{stem}.{extension}")),
            ]
        });
        let mut there = candidates.into_iter().filter(|path| path.is_file());
        let path = there.next().ok_or_else(|| {
            Problem::Missing(format!(
                "no calibration of view {view} (calib/{stem}_c{view}_calib.pickle)"
            ))
        })?;
        let camera = Calibration::load(&path)?.rgb;
        for other in there {
            if !Calibration::load(&other)?.rgb.is_near(&camera) {
                let (path, other) = (path.display(), other.display());
                return Err(Problem::Damaged(format!(
                    "{path} and {other} are different calibrations of the same view: remove one"
                )));
            }
        }
        Ok(camera)
    }

    /// The frames of a view of one kind, in their order; none where there is no folder.
    ///
    /// # Errors
    /// The folder cannot be read, or `view` is not 1 to 4.
    pub fn frames(&self, kind: Kind, view: u8) -> Result<&[Frame], Problem> {
        let list = of_view(&self.frames[kind as usize], view)?;
        match list.get_or_init(|| self.list(kind.folder(), view)) {
            Ok(frames) => Ok(frames),
            Err(problem) => Err(problem.clone()),
        }
    }

    /// The image of a kind that shows a frame of a view.
    pub(super) fn image(&self, kind: Kind, view: u8, frame: u32) -> Result<Option<&Path>, Problem> {
        let frames = self.frames(kind, view)?;
        let at = frames.partition_point(|f| f.number < frame);
        Ok(frames.get(at).filter(|f| f.number == frame).map(|f| f.path.as_path()))
    }

    fn list(&self, kind: &str, view: u8) -> Result<Vec<Frame>, Problem> {
        let Self { base, stem, .. } = self;
        let folders = [
            base.join(format!("{kind}/{stem}/c{view}")),
            base.join(format!("view{view}/{kind}/{stem}")),
        ];
        let found = folders.iter().find(|folder| folder.is_dir());
        found.map_or(Ok(Vec::new()), |folder| frames::list(folder))
    }

    /// The video of a view, where there is one. Its index is read once.
    pub(super) fn video(&self, view: u8) -> Result<Option<&Video>, Problem> {
        let Self { base, stem, .. } = self;
        let open = || {
            let videos = [
                base.join(format!("rgb/{stem}_c{view}.mp4")),
                base.join(format!("view{view}/rgb/{stem}.mp4")),
            ];
            let found = videos.into_iter().find(|path| path.is_file());
            Ok(found.map(|path| Video::open(&path)).transpose()?)
        };
        match of_view(&self.videos, view)?.get_or_init(open) {
            Ok(video) => Ok(video.as_ref()),
            Err(problem) => Err(problem.clone()),
        }
    }

    /// The colour frames of a view: its images or, where there are none, its video.
    ///
    /// # Errors
    /// The folder or the video cannot be read, or `view` is not 1 to 4.
    pub fn colours(&self, view: u8) -> Result<Colours<'_>, Problem> {
        let images = self.frames(Kind::Rgb, view)?;
        match images.is_empty().then(|| self.video(view)).transpose()?.flatten() {
            Some(video) => Ok(Colours::of_video(video)),
            None => Ok(Colours::of_images(images)),
        }
    }

    /// Where its table of detections is, if there is one.
    ///
    /// # Errors
    /// There are two, and nothing says which is right.
    pub(super) fn table(&self) -> Result<Option<PathBuf>, Problem> {
        let own = self.base.join("detections");
        let folder = self.detections.as_ref().unwrap_or(&own);
        let mut folders = vec![vec![folder.clone()]];
        if self.detections.is_some() {
            let groups = std::iter::once(&self.group).chain(&self.part);
            folders.insert(0, groups.map(|group| folder.join(group)).collect());
        }
        for folders in folders {
            let tables = folders.iter().flat_map(|folder| {
                ["csv", "json"].map(|extension| folder.join(format!("{}.{extension}", self.stem)))
            });
            let mut there = tables.filter(|path| path.is_file());
            match (there.next(), there.next()) {
                (Some(one), Some(other)) => {
                    return Err(Problem::Damaged(format!(
                        "{} and {} are tables of the same recording: remove one",
                        one.display(),
                        other.display()
                    )));
                }
                (Some(table), None) => return Ok(Some(table)),
                (None, _) => {}
            }
        }
        Ok(None)
    }

    /// A depth image of a view.
    ///
    /// # Errors
    /// It is not there, damaged, or of another size than the calibrated images.
    pub fn depth(&self, view: u8, frame: u32) -> Result<Depth, Problem> {
        let path = self.image(Kind::Depth, view, frame)?.ok_or_else(|| {
            Problem::Missing(format!("no depth image of view {view}, frame {frame}"))
        })?;
        let depth = Depth::read(path)?;
        check_size((depth.width, depth.height), || path.display().to_string())?;
        Ok(depth)
    }
}

/// What there is of a view, 1 to 4.
fn of_view<T>(all: &[T; 4], view: u8) -> Result<&T, Problem> {
    let place = all.get(usize::from(view.wrapping_sub(1)));
    place.ok_or_else(|| Problem::Missing(format!("no view {view}; views are 1 to 4")))
}

/// Masks and depth images must be as large as what the calibration belongs to: measures on others are as wrong
/// as their scale.
pub(super) fn check_size(size: (usize, usize), what: impl Fn() -> String) -> Result<(), Problem> {
    if size == IMAGE_SIZE {
        return Ok(());
    }
    Err(Problem::Damaged(format!(
        "{}: {} by {} px; the data set's images, which the calibrations belong to, have {} by {} px",
        what(),
        size.0,
        size.1,
        IMAGE_SIZE.0,
        IMAGE_SIZE.1
    )))
}
