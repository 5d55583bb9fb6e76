//! Runs over what an earlier run has left: an output that is to be replaced, recordings that have changed.

use std::fs;
use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;
use std::sync::{Arc, Mutex};

use corsmal_extract::config::Config;
use corsmal_extract::cut::{WindowSpan, into_windows};
use corsmal_extract::inputs::{self, Input};
use corsmal_extract::ledger::ledger_path;
use corsmal_extract::merge::{self, Existing};
use corsmal_extract::run::{self, Progress, RunError, RunOptions, RunReport};
use corsmal_files::npz::Compression;
use corsmal_files::outcome::{Outcome, Status};
use corsmal_files::shard::Shard;

use crate::support::text;

fn wav(path: &Path, channels: u16, seed: u32) {
    let spec = hound::WavSpec {
        channels,
        sample_rate: 8000,
        bits_per_sample: 16,
        sample_format: hound::SampleFormat::Int,
    };
    let mut writer = hound::WavWriter::create(path, spec).unwrap();
    for i in 0..16_000 * u32::from(channels) {
        writer.write_sample((i.wrapping_mul(2_654_435_761 + seed) >> 17) as i16).unwrap();
    }
    writer.finalize().unwrap();
}

/// Keeps what it is told.
#[derive(Default)]
struct Told(Mutex<Vec<String>>);

impl Progress for Told {
    fn start(&self, _: usize, _: usize) {}
    fn done(&self, _: &Outcome) {}
    fn warning(&self, message: &str) {
        self.0.lock().unwrap().push(message.into());
    }
}

struct Folder(tempfile::TempDir);

impl Folder {
    /// Recordings of so many channels, called `0.wav`, `1.wav`, ...
    fn of(channels: &[u16]) -> Self {
        let folder = Self(tempfile::tempdir().unwrap());
        fs::create_dir(folder.path("audio")).unwrap();
        for (number, channels) in channels.iter().enumerate() {
            wav(&folder.path(&format!("audio/{number}.wav")), *channels, number as u32);
        }
        folder
    }

    fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    fn inputs(&self) -> Vec<Input> {
        inputs::collect(&[text(&self.path("audio"))]).unwrap().inputs
    }

    /// A run over all recordings, and what it has told.
    fn run(
        &self,
        preset: &str,
        change: impl Fn(&mut RunOptions),
    ) -> (Result<RunReport, RunError>, String) {
        self.run_of(&self.inputs(), preset, change)
    }

    /// A run over these recordings.
    fn run_of(
        &self,
        found: &[Input],
        preset: &str,
        change: impl Fn(&mut RunOptions),
    ) -> (Result<RunReport, RunError>, String) {
        let mut options = RunOptions {
            out: self.path("out.npz"),
            work: None,
            partition_by: None,
            compression: Compression::Stored,
            jobs: 1,
            shard: Shard::default(),
            resume: false,
            overwrite: false,
            max_errors: None,
        };
        change(&mut options);
        let config = Arc::new(Config::preset(preset).unwrap());
        let (told, stop) = (Told::default(), Arc::new(AtomicBool::new(false)));
        let report = run::run(found, &config, &options, &told, &stop);
        (report, told.0.into_inner().unwrap().join("\n"))
    }
}

/// What it had done was lost: `--resume` was refused for the existing output, `--overwrite` began again.
#[test]
fn an_interrupted_run_that_replaces_an_output_goes_on() {
    let folder = Folder::of(&[1, 1, 1]);
    folder.run("mfcc-zcr", |options| options.out = folder.path("expected.npz")).0.unwrap();
    folder.run("esc26", |_| {}).0.unwrap();
    let good = fs::read(folder.path("audio/1.wav")).unwrap();
    fs::write(folder.path("audio/1.wav"), b"no audio").unwrap();
    let (stopped, _) = folder.run("mfcc-zcr", |options| {
        (options.overwrite, options.max_errors) = (true, Some(0));
    });
    assert!(matches!(stopped, Err(RunError::TooManyErrors { .. })), "{stopped:?}");
    fs::write(folder.path("audio/1.wav"), good).unwrap();
    // The user has not said again that the output may go.
    let (refused, _) = folder.run("mfcc-zcr", |options| options.resume = true);
    let refused = refused.unwrap_err().to_string();
    assert!(refused.contains("--overwrite with --resume continues that run"), "{refused}");
    let both = |options: &mut RunOptions| (options.resume, options.overwrite) = (true, true);
    let report = folder.run("mfcc-zcr", both).0.unwrap();
    assert_eq!((report.resumed, report.failed()), (1, 0));
    let read = |name| fs::read(folder.path(name)).unwrap();
    assert!(read("out.npz") == read("expected.npz"));
    // Nothing is left to do, and another output is replaced.
    assert!(folder.run("mfcc-zcr", both).0.unwrap().up_to_date);
    let other = folder.run("esc26", both).0.unwrap();
    assert!(!other.up_to_date && other.resumed == 0);
}

