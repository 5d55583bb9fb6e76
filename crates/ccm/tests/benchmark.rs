//! The benchmark on synthetic recordings, and its features on the real one.

#![allow(clippy::unwrap_used)]

mod shared_data;

use std::path::Path;
use std::sync::atomic::{AtomicUsize, Ordering};

use corsmal_ccm::benchmark::{Baseline, BaselineFeatures, FeatureSet, FeatureSource, Options, run};
use corsmal_ccm::synth::{self, Size};
use corsmal_extract::npz::NpzFile;
use ndarray::Axis;
use shared_data::ccm;

/// Features of librosa 0.8.0 on the one real recording.
#[test]
fn features_are_those_of_the_published_code() {
    let Some(path) = ccm("baseline_feature_reference.npz") else { return };
    let wav = ccm("audio/s1_fi0_fu0_b1_l0_audio.wav").unwrap();
    let mut reference = NpzFile::open(&path).unwrap();
    let zcr = reference.f64("zcr_mfcc26").unwrap().index_axis(Axis(0), 0).to_owned();
    let spectrogram = reference.f32("spectrogram96").unwrap().index_axis(Axis(0), 0).to_owned();
    let ours = BaselineFeatures.vector(FeatureSet::ZcrMfcc, &wav, None).unwrap();
    assert_eq!(ours.len(), zcr.len());
    for (a, b) in ours.iter().zip(&zcr) {
        assert!((f64::from(*a) - b).abs() < 1e-3 * b.abs().max(1.0), "{a} {b}");
    }
    let ours = BaselineFeatures.vector(FeatureSet::Spectrogram, &wav, None).unwrap();
    assert_eq!(ours.len(), spectrogram.len());
    for (a, b) in ours.iter().zip(&spectrogram) {
        assert!((a - b).abs() < 0.02, "{a} {b}");
    }
}

/// Counts how often features are computed; the values are a few statistics of the file's bytes.
struct Counting(AtomicUsize);

impl FeatureSource for Counting {
    fn identity(&self, set: FeatureSet) -> String {
        format!("counting {}", set.slug())
    }

    fn vector(
        &self,
        set: FeatureSet,
        path: &Path,
        _: Option<(f64, f64)>,
    ) -> Result<Vec<f32>, String> {
        self.0.fetch_add(1, Ordering::Relaxed);
        let bytes = std::fs::read(path).map_err(|e| e.to_string())?;
        let step = bytes.len() / set.width();
        Ok((0..set.width()).map(|i| f32::from(bytes[i * step])).collect())
    }
}

#[test]
fn the_report_is_complete_and_features_are_kept() {
    let dir = tempfile::tempdir().unwrap();
    let data = dir.path().join("data");
    synth::generate(&data, Size::Reduced, 3).unwrap();
    let out = dir.path().join("report");
    let options = Options {
        data: data.clone(),
        out: out.clone(),
        baselines: Baseline::all()
            .into_iter()
            .filter(|b| b.features == FeatureSet::ZcrMfcc)
            .collect(),
        added: Vec::new(),
        seed: 1,
    };
    let source = Counting(AtomicUsize::new(0));
    let report = run(&options, &source, &|_| {}).unwrap();
    assert_eq!(source.0.load(Ordering::Relaxed), 133);
    assert!(report.warning.unwrap().contains("SYNTHETIC"));

    let read = |name: &str| std::fs::read_to_string(out.join(name)).unwrap();
    let html = read("report.html");
    assert!(html.contains("SYNTHETIC") && html.contains("<svg"));
    for outside in ["http://", "https://", "src=", "@import", "<link"] {
        assert!(!html.contains(outside), "the page needs {outside}");
    }
    let level = read("tables/level.csv");
    assert!(level.contains("paper,M6,audio,paper,,80.2200,81.4600,80.8400"), "{level}");
    // Three baselines in two variants and the random estimates, each with a public figure.
    assert_eq!(level.lines().filter(|l| l.starts_with("ours,")).count(), 7);
    let json: serde_json::Value = serde_json::from_str(&read("report.json")).unwrap();
    assert_eq!(json["sections"][0]["id"], "level");
    let submission = read("submissions/zcr-mfcc-rf-corrected-public-test.csv");
    assert_eq!(submission.lines().count(), 1 + 19);
    assert!(out.join("figures/zcr-mfccs-rf-corrected-joint-confusion.svg").exists());
    let model =
        corsmal_models::model_file::Model::load(&out.join("models/zcr-mfcc-rf-corrected.model"));
    assert_eq!(model.unwrap().n_features(), 26);

    run(&options, &source, &|_| {}).unwrap();
    assert_eq!(source.0.load(Ordering::Relaxed), 133, "cached features were not used");
    assert!(read("tables/level.csv") == level, "a second run differs");
}

#[test]
fn an_unusable_file_to_add_stops_before_the_work() {
    let dir = tempfile::tempdir().unwrap();
    let file = dir.path().join("p.csv");
    std::fs::write(&file, "a,b\n1,2\n").unwrap();
    let options = Options {
        data: dir.path().join("nowhere"),
        out: dir.path().join("report"),
        baselines: Vec::new(),
        added: vec![("x".into(), file)],
        seed: 1,
    };
    let error = run(&options, &BaselineFeatures, &|_| {}).unwrap_err().to_string();
    assert!(error.contains("p.csv: no column"), "{error}");
    assert!(!options.out.exists());
}
