//! Making a data set.

use std::path::Path;

use rayon::prelude::*;

use super::files::{self, NOTICE};
use super::objects::capacity_ml;
use super::take::{Size, Take, generator, plan};
use super::views::write_views;
use super::{annotations, array, physics};
use crate::dataset::Subset;
use crate::error::{CcmError, Result};

/// What was written.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Summary {
    /// Number of recordings.
    pub recordings: usize,
    /// Samples per channel over all recordings.
    pub frames: u64,
}

/// Writes a synthetic data set below `dir` (created where absent).
///
/// The same seed and size give the same bytes for any number of threads.
///
/// # Errors
/// [`CcmError`] when `dir` holds files but no [`NOTICE`] of an earlier run, or one of other recordings, and when
/// something cannot be written.
pub fn generate(dir: &Path, size: Size, seed: u64) -> Result<Summary> {
    make(dir, size, seed, false)
}

/// The same with views of every recording: colour and depth images, calibrations and detections.
///
/// # Errors
/// As [`generate`].
pub fn generate_with_views(dir: &Path, size: Size, seed: u64) -> Result<Summary> {
    make(dir, size, seed, true)
}

fn make(dir: &Path, size: Size, seed: u64, vision: bool) -> Result<Summary> {
    let occupied =
        dir.exists() && std::fs::read_dir(dir).map_err(|e| CcmError::io(dir, e))?.next().is_some();
    if occupied && !dir.join(NOTICE).exists() {
        return Err(CcmError::Request(format!(
            "{}: has files that are not synthetic recordings; choose a new or empty folder",
            dir.display()
        )));
    }
    std::fs::create_dir_all(dir).map_err(|e| CcmError::io(dir, e))?;
    files::write_notice(dir, size, seed, vision)?;
    let mut takes = plan(size, seed);
    takes.par_iter_mut().try_for_each(|take| record(take, dir, seed, vision))?;
    annotations::write_annotations(dir, &takes)?;
    Ok(Summary { recordings: takes.len(), frames: takes.iter().map(|t| t.frames as u64).sum() })
}

/// Makes one recording, and its views where they are wanted.
fn record(take: &mut Take, dir: &Path, seed: u64, vision: bool) -> Result<()> {
    let mut rng = generator(seed, take.container, Some(take.name));
    let source = physics::Source {
        category: take.container.category(),
        capacity_ml: capacity_ml(take.container),
        filling: take.name.filling,
        held: take.name.scenario == 1,
    };
    let sound = source.sound(&mut rng);
    let distance = [0.45, 0.55, 1.1][usize::from(take.name.scenario)];
    let noise = 0.004 + 0.002 * f64::from(take.name.background);
    let pcm = array::record(&sound.samples, distance, noise, &mut rng);
    take.frames = sound.samples.len();
    take.action = sound.action;
    files::write_wav(&dir.join(take.path()), &pcm)?;
    if vision {
        let stem = match take.container.subset() {
            Subset::Training => take.name.to_string(),
            _ => format!("{:04}", take.number),
        };
        write_views(&dir.join(take.folder()), &stem, take.container, take.name, seed)?;
    }
    Ok(())
}
