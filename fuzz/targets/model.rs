//! Model files with a check sum that is right, so that what lies behind it is reached; an accepted one
//! predicts, and is written as it was read.
#![no_main]

use corsmal_models::model_file::Model;

libfuzzer_sys::fuzz_target!(init: corsmal_fuzz::ours_only(), |bytes: &[u8]| {
    let mut file = bytes.to_vec();
    file.extend(blake3::hash(bytes).as_bytes());
    let Ok(model) = Model::from_bytes(&file) else { return };
    let features = model.n_features();
    assert!(features <= 1 << 24, "{features} features from {} bytes", file.len());
    let zeros = ndarray::Array2::zeros((2, features));
    let _ = model.predict(zeros.view());
    let _ = model.predict_proba(zeros.view());
    let again = model.to_bytes().expect("what was read can be written");
    assert!(Model::from_bytes(&again).is_ok());
});
