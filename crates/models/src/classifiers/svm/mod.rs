//! Support vector machine (C-SVC), one against one, labels by votes as LIBSVM and scikit-learn.
//!
//! Chang & Lin, "LIBSVM: a library for support vector machines" (2011). Probabilities: a sigmoid
//! per pair fitted on five-fold held-out decision values, then pairwise coupling. Kernel values of rows
//! far from zero are those of the rows less their mean, which moves no decision and keeps digits.

mod kernel;
mod linfa;
mod pair;
mod probability;
mod smo;
mod two_class;

use ndarray::{Array1, Array2, ArrayView1, ArrayView2, Axis};
use rand::{RngCore, SeedableRng};
use rand_xoshiro::Xoshiro256PlusPlus;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use self::kernel::{Centred, Function, Gram};
use self::linfa::Solved;
use self::pair::{Pair, compact};
use self::probability::Sigmoid;
use self::two_class::TwoClass;
use super::{Classify, Train};
use crate::error::{ModelError, Result};
use crate::params::{ClassWeight, Parameters, parameters};
use crate::table::argmax;

/// How two rows are compared.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum SvmKernel {
    /// exp(−γ‖a − b‖²)
    Rbf,
    /// a·b
    Linear,
}

/// Width of the RBF kernel.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(untagged)]
pub enum Gamma {
    /// by rule
    Rule(GammaRule),
    /// this value
    Value(f64),
}

/// Rules for the width of the RBF kernel.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum GammaRule {
    /// 1 / (features · variance of all training values)
    Scale,
    /// 1 / features
    Auto,
}

/// Who solves the two-class problems.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum SvmSolver {
    /// this crate
    #[default]
    Own,
    /// linfa-svm: no probabilities, the whole kernel matrix in memory
    Linfa,
}

impl SvmSolver {
    fn is_own(&self) -> bool {
        *self == Self::Own
    }
}

parameters! {
    /// Parameters of the support vector machine.
    #[allow(non_snake_case, reason = "C is its name everywhere")]
    SvmParams, "svm" {
        C: f64 = 1.0, "a positive number", "cost of a training row on the wrong side";
        kernel: SvmKernel = SvmKernel::Rbf, "rbf or linear", "how rows are compared";
        gamma: Gamma = Gamma::Rule(GammaRule::Scale), "scale, auto or a positive number",
            "width of the rbf kernel";
        class_weight: ClassWeight = ClassWeight::Equal,
            "null, balanced, or one positive number per class in label order",
            "factors of C by class";
        probability: bool = true, "true or false",
            "also fit class probabilities (five more fits per pair)";
        tol: f64 = 1e-3, "a positive number", "tolerance of the optimality conditions";
        cache_mb: usize = 200, "a whole number of at least 1", "memory for kernel values, MiB";
        seed: u64 = 0, "a whole number", "seed of the folds for the probabilities";
        #[serde(skip_serializing_if = "SvmSolver::is_own")]
        solver: SvmSolver = SvmSolver::Own, "own or linfa",
            "this program's solver, or linfa-svm (no probabilities, smaller tables)";
    }
    check(this) {
        let positive = |v: f64| v.is_finite() && v > 0.0;
        Self::require(positive(this.C), "C", this.C)?;
        if let Gamma::Value(gamma) = this.gamma {
            Self::require(positive(gamma), "gamma", gamma)?;
        }
        Self::require(this.class_weight.is_valid(), "class_weight", format!("{:?}", this.class_weight))?;
        Self::require(positive(this.tol), "tol", this.tol)?;
        Self::require(this.cache_mb >= 1, "cache_mb", this.cache_mb)
    }
}

impl SvmParams {
    fn function(&self, x: ArrayView2<'_, f64>) -> Function {
        let features = x.ncols() as f64;
        match (self.kernel, self.gamma) {
            (SvmKernel::Linear, _) => Function::Linear,
            (_, Gamma::Value(gamma)) => Function::Rbf { gamma },
            (_, Gamma::Rule(GammaRule::Auto)) => Function::Rbf { gamma: 1.0 / features },
            (_, Gamma::Rule(GammaRule::Scale)) => {
                let variance = x.var(0.0);
                let gamma = if variance > 0.0 { 1.0 / (features * variance) } else { 1.0 };
                Function::Rbf { gamma }
            }
        }
    }
}

/// A fitted support vector machine.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Svm {
    n_classes: usize,
    function: Function,
    /// `[support vectors, features]`, each once however many pairs use it
    support: Array2<f64>,
    pairs: Vec<Pair>,
}

impl Train for SvmParams {
    type Fitted = Svm;
    const FEWEST_CLASSES: usize = 2;

