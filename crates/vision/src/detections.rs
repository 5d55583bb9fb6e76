//! Tables of detections: what a detector saw in the frames of a recording.
//!
//! CSV with the columns `frame, view, label, score, x_min, y_min, x_max, y_max, mask`, or JSON, a
//! list of objects with `frame`, `view`, `label`, `score`, `box` (four numbers) and `mask`. Boxes are
//! in px. A label is a COCO category, by number (of 91) or name. A mask is a PNG beside the table, or a
//! COCO segmentation (in CSV as JSON text); it may be left out.

use std::path::{Path, PathBuf};

use serde_json::Value as Json;

use crate::coco;
use crate::error::{Result, VisionError, read};
use crate::mask::Mask;

/// Largest table that is read.
const MAX_BYTES: u64 = 256 << 20;
/// Largest frame number.
const MAX_FRAME: u32 = 10_000_000;

/// One object in one frame.
#[derive(Clone, Debug)]
pub struct Detection {
    /// Number of the frame in its video, from 0.
    pub frame: u32,
    /// View, 1 to 4.
    pub view: u8,
    /// COCO name of the category, or another detector's label.
    pub label: String,
    /// Confidence, 0 to 1.
    pub score: f64,
    /// Left, top, right and bottom edge in px.
    pub bounds: [f64; 4],
    mask: Segmentation,
}

#[derive(Clone, Debug)]
enum Segmentation {
    None,
    File(PathBuf),
    Coco(Json),
}

impl Detection {
    /// The pixels of the object; `None` where the table gives none. Polygons need the `(width, height)`
    /// of the image.
    ///
    /// # Errors
    /// The mask is damaged.
    pub fn mask(&self, size: Option<(usize, usize)>) -> Result<Option<Mask>> {
        match &self.mask {
            Segmentation::None => Ok(None),
            Segmentation::File(path) => Mask::read(path).map(Some),
            Segmentation::Coco(json) => match coco::mask(json, size) {
                Ok(mask) => Ok(Some(mask)),
                Err(reason) => {
                    let Self { frame, view, .. } = *self;
                    Err(VisionError::Mask { frame, view, label: self.label.clone(), reason })
                }
            },
        }
    }

    /// Width and height of the box in px.
    pub fn size(&self) -> [f64; 2] {
        [self.bounds[2] - self.bounds[0], self.bounds[3] - self.bounds[1]]
    }
}

/// Reads a table, in its order.
///
/// # Errors
/// [`VisionError`] with the line or entry at fault.
pub fn read_detections(path: &Path) -> Result<Vec<Detection>> {
    let bytes = read(path, MAX_BYTES)?;
    if path.extension().is_some_and(|e| e.eq_ignore_ascii_case("json")) {
        from_json(&bytes, path)
    } else {
        from_csv(&bytes, path)
    }
}

fn from_json(bytes: &[u8], path: &Path) -> Result<Vec<Detection>> {
    let table: Vec<Json> = serde_json::from_slice(bytes)
        .map_err(|e| VisionError::file(path, format!("not a JSON list of detections: {e}")))?;
    let rows = table.iter().enumerate().map(|(i, row)| {
        let text = |key: &str| match row.get(key) {
            Some(Json::String(text)) => Some(text.clone()),
            Some(Json::Number(number)) => Some(number.to_string()),
            _ => None,
        };
        let side = |k: usize| row.get("box").and_then(|b| b.get(k)).map(Json::to_string);
        let segmentation = match row.get("mask") {
            None | Some(Json::Null) => Segmentation::None,
            Some(Json::String(file)) => Segmentation::File(beside(path, file)),
            Some(coco) => Segmentation::Coco(coco.clone()),
        };
        let bounds = std::array::from_fn(side);
        detection(text, bounds, segmentation)
            .map_err(|reason| VisionError::file(path, format!("entry {}: {reason}", i + 1)))
    });
    rows.collect()
}

fn from_csv(bytes: &[u8], path: &Path) -> Result<Vec<Detection>> {
    let mut reader = csv::ReaderBuilder::new().trim(csv::Trim::All).from_reader(bytes);
    let fault = |e: csv::Error| VisionError::file(path, format!("not a readable table: {e}"));
    let header = reader.headers().map_err(fault)?.clone();
    let column = |name: &str| header.iter().position(|h| h.eq_ignore_ascii_case(name));
    for name in ["frame", "view", "label", "score", "x_min", "y_min", "x_max", "y_max"] {
        if column(name).is_none() {
            let there: Vec<_> = header.iter().collect();
            let there = there.join(", ");
            return Err(VisionError::file(path, format!("no column '{name}'; it has {there}")));
        }
    }
    let rows = reader.records().map(|row| {
        let row = row.map_err(fault)?;
        let line = row.position().map_or(0, |p| p.line());
        let text = |key: &str| column(key).and_then(|c| row.get(c)).map(str::to_string);
        let place = |reason: String| VisionError::file(path, format!("line {line}: {reason}"));
        let segmentation = match text("mask").as_deref() {
            None | Some("") => Segmentation::None,
            Some(json) if json.starts_with(['{', '[']) => Segmentation::Coco(
                serde_json::from_str(json)
                    .map_err(|e| place(format!("a mask that is not readable as JSON: {e}")))?,
            ),
            Some(file) => Segmentation::File(beside(path, file)),
        };
        let bounds = ["x_min", "y_min", "x_max", "y_max"].map(text);
        detection(text, bounds, segmentation).map_err(place)
    });
    rows.collect()
}

