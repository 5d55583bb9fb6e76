//! One feature that outweighs all others in distances.

use ndarray::ArrayView1;

use crate::classifiers::ClassifierSpec;
use crate::dataset::LabelledTable;
use crate::pipeline::PipelineSpec;
use crate::steps::StepSpec;

/// Share of the squared spreads of all features from which on a feature decides alone.
const SHARE: f64 = 0.9;
/// Fewest features: of two, one may well say more.
const FEATURES: usize = 3;

/// That a feature decides the distances of a classifier that measures them, in words.
pub fn dominance(pipelines: &[PipelineSpec], table: &LabelledTable) -> Option<String> {
    let by_distance = |pipeline: &&PipelineSpec| {
        let scaled = pipeline.steps.iter().any(|step| matches!(step, StepSpec::Standardize(_)));
        let measures =
            matches!(pipeline.classifier, ClassifierSpec::KNearest(_) | ClassifierSpec::Svm(_));
        measures && !scaled
    };
    let name = pipelines.iter().find(by_distance)?.classifier.name();
    if table.x.ncols() < FEATURES {
        return None;
    }
    let spreads: Vec<f64> =
        table.x.columns().into_iter().map(|column| spread(column).powi(2)).collect();
    let (first, largest) =
        spreads.iter().copied().enumerate().max_by(|a, b| a.1.total_cmp(&b.1))?;
    (largest >= SHARE * spreads.iter().sum::<f64>() && largest > 0.0).then(|| {
        format!(
            "{} varies so much more than the {} other features that {name} decides by it almost alone; --standardize \
             (in Python a StandardScaler before it) gives all features the same weight",
            table.feature_name(first),
            table.x.ncols() - 1
        )
    })
}

/// From the 10th to the 90th percentile, about: a few outliers do not count.
fn spread(column: ArrayView1<'_, f64>) -> f64 {
    let mut values = column.to_vec();
    let tenth = values.len() / 10;
    let mut at = |place: usize| *values.select_nth_unstable_by(place, f64::total_cmp).1;
    match column.len() {
        0 => 0.0,
        n => at(n - 1 - tenth) - at(tenth),
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use ndarray::array;

    use super::*;

    #[test]
    fn a_feature_that_decides_alone_is_named() {
        let table = |scale: f64| {
            let ids = ["a", "b", "c", "d"].map(String::from).to_vec();
            let mut table = LabelledTable::of_columns(Path::new("x.npz"), ids, Vec::new());
            table.x = array![[1.0, 0.0, 1.0], [2.0, 1.0, 0.0], [4.0, 1.0, 1.0], [8.0, 0.0, 0.0]];
            table.x.column_mut(0).mapv_inplace(|v| v * scale);
            table
        };
        let spec = |name: &str| ClassifierSpec::named(name).unwrap();
        let plain = |name: &str| [PipelineSpec::plain(spec(name))];
        let said = dominance(&plain("knn"), &table(1000.0)).unwrap();
        assert!(said.contains("more than the 2 other features that knn decides"), "{said}");
        assert!(dominance(&plain("svm"), &table(1000.0)).is_some());
        for (pipeline, scale) in [
            (plain("knn"), 0.1),
            (plain("rf"), 1000.0),
            ([PipelineSpec::standardized(spec("knn"))], 1000.0),
        ] {
            assert_eq!(dominance(&pipeline, &table(scale)), None);
        }
    }
}
