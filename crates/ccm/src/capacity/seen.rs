//! What is seen of the object in a recording's views: a detector's table, masks, and in which frames.

use corsmal_vision::{Detection, Mask, read_detections};

use super::frames::{Frame, Kind};
use super::problem::Problem;
use super::views::{IMAGE_SIZE, VIEWS, Views, check_size};

impl Views {
    /// What a detector saw in all views; `None` where there is no table.
    ///
    /// # Errors
    /// The table is damaged, or about frames that a video does not have.
    pub fn detections(&self) -> Result<Option<Vec<Detection>>, Problem> {
        let Some(path) = self.table()? else { return Ok(None) };
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