    fn train(&self, x: ArrayView2<'_, f64>, y: &[usize], n_classes: usize) -> Result<Svm> {
        let weights = self.class_weight.per_class(y, n_classes)?;
        if self.solver == SvmSolver::Linfa {
            let (function, rows) = (self.function(x), Centred::new(x));
            let costs: Vec<f64> = weights.iter().map(|weight| self.C * weight).collect();
            let solved = linfa::train(rows.x.view(), y, &costs, function, self.tol)?;
            let pair = |Solved { first, second, rows, coefficients, rho }| Pair {
                first,
                second,
                rows,
                coefficients,
                rho,
                sigmoid: None,
            };
            let pairs = solved.into_iter().map(pair).collect();
            return Ok(Svm::new(n_classes, function, pairs, x, &rows));
        }
        let costs: Vec<f64> = y.iter().map(|&class| self.C * weights[class]).collect();
        self.solve(x, y, n_classes, &costs)
    }

    /// A weight is a factor of the row's cost.
    fn train_weighted(
        &self,
        x: ArrayView2<'_, f64>,
        y: &[usize],
        n_classes: usize,
        weights: &[f64],
    ) -> Result<Svm> {
        if self.solver == SvmSolver::Linfa {
            return Err(ModelError::Lacks {
                what: "sample weights",
                which: "train with solver=own",
            });
        }
        let per_class = self.class_weight.per_class(y, n_classes)?;
        let cost = |(&class, weight): (&usize, &f64)| self.C * per_class[class] * weight;
        let costs: Vec<f64> = y.iter().zip(weights).map(cost).collect();
        self.solve(x, y, n_classes, &costs)
    }
}

impl SvmParams {
    /// `costs`: the largest α of each row.
    fn solve(
        &self,
        x: ArrayView2<'_, f64>,
        y: &[usize],
        n_classes: usize,
        costs: &[f64],
    ) -> Result<Svm> {
        let function = self.function(x);
        let centred = Centred::new(x);
        let budget = self.cache_mb.saturating_mul(1 << 20);
        let gram = Gram::new(centred.x.view(), function, budget)?;
        let mut members = vec![Vec::new(); n_classes];
        y.iter().enumerate().for_each(|(row, &c)| members[c].push(row as u32));
        let mut seeds = Xoshiro256PlusPlus::seed_from_u64(self.seed);
        let jobs: Vec<(usize, usize, u64)> = (0..n_classes)
            .flat_map(|a| (a + 1..n_classes).map(move |b| (a, b)))
            .map(|(a, b)| (a, b, seeds.next_u64()))
            .collect();
        let cache_bytes = budget / rayon::current_num_threads().min(jobs.len()).max(1);
        let pairs: Vec<Pair> = jobs
            .into_par_iter()
            .map(|(first, second, seed)| {
                let rows = [members[first].as_slice(), &members[second]].concat();
                let sign = |&row: &u32| if y[row as usize] == first { 1.0 } else { -1.0 };
                let problem = TwoClass {
                    gram: &gram,
                    signs: rows.iter().map(sign).collect(),
                    bounds: rows.iter().map(|&row| costs[row as usize]).collect(),
                    rows,
                    tol: self.tol,
                    most_steps: smo::MOST_STEPS,
                    cache_bytes,
                };
                let solution = problem.solve()?;
                let sigmoid = if self.probability {
                    let decisions = problem.held_out_decisions(seed)?;
                    Some(Sigmoid::fit(&decisions, &problem.signs))
                } else {
                    None
                };
                let (mut rows, mut coefficients) = (Vec::new(), Vec::new());
                for ((&row, &alpha), sign) in
                    problem.rows.iter().zip(&solution.alpha).zip(&problem.signs)
                {
                    if alpha > 0.0 {
                        rows.push(row);
                        coefficients.push(alpha * sign);
                    }
                }
                Ok(Pair { first, second, rows, coefficients, rho: solution.rho, sigmoid })
            })
            .collect::<Result<_>>()?;
        Ok(Svm::new(n_classes, function, pairs, x, &centred))
    }
}

impl Svm {
    /// From pairs of rows of `x` that were trained on these rows `centred`.
    fn new(
        n_classes: usize,
        function: Function,
        mut pairs: Vec<Pair>,
        x: ArrayView2<'_, f64>,
        centred: &Centred<'_>,
    ) -> Self {
        for pair in &mut pairs {
            pair.rho += function.shift(centred, pair.terms());
        }
        let support = compact(&mut pairs, x);
        Self { n_classes, function, support, pairs }
    }

