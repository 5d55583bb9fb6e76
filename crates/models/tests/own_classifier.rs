//! The example of a registered classifier runs, and its refusals are those of the built-in ones.

#![allow(clippy::unwrap_used, reason = "tests")]

mod common;

#[path = "../examples/own_classifier.rs"]
mod example;

use common::clouds;
use corsmal_models::ModelError;
use corsmal_models::classifiers::{ClassifierSpec, classifiers, register};
use corsmal_models::cross_validation::{Data, cross_validate};
use corsmal_models::labels::Labels;
use corsmal_models::model_file::{Model, ModelHeader};
use corsmal_models::params::key_values;
use corsmal_models::pipeline::PipelineSpec;
use corsmal_models::splits::stratified_k_fold;
use corsmal_models::targets::Classes;
use linfa::DatasetBase;

#[test]
fn a_registered_classifier_is_like_any_other() {
    assert!(ClassifierSpec::named("nearest-mean").is_err(), "nobody registered it yet");
    example::main().unwrap();
    assert!(classifiers().iter().any(|(name, _)| *name == "nearest-mean"));
    let again = register::<example::NearestMeanParams>("twice").unwrap_err();
    assert!(matches!(again, ModelError::NameTaken { name: "nearest-mean" }), "{again}");

    let parameters = key_values(&["sharpness=0.5"]).unwrap();
    let classifier = ClassifierSpec::new("nearest-mean", &parameters).unwrap();
    for (texts, part) in [("sharpness=0", "a positive number"), ("sharp=1", "sharpness")] {
        let texts = key_values(&[texts]).unwrap();
        let refusal = ClassifierSpec::new("nearest-mean", &texts).unwrap_err().to_string();
        assert!(refusal.contains(part), "{refusal}");
    }
    let (x, y) = clouds(90, 5, 3, 41);
    let folds = stratified_k_fold(&y, 3, Some(0)).unwrap();
    let pipeline = PipelineSpec::standardized(classifier);
    let dataset = DatasetBase::new(x.view(), Classes::new(y.clone(), 3).unwrap());
    let data = Data { dataset: &dataset, merge: None };
    assert!(cross_validate(&data, &folds, &pipeline).unwrap().pooled.accuracy > 0.6);

    // Its specification and the model survive text and disk; damage is noticed.
    let text = serde_json::to_string(&pipeline).unwrap();
    assert_eq!(serde_json::from_str::<PipelineSpec>(&text).unwrap(), pipeline);
    let fitted = pipeline.train(x.view(), &y, 3).unwrap();
    let labels = Labels::new(["a", "b", "c"].map(String::from).to_vec()).unwrap();
    let model = Model::new(ModelHeader::new(pipeline, labels), fitted).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("own.model");
    model.save(&path).unwrap();
    let back = Model::load(&path).unwrap();
    assert_eq!(back.predict_proba(x.view()).unwrap(), model.predict_proba(x.view()).unwrap());
    let bytes = std::fs::read(&path).unwrap();
    assert!(Model::from_bytes(&bytes[..bytes.len() - 1]).is_err());
}
