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
/// exchanged views 28.
const MAX_RESIDUAL: f64 = 20.0;
/// Beyond this distance in px the views may be exchanged. 568 pairs of synthetic views: at most 2.1, and for most of
/// those exchanged 3.4 or more.
const SMALL_RESIDUAL: f64 = 2.0;
/// The views count as exchanged where the distance is by this factor smaller the other way around: in none of these pairs,
/// and in 69 % of them exchanged.
const EXCHANGED: f64 = 3.0;

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
    let residual = residual(cameras, middles, point);
    if variant == Variant::Corrected {
        let behind = (0..2).find(|&i| cameras[i].depth(point) <= 0.0);
        let reason = match behind {
            Some(i) => format!("the object would be behind the camera of view {}", i + 1),
            None if residual > MAX_RESIDUAL => format!(
                "the middles of the masks do not meet at one point, by {residual:.0} px (at most {MAX_RESIDUAL:.0} px)"
            ),
            None => match exchanged(cameras, middles, residual) {
                Some(other) => format!(
                    "each mask fits the camera of the other view (to {other:.1} px) better than its own (to \
                     {residual:.1} px): the views seem to be exchanged"
                ),
                None => return Ok(Centre { point, residual }),
            },
        };
        return Err(VisionError::Request(format!(
            "{reason}; check that both masks show the same object, and that each view has its own calibration"
        )));
    }
    Ok(Centre { point, residual })
}

/// Largest distance in px between the middle of a mask and where a point is seen.
fn residual(cameras: [&Camera; 2], middles: [[f64; 2]; 2], point: [f64; 3]) -> f64 {
    let seen = |i: usize| distance(cameras[i].project(point), middles[i]);
    seen(0).max(seen(1))
}

/// The residual with exchanged views, where that is much smaller than `as_given`.
fn exchanged(cameras: [&Camera; 2], middles: [[f64; 2]; 2], as_given: f64) -> Option<f64> {
    if as_given <= SMALL_RESIDUAL {
        return None;
    }
    let swapped = [middles[1], middles[0]];
    let other = residual(cameras, swapped, triangulate(cameras, swapped)?);
    (other * EXCHANGED < as_given).then_some(other)
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mask::Mask;

    /// A camera 1 m from the origin, looking down by `down` degrees.
    fn camera(around: f64, down: f64) -> Camera {
        let (s, c) = around.sin_cos();
        let (ts, tc) = down.to_radians().sin_cos();
        let rotation = [[-s, c, 0.0], [c * ts, s * ts, -tc], [-c * tc, -s * tc, -ts]];
        let k = [[900.0, 0.0, 320.0], [0.0, 900.0, 240.0], [0.0, 0.0, 1.0]];
        Camera::new(k, rotation, [0.0, 0.12, 1.0])
    }

    /// A square around where a camera sees a point.
    fn square(camera: &Camera, point: [f64; 3]) -> Mask {
        let [x, y] = camera.project(point).map(|p| p.round() as usize);
        let mut mask = Mask::empty(640, 480);
        for row in y - 5..=y + 5 {
            mask.data[row * 640 + x - 5..=row * 640 + x + 5].fill(true);
        }
        mask
    }

    #[test]
    fn exchanged_views_are_no_object() {
        let cameras = [camera(0.3, 20.0), camera(1.9, 20.8)];
        let masks = [0, 1].map(|i| square(&cameras[i], [0.02, 0.01, 0.05]));
        let views = |exchanged: bool| {
            [0, 1].map(|i| View {
                mask: &masks[if exchanged { 1 - i } else { i }],
                camera: &cameras[i],
            })
        };
        assert!(centre(views(false), Variant::Corrected).unwrap().residual < 1.0);
        let error = centre(views(true), Variant::Corrected).err().unwrap().to_string();
        assert!(error.contains("the views seem to be exchanged; check"), "{error}");
        let measured = centre(views(true), Variant::Published).unwrap();
        assert!((SMALL_RESIDUAL..MAX_RESIDUAL).contains(&measured.residual));
    }
}
