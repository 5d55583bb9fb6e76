//! Which recordings are made, and where they go.

use rand::{Rng, SeedableRng};
use rand_xoshiro::Xoshiro256PlusPlus;

use crate::dataset::{Container, SequenceName, Subset};

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

/// One recording to make.
pub(super) struct Take {
    pub(super) container: Container,
    pub(super) name: SequenceName,
    /// Number in file name of a test recording.
    pub(super) number: usize,
    /// Samples per channel, once it is made.
    pub(super) frames: usize,
    /// Start and end of the action in seconds, once it is made; `None` for empty.
    pub(super) action: Option<(f64, f64)>,
}

impl Take {
    /// The container's folder below the data set's.
    pub(super) fn folder(&self) -> String {
        let part = match self.container.subset() {
            Subset::Training => "train",
            Subset::Public => "test",
            Subset::Private => "test_private",
        };
        format!("{part}/{}", self.container.number())
    }

    /// Path below the data set's folder.
    pub(super) fn path(&self) -> String {
        let folder = self.folder();
        match self.container.subset() {
            Subset::Training => format!("{folder}/audio/{}_audio.wav", self.name),
            _ => format!("{folder}/audio/{:04}_audio.wav", self.number),
        }
    }
}

/// The recordings of a data set of this size.
pub(super) fn plan(size: Size, seed: u64) -> Vec<Take> {
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
pub(super) fn generator(seed: u64, container: Container, name: Option<SequenceName>) -> impl Rng {
    let number = name.and_then(|n| n.number(container)).map_or(0, |n| u64::from(n) + 1);
    let stream = u64::from(container.number()) << 32 | number;
    Xoshiro256PlusPlus::seed_from_u64(seed ^ stream.wrapping_mul(0x9E37_79B9_7F4A_7C15))
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
