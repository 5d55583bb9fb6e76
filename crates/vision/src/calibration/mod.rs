//! Calibration files of the data set: pickles of `[intrinsic, extrinsic, …]`, or the same as JSON.

use std::path::Path;

use serde::Serialize;
use serde_json::Value as Json;

use crate::error::{Result, VisionError, read};
use crate::matrix::{self, Matrix3, Matrix34};
use crate::pickle::{Id, Pickle, Value};

/// Largest file that is read; real ones have under 4 kB.
const MAX_BYTES: u64 = 1 << 20;
/// Largest focal length and principal point in px.
const MAX_PX: f64 = 1e5;
/// Largest distance of a camera from the world's origin in m.
pub(crate) const MAX_DISTANCE: f64 = 100.0;
/// How far a rotation times its transpose may be from the unit matrix; real files: 1e-7.
const TURNED: f64 = 1e-3;
/// How far a row of 'projMatrix' may be from that of the other parts, as a share of its length: 1 or 2 px. Real
/// files: 0.
const PROJECTED: f64 = 1e-3;
/// Smallest ratio of the two focal lengths, and largest skew as a share of them; real cameras: 0.99 and 0.
const SQUARE: f64 = 0.8;
const SKEW: f64 = 0.05;
/// Least share of an image's size that twice the principal point is, or the other way around; real cameras:
/// 0.98.
const OFF_CENTRE: f64 = 0.8;

/// A camera without lens distortion, as the data set gives it.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Camera {
    /// Focal lengths and principal point in px.
    pub intrinsic: Matrix3,
    /// World to camera (the data set calls it `rvec`).
    pub rotation: Matrix3,
    /// World to camera, in m.
    pub translation: [f64; 3],
    /// World to pixels, homogeneous.
    pub projection: Matrix34,
}

/// The cameras of one view.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Calibration {
    /// Colour camera; aligned depth images are seen from here.
    pub rgb: Camera,
    /// First infrared camera.
    pub ir1: Option<Camera>,
    /// Second infrared camera.
    pub ir2: Option<Camera>,
}

impl Camera {
    /// A camera from its parts; the projection follows.
    pub fn new(intrinsic: Matrix3, rotation: Matrix3, translation: [f64; 3]) -> Self {
        let projection = std::array::from_fn(|r| {
            std::array::from_fn(|c| {
                let column = |k: usize| if c < 3 { rotation[k][c] } else { translation[k] };
                (0..3).map(|k| intrinsic[r][k] * column(k)).sum()
            })
        });
        Self { intrinsic, rotation, translation, projection }
    }

    /// Whether anything can be seen with it: focal lengths above 0 and a principal point, in px, a
    /// rotation, a place within 100 m, and the projection that follows from them.
    ///
    /// # Errors
    /// A text that names the part at fault.
    pub fn check(&self) -> std::result::Result<(), String> {
        let [[fx, skew, cx], [zero, fy, cy], last] = self.intrinsic;
        let focal = [fx, fy].iter().all(|f| (1.0..=MAX_PX).contains(f));
        let point = [cx, cy, skew].iter().all(|p| p.abs() <= MAX_PX);
        if !focal || !point || zero != 0.0 || last != [0.0, 0.0, 1.0] {
            return Err(format!(
                "'intrinsic' is not a camera matrix: expected focal lengths and a principal point of at \
                 most {MAX_PX} px over a row 0, 0, 1"
            ));
        }
        if fx.min(fy) < SQUARE * fx.max(fy) || skew.abs() > SKEW * fx {
            return Err(format!(
                "'intrinsic' has focal lengths of {fx} and {fy} px and a skew of {skew} px: expected nearly equal focal \
                 lengths and almost no skew"
            ));
        }
        let r = &self.rotation;
        let unit = (0..3).all(|i| {
            (0..3).all(|j| {
                let product: f64 = (0..3).map(|k| r[i][k] * r[j][k]).sum();
                (product - if i == j { 1.0 } else { 0.0 }).abs() <= TURNED
            })
        });
        if !unit {
            return Err(
                "'rvec' is not a rotation: expected rows of length 1 at right angles".into()
            );
        }
        if matrix::determinant(r) <= 0.0 {
            return Err("'rvec' is a mirrored rotation: expected a determinant of 1, not -1".into());
        }
        if !self.translation.iter().all(|t| t.abs() <= MAX_DISTANCE) {
            return Err(format!(
                "'tvec' puts the camera more than {MAX_DISTANCE} m away; expected metres"
            ));
        }
        if !self.projection.iter().flatten().all(|p| p.abs() <= MAX_PX * MAX_DISTANCE * 4.0) {
            return Err("'projMatrix' has numbers that are impossible for a camera".into());
        }
        if !self.projects() {
            return Err(
                "'projMatrix' is not 'intrinsic' times 'rvec' and 'tvec': they are of different \
                 calibrations; leave 'projMatrix' out, or take all four from one calibration"
                    .into(),
            );
        }
        Ok(())
    }