/// The table kept the width of the recordings done before, and those that most were like failed.
#[test]
fn a_change_of_the_usual_channels_is_work_not_done() {
    let folder = Folder::of(&[1, 1, 1, 2, 2]);
    let (stopped, _) = folder.run("mfcc-zcr", |options| options.max_errors = Some(0));
    assert!(matches!(stopped, Err(RunError::TooManyErrors { .. })), "{stopped:?}");
    wav(&folder.path("audio/2.wav"), 2, 2);
    let (report, told) = folder.run("mfcc-zcr", |options| options.resume = true);
    let report = report.unwrap();
    assert!(told.contains("0 and what follows it are computed again"), "{told}");
    let statuses: Vec<Status> = report.outcomes.iter().map(|o| o.status).collect();
    let (no, ok) = (Status::Mismatch, Status::Ok);
    assert_eq!((statuses, report.resumed), (vec![no, no, ok, ok, ok], 0));
    let fresh = |options: &mut RunOptions| options.out = folder.path("fresh.npz");
    folder.run("mfcc-zcr", fresh).0.unwrap();
    let read = |name| fs::read(folder.path(name)).unwrap();
    assert!(read("out.npz") == read("fresh.npz"));
}

/// A run left by another configuration was in the way of an output that was right already, and of a new run.
#[test]
fn a_run_of_another_configuration_is_replaced() {
    let folder = Folder::of(&[1, 1]);
    folder.run("esc26", |_| {}).0.unwrap();
    fs::write(folder.path("audio/2.wav"), b"no audio").unwrap();
    let stopping = |options: &mut RunOptions| {
        (options.overwrite, options.max_errors) = (true, Some(0));
    };
    assert!(folder.run("mfcc-zcr", stopping).0.is_err());
    fs::remove_file(folder.path("audio/2.wav")).unwrap();
    let both = |options: &mut RunOptions| (options.resume, options.overwrite) = (true, true);
    let ledger = ledger_path(&folder.path("out.npz"));
    // What the other run has done stays.
    assert!(folder.run("esc26", both).0.unwrap().up_to_date && ledger.exists());
    let (report, told) = folder.run("a34f136", both);
    let report = report.unwrap();
    assert!(!report.up_to_date && report.resumed == 0 && !ledger.exists());
    assert!(told.contains("the run starts again"), "{told}");
    // Without leave to replace anything it is refused.
    assert!(folder.run("mfcc-zcr", stopping).0.is_ok());
    fs::write(folder.path("audio/2.wav"), b"no audio").unwrap();
    let new = |options: &mut RunOptions| {
        (options.out, options.max_errors) = (folder.path("new.npz"), Some(0));
    };
    assert!(folder.run("mfcc-zcr", new).0.is_err());
    let resumed = |options: &mut RunOptions| {
        (options.out, options.resume) = (folder.path("new.npz"), true);
    };
    let refused = folder.run("esc26", resumed).0.unwrap_err().to_string();
    assert!(refused.contains("the interrupted run had"), "{refused}");
}

