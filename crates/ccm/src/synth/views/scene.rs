//! Ray casting: what a camera sees of a container, a hand, a person and a table.

use corsmal_vision::{Camera, Mask};

use super::shape::Shape;

/// Columns and rows of the images.
pub(super) const SIZE: (usize, usize) = (1280, 720);
/// Nothing beyond is measured, in m.
pub(super) const FARTHEST: f64 = 3.0;

/// What a pixel shows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Part {
    Nothing,
    Table,
    Person,
    Hand,
    Container,
}

/// An ellipsoid along the axes of the world.
#[derive(Clone, Copy, Debug)]
pub(super) struct Ellipsoid {
    pub(super) centre: [f64; 3],
    pub(super) radii: [f64; 3],
}

/// Everything that is seen, in m.
pub(super) struct Scene {
    pub(super) shape: Shape,
    /// Where the middle of the container's base is.
    pub(super) place: [f64; 3],
    /// Turn of a box around the vertical axis.
    pub(super) turn: f64,
    pub(super) hand: Vec<Ellipsoid>,
    pub(super) person: Vec<Ellipsoid>,
    /// Half the sides of the table's top around the origin; `None` without a table.
    pub(super) table: Option<[f64; 2]>,
}

/// What one camera sees.
pub(super) struct Seen {
    /// Distance along the camera's axis in m, infinite where there is nothing.
    pub(super) depth: Vec<f32>,
    pub(super) part: Vec<Part>,
    /// Cosine between the surface's normal and the ray.
    pub(super) facing: Vec<f32>,
    /// Height of the seen point over the container's base over its height.
    pub(super) level: Vec<f32>,
}

/// Origin and direction; the parameter along it is the distance along the camera's axis.
struct Ray {
    from: [f64; 3],
    along: [f64; 3],
}

/// Parameter and normal of a hit.
type Hit = (f64, [f64; 3]);

impl Scene {
    /// Renders the scene.
    pub(super) fn seen(&self, camera: &Camera) -> Seen {
        let pixels = SIZE.0 * SIZE.1;
        let mut seen = Seen {
            depth: vec![f32::INFINITY; pixels],
            part: vec![Part::Nothing; pixels],
            facing: vec![0.0; pixels],
            level: vec![0.0; pixels],
        };
        let Some(back) = camera.back_projection() else { return seen };
        let from = back.point(0.0, 0.0, 0.0);
        let ray = |x: usize, y: usize| {
            let at = back.point(x as f64, y as f64, 1.0);
            Ray { from, along: std::array::from_fn(|i| at[i] - from[i]) }
        };
        if let Some(half) = self.table {
            let corners = [[half[0], half[1], 0.0], [-half[0], -half[1], 0.0]];
            seen.draw(everything(), Part::Table, ray, |ray| on_table(ray, half));
            debug_assert!(corners[0][0] > corners[1][0]);
        }
        for (part, of) in [(Part::Person, &self.person), (Part::Hand, &self.hand)] {
            for ellipsoid in of {
                let r = ellipsoid.radii;
                let low = std::array::from_fn(|i| ellipsoid.centre[i] - r[i]);
                let high = std::array::from_fn(|i| ellipsoid.centre[i] + r[i]);
                seen.draw(frame(camera, low, high), part, ray, |ray| on_ellipsoid(ray, ellipsoid));
            }
        }
        let reach = self.shape.reach();
        let p = self.place;
        let low = [p[0] - reach, p[1] - reach, p[2]];
        let high = [p[0] + reach, p[1] + reach, p[2] + self.shape.height()];
        seen.draw(frame(camera, low, high), Part::Container, ray, |ray| self.on_container(ray));
        let height = self.shape.height();
        for (i, part) in seen.part.iter().enumerate() {
            if *part == Part::Container {
                let at = ray(i % SIZE.0, i / SIZE.0);
                let z = at.from[2] + f64::from(seen.depth[i]) * at.along[2];
                seen.level[i] = ((z - p[2]) / height) as f32;
            }
        }
        seen
    }

    fn on_container(&self, ray: &Ray) -> Option<Hit> {
        let shifted =
            Ray { from: std::array::from_fn(|i| ray.from[i] - self.place[i]), along: ray.along };
        match &self.shape {
            Shape::Turned { profile, .. } => on_turned(&shifted, profile),
            Shape::Box(sides) => on_box(&shifted, sides, self.turn),
        }
    }
}

impl Seen {
    fn draw(
        &mut self,
        [x0, y0, x1, y1]: [usize; 4],
        part: Part,
        ray: impl Fn(usize, usize) -> Ray,
        hit: impl Fn(&Ray) -> Option<Hit>,
    ) {
        for y in y0..y1 {
            for x in x0..x1 {
                let ray = ray(x, y);
                let Some((t, normal)) = hit(&ray) else { continue };
                let at = y * SIZE.0 + x;
                if t < FARTHEST && (t as f32) < self.depth[at] {
                    self.depth[at] = t as f32;
                    self.part[at] = part;
                    let length = |v: [f64; 3]| v.iter().map(|c| c * c).sum::<f64>().sqrt();
                    let dot: f64 = (0..3).map(|i| normal[i] * ray.along[i]).sum();
                    self.facing[at] = (dot / length(normal) / length(ray.along)).abs() as f32;
                }
            }
        }
    }

    /// Pixels of a part.
    pub(super) fn mask(&self, part: Part) -> Mask {
        let data = self.part.iter().map(|p| *p == part).collect();
        Mask { width: SIZE.0, height: SIZE.1, data }
    }
}

