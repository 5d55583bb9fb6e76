//! Where an object is: the point that both views see at the middle of their masks.

use linfa_linalg::svd::SVD;
use ndarray::Array2;

use super::{Variant, View};
use crate::calibration::Camera;
use crate::contour;
use crate::error::{Result, VisionError};

/// Cameras that are nearer to each other, in m, measure no distance.
const MIN_BASELINE: f64 = 0.001;
/// Largest distance in px between the middle of a mask and where the centre is seen. The real pair: 0.7, with
/// exchanged views 28; synthetic views with a hand before the container: at most 7.
const MAX_RESIDUAL: f64 = 20.0;

/// The centre of an object.
pub(super) struct Centre {
    /// Its place in m.
    pub(super) point: [f64; 3],
    /// Largest distance in px between the middle of a mask and where the point is seen.
    pub(super) residual: f64,
}

/// Finds the centre of what two masks show.
///
/// # Errors
/// [`VisionError::Conflict`] for masks of another size than the calibrated images and for cameras at one place,
/// [`VisionError::Request`] for a mask without an area and, in the corrected variant, masks that cannot show one
/// object.
pub(super) fn centre(views: [View<'_>; 2], variant: Variant) -> Result<Centre> {
    let mut middles = [[0.0; 2]; 2];
    for (i, view) in views.iter().enumerate() {
        let (number, mask) = (i + 1, view.mask);
        let what = format!("the mask of view {number}");
        view.camera.check_size(&what, mask.width, mask.height)?;
        let border = contour::largest(mask)
            .ok_or_else(|| VisionError::Request(format!("{what} is empty")))?;
        middles[i] =
            border.centroid().ok_or_else(|| VisionError::Request(format!("{what} has no area")))?;
    }
    let cameras = views.map(|view| view.camera);
    let [a, b] = cameras.map(Camera::place);
    if distance(a, b) < MIN_BASELINE {
        return Err(VisionError::Conflict(
            "the cameras of both views are at the same place, from where no size can be measured; give each view its \
             own calibration"
                .into(),
        ));
    }
    let point = triangulate(cameras, middles)
        .ok_or_else(|| VisionError::Request("the two lines of sight do not meet".into()))?;
    let seen = |i: usize| distance(cameras[i].project(point), middles[i]);
    let residual = seen(0).max(seen(1));
    if variant == Variant::Corrected {
        let behind = (0..2).find(|&i| cameras[i].depth(point) <= 0.0);
        let reason = match behind {
            Some(i) => format!("the object would be behind the camera of view {}", i + 1),
            None if residual > MAX_RESIDUAL => format!(
                "the middles of the masks do not meet at one point, by {residual:.0} px (at most {MAX_RESIDUAL:.0} px)"
            ),
            None => return Ok(Centre { point, residual }),
        };
        return Err(VisionError::Request(format!(
            "{reason}; check that both masks show the same object, and that each view has its own calibration"
        )));
    }
    Ok(Centre { point, residual })
}

fn distance<const N: usize>(a: [f64; N], b: [f64; N]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b).powi(2)).sum::<f64>().sqrt()
}

/// The point in m seen at two pixels: least squares on the homogeneous equations of both cameras.
fn triangulate(cameras: [&Camera; 2], pixels: [[f64; 2]; 2]) -> Option<[f64; 3]> {
    let mut equations = Array2::zeros((4, 4));
    for (view, (camera, pixel)) in cameras.iter().zip(pixels).enumerate() {
        for axis in 0..2 {
            for column in 0..4 {
                equations[[2 * view + axis, column]] =
                    pixel[axis] * camera.projection[2][column] - camera.projection[axis][column];
            }
        }
    }
    let (_, values, vectors) = equations.svd(false, true).ok()?;
    let smallest = (0..4).min_by(|&a, &b| values[a].total_cmp(&values[b]))?;
    let v = vectors?.row(smallest).to_owned();
    let point = [v[0] / v[3], v[1] / v[3], v[2] / v[3]];
    point.iter().all(|x| x.is_finite()).then_some(point)
}
