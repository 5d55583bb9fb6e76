//! The 15 containers.

use corsmal_vision::Category;
use serde::Serialize;

use super::filling::{Filling, FillingType};

/// The three folds of training containers that the compared methods validate on: one cup, one
/// glass and one box each.
pub const CONTAINER_FOLDS: [[u8; 3]; 3] = [[1, 4, 7], [2, 5, 8], [3, 6, 9]];

/// Capacity in mL and mass in g of the training containers 1 to 9 (official annotations).
const CAPACITY_ML: [f64; 9] = [520.0, 185.0, 202.0, 296.0, 363.0, 128.0, 3209.397, 1239.84, 471.6];
const MASS_G: [f64; 9] = [10.0, 2.0, 3.0, 86.0, 134.0, 15.0, 59.0, 31.0, 15.0];

/// Part of the data set that a container belongs to.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize)]
pub enum Subset {
    /// Containers 1 to 9, 684 recordings, labels published.
    Training,
    /// Containers 10 to 12, 228 recordings.
    Public,
    /// Containers 13 to 15, 228 recordings.
    Private,
}

/// A container of the data set, by its number 1 to 15.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize)]
#[serde(transparent)]
pub struct Container(u8);

impl Container {
    /// The container with this number, 1 to 15.
    pub fn new(number: u8) -> Option<Self> {
        (1..=15).contains(&number).then_some(Self(number))
    }

    /// All containers of the data set.
    pub fn all() -> impl Iterator<Item = Self> {
        (1..=15).map(Self)
    }

    /// Number, 1 to 15.
    pub fn number(self) -> u8 {
        self.0
    }

    /// Kind of container.
    pub fn category(self) -> Category {
        match self.0 {
            1..=3 | 10 | 13 => Category::Cup,
            4..=6 | 11 | 14 => Category::Glass,
            _ => Category::Box,
        }
    }

    /// Whether one cannot see what it holds: boxes, and the coloured cups 1 and 2 (our reading). Of
    /// the test containers only the boxes are known.
    pub fn is_opaque(self) -> bool {
        self.category() == Category::Box || matches!(self.0, 1 | 2)
    }

    /// Part of the data set.
    pub fn subset(self) -> Subset {
        match self.0 {
            1..=9 => Subset::Training,
            10..=12 => Subset::Public,
            _ => Subset::Private,
        }
    }

    /// Index of the fold in [`CONTAINER_FOLDS`]; `None` for test containers.
    pub fn fold(self) -> Option<usize> {
        CONTAINER_FOLDS.iter().position(|fold| fold.contains(&self.0))
    }

    /// Capacity in mL; published for the training containers only.
    pub fn capacity_ml(self) -> Option<f64> {
        CAPACITY_ML.get(usize::from(self.0) - 1).copied()
    }

    /// Mass of the empty container in g; published for the training containers only.
    pub fn mass_g(self) -> Option<f64> {
        MASS_G.get(usize::from(self.0) - 1).copied()
    }

    /// The fillings it is recorded with, in the order of the 2020 sequence numbers.
    pub fn fillings(self) -> impl Iterator<Item = Filling> {
        let dry = self.category() == Category::Box;
        Filling::all().filter(move |f| !(dry && f.kind() == FillingType::Water))
    }

    /// Number of recordings: 3 scenarios, 2 backgrounds, 2 illuminations per filling.
    pub fn recordings(self) -> usize {
        self.fillings().count() * 12
    }
}

impl Subset {
    /// All parts.
    pub const ALL: [Self; 3] = [Self::Training, Self::Public, Self::Private];

    /// Name as used in folders of the 2020 release and in reports.
    pub fn name(self) -> &'static str {
        match self {
            Self::Training => "training",
            Self::Public => "public test",
            Self::Private => "private test",
        }
    }

    /// Name as used in folders and files that this program writes: `public-test`.
    pub fn slug(self) -> String {
        self.name().replace(' ', "-")
    }

    /// Containers of this part.
    pub fn containers(self) -> impl Iterator<Item = Container> {
        Container::all().filter(move |c| c.subset() == self)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn subsets_have_the_published_sizes() {
        for (subset, size) in Subset::ALL.into_iter().zip([684, 228, 228]) {
            assert_eq!(subset.containers().map(Container::recordings).sum::<usize>(), size);
        }
        assert_eq!(Container::new(0), None);
        assert_eq!(Container::new(16), None);
    }

    #[test]
    fn mean_training_capacity_is_the_known_one() {
        let known: Vec<_> = Container::all().filter_map(Container::capacity_ml).collect();
        assert_eq!(known.len(), 9);
        assert!((known.iter().sum::<f64>() / 9.0 - 734.98).abs() < 0.005);
    }

    #[test]
    fn folds_hold_one_container_of_each_category() {
        for (i, fold) in CONTAINER_FOLDS.iter().enumerate() {
            let kinds: Vec<_> = fold
                .iter()
                .map(|&n| Container::new(n).unwrap())
                .inspect(|c| assert_eq!(c.fold(), Some(i)))
                .map(Container::category)
                .collect();
            assert_eq!(kinds, [Category::Cup, Category::Glass, Category::Box]);
        }
    }
}
