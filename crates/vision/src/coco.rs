//! Masks and categories as COCO writes them.

use std::fmt;

use serde::de::{Deserialize, Deserializer, Error, IgnoredAny, MapAccess, SeqAccess, Visitor};

use crate::image::{MAX_PIXELS, MAX_SIDE};
use crate::mask::Mask;
use crate::polygon;

/// Largest number of coordinates of a mask's polygons.
const MAX_COORDINATES: usize = 1 << 17;

/// Category numbers and names of the detectors trained on COCO (91 numbers, of which 80 are used).
const CATEGORIES: [(u8, &str); 80] = [
    (1, "person"),
    (2, "bicycle"),
    (3, "car"),
    (4, "motorcycle"),
    (5, "airplane"),
    (6, "bus"),
    (7, "train"),
    (8, "truck"),
    (9, "boat"),
    (10, "traffic light"),
    (11, "fire hydrant"),
    (13, "stop sign"),
    (14, "parking meter"),
    (15, "bench"),
    (16, "bird"),
    (17, "cat"),
    (18, "dog"),
    (19, "horse"),
    (20, "sheep"),
    (21, "cow"),
    (22, "elephant"),
    (23, "bear"),
    (24, "zebra"),
    (25, "giraffe"),
    (27, "backpack"),
    (28, "umbrella"),
    (31, "handbag"),
    (32, "tie"),
    (33, "suitcase"),
    (34, "frisbee"),
    (35, "skis"),
    (36, "snowboard"),
    (37, "sports ball"),
    (38, "kite"),
    (39, "baseball bat"),
    (40, "baseball glove"),
    (41, "skateboard"),
    (42, "surfboard"),
    (43, "tennis racket"),
    (44, "bottle"),
    (46, "wine glass"),
    (47, "cup"),
    (48, "fork"),
    (49, "knife"),
    (50, "spoon"),
    (51, "bowl"),
    (52, "banana"),
    (53, "apple"),
    (54, "sandwich"),
    (55, "orange"),
    (56, "broccoli"),
    (57, "carrot"),
    (58, "hot dog"),
    (59, "pizza"),
    (60, "donut"),
    (61, "cake"),
    (62, "chair"),
    (63, "couch"),
    (64, "potted plant"),
    (65, "bed"),
    (67, "dining table"),
    (70, "toilet"),
    (72, "tv"),
    (73, "laptop"),
    (74, "mouse"),
    (75, "remote"),
    (76, "keyboard"),
    (77, "cell phone"),
    (78, "microwave"),
    (79, "oven"),
    (80, "toaster"),
    (81, "sink"),
    (82, "refrigerator"),
    (84, "book"),
    (85, "clock"),
    (86, "vase"),
    (87, "scissors"),
    (88, "teddy bear"),
    (89, "hair drier"),
    (90, "toothbrush"),
];

/// The name of a category number.
pub fn category_name(number: u8) -> Option<&'static str> {
    CATEGORIES.iter().find(|(n, _)| *n == number).map(|(_, name)| *name)
}

/// A COCO segmentation: `{"size": [height, width], "counts": …}` with counts as numbers or as COCO's
/// compressed text, or polygons `[[x, y, x, y, …], …]`.
///
/// It is read straight into numbers: a tree of JSON values takes seventy times the text's size.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Segmentation {
    /// Columns, rows, and run lengths down the columns, outside first.
    Runs { width: usize, height: usize, counts: Vec<u32> },
    /// x and y of each polygon's points in turn.
    Polygons(Vec<Vec<f32>>),
}

impl Segmentation {
    /// The pixels; polygons need the `(width, height)` of the image.
    pub(crate) fn mask(&self, size: Option<(usize, usize)>) -> Result<Mask, String> {
        match self {
            Self::Runs { width, height, counts } => Ok(runs(counts, *width, *height)),
            Self::Polygons(polygons) => {
                let (width, height) = size.ok_or("polygons need the size of the image")?;
                let mut out = Mask::empty(width, height);
                for polygon in polygons {
                    polygon::fill(polygon, &mut out);
                }
                Ok(out)
            }
        }
    }
}

impl<'de> Deserialize<'de> for Segmentation {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(SegmentationVisitor)
    }
}

pub(crate) struct SegmentationVisitor;

