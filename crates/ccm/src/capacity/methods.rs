//! The methods: what each makes of a recording's views.

use std::collections::BTreeMap;

use corsmal_vision::category::{self, Vote};
use corsmal_vision::cloud::{self, DepthView};
use corsmal_vision::cuboid::{self, Outliers};
use corsmal_vision::lode::{self, Variant, View};
use corsmal_vision::region::{self, Region};
use corsmal_vision::{Camera, Depth, Detection, Mask};

use super::frames::Kind;
use super::problem::Problem;
use super::views::{IMAGE_SIZE, Views};

/// Labels that M5 takes for a container.
const M5_LABELS: [&str; 5] = ["bottle", "wine glass", "cup", "book", "vase"];
/// Smallest score of a detection that M5 uses.
const M5_SCORE: f64 = 0.5;
/// M5's second frame, counted from the end.
pub const M5_FROM_END: usize = 20;
/// Labels of containers in any method of ours.
const LABELS: [&str; 10] = [
    "bottle",
    "wine glass",
    "cup",
    "book",
    "vase",
    "bowl",
    "suitcase",
    "glass",
    "box",
    "container",
];

/// What a method found.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Estimate {
    /// Capacity in mL.
    pub capacity: f64,
    /// Lower and upper end of the uncertainty in mL.
    pub band: Option<[f64; 2]>,
    /// Frames that the estimate rests on.
    pub frames: usize,
    /// Sizes in mm, from the profile of LoDE.
    pub sizes: Option<Sizes>,
    /// Why it is a substitute, where it is one.
    pub substitute: Option<String>,
}

/// Sizes in mm.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sizes {
    /// Largest width.
    pub width: f64,
    /// Width near the top.
    pub width_top: f64,
    /// Width near the bottom.
    pub width_bottom: f64,
    /// Height.
    pub height: f64,
}

/// Kind of container that the detections of all views vote for.
pub(super) fn vote(detections: &[Detection], seed: u64) -> Result<Vote, Problem> {
    category::vote(detections, category::SHARE, seed)
        .ok_or_else(|| Problem::Missing("no container in any view".into()))
}

/// The detections of a recording; none where it has no table but masks.
pub(super) fn table(views: &Views) -> Result<Vec<Detection>, Problem> {
    Ok(views.detections()?.unwrap_or_default())
}

/// M5: LoDE on the first frame and the 20th from the end, or the last where there are fewer.
pub(super) fn m5(
    views: &Views,
    detections: &[Detection],
    variant: Variant,
) -> Result<Estimate, Problem> {
    let (found, mut problems) = lode_frames(views, detections, variant)?;
    // Damage is a failure; a container that is not seen gets the prior, as published.
    if let Some(damaged) = problems.iter().find(|p| matches!(p, Problem::Damaged(_))) {
        return Err(damaged.clone());
    }
    let capacity = |i: usize| found.get(i).map(|f: &Lode| f.dimensions.capacity);
    let Some(combined) = lode::combine(capacity(0), capacity(1)) else {
        let reason = match problems.pop() {
            Some(Problem::Missing(reason)) => reason,
            _ => "no frame with both views".into(),
        };
        let substitute = Some(format!("prior: {reason}"));
        return Ok(Estimate { capacity: lode::PRIOR_ML, substitute, ..Estimate::default() });
    };
    let n = found.len() as f64;
    let bands: Option<Vec<[f64; 2]>> =
        found.iter().map(|f| Some([f.band.low?, f.band.high?])).collect();
    let band = bands.map(|b| [0, 1].map(|end| b.iter().map(|x| x[end]).sum::<f64>() / n));
    Ok(Estimate {
        capacity: combined,
        band,
        frames: found.len(),
        sizes: Some(sizes(&found)),
        substitute: None,
    })
}

struct Lode {
    dimensions: lode::Dimensions,
    band: lode::Band,
}

