//! Synthetic data sets: same bytes for any number of threads, and what is in them.

#![allow(clippy::unwrap_used)]

use std::collections::BTreeMap;
use std::path::Path;

use corsmal_ccm::synth::{self, NOTICE, Size};

/// All files below a folder by relative name.
fn files(dir: &Path, prefix: &str, into: &mut BTreeMap<String, Vec<u8>>) {
    for entry in std::fs::read_dir(dir).unwrap() {
        let entry = entry.unwrap();
        let name = format!("{prefix}{}", entry.file_name().to_string_lossy());
        if entry.path().is_dir() {
            files(&entry.path(), &format!("{name}/"), into);
        } else {
            into.insert(name, std::fs::read(entry.path()).unwrap());
        }
    }
}

fn made(threads: usize, seed: u64) -> BTreeMap<String, Vec<u8>> {
    let dir = tempfile::tempdir().unwrap();
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
    pool.install(|| synth::generate(dir.path(), Size::Small, seed)).unwrap();
    let mut all = BTreeMap::new();
    files(dir.path(), "", &mut all);
    all
}

#[test]
fn same_bytes_for_any_number_of_threads() {
    let one = made(1, 5);
    assert!(one == made(3, 5));
    let wav = "train/1/audio/s0_fi1_fu1_b1_l0_audio.wav";
    assert!(one[wav] != made(2, 6)[wav]);
    assert_eq!(one.len(), 57 + 3);
    assert!(String::from_utf8_lossy(&one[NOTICE]).contains("NOT THE CORSMAL DATA SET"));
}

#[test]
fn recordings_are_as_the_data_set_has_them() {
    let dir = tempfile::tempdir().unwrap();
    synth::generate(dir.path(), Size::Small, 1).unwrap();
    let read = |name: &str| {
        let path = dir.path().join(format!("train/3/audio/s0_{name}_b1_l0_audio.wav"));
        let mut reader = hound::WavReader::open(path).unwrap();
        let spec = reader.spec();
        assert_eq!((spec.channels, spec.sample_rate, spec.bits_per_sample), (8, 44_100, 16));
        reader.samples::<i16>().map(|s| f64::from(s.unwrap())).collect::<Vec<f64>>()
    };
    let rms = |x: &[f64]| (x.iter().map(|v| v * v).sum::<f64>() / x.len() as f64).sqrt();
    let (empty, rice) = (read("fi0_fu0"), read("fi2_fu2"));
    assert!(rms(&rice) > 3.0 * rms(&empty));
    // More filling takes longer, pasta, rice and water together (single recordings vary).
    let seconds = |level: u8| -> usize {
        (1..=3).map(|filling| read(&format!("fi{filling}_fu{level}")).len()).sum()
    };
    assert!(seconds(2) > seconds(1));
    // No two microphones hear the same.
    let channel = |c: usize| rice.iter().skip(c).step_by(8).collect::<Vec<_>>();
    assert!((1..8).all(|c| channel(c) != channel(0)));
}

#[test]
fn a_folder_with_other_files_is_left_alone() {
    let dir = tempfile::tempdir().unwrap();
    std::fs::write(dir.path().join("thesis.txt"), "x").unwrap();
    let error = synth::generate(dir.path(), Size::Small, 1).unwrap_err().to_string();
    assert!(error.contains("not synthetic"), "{error}");
    assert_eq!(std::fs::read_dir(dir.path()).unwrap().count(), 1);
}

/// What an earlier run had made stayed among the new recordings.
#[test]
fn a_folder_of_other_recordings_is_refused() {
    let dir = tempfile::tempdir().unwrap();
    let make = |size, seed| synth::generate(dir.path(), size, seed).map_err(|e| e.to_string());
    make(Size::Small, 5).unwrap();
    make(Size::Small, 5).unwrap();
    for refused in [make(Size::Small, 6), make(Size::Reduced, 5)] {
        assert!(refused.unwrap_err().contains("of another size, seed or version"));
    }
    let mut all = BTreeMap::new();
    files(dir.path(), "", &mut all);
    assert!(all == made(2, 5));
    // A run with views says more, and leaves them where one without would leave them, too.
    let notice = dir.path().join(NOTICE);
    let views = std::fs::read_to_string(&notice).unwrap() + "calib/, rgb/, depth/";
    std::fs::write(&notice, views).unwrap();
    assert!(make(Size::Small, 5).unwrap_err().contains("or with views"));
}
