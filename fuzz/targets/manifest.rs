//! Manifests and label files, as CSV and as JSON lines; and the bytes as a tar of recordings.
#![no_main]

use corsmal_extract::inputs;
use corsmal_models::dataset::LabelFile;

libfuzzer_sys::fuzz_target!(init: corsmal_fuzz::ours_only(), |bytes: &[u8]| {
    corsmal_fuzz::file("a.wav", b"RIFF");
    for name in ["list.csv", "list.jsonl", "list.tar"] {
        let path = corsmal_fuzz::file(name, bytes);
        let _ = inputs::collect(&[&path]);
        let _ = LabelFile::read(&path, None);
    }
});
