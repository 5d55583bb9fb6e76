//! M4's capacity: the box around an object's points from one depth image, times the share of the box
//! that projects onto the object's mask.

use rand::SeedableRng;
use rand_xoshiro::Xoshiro256PlusPlus;
use serde::Serialize;

use crate::calibration::Camera;
use crate::capacity::possible;
use crate::cloud::{self, DepthView};
use crate::detections::Detection;
use crate::error::{Result, VisionError};
use crate::forest::inliers;
use crate::image::Depth;
use crate::mask::Mask;

/// Every how many frames the published program looks.
pub const FRAME_STEP: u32 = 8;
/// Categories that may be the container.
pub const CONTAINERS: [&str; 4] = ["bottle", "wine glass", "cup", "vase"];

/// Distance between the samples of a box, in m.
const GRID: f64 = 0.01;
/// Largest number of samples of a box: one of 2 m has 8 million.
const MAX_SAMPLES: usize = 20_000_000;

/// How outliers among the points are dropped.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Outliers {
    /// As published: four isolation forests, of which the last has no effect.
    Published,
    /// All four have an effect.
    Corrected,
    /// Every point stays.
    Kept,
}

/// A box along the axes of the world.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Cuboid {
    /// Lower corner in m.
    pub low: [f64; 3],
    /// Upper corner in m.
    pub high: [f64; 3],
    /// Share of the samples of the box that project onto the mask.
    pub share: f64,
    /// Volume of the box times that share, in mL.
    pub capacity: f64,
    /// Points that made the box.
    pub points: usize,
}

/// Estimates a capacity from a depth image aligned with the colour camera and a mask.
///
/// The same seed gives the same estimate.
///
/// # Errors
/// [`VisionError::Conflict`] when sizes differ or the camera does not fit the images, [`VisionError::Request`]
/// when no depth lies on the mask, or no container has the capacity.
pub fn cuboid(
    depth: &Depth,
    mask: &Mask,
    camera: &Camera,
    outliers: Outliers,
    seed: u64,
) -> Result<Cuboid> {
    let mut points = cloud::points(&DepthView { depth, mask, camera })?;
    if outliers != Outliers::Kept {
        points = filtered(points, outliers, seed);
    }
    if points.is_empty() {
        return Err(VisionError::Request("the mask has no pixel with depth".into()));
    }
    let [low, high] = [f64::min, f64::max].map(|pick: fn(f64, f64) -> f64| {
        points.iter().skip(1).fold(points[0], |a, p| std::array::from_fn(|i| pick(a[i], p[i])))
    });
    let share = share_on_mask(low, high, mask, camera)?;
    let volume: f64 = (0..3).map(|i| high[i] - low[i]).product();
    let capacity = possible(volume * 1e6 * share)?;
    Ok(Cuboid { low, high, share, capacity, points: points.len() })
}

/// What the forests keep: in space first, then in the planes xy, xz and yz of what is left.
fn filtered(mut points: Vec<[f64; 3]>, outliers: Outliers, seed: u64) -> Vec<[f64; 3]> {
    let mut rng = Xoshiro256PlusPlus::seed_from_u64(seed);
    let single: Vec<[f32; 3]> = points.iter().map(|p| p.map(|v| v as f32)).collect();
    let mut kept = inliers(&single, &mut rng).into_iter();
    points.retain(|_| kept.next().unwrap_or(false));
    let mut keep = vec![true; points.len()];
    // The published program passes the third plane as the place for the result.
    let planes: &[[usize; 2]] = match outliers {
        Outliers::Published => &[[0, 1], [0, 2]],
        _ => &[[0, 1], [0, 2], [1, 2]],
    };
    for plane in planes {
        let flat: Vec<[f32; 2]> = points.iter().map(|p| plane.map(|axis| p[axis] as f32)).collect();
        for (keep, inlier) in keep.iter_mut().zip(inliers(&flat, &mut rng)) {
            *keep &= inlier;
        }
    }
    let mut keep = keep.into_iter();
    points.retain(|_| keep.next().unwrap_or(false));
    points
}

