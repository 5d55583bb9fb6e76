//! M5's capacity: localisation and dimensions of an object from masks in two views (LoDE).
//!
//! A circle around the vertical axis through the object's centre, at a height, belongs to the object
//! where its projections lie on the masks of both views. The largest such circle at every height is
//! the profile of the object.

mod centre;
mod circles;

use std::f64::consts::PI;

use serde::Serialize;

use crate::calibration::Camera;
use crate::capacity::possible;
use crate::error::{Result, VisionError};
use crate::mask::Mask;

/// Radii that are tried, in m, from the first to the last.
pub const RADII: Grid = Grid { first: 0.075, last: 0.0025, count: 145 };
/// Heights that are tried, in m above the world's origin.
pub const HEIGHTS: Grid = Grid { first: -0.1, last: 0.4, count: 500 };
/// Angles of the points on a circle, in degrees; the last is almost the first again.
pub const ANGLES: Grid = Grid { first: 0.0, last: 359.0, count: 19 };

/// Evenly spaced values, as numpy's `linspace` makes them.
#[derive(Clone, Copy, Debug)]
pub struct Grid {
    /// First value.
    pub first: f64,
    /// Last value.
    pub last: f64,
    /// How many.
    pub count: usize,
}

impl Grid {
    /// Distance between neighbours.
    pub fn step(&self) -> f64 {
        (self.last - self.first) / (self.count - 1) as f64
    }

    /// The value with a number from 0.
    pub fn get(&self, i: usize) -> f64 {
        if i + 1 == self.count { self.last } else { i as f64 * self.step() + self.first }
    }
}

/// Share of the circles that may have the largest radius. Boxes in synthetic views, wider than that: 0.78.
const MAX_WIDEST: f64 = 0.9;

/// How faithfully the published program is followed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Variant {
    /// As published: indices left of or above an image wrap to its other side, a circle that
    /// reaches beyond the other sides ends the estimate, gaps in the profile count as height.
    Published,
    /// Pixels outside an image are not on the mask; only heights that belong to the object count. No
    /// estimate where the masks cannot show one object, or it reaches the ends of the search.
    Corrected,
}

/// The size of an object.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Dimensions {
    /// Centre in m, in the coordinates of the world.
    pub centre: [f64; 3],
    /// Height in mm.
    pub height: f64,
    /// Largest width in mm.
    pub width: f64,
    /// Capacity in mL.
    pub capacity: f64,
    /// Height above the world's origin and radius of every accepted circle, in m, from below.
    pub profile: Vec<[f64; 2]>,
    /// Largest distance in px between the middle of a mask and where the centre is seen.
    pub residual: f64,
}

impl Dimensions {
    /// Widths in mm at a tenth of the height from the bottom and from the top: at the very ends the
    /// circles of this method shrink.
    pub fn end_widths(&self) -> [f64; 2] {
        let width = |share: f64| {
            let at = (self.profile.len().saturating_sub(1)) as f64 * share;
            self.profile.get(at.round() as usize).map_or(0.0, |p| p[1] * 2000.0)
        };
        [width(0.1), width(0.9)]
    }

    /// Volume in mL of the circles' slices above a stem, where there is one: the narrowest place in the
    /// middle of the object, narrower than two fifths of the widest (beyond the paper).
    pub fn bowl_capacity(&self) -> f64 {
        let n = self.profile.len();
        let widest = self.profile.iter().map(|p| p[1]).fold(0.0, f64::max);
        let middle = self.profile.iter().enumerate().skip(n / 7).take(n - 2 * (n / 7));
        // The last of equals: a stem is straight.
        let narrowest = middle.min_by(|(i, a), (j, b)| a[1].total_cmp(&b[1]).then(j.cmp(i)));
        let from = narrowest.filter(|(_, p)| p[1] < 0.4 * widest).map_or(0, |(i, _)| i);
        let slices = self.profile[from..].iter().map(|p| PI * p[1] * p[1]);
        slices.sum::<f64>() * HEIGHTS.step() * 1e6
    }
}

/// Capacity and what one pixel more or less on both masks makes of it, in mL.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Band {
    /// With masks eroded by a pixel; `None` where there is no estimate.
    pub low: Option<f64>,
    /// With masks dilated by a pixel.
    pub high: Option<f64>,
}

