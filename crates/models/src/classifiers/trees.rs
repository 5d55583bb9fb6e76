//! One or many trees whose leaf fractions are averaged.

use ndarray::{Array2, ArrayView2, Axis};
use rand::{Rng, RngCore, SeedableRng};
use rand_xoshiro::Xoshiro256PlusPlus;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::Classify;
use super::cart::{Columns, Growth, Sample, Tree};
use crate::error::{ModelError, Result};
use crate::params::ClassWeight;

/// Trees with the shape of what they were grown on.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Trees {
    n_features: usize,
    n_classes: usize,
    trees: Vec<Tree>,
}

/// How an ensemble is grown.
pub(super) struct Plan<'a> {
    pub growth: Growth,
    pub n_trees: usize,
    pub bootstrap: bool,
    pub class_weight: &'a ClassWeight,
    pub seed: u64,
}

/// Rows predicted together.
const ROW_BLOCK: usize = 64;

impl Trees {
    /// Grows the trees in parallel, each from its own seed: the number of threads does not matter.
    pub(super) fn grow(
        x: ArrayView2<'_, f64>,
        y: &[usize],
        n_classes: usize,
        plan: &Plan<'_>,
    ) -> Result<Self> {
        if u32::try_from(x.nrows()).is_err() || u32::try_from(x.ncols()).is_err() {
            return Err(ModelError::Numerical {
                owner: "trees",
                reason: format!("{} rows x {} features are too many", x.nrows(), x.ncols()),
            });
        }
        let columns = Columns::new(x)?;
        let per_class = plan.class_weight.per_class(y, n_classes)?;
        let labels: Vec<u32> = y.iter().map(|&c| c as u32).collect();
        let mut seeds = Xoshiro256PlusPlus::seed_from_u64(plan.seed);
        let seeds: Vec<u64> = (0..plan.n_trees).map(|_| seeds.next_u64()).collect();
        let trees = seeds
            .into_par_iter()
            .map(|seed| {
                let mut rng = Xoshiro256PlusPlus::seed_from_u64(seed);
                let mut times = vec![u32::from(!plan.bootstrap); y.len()];
                if plan.bootstrap {
                    (0..y.len()).for_each(|_| times[rng.gen_range(0..y.len())] += 1);
                }
                let weights: Vec<f32> =
                    times.iter().zip(y).map(|(&n, &c)| (f64::from(n) * per_class[c]) as f32).collect();
                let sample = Sample { y: &labels, weights: &weights, n_classes };
                Tree::grow(&columns, &sample, &plan.growth, rng.next_u64())
            })
            .collect();
        Ok(Self { n_features: x.ncols(), n_classes, trees })
    }
}

impl Classify for Trees {
    fn n_features(&self) -> usize {
        self.n_features
    }

    fn n_classes(&self) -> usize {
        self.n_classes
    }

    fn predict_proba(&self, x: ArrayView2<'_, f64>) -> Result<Array2<f64>> {
        let mut proba = Array2::zeros((x.nrows(), self.n_classes));
        proba
            .axis_chunks_iter_mut(Axis(0), ROW_BLOCK)
            .into_par_iter()
            .zip(x.axis_chunks_iter(Axis(0), ROW_BLOCK))
            .for_each(|(mut out, rows)| {
                // Out of single range saturates: still on the right side of every threshold.
                let rows = rows.mapv(|v| v as f32).as_standard_layout().into_owned();
                for tree in &self.trees {
                    for (mut out, row) in out.outer_iter_mut().zip(rows.outer_iter()) {
                        let row = row.to_slice().expect("standard layout");
                        let leaf = tree.leaf(row, self.n_classes);
                        out.iter_mut().zip(leaf).for_each(|(o, &p)| *o += f64::from(p));
                    }
                }
                for mut row in out.outer_iter_mut() {
                    // Single precision fractions: their sum is one only to seven digits.
                    let sum = row.sum();
                    row /= sum;
                }
            });
        Ok(proba)
    }

    fn validate(&self) -> Result<()> {
        if self.trees.is_empty() || self.n_features == 0 || self.n_classes == 0 {
            return Err(ModelError::Inconsistent("forest without trees".into()));
        }
        self.trees.iter().try_for_each(|t| t.validate(self.n_features, self.n_classes))
    }
}