    /// Calls `finish` with every row's number and its decision values, one per pair.
    fn decide<T: Send>(
        &self,
        x: ArrayView2<'_, f64>,
        finish: impl Fn(ArrayView1<'_, f64>) -> T + Sync,
    ) -> Vec<T> {
        const BLOCK: usize = 128;
        let support = Centred::new(self.support.view());
        let norms = kernel::squared_lengths(support.x.view());
        let rhos =
            self.pairs.iter().map(|pair| pair.rho - self.function.shift(&support, pair.terms()));
        let rhos: Vec<f64> = rhos.collect();
        let blocks: Vec<_> = x.axis_chunks_iter(Axis(0), BLOCK).collect();
        blocks
            .into_par_iter()
            .flat_map_iter(|block| {
                let block = support.shifted(block);
                let values = self.function.matrix(block.view(), support.x.view(), &norms);
                let decide = |row: ArrayView1<'_, f64>| {
                    let decisions: Array1<f64> = self
                        .pairs
                        .iter()
                        .zip(&rhos)
                        .map(|(pair, rho)| pair.terms().map(|(i, c)| row[i] * c).sum::<f64>() - rho)
                        .collect();
                    finish(decisions.view())
                };
                values.outer_iter().map(decide).collect::<Vec<_>>()
            })
            .collect()
    }
}

impl Classify for Svm {
    fn n_features(&self) -> usize {
        self.support.ncols()
    }

    fn n_classes(&self) -> usize {
        self.n_classes
    }

    fn predict(&self, x: ArrayView2<'_, f64>) -> Result<Vec<usize>> {
        Ok(self.decide(x, |decisions| {
            let mut votes = vec![0.0; self.n_classes];
            for (pair, &d) in self.pairs.iter().zip(decisions) {
                votes[if d > 0.0 { pair.first } else { pair.second }] += 1.0;
            }
            argmax(&votes)
        }))
    }

    /// The votes of the pairs, and less than half a vote more for their decision values, as
    /// scikit-learn breaks ties.
    fn decision_function(&self, x: ArrayView2<'_, f64>) -> Result<Array2<f64>> {
        let two = self.n_classes == 2;
        let rows = self.decide(x, |decisions| {
            if two {
                return vec![-decisions[0]];
            }
            let mut votes = vec![0.0; self.n_classes];
            let mut sums = vec![0.0; self.n_classes];
            for (pair, &d) in self.pairs.iter().zip(decisions) {
                votes[if d < 0.0 { pair.second } else { pair.first }] += 1.0;
                sums[pair.first] += d;
                sums[pair.second] -= d;
            }
            let share = |(vote, sum): (&f64, &f64)| vote + sum / (3.0 * (sum.abs() + 1.0));
            votes.iter().zip(&sums).map(share).collect()
        });
        let columns = if two { 1 } else { self.n_classes };
        Ok(Array2::from_shape_fn((x.nrows(), columns), |(row, class)| rows[row][class]))
    }

    fn predict_proba(&self, x: ArrayView2<'_, f64>) -> Result<Array2<f64>> {
        let sigmoids: Option<Vec<Sigmoid>> = self.pairs.iter().map(|p| p.sigmoid).collect();
        let sigmoids = sigmoids.ok_or(ModelError::NoProbability {
            owner: SvmParams::OWNER,
            remedy: "train with probability=true and solver=own",
        })?;
        let rows = self.decide(x, |decisions| {
            let mut pairwise = Array2::zeros((self.n_classes, self.n_classes));
            for ((pair, sigmoid), &d) in self.pairs.iter().zip(&sigmoids).zip(decisions) {
                let p = sigmoid.at(d).clamp(1e-7, 1.0 - 1e-7);
                pairwise[[pair.first, pair.second]] = p;
                pairwise[[pair.second, pair.first]] = 1.0 - p;
            }
            probability::couple(pairwise.view())
        });
        let mut proba = Array2::zeros((x.nrows(), self.n_classes));
        for (mut to, from) in proba.outer_iter_mut().zip(rows) {
            to.assign(&from);
        }
        Ok(proba)
    }

    fn validate(&self) -> Result<()> {
        let k = self.n_classes;
        let mut expected = (0..k).flat_map(|a| (a + 1..k).map(move |b| (a, b)));
        let finite = |values: &[f64]| values.iter().all(|v| v.is_finite());
        let pairs_sound = self.pairs.iter().all(|p| {
            expected.next() == Some((p.first, p.second))
                && p.rows.len() == p.coefficients.len()
                && p.rows.iter().all(|&r| (r as usize) < self.support.nrows())
                && finite(&p.coefficients)
                && p.rho.is_finite()
                && p.sigmoid.is_none_or(|s| s.is_finite())
        });
        let sound = pairs_sound
            && expected.next().is_none()
            && k >= 2
            && self.function.is_valid()
            && self.support.iter().all(|v| v.is_finite());
        if sound { Ok(()) } else { Err(ModelError::Inconsistent("support vectors".into())) }
    }
}