    /// Whether the projection is that of the other parts, up to a factor, which changes no pixel.
    fn projects(&self) -> bool {
        let own = Self::new(self.intrinsic, self.rotation, self.translation).projection;
        let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(x, y)| x * y).sum::<f64>();
        // The last row begins with a row of the rotation, whose length is 1.
        let factor = dot(&self.projection[2][..3], &own[2][..3]);
        let near = |given: &[f64; 4], own: &[f64; 4]| {
            let off: [f64; 4] = std::array::from_fn(|c| given[c] - factor * own[c]);
            dot(&off, &off) <= (PROJECTED * factor).powi(2) * dot(own, own)
        };
        factor != 0.0 && self.projection.iter().zip(&own).all(|(given, own)| near(given, own))
    }

    /// Refuses images of another resolution than the calibrated ones: a lens points near the middle of its
    /// image, and everything measured on another would be as wrong as its scale.
    pub(crate) fn check_size(&self, what: &str, width: usize, height: usize) -> Result<()> {
        let calibrated = [0, 1].map(|axis| self.intrinsic[axis][2] * 2.0);
        let fits = |size: usize, expected: f64| {
            (size as f64 * OFF_CENTRE..=size as f64 / OFF_CENTRE).contains(&expected)
        };
        if fits(width, calibrated[0]) && fits(height, calibrated[1]) {
            return Ok(());
        }
        Err(VisionError::Conflict(format!(
            "{what} has {width} by {height} px, but its calibration is of images of about {:.0} by {:.0} px; \
             give images and a calibration of the same resolution",
            calibrated[0], calibrated[1]
        )))
    }

    /// Where the camera is, in m.
    pub(crate) fn place(&self) -> [f64; 3] {
        let along = |axis: usize| (0..3).map(move |k| self.rotation[k][axis] * self.translation[k]);
        std::array::from_fn(|axis| -along(axis).sum::<f64>())
    }

    /// Pixel (column, row) of a point in m; computed as OpenCV's `projectPoints` does, but for the skew, which that
    /// leaves out.
    pub fn project(&self, point: [f64; 3]) -> [f64; 2] {
        let turned = matrix::times(&self.rotation, point);
        let [x, y, z] = std::array::from_fn(|i| turned[i] + self.translation[i]);
        let over = if z == 0.0 { 1.0 } else { 1.0 / z };
        let k = &self.intrinsic;
        [x * over * k[0][0] + y * over * k[0][1] + k[0][2], y * over * k[1][1] + k[1][2]]
    }

    /// Whether another camera's numbers are equal to about 1e-4, relative for numbers above 1.
    pub fn is_near(&self, other: &Self) -> bool {
        let numbers = |camera: &Self| {
            let matrices = [camera.intrinsic, camera.rotation, [camera.translation; 3]];
            matrices.into_iter().flatten().flatten().collect::<Vec<f64>>()
        };
        let near = |(a, b): (f64, f64)| (a - b).abs() <= 1e-4 * (1.0 + a.abs());
        numbers(self).into_iter().zip(numbers(other)).all(near)
    }

    /// Distance of a point along the camera's axis in m; below 0 after the camera.
    pub(crate) fn depth(&self, point: [f64; 3]) -> f64 {
        matrix::times(&self.rotation, point)[2] + self.translation[2]
    }

    /// Turns pixels with depth into points of the world; `None` for a singular camera.
    pub fn back_projection(&self) -> Option<BackProjection<'_>> {
        let pixel = matrix::inverse(&self.intrinsic)?;
        let turn = matrix::inverse(&self.rotation)?;
        Some(BackProjection { camera: self, pixel, turn })
    }
}

/// Pixels and depths to points of the world.
pub struct BackProjection<'a> {
    camera: &'a Camera,
    pixel: Matrix3,
    turn: Matrix3,
}

impl BackProjection<'_> {
    /// The point in m seen at a pixel (column, row) at a depth in m.
    pub fn point(&self, column: f64, row: f64, depth: f64) -> [f64; 3] {
        let seen = matrix::times(&self.pixel, [column, row, 1.0]).map(|v| v * depth);
        let shifted = std::array::from_fn(|i| seen[i] - self.camera.translation[i]);
        matrix::times(&self.turn, shifted)
    }
}

impl Calibration {
    /// Reads a calibration pickle of the data set (protocol 0) or a JSON file with the keys
    /// `intrinsic` and `extrinsic`, or a list of these two; each maps `rgb`, `ir1` and `ir2` to a
    /// matrix, or to `rvec`, `tvec` and `projMatrix`.
    ///
    /// # Errors
    /// [`VisionError`] when the file cannot be read, is a pickle that does more than make arrays,
    /// or lacks the colour camera.
    pub fn load(path: &Path) -> Result<Self> {
        Self::parse(&read(path, MAX_BYTES)?, path)
    }

