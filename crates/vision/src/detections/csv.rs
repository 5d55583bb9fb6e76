//! Tables of detections in CSV.

use std::path::Path;

use corsmal_files::csv_text::{self, Fault};

use super::{Detection, MAX_DETECTIONS, Segmentation, beside, detection};
use crate::error::{Result, VisionError};

/// Columns that a table must have.
const COLUMNS: [&str; 8] = ["frame", "view", "label", "score", "x_min", "y_min", "x_max", "y_max"];

pub(super) fn read(bytes: &[u8], path: &Path) -> Result<Vec<Detection>> {
    let mut reader = csv_text::reader(bytes).map_err(|e| VisionError::file(path, e.to_string()))?;
    let fault = |e: Fault| VisionError::file(path, e.to_string());
    let header = csv_text::header(&mut reader).map_err(fault)?;
    let column = |name: &str| header.iter().position(|h| h.eq_ignore_ascii_case(name));
    for name in COLUMNS {
        if column(name).is_none() {
            let there: Vec<_> = header.iter().collect();
            let there = there.join(", ");
            return Err(VisionError::file(path, format!("no column '{name}'; it has {there}")));
        }
    }
    for name in COLUMNS.into_iter().chain(["mask"]) {
        // The first of two would count, whatever the other says.
        if header.iter().filter(|h| h.eq_ignore_ascii_case(name)).count() > 1 {
            return Err(VisionError::file(path, format!("two columns are named '{name}'")));
        }
    }
    let mut detections = Vec::new();
    for row in csv_text::records(&mut reader) {
        let (line, row) = row.map_err(fault)?;
        let text = |key: &str| column(key).and_then(|c| row.get(c)).unwrap_or_default();
        let place = |reason: String| VisionError::file(path, format!("line {line}: {reason}"));
        if detections.len() == MAX_DETECTIONS {
            return Err(place(format!("a table has at most {MAX_DETECTIONS} detections")));
        }
        let mask = match text("mask") {
            "" => Segmentation::None,
            json if json.starts_with(['{', '[']) => Segmentation::Coco(
                serde_json::from_str(json)
                    .map_err(|e| place(format!("a mask that is not readable as JSON: {e}")))?,
            ),
            file => Segmentation::File(beside(path, file)),
        };
        let number = |key: &str, what: &str| {
            let text = text(key);
            text.trim().parse::<f64>().map_err(|_| place(format!("'{text}' is not {what}")))
        };
        let mut bounds = [0.0; 4];
        for (side, key) in bounds.iter_mut().zip(["x_min", "y_min", "x_max", "y_max"]) {
            *side = number(key, "an edge of a box in px")?;
        }
        let score = number("score", "a score from 0 to 1")?;
        let names = ["frame", "view", "label"].map(text);
        detections.push(detection(names, score, bounds, mask).map_err(place)?);
    }
    Ok(detections)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The first of two columns counted, though it was empty.
    #[test]
    fn no_column_is_there_twice() {
        for twice in COLUMNS.into_iter().chain(["mask"]) {
            let text = format!("{},mask,{twice}\n", COLUMNS.join(","));
            let refused = read(text.as_bytes(), Path::new("x.csv")).unwrap_err().to_string();
            assert!(refused.contains(&format!("two columns are named '{twice}'")), "{refused}");
        }
    }
}