/// A recording that could not be read for a moment cost all that was done, since another one was the first of
/// its width.
#[test]
fn recordings_that_cannot_be_read_give_up_nothing() {
    let folder = Folder::of(&[1, 1, 1, 2, 2]);
    let found = folder.inputs();
    let shard = |options: &mut RunOptions| options.shard = "1/2".parse().unwrap();
    let own: Vec<String> = {
        let shard: Shard = "1/2".parse().unwrap();
        shard.of(&found).iter().map(|input| input.id.clone()).collect()
    };
    assert_eq!(own, ["2", "3", "4"]);
    let stopped = folder.run_of(&found, "mfcc-zcr", |options| {
        shard(options);
        options.max_errors = Some(0);
    });
    assert!(matches!(stopped.0, Err(RunError::TooManyErrors { .. })), "{:?}", stopped.0);
    let ledger = ledger_path(&folder.path("out.npz"));
    let done = fs::read(&ledger).unwrap();
    let hide = |name: &str| fs::rename(folder.path(name), folder.path("hidden.wav")).unwrap();
    let show = |name: &str| fs::rename(folder.path("hidden.wav"), folder.path(name)).unwrap();
    let resume = |options: &mut RunOptions| {
        shard(options);
        (options.resume, options.max_errors) = (true, Some(0));
    };
    // As many recordings have two channels now, but one channel comes first.
    hide("audio/1.wav");
    let (stopped, told) = folder.run_of(&found, "mfcc-zcr", resume);
    assert!(matches!(stopped, Err(RunError::TooManyErrors { .. })), "{stopped:?}");
    assert!(!told.contains("computed again"), "{told}");
    assert!(fs::read(&ledger).unwrap() == done);
    // Most have two.
    fs::rename(folder.path("audio/0.wav"), folder.path("0.wav")).unwrap();
    let (unreadable, told) = folder.run_of(&found, "mfcc-zcr", resume);
    assert!(matches!(unreadable, Err(RunError::Unreadable { .. })), "{unreadable:?} {told}");
    assert!(fs::read(&ledger).unwrap() == done);
    fs::rename(folder.path("0.wav"), folder.path("audio/0.wav")).unwrap();
    show("audio/1.wav");
    let (report, told) = folder.run_of(&found, "mfcc-zcr", |options| {
        shard(options);
        options.resume = true;
    });
    assert_eq!((report.unwrap().resumed, told.contains("computed again")), (2, false));
}

/// Only a run that has both in one table warned.
#[test]
fn shards_with_windows_of_two_contents_are_told() {
    let folder = Folder::of(&[1]);
    let config = Arc::new(Config::preset("esc26").unwrap());
    let stop = Arc::new(AtomicBool::new(false));
    let shards = ["0/2", "1/2"].map(|shard| {
        let found = inputs::collect(&[text(&folder.path("audio"))]).unwrap().inputs;
        let span = WindowSpan { window: 0.5, hop: 0.5 };
        let windows = into_windows(found, span, &stop).unwrap();
        assert!(windows.warnings().is_empty());
        let out = folder.path(&format!("{}.npz", &shard[..1]));
        let options = RunOptions {
            out: out.clone(),
            work: None,
            partition_by: None,
            compression: Compression::Stored,
            jobs: 1,
            shard: shard.parse().unwrap(),
            resume: false,
            overwrite: false,
            max_errors: None,
        };
        let told = Told::default();
        run::run(&windows.inputs, &config, &options, &told, &stop).unwrap();
        assert!(told.0.lock().unwrap().is_empty());
        wav(&folder.path("audio/0.wav"), 1, 7);
        out
    });
    let warning = merge::merge(&shards, &folder.path("out.npz"), Existing::Keep, &stop).unwrap();
    assert!(warning.unwrap().contains("0.wav was replaced during the run"));
}

#[test]
fn the_projection_is_no_output() {
    let folder = Folder::of(&[1, 1, 1]);
    let features = folder.path("features.npz");
    folder.run("esc26", |options| options.out.clone_from(&features)).0.unwrap();
    let pca = folder.path("pca.npz");
    let projection = corsmal_extract::projection::Projection::fit(&features, Some(1)).unwrap();
    projection.save(&pca).unwrap();
    let preset = corsmal_extract::config::Preset::find("esc26").unwrap();
    let file = format!("projection.file={}", serde_json::json!(text(&pca)));
    let config = Arc::new(Config::with_overrides(preset.toml, "esc26", &[file]).unwrap());
    let found = inputs::collect(&[text(&folder.path("audio"))]).unwrap().inputs;
    let options = RunOptions {
        out: pca.clone(),
        work: None,
        partition_by: None,
        compression: Compression::Stored,
        jobs: 1,
        shard: Shard::default(),
        resume: false,
        overwrite: true,
        max_errors: None,
    };
    let before = fs::read(&pca).unwrap();
    let refused = run::run(&found, &config, &options, &Told::default(), &Arc::default());
    let refused = refused.unwrap_err().to_string();
    assert!(refused.contains("is the projection itself"), "{refused}");
    assert!(fs::read(&pca).unwrap() == before);
}