fn beside(table: &Path, file: &str) -> PathBuf {
    table.parent().unwrap_or(Path::new("")).join(file)
}

fn detection(
    text: impl Fn(&str) -> Option<String>,
    bounds: [Option<String>; 4],
    mask: Segmentation,
) -> std::result::Result<Detection, String> {
    let shown = |value: &Option<String>| value.clone().unwrap_or_else(|| "nothing".into());
    let frame = text("frame");
    let number = frame.as_ref().and_then(|f| f.parse().ok()).filter(|&f| f <= MAX_FRAME);
    let frame = number.ok_or_else(|| format!("'{}' is not a frame number", shown(&frame)))?;
    let view = text("view");
    let number = view.as_ref().and_then(|v| v.trim_start_matches('c').parse().ok());
    let view = number
        .filter(|v| (1..=4).contains(v))
        .ok_or_else(|| format!("'{}' is not a view (1 to 4, or c1 to c4)", shown(&view)))?;
    let label = text("label").filter(|l| !l.is_empty()).ok_or("no label")?;
    let label = match label.parse() {
        Ok(number) => coco::category_name(number)
            .ok_or_else(|| format!("{number} is not a COCO category (1 to 90)"))?
            .to_string(),
        Err(_) => label.to_lowercase(),
    };
    let score = text("score");
    let value = score.as_ref().and_then(|s| s.parse().ok()).filter(|s| (0.0..=1.0).contains(s));
    let score = value.ok_or_else(|| format!("'{}' is not a score from 0 to 1", shown(&score)))?;
    let mut sides = [0.0; 4];
    for (side, text) in sides.iter_mut().zip(&bounds) {
        *side = text
            .as_ref()
            .and_then(|t| t.parse().ok())
            .filter(|v: &f64| v.abs() <= 1e6)
            .ok_or_else(|| format!("'{}' is not an edge of a box in px", shown(text)))?;
    }
    if sides[0] > sides[2] || sides[1] > sides[3] {
        return Err(format!("a box {sides:?} whose right or lower edge comes first"));
    }
    Ok(Detection { frame, view, label, score, bounds: sides, mask })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn table(name: &str, text: &str) -> Result<Vec<Detection>> {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join(name);
        std::fs::write(&path, text).unwrap();
        let mask = Mask { width: 2, height: 1, data: vec![true, false] };
        std::fs::write(dir.path().join("m.png"), mask.to_png().unwrap()).unwrap();
        let rows = read_detections(&path)?;
        if let Some(first) = rows.first() {
            assert_eq!(first.mask(None).unwrap().map(|m| m.area()), Some(1), "{text}");
        }
        Ok(rows)
    }

    const HEADER: &str = "frame,view,label,score,x_min,y_min,x_max,y_max,mask\n";

    #[test]
    fn csv_and_json_say_the_same() {
        let csv = format!("{HEADER}0,c1,47,0.9,1,2,3.5,4,m.png\n8,2,Wine Glass,0.5,0,0,1,1,\n");
        let json = r#"[{"frame":0,"view":1,"label":"cup","score":0.9,"box":[1,2,3.5,4],"mask":"m.png"},
            {"frame":8,"view":"c2","label":46,"score":0.5,"box":[0,0,1,1]}]"#;
        let (a, b) = (table("d.csv", &csv).unwrap(), table("d.json", json).unwrap());
        for (a, b) in a.iter().zip(&b) {
            assert_eq!(
                (a.frame, a.view, &a.label, a.score, a.bounds),
                (b.frame, b.view, &b.label, b.score, b.bounds)
            );
        }
        assert_eq!((a.len(), a[1].label.as_str(), a[0].size()), (2, "wine glass", [2.5, 2.0]));
        assert!(a[1].mask(None).unwrap().is_none());
        let rle = r#"{""size"":[1,2],""counts"":[0,1,1]}"#;
        table("d.csv", &format!("{HEADER}0,1,cup,1,0,0,1,1,\"{rle}\"\n")).unwrap();
    }

    #[test]
    fn faults_give_the_line() {
        for (row, part) in [
            ("x,1,cup,1,0,0,1,1,", "line 2: 'x' is not a frame number"),
            ("1,5,cup,1,0,0,1,1,", "not a view"),
            ("1,1,12,1,0,0,1,1,", "12 is not a COCO category"),
            ("1,1,cup,1.5,0,0,1,1,", "not a score"),
            ("1,1,cup,nan,0,0,1,1,", "not a score"),
            ("1,1,cup,1,0,0,inf,1,", "not an edge"),
            ("1,1,cup,1,3,0,1,1,", "comes first"),
            ("1,1,cup,1,0,0,1,1,{x", "not readable as JSON"),
            ("1,1,cup", "not a readable table"),
        ] {
            let error = table("d.csv", &format!("{HEADER}{row}\n")).unwrap_err().to_string();
            assert!(error.contains(part), "{error}");
        }
        let error = table("d.csv", "frame,view\n1,1\n").unwrap_err().to_string();
        assert!(error.contains("no column 'label'; it has frame, view"), "{error}");
        assert!(table("d.json", "{}").unwrap_err().to_string().contains("JSON list"));
    }
}
