//! Tables of detections: what a detector saw in the frames of a recording.
//!
//! CSV with the columns `frame, view, label, score, x_min, y_min, x_max, y_max, mask`, or JSON, a
//! list of objects with `frame`, `view`, `label`, `score`, `box` (four numbers) and `mask`. Boxes are
//! in px. A label is a COCO category, by number (of 91) or name. A mask is a PNG beside the table, or a
//! COCO segmentation (in CSV as JSON text); it may be left out.

use std::fmt;
use std::path::{Path, PathBuf};

use serde::de::{Deserialize, Deserializer, Error, MapAccess, SeqAccess, Visitor};

use crate::coco::{self, SegmentationVisitor};
use crate::error::{Result, VisionError, read};
use crate::mask::Mask;

/// Largest table that is read: a minute of four views with plain run lengths takes a tenth.
const MAX_BYTES: u64 = 64 << 20;
/// Largest number of detections in a table.
const MAX_DETECTIONS: usize = 1 << 20;
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
    Coco(coco::Segmentation),
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
            Segmentation::Coco(segmentation) => match segmentation.mask(size) {
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
    let bytes = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(&bytes);
    // The header of a CSV begins with a letter, whatever the name of the file.
    match bytes.trim_ascii_start().first() {
        Some(b'[' | b'{') => from_json(bytes, path),
        _ => from_csv(bytes, path),
    }
}

/// An entry of a JSON table.
#[derive(serde::Deserialize)]
struct Entry {
    frame: Text,
    view: Text,
    label: Text,
    score: f64,
    #[serde(rename = "box")]
    bounds: [f64; 4],
    #[serde(default)]
    mask: EntryMask,
}

/// A string, or a number as it is written.
struct Text(String);

impl<'de> Deserialize<'de> for Text {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> std::result::Result<Self, D::Error> {
        struct TextVisitor;
        impl Visitor<'_> for TextVisitor {
            type Value = Text;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("a number or a string")
            }

            fn visit_str<E: Error>(self, text: &str) -> std::result::Result<Text, E> {
                Ok(Text(text.into()))
            }

            fn visit_u64<E: Error>(self, number: u64) -> std::result::Result<Text, E> {
                Ok(Text(number.to_string()))
            }

            fn visit_i64<E: Error>(self, number: i64) -> std::result::Result<Text, E> {
                Ok(Text(number.to_string()))
            }

            fn visit_f64<E: Error>(self, number: f64) -> std::result::Result<Text, E> {
                Ok(Text(number.to_string()))
            }
        }
        deserializer.deserialize_any(TextVisitor)
    }
}

/// A file's name, a COCO segmentation, or nothing.
#[derive(Default)]
enum EntryMask {
    #[default]
    None,
    File(String),
    Coco(coco::Segmentation),
}

impl<'de> Deserialize<'de> for EntryMask {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> std::result::Result<Self, D::Error> {
        struct MaskVisitor;
        impl<'de> Visitor<'de> for MaskVisitor {
            type Value = EntryMask;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("the name of a PNG, ")?;
                SegmentationVisitor.expecting(f)
            }

            fn visit_unit<E: Error>(self) -> std::result::Result<EntryMask, E> {
                Ok(EntryMask::None)
            }

            fn visit_str<E: Error>(self, file: &str) -> std::result::Result<EntryMask, E> {
                Ok(EntryMask::File(file.into()))
            }

            fn visit_map<A: MapAccess<'de>>(
                self,
                map: A,
            ) -> std::result::Result<EntryMask, A::Error> {
                SegmentationVisitor.visit_map(map).map(EntryMask::Coco)
            }

            fn visit_seq<A: SeqAccess<'de>>(
                self,
                list: A,
            ) -> std::result::Result<EntryMask, A::Error> {
                SegmentationVisitor.visit_seq(list).map(EntryMask::Coco)
            }
        }
        deserializer.deserialize_any(MaskVisitor)
    }
}

/// Makes the detections of a JSON list one by one, so that only they are held.
struct Entries<'a>(&'a Path);

impl<'de> Visitor<'de> for Entries<'_> {
    type Value = Vec<Detection>;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a list of detections")
    }

    fn visit_seq<A: SeqAccess<'de>>(
        self,
        mut list: A,
    ) -> std::result::Result<Vec<Detection>, A::Error> {
        let mut detections = Vec::new();
        while let Some(entry) = list.next_element::<Entry>()? {
            let number = detections.len() + 1;
            let fault = |reason: String| A::Error::custom(format!("entry {number}: {reason}"));
            if number > MAX_DETECTIONS {
                return Err(fault(format!("a table has at most {MAX_DETECTIONS}")));
            }
            let mask = match entry.mask {
                EntryMask::None => Segmentation::None,
                EntryMask::File(file) => Segmentation::File(beside(self.0, &file)),
                EntryMask::Coco(coco) => Segmentation::Coco(coco),
            };
            let names = [&entry.frame, &entry.view, &entry.label].map(|t| t.0.as_str());
            let found = detection(names, entry.score, entry.bounds, mask);
            detections.push(found.map_err(fault)?);
        }
        Ok(detections)
    }
}

