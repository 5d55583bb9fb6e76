//! Tables of detections in JSON.

use std::fmt;
use std::path::Path;

use serde::de::{Deserialize, Deserializer, Error, MapAccess, SeqAccess, Visitor};

use super::{Detection, MAX_DETECTIONS, Segmentation, beside, detection};
use crate::coco::{self, SegmentationVisitor};
use crate::error::{Result, VisionError};

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

pub(super) fn read(bytes: &[u8], path: &Path) -> Result<Vec<Detection>> {
    let mut json = serde_json::Deserializer::from_slice(bytes);
    let detections = json.deserialize_seq(Entries(path)).and_then(|d| json.end().map(|()| d));
    detections.map_err(|e| VisionError::file(path, format!("not a JSON list of detections: {e}")))
}