    /// Parses the content of a file; `path` is named in errors.
    ///
    /// # Errors
    /// As [`Calibration::load`].
    pub fn parse(bytes: &[u8], path: &Path) -> Result<Self> {
        let bytes = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes);
        // A text pickle begins with "(" or an opcode letter, JSON with a bracket.
        let json = matches!(bytes.iter().find(|b| !b.is_ascii_whitespace()), Some(b'{' | b'['));
        let calibration = if json {
            let value: Json = serde_json::from_slice(bytes)
                .map_err(|e| VisionError::file(path, format!("not readable as JSON: {e}")))?;
            Self::from_source(&JsonSource(value))
        } else {
            let pickle = Pickle::parse(bytes).map_err(|reason| {
                VisionError::file(path, format!("not a readable calibration pickle: {reason}"))
            })?;
            Self::from_source(&PickleSource(pickle))
        };
        calibration.map_err(|reason| VisionError::file(path, reason))
    }

    fn from_source(source: &impl Source) -> std::result::Result<Self, String> {
        let camera = |name: &str| -> std::result::Result<Option<Camera>, String> {
            let Some(k) = source.numbers(&["intrinsic", name]) else { return Ok(None) };
            let intrinsic = matrix3(&k).ok_or_else(|| wrong("intrinsic", name, "3 by 3", &k))?;
            let part = |key| {
                source.numbers(&["extrinsic", name, key]).ok_or_else(|| {
                    format!("no '{key}' of numbers for camera '{name}' in the extrinsic part")
                })
            };
            let r = part("rvec")?;
            let rotation = match r[..] {
                [x, y, z] if [x, y, z].iter().all(|v| v.is_finite()) => matrix::rotation([x, y, z]),
                _ => matrix3(&r).ok_or_else(|| wrong("rvec", name, "3 by 3, or 3", &r))?,
            };
            let t = part("tvec")?;
            let translation = finite(&t).ok_or_else(|| wrong("tvec", name, "3", &t))?;
            let mut camera = Camera::new(intrinsic, rotation, translation);
            if let Some(p) = source.numbers(&["extrinsic", name, "projMatrix"]) {
                let flat: [f64; 12] =
                    finite(&p).ok_or_else(|| wrong("projMatrix", name, "3 by 4", &p))?;
                camera.projection =
                    std::array::from_fn(|r| std::array::from_fn(|c| flat[4 * r + c]));
            }
            camera.check().map_err(|reason| format!("camera '{name}': {reason}"))?;
            Ok(Some(camera))
        };
        let rgb = camera("rgb")?.ok_or(
            "no colour camera; expected an intrinsic and an extrinsic part, each with an entry \
             'rgb'",
        )?;
        Ok(Self { rgb, ir1: camera("ir1")?, ir2: camera("ir2")? })
    }
}

fn wrong(what: &str, camera: &str, expected: &str, found: &[f64]) -> String {
    format!(
        "'{what}' of camera '{camera}' is not {expected} finite numbers but {} numbers",
        found.len()
    )
}

fn finite<const N: usize>(numbers: &[f64]) -> Option<[f64; N]> {
    numbers.try_into().ok().filter(|n: &[f64; N]| n.iter().all(|v| v.is_finite()))
}

fn matrix3(numbers: &[f64]) -> Option<Matrix3> {
    let flat: [f64; 9] = finite(numbers)?;
    Some(std::array::from_fn(|r| std::array::from_fn(|c| flat[3 * r + c])))
}

/// Where the numbers come from.
trait Source {
    /// All numbers under the keys, row by row; the first key is the part.
    fn numbers(&self, keys: &[&str]) -> Option<Vec<f64>>;
}

struct JsonSource(Json);

impl Source for JsonSource {
    fn numbers(&self, keys: &[&str]) -> Option<Vec<f64>> {
        let (part, inner) = keys.split_first()?;
        let top = match &self.0 {
            Json::Array(parts) => parts.get(usize::from(*part == "extrinsic"))?,
            object => object.get(part)?,
        };
        let value = inner.iter().try_fold(top, |value, key| value.get(key))?;
        let mut numbers = Vec::new();
        flatten(value, &mut numbers).then_some(numbers)
    }
}

fn flatten(value: &Json, out: &mut Vec<f64>) -> bool {
    match value {
        Json::Array(items) => items.iter().all(|item| flatten(item, out)),
        other => other.as_f64().is_some_and(|number| {
            out.push(number);
            true
        }),
    }
}

struct PickleSource(Pickle);

impl Source for PickleSource {
    fn numbers(&self, keys: &[&str]) -> Option<Vec<f64>> {
        let (part, inner) = keys.split_first()?;
        let top: Id = match self.0.get(self.0.root) {
            Value::List(parts) => *parts.get(usize::from(*part == "extrinsic"))?,
            _ => self.0.entry(self.0.root, part)?,
        };
        let id = inner.iter().try_fold(top, |id, key| self.0.entry(id, key))?;
        match self.0.get(id) {
            Value::Array(array) => Some(array.data.clone()),
            _ => None,
        }
    }
}

#[cfg(test)]
mod tests;
