//! What a detector found in a frame, as rows of a table of detections.

use corsmal_vision::{Category, Mask, Rgb, category_name, check_box, compress};
use serde_json::{Value, json};

/// Masks hold a pixel from here on.
const INSIDE: f32 = 0.5;

/// What torchvision's Mask R-CNN gives for a frame, where the runtime keeps it: the masks of a hundred objects
/// are 350 MiB.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Instances<'a> {
    /// Left, top, right and bottom edge in px of each.
    pub boxes: &'a [[f32; 4]],
    /// COCO category of each, a number of 91.
    pub labels: &'a [i64],
    /// Confidence of each, 0 to 1.
    pub scores: &'a [f32],
    /// Pixels of each, row by row, in the size of the frame; 0 to 1.
    pub masks: &'a [f32],
}

/// The frame as the detector takes it, `[colour][row][column]`, 0 to 1.
pub fn input(image: &Rgb) -> Vec<f32> {
    let colour = |c: usize| image.data.iter().skip(c).step_by(3).map(|&v| f32::from(v) / 255.0);
    (0..3).flat_map(colour).collect()
}

impl Instances<'_> {
    /// Rows of a table, in their order: all of a known category with at least `score`; containers with
    /// their masks.
    ///
    /// # Errors
    /// Numbers that cannot be edges, confidences or a mask of `size`, columns by rows.
    pub fn rows(
        &self,
        (view, frame): (u8, u32),
        size: (usize, usize),
        score: f32,
    ) -> Result<Vec<Value>, String> {
        let count = self.boxes.len();
        let pixels = size.0 * size.1;
        if self.labels.len() != count
            || self.scores.len() != count
            || self.masks.len() != count * pixels
        {
            return Err(format!(
                "{count} boxes, {} labels, {} scores and {} mask pixels for a frame of {} by {} px",
                self.labels.len(),
                self.scores.len(),
                self.masks.len(),
                size.0,
                size.1
            ));
        }
        let mut rows = Vec::new();
        for i in 0..count {
            let (bounds, certain) = (self.boxes[i], self.scores[i]);
            if !(0.0..=1.0).contains(&certain) || !bounds.iter().all(|edge| edge.is_finite()) {
                return Err(format!(
                    "detection {i}: score {certain}, box {bounds:?}; expected a score from 0 to 1 and finite edges"
                ));
            }
            let name = u8::try_from(self.labels[i]).ok().and_then(category_name);
            let Some(name) = name.filter(|_| certain >= score) else { continue };
            check_box(bounds.map(f64::from)).map_err(|why| format!("detection {i}: {why}"))?;
            let mut row = json!({
                "frame": frame, "view": view, "label": name, "score": certain, "box": bounds,
            });
            if Category::of_label(name).is_some() {
                let data = &self.masks[i * pixels..(i + 1) * pixels];
                if let Some(value) = data.iter().find(|value| !value.is_finite()) {
                    return Err(format!("detection {i}: a number of its mask is {value}"));
                }
                let data = data.iter().map(|&value| value >= INSIDE).collect();
                let mask = Mask { width: size.0, height: size.1, data };
                row["mask"] = json!({ "size": [size.1, size.0], "counts": compress(&mask) });
            }
            rows.push(row);
        }
        Ok(rows)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn colours_lie_apart() {
        let image = Rgb { width: 2, height: 1, data: vec![0, 51, 102, 255, 204, 153] };
        assert_eq!(input(&image), [0.0, 1.0, 0.2, 0.8, 0.4, 0.6]);
    }

    #[test]
    fn masks_of_no_numbers_are_refused() {
        let found = |mask: &[f32]| {
            let boxes = [[0.0, 0.0, 1.0, 1.0]];
            Instances { boxes: &boxes, labels: &[47], scores: &[0.9], masks: mask }
                .rows((0, 1), (2, 1), 0.5)
                .map(|rows| rows.len())
        };
        assert_eq!(found(&[0.2, 0.7]), Ok(1));
        for value in [f32::NAN, f32::INFINITY] {
            let said = found(&[0.2, value]).unwrap_err();
            assert!(said.contains("a number of its mask"), "{said}");
        }
    }

    #[test]
    fn known_categories_become_rows() {
        let found = Instances {
            boxes: &[[0.0, 0.0, 2.0, 1.0], [0.5, 0.0, 1.0, 2.0], [0.0; 4], [0.0; 4]],
            labels: &[1, 47, 12, 47],
            scores: &[0.9, 0.8, 0.7, 0.1],
            masks: &[
                1.0, 1.0, 1.0, 1.0, 0.2, 0.5, 0.4, 0.9, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0,
            ],
        };
        let rows = found.rows((3, 7), (2, 2), 0.25).unwrap();
        // 12 is no category; a person has no mask.
        assert_eq!(rows.len(), 2);
        assert_eq!((&rows[0]["label"], rows[0].get("mask")), (&"person".into(), None));
        assert_eq!((&rows[1]["label"], &rows[1]["frame"]), (&"cup".into(), &7.into()));
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("d.json");
        std::fs::write(&path, Value::from(rows).to_string()).unwrap();
        let read = corsmal_vision::read_detections(&path).unwrap();
        let mask = read[1].mask(None).unwrap().unwrap();
        assert_eq!((read[1].view, mask.data), (3, vec![false, true, false, true]));

        let strange = Instances { scores: &[0.9, f32::NAN, 0.7, 0.1], ..found };
        assert!(strange.rows((3, 7), (2, 2), 0.25).unwrap_err().contains("detection 1"));
        // Tables with such boxes were written, and refused by whoever read them.
        for (bounds, why) in [
            ([558.0, 559.0, 68.0, 68.0], "right or lower edge comes first"),
            ([0.0, 0.0, 2e6, 2.0], "'2000000' is not an edge"),
            ([0.0, 0.0, f32::INFINITY, 2.0], "box [0.0, 0.0, inf, 2.0]"),
        ] {
            let boxes = [bounds, bounds, bounds, bounds];
            let said = Instances { boxes: &boxes, ..found }.rows((3, 7), (2, 2), 0.25);
            assert!(said.unwrap_err().contains(why), "{bounds:?}");
        }
        // Of what is not written, only the numbers are looked at.
        let boxes = [found.boxes[0], found.boxes[1], [2.0, 0.0, 1.0, 0.0], [2.0, 0.0, 1.0, 0.0]];
        let rows = Instances { boxes: &boxes, ..found }.rows((3, 7), (2, 2), 0.25).unwrap();
        assert_eq!(rows.len(), 2);
        let fewer = Instances { labels: &found.labels[..3], ..found };
        assert!(fewer.rows((3, 7), (2, 2), 0.25).unwrap_err().contains("3 labels"));
    }
}
