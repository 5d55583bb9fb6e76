//! The upright box around an object's points from the depth images of several views (beyond the paper).
//!
//! One view sees one side of an object, two or three nearly all of its outline. The box stands upright
//! and is turned so that its ground plan is smallest; stray points are left out by percentiles.

use serde::Serialize;

use crate::calibration::{Camera, MAX_DISTANCE};
use crate::capacity::possible;
use crate::error::{Result, VisionError};
use crate::image::Depth;
use crate::mask::Mask;

/// Share of the points that may lie beyond each face.
const STRAY: f64 = 0.01;
/// Points beyond this number are thinned out evenly.
const MAX_POINTS: usize = 6000;
/// Directions that are tried over a right angle.
const DIRECTIONS: usize = 45;
/// Fewer points are no object.
const MIN_POINTS: usize = 50;

/// What one view gives: a depth image aligned with the colour camera, and the object's pixels.
#[derive(Clone, Copy, Debug)]
pub struct DepthView<'a> {
    /// Depth in mm.
    pub depth: &'a Depth,
    /// Pixels of the object.
    pub mask: &'a Mask,
    /// Colour camera.
    pub camera: &'a Camera,
}

/// An upright box.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct UprightBox {
    /// Longer and shorter side of the ground plan, and height, in m.
    pub sides: [f64; 3],
    /// Its volume in mL.
    pub volume: f64,
    /// Points that made it.
    pub points: usize,
}

/// Points of the world, in m, of the pixels on the mask that have a depth.
pub(crate) fn points(view: &DepthView<'_>) -> Result<Vec<[f64; 3]>> {
    let DepthView { depth, mask, camera } = view;
    if (depth.width, depth.height) != (mask.width, mask.height) {
        return Err(VisionError::Conflict(format!(
            "a depth image of {} by {} px and a mask of {} by {}; they must be equal",
            depth.width, depth.height, mask.width, mask.height
        )));
    }
    camera.check_size("the depth image", depth.width, depth.height)?;
    let back = camera
        .back_projection()
        .ok_or_else(|| VisionError::Conflict("the camera matrix cannot be inverted".into()))?;
    let pixels = depth.data.iter().zip(&mask.data).enumerate();
    let points = pixels.filter(|(_, (mm, inside))| **inside && **mm > 0).map(|(i, (&mm, _))| {
        let (column, row) = ((i % depth.width) as f64, (i / depth.width) as f64);
        back.point(column, row, f64::from(mm) / 1000.0)
    });
    let points: Vec<[f64; 3]> = points.collect();
    if !points.iter().flatten().all(|v| v.abs() <= MAX_DISTANCE) {
        return Err(VisionError::Conflict(format!(
            "a point more than {MAX_DISTANCE} m from the world's origin: the calibration does not fit this \
             depth image"
        )));
    }
    Ok(points)
}

