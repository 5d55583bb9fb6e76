//! Tables of the benchmark: submissions, annotations, capacities, predictions by recording, actions,
//! models of M3.
#![no_main]

use corsmal_ccm::capacity::{self, CapacityModel};
use corsmal_ccm::dataset::{Annotations, read_actions};
use corsmal_ccm::predictions::{self, RecordingPredictions, read_capacities};
use corsmal_ccm::submission::Submission;
use corsmal_models::voting::VotingRule;

libfuzzer_sys::fuzz_target!(init: corsmal_fuzz::ours_only(), |bytes: &[u8]| {
    let path = corsmal_fuzz::file("table.csv", bytes);
    let annotations = Annotations::read(&path);
    if let (Ok(submission), Ok(annotations)) = (Submission::read(&path), &annotations) {
        let _ = submission.align(annotations, annotations);
    }
    let _ = read_capacities(&path);
    let _ = read_actions(&path);
    let _ = capacity::read(&path);
    let _ = CapacityModel::read(&path);
    if let Ok(table) = predictions::read(&path) {
        let _ = table.vote(VotingRule::Majority(None)).map(|voted| voted.to_csv());
        let _ = RecordingPredictions::average(&[table.clone(), table], None);
    }
});