/// LoDE on M5's two frames: those with an estimate, and what the others lack.
fn lode_frames(
    views: &Views,
    detections: &[Detection],
    variant: Variant,
) -> Result<(Vec<Lode>, Vec<Problem>), Problem> {
    let cameras = [views.camera(1)?, views.camera(2)?];
    let Some((first, late)) = views.ends(detections, M5_FROM_END)? else {
        return Ok((vec![], vec![Problem::Missing("no frame with both side views".into())]));
    };
    let mut wanted = vec![first];
    wanted.extend(Some(late).filter(|n| *n != first));
    let (mut found, mut problems) = (Vec::new(), Vec::new());
    for frame in wanted {
        let estimate = || -> Result<Lode, Problem> {
            let mask = |view| views.mask(detections, (view, frame), &M5_LABELS, M5_SCORE);
            let masks = [mask(1)?, mask(2)?];
            let pair = [0, 1].map(|i| View { mask: &masks[i], camera: &cameras[i] });
            let dimensions = lode::dimensions(pair, variant)?;
            Ok(Lode { dimensions, band: lode::band(pair, variant) })
        };
        match estimate() {
            Ok(lode) => found.push(lode),
            Err(problem) => problems.push(problem),
        }
    }
    Ok((found, problems))
}

/// Mean sizes over frames.
fn sizes(found: &[Lode]) -> Sizes {
    let n = found.len() as f64;
    let mean = |value: &dyn Fn(&Lode) -> f64| found.iter().map(value).sum::<f64>() / n;
    let ends = |f: &Lode| f.dimensions.end_widths();
    Sizes {
        width: mean(&|f| f.dimensions.width),
        width_top: mean(&|f| ends(f)[1]),
        width_bottom: mean(&|f| ends(f)[0]),
        height: mean(&|f| f.dimensions.height),
    }
}

/// M4: the cuboid of the first view.
pub(super) fn m4(
    views: &Views,
    detections: &[Detection],
    outliers: Outliers,
    seed: u64,
) -> Result<Estimate, Problem> {
    let camera = views.camera(1)?;
    if views.frames(Kind::Depth, 1)?.is_empty() {
        return Err(Problem::Missing("no depth image of view 1".into()));
    }
    let of_view: Vec<Detection> = detections.iter().filter(|d| d.view == 1).cloned().collect();
    let choice = cuboid::choose(&of_view, IMAGE_SIZE.0 as f64, IMAGE_SIZE)?.ok_or_else(|| {
        Problem::Missing(format!(
            "view 1 has no frame (every {}th) with a person in the middle third and a container",
            cuboid::FRAME_STEP
        ))
    })?;
    let depth = views.depth(1, choice.frame)?;
    let found = cuboid::cuboid(&depth, &choice.mask, &camera, outliers, seed)?;
    Ok(Estimate { capacity: found.capacity, frames: 1, ..Estimate::default() })
}

/// M2's network, published weights and all.
pub trait RegionNetwork: std::fmt::Debug + Send + Sync {
    /// Capacity in mL of the container in a region of interest.
    ///
    /// # Errors
    /// A text when the network cannot be run.
    fn capacity_ml(&self, region: &Region) -> Result<f64, String>;

    /// What tells its weights from others, such as a hash.
    fn identity(&self) -> &str;
}

/// M2: its network on the region of interest.
pub(super) fn m2(
    views: &Views,
    network: &dyn RegionNetwork,
    variant: Variant,
) -> Result<Estimate, Problem> {
    let region = m2_region(views, variant)?;
    let capacity = network.capacity_ml(&region).map_err(Problem::Damaged)?;
    Ok(Estimate { capacity, frames: 1, ..Estimate::default() })
}

/// The region of interest of the last depth image of view 3 that has one.
pub(super) fn m2_region(views: &Views, variant: Variant) -> Result<Region, Problem> {
    let frames = views.frames(Kind::Depth, 3)?;
    // The published program never looks at the first image of a short video.
    let first = match (variant, frames.len()) {
        (Variant::Published, 1..region::FRAMES) => 1,
        (_, count) => count.saturating_sub(region::FRAMES),
    };
    for frame in frames[first..].iter().rev() {
        if let Some(region) = region::region(&views.depth(3, frame.number)?) {
            return Ok(region);
        }
    }
    let looked = frames.len() - first;
    Err(Problem::Missing(match looked {
        0 if !frames.is_empty() => {
            "only one depth image of view 3, which the published program skips".into()
        }
        0 => "no depth image of view 3".into(),
        n => format!("no object is near and large enough in the last {n} depth images of view 3"),
    }))
}