/// The upright box around the points of all views.
///
/// # Errors
/// [`VisionError::Conflict`] when sizes differ or a camera does not fit its images, [`VisionError::Request`] when
/// hardly any depth lies on the masks, or no container has the volume.
pub fn upright_box(views: &[DepthView<'_>]) -> Result<UprightBox> {
    let mut cloud = Vec::new();
    for view in views {
        // Edges mix the object with what is after it.
        let mask = view.mask.eroded();
        cloud.extend(points(&DepthView { mask: &mask, ..*view })?);
    }
    if cloud.len() < MIN_POINTS {
        return Err(VisionError::Request(format!(
            "{} points with a depth on the masks; at least {MIN_POINTS} make a box",
            cloud.len()
        )));
    }
    let step = cloud.len().div_ceil(MAX_POINTS);
    let thinned: Vec<[f64; 3]> = cloud.into_iter().step_by(step).collect();
    let height = extent(thinned.iter().map(|p| p[2]));
    let plans = (0..DIRECTIONS).map(|i| {
        let angle = std::f64::consts::FRAC_PI_2 * i as f64 / DIRECTIONS as f64;
        let (sin, cos) = angle.sin_cos();
        [
            extent(thinned.iter().map(|p| cos * p[0] + sin * p[1])),
            extent(thinned.iter().map(|p| cos * p[1] - sin * p[0])),
        ]
    });
    let [a, b] = plans.min_by(|a, b| (a[0] * a[1]).total_cmp(&(b[0] * b[1]))).unwrap_or_default();
    let sides = [a.max(b), a.min(b), height];
    let volume = possible(a * b * height * 1e6)?;
    Ok(UprightBox { sides, volume, points: thinned.len() })
}

/// Length between the percentiles of stray points.
fn extent(values: impl Iterator<Item = f64>) -> f64 {
    let mut values: Vec<f64> = values.collect();
    let stray = (values.len() as f64 * STRAY) as usize;
    let (_, low, _) = values.select_nth_unstable_by(stray, f64::total_cmp);
    let low = *low;
    let last = values.len() - 1 - stray;
    let (_, high, _) = values.select_nth_unstable_by(last, f64::total_cmp);
    *high - low
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two cameras that see the corner of a box of 0.2 by 0.1 by 0.1 m, turned by 30 degrees: each the
    /// half of its sides that face it, as depth images of single points.
    #[test]
    fn a_turned_box_is_measured_from_two_sides() {
        let camera = |around: f64| {
            let (s, c) = around.sin_cos();
            let rotation = [[-s, c, 0.0], [0.0, 0.0, -1.0], [-c, -s, 0.0]];
            let k = [[900.0, 0.0, 200.0], [0.0, 900.0, 150.0], [0.0, 0.0, 1.0]];
            Camera::new(k, rotation, [0.0, 0.05, 1.0])
        };
        let (sin, cos) = 30f64.to_radians().sin_cos();
        let views: Vec<(Depth, Mask, Camera)> = [-0.4, 1.4]
            .map(|around| {
                let camera = camera(around);
                let mut depth = Depth { width: 400, height: 300, data: vec![0; 400 * 300] };
                let mut mask = Mask::empty(400, 300);
                for i in 0..=400 {
                    for j in 0..=200 {
                        let (u, z) = (f64::from(i) / 400.0 - 0.5, f64::from(j) / 2000.0);
                        let faces =
                            [[0.2 * u, -0.05], [0.2 * u, 0.05], [-0.1, 0.1 * u], [0.1, 0.1 * u]];
                        for [x, y] in faces {
                            let p = [cos * x - sin * y, sin * x + cos * y, z];
                            let [px, py] = camera.project(p);
                            let row = camera.projection[2];
                            let d = row[0] * p[0] + row[1] * p[1] + row[2] * p[2] + row[3];
                            let at = py.round() as usize * 400 + px.round() as usize;
                            let mm = (d * 1000.0).round() as u16;
                            mask.data[at] = true;
                            if depth.data[at] == 0 || mm < depth.data[at] {
                                depth.data[at] = mm;
                            }
                        }
                    }
                }
                (depth, mask.closed(2), camera)
            })
            .into();
        let view = |i: usize| {
            let (depth, mask, camera) = &views[i];
            DepthView { depth, mask, camera }
        };
        let found = upright_box(&[view(0), view(1)]).unwrap();
        for (side, expected) in found.sides.iter().zip([0.2, 0.1, 0.1]) {
            assert!((side - expected).abs() < 0.012, "{found:?}");
        }
        assert!((found.volume / 2000.0 - 1.0).abs() < 0.12, "{found:?}");
        let empty = Mask::empty(400, 300);
        let none = DepthView { mask: &empty, ..view(0) };
        assert!(upright_box(&[none]).unwrap_err().to_string().contains("0 points"));
        let mut halved = views[0].2.clone();
        halved.intrinsic = [[450.0, 0.0, 100.0], [0.0, 450.0, 75.0], [0.0, 0.0, 1.0]];
        let error = upright_box(&[DepthView { camera: &halved, ..view(0) }]).unwrap_err();
        assert!(matches!(error, VisionError::Conflict(_)), "{error}");
        assert!(error.to_string().contains("depth image has 400 by 300 px"), "{error}");
        // In tenths of a metre.
        let mut coarse = views[0].0.clone();
        coarse.data.iter_mut().for_each(|mm| *mm = mm.div_ceil(100));
        let error = upright_box(&[DepthView { depth: &coarse, ..view(0) }]).unwrap_err();
        assert!(error.to_string().contains("impossible for a container"), "{error}");
    }
}
