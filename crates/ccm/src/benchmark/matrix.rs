//! Feature matrices of a data set, kept in files.
//!
//! `features/<set>-<hash>.npy` holds `[recordings, values]` float32; the hash is that of the
//! configuration, of every recording's path, size and time of change, and of its crop.

use std::io::{Read, Write};
use std::path::{Path, PathBuf};

use ndarray::Array2;
use rayon::prelude::*;

use super::features::{FeatureSet, FeatureSource};
use super::results::Rows;
use crate::dataset::{Actions, DataSet, Recording};
use crate::error::{CcmError, Result};

/// Features of the training recordings and of each test part, `[recordings, values]`.
pub(super) struct Matrices {
    pub(super) training: Array2<f64>,
    pub(super) tests: Vec<Array2<f64>>,
    /// Hash of the configuration.
    pub(super) configuration: String,
}

pub(super) fn load(
    set: &DataSet,
    rows: &Rows,
    features: FeatureSet,
    source: &dyn FeatureSource,
    out: &Path,
) -> Result<Matrices> {
    let actions = if features.cropped() { set.actions()? } else { Actions::new() };
    let crop = |r: &Recording| {
        r.container.zip(r.name).and_then(|key| actions.get(&key).copied().flatten())
    };
    let training = rows.training.iter().map(|r| (&r.recording, crop(&r.recording))).collect();
    Ok(Matrices {
        training: part(training, features, source, out)?,
        tests: rows
            .tests
            .iter()
            .map(|t| {
                let all = t.rows.iter().map(|r| (&r.recording, None)).collect();
                part(all, features, source, out)
            })
            .collect::<Result<_>>()?,
        configuration: hash(&[&source.identity(features)]),
    })
}

type Job<'a> = (&'a Recording, Option<(f64, f64)>);

fn part(
    jobs: Vec<Job<'_>>,
    features: FeatureSet,
    source: &dyn FeatureSource,
    out: &Path,
) -> Result<Array2<f64>> {
    let shape = (jobs.len(), features.width());
    let path = cache_path(&jobs, features, source, out)?;
    let values = match read(&path, shape) {
        Some(values) => values,
        None => {
            let vectors: Vec<Vec<f32>> = jobs
                .par_iter()
                .map(|(recording, crop)| {
                    let vector = source.vector(features, &recording.path, *crop);
                    let vector = vector.and_then(|v| {
                        let sound = v.len() == shape.1 && v.iter().all(|x| x.is_finite());
                        if sound { Ok(v) } else { Err("features are not finite numbers".into()) }
                    });
                    vector.map_err(|what| {
                        CcmError::Request(format!("{}: {what}", recording.path.display()))
                    })
                })
                .collect::<Result<_>>()?;
            let values = vectors.concat();
            write(&path, shape, &values).map_err(|e| CcmError::io(&path, e))?;
            values
        }
    };
    let values = values.into_iter().map(f64::from).collect();
    Array2::from_shape_vec(shape, values).map_err(|e| CcmError::Request(e.to_string()))
}

fn cache_path(
    jobs: &[Job<'_>],
    features: FeatureSet,
    source: &dyn FeatureSource,
    out: &Path,
) -> Result<PathBuf> {
    let mut parts = vec![source.identity(features)];
    for (recording, crop) in jobs {
        let path = &recording.path;
        let meta = std::fs::metadata(path).map_err(|e| CcmError::io(path, e))?;
        let changed =
            meta.modified().ok().and_then(|t| t.duration_since(std::time::UNIX_EPOCH).ok());
        parts.push(format!("{} {} {changed:?} {crop:?}", path.display(), meta.len()));
    }
    let name = format!("{}-{}.npy", features.slug(), hash(&parts));
    Ok(out.join("features").join(name))
}

/// The first 64 bits of BLAKE3 over the parts, in hexadecimal.
fn hash<T: AsRef<str>>(parts: &[T]) -> String {
    let mut hasher = blake3::Hasher::new();
    for part in parts {
        hasher.update(part.as_ref().as_bytes());
        hasher.update(&[0]);
    }
    hasher.finalize().to_hex()[..16].to_string()
}

/// The values of a cached matrix of this shape; `None` where there is none or it is unusable.
fn read(path: &Path, shape: (usize, usize)) -> Option<Vec<f32>> {
    let mut bytes = Vec::new();
    std::fs::File::open(path).ok()?.read_to_end(&mut bytes).ok()?;
    let data = bytes.strip_prefix(header(shape).as_slice())?;
    (data.len() == shape.0 * shape.1 * 4).then(|| {
        data.chunks_exact(4).map(|b| f32::from_le_bytes([b[0], b[1], b[2], b[3]])).collect()
    })
}

fn write(path: &Path, shape: (usize, usize), values: &[f32]) -> std::io::Result<()> {
    let part = path.with_extension("npy.part");
    let mut file = std::io::BufWriter::new(std::fs::File::create(&part)?);
    file.write_all(&header(shape))?;
    for value in values {
        file.write_all(&value.to_le_bytes())?;
    }
    file.flush()?;
    drop(file);
    std::fs::rename(part, path)
}

/// Header of a float32 matrix in numpy's format, version 1.0.
fn header((rows, columns): (usize, usize)) -> Vec<u8> {
    let mut text =
        format!("{{'descr': '<f4', 'fortran_order': False, 'shape': ({rows}, {columns}), }}");
    let length = (text.len() + 11).div_ceil(64) * 64 - 10;
    text.push_str(&" ".repeat(length - text.len() - 1));
    text.push('\n');
    let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
    bytes.extend((length as u16).to_le_bytes());
    bytes.extend(text.as_bytes());
    bytes
}