fn everything() -> [usize; 4] {
    [0, 0, SIZE.0, SIZE.1]
}

/// Columns and rows around the projection of a box; everything where a corner is behind the camera.
fn frame(camera: &Camera, low: [f64; 3], high: [f64; 3]) -> [usize; 4] {
    let mut bounds = [f64::MAX, f64::MAX, f64::MIN, f64::MIN];
    for corner in 0..8 {
        let point: [f64; 3] =
            std::array::from_fn(|i| if corner >> i & 1 == 0 { low[i] } else { high[i] });
        let p = &camera.projection[2];
        if p[0] * point[0] + p[1] * point[1] + p[2] * point[2] + p[3] < 0.02 {
            return everything();
        }
        let [x, y] = camera.project(point);
        bounds = [bounds[0].min(x), bounds[1].min(y), bounds[2].max(x), bounds[3].max(y)];
    }
    let clip = |v: f64, max: usize| v.clamp(0.0, max as f64) as usize;
    [
        clip(bounds[0], SIZE.0),
        clip(bounds[1], SIZE.1),
        clip(bounds[2] + 2.0, SIZE.0),
        clip(bounds[3] + 2.0, SIZE.1),
    ]
}

fn on_table(ray: &Ray, half: [f64; 2]) -> Option<Hit> {
    let t = -ray.from[2] / ray.along[2];
    let inside = (0..2).all(|i| (ray.from[i] + t * ray.along[i]).abs() <= half[i]);
    (t > 0.0 && inside).then_some((t, [0.0, 0.0, 1.0]))
}

fn on_ellipsoid(ray: &Ray, e: &Ellipsoid) -> Option<Hit> {
    let from: [f64; 3] = std::array::from_fn(|i| (ray.from[i] - e.centre[i]) / e.radii[i]);
    let along: [f64; 3] = std::array::from_fn(|i| ray.along[i] / e.radii[i]);
    let dot = |a: &[f64; 3], b: &[f64; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
    let (a, b, c) = (dot(&along, &along), dot(&from, &along), dot(&from, &from) - 1.0);
    let root = b * b - a * c;
    let t = (root >= 0.0).then(|| (-b - root.sqrt()) / a).filter(|t| *t > 0.0)?;
    let normal = std::array::from_fn(|i| (from[i] + t * along[i]) / e.radii[i]);
    Some((t, normal))
}

fn nearer(a: Option<Hit>, b: Option<Hit>) -> Option<Hit> {
    match (a, b) {
        (Some(a), Some(b)) => Some(if b.0 < a.0 { b } else { a }),
        (a, b) => a.or(b),
    }
}

/// Frustums around the vertical axis and the base; the top is open.
fn on_turned(ray: &Ray, profile: &[[f64; 2]]) -> Option<Hit> {
    let [ox, oy, oz] = ray.from;
    let [dx, dy, dz] = ray.along;
    let mut best = None;
    for pair in profile.windows(2) {
        let [[z0, r0], [z1, r1]] = [pair[0], pair[1]];
        let slope = (r1 - r0) / (z1 - z0);
        // (ox + dx t)² + (oy + dy t)² = (r0 + slope (oz + dz t - z0))²
        let (base, per) = (r0 + slope * (oz - z0), slope * dz);
        let a = dx * dx + dy * dy - per * per;
        let b = ox * dx + oy * dy - base * per;
        let c = ox * ox + oy * oy - base * base;
        let root = b * b - a * c;
        if root < 0.0 || a == 0.0 {
            continue;
        }
        for t in [(-b - root.sqrt()) / a, (-b + root.sqrt()) / a] {
            let z = oz + dz * t;
            if t > 0.0 && (z0..=z1).contains(&z) {
                let (x, y) = (ox + dx * t, oy + dy * t);
                let radius = x.hypot(y).max(1e-9);
                best = nearer(best, Some((t, [x / radius, y / radius, -slope])));
            }
        }
    }
    let radius = profile.first().map_or(0.0, |p| p[1]);
    let t = -oz / dz;
    let on_base = t > 0.0 && (ox + dx * t).hypot(oy + dy * t) <= radius;
    nearer(best, on_base.then_some((t, [0.0, 0.0, 1.0])))
}

fn on_box(ray: &Ray, sides: &[f64; 3], turn: f64) -> Option<Hit> {
    let (sin, cos) = turn.sin_cos();
    let turned = |v: [f64; 3]| [cos * v[0] + sin * v[1], cos * v[1] - sin * v[0], v[2]];
    let (from, along) = (turned(ray.from), turned(ray.along));
    let low = [-sides[0] / 2.0, -sides[1] / 2.0, 0.0];
    let high = [sides[0] / 2.0, sides[1] / 2.0, sides[2]];
    let (mut enter, mut leave, mut face) = (f64::MIN, f64::MAX, 0);
    for i in 0..3 {
        let (a, b) = ((low[i] - from[i]) / along[i], (high[i] - from[i]) / along[i]);
        if a.min(b) > enter {
            (enter, face) = (a.min(b), i);
        }
        leave = leave.min(a.max(b));
    }
    let mut normal = [0.0; 3];
    normal[face] = 1.0;
    let back = [cos * normal[0] - sin * normal[1], sin * normal[0] + cos * normal[1], normal[2]];
    (enter > 0.0 && enter <= leave).then_some((enter, back))
}
