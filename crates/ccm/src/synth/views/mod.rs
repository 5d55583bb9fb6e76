//! Synthetic views: colour and depth images, calibrations and detections of a recording.
//!
//! Two frames of four views: 1 and 2 from the sides, 3 from the robot at the table, 4 from the
//! person's chest. Depth has noise, holes and ragged edges, and glass is measured poorly. Detections
//! miss some containers and mistake others; masks are those of the visible pixels, give or take one.

mod calibration;
mod scene;
mod shape;

use std::path::Path;

use corsmal_vision::{Camera, Depth, Rgb, compress};
use rand::Rng;
use serde_json::json;

use super::files;
use super::physics::gaussian;
use super::take::generator;
use crate::dataset::{Category, Container, FillingType, SequenceName};
use crate::error::{CcmError, Result};
use scene::{Ellipsoid, Part, SIZE, Scene, Seen};
pub(super) use shape::Shape;

/// Numbers of the frames that are rendered.
const FRAMES: [u32; 2] = [0, 8];
/// Views with depth images; the fourth is left out to save space.
const DEPTH_VIEWS: [usize; 3] = [0, 1, 2];
/// Share of the frames in which the detector misses the container.
const MISSED: f64 = 0.06;
/// Share of the frames in which it takes the container for another kind.
const MISTAKEN: f64 = 0.1;

/// A recording to render.
struct Take {
    container: Container,
    name: SequenceName,
}

/// Writes the views of one recording: calibrations, colour and depth images, detections. `stem` names
/// the recording in the folder `base` of its container.
///
/// # Errors
/// [`CcmError`] when something cannot be written.
pub fn write_views(
    base: &Path,
    stem: &str,
    container: Container,
    name: SequenceName,
    seed: u64,
) -> Result<()> {
    let take = &Take { container, name };
    // Other random numbers than those of the sound.
    let mut rng = generator(seed ^ 0x5EE_1467, container, Some(name));
    let cameras = cameras();
    for (view, camera) in cameras.iter().enumerate() {
        let path = base.join(format!("calib/{stem}_c{}_calib.pickle", view + 1));
        files::write_new(&path, &calibration::pickle(camera))?;
    }
    let place = Place::random(take, &mut rng);
    let mut detections = Vec::new();
    for frame in FRAMES {
        let scene = scene(take, &place, frame);
        for (view, camera) in cameras.iter().enumerate() {
            let seen = scene.seen(camera);
            let folder = format!("{stem}/c{}/{frame:04}.png", view + 1);
            let image = colours(&seen, take).to_png().map_err(fault)?;
            files::write_new(&base.join("rgb").join(&folder), &image)?;
            if DEPTH_VIEWS.contains(&view) {
                let depth = depth(&seen, take.container, &mut rng).to_png().map_err(fault)?;
                files::write_new(&base.join("depth").join(&folder), &depth)?;
            }
            detect(&seen, take.container, frame, view, &mut rng, &mut detections);
        }
    }
    let path = base.join(format!("detections/{stem}.json"));
    files::write_new(&path, serde_json::Value::from(detections).to_string().as_bytes())
}

fn fault(error: corsmal_vision::VisionError) -> CcmError {
    CcmError::Request(error.to_string())
}

/// The four colour cameras, as invented as everything here.
fn cameras() -> [Camera; 4] {
    [
        looking([-0.55, -1.1, 0.62], [0.0, 0.0, 0.1]),
        looking([0.55, -1.1, 0.62], [0.0, 0.0, 0.1]),
        // Close and low, tilted up: the table fills the rows below 600 only.
        looking([0.0, -0.4, 0.05], [0.0, 0.0, 0.125]),
        looking([0.05, 0.42, 0.5], [0.0, 0.0, 0.05]),
    ]
}

