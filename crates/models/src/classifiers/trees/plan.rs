//! How an ensemble is grown: the draws of its rows, and what each row counts.

use rand::{Rng, SeedableRng};
use rand_xoshiro::Xoshiro256PlusPlus;

use crate::classifiers::cart::Growth;
use crate::error::Result;
use crate::params::ClassWeight;

/// How an ensemble is grown.
pub(in crate::classifiers) struct Plan<'a> {
    pub growth: Growth,
    pub n_trees: usize,
    pub bootstrap: bool,
    /// whether trees are asked about the rows that they have not seen
    pub out_of_bag: bool,
    pub class_weight: &'a ClassWeight,
    /// whether balanced classes have equal weights of rows, or equal numbers
    pub balances_weights: bool,
    pub seed: u64,
}

impl Plan<'_> {
    /// How often each row is in the sample of the tree of this seed, and the tree's further draws.
    /// `upto`: rows are drawn in proportion to their weights, which are added up there.
    pub(super) fn draw(
        &self,
        seed: u64,
        rows: usize,
        upto: Option<&[f64]>,
    ) -> (Vec<u32>, Xoshiro256PlusPlus) {
        let mut rng = Xoshiro256PlusPlus::seed_from_u64(seed);
        let mut times = vec![u32::from(!self.bootstrap); rows];
        if self.bootstrap {
            for _ in 0..rows {
                let row = match upto {
                    None => rng.gen_range(0..rows),
                    Some(upto) => {
                        let at = rng.r#gen::<f64>() * upto[rows - 1];
                        upto.partition_point(|&sum| sum <= at).min(rows - 1)
                    }
                };
                times[row] += 1;
            }
        }
        (times, rng)
    }
}

/// What rows and classes count in an ensemble.
pub(super) struct Weighing {
    pub(super) of_class: Vec<f64>,
    /// where all rows are in each tree and do not count alike
    pub(super) of_row: Option<Vec<f64>>,
    /// where each tree draws its rows and they do not have the same chance: sums of their chances
    pub(super) upto: Option<Vec<f64>>,
}

impl Weighing {
    /// Of rows of the classes `y`.
    pub(super) fn new(
        plan: &Plan<'_>,
        y: &[usize],
        n_classes: usize,
        weights: Option<&[f64]>,
    ) -> Result<Self> {
        let weights = weights.map(scaled);
        let counted = weights.as_deref().filter(|_| plan.balances_weights);
        let mut of_class = scaled(&plan.class_weight.per_class_of(y, n_classes, counted)?);
        // Equal weights are none, to the bit.
        let differ = |all: &Vec<f64>| all.iter().any(|weight| *weight != all[0]);
        if !plan.bootstrap {
            let of_row = weights.filter(differ).map(|all| scaled(&all));
            return Ok(Self { of_class, of_row, upto: None });
        }
        // Where rows are drawn, the weight of a row's class is a part of its chance, as in scikit-learn 1.9.
        let chance = |(row, &class): (usize, &usize)| {
            weights.as_ref().map_or(1.0, |all| all[row]) * of_class[class]
        };
        let chances: Vec<f64> = y.iter().enumerate().map(chance).collect();
        of_class.fill(1.0);
        let upto = Some(chances).filter(differ).map(|all| added_up(&all));
        Ok(Self { of_class, of_row: None, upto })
    }
}

/// Weights divided by a power of two, the largest being near one: that changes no bits of a tree, but lets no sum
/// or square overflow.
fn scaled(weights: &[f64]) -> Vec<f64> {
    let largest = weights.iter().copied().fold(0.0, f64::max);
    let factor = 2f64.powi((largest.log2() as i32).clamp(-1022, 1023));
    weights.iter().map(|weight| weight / factor).collect()
}

/// Sums of the weights up to each row, the largest weight being one.
fn added_up(weights: &[f64]) -> Vec<f64> {
    let largest = weights.iter().copied().fold(0.0, f64::max);
    let add = |sum: &mut f64, weight: &f64| {
        *sum += weight / largest;
        Some(*sum)
    };
    weights.iter().scan(0.0, add).collect()
}