fn share_on_mask(low: [f64; 3], high: [f64; 3], mask: &Mask, camera: &Camera) -> Result<f64> {
    // As numpy's arange: the upper end is left out.
    let counts: [usize; 3] = std::array::from_fn(|i| ((high[i] - low[i]) / GRID).ceil() as usize);
    let total = counts.iter().try_fold(1usize, |n, &count| n.checked_mul(count));
    let total = total.filter(|n| (1..=MAX_SAMPLES).contains(n)).ok_or_else(|| {
        VisionError::Request(format!(
            "a box of {:.2} by {:.2} by {:.2} m; it must have an extent, and at most 20 m³",
            high[0] - low[0],
            high[1] - low[1],
            high[2] - low[2]
        ))
    })?;
    let p = &camera.projection;
    let mut on_mask = 0usize;
    for i in 0..counts[0] {
        for j in 0..counts[1] {
            for k in 0..counts[2] {
                let at = [i, j, k];
                let point: [f64; 3] = std::array::from_fn(|a| low[a] + at[a] as f64 * GRID);
                let row = |r: usize| {
                    p[r][0] * point[0] + p[r][1] * point[1] + p[r][2] * point[2] + p[r][3]
                };
                let depth = row(2);
                let [u, v] = [row(0) / depth, row(1) / depth].map(f64::round_ties_even);
                let inside =
                    u >= 0.0 && v >= 0.0 && u < mask.width as f64 && v < mask.height as f64;
                on_mask += usize::from(inside && mask.data[v as usize * mask.width + u as usize]);
            }
        }
    }
    Ok(on_mask as f64 / total as f64)
}

/// The container that the published program measures: the most confident candidate of the frame with the
/// fewest candidates, the largest such mask among those.
///
/// `detections` are those of one view; `width` is that of the images.
///
/// # Errors
/// A mask is damaged.
pub fn choose(
    detections: &[Detection],
    width: f64,
    size: (usize, usize),
) -> Result<Option<Choice>> {
    let mut frames: Vec<u32> = detections.iter().map(|d| d.frame).collect();
    frames.sort_unstable();
    frames.dedup();
    let mut best: Option<(usize, usize, Choice)> = None;
    for frame in frames.into_iter().filter(|f| f % FRAME_STEP == 0) {
        let mut of_frame: Vec<_> = detections.iter().filter(|d| d.frame == frame).collect();
        // Detectors list by score, tables need not; equals keep their order.
        of_frame.sort_by(|a, b| b.score.total_cmp(&a.score));
        let person = of_frame.iter().find(|d| d.label == "person");
        let centred = person.is_some_and(|p| {
            let centre = (p.bounds[0] + p.bounds[2]) / 2.0;
            (width / 3.0..width / 3.0 * 2.0).contains(&centre)
        });
        if !centred {
            continue;
        }
        let candidates: Vec<&Detection> = of_frame
            .iter()
            .copied()
            .filter(|d| d.bounds[2] > width / 4.0 && d.bounds[0] < width / 4.0 * 3.0)
            .filter(|d| CONTAINERS.contains(&d.label.as_str()))
            .collect();
        let Some(first) = candidates.first() else { continue };
        if best.as_ref().is_some_and(|(count, ..)| candidates.len() > *count) {
            continue;
        }
        let Some(mask) = first.mask(Some(size))? else { continue };
        let area = mask.area();
        let better = best
            .as_ref()
            .is_none_or(|(count, largest, _)| candidates.len() < *count || area > *largest);
        if better {
            best = Some((candidates.len(), area, Choice { frame, mask }));
        }
    }
    Ok(best.map(|(.., choice)| choice))
}

/// A frame and the container in it.
#[derive(Clone, Debug, PartialEq)]
pub struct Choice {
    /// Number of the frame.
    pub frame: u32,
    /// Pixels of the container.
    pub mask: Mask,
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A camera 1 m in front of the origin that looks along y.
    fn camera() -> Camera {
        let k = [[600.0, 0.0, 320.0], [0.0, 600.0, 240.0], [0.0, 0.0, 1.0]];
        let rotation = [[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]];
        Camera::new(k, rotation, [0.0, 0.0, 1.0])
    }

    /// The near half of a sphere of 5 cm radius at the origin.
    fn sphere() -> (Depth, Mask) {
        let mut depth = Depth { width: 640, height: 480, data: vec![0; 640 * 480] };
        let mut mask = Mask::empty(640, 480);
        for (i, mm) in depth.data.iter_mut().enumerate() {
            let x = ((i % 640) as f64 - 320.0) / 600.0;
            let y = ((i / 640) as f64 - 240.0) / 600.0;
            // |d (x, y, 1) - (0, 0, 1)| = 0.05
            let (a, c) = (x * x + y * y + 1.0, 1.0 - 0.0025);
            let root = 1.0 - a * c;
            if root >= 0.0 {
                *mm = ((1.0 - root.sqrt()) / a * 1000.0).round() as u16;
                mask.data[i] = true;
            }
        }
        (depth, mask)
    }

