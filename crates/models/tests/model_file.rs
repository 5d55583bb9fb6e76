//! Model files: whole, damaged and hostile.

#![allow(clippy::unwrap_used, reason = "tests")]

mod common;

use common::clouds;
use corsmal_models::classifiers::{CLASSIFIERS, ClassifierSpec};
use corsmal_models::labels::Labels;
use corsmal_models::model_file::{Lengths, Model, ModelFileError, ModelHeader, TrainedOn};
use corsmal_models::params::key_values;
use corsmal_models::pipeline::PipelineSpec;
use corsmal_models::steps::{Components, PcaParams, StepSpec};
use ndarray::Array2;
use proptest::prelude::*;

fn model(name: &str, texts: &[&str], rows: usize) -> (Model, Array2<f64>) {
    let (x, y) = clouds(rows, 6, 3, 11);
    let classifier = ClassifierSpec::new(name, &key_values(texts).unwrap()).unwrap();
    let pca = PcaParams { n_components: Some(Components::Count(4)) };
    let mut pipeline = PipelineSpec::standardized(classifier);
    pipeline.steps.push(StepSpec::Pca(pca));
    let fitted = pipeline.train(x.view(), &y, 3).unwrap();
    let header = ModelHeader {
        pipeline,
        labels: Labels::new(vec!["none".into(), "pasta".into(), "rice".into()]).unwrap(),
        target: "type".into(),
        feature_names: (0..6).map(|i| format!("mfcc_{i}")).collect(),
        feature_config: serde_json::json!({"sample_rate": 22050, "mfcc": {"n_mfcc": 6}}),
        feature_config_hash: "00ff".into(),
        provenance: serde_json::json!({"rows": rows}),
        trained_on: None,
        tool_version: "0.1.0".into(),
    };
    (Model::new(header, fitted).unwrap(), x)
}

fn small(name: &str) -> (Model, Array2<f64>) {
    let trees: &[&str] = if ["rf", "et"].contains(&name) { &["trees=3"] } else { &[] };
    model(name, trees, 45)
}

/// Every kind of content that a model file can have: all classifiers, and linfa's solvers.
fn kinds() -> Vec<(Model, Array2<f64>)> {
    let own = CLASSIFIERS.iter().map(|(name, _)| small(name));
    let linfa = [("knn", "algorithm=linfa"), ("tree", "solver=linfa"), ("svm", "solver=linfa")];
    own.chain(linfa.map(|(name, text)| model(name, &[text], 45))).collect()
}

/// The same bytes with a checksum that fits them, as somebody hostile would make them.
fn reseal(mut bytes: Vec<u8>) -> Vec<u8> {
    let end = bytes.len() - 32;
    let checksum = *blake3::hash(&bytes[..end]).as_bytes();
    bytes[end..].copy_from_slice(&checksum);
    bytes
}

#[test]
fn every_classifier_survives_the_disk() {
    let folder = tempfile::tempdir().unwrap();
    let all = kinds();
    for (at, (model, x)) in all.iter().enumerate() {
        let path = folder.path().join(at.to_string());
        model.save(&path).unwrap();
        let back = Model::load(&path).unwrap();
        assert_eq!(back.header(), model.header());
        assert_eq!(back.predict(x.view()).unwrap(), model.predict(x.view()).unwrap());
        let proba = |model: &Model| model.predict_proba(x.view()).ok();
        assert_eq!(proba(&back), proba(model));
        assert_eq!(back.to_bytes().unwrap(), model.to_bytes().unwrap());
    }
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), all.len());
}

/// A model of version 0.1.0 says nothing of the recordings, and its parameters nothing of solvers.
#[test]
fn what_came_after_0_1_0_is_written_only_where_it_is_used() {
    for name in ["knn", "svm", "tree"] {
        let header = serde_json::to_string(small(name).0.header()).unwrap();
        for word in ["trained_on", "solver", "algorithm"] {
            assert!(!header.contains(word), "{name}: {header}");
        }
    }
    let linfa = model("knn", &["algorithm=linfa"], 45).0;
    let header = serde_json::to_string(linfa.header()).unwrap();
    assert!(header.contains("\"algorithm\":\"linfa\""), "{header}");
}

