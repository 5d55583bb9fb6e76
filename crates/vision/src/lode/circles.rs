//! Circles around the vertical axis through an object's centre, and whether they lie on its masks.

use super::{ANGLES, HEIGHTS, RADII, Variant, View};
use crate::error::{Result, VisionError};

/// Projections of circles around a centre: a pixel is `(a + radius * b) / (c + radius * d)`.
struct Circles {
    /// Cosine and sine of the angles.
    turns: [(f64, f64); ANGLES.count],
    centre: [f64; 3],
}

/// Width in mm, and numbers of height and radius of the accepted circles.
pub(super) type Profile = (f64, Vec<(usize, usize)>);

/// The largest circle on both masks at every height.
pub(super) fn profile(views: [View<'_>; 2], centre: [f64; 3], variant: Variant) -> Result<Profile> {
    let circles = Circles {
        turns: std::array::from_fn(|i| {
            let angle = ANGLES.get(i).to_radians();
            (angle.cos(), angle.sin())
        }),
        centre,
    };
    let mut widest = 0.0f64;
    let mut accepted = Vec::new();
    for h in 0..HEIGHTS.count {
        let mut radius = RADII.count - 1;
        for r in 0..RADII.count {
            let mut inside = true;
            for view in &views {
                match circles.seen(view, RADII.get(r), HEIGHTS.get(h), variant) {
                    Seen::Inside => {}
                    Seen::Partly => inside = false,
                    Seen::Beyond => {
                        return Err(VisionError::Request(format!(
                            "a circle of {:.1} mm at height {:.0} mm reaches beyond an image, where the published program stops",
                            RADII.get(r) * 1000.0,
                            HEIGHTS.get(h) * 1000.0
                        )));
                    }
                }
                // The published program looks at both images before it decides.
                if !inside && variant == Variant::Corrected {
                    break;
                }
            }
            if inside {
                accepted.push((h, r));
                radius = r;
                break;
            }
        }
        widest = widest.max(RADII.get(radius) * 2.0 * 1000.0);
    }
    if variant == Variant::Corrected {
        widest = accepted.iter().map(|&(_, r)| RADII.get(r) * 2000.0).fold(0.0, f64::max);
    }
    Ok((widest, accepted))
}

/// Where the points of a circle lie.
#[derive(PartialEq)]
enum Seen {
    Inside,
    Partly,
    Beyond,
}

impl Circles {
    fn seen(&self, view: &View<'_>, radius: f64, height: f64, variant: Variant) -> Seen {
        let (width, rows) = (view.mask.width as i64, view.mask.height as i64);
        let mut seen = Seen::Inside;
        for &(cos, sin) in &self.turns {
            let point = [self.centre[0] + radius * cos, self.centre[1] + radius * sin, height];
            let pixel = view.camera.project(point);
            let [x, y] = match variant {
                // Truncated towards zero and wrapped, as numpy does.
                Variant::Published => {
                    let [x, y] = pixel.map(|v| v as i64);
                    [x + if x < 0 { width } else { 0 }, y + if y < 0 { rows } else { 0 }]
                }
                Variant::Corrected => pixel.map(|v| v.floor() as i64),
            };
            let in_image = (0..width).contains(&x) && (0..rows).contains(&y);
            if !in_image && variant == Variant::Published {
                return Seen::Beyond;
            }
            if !in_image || !view.mask.data[(y * width + x) as usize] {
                if variant == Variant::Corrected {
                    return Seen::Partly;
                }
                seen = Seen::Partly;
            }
        }
        seen
    }
}
