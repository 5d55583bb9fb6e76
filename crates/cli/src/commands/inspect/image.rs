//! Inspection of pictures: depth images, masks, colour.

use std::path::Path;
use std::process::ExitCode;

use corsmal_vision::{Depth, Mask, Rgb};
use serde_json::{Value, json};

use super::refusal::{corrupt, to_json};
use crate::failure::Failure;

/// Prints what a picture shows, as far as `capacity` and `crops` care.
pub fn inspect(path: &Path, json: bool) -> Result<ExitCode, Failure> {
    let name = path.display().to_string();
    let found = match Depth::read(path) {
        Ok(depth) => {
            // Nothing is 1 mm or 65,535 mm away.
            let values = || depth.data.iter().copied();
            match values().any(|mm| mm > 0) && two_values(values(), u16::MAX) {
                true => Mask::read(path).map(|mask| of_mask(&mask)),
                false => Ok(of_depth(&depth)),
            }
        }
        Err(_) => Rgb::read(path).map(|image| {
            let grey = image.data.as_chunks::<3>().0.iter().all(|p| p[0] == p[1] && p[0] == p[2]);
            let mask = grey && two_values(image.data.iter().copied(), u8::MAX);
            // What is drawn in transparency alone is no mask.
            let mask = mask.then(|| Mask::read(path).ok()).flatten();
            mask.as_ref().map_or_else(|| of_colours(&image), of_mask)
        }),
    };
    let (kind, text, mut facts) = match found {
        Ok(found) => found,
        Err(error) => return corrupt(path, &error, json),
    };
    if json {
        facts["path"] = name.into();
        facts["kind"] = kind.into();
        print!("{}", to_json(&facts)?);
    } else {
        let size = format!("{} × {} px", facts["width"], facts["height"]);
        println!("{name}\n  {kind} · {size}{text}");
    }
    Ok(ExitCode::SUCCESS)
}

/// Kind, what is said of it, and facts.
type Found = (&'static str, String, Value);

fn of_depth(depth: &Depth) -> Found {
    let measured = || depth.data.iter().copied().filter(|&mm| mm > 0);
    let count = measured().count();
    let (nearest, farthest) = (measured().min(), measured().max());
    let share = count as f64 / depth.data.len() as f64;
    let range = nearest.zip(farthest).map(|(near, far)| format!(" · {near} to {far} mm"));
    let text = format!("{} · {:.1} % measured", range.unwrap_or_default(), 100.0 * share);
    let facts = json!({
        "width": depth.width, "height": depth.height, "measured": share, "nearest_mm": nearest,
        "farthest_mm": farthest,
    });
    ("depth image", text, facts)
}

/// Whether nothing occurs but 0 and, as masks are written, one of 1 and the largest value.
fn two_values<T: Copy + PartialEq + From<u8>>(values: impl Iterator<Item = T>, most: T) -> bool {
    let mut inside = None;
    values.filter(|value| *value != T::from(0)).all(|value| {
        (value == T::from(1) || value == most) && *inside.get_or_insert(value) == value
    })
}

fn of_colours(Rgb { width, height, .. }: &Rgb) -> Found {
    ("colour image", String::new(), json!({ "width": width, "height": height }))
}

fn of_mask(mask: &Mask) -> Found {
    let (area, bounds) = (mask.area(), mask.bounds());
    let place = bounds
        .map(|[x0, y0, x1, y1]| format!(", columns {x0} to {}, rows {y0} to {}", x1 - 1, y1 - 1));
    let text = format!(" · {area} px inside{}", place.unwrap_or_default());
    let Mask { width, height, .. } = mask;
    ("mask", text, json!({ "width": width, "height": height, "area": area, "bounds": bounds }))
}