#[test]
fn a_model_knows_which_recordings_it_may_be_applied_to() {
    let with = |trained_on: Option<TrainedOn>, config: serde_json::Value| {
        let header =
            ModelHeader { trained_on, feature_config: config, ..small("knn").0.header().clone() };
        let (x, y) = clouds(45, 6, 3, 11);
        let fitted = header.pipeline.train(x.view(), &y, 3).unwrap();
        Model::new(header, fitted).unwrap()
    };
    let config = |rate: f64, channels: &str, averaged: bool| {
        serde_json::json!({
            "signal": {"sample_rate": rate, "channels": channels},
            "summary": {"average_channels": averaged},
        })
    };
    let formats = [(Some(44_100), Some(8)), (Some(48_000), Some(8)), (Some(44_100), Some(8))];
    let trained = TrainedOn::of(formats).unwrap();
    assert_eq!(
        (&trained.sample_rates[..], &trained.channels[..]),
        (&[44_100, 48_000][..], &[8][..])
    );
    assert_eq!(TrainedOn::of([(Some(8000), None)]), None, "unknown for one is unknown for all");
    let own = config(0.0, "all", false);
    let lengths = Lengths { shortest: 1.0, longest: 2.0 };
    let model = with(Some(TrainedOn { seconds: Some(lengths), ..trained }), own.clone());
    let reread = Model::from_bytes(&model.to_bytes().unwrap()).unwrap();
    assert_eq!(reread.lengths(&own), Some(lengths));
    let cut = serde_json::json!({"signal": {"sample_rate": 0.0, "channels": "all", "length": 3.0}});
    assert_eq!(reread.lengths(&cut), None, "all have one length");
    let rule = model.format_rule(&own).unwrap();
    assert!(rule.check(Some(44_100), Some(8)).is_ok() && rule.check(None, None).is_ok());
    let rate = rule.check(Some(22_050), Some(8)).unwrap_err();
    assert!(rate.starts_with("22,050 Hz; the model was trained on 44,100 Hz, 48,000 Hz"), "{rate}");
    assert!(rule.check(Some(44_100), Some(1)).unwrap_err().starts_with("1 channel;"));
    let both = rule.check(Some(22_050), Some(1)).unwrap_err();
    assert!(both.starts_with("22,050 Hz;") && both.contains("; and 1 channel;"), "{both}");
    // Resampled to a rate of the training, mixed or averaged: another format does not matter.
    let rule = model.format_rule(&config(48_000.0, "mean", false)).unwrap();
    assert!(rule.check(Some(22_050), Some(1)).is_ok());
    let rule = model.format_rule(&config(0.0, "all", true)).unwrap();
    assert!(rule.check(Some(44_100), Some(2)).is_ok() && rule.check(Some(8000), None).is_err());
    assert!(matches!(
        model.format_rule(&config(16_000.0, "all", false)),
        Err(ModelFileError::Rate(_))
    ));
    // Where all were resampled, the rates of files say nothing: features at them are others.
    let low = config(16_000.0, "mean", false);
    let formats = [(Some(44_100), Some(1)), (Some(44_100), Some(1))];
    let resampled = with(TrainedOn::of(formats), low.clone());
    assert!(resampled.format_rule(&low).unwrap().check(Some(8000), Some(1)).is_ok());
    for other in [44_100.0, 0.0] {
        let refused = resampled.format_rule(&config(other, "mean", false)).unwrap_err().to_string();
        assert!(refused.contains("must be 16,000 Hz, as in training"), "{refused}");
    }
    // A model of version 0.1.0 matters only where recordings keep their own rate.
    let old = with(None, own.clone());
    assert!(matches!(old.format_rule(&own), Err(ModelFileError::FormatUnknown { .. })));
    let fixed = config(22_050.0, "mean", false);
    assert!(with(None, fixed.clone()).format_rule(&fixed).is_ok());
}

/// Squared lengths beyond the range of numbers made a file that could not be read back.
#[test]
fn neighbours_with_huge_features_are_refused_or_survive_the_disk() {
    let y = [0, 1, 0, 1, 0, 1];
    for metric in ["euclidean", "manhattan", "cosine", "chebyshev"] {
        let spec = PipelineSpec::plain(
            ClassifierSpec::new("knn", &key_values(&[&format!("metric={metric}"), "k=1"]).unwrap())
                .unwrap(),
        );
        let x = |scale: f64| Array2::from_shape_fn((6, 2), |(r, c)| (r + c) as f64 * scale);
        let fitted = spec.train(x(1e150).view(), &y, 2).unwrap();
        let labels = Labels::new(vec!["a".into(), "b".into()]).unwrap();
        let header =
            ModelHeader { pipeline: spec.clone(), labels, ..small("knn").0.header().clone() };
        let header = ModelHeader { feature_names: Vec::new(), ..header };
        let bytes = Model::new(header, fitted.clone()).unwrap().to_bytes().unwrap();
        assert_eq!(Model::from_bytes(&bytes).unwrap().n_features(), 2, "{metric}");
        let error = spec.train(x(1e200).view(), &y, 2).unwrap_err().to_string();
        assert!(error.contains("row 0") && error.contains("too large"), "{metric}: {error}");
        assert!(fitted.predict(x(1e200).view()).is_err(), "{metric}");
    }
}

