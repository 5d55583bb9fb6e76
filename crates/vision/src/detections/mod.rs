//! Tables of detections: what a detector saw in the frames of a recording.
//!
//! CSV with the columns `frame, view, label, score, x_min, y_min, x_max, y_max, mask`, or JSON, a
//! list of objects with `frame`, `view`, `label`, `score`, `box` (four numbers) and `mask`. Boxes are
//! in px. A label is a COCO category, by number (of 91) or name. A mask is a PNG beside the table, or a
//! COCO segmentation (in CSV as JSON text); it may be left out.

mod csv;
mod json;

use std::path::{Path, PathBuf};

use crate::coco;
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
    /// The mask is damaged, or its extent is outside the box.
    pub fn mask(&self, size: Option<(usize, usize)>) -> Result<Option<Mask>> {
        let mask = match &self.mask {
            Segmentation::None => return Ok(None),
            Segmentation::File(path) => Mask::read(path)?,
            Segmentation::Coco(segmentation) => {
                segmentation.mask(size).map_err(|reason| self.mask_fault(reason))?
            }
        };
        // One of another size is refused as that, by who knows the image.
        let comparable = size.is_none_or(|size| size == (mask.width, mask.height));
        let outside = mask.bounds().filter(|bounds| comparable && !self.overlaps(*bounds));
        if let Some(bounds) = outside {
            let [left, top, right, bottom] = bounds;
            return Err(self.mask_fault(format!(
                "its pixels (columns {left} to {}, rows {top} to {}) are all outside the box {:?}; \
                 expected the mask of the same object, in px of the same image",
                right - 1,
                bottom - 1,
                self.bounds
            )));
        }
        Ok(Some(mask))
    }

    /// Whether the box overlaps a rectangle of pixels (first column and row, those after the last), or
    /// touches it: detectors round.
    fn overlaps(&self, [left, top, right, bottom]: [usize; 4]) -> bool {
        let [x_min, y_min, x_max, y_max] = self.bounds;
        x_min <= right as f64
            && y_min <= bottom as f64
            && x_max >= left as f64
            && y_max >= top as f64
    }

    fn mask_fault(&self, reason: String) -> VisionError {
        let Self { frame, view, .. } = *self;
        VisionError::Mask { frame, view, label: self.label.clone(), reason }
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
        Some(b'[' | b'{') => json::read(bytes, path),
        _ => csv::read(bytes, path),
    }
}

fn beside(table: &Path, file: &str) -> PathBuf {
    table.parent().unwrap_or(Path::new("")).join(file)
}

/// A whole number without what pandas may write after it: also 8.0.
fn whole(number: &str) -> &str {
    number.strip_suffix(".0").unwrap_or(number)
}

fn detection(
    [frame, view, label]: [&str; 3],
    score: f64,
    bounds: [f64; 4],
    mask: Segmentation,
) -> std::result::Result<Detection, String> {
    let number = whole(frame).parse().ok().filter(|&f| f <= MAX_FRAME);
    let frame = number.ok_or_else(|| format!("'{frame}' is not a frame number"))?;
    let number = view.strip_prefix('c').unwrap_or(whole(view)).parse().ok();
    let view = number
        .filter(|v| (1..=4).contains(v))
        .ok_or_else(|| format!("'{view}' is not a view (1 to 4, or c1 to c4)"))?;
    let label = label.trim();
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
    check_box(bounds)?;
    Ok(Detection { frame, view, label, score, bounds, mask })
}

/// Refuses numbers that cannot be the left, top, right and bottom edge of a box.
///
/// # Errors
/// Which, and why.
pub fn check_box(bounds: [f64; 4]) -> std::result::Result<(), String> {
    if let Some(side) = bounds.iter().find(|side| side.is_nan() || side.abs() > 1e6) {
        return Err(format!("'{side}' is not an edge of a box in px"));
    }
    if bounds[0] > bounds[2] || bounds[1] > bounds[3] {
        return Err(format!("a box {bounds:?} whose right or lower edge comes first"));
    }
    Ok(())
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
        let csv = format!("{HEADER}0,c1,47,0.9,0,1,2.5,3,m.png\n8.0,2.0,Wine Glass,0.5,0,0,1,1,\n");
        let json = r#"[{"frame":0,"view":1,"label":"cup","score":0.9,"box":[0,1,2.5,3],"mask":"m.png"},
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
            ("1,1,cup", "line 2: 3 fields, but the first line has 9"),
            ("1,1,\"cup,1,0,0,1,1,\n1,1,cup,1,0,0,1,1,", "line 2: a quotation mark opens here"),
        ] {
            let error = table("d.csv", &format!("{HEADER}{row}\n")).unwrap_err().to_string();
            assert!(error.contains(part), "{error}");
        }
        // As Excel ends lines and separates columns, and after an empty one.
        let rows = format!("{HEADER}1,1,cup,1,0,0,1,1,m.png\n\n1,5,cup,1,0,0,1,1,\n");
        for (ending, comma) in [("\n", ","), ("\r\n", ";"), ("\r", "\t")] {
            let rows = rows.replace(',', comma).replace('\n', ending);
            let error = table("d.csv", &rows).unwrap_err().to_string();
            assert!(error.contains("line 4: '5' is not a view"), "{error}");
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

    /// The box of another object, or px of an image of another size.
    #[test]
    fn a_mask_outside_its_box_is_refused() {
        let rle = r#"{""size"":[4,8],""counts"":[0,4,28]}"#;
        let mask = |bounds: &str| {
            let row = format!("{HEADER}3,2,cup,1,{bounds},\"{rle}\"\n");
            let dir = tempfile::tempdir().unwrap();
            let path = dir.path().join("d.csv");
            std::fs::write(&path, row).unwrap();
            read_detections(&path).unwrap()[0].mask(None)
        };
        for bounds in ["0,0,1,4", "1,0,5,4", "-9,-9,0,0"] {
            assert_eq!(mask(bounds).unwrap().unwrap().area(), 4, "{bounds}");
        }
        for bounds in ["2,0,5,4", "0,5,1,9", "-9,0,-1,4", "0,-9,1,-1"] {
            let error = mask(bounds).unwrap_err().to_string();
            assert!(error.contains("columns 0 to 0, rows 0 to 3"), "{error}");
        }
    }

    #[test]
    fn a_whole_number_with_a_point_is_a_category_too() {
        let rows = table("d.csv", &format!("{HEADER}0,1,47.0,1,0,0,1,1,m.png\n")).unwrap();
        assert_eq!(rows[0].label, "cup");
    }
}
