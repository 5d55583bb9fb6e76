//! Every file of the odd and broken WAV corpus has the outcome that `corpus.csv` specifies.

use std::fs;
use std::path::Path;

use corsmal_audio::{AudioError, open};

use crate::common::shared;

/// FNV-1a over the bits of the samples (little-endian), 64 bits.
fn checksum(samples: &[f32]) -> u64 {
    let bytes = samples.iter().flat_map(|s| s.to_bits().to_le_bytes());
    bytes.fold(0xcbf2_9ce4_8422_2325, |h, b| (h ^ u64::from(b)).wrapping_mul(0x0000_0100_0000_01b3))
}

/// One line of the table: what the reader makes of the file.
fn outcome(path: &Path) -> String {
    let read = || -> Result<String, AudioError> {
        let mut source = open(path)?;
        let channels = usize::from(source.spec().channels);
        let mut samples = Vec::new();
        let mut block = vec![0.0; 700 * channels];
        loop {
            let frames = source.read(&mut block)?;
            if frames == 0 {
                break;
            }
            samples.extend_from_slice(&block[..frames * channels]);
        }
        let (spec, report) = (source.spec(), source.health());
        let declared = spec.declared_frames.map_or(String::new(), |n| n.to_string());
        let repairs: Vec<_> = report.repairs.iter().map(|r| r.name()).collect();
        Ok(format!(
            "ok,{},{channels},{},{declared},{},{:016x},{}",
            spec.format,
            spec.sample_rate,
            report.decoded_frames,
            checksum(&samples),
            repairs.join(";")
        ))
    };
    read().unwrap_or_else(|e| {
        format!(
            "{},,,,,,,{}",
            e.verdict().name(),
            e.offset().map_or(String::new(), |n| n.to_string())
        )
    })
}

#[test]
fn every_file_has_its_specified_outcome() {
    let Some(root) = shared("data/wav_corpus") else { return };
    let table = include_str!("corpus.csv");
    let mut wrong = Vec::new();
    let mut lines = 0;
    for line in table.lines().skip(1) {
        let (file, expected) = line.split_once(',').expect("file and outcome");
        let actual = outcome(&root.join(file));
        lines += 1;
        if actual != expected {
            wrong.push(format!("{file}\n  expected {expected}\n  actual   {actual}"));
        }
    }
    assert!(wrong.is_empty(), "{} of {lines} differ:\n{}", wrong.len(), wrong.join("\n"));
    let files = ["hound", "scipy", "wavefile"]
        .iter()
        .flat_map(|dir| fs::read_dir(root.join(dir)).unwrap())
        .filter(|entry| entry.as_ref().unwrap().path().extension().is_some_and(|e| e == "wav"));
    assert_eq!(lines, files.count(), "files without a line in the table");
}