    #[test]
    fn the_near_half_of_a_sphere_makes_half_a_box() {
        let (depth, mask) = sphere();
        let found = cuboid(&depth, &mask, &camera(), Outliers::Kept, 1).unwrap();
        for (value, expected) in
            found.low.iter().chain(&found.high).zip([-0.05, -0.05, -0.05, 0.05, 0.0, 0.05])
        {
            assert!((value - expected).abs() < 0.006, "{found:?}");
        }
        // A sphere covers pi / 4 of the square around it.
        assert!((0.7..0.85).contains(&found.share), "{found:?}");
        let fewer = [Outliers::Published, Outliers::Corrected].map(|o| {
            let same = || cuboid(&depth, &mask, &camera(), o, 1).unwrap();
            assert_eq!(same(), same());
            same().points
        });
        assert!(fewer[1] < fewer[0] && fewer[0] < found.points / 2, "{fewer:?}");
    }

    #[test]
    fn what_cannot_be_measured_has_a_reason() {
        let (depth, mask) = sphere();
        let reason = |d: &Depth, m: &Mask| {
            cuboid(d, m, &camera(), Outliers::Kept, 1).unwrap_err().to_string()
        };
        assert!(reason(&depth, &Mask::empty(2, 2)).contains("must be equal"));
        assert!(reason(&depth, &Mask::empty(640, 480)).contains("no pixel with depth"));
        let mut wide = Depth { data: vec![u16::MAX; 640 * 480], ..depth };
        wide.data[0] = 1;
        let all = Mask { data: vec![true; 640 * 480], ..mask };
        assert!(reason(&wide, &all).contains("at most 20 m³"));
        // Depth in cm, and in tenths of a mm.
        let scaled = |of: fn(u16) -> u16| {
            let data = depth.data.iter().map(|&mm| of(mm)).collect();
            reason(&Depth { data, ..depth.clone() }, &mask)
        };
        for said in [scaled(|mm| mm.div_ceil(10)), scaled(|mm| mm * 10)] {
            assert!(said.contains("impossible for a container"), "{said}");
        }
        // A calibration of half the resolution.
        let k = [[300.0, 0.0, 160.0], [0.0, 300.0, 120.0], [0.0, 0.0, 1.0]];
        let halved = Camera { intrinsic: k, ..camera() };
        let error = cuboid(&depth, &mask, &halved, Outliers::Kept, 1).unwrap_err();
        assert!(matches!(error, VisionError::Conflict(_)), "{error}");
        assert!(error.to_string().contains("images of about 320 by 240 px"), "{error}");
        // A camera whose points leave every room, as single precision cannot hold them.
        let mut far = camera();
        far.translation = [0.0, 0.0, 1e39];
        let (depth, mask) = sphere();
        for outliers in [Outliers::Published, Outliers::Corrected, Outliers::Kept] {
            let error = cuboid(&depth, &mask, &far, outliers, 1).unwrap_err();
            assert!(matches!(error, VisionError::Conflict(_)), "{error}");
            assert!(error.to_string().len() < 120, "{error}");
        }
    }

    #[test]
    fn the_order_of_a_table_does_not_matter() {
        let rows = [
            "0,1,person,0.9,200,0,440,480,",
            // Another person, at the edge.
            "0,1,person,0.6,0,0,20,480,",
            r#"0,1,cup,0.8,200,0,300,9,"{""size"":[1,400],""counts"":[200,4,196]}""#,
            r#"0,1,vase,0.7,200,0,300,9,"{""size"":[1,400],""counts"":[200,1,199]}""#,
        ];
        let chosen = |order: [usize; 4]| {
            let text: Vec<&str> = order.iter().map(|i| rows[*i]).collect();
            let header = "frame,view,label,score,x_min,y_min,x_max,y_max,mask";
            let dir = tempfile::tempdir().unwrap();
            let path = dir.path().join("d.csv");
            std::fs::write(&path, format!("{header}\n{}\n", text.join("\n"))).unwrap();
            let detections = crate::read_detections(&path).unwrap();
            choose(&detections, 640.0, (400, 1)).unwrap().map(|c| c.mask.area())
        };
        assert_eq!(chosen([0, 1, 2, 3]), Some(4));
        assert_eq!(chosen([3, 1, 2, 0]), Some(4));
    }
}
