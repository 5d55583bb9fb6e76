//! What is wrong with one recording, or with this program, costs that recording only.

use std::path::Path;
use std::sync::atomic::AtomicBool;
use std::sync::{Arc, Mutex};

use corsmal_extract::config::Config;
use corsmal_extract::inputs::{self, Input};
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
    let found = inputs::collect(&[text(&folder.join("audio")).to_string()]).unwrap().inputs;
    run_on(&found, folder, preset, progress, change)
}

fn run_on(
    found: &[Input],
    folder: &Path,
    preset: &str,
    progress: &dyn Progress,
    change: impl Fn(&mut RunOptions),
) -> Result<RunReport, RunError> {
    let config = Arc::new(Config::preset(preset).unwrap());
    let mut options = RunOptions {
        out: folder.join("out.npz"),
        work: None,
        partition_by: None,
        compression: Compression::Stored,
        jobs: 2,
        shard: Shard::default(),
        resume: false,
        overwrite: false,
        max_errors: None,
    };
    change(&mut options);
    run::run(found, &config, &options, progress, &Arc::new(AtomicBool::new(false)))
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
    assert!(report.outcomes[1].reason.contains("bug in corsmal-feat"));
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

/// Replaces a recording once its first stretch is done, and keeps what it is warned of.
struct Replacing<'a>(&'a Path, Mutex<Vec<String>>);

impl Progress for Replacing<'_> {
    fn start(&self, _: usize, _: usize) {}
    fn done(&self, outcome: &Outcome) {
        if outcome.id == "0" {
            let other = self.0.with_extension("other");
            wav(&other, 8000, 9000);
            std::fs::rename(other, self.0).unwrap();
        }
    }
    fn warning(&self, message: &str) {
        self.1.lock().unwrap().push(message.into());
    }
}

#[test]
fn stretches_of_several_contents_are_said() {
    let folder = folder();
    let path = folder.path().join("audio/a.wav");
    wav(&path, 8000, 8000);
    let stretch = |i: u32| Input {
        id: i.to_string(),
        source: inputs::InputSource::File(path.clone()),
        start: Some(f64::from(i) * 0.4),
        end: Some(f64::from(i) * 0.4 + 0.4),
        labels: Vec::new(),
    };
    let found = [0, 1].map(stretch);
    let progress = Replacing(&path, Mutex::default());
    let report = run_on(&found, folder.path(), "esc26", &progress, |o| o.jobs = 1).unwrap();
    assert_eq!(statuses(&report), [Status::Ok; 2]);
    let warned = progress.1.into_inner().unwrap();
    let said = |line: &String| line.contains("a.wav was replaced during the run");
    assert_eq!(warned.iter().filter(|line| said(line)).count(), 1, "{warned:?}");
}

/// Does something to a recording once it is open: between its header and its samples there is a warning
/// of mel bands without bins.
struct Meanwhile<'a>(Mutex<Option<Box<dyn FnOnce() + Send + 'a>>>);

impl Progress for Meanwhile<'_> {
    fn start(&self, _: usize, _: usize) {}
    fn done(&self, _: &Outcome) {}
    fn warning(&self, _: &str) {
        if let Some(change) = self.0.lock().unwrap().take() {
            change();
        }
    }
}

/// What the outcome says, and what is done to the file.
type Change = (&'static str, fn(&Path));

/// Replaced, rewritten in place, grown, cut, removed; read whole and in spans.
#[cfg(unix)]
#[test]
fn a_recording_that_changes_while_it_is_read_has_no_features() {
    use std::fs;
    use std::os::unix::fs::FileExt;

    let preset = corsmal_extract::config::Preset::find("logmel").unwrap();
    let wide =
        ["n_mels=512", "n_fft=256", "hop_length=65536"].map(|key| format!("melspectrogram.{key}"));
    let config = Arc::new(Config::with_overrides(preset.toml, "logmel", &wide).unwrap());
    for samples in [100_000, (2 << 20) + 100_000] {
        let folder = folder();
        let at = |name: &str| folder.path().join(format!("audio/{name}.wav"));
        let changes: [Change; 5] = [
            ("was replaced by another file", |path| {
                let other = path.with_extension("other");
                fs::copy(path, &other).unwrap();
                fs::rename(other, path).unwrap();
            }),
            ("was written to", |path| {
                let file = fs::File::options().write(true).open(path).unwrap();
                file.write_all_at(&[7; 1000], 50_000).unwrap();
            }),
            ("grew from ", |path| {
                let mut file = fs::File::options().append(true).open(path).unwrap();
                std::io::Write::write_all(&mut file, &[7; 1000]).unwrap();
            }),
            ("was cut from ", |path| {
                let file = fs::File::options().write(true).open(path).unwrap();
                file.set_len(file.metadata().unwrap().len() / 2).unwrap();
            }),
            ("was removed", |path| fs::remove_file(path).unwrap()),
        ];
        for (what, change) in changes {
            wav(&at("a"), 8000, samples);
            wav(&at("b"), 8000, 8000);
            let found =
                inputs::collect(&[text(&folder.path().join("audio")).to_string()]).unwrap().inputs;
            let options = RunOptions {
                out: folder.path().join("out.npz"),
                work: None,
                partition_by: None,
                compression: Compression::Stored,
                jobs: 1,
                shard: Shard::default(),
                resume: false,
                overwrite: true,
                max_errors: None,
            };
            let go_on = Arc::new(AtomicBool::new(false));
            let path = at("a");
            let meanwhile = Meanwhile(Mutex::new(Some(Box::new(move || change(&path)))));
            let report = run::run(&found, &config, &options, &meanwhile, &go_on).unwrap();
            assert_eq!(statuses(&report), [Status::Changed, Status::Ok], "{what}");
            let reason = &report.outcomes[0].reason;
            assert!(reason.starts_with(what) && reason.ends_with(" while it was read"), "{reason}");
            assert_eq!(report.outcomes[0].identity, "", "it is of a file that is no more");
            let options = RunOptions { overwrite: false, ..options };
            let again = run::run(&found, &config, &options, &Quiet, &go_on);
            match again {
                Err(RunError::Exists { .. }) if at("a").exists() => {}
                Ok(report) if !at("a").exists() => assert!(report.up_to_date),
                _ => panic!("{what}: not to be taken for done"),
            }
        }
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

#[test]
fn stretches_beyond_the_end_are_said() {
    let folder = folder();
    wav(&folder.path().join("audio/a.wav"), 8000, 8000);
    let manifest = folder.path().join("m.csv");
    let rows = "path,start,end\naudio/a.wav,0.25,1\naudio/a.wav,0.25,9\naudio/a.wav,5,6\n";
    std::fs::write(&manifest, rows).unwrap();
    let found = inputs::collect(&[text(&manifest)]).unwrap().inputs;
    let report = run_on(&found, folder.path(), "mfcc-zcr", &Quiet, |_| {}).unwrap();
    let [inside, end, start] = report.outcomes.as_slice() else { panic!("{report:?}") };
    // The same samples, and that there are fewer than were asked for.
    assert_eq!((inside.status, inside.decoded_frames, inside.repairs.len()), (Status::Ok, 6000, 0));
    assert_eq!((end.status, end.decoded_frames), (Status::Ok, 6000));
    assert_eq!(end.repairs, ["end_beyond_recording"]);
    let expected = "the stretch begins at 5 s, after the end of the recording";
    assert_eq!((start.status, start.reason.as_str()), (Status::Empty, expected));
}
