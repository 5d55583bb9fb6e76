//! Pictures of a feature file: the arrays of a recording over time, or the rows of a table.

use std::path::Path;

use corsmal_files::layout::{TIMES, is_frame_level};
use corsmal_files::npz::NpzFile;
use corsmal_files::parquet::ParquetFile;
use corsmal_plot::{FeaturePanel, FeaturePicture};
use ndarray::{Array2, ArrayD, ArrayView2, Axis, Ix3, s};

use super::picture::Picture;
use crate::failure::Failure;

/// Panels in one picture.
const MAX_PANELS: usize = 24;

/// Draws the frame-level arrays of one recording of an `.npz`.
pub fn draw_npz(file: &mut NpzFile, picture: &Picture) -> Result<(), Failure> {
    let path = file.path().display().to_string();
    let names: Vec<String> = file.names().iter().filter(|n| is_frame_level(n)).cloned().collect();
    let arrays: Vec<&String> = names.iter().filter(|n| !n.starts_with(TIMES)).collect();
    let ids = if file.contains("__ids__") { file.strings("__ids__")? } else { Vec::new() };
    let known: Vec<String> = match ids.is_empty() {
        true => arrays.iter().map(|n| (*n).clone()).collect(),
        false => ids,
    };
    let id = chosen(&path, &known, picture)?;
    let of = |name: &str| name == id || name.strip_prefix(&id).is_some_and(|r| r.starts_with('/'));
    let arrays: Vec<String> = arrays.into_iter().filter(|n| of(n)).cloned().collect();
    let mut panels = Vec::new();
    let mut time = None;
    for name in &arrays {
        let values = file.f32(name)?;
        let times_name = format!("{TIMES}{name}");
        if time.is_none() && file.contains(&times_name) {
            let times = file.f64(&times_name)?;
            time = times.first().copied().zip(times.last().copied());
        }
        let feature = name.strip_prefix(&id).unwrap_or_default().trim_start_matches('/');
        panels.extend(panels_of(feature, values, picture)?);
    }
    draw_frames(path, id, panels, time, picture)
}

/// Draws the frames of one recording of a Parquet file.
pub fn draw_parquet(file: &mut ParquetFile, picture: &Picture) -> Result<(), Failure> {
    let path = file.path().display().to_string();
    let ids = file.table()?.0.ids().to_vec();
    let id = chosen(&path, &ids, picture)?;
    let row = ids.iter().position(|known| *known == id).unwrap_or_default();
    let features = file.frame_features();
    let mut panels = Vec::new();
    let mut time = None;
    for feature in &features {
        let frames = file.frames(row, feature)?;
        if frames.values.is_empty() {
            continue;
        }
        time = time.or(frames.times.first().copied().zip(frames.times.last().copied()));
        let named = if features.len() > 1 { feature } else { "" };
        panels.extend(panels_of(named, frames.values, picture)?);
    }
    draw_frames(path, id, panels, time, picture)
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

/// Draws the panels of one recording, from the first to the last `time` in seconds.
fn draw_frames(
    path: String,
    id: String,
    panels: Vec<FeaturePanel>,
    time: Option<(f64, f64)>,
    picture: &Picture,
) -> Result<(), Failure> {
    if panels.is_empty() {
        return Err(nothing(&path));
    }
    let frames = panels.iter().map(|p| p.values.ncols()).max().unwrap_or(0);
    let (time, time_label) = match time.filter(|(from, to)| to > from) {
        Some(ends) => (ends, "time, seconds"),
        None => ((0.0, frames as f64), "frame"),
    };
    if panels.len() > MAX_PANELS {
        return Err(Failure::new(format!(
            "{path}: {} panels; choose some with --channels, at most {MAX_PANELS} are drawn",
            panels.len()
        )));
    }
    let title = picture.title.clone().unwrap_or(id);
    let time_label = time_label.to_owned();
    picture.save(&FeaturePicture { title, subtitle: path, time, time_label, panels })
}

/// Draws the one array of an `.npy`.
pub fn draw_array(path: &Path, values: ArrayD<f32>, picture: &Picture) -> Result<(), Failure> {
    let panels = panels_of("", values, picture)?;
    let frames = panels.iter().map(|p| p.values.ncols()).max().unwrap_or(0);
    let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
    picture.save(&FeaturePicture {
        title: picture.title.clone().unwrap_or(name),
        subtitle: path.display().to_string(),
        time: (0.0, frames as f64),
        time_label: "frame".into(),
        panels,
    })
}

fn nothing(path: &str) -> Failure {
    Failure::new(format!("{path}: has no array of features to draw"))
}

/// A panel for each channel of an array `[channels, coefficients, frames]`.
fn panels_of(
    feature: &str,
    values: ArrayD<f32>,
    picture: &Picture,
) -> Result<Vec<FeaturePanel>, Failure> {
    let shape = values.shape().to_vec();
    let cube = match shape.len() {
        3 => values.into_dimensionality::<Ix3>()?,
        2 => values.insert_axis(Axis(0)).into_dimensionality::<Ix3>()?,
        1 => values.insert_axis(Axis(0)).insert_axis(Axis(0)).into_dimensionality::<Ix3>()?,
        _ => {
            let message = format!("an array of shape {shape:?} cannot be drawn: at most 3 axes");
            return Err(Failure::new(message));
        }
    };
    picture.check_channels(cube.len_of(Axis(0)))?;
    let channels: Vec<usize> = match picture.view.channels.is_empty() {
        true => (0..cube.len_of(Axis(0))).collect(),
        false => picture.view.channels.clone(),
    };
    let panel = |channel: usize| FeaturePanel {
        label: match feature {
            "" => format!("channel {channel}"),
            feature => format!("{feature}, channel {channel}"),
        },
        values: thinned(cube.slice(s![channel, .., ..])),
        rows: Vec::new(),
        unit: String::new(),
    };
    Ok(channels.into_iter().map(panel).collect())
}

/// Every k-th frame, so that a picture of a long recording stays small.
fn thinned(values: ArrayView2<f32>) -> Array2<f32> {
    const MOST: usize = 4000;
    let step = values.ncols().div_ceil(MOST).max(1);
    values.slice(s![.., ..;step as isize]).to_owned()
}

/// Draws a table: each row a recording, each column a feature in units of its standard deviation.
pub fn draw_table(
    path: &Path,
    ids: &[String],
    values: ArrayView2<f32>,
    picture: &Picture,
) -> Result<(), Failure> {
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
