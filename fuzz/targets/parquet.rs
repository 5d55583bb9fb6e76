//! Parquet tables, ours and others.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    corsmal_fuzz::read_features(&corsmal_fuzz::file("features.parquet", bytes));
});
