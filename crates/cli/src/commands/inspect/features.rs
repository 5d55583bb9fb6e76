//! Pictures of a feature file: the arrays of a recording over time, or the rows of a table.

use std::path::Path;

use corsmal_files::layout::{self, TIMES, is_frame_level};
use corsmal_files::npz::NpzFile;
use corsmal_files::parquet::ParquetFile;
use corsmal_plot::{FeaturePanel, FeaturePicture};
use ndarray::{ArrayD, ArrayView2, Axis, Ix3, s};

use super::picture::Picture;
use crate::failure::Failure;

/// Panels in one picture.
const MAX_PANELS: usize = 24;
/// Frames of a panel; of more, every k-th is drawn.
const MOST_FRAMES: usize = 4000;

/// The frames of a feature.
struct Frames {
    /// Empty where there is one feature only.
    feature: String,
    /// `[channels, coefficients, frames]`, or fewer axes.
    values: ArrayD<f32>,
    /// Their middles in seconds, where they are known.
    times: Vec<f64>,
    /// Seconds from one to the next, where there are two.
    hop: Option<f64>,
}

/// Draws the frame-level arrays of one recording of an `.npz`.
pub fn draw_npz(file: &mut NpzFile, picture: &Picture) -> Result<(), Failure> {
    let path = file.path().display().to_string();
    let names: Vec<String> = file.names().iter().filter(|n| is_frame_level(n)).cloned().collect();
    let (known, features) = match layout::is_ours(file) {
        true => (file.strings("__ids__")?, layout::read_table(file)?.1.features()),
        false => (names.into_iter().filter(|n| !n.starts_with(TIMES)).collect(), Vec::new()),
    };
    let id = chosen(&path, &known, picture)?;
    // One feature, or an array of another program, has the name of its recording.
    let features: Vec<Option<String>> = match features.len() {
        0 | 1 => vec![None],
        _ => features.into_iter().map(Some).collect(),
    };
    let mut frames = Vec::new();
    for feature in features {
        let name = layout::frames_name(&id, feature.as_deref());
        let times = layout::times_name(&id, feature.as_deref());
        if file.contains(&name) {
            let times = match file.contains(&times) {
                true => file.f64(&times)?.into_iter().collect(),
                false => Vec::new(),
            };
            frames.push(Frames::new(feature.unwrap_or_default(), file.f32(&name)?, times));
        }
    }
    draw_frames(path, id, frames, picture)
}

/// Draws the frames of one recording of a Parquet file.
pub fn draw_parquet(file: &mut ParquetFile, picture: &Picture) -> Result<(), Failure> {
    let path = file.path().display().to_string();
    let ids = file.table()?.0.ids().to_vec();
    let id = chosen(&path, &ids, picture)?;
    let row = ids.iter().position(|known| *known == id).unwrap_or_default();
    let features = file.frame_features();
    let mut frames = Vec::new();
    for feature in &features {
        let found = file.frames(row, feature)?;
        if found.values.is_empty() {
            continue;
        }
        let feature = if features.len() > 1 { feature.clone() } else { String::new() };
        frames.push(Frames::new(feature, found.values, found.times.to_vec()));
    }
    draw_frames(path, id, frames, picture)
}

/// The recording to draw, of those that there are.
fn chosen(path: &str, known: &[String], picture: &Picture) -> Result<String, Failure> {
    match &picture.recording {
        Some(wanted) if known.contains(wanted) => Ok(wanted.clone()),
        Some(wanted) => {
            let some = known.iter().take(5).cloned().collect::<Vec<_>>().join(", ");
            Err(Failure::new(format!(
                "{path}: no recording '{wanted}'; it has {} ({some}{})",
                known.len(),
                if known.len() > 5 { ", …" } else { "" }
            )))
        }
        None => known.first().cloned().ok_or_else(|| nothing(path)),
    }
}

/// Draws the frames of one recording over one time axis.
fn draw_frames(
    path: String,
    id: String,
    frames: Vec<Frames>,
    picture: &Picture,
) -> Result<(), Failure> {
    picture.takes("frames", &["--channels", "--start", "--end", "--recording"])?;
    if frames.is_empty() {
        return Err(nothing(&path));
    }
    let hop = frames.iter().filter_map(|found| found.hop).reduce(f64::min);
    let mut panels = Vec::new();
    for found in frames {
        panels.extend(found.within(picture, &path)?.panels(picture, hop)?);
    }
    // A feature with a long hop may have none where others have some.
    panels.retain(|panel| panel.values.ncols() > 0);
    if panels.is_empty() {
        let start = picture.view.start;
        if start == 0.0 && picture.end.is_none() {
            return Err(nothing(&path));
        }
        let end = picture.end.map_or(String::new(), |end| format!(" --end {end}"));
        return Err(Failure::new(format!("--start {start}{end}: {path} has no frame there")));
    }
    if panels.len() > MAX_PANELS {
        return Err(Failure::new(format!(
            "{path}: {} panels; choose some with --channels, at most {MAX_PANELS} are drawn",
            panels.len()
        )));
    }
    let union = |a: (f64, f64), b: (f64, f64)| (a.0.min(b.0), a.1.max(b.1));
    let (time, time_label) = match panels.iter().filter_map(|panel| panel.span).reduce(union) {
        Some(ends) => (ends, "time, seconds"),
        None => (whole(&panels), "frame"),
    };
    let title = picture.title.clone().unwrap_or(id);
    let time_label = time_label.to_owned();
    picture.save(&FeaturePicture { title, subtitle: path, time, time_label, panels })
}