#[test]
fn every_truncation_and_every_flipped_byte_is_noticed() {
    for (name, (model, _)) in kinds().iter().enumerate() {
        let bytes = model.to_bytes().unwrap();
        for at in 0..bytes.len() {
            assert!(Model::from_bytes(&bytes[..at]).is_err(), "{name}: cut at {at}");
            // Every byte of the frame, every seventh inside.
            if at < 64 || at % 7 == 0 {
                let mut damaged = bytes.clone();
                damaged[at] ^= 1 << (at % 8);
                assert!(Model::from_bytes(&damaged).is_err(), "{name}: byte {at}");
            }
        }
        let longer = [bytes.as_slice(), &[0]].concat();
        assert!(matches!(Model::from_bytes(&longer), Err(ModelFileError::Length { .. })));
    }
}

#[test]
fn refusals_say_what_is_wrong() {
    let bytes = small("knn").0.to_bytes().unwrap();
    let mut other = bytes.clone();
    other[8] = 9;
    assert!(matches!(Model::from_bytes(&other), Err(ModelFileError::Version { found: 9 })));
    assert!(matches!(Model::from_bytes(b"RIFFabcd"), Err(ModelFileError::NotAModel)));
    assert!(matches!(Model::from_bytes(b""), Err(ModelFileError::NotAModel)));
    let mut huge = bytes.clone();
    huge[12..20].copy_from_slice(&u64::MAX.to_le_bytes());
    assert!(matches!(
        Model::from_bytes(&huge),
        Err(ModelFileError::TooLarge { part: "header", .. })
    ));
    let mut huge = bytes.clone();
    huge[20..28].copy_from_slice(&u64::MAX.to_le_bytes());
    assert!(matches!(Model::from_bytes(&huge), Err(ModelFileError::TooLarge { part: "file", .. })));
    let mut damaged = bytes.clone();
    *damaged.last_mut().unwrap() ^= 1;
    assert!(matches!(Model::from_bytes(&damaged), Err(ModelFileError::Checksum)));
    let absent = Model::load(std::path::Path::new("/nowhere/model"));
    assert!(absent.unwrap_err().to_string().starts_with("/nowhere/model: "));
    let (model, _) = small("knn");
    assert!(model.check_configuration("00ff").is_ok());
    let text = model.check_configuration("abcd").unwrap_err().to_string();
    assert!(text.contains("00ff") && text.contains("abcd"), "{text}");
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(400))]

    // Damage under a checksum that fits: refused, or a model that can be used without panic.
    #[test]
    fn hostile_files_never_panic(
        which in 0..CLASSIFIERS.len() + 3,
        changes in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..4),
        cut in prop::option::of(any::<prop::sample::Index>()),
    ) {
        let (model, x) = hostile_base(which);
        let mut bytes = model.clone();
        // Behind the magic and the version, and mostly in the payload.
        for (index, value) in changes {
            let at = 12 + index.index(bytes.len() - 12);
            bytes[at] = value;
        }
        if let Some(cut) = cut {
            bytes.truncate(60 + cut.index(bytes.len() - 60));
        }
        if let Ok(model) = Model::from_bytes(&reseal(bytes)) {
            if let Ok(proba) = model.predict_proba(x.view()) {
                prop_assert_eq!(proba.nrows(), x.nrows());
            }
            let _ = model.predict(x.view());
        }
    }

    #[test]
    fn saved_models_predict_the_same(seed in any::<u32>(), rows in 9usize..40, k in 1usize..9) {
        let (model, x) = model("knn", &[&format!("k={k}")], rows);
        let (forest, _) = self::model("rf", &["trees=2", &format!("seed={seed}")], rows);
        for model in [model, forest] {
            let back = Model::from_bytes(&model.to_bytes().unwrap()).unwrap();
            prop_assert_eq!(back.predict_proba(x.view()).unwrap(), model.predict_proba(x.view()).unwrap());
        }
    }
}

fn hostile_base(which: usize) -> &'static (Vec<u8>, Array2<f64>) {
    static BASES: std::sync::OnceLock<Vec<(Vec<u8>, Array2<f64>)>> = std::sync::OnceLock::new();
    let make = |(model, x): (Model, Array2<f64>)| (model.to_bytes().unwrap(), x);
    &BASES.get_or_init(|| kinds().into_iter().map(make).collect())[which]
}