/// Inputs of M3's Gaussian processes: the logarithms of width and height in the four views.
pub(super) fn region_sizes(vote: &Vote) -> Vec<Option<f64>> {
    vote.sizes.iter().flat_map(|size| [size.map(|s| s[0]), size.map(|s| s[1])]).collect()
}

/// What the methods find that need no training.
#[derive(Debug, Default)]
pub(super) struct Geometry {
    /// Capacities in mL by method.
    pub(super) estimates: BTreeMap<String, f64>,
    /// Sizes from LoDE.
    pub(super) sizes: Option<Sizes>,
    /// How many frames each used.
    pub(super) frames: BTreeMap<String, usize>,
}

/// All estimates of the methods that need no training.
pub(super) fn geometry(
    views: &Views,
    detections: &[Detection],
    seed: u64,
) -> Result<Geometry, Problem> {
    let mut estimates = BTreeMap::new();
    let mut measured = None;
    let mut frames = BTreeMap::new();
    // What one method lacks another may not need; damage is a failure of the recording.
    let missing = |problem: Problem| match problem {
        Problem::Missing(_) => Ok(()),
        damaged => Err(damaged),
    };
    match lode_frames(views, detections, Variant::Corrected) {
        Ok((found, problems)) => {
            problems.into_iter().try_for_each(missing)?;
            if !found.is_empty() {
                let mean = |value: &dyn Fn(&lode::Dimensions) -> f64| {
                    let logs = found.iter().map(|f| value(&f.dimensions).max(1.0).ln());
                    (logs.sum::<f64>() / found.len() as f64).exp()
                };
                estimates.insert("lode".into(), mean(&|d| d.capacity));
                estimates.insert("profile".into(), mean(&lode::Dimensions::bowl_capacity));
                measured = Some(sizes(&found));
                frames.extend(["lode", "profile"].map(|name| (name.into(), found.len())));
            }
        }
        Err(problem) => missing(problem)?,
    }
    match m4(views, detections, Outliers::Kept, seed) {
        Ok(found) => {
            estimates.insert("cuboid".into(), found.capacity);
            frames.insert("cuboid".into(), found.frames);
        }
        Err(problem) => missing(problem)?,
    }
    match upright(views, detections) {
        Ok((volume, used)) => {
            estimates.insert("upright".into(), volume);
            frames.insert("upright".into(), used);
        }
        Err(problem) => missing(problem)?,
    }
    Ok(Geometry { estimates, sizes: measured, frames })
}

/// Frames with depth images that are searched for depth of the object.
const LOOKED: usize = 10;

/// Volume of the upright box around the depth of the side views, over the first frames that have it.
fn upright(views: &Views, detections: &[Detection]) -> Result<(f64, usize), Problem> {
    const FRAMES: usize = 2;
    let (mut logs, mut looked) = (Vec::new(), 0);
    for frame in views.seen(detections, &[1, 2])? {
        // One side alone says little about depth. A mask is found at once, a depth image takes 60 ms.
        let parts = || -> Result<Vec<(Depth, Mask, Camera)>, Problem> {
            let mask = |view| views.mask(detections, (view, frame), &LABELS, 0.0);
            let masks = [(1, mask(1)?), (2, mask(2)?)];
            let part = |(view, mask)| Ok((views.depth(view, frame)?, mask, views.camera(view)?));
            masks.into_iter().map(part).collect()
        };
        let parts = match parts() {
            Ok(parts) => parts,
            Err(Problem::Missing(_)) => continue,
            Err(damaged) => return Err(damaged),
        };
        let of: Vec<DepthView<'_>> =
            parts.iter().map(|(depth, mask, camera)| DepthView { depth, mask, camera }).collect();
        match cloud::upright_box(&of).map_err(Problem::from) {
            Ok(found) => logs.push(found.volume.max(1.0).ln()),
            // Depth cameras lose glass in single frames.
            Err(Problem::Missing(_)) => {}
            Err(damaged) => return Err(damaged),
        }
        looked += 1;
        if logs.len() == FRAMES || looked == LOOKED {
            break;
        }
    }
    let n = logs.len();
    if n == 0 {
        return Err(Problem::Missing("no frame with depth and mask in both side views".into()));
    }
    Ok(((logs.iter().sum::<f64>() / n as f64).exp(), n))
}
