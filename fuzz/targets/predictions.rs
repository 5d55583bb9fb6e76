//! Prediction files.
#![no_main]

use std::path::Path;

use corsmal_models::predictions::PredictionTable;

libfuzzer_sys::fuzz_target!(init: corsmal_fuzz::ours_only(), |bytes: &[u8]| {
    let _ = PredictionTable::parse(bytes, Path::new("predictions.csv"));
});