/// A camera at a place that looks at a point, upright.
fn looking(from: [f64; 3], at: [f64; 3]) -> Camera {
    let unit = |v: [f64; 3]| {
        let length = v.iter().map(|c| c * c).sum::<f64>().sqrt();
        v.map(|c| c / length)
    };
    let cross = |a: [f64; 3], b: [f64; 3]| {
        [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
    };
    let forward = unit(std::array::from_fn(|i| at[i] - from[i]));
    let right = unit(cross(forward, [0.0, 0.0, 1.0]));
    let rotation = [right, cross(forward, right), forward];
    let shift = rotation.map(|row| -(row[0] * from[0] + row[1] * from[1] + row[2] * from[2]));
    let intrinsic = [[920.0, 0.0, 645.0], [0.0, 920.0, 358.0], [0.0, 0.0, 1.0]];
    Camera::new(intrinsic, rotation, shift)
}

/// Where and how a container stands or is held.
struct Place {
    at: [f64; 3],
    turn: f64,
    sway: [f64; 2],
}

impl Place {
    fn random(take: &Take, rng: &mut impl Rng) -> Self {
        let held = take.name.scenario > 0;
        let height = if held { rng.gen_range(0.06..0.12) } else { 0.0 };
        Self {
            at: [rng.gen_range(-0.03..0.03), rng.gen_range(-0.02..0.03), height],
            turn: rng.gen_range(-0.5..0.5),
            sway: [0.008 * gaussian(rng), 0.008 * gaussian(rng)],
        }
    }
}

fn scene(take: &Take, place: &Place, frame: u32) -> Scene {
    let shape = Shape::of(take.container);
    let held = take.name.scenario > 0;
    let moved = if held { f64::from(frame) / 8.0 } else { 0.0 };
    let at =
        [place.at[0] + moved * place.sway[0], place.at[1] + moved * place.sway[1], place.at[2]];
    let hand = if held { hand(&shape, at) } else { Vec::new() };
    Scene {
        hand,
        person: vec![
            Ellipsoid { centre: [0.0, 0.62, 0.15], radii: [0.22, 0.12, 0.4] },
            Ellipsoid { centre: [0.0, 0.62, 0.65], radii: [0.09, 0.1, 0.13] },
        ],
        // Away from the table the person stands alone.
        table: (take.name.scenario < 2).then_some([0.5, 0.35]),
        shape,
        place: at,
        turn: place.turn,
    }
}

/// A palm behind the container and fingers around its middle.
fn hand(shape: &Shape, at: [f64; 3]) -> Vec<Ellipsoid> {
    let (reach, height) = (shape.reach(), shape.height());
    let middle = at[2] + 0.45 * height;
    let thick = 0.009;
    let palm = Ellipsoid {
        centre: [at[0] + reach + 0.01, at[1] + 0.03, middle],
        radii: [0.018, 0.05, 0.045],
    };
    let fingers = (0..4).map(|i| {
        let z = middle - 0.03 + 0.02 * f64::from(i);
        let length = (0.6 * reach).min(0.035);
        Ellipsoid {
            centre: [at[0] + 0.55 * reach, at[1] - reach - 0.002, z],
            radii: [length, thick, thick],
        }
    });
    std::iter::once(palm).chain(fingers).collect()
}

/// Colour by part and facing; filling shows through what is transparent.
fn colours(seen: &Seen, take: &Take) -> Rgb {
    let container = match (take.container.category(), take.container.is_opaque()) {
        (Category::Box, _) => [196.0, 148.0, 88.0],
        (_, true) => [190.0, 60.0, 52.0],
        _ => [176.0, 196.0, 204.0],
    };
    let filling = take.name.filling;
    let content = match filling.kind() {
        FillingType::None => container,
        FillingType::Pasta => [222.0, 186.0, 92.0],
        FillingType::Rice => [238.0, 234.0, 214.0],
        FillingType::Water => [120.0, 160.0, 200.0],
    };
    let light = if take.name.illumination == 0 { 1.0 } else { 0.75 };
    let wall = if take.name.background == 0 { [92.0, 98.0, 104.0] } else { [150.0, 140.0, 120.0] };
    let level = filling.level().fraction() as f32;
    let pixels = seen.part.iter().zip(&seen.facing).zip(&seen.level);
    let data = pixels.flat_map(|((part, facing), height)| {
        let base = match part {
            Part::Nothing => wall,
            Part::Table => [112.0, 84.0, 62.0],
            Part::Person => [54.0, 70.0, 96.0],
            Part::Hand => [206.0, 160.0, 134.0],
            Part::Container if !take.container.is_opaque() && *height < level => content,
            Part::Container => container,
        };
        let shade = if *part == Part::Nothing { 1.0 } else { 0.45 + 0.55 * f64::from(*facing) };
        base.map(|c| (c * shade * light).round().clamp(0.0, 255.0) as u8)
    });
    Rgb { width: SIZE.0, height: SIZE.1, data: data.collect() }
}

/// Depth in mm: noise that grows with the distance, holes, lost edges; glass is measured poorly.
fn depth(seen: &Seen, container: Container, rng: &mut impl Rng) -> Depth {
    let glass = !container.is_opaque();
    let mut data = vec![0u16; seen.depth.len()];
    for (i, mm) in data.iter_mut().enumerate() {
        let z = f64::from(seen.depth[i]);
        if !z.is_finite() {
            continue;
        }
        let edge = [1usize, SIZE.0].iter().any(|step| {
            let other = seen.depth.get(i + step).copied().unwrap_or(f32::INFINITY);
            (f64::from(other) - z).abs() > 0.03
        });
        let lost = match seen.part[i] {
            _ if edge => 0.5,
            Part::Container if glass => 0.35,
            _ => 0.01,
        };
        if rng.gen_bool(lost) {
            continue;
        }
        // Sum of three uniform numbers: close to normal, and quick.
        let noise: f64 = (0..3).map(|_| rng.gen_range(-1.0..1.0)).sum();
        *mm = (z * 1000.0 + 2.0 * z * z * noise).round().clamp(0.0, 65_535.0) as u16;
    }
    Depth { width: SIZE.0, height: SIZE.1, data }
}

/// What a detector would say of a view.
fn detect(
    seen: &Seen,
    container: Container,
    frame: u32,
    view: usize,
    rng: &mut impl Rng,
    out: &mut Vec<serde_json::Value>,
) {
    let mut add = |part: Part, label: &str, score: f64, rng: &mut dyn FnMut() -> f64| {
        let mask = seen.mask(part);
        if mask.area() < 200 {
            return;
        }
        let draw = rng();
        let mask = match draw {
            d if d < 0.25 => mask.eroded(),
            d if d < 0.5 => mask.dilated(),
            _ => mask,
        };
        let Some(bounds) = mask.bounds() else { return };
        let mut entry = json!({
            "frame": frame, "view": view + 1, "label": label, "score": score, "box": bounds,
        });
        if part == Part::Container {
            entry["mask"] = json!({ "size": [SIZE.1, SIZE.0], "counts": compress(&mask) });
        }
        out.push(entry);
    };
    let mut random = || rng.r#gen::<f64>();
    add(Part::Person, "person", 0.99, &mut random);
    let (missed, mistaken) = (random() < MISSED, random() < MISTAKEN);
    let score = (0.6 + 0.39 * random()) * if mistaken { 0.8 } else { 1.0 };
    let label = match (container.category(), mistaken) {
        (Category::Cup, false) | (Category::Glass, true) => "cup",
        (Category::Cup, true) => "vase",
        (Category::Glass, false) => "wine glass",
        (Category::Box, false) => "book",
        (Category::Box, true) => "vase",
    };
    if !missed {
        add(Part::Container, label, (score * 1000.0).round() / 1000.0, &mut random);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cameras_see_the_origin_upright() {
        for camera in cameras() {
            let [x, low] = camera.project([0.0, 0.0, 0.05]);
            let [_, high] = camera.project([0.0, 0.0, 0.15]);
            assert!((300.0..980.0).contains(&x) && high < low && low < 720.0, "{x} {low} {high}");
        }
        // The published method needs all its circles within both images.
        for camera in &cameras()[..2] {
            for height in [-0.1, 0.4] {
                for (x, y) in [(-0.09, -0.09), (0.09, -0.09), (-0.09, 0.09), (0.09, 0.09)] {
                    let [u, v] = camera.project([x, y, height]);
                    assert!((0.0..1280.0).contains(&u) && (0.0..720.0).contains(&v), "{u} {v}");
                }
            }
        }
    }
}
