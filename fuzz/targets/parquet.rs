//! Parquet tables, ours and others.
#![no_main]

libfuzzer_sys::fuzz_target!(init: corsmal_fuzz::ours_only(), |bytes: &[u8]| {
    corsmal_fuzz::read_features(&corsmal_fuzz::file("features.parquet", bytes));
});