impl<'de> Visitor<'de> for SegmentationVisitor {
    type Value = Segmentation;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(
            "run lengths {\"size\": [height, width], \"counts\": …} or polygons [[x, y, …], …]",
        )
    }

    fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<Segmentation, A::Error> {
        let (mut size, mut counts) = (None, None);
        while let Some(key) = map.next_key::<String>()? {
            match key.as_str() {
                "size" => size = Some(map.next_value::<[u32; 2]>()?),
                "counts" => counts = Some(map.next_value::<Counts>()?.0),
                _ => {
                    map.next_value::<IgnoredAny>()?;
                }
            }
        }
        let sound = |side: &u32| (1..=MAX_SIDE as u32).contains(side);
        let [height, width] = size
            .filter(|sides| sides.iter().all(sound))
            .ok_or_else(|| A::Error::custom("a mask without \"size\": [height, width]"))?
            .map(|side| side as usize);
        let counts = counts.ok_or_else(|| A::Error::custom("a mask without \"counts\""))?;
        if width * height > MAX_PIXELS {
            return Err(A::Error::custom(format!(
                "a mask of {width} by {height} px; the limit is {MAX_PIXELS} px"
            )));
        }
        let sum: u64 = counts.iter().copied().map(u64::from).sum();
        if sum != (width * height) as u64 {
            return Err(A::Error::custom(format!(
                "run lengths that do not add up to the {} px of the mask",
                width * height
            )));
        }
        Ok(Segmentation::Runs { width, height, counts })
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut list: A) -> Result<Segmentation, A::Error> {
        let mut polygons = Vec::new();
        let mut coordinates = 0;
        while let Some(polygon) = list.next_element::<Vec<f32>>()? {
            if polygon.len() < 6 || polygon.len() % 2 == 1 {
                return Err(A::Error::custom(
                    "a polygon must be a list x, y, x, y, … of three points or more",
                ));
            }
            coordinates += polygon.len();
            if coordinates > MAX_COORDINATES {
                return Err(A::Error::custom(format!(
                    "polygons of more than {MAX_COORDINATES} coordinates"
                )));
            }
            polygons.push(polygon);
        }
        Ok(Segmentation::Polygons(polygons))
    }
}

/// Run lengths, plain or compressed.
struct Counts(Vec<u32>);

impl<'de> Deserialize<'de> for Counts {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct CountsVisitor;
        impl<'de> Visitor<'de> for CountsVisitor {
            type Value = Counts;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("run lengths as a list of whole numbers or COCO's compressed text")
            }

            fn visit_str<E: Error>(self, text: &str) -> Result<Counts, E> {
                decompress(text).map(Counts).map_err(E::custom)
            }

            fn visit_seq<A: SeqAccess<'de>>(self, mut list: A) -> Result<Counts, A::Error> {
                let mut counts = Vec::new();
                while let Some(count) = list.next_element::<u32>()? {
                    // Only the first run may be empty: a mask has no more runs than pixels.
                    if count == 0 && !counts.is_empty() {
                        return Err(A::Error::custom("an empty run after the first"));
                    }
                    counts.push(count);
                }
                Ok(Counts(counts))
            }
        }
        deserializer.deserialize_any(CountsVisitor)
    }
}

/// Run lengths down the columns, outside first; their sum has been checked.
fn runs(counts: &[u32], width: usize, height: usize) -> Mask {
    let mut mask = Mask::empty(width, height);
    let mut at = 0;
    for (i, &count) in counts.iter().enumerate() {
        let end = at + count as usize;
        if i % 2 == 1 {
            for pixel in at..end {
                mask.data[pixel % height * width + pixel / height] = true;
            }
        }
        at = end;
    }
    mask
}

/// COCO's text: numbers of five bits a character, from the third on as differences to the last but
/// one.
fn decompress(text: &str) -> Result<Vec<u32>, String> {
    const FAULT: &str = "compressed run lengths that are damaged";
    let mut counts: Vec<u32> = Vec::new();
    let mut sum = 0u64;
    let mut bytes = text.bytes();
    while let Some(mut byte) = bytes.next() {
        let (mut value, mut shift) = (0i64, 0);
        loop {
            let bits = i64::from(byte.checked_sub(48).filter(|b| *b < 64).ok_or(FAULT)?);
            if shift > 50 {
                return Err(FAULT.into());
            }
            value |= (bits & 31) << shift;
            shift += 5;
            if bits & 32 == 0 {
                if bits & 16 != 0 {
                    value |= -1 << shift;
                }
                break;
            }
            byte = bytes.next().ok_or(FAULT)?;
        }
        if counts.len() > 2 {
            let before = i64::from(counts[counts.len() - 2]);
            value = value.checked_add(before).ok_or(FAULT)?;
        }
        let count = u32::try_from(value).map_err(|_| FAULT)?;
        sum += u64::from(count);
        // Before memory is filled with runs that no mask has.
        if sum > MAX_PIXELS as u64 || count == 0 && !counts.is_empty() {
            return Err(FAULT.into());
        }
        counts.push(count);
    }
    Ok(counts)
}

