//! What is wrong with one recording, or with this program, costs that recording only.

use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use corsmal_extract::config::Config;
use corsmal_extract::inputs;
use corsmal_extract::run::{self, Progress, Quiet, RunError, RunOptions, RunReport};
use corsmal_files::npz::Compression;
use corsmal_files::outcome::{Outcome, Status};
use corsmal_files::shard::Shard;

use crate::support::text;

/// A WAV of one channel with so many samples.
fn wav(path: &Path, sample_rate: u32, samples: usize) {
    let spec = hound::WavSpec {
        channels: 1,
        sample_rate,
        bits_per_sample: 16,
        sample_format: hound::SampleFormat::Int,
    };
    let mut writer = hound::WavWriter::create(path, spec).unwrap();
    (0..samples).for_each(|i| writer.write_sample((i * i % 997) as i16).unwrap());
    writer.finalize().unwrap();
}

fn run(
    folder: &Path,
    preset: &str,
    progress: &dyn Progress,
    change: impl Fn(&mut RunOptions),
) -> Result<RunReport, RunError> {
    let found = inputs::collect(&[text(&folder.join("audio")).to_string()]).unwrap();
    let config = Arc::new(Config::preset(preset).unwrap());
    let mut options = RunOptions {
        out: folder.join("out.npz"),
        compression: Compression::Stored,
        jobs: 2,
        shard: Shard::default(),
        resume: false,
        overwrite: false,
        max_errors: None,
    };
    change(&mut options);
    run::run(&found, &config, &options, progress, &Arc::new(AtomicBool::new(false)))
}

fn statuses(report: &RunReport) -> Vec<Status> {
    report.outcomes.iter().map(|o| o.status).collect()
}

fn folder() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    std::fs::create_dir(folder.path().join("audio")).unwrap();
    folder
}

/// Stands for any fault of this program that a recording brings to light.
struct Faulty;

impl Progress for Faulty {
    fn start(&self, _: usize, _: usize) {}
    fn done(&self, _: &Outcome) {}
    fn warning(&self, message: &str) {
        panic!("a fault made for a test: {message}");
    }
}

#[test]
fn a_panic_is_an_outcome() {
    let folder = folder();
    // The second is shorter than a transform, of which there is a warning.
    for (name, samples) in [("a", 8000), ("b", 100), ("c", 8000), ("d", 8000)] {
        wav(&folder.path().join(format!("audio/{name}.wav")), 8000, samples);
    }
    let report = run(folder.path(), "logmel", &Faulty, |_| {}).unwrap();
    assert_eq!(statuses(&report), [Status::Ok, Status::Unsupported, Status::Ok, Status::Ok]);
    assert!(report.outcomes[1].reason.contains("fault of this program"));
}

/// Stands for a fault while the output is written.
struct FaultyAtTheEnd;

impl Progress for FaultyAtTheEnd {
    fn start(&self, _: usize, _: usize) {}
    fn done(&self, outcome: &Outcome) {
        assert_ne!(outcome.id, "05", "a fault made for a test");
    }
    fn warning(&self, _: &str) {}
}

#[test]
fn a_panic_while_writing_ends_the_run_and_it_can_go_on() {
    let folder = folder();
    for i in 0..40 {
        wav(&folder.path().join(format!("audio/{i:02}.wav")), 8000, 8000);
    }
    let ended = run(folder.path(), "logmel", &FaultyAtTheEnd, |_| {});
    assert!(matches!(ended, Err(RunError::Broken)), "{:?}", ended.err());
    let report = run(folder.path(), "logmel", &Quiet, |o| o.resume = true).unwrap();
    assert!((5..40).contains(&report.resumed), "{}", report.resumed);
    assert_eq!(statuses(&report), vec![Status::Ok; 40]);
}

#[test]
fn an_interrupted_run_outlives_a_look_at_the_finished_one() {
    let folder = folder();
    for i in 0..40 {
        wav(&folder.path().join(format!("audio/{i:02}.wav")), 8000, 8000);
    }
    run(folder.path(), "logmel", &Quiet, |_| {}).unwrap();
    assert!(run(folder.path(), "m4-code", &FaultyAtTheEnd, |o| o.overwrite = true).is_err());
    assert!(run(folder.path(), "logmel", &Quiet, |_| {}).unwrap().up_to_date);
    std::fs::remove_file(folder.path().join("out.npz")).unwrap();
    let report = run(folder.path(), "m4-code", &Quiet, |o| o.resume = true).unwrap();
    assert!(report.resumed >= 5, "{}", report.resumed);
}

/// Headers that promise 2^63 bytes, or one sample a second.
#[test]
fn hostile_headers_take_neither_memory_nor_time() {
    let folder = folder();
    wav(&folder.path().join("audio/a.wav"), 8000, 8000);
    let plain = std::fs::read(folder.path().join("audio/a.wav")).unwrap();
    for (name, size) in [("huge", (1_u64 << 63) - 1), ("large", 1 << 40)] {
        let mut bytes = b"RF64\xff\xff\xff\xffWAVEds64\x1c\0\0\0".to_vec();
        bytes.extend(size.to_le_bytes());
        bytes.extend(size.to_le_bytes());
        bytes.extend([0; 12]);
        bytes.extend(&plain[12..40]);
        bytes.extend([0xff; 4]);
        bytes.extend(&plain[44..]);
        std::fs::write(folder.path().join(format!("audio/{name}.wav")), bytes).unwrap();
    }
    let report = run(folder.path(), "logmel", &Quiet, |_| {}).unwrap();
    assert_eq!(statuses(&report), [Status::Ok, Status::Truncated, Status::Truncated]);
    assert!(report.outcomes.iter().all(|o| o.decoded_frames == 8000), "{:?}", report.outcomes);

    wav(&folder.path().join("audio/slow.wav"), 1, 8000);
    for preset in ["m2", "m3", "m5-vggish", "m6-code"] {
        let report = run(folder.path(), preset, &Quiet, |o| o.overwrite = true).unwrap();
        let slow = report.outcomes.last().unwrap();
        assert_eq!(slow.status, Status::Unsupported, "{preset}");
        assert!(slow.reason.contains("Hz"), "{preset}: {}", slow.reason);
    }
}

#[test]
fn a_strict_run_goes_on_once_the_file_is_repaired() {
    let folder = folder();
    let at = |name: &str| folder.path().join(format!("audio/{name}.wav"));
    ["a", "b", "c"].iter().for_each(|name| wav(&at(name), 8000, 8000));
    let good = std::fs::read(at("b")).unwrap();
    std::fs::write(at("b"), "RIFF").unwrap();
    let strict = |resume| {
        run(folder.path(), "logmel", &Quiet, |o| (o.max_errors, o.resume) = (Some(0), resume))
    };
    assert!(matches!(strict(false), Err(RunError::TooManyErrors { .. })));
    assert!(matches!(strict(true), Err(RunError::TooManyErrors { .. })), "it is still bad");
    std::fs::write(at("b"), good).unwrap();
    let report = strict(true).unwrap();
    assert_eq!((statuses(&report), report.resumed), (vec![Status::Ok; 3], 1));
    let resumed = std::fs::read(folder.path().join("out.npz")).unwrap();
    run(folder.path(), "logmel", &Quiet, |o| o.overwrite = true).unwrap();
    assert!(std::fs::read(folder.path().join("out.npz")).unwrap() == resumed);
}