/// Draws the one array of an `.npy`.
pub fn draw_array(path: &Path, values: ArrayD<f32>, picture: &Picture) -> Result<(), Failure> {
    picture.takes("an array", &["--channels"])?;
    let panels = Frames::new(String::new(), values, Vec::new()).panels(picture, None)?;
    let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
    picture.save(&FeaturePicture {
        title: picture.title.clone().unwrap_or(name),
        subtitle: path.display().to_string(),
        time: whole(&panels),
        time_label: "frame".into(),
        panels,
    })
}

/// An axis of frame numbers.
fn whole(panels: &[FeaturePanel]) -> (f64, f64) {
    (0.0, panels.iter().map(|panel| panel.values.ncols()).max().unwrap_or(0) as f64)
}

fn nothing(path: &str) -> Failure {
    Failure::new(format!("{path}: has no array of features to draw"))
}

impl Frames {
    fn new(feature: String, values: ArrayD<f32>, times: Vec<f64>) -> Self {
        let hop = match times[..] {
            [first, .., last] if last > first => Some((last - first) / (times.len() - 1) as f64),
            _ => None,
        };
        Self { feature, values, times, hop }
    }

    /// The frames of the stretch that is to be drawn.
    fn within(mut self, picture: &Picture, path: &str) -> Result<Self, Failure> {
        let (start, end) = (picture.view.start, picture.end);
        if start == 0.0 && end.is_none() {
            return Ok(self);
        }
        let last = Axis(self.values.ndim().saturating_sub(1));
        if self.times.is_empty() || self.times.len() != self.values.len_of(last) {
            return Err(Failure::new(format!("--start and --end: {path} has no times of frames")));
        }
        let from = self.times.partition_point(|time| *time < start);
        let to = self.times.partition_point(|time| end.is_none_or(|end| *time < end)).max(from);
        self.values = self.values.slice_axis(last, (from..to).into()).to_owned();
        self.times = self.times[from..to].to_vec();
        Ok(self)
    }

    /// A panel for each channel. A single frame reaches as far as one of `other_hop`.
    fn panels(
        self,
        picture: &Picture,
        other_hop: Option<f64>,
    ) -> Result<Vec<FeaturePanel>, Failure> {
        let Self { feature, values, times, hop } = self;
        let shape = values.shape().to_vec();
        let cube = match shape.len() {
            3 => values.into_dimensionality::<Ix3>()?,
            2 => values.insert_axis(Axis(0)).into_dimensionality::<Ix3>()?,
            1 => values.insert_axis(Axis(0)).insert_axis(Axis(0)).into_dimensionality::<Ix3>()?,
            _ => {
                let message =
                    format!("an array of shape {shape:?} cannot be drawn: at most 3 axes");
                return Err(Failure::new(message));
            }
        };
        picture.check_channels(cube.len_of(Axis(0)))?;
        let channels: Vec<usize> = match picture.view.channels.is_empty() {
            true => (0..cube.len_of(Axis(0))).collect(),
            false => picture.view.channels.clone(),
        };
        let step = cube.len_of(Axis(2)).div_ceil(MOST_FRAMES).max(1);
        // Each frame reaches half way to its neighbours.
        let drawn = (times.len().div_ceil(step) * step) as f64;
        let span = times.first().zip(hop.or(other_hop));
        let span = span.map(|(first, hop)| (first - hop / 2.0, first + hop * (drawn - 0.5)));
        let panel = |channel: usize| FeaturePanel {
            label: match &*feature {
                "" => format!("channel {channel}"),
                feature => format!("{feature}, channel {channel}"),
            },
            values: cube.slice(s![channel, .., ..;step as isize]).to_owned(),
            span,
            rows: Vec::new(),
            unit: String::new(),
        };
        Ok(channels.into_iter().map(panel).collect())
    }
}

/// Draws a table: each row a recording, each column a feature in units of its standard deviation.
pub fn draw_table(
    path: &Path,
    ids: &[String],
    values: ArrayView2<f32>,
    picture: &Picture,
) -> Result<(), Failure> {
    picture.takes("a table", &[])?;
    if values.is_empty() {
        return Err(nothing(&path.display().to_string()));
    }
    let finite = |column: ndarray::ArrayView1<f32>| -> Vec<f64> {
        column.iter().map(|v| f64::from(*v)).filter(|v| v.is_finite()).collect()
    };
    let mut standard = values.to_owned();
    for mut column in standard.columns_mut() {
        let known = finite(column.view());
        let n = known.len().max(1) as f64;
        let mean = known.iter().sum::<f64>() / n;
        let deviation = (known.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / n).sqrt();
        let unit = if deviation > 0.0 { deviation } else { 1.0 };
        column.mapv_inplace(|v| (((f64::from(v) - mean) / unit) as f32).clamp(-3.0, 3.0));
    }
    standard.invert_axis(Axis(0));
    let rows = ids.len() as f64;
    let step = (ids.len() / 8).max(1);
    let places = (0..ids.len()).step_by(step);
    let label = |i: usize| (i as f64, 1.0 - (i as f64 + 0.5) / rows);
    let panel = FeaturePanel {
        label: "rows: recordings, columns: features, each in units of its standard deviation"
            .into(),
        values: standard,
        span: None,
        rows: places.map(label).collect(),
        unit: "standard deviations".into(),
    };
    let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
    picture.save(&FeaturePicture {
        title: picture.title.clone().unwrap_or(name),
        subtitle: format!("recordings: {}, features: {}", ids.len(), values.ncols()),
        time: (0.0, values.ncols() as f64),
        time_label: "feature".into(),
        panels: vec![panel],
    })
}
