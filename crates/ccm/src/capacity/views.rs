//! The files of a recording's views.
//!
//! Tree of 2020: beside `audio/`, the folders `calib/<sequence>_c1_calib.pickle`,
//! `depth/<sequence>/c1/0000.png`, `rgb/<sequence>/c1/0000.png` (extracted frames; PNG or JPEG) or else
//! the video `rgb/<sequence>_c1.mp4`, `masks/<sequence>/c1/0000.png` and `detections/<sequence>.csv` or `.json`. Flat release:
//! `view1/calib/<id>.pickle`, `view1/depth/<id>/0000.png`, `view1/rgb/<id>/0000.png`,
//! `view1/rgb/<id>.mp4`, `view1/masks/<id>/0000.png`, and `detections/<id>.csv` or `.json`. Calibrations may be `.json`.

use std::path::{Path, PathBuf};
use std::sync::OnceLock;

use corsmal_vision::{Calibration, Camera, Depth, Detection, Mask, Video, read_detections};

use super::colours::Colours;
use super::frames::{self, Frame, Kind};
use super::problem::Problem;
use crate::dataset::Recording;

/// Columns and rows of the data set's images.
pub(super) const IMAGE_SIZE: (usize, usize) = (1280, 720);

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
                None => recording.part.name().replace(' ', "-"),
            },
            frames: Default::default(),
            videos: Default::default(),
        }
    }

    /// Where its table of detections is among those in a folder.
    pub fn table_in(&self, folder: &Path) -> PathBuf {
        folder.join(&self.group).join(format!("{}.json", self.stem))
    }

    /// The colour camera of a view, 1 to 4.
    ///
    /// # Errors
    /// There is no calibration, or it is damaged.
    pub fn camera(&self, view: u8) -> Result<Camera, Problem> {
        let Self { base, stem, .. } = self;
        let candidates = ["pickle", "json"].into_iter().flat_map(|extension| {
            [
                base.join(format!("calib/{stem}_c{view}_calib.{extension}")),
                base.join(format!("view{view}/calib/{stem}.{extension}")),
            ]
        });
        let path = candidates.into_iter().find(|path| path.is_file()).ok_or_else(|| {
            Problem::Missing(format!(
                "no calibration of view {view} (calib/{stem}_c{view}_calib.pickle)"
            ))
        })?;
        Ok(Calibration::load(&path)?.rgb)
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
    fn image(&self, kind: Kind, view: u8, frame: u32) -> Result<Option<&Path>, Problem> {
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
    pub(super) fn table(&self) -> Option<PathBuf> {
        let own = self.base.join("detections");
        let folder = self.detections.as_ref().unwrap_or(&own);
        let mut folders = vec![folder.clone()];
        if self.detections.is_some() {
            folders.insert(0, folder.join(&self.group));
        }
        let tables = folders.iter().flat_map(|folder| {
            ["csv", "json"].map(|extension| folder.join(format!("{}.{extension}", self.stem)))
        });
        tables.into_iter().find(|path| path.is_file())
    }

    /// What a detector saw in all views; `None` where there is no table.
    ///
    /// # Errors
    /// The table is damaged, or about frames that a video does not have.
    pub fn detections(&self) -> Result<Option<Vec<Detection>>, Problem> {
        let Some(path) = self.table() else { return Ok(None) };
        let detections = read_detections(&path)?;
        self.require_frames(&detections)
            .map_err(|reason| Problem::Damaged(format!("{}: {reason}", path.display())))?;
        Ok(Some(detections))
    }

    /// Whether something says where the object is in a frame of a view, as [`Views::edges`] finds it.
    ///
    /// # Errors
    /// Nothing does.
    pub fn shows(
        &self,
        detections: &[Detection],
        (view, frame): (u8, u32),
        labels: &[&str],
    ) -> Result<(), Problem> {
        match self.image(Kind::Masks, view, frame)? {
            Some(_) => Ok(()),
            None => best(detections, (view, frame), labels, 0.0).map(|_| ()),
        }
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

    /// The object's pixels in a frame: a mask's file, or else the most confident detection among
    /// `labels` with at least `score`.
    ///
    /// # Errors
    /// There is neither, it is damaged, or of another size than the calibrated images.
    pub fn mask(
        &self,
        detections: &[Detection],
        (view, frame): (u8, u32),
        labels: &[&str],
        score: f64,
    ) -> Result<Mask, Problem> {
        if let Some(path) = self.image(Kind::Masks, view, frame)? {
            let mask = Mask::read(path)?;
            check_size((mask.width, mask.height), || path.display().to_string())?;
            return Ok(mask);
        }
        let best = best(detections, (view, frame), labels, score)?;
        let mask = best.mask(Some(IMAGE_SIZE))?.ok_or_else(|| {
            Problem::Missing(format!("view {view}, frame {frame}: the detection has no mask"))
        })?;
        check_size((mask.width, mask.height), || {
            format!("the detection in view {view}, frame {frame}")
        })?;
        Ok(mask)
    }

    /// Edges of the object in a colour image of `size`, first column and row and those after the last: of
    /// its mask, where there is one, else of the detector's box. Where it is, is as [`Views::mask`] finds it.
    ///
    /// # Errors
    /// There is neither, it is damaged, or its mask is of another size.
    pub fn edges(
        &self,
        detections: &[Detection],
        (view, frame): (u8, u32),
        labels: &[&str],
        size: (usize, usize),
    ) -> Result<[usize; 4], Problem> {
        let (mask, boxed) = match self.image(Kind::Masks, view, frame)? {
            Some(path) => (Some(Mask::read(path)?), None),
            None => {
                let best = best(detections, (view, frame), labels, 0.0)?;
                (best.mask(Some(size))?, Some(best.bounds))
            }
        };
        let edges = match (mask, boxed) {
            (Some(mask), _) if (mask.width, mask.height) != size => {
                return Err(Problem::Damaged(format!(
                    "the mask in view {view}, frame {frame}: {} by {} px; its image has {} by {}",
                    mask.width, mask.height, size.0, size.1
                )));
            }
            (Some(mask), _) => mask.bounds(),
            (None, boxed) => boxed.map(|[left, top, right, bottom]| {
                [left.floor(), top.floor(), right.ceil(), bottom.ceil()].map(|v| v as usize)
            }),
        };
        edges.ok_or_else(|| absent(view, frame))
    }

    /// Numbers of the frames in which every one of `views` has a mask or a detection.
    ///
    /// # Errors
    /// A folder cannot be read.
    pub fn seen(&self, detections: &[Detection], views: &[u8]) -> Result<Vec<u32>, Problem> {
        let mut common: Option<Vec<u32>> = None;
        for &view in views {
            let mut numbers: Vec<u32> = detections
                .iter()
                .filter(|d| d.view == view)
                .map(|d| d.frame)
                .chain(self.frames(Kind::Masks, view)?.iter().map(|f| f.number))
                .collect();
            numbers.sort_unstable();
            numbers.dedup();
            common = Some(match common {
                None => numbers,
                Some(mut all) => {
                    all.retain(|n| numbers.binary_search(n).is_ok());
                    all
                }
            });
        }
        Ok(common.unwrap_or_default())
    }
}

/// What there is of a view, 1 to 4.
fn of_view<T>(all: &[T; 4], view: u8) -> Result<&T, Problem> {
    let place = all.get(usize::from(view.wrapping_sub(1)));
    place.ok_or_else(|| Problem::Missing(format!("no view {view}; views are 1 to 4")))
}

/// The most confident detection among `labels` in a frame with at least `score`, of equals the first, as
/// detectors list them.
fn best<'d>(
    detections: &'d [Detection],
    (view, frame): (u8, u32),
    labels: &[&str],
    score: f64,
) -> Result<&'d Detection, Problem> {
    let of_frame = detections
        .iter()
        .filter(|d| d.view == view && d.frame == frame && d.score >= score)
        .filter(|d| labels.contains(&d.label.as_str()));
    let best = of_frame.reduce(|best, d| if d.score > best.score { d } else { best });
    best.ok_or_else(|| absent(view, frame))
}

fn absent(view: u8, frame: u32) -> Problem {
    Problem::Missing(format!("no container in view {view}, frame {frame}"))
}

/// Masks and depth images must be as large as what the calibration belongs to: measures on others are as wrong
/// as their scale.
fn check_size(size: (usize, usize), what: impl Fn() -> String) -> Result<(), Problem> {
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
