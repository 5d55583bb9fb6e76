//! Synthetic recordings in the layout and naming of the CCM data set.
//!
//! For demonstration and tests only: scores on them mean nothing about the real data set.

mod array;
mod files;
mod physics;
mod views;

use std::path::Path;

use rand::{Rng, SeedableRng};
use rand_xoshiro::Xoshiro256PlusPlus;
use rayon::prelude::*;

use crate::dataset::{Category, Container, Filling, SequenceName, Subset};
use crate::error::{CcmError, Result};

pub use views::write_views;

/// Sample rate of the recordings in Hz.
pub const SAMPLE_RATE: u32 = 44_100;

/// The file that marks a folder as synthetic.
pub const NOTICE: &str = "SYNTHETIC.txt";

/// How many recordings.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Size {
    /// Training containers, one setting each: 57 recordings.
    Small,
    /// Training containers in two settings, public test containers in one: 133 recordings.
    Reduced,
    /// All 15 containers, scenarios, backgrounds and illuminations: 1,140 recordings.
    Full,
}

/// What was written.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Summary {
    /// Number of recordings.
    pub recordings: usize,
    /// Samples per channel over all recordings.
    pub frames: u64,
}

/// One recording to make.
struct Take {
    container: Container,
    name: SequenceName,
    /// Number in file name of a test recording.
    number: usize,
    frames: usize,
    action: Option<(f64, f64)>,
}

/// Writes a synthetic data set below `dir` (created where absent).
///
/// The same seed and size give the same bytes for any number of threads.
///
/// # Errors
/// [`CcmError`] when `dir` holds files but no [`NOTICE`] of an earlier run, and when something
/// cannot be written.
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
            "{}: holds files that are not synthetic recordings; choose a new or empty folder",
            dir.display()
        )));
    }
    std::fs::create_dir_all(dir).map_err(|e| CcmError::io(dir, e))?;
    files::write_notice(dir, size, seed, vision)?;
    let mut takes = plan(size, seed);
    takes.par_iter_mut().try_for_each(|take| take.record(dir, seed, vision))?;
    files::write_annotations(dir, &takes)?;
    Ok(Summary { recordings: takes.len(), frames: takes.iter().map(|t| t.frames as u64).sum() })
}

fn plan(size: Size, seed: u64) -> Vec<Take> {
    let wanted = |container: Container, name: &SequenceName| {
        let training = container.subset() == Subset::Training;
        // One background and illumination each, spread over the containers.
        let setting = name.background == container.number() % 2 && name.illumination == 0;
        match size {
            Size::Full => true,
            Size::Small => training && setting && name.scenario == 0,
            Size::Reduced if training => setting && name.scenario < 2,
            Size::Reduced => container.subset() == Subset::Public && setting && name.scenario == 0,
        }
    };
    let mut takes = Vec::new();
    for container in Container::all() {
        let names: Vec<_> =
            SequenceName::all(container).filter(|name| wanted(container, name)).collect();
        // Test files are numbered in no telling order.
        let mut numbers: Vec<_> = (0..names.len()).collect();
        let mut rng = generator(seed, container, None);
        for i in (1..numbers.len()).rev() {
            numbers.swap(i, rng.gen_range(0..=i));
        }
        takes.extend(names.into_iter().zip(numbers).map(|(name, number)| Take {
            container,
            name,
            number,
            frames: 0,
            action: None,
        }));
    }
    takes
}

/// The random numbers of one recording, or of a container's file order.
fn generator(seed: u64, container: Container, name: Option<SequenceName>) -> impl Rng {
    let number = name.and_then(|n| n.number(container)).map_or(0, |n| u64::from(n) + 1);
    let stream = u64::from(container.number()) << 32 | number;
    Xoshiro256PlusPlus::seed_from_u64(seed ^ stream.wrapping_mul(0x9E37_79B9_7F4A_7C15))
}

impl Take {
    fn record(&mut self, dir: &Path, seed: u64, vision: bool) -> Result<()> {
        let mut rng = generator(seed, self.container, Some(self.name));
        let source = physics::Source {
            category: self.container.category(),
            capacity_ml: capacity_ml(self.container),
            filling: self.name.filling,
            held: self.name.scenario == 1,
        };
        let sound = source.sound(&mut rng);
        let distance = [0.45, 0.55, 1.1][usize::from(self.name.scenario)];
        let noise = 0.004 + 0.002 * f64::from(self.name.background);
        let pcm = array::record(&sound.samples, distance, noise, &mut rng);
        self.frames = sound.samples.len();
        self.action = sound.action;
        files::write_wav(&dir.join(self.path()), &pcm)?;
        if vision {
            let stem = match self.container.subset() {
                Subset::Training => self.name.to_string(),
                _ => format!("{:04}", self.number),
            };
            write_views(&dir.join(self.folder()), &stem, self.container, self.name, seed)?;
        }
        Ok(())
    }

    /// The container's folder below the data set's.
    fn folder(&self) -> String {
        let part = match self.container.subset() {
            Subset::Training => "train",
            Subset::Public => "test",
            Subset::Private => "test_private",
        };
        format!("{part}/{}", self.container.number())
    }

    /// Path below the data set's folder.
    fn path(&self) -> String {
        let folder = self.folder();
        match self.container.subset() {
            Subset::Training => format!("{folder}/audio/{}_audio.wav", self.name),
            _ => format!("{folder}/audio/{:04}_audio.wav", self.number),
        }
    }
}

/// Capacity: the published one for training containers, an invented one for the others.
fn capacity_ml(container: Container) -> f64 {
    const INVENTED: [f64; 6] = [400.0, 330.0, 1500.0, 250.0, 410.0, 900.0];
    container
        .capacity_ml()
        .unwrap_or_else(|| INVENTED[usize::from(container.number()).saturating_sub(10) % 6])
}

/// Mass of the empty container in g, invented for test containers.
fn container_mass_g(container: Container) -> f64 {
    container.mass_g().unwrap_or(match container.category() {
        Category::Cup => 8.0,
        Category::Glass => 110.0,
        Category::Box => 35.0,
    })
}

/// Density in g/mL as the official annotations write it, the same in every container.
fn density(filling: Filling) -> f64 {
    [0.0, 0.34, 0.82, 1.0][filling.kind() as usize]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn plans_have_their_sizes() {
        for (size, count) in [(Size::Small, 57), (Size::Reduced, 133), (Size::Full, 1140)] {
            assert_eq!(plan(size, 1).len(), count, "{size:?}");
        }
    }

    #[test]
    fn test_files_are_numbered_without_gaps() {
        let takes = plan(Size::Full, 3);
        let mut numbers: Vec<_> =
            takes.iter().filter(|t| t.container.number() == 12).map(|t| t.number).collect();
        assert!(!numbers.is_sorted());
        numbers.sort_unstable();
        assert!(numbers.into_iter().eq(0..60));
    }
}
