//! What k nearest neighbours are asked for.

use ndarray::{ArcArray2, ArrayView2};
use serde::{Deserialize, Serialize};

use super::linfa::{self, LinfaNeighbours};
use super::{KNearest, Metric, Weights, check_lengths, copied, squared_lengths, unit_rows};
use crate::classifiers::Train;
use crate::error::{ModelError, Result};
use crate::params::{Parameters, parameters};

/// Who finds the neighbours.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Search {
    /// this crate, by exhaustive search
    #[default]
    Brute,
    /// linfa-nn: a k-d tree up to 16 features, else its linear search
    Linfa,
}

impl Search {
    fn is_brute(&self) -> bool {
        *self == Self::Brute
    }
}

parameters! {
    /// Parameters of k nearest neighbours.
    KNearestParams, "knn" {
        k: usize = 5, "a whole number from 1 to the number of training rows", "neighbours that vote";
        weights: Weights = Weights::Uniform, "uniform or distance", "how votes count";
        metric: Metric = Metric::Euclidean,
            "euclidean, manhattan, cosine, chebyshev or minkowski", "distance between rows";
        p: f64 = 2.0, "a number of at least 1", "exponent of metric=minkowski";
        #[serde(skip_serializing_if = "Search::is_brute")]
        algorithm: Search = Search::Brute, "brute or linfa",
            "this program's search for neighbours, or linfa-nn";
    }
    check(this) {
        Self::require(this.k >= 1, "k", this.k)?;
        Self::require(this.p.is_finite() && this.p >= 1.0, "p", this.p)?;
        match this.algorithm {
            Search::Brute => Ok(()),
            Search::Linfa => linfa::check(this.metric),
        }
    }
}

impl KNearestParams {
    /// Refuses an exponent that the metric does not have. Models of earlier versions that hold one
    /// are read: it had no effect on them.
    fn check_exponent(&self) -> Result<()> {
        let fits = match self.metric {
            Metric::Minkowski => true,
            Metric::Manhattan => self.p == 1.0 || self.p == 2.0,
            Metric::Euclidean | Metric::Cosine | Metric::Chebyshev => self.p == 2.0,
        };
        if fits {
            return Ok(());
        }
        Err(ModelError::ParameterValue {
            owner: Self::OWNER,
            key: "p".into(),
            value: self.p.to_string(),
            allowed: format!(
                "left out with metric={}, which has no exponent (metric=minkowski has one)",
                format!("{:?}", self.metric).to_lowercase()
            ),
        })
    }
}

/// Training rows of either search.
pub enum FittedNeighbours {
    Own(KNearest),
    Linfa(LinfaNeighbours),
}

impl Train for KNearestParams {
    type Fitted = FittedNeighbours;
    const FEWEST_CLASSES: usize = 1;

    fn train(
        &self,
        x: ArrayView2<'_, f64>,
        y: &[usize],
        n_classes: usize,
    ) -> Result<FittedNeighbours> {
        self.keep(x, copied, y, n_classes)
    }

    fn train_shared(
        &self,
        x: &ArcArray2<f64>,
        y: &[usize],
        n_classes: usize,
    ) -> Result<FittedNeighbours> {
        if !x.is_standard_layout() {
            return self.train(x.view(), y, n_classes);
        }
        self.keep(x.view(), |view| (x.clone(), squared_lengths(view)), y, n_classes)
    }
}

impl KNearestParams {
    /// Keeps the training rows, which `rows` gives with their squared lengths; for the cosine metric, rows of
    /// unit length.
    fn keep(
        &self,
        x: ArrayView2<'_, f64>,
        rows: impl Fn(ArrayView2<'_, f64>) -> (ArcArray2<f64>, Vec<f64>),
        y: &[usize],
        n_classes: usize,
    ) -> Result<FittedNeighbours> {
        self.check_exponent()?;
        if self.k > x.nrows() {
            return Err(ModelError::ParameterValue {
                owner: Self::OWNER,
                key: "k".into(),
                value: self.k.to_string(),
                allowed: format!("at most the number of training rows ({})", x.nrows()),
            });
        }
        let (x, norms) = match self.metric {
            Metric::Cosine => {
                check_lengths(&squared_lengths(x))?;
                let x = unit_rows(x).into_shared();
                let norms = squared_lengths(x.view());
                (x, norms)
            }
            _ => {
                let (x, norms) = rows(x);
                check_lengths(&norms)?;
                (x, norms)
            }
        };
        let rows = KNearest {
            k: self.k,
            weights: self.weights,
            metric: self.metric,
            p: self.p,
            n_classes,
            x,
            y: y.to_vec(),
            norms,
        };
        match self.algorithm {
            Search::Brute => Ok(FittedNeighbours::Own(rows)),
            Search::Linfa => LinfaNeighbours::new(rows).map(FittedNeighbours::Linfa),
        }
    }
}