/// COCO's text of a mask.
pub fn compress(mask: &Mask) -> String {
    let mut counts = vec![0i64];
    let mut inside = false;
    for column in 0..mask.width {
        for row in 0..mask.height {
            if mask.data[row * mask.width + column] != inside {
                inside = !inside;
                counts.push(0);
            }
            if let Some(last) = counts.last_mut() {
                *last += 1;
            }
        }
    }
    let mut text = String::new();
    for (i, &count) in counts.iter().enumerate() {
        let mut value = if i > 2 { count - counts[i - 2] } else { count };
        loop {
            let bits = (value & 31) as u8;
            value >>= 5;
            let done = value == if bits & 16 != 0 { -1 } else { 0 };
            text.push(char::from(48 + (bits | if done { 0 } else { 32 })));
            if done {
                break;
            }
        }
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mask::tests::drawn;
    use serde_json::{Value as Json, json};

    fn mask(json: &Json, size: Option<(usize, usize)>) -> Result<Mask, String> {
        let read: Segmentation = serde_json::from_value(json.clone()).map_err(|e| e.to_string())?;
        read.mask(size)
    }

    #[test]
    fn runs_go_down_the_columns() {
        let expected = drawn(&["..#.", ".##.", ".#.."]);
        let plain = json!({"size": [3, 4], "counts": [4, 4, 4]});
        assert_eq!(mask(&plain, None).unwrap(), expected);
        // The text that pycocotools gives for these counts.
        let text = json!({"size": [3, 4], "counts": "444"});
        assert_eq!(mask(&text, None).unwrap(), expected);
        assert_eq!(compress(&expected), "444");
    }

    #[test]
    fn polygons_cover_pixel_centres() {
        let square = json!([[1.0, 1.0, 3.0, 1.0, 3.0, 2.0, 1.0, 2.0]]);
        let expected = drawn(&["....", ".##.", "...."]);
        assert_eq!(mask(&square, Some((4, 3))).unwrap(), expected);
        assert!(mask(&square, None).unwrap_err().contains("size of the image"));
    }

    #[test]
    fn hostile_masks_are_refused() {
        for (json, part) in [
            (json!({"size": [1_000_000, 1_000_000], "counts": [1]}), "size"),
            (json!({"size": [8192, 8192], "counts": [67_108_864]}), "limit"),
            (json!({"size": [3, 4], "counts": [4, u32::MAX, 9]}), "add up"),
            (json!({"size": [3, 4], "counts": [4, u64::MAX, 9]}), "u32"),
            (json!({"size": [3, 4], "counts": [4, -4, 12]}), "u32"),
            (json!({"size": [3, 4], "counts": [0, 0, 12]}), "empty run after the first"),
            (json!({"size": [3, 4], "counts": "oooooooooooooo"}), "damaged"),
            (json!({"size": [3, 4], "counts": "\u{7f}"}), "damaged"),
            (json!({"size": [3, 4]}), "counts"),
            (json!([[1, 2, 3, 4]]), "three points"),
            (json!([[1, 2, 3, 4, 5, 6, 7]]), "three points"),
            (json!([[1, 2, 3, 4, 5, "x"]]), "f32"),
            (json!([vec![1.0; MAX_COORDINATES + 2]]), "coordinates"),
            (json!(7), "expected run lengths"),
        ] {
            let error = mask(&json, Some((4, 3))).unwrap_err();
            assert!(error.contains(part), "{json}: {error}");
        }
    }

    proptest::proptest! {
        #[test]
        fn compressed_masks_come_back(bits in proptest::collection::vec(proptest::bool::weighted(0.9), 20 * 31)) {
            let original = Mask { width: 20, height: 31, data: bits };
            let json = json!({"size": [31, 20], "counts": compress(&original)});
            proptest::prop_assert_eq!(mask(&json, None).unwrap(), original);
        }
    }
}