/// M5's estimate where there is none: close to the mean capacity of the training containers, in mL.
pub const PRIOR_ML: f64 = 734.94;

/// M5's estimate of a recording from its first frame and the 20th from the end: their mean, the one
/// that there is, or `None`, where M5 takes [`PRIOR_ML`].
pub fn combine(first: Option<f64>, late: Option<f64>) -> Option<f64> {
    match (first, late) {
        (Some(a), Some(b)) => Some((a + b) / 2.0),
        (one, other) => one.or(other),
    }
}

/// What one view gives.
#[derive(Clone, Copy, Debug)]
pub struct View<'a> {
    /// Pixels of the object.
    pub mask: &'a Mask,
    /// Colour camera of the view.
    pub camera: &'a Camera,
}

/// Measures the object that two masks show.
///
/// # Errors
/// [`VisionError::Request`] with the reason when there is no estimate: an empty mask, a circle
/// outside an image (published variant), no circle on both masks; in the corrected variant also masks that
/// do not show one object, an object that reaches the ends of the search, and a capacity that no container
/// has. [`VisionError::Conflict`] for masks of another size than the calibrated images, and for cameras at
/// one place.
pub fn dimensions(views: [View<'_>; 2], variant: Variant) -> Result<Dimensions> {
    let centre = centre::centre(views, variant)?;
    let (width, accepted) = circles::profile(views, centre.point, variant)?;
    let (Some(&(first, _)), Some(&(last, _))) = (accepted.first(), accepted.last()) else {
        return Err(VisionError::Request("no circle fits both masks".into()));
    };
    let count = accepted.len() as f64;
    let radius = accepted.iter().map(|&(_, r)| RADII.get(r)).sum::<f64>() / count * 1000.0;
    let height = match variant {
        Variant::Published => (HEIGHTS.get(last) - HEIGHTS.get(first)) * 1000.0,
        // Each circle stands for a slice of the grid's step.
        Variant::Corrected => count * HEIGHTS.step() * 1000.0,
    };
    let capacity = radius.powi(2) * height * PI / 1000.0;
    if variant == Variant::Corrected {
        check_ends(&accepted)?;
        possible(capacity)?;
    }
    Ok(Dimensions {
        centre: centre.point,
        height,
        width,
        capacity,
        profile: accepted.iter().map(|&(h, r)| [HEIGHTS.get(h), RADII.get(r)]).collect(),
        residual: centre.residual,
    })
}

/// Refuses an object that reaches the ends of what is tried: its size would be that of the search.
fn check_ends(accepted: &[(usize, usize)]) -> Result<()> {
    let ends = [0, HEIGHTS.count - 1];
    let widest = accepted.iter().filter(|&&(_, radius)| radius == 0).count();
    let reason = if accepted.iter().any(|(height, _)| ends.contains(height)) {
        let [low, high] = ends.map(|end| HEIGHTS.get(end) * 1000.0);
        format!(
            "the object reaches beyond the heights that are tried, {low:.0} to {high:.0} mm above the world's origin"
        )
    } else if widest as f64 > MAX_WIDEST * accepted.len() as f64 {
        let width = RADII.first * 2000.0;
        format!(
            "the object is wider than the largest circle that is tried, {width:.0} mm, at nearly all heights"
        )
    } else {
        return Ok(());
    };
    Err(VisionError::Request(format!(
        "{reason}; check that the masks show the object alone, and that the calibrations are in m"
    )))
}

/// The same with masks one pixel smaller and larger: how much the masks decide.
pub fn band(views: [View<'_>; 2], variant: Variant) -> Band {
    let capacity = |change: fn(&Mask) -> Mask| {
        let masks = views.map(|view| change(view.mask));
        let changed = [0, 1].map(|i| View { mask: &masks[i], camera: views[i].camera });
        dimensions(changed, variant).ok().map(|d| d.capacity)
    };
    Band { low: capacity(Mask::eroded), high: capacity(Mask::dilated) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn grids_are_those_of_the_published_program() {
        assert_eq!((RADII.get(0), RADII.get(144)), (0.075, 0.0025));
        assert!((RADII.step() + 0.0725 / 144.0).abs() < 1e-18);
        assert_eq!((HEIGHTS.get(0), HEIGHTS.get(499)), (-0.1, 0.4));
        assert_eq!(ANGLES.get(18), 359.0);
    }

    /// Cameras 1 m from the origin, 90 degrees apart, looking down by 20 degrees.
    fn camera(around: f64) -> Camera {
        let (s, c) = around.sin_cos();
        let (ts, tc) = 20f64.to_radians().sin_cos();
        let rotation = [[-s, c, 0.0], [c * ts, s * ts, -tc], [-c * tc, -s * tc, -ts]];
        let k = [[900.0, 0.0, 320.0], [0.0, 900.0, 240.0], [0.0, 0.0, 1.0]];
        Camera::new(k, rotation, [0.0, 0.12, 1.0])
    }

    /// The mask of an upright cylinder of 60 mm width and 120 mm height at the origin.
    fn cylinder(camera: &Camera) -> Mask {
        let mut mask = Mask::empty(640, 480);
        for h in 0..=120 {
            for ring in 0..=15 {
                for a in 0..180 {
                    let (s, c) = (f64::from(a) * 2.0).to_radians().sin_cos();
                    let r = 0.03 * f64::from(ring) / 15.0;
                    let [x, y] = camera.project([r * c, r * s, 0.001 * f64::from(h)]);
                    mask.data[y as usize * 640 + x as usize] = true;
                }
            }
        }
        mask.closed(2)
    }

    #[test]
    fn a_cylinder_is_measured() {
        let cameras = [camera(0.3), camera(0.3 + PI / 2.0)];
        let masks = [0, 1].map(|i| cylinder(&cameras[i]));
        let views = [0, 1].map(|i| View { mask: &masks[i], camera: &cameras[i] });
        let d = dimensions(views, Variant::Corrected).unwrap();
        assert!(d.centre[0].abs() < 2e-3 && d.centre[1].abs() < 2e-3, "{:?}", d.centre);
        assert!((d.width - 60.0).abs() < 3.0, "{}", d.width);
        // Circles seen from above fit on the mask beyond both ends: the known bias of the method.
        assert!((120.0..150.0).contains(&d.height), "{}", d.height);
        let band = band(views, Variant::Corrected);
        assert!(band.low.unwrap() < d.capacity && d.capacity < band.high.unwrap(), "{band:?}");
        let published = dimensions(views, Variant::Published).unwrap();
        assert_eq!((published.width, published.residual), (d.width, d.residual));
        assert!(d.residual < 1.0, "{}", d.residual);
        // Without the rows below the object, circles reach beyond the image.
        let cut = masks.map(|m| Mask { width: 640, height: 400, data: m.data[..400 * 640].into() });
        let views = [0, 1].map(|i| View { mask: &cut[i], camera: &cameras[i] });
        let error = dimensions(views, Variant::Published).unwrap_err().to_string();
        assert!(error.contains("beyond an image"), "{error}");
        assert_eq!(dimensions(views, Variant::Corrected).unwrap().capacity, d.capacity);
    }

    #[test]
    fn masks_of_another_size_are_refused() {
        let cameras = [camera(0.3), camera(0.3 + PI / 2.0)];
        let halved = [0, 1].map(|i| {
            let full = cylinder(&cameras[i]);
            let data =
                (0..240 * 320).map(|at| full.data[at / 320 * 2 * 640 + at % 320 * 2]).collect();
            Mask { width: 320, height: 240, data }
        });
        let views = [0, 1].map(|i| View { mask: &halved[i], camera: &cameras[i] });
        for variant in [Variant::Published, Variant::Corrected] {
            let error = dimensions(views, variant).unwrap_err();
            assert!(matches!(error, VisionError::Conflict(_)), "{error}");
            let message = error.to_string();
            assert!(message.contains("view 1 has 320 by 240 px"), "{message}");
            assert!(message.contains("about 640 by 480 px"), "{message}");
        }
    }

    /// What the corrected variant says of masks and cameras of which nothing can be measured; the published
    /// program gives a number.
    #[test]
    fn what_the_search_cannot_hold_is_no_estimate() {
        let cameras = [camera(0.3), camera(0.3 + PI / 2.0)];
        let masks = [0, 1].map(|i| cylinder(&cameras[i]));
        let reason = |masks: [&Mask; 2], cameras: [&Camera; 2], variant| {
            let views = [0, 1].map(|i| View { mask: masks[i], camera: cameras[i] });
            dimensions(views, variant).map(|d| d.capacity).map_err(|error| {
                let conflict = matches!(error, VisionError::Conflict(_));
                (conflict, error.to_string())
            })
        };
        let corrected = |masks, cameras: [&Camera; 2]| {
            let (conflict, said) = reason(masks, cameras, Variant::Corrected).unwrap_err();
            assert!(!conflict, "{said}");
            said
        };
        let both = [&cameras[0], &cameras[1]];
        // Masks of everything, and of everything else.
        let all = Mask { data: vec![true; 640 * 480], ..masks[0] };
        let said = corrected([&all, &all], both);
        assert!(said.contains("beyond the heights that are tried, -100 to 400 mm"), "{said}");
        let inverted =
            [0, 1].map(|i| Mask { data: masks[i].data.iter().map(|p| !p).collect(), ..masks[i] });
        let said = corrected([&inverted[0], &inverted[1]], both);
        assert!(said.contains("beyond the heights that are tried"), "{said}");
        // In decimetres.
        let far = [0, 1].map(|i| {
            let Camera { intrinsic, rotation, translation, .. } = cameras[i];
            Camera::new(intrinsic, rotation, translation.map(|t| t * 10.0))
        });
        let said = corrected([&masks[0], &masks[1]], [&far[0], &far[1]]);
        assert!(said.contains("beyond the heights that are tried"), "{said}");
        // Another object in one of the views.
        let lower = |i: usize| {
            let data =
                (0..640 * 480).map(|at| at >= 60 * 640 && masks[i].data[at - 60 * 640]).collect();
            Mask { data, ..masks[i] }
        };
        let said = corrected([&masks[0], &lower(1)], both);
        assert!(said.contains("px (at most 20 px); check that both masks"), "{said}");
        assert!(!said.contains("by 0 px"), "{said}");
        // One camera.
        for variant in [Variant::Published, Variant::Corrected] {
            let (conflict, said) =
                reason([&masks[0], &masks[0]], [&cameras[0], &cameras[0]], variant).unwrap_err();
            assert!(conflict && said.contains("at the same place"), "{said}");
        }
    }

    #[test]
    fn an_object_that_ends_within_the_search_may_be_wide() {
        let profile = |widest: usize| -> Vec<(usize, usize)> {
            (100..200).map(|h| (h, usize::from(h >= 100 + widest))).collect()
        };
        assert!(check_ends(&profile(90)).is_ok());
        let said = check_ends(&profile(91)).unwrap_err().to_string();
        assert!(said.contains("wider than the largest circle that is tried, 150 mm"), "{said}");
        for end in [0, HEIGHTS.count - 1] {
            assert!(check_ends(&[(end, 50)]).is_err(), "{end}");
        }
    }

    #[test]
    fn a_stem_holds_nothing() {
        let profile = |radius: &dyn Fn(f64) -> f64| -> Vec<[f64; 2]> {
            (0..100).map(|i| [0.001 * f64::from(i), radius(f64::from(i))]).collect()
        };
        let of = |profile| Dimensions {
            centre: [0.0; 3],
            height: 100.0,
            width: 60.0,
            capacity: 0.0,
            profile,
            residual: 0.0,
        };
        let slice = PI * 0.03 * 0.03 * HEIGHTS.step() * 1e6;
        let tumbler = of(profile(&|_| 0.03));
        assert!((tumbler.bowl_capacity() - 100.0 * slice).abs() < 1e-9);
        let wine = of(profile(&|i| if (10.0..50.0).contains(&i) { 0.004 } else { 0.03 }));
        let bowl = wine.bowl_capacity();
        assert!((50.0 * slice..51.0 * slice).contains(&bowl), "{bowl}");
        assert_eq!(wine.end_widths(), [8.0, 60.0]);
        assert_eq!(of(vec![]).bowl_capacity(), 0.0);
    }

    #[test]
    fn no_estimate_has_a_reason() {
        let camera = camera(0.0);
        let empty = Mask::empty(640, 480);
        let view = View { mask: &empty, camera: &camera };
        let error = dimensions([view, view], Variant::Published).unwrap_err().to_string();
        assert_eq!(error, "the mask of view 1 is empty");
    }
}
