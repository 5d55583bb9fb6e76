//! Published estimates of capacity.

use std::path::{Path, PathBuf};

use corsmal_ccm::capacity;
use corsmal_ccm::dataset::{Annotations, Container};
use corsmal_ccm::predictions::read_capacities;
use corsmal_ccm::scores::{RuleSet, evaluate};
use corsmal_ccm::submission::{Submission, pseudo_random};
use corsmal_vision::lode::PRIOR_ML;

/// Capacities that the printed scores of two methods imply: inferred, not official.
const IMPLIED: [(u8, f64); 3] = [(10, 641.0), (11, 469.0), (12, 1668.0)];

#[test]
fn public_capacity_files_score_as_printed() {
    let Some(data) = shared() else { return };
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("annotation.csv");
    let mut text = String::from(
        "Container ID,Sequence,Scenario,Background,Illumination,Container Capacity [mL],Container mass \
         [g],Filling type,Filling density [g/mL],Filling level,Filling mass [g]\n",
    );
    for (number, capacity) in IMPLIED {
        for sequence in 0..Container::new(number).unwrap().recordings() {
            text += &format!("{number},{sequence},s0,b0,l0,{capacity},10,0,0,0,0\n");
        }
    }
    std::fs::write(&path, text).unwrap();
    let annotations = Annotations::read(&path).unwrap();
    for (file, printed) in [
        ("other_predictions/m2_submission_public.csv", [66.02, 69.14, 65.08]),
        ("m5_predictions/submission_public_test.csv", [60.71, 62.43, 57.71]),
    ] {
        let submission = Submission::read(&data.join(file)).unwrap();
        let stand_in = pseudo_random(&submission.keys, 1);
        let stand_in = Submission::from_predictions("random", submission.format, &stand_in);
        for ((container, _), printed) in IMPLIED.into_iter().zip(printed) {
            let only = [container];
            let scores =
                evaluate(&submission, &annotations, &stand_in, RuleSet::Paper, Some(&only))
                    .unwrap();
            let score = scores.get("T3").unwrap();
            assert!((score - printed).abs() < 0.1, "{file}, {container}: {score} not {printed}");
        }
    }
}

#[test]
fn stored_frames_combine_to_the_published_file() {
    let Some(data) = shared() else { return };
    let dir = tempfile::tempdir().unwrap();
    let file = |name: &str| data.join(format!("m5_predictions/capacity_estimation_{name}.csv"));
    let out = dir.path().join("combined.csv");
    let frames = [file("1_public_test"), file("20_public_test")];
    assert_eq!(capacity::combine_files(&frames, PRIOR_ML, &out).unwrap(), (228, 81));
    let (own, published) =
        (read_capacities(&out).unwrap(), read_capacities(&file("combination_public_test")));
    for (key, value) in published.unwrap() {
        assert!((own[&key].unwrap() - value.unwrap()).abs() < 1e-9, "{key}");
    }
}

/// Folder `ccm` of the reference data; says so when it is not there.
fn shared() -> Option<PathBuf> {
    let root = std::env::var_os("CORSMAL_SHARED").map_or_else(
        || Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared"),
        PathBuf::from,
    );
    let path = root.join("data/ccm");
    if !path.exists() {
        eprintln!("skipped: {} is absent (set CORSMAL_SHARED)", path.display());
        return None;
    }
    Some(path)
}
