//! Shapes of the containers: surfaces of revolution and boxes that hold exactly the capacity.

use std::f64::consts::PI;

use super::super::objects::capacity_ml;
use crate::dataset::{Category, Container, Dimensions};

/// Thickness of walls in m.
const WALL: f64 = 0.002;
/// Thickness of the base in m.
const BASE: f64 = 0.003;

/// What a container looks like, standing on the ground, in m.
#[derive(Clone, Debug)]
pub(in super::super) enum Shape {
    /// Height and outer radius from below; the inside begins at a height.
    Turned {
        /// Height and radius of the corners of the profile.
        profile: Vec<[f64; 2]>,
        /// Height at which the inside begins.
        floor: f64,
    },
    /// Width, depth and height.
    Box([f64; 3]),
}

/// Width at the top, width at the bottom, height and, for boxes, depth in mm. Those of containers 1 to
/// 9 are the annotated ones; of the others they are invented.
const SIZES: [[f64; 4]; 15] = [
    [98.0, 61.0, 119.0, 0.0],
    [69.0, 42.0, 72.0, 0.0],
    [69.0, 39.0, 85.0, 0.0],
    [88.0, 56.0, 91.0, 0.0],
    [81.0, 67.0, 136.0, 0.0],
    [49.0, 59.0, 175.0, 0.0],
    [193.0, 193.0, 241.0, 69.0],
    [135.0, 135.0, 164.0, 56.0],
    [80.0, 80.0, 131.0, 45.0],
    [90.0, 58.0, 100.0, 0.0],
    [80.0, 64.0, 95.0, 0.0],
    [160.0, 160.0, 190.0, 60.0],
    [75.0, 48.0, 85.0, 0.0],
    [84.0, 70.0, 110.0, 0.0],
    [120.0, 120.0, 150.0, 50.0],
];

impl Shape {
    /// The shape of a container. Its inside holds the capacity; sizes are scaled to that end.
    pub(in super::super) fn of(container: Container) -> Self {
        let [top, bottom, height, depth] =
            SIZES[usize::from(container.number() - 1) % SIZES.len()].map(|mm| mm / 1000.0);
        let capacity = capacity_ml(container) * 1e-6;
        if container.category() == Category::Box {
            // Cardboard is thin: inside and outside are the same.
            let scale = (capacity / (top * depth * height)).cbrt();
            return Self::Box([top * scale, depth * scale, height * scale]);
        }
        let stemmed = matches!(container.number(), 5 | 6);
        let shape = |scale: f64| {
            let (t, b, h) = (top / 2.0 * scale, bottom / 2.0 * scale, height * scale);
            if stemmed {
                bowl_on_stem(t, b, h)
            } else {
                Self::Turned { profile: vec![[0.0, b], [h, t]], floor: BASE }
            }
        };
        // The inside grows with the scale.
        let (mut low, mut high) = (0.5, 3.0);
        for _ in 0..60 {
            let middle = (low + high) / 2.0;
            let too_small = shape(middle).inside() < capacity;
            if too_small { low = middle } else { high = middle }
        }
        shape(high)
    }

    /// Volume of the inside in m³.
    pub(in super::super) fn inside(&self) -> f64 {
        match self {
            Self::Box(sides) => sides.iter().product(),
            Self::Turned { profile, floor } => {
                let slices = profile.windows(2).map(|pair| {
                    let [[z0, r0], [z1, r1]] = [pair[0], pair[1]];
                    let from = z0.max(*floor);
                    if z1 <= from {
                        return 0.0;
                    }
                    let radius = |z: f64| (r0 + (r1 - r0) * (z - z0) / (z1 - z0) - WALL).max(0.0);
                    let (a, b) = (radius(from), radius(z1));
                    PI * (z1 - from) / 3.0 * (a * a + a * b + b * b)
                });
                slices.sum()
            }
        }
    }

    /// Height in m.
    pub(super) fn height(&self) -> f64 {
        match self {
            Self::Box(sides) => sides[2],
            Self::Turned { profile, .. } => profile.last().map_or(0.0, |p| p[0]),
        }
    }

    /// Half the width of a square around the ground plan, in m.
    pub(super) fn reach(&self) -> f64 {
        match self {
            Self::Box([width, depth, _]) => width.hypot(*depth) / 2.0,
            Self::Turned { profile, .. } => profile.iter().map(|p| p[1]).fold(0.0, f64::max),
        }
    }

    /// Sizes as the annotations give them, in mm.
    pub(in super::super) fn dimensions(&self) -> Dimensions {
        let mm = |m: f64| (m * 1e4).round() / 10.0;
        let (top, bottom) = match self {
            Self::Box(sides) => (sides[0], sides[0]),
            Self::Turned { profile, .. } => {
                let width = |p: Option<&[f64; 2]>| p.map_or(0.0, |p| 2.0 * p[1]);
                (width(profile.last()), width(profile.first()))
            }
        };
        Dimensions { width_top: mm(top), width_bottom: mm(bottom), height: mm(self.height()) }
    }
}

/// A foot, a stem of 4 mm radius to two fifths of the height, and a bowl.
fn bowl_on_stem(top: f64, foot: f64, height: f64) -> Shape {
    let (rise, stem) = (0.4 * height, 0.004);
    let bowl = (0..=6).map(|i| {
        let along = f64::from(i) / 6.0;
        let radius = stem + (top - stem) * (along * (2.0 - along)).sqrt();
        [rise + (height - rise) * along, radius]
    });
    let below = [[0.0, foot], [0.004, foot], [0.012, stem]];
    Shape::Turned { profile: below.into_iter().chain(bowl).collect(), floor: rise + BASE }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_container_holds_its_capacity_and_keeps_its_size_roughly() {
        for container in Container::all() {
            let shape = Shape::of(container);
            let capacity = capacity_ml(container);
            assert!((shape.inside() * 1e6 / capacity - 1.0).abs() < 1e-9, "{container:?}");
            let size = SIZES[usize::from(container.number() - 1)];
            let found = shape.dimensions();
            assert!((0.8..1.3).contains(&(found.height / size[2])), "{container:?} {found:?}");
            assert!((0.8..1.3).contains(&(found.width_top / size[0])), "{container:?} {found:?}");
        }
    }
}