fn from_json(bytes: &[u8], path: &Path) -> Result<Vec<Detection>> {
    let mut json = serde_json::Deserializer::from_slice(bytes);
    let detections = json.deserialize_seq(Entries(path)).and_then(|d| json.end().map(|()| d));
    detections.map_err(|e| VisionError::file(path, format!("not a JSON list of detections: {e}")))
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
        // The first of two would count, whatever the other says.
        if header.iter().filter(|h| h.eq_ignore_ascii_case(name)).count() > 1 {
            return Err(VisionError::file(path, format!("two columns are named '{name}'")));
        }
    }
    let mut detections = Vec::new();
    for row in reader.records() {
        let row = row.map_err(fault)?;
        let line = row.position().map_or(0, |p| p.line());
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
            text.parse::<f64>().map_err(|_| place(format!("'{text}' is not {what}")))
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

fn beside(table: &Path, file: &str) -> PathBuf {
    table.parent().unwrap_or(Path::new("")).join(file)
}

fn detection(
    [frame, view, label]: [&str; 3],
    score: f64,
    bounds: [f64; 4],
    mask: Segmentation,
) -> std::result::Result<Detection, String> {
    let number = frame.parse().ok().filter(|&f| f <= MAX_FRAME);
    let frame = number.ok_or_else(|| format!("'{frame}' is not a frame number"))?;
    let number = view.strip_prefix('c').unwrap_or(view).parse().ok();
    let view = number
        .filter(|v| (1..=4).contains(v))
        .ok_or_else(|| format!("'{view}' is not a view (1 to 4, or c1 to c4)"))?;
    // What is a number is a category's, as detectors write it: also 47.0.
    let label = match label.parse::<f64>() {
        Ok(number) => Some(number)
            .filter(|n| n.fract() == 0.0 && (0.0..=255.0).contains(n))
            .and_then(|n| coco::category_name(n as u8))
            .ok_or_else(|| format!("{label} is not a COCO category (1 to 90)"))?
            .to_string(),
        Err(_) if label.is_empty() => return Err("no label".into()),
        Err(_) => label.to_lowercase(),
    };
    if !(0.0..=1.0).contains(&score) {
        return Err(format!("'{score}' is not a score from 0 to 1"));
    }
    if let Some(side) = bounds.iter().find(|side| side.is_nan() || side.abs() > 1e6) {
        return Err(format!("'{side}' is not an edge of a box in px"));
    }
    if bounds[0] > bounds[2] || bounds[1] > bounds[3] {
        return Err(format!("a box {bounds:?} whose right or lower edge comes first"));
    }
    Ok(Detection { frame, view, label, score, bounds, mask })
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
        // With a byte-order mark, too.
        let (a, b) =
            (table("d.json", &csv).unwrap(), table("d.csv", &format!("\u{feff}{json}")).unwrap());
        assert_eq!(table("d.csv", &format!("\u{feff}{csv}")).unwrap().len(), 2);
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
            ("1,5,cup,1,0,0,1,1,", "'5' is not a view"),
            ("1,1,12,1,0,0,1,1,", "12 is not a COCO category"),
            ("1,1,300,1,0,0,1,1,", "300 is not a COCO category"),
            ("1,1,47.5,1,0,0,1,1,", "47.5 is not a COCO category"),
            ("1,1,nan,1,0,0,1,1,", "nan is not a COCO category"),
            ("1,ccc1,cup,1,0,0,1,1,", "'ccc1' is not a view"),
            ("1,1,,1,0,0,1,1,", "no label"),
            ("1,1,cup,1.5,0,0,1,1,", "is not a score"),
            ("1,1,cup,nan,0,0,1,1,", "is not a score"),
            ("1,1,cup,1,0,0,inf,1,", "is not an edge"),
            ("1,1,cup,1,3,0,1,1,", "comes first"),
            ("1,1,cup,1,0,0,1,1,{x", "not readable as JSON"),
            ("1,1,cup", "not a readable table"),
        ] {
            let error = table("d.csv", &format!("{HEADER}{row}\n")).unwrap_err().to_string();
            assert!(error.contains(part), "{error}");
        }
        let error = table("d.csv", "frame,view\n1,1\n").unwrap_err().to_string();
        assert!(error.contains("no column 'label'; it has frame, view"), "{error}");
        for (text, part) in [
            ("{}", "not a JSON list of detections"),
            ("[{}]", "missing field `frame`"),
            (
                r#"[{"frame":0,"view":5,"label":1,"score":1,"box":[0,0,1,1]}]"#,
                "entry 1: '5' is not a view",
            ),
            (r#"[{"frame":0,"view":1,"label":1,"score":1,"box":[0,0,1]}]"#, "array of length 4"),
            (
                r#"[{"frame":0,"view":1,"label":1,"score":1,"box":[0,0,1,1],"mask":{"size":[1,2],"counts":[0,0,2]}}]"#,
                "empty run",
            ),
            (
                r#"[{"frame":0,"view":1,"label":1,"score":1,"box":[0,0,1,1],"mask":7}]"#,
                "name of a PNG",
            ),
        ] {
            let error = table("d.json", text).unwrap_err().to_string();
            assert!(error.contains(part), "{text}: {error}");
        }
    }

    #[test]
    fn a_whole_number_with_a_point_is_a_category_too() {
        let rows = table("d.csv", &format!("{HEADER}0,1,47.0,1,0,0,1,1,m.png\n")).unwrap();
        assert_eq!(rows[0].label, "cup");
    }
}
