//! M5's stored predictions, fused by averaging, are its submission.

#![allow(clippy::unwrap_used)]

mod shared_data;

use corsmal_ccm::predictions::{self, RecordingPredictions, RowName};
use corsmal_ccm::submission::Submission;
use shared_data::ccm;

#[test]
fn averages_of_m5_are_its_submission() {
    let Some(path) = ccm("m5_predictions/submission_public_test.csv") else { return };
    let submission = Submission::read(&path).unwrap();
    let fuse = |files: &[&str]| {
        let tables: Vec<_> = files
            .iter()
            .map(|f| {
                let path = ccm(&format!("m5_predictions/publictest_{f}.csv")).unwrap();
                predictions::read(&path).unwrap()
            })
            .collect();
        RecordingPredictions::average(&tables, None).unwrap()
    };
    let kind = fuse(&["type_rf", "type_vggish_agg"]);
    let level = fuse(&["level_rf", "level_vggish_agg", "level_r21d_agg"]);
    for (fused, estimates) in [(kind, &submission.kind), (level, &submission.level)] {
        let equal = submission.keys.iter().zip(&estimates.values).filter(|(key, value)| {
            let name = RowName::Recording(**key);
            let row = fused.rows.iter().find(|row| row.key == name).unwrap();
            row.class.unwrap() as f64 == **value
        });
        assert_eq!(equal.count(), 228);
    }
}
