//! The same votes over neighbours that linfa-nn finds.
//!
//! linfa-nn is an index without votes and cannot be stored: the rows are kept, and the index is made
//! for each prediction. Which of several rows at the same distance is a neighbour is linfa-nn's choice.

use linfa_nn::distance::{L1Dist, L2Dist, LInfDist};
use linfa_nn::{CommonNearestNeighbour, NearestNeighbour, NearestNeighbourIndex};
use ndarray::{Array2, ArrayView1, ArrayView2, Axis};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::nearest::Nearest;
use super::{KNearest, Metric, OWNER, check_lengths, squared_lengths};
use crate::classifiers::{Classify, Neighbours};
use crate::error::{ModelError, Result};

/// The name by which model files know these neighbours.
pub(in crate::classifiers) const STORED_NAME: &str = "linfa-nn";

/// With more features than this a tree looks at every row anyway.
const MOST_TREE_FEATURES: usize = 16;

/// Largest squared length of a row: beyond it differences of rows overflow inside linfa-nn.
const LONGEST: f64 = 1e280;

/// Refuses distances that linfa-nn does not have.
pub(super) fn check(metric: Metric) -> Result<()> {
    if matches!(metric, Metric::Euclidean | Metric::Manhattan | Metric::Chebyshev) {
        return Ok(());
    }
    Err(ModelError::ParameterValue {
        owner: OWNER,
        key: "metric".into(),
        value: format!("{:?}", metric).to_lowercase(),
        allowed: "euclidean, manhattan or chebyshev with algorithm=linfa".into(),
    })
}

/// Training rows that linfa-nn searches.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct LinfaNeighbours(KNearest);

impl LinfaNeighbours {
    pub(super) fn new(rows: KNearest) -> Result<Self> {
        check_range(&rows.norms)?;
        Ok(Self(rows))
    }

    fn vote(
        &self,
        index: &dyn NearestNeighbourIndex<f64>,
        query: ArrayView1<'_, f64>,
    ) -> Result<Vec<f64>> {
        let rows = &self.0;
        let found = index.k_nearest(query, rows.k).map_err(failed)?;
        let exact = |(_, row): &(_, usize)| (rows.distance(query, *row), *row);
        let nearest = Nearest::exactly(found.iter().map(exact).collect());
        let mut votes = vec![0.0; rows.n_classes];
        rows.vote(nearest, &mut votes);
        Ok(votes)
    }
}

impl Classify for LinfaNeighbours {
    fn n_features(&self) -> usize {
        self.0.n_features()
    }

    fn n_classes(&self) -> usize {
        self.0.n_classes()
    }

    fn predict_proba(&self, x: ArrayView2<'_, f64>) -> Result<Array2<f64>> {
        let squared = squared_lengths(x);
        check_lengths(&squared)?;
        check_range(&squared)?;
        let rows = &self.0.x;
        let kind = if rows.ncols() <= MOST_TREE_FEATURES {
            CommonNearestNeighbour::KdTree
        } else {
            CommonNearestNeighbour::LinearSearch
        };
        let index = match self.0.metric {
            Metric::Manhattan => kind.from_batch(rows, L1Dist),
            Metric::Chebyshev => kind.from_batch(rows, LInfDist),
            _ => kind.from_batch(rows, L2Dist),
        };
        let index = index.map_err(failed)?;
        // linfa-nn wants rows that lie in one piece.
        let x = x.as_standard_layout();
        let votes: Vec<Vec<f64>> = x
            .axis_iter(Axis(0))
            .into_par_iter()
            .map(|query| self.vote(index.as_ref(), query))
            .collect::<Result<_>>()?;
        let mut proba = Array2::zeros((x.nrows(), self.0.n_classes));
        proba
            .outer_iter_mut()
            .zip(votes)
            .for_each(|(mut row, votes)| row.assign(&ndarray::aview1(&votes)));
        Ok(proba)
    }

    fn neighbours(&self, x: Option<ArrayView2<'_, f64>>, k: usize) -> Result<Neighbours> {
        self.0.neighbours(x, k)
    }

    fn validate(&self) -> Result<()> {
        self.0.validate()?;
        check_range(&self.0.norms)?;
        match self.0.metric {
            Metric::Euclidean | Metric::Manhattan | Metric::Chebyshev => Ok(()),
            _ => Err(ModelError::Inconsistent("neighbours".into())),
        }
    }
}

fn check_range(squared_lengths: &[f64]) -> Result<()> {
    match squared_lengths.iter().position(|length| *length > LONGEST) {
        None => Ok(()),
        Some(row) => Err(ModelError::Numerical {
            owner: OWNER,
            reason: format!(
                "the features of row {row} are too large for algorithm = linfa: standardize them"
            ),
        }),
    }
}

fn failed(error: impl std::fmt::Display) -> ModelError {
    ModelError::Numerical { owner: OWNER, reason: format!("linfa-nn: {error}") }
}
