//! Runs over the same recordings in one reading: same bytes and outcomes as one after the other.

use std::path::Path;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Arc, Mutex};

use corsmal_extract::config::Config;
use corsmal_extract::inputs::{self, Input};
use corsmal_extract::run::{self, Begun, Progress, Quiet, RunError, RunOptions, RunReport};
use corsmal_files::npz::Compression;
use corsmal_files::outcome::{Outcome, Status};
use corsmal_files::shard::Shard;

use crate::support::text;

/// Two whose signals are alike, one of another channel that needs whole recordings, one at a common level.
const CONFIGS: [(&str, &[&str]); 4] = [
    ("esc26", &["librosa=0.8"]),
    ("spec9216-code", &["librosa=0.8"]),
    ("af193", &[]),
    ("esc26", &["signal.normalize=peak", "signal.start=0.05"]),
];

/// Recordings of two channels: one with a NaN late, one of another rate, one cut short, one without samples, one
/// that is none, one that is compressed.
fn recordings(folder: &Path) {
    std::fs::create_dir(folder).unwrap();
    let spec = |sample_rate, float| hound::WavSpec {
        channels: 2,
        sample_rate,
        bits_per_sample: if float { 32 } else { 16 },
        sample_format: if float { hound::SampleFormat::Float } else { hound::SampleFormat::Int },
    };
    let noise = |i: u32| (i.wrapping_mul(i) % 997) as f32 / 997.0 - 0.5;
    for (name, rate, frames) in
        [("a", 44_100, 60_000), ("b", 48_000, 30_000), ("c", 44_100, 0), ("d", 44_100, 50_000)]
    {
        let path = folder.join(format!("{name}.wav"));
        let mut wav = hound::WavWriter::create(&path, spec(rate, false)).unwrap();
        (0..2 * frames).for_each(|i| wav.write_sample((noise(i) * 2e4) as i16).unwrap());
        wav.finalize().unwrap();
    }
    let cut = std::fs::read(folder.join("d.wav")).unwrap();
    std::fs::write(folder.join("d.wav"), &cut[..150_001]).unwrap();
    let mut wav = hound::WavWriter::create(folder.join("e.wav"), spec(44_100, true)).unwrap();
    (0..80_000).for_each(|i| {
        wav.write_sample(if i == 70_000 { f32::NAN } else { noise(i) }).unwrap();
    });
    wav.finalize().unwrap();
    std::fs::write(folder.join("f.wav"), "no recording").unwrap();
}

/// The recordings as each configuration takes them: the second crops some.
fn inputs_of(folder: &Path, config: usize) -> Vec<Input> {
    let mut found = inputs::collect(&[text(folder).to_string()]).unwrap().inputs;
    for (i, input) in found.iter_mut().enumerate().filter(|_| config == 1) {
        (input.start, input.end) = match i {
            0 => (Some(0.25), Some(0.9)),
            3 => (Some(0.1), Some(0.6)),
            4 => (None, Some(0.7)),
            _ => (None, None),
        };
    }
    found
}

fn options(out: &Path, change: impl Fn(&mut RunOptions)) -> RunOptions {
    let mut options = RunOptions {
        out: out.to_path_buf(),
        work: None,
        partition_by: None,
        compression: Compression::Stored,
        jobs: 2,
        shard: Shard::default(),
        resume: true,
        overwrite: false,
        max_errors: None,
    };
    change(&mut options);
    options
}

fn config(number: usize) -> Arc<Config> {
    let (preset, overrides) = CONFIGS[number];
    let overrides: Vec<String> = overrides.iter().map(|text| text.to_string()).collect();
    let toml = corsmal_extract::config::Preset::find(preset).unwrap().toml;
    Arc::new(Config::with_overrides(toml, preset, &overrides).unwrap())
}

/// All configurations, together.
fn together(
    audio: &Path,
    out: &Path,
    jobs: usize,
    progress: &dyn Progress,
    stop: &Arc<AtomicBool>,
    change: impl Fn(&mut RunOptions),
) -> Result<Vec<RunReport>, RunError> {
    let all = 0..CONFIGS.len();
    let configs: Vec<_> = all.clone().map(config).collect();
    let inputs: Vec<_> = all.clone().map(|i| inputs_of(audio, i)).collect();
    let options: Vec<_> =
        all.clone().map(|i| options(&out.join(format!("{i}.npz")), &change)).collect();
    let begin = |i: usize| Begun::new(&inputs[i], &configs[i], &options[i], progress, stop);
    run::together(all.map(begin).collect::<Result<_, _>>()?, jobs, progress, stop)
}

#[test]
fn one_reading_gives_what_several_give() {
    let dir = tempfile::tempdir().unwrap();
    let audio = dir.path().join("audio");
    recordings(&audio);
    let stop = Arc::default();
    let apart: Vec<(RunReport, Vec<u8>)> = (0..CONFIGS.len())
        .map(|i| {
            let out = dir.path().join(format!("{i}.npz"));
            let (inputs, options) = (inputs_of(&audio, i), options(&out, |_| {}));
            let report = run::run(&inputs, &config(i), &options, &Quiet, &stop).unwrap();
            (report, std::fs::read(out).unwrap())
        })
        .collect();
    let statuses: Vec<Status> = apart[0].0.outcomes.iter().map(|o| o.status).collect();
    use Status::{Empty, NonFinite, NotAudio, Ok, Truncated};
    assert_eq!(statuses, [Ok, Ok, Empty, Truncated, NonFinite, NotAudio]);
    // The stretch ends before the NaN.
    assert_eq!(apart[1].0.outcomes[4].status, Ok);
    for jobs in [1, 3] {
        let out = tempfile::tempdir().unwrap();
        let reports = together(&audio, out.path(), jobs, &Quiet, &stop, |_| {}).unwrap();
        for (i, (report, (alone, bytes))) in reports.iter().zip(&apart).enumerate() {
            assert_eq!(report.outcomes, alone.outcomes, "{:?}", CONFIGS[i]);
            let same = std::fs::read(out.path().join(format!("{i}.npz"))).unwrap() == *bytes;
            assert!(same, "{:?}", CONFIGS[i]);
        }
        // What is there is not computed again.
        let again = together(&audio, out.path(), jobs, &Quiet, &stop, |_| {}).unwrap();
        assert!(again.iter().all(|report| report.up_to_date));
    }
}

/// What lies between them is not read.
#[test]
fn stretches_far_apart_are_those_of_runs_of_their_own() {
    let dir = tempfile::tempdir().unwrap();
    let audio = dir.path().join("audio");
    recordings(&audio);
    let (config, stop) = (config(0), Arc::default());
    let stretches: Vec<Vec<Input>> = [(1.0, 1.2), (0.0, 0.1), (0.5, 0.6)]
        .map(|(start, end)| {
            let mut found = inputs_of(&audio, 0);
            found.truncate(1);
            (found[0].start, found[0].end) = (Some(start), Some(end));
            found
        })
        .into();
    let out = |kind: &str, i: usize| options(&dir.path().join(format!("{kind}{i}.npz")), |_| {});
    let of: Vec<RunOptions> = (0..stretches.len()).map(|i| out("together", i)).collect();
    let begun = stretches.iter().zip(&of);
    let begun = begun.map(|(inputs, of)| Begun::new(inputs, &config, of, &Quiet, &stop).unwrap());
    let reports = run::together(begun.collect(), 1, &Quiet, &stop).unwrap();
    for (i, (inputs, report)) in stretches.iter().zip(&reports).enumerate() {
        let alone = out("alone", i);
        assert_eq!(
            run::run(inputs, &config, &alone, &Quiet, &stop).unwrap().outcomes,
            report.outcomes
        );
        assert_eq!(report.outcomes[0].status, Status::Ok);
        assert!(std::fs::read(&alone.out).unwrap() == std::fs::read(&of[i].out).unwrap(), "{i}");
    }
}

/// Stops the run at a recording.
struct Stopping(usize, AtomicUsize, Arc<AtomicBool>);

impl Progress for Stopping {
    fn start(&self, _: usize, _: usize) {}
    fn done(&self, _: &Outcome) {
        if self.1.fetch_add(1, Ordering::Relaxed) + 1 == self.0 {
            self.2.store(true, Ordering::Relaxed);
        }
    }
    fn warning(&self, _: &str) {}
}

/// Counts the recordings that are computed.
#[derive(Default)]
struct Counting(Mutex<Vec<(usize, usize)>>, AtomicUsize);

impl Progress for Counting {
    fn start(&self, inputs: usize, done: usize) {
        self.0.lock().unwrap().push((inputs, done));
    }
    fn done(&self, _: &Outcome) {
        self.1.fetch_add(1, Ordering::Relaxed);
    }
    fn warning(&self, _: &str) {}
}

#[test]
fn interrupted_runs_go_on_each_from_where_it_was() {
    let dir = tempfile::tempdir().unwrap();
    let audio = dir.path().join("audio");
    recordings(&audio);
    let (whole, out) = (dir.path().join("whole"), dir.path().join("out"));
    std::fs::create_dir(&whole).unwrap();
    std::fs::create_dir(&out).unwrap();
    let go_on = Arc::default();
    together(&audio, &whole, 2, &Quiet, &go_on, |_| {}).unwrap();

    // The first of the runs alone, until its second recording.
    let stop = Arc::new(AtomicBool::new(false));
    let stopping = Stopping(2, AtomicUsize::new(0), stop.clone());
    let (inputs, first) = (inputs_of(&audio, 0), options(&out.join("0.npz"), |o| o.jobs = 1));
    let stopped = run::run(&inputs, &config(0), &first, &stopping, &stop);
    assert!(matches!(stopped, Err(RunError::Interrupted)));
    // All of them, stopped before anything is read.
    let stopped = together(&audio, &out, 2, &Quiet, &Arc::new(AtomicBool::new(true)), |_| {});
    assert!(matches!(stopped, Err(RunError::Interrupted)));

    let counting = Counting::default();
    let reports = together(&audio, &out, 2, &counting, &go_on, |_| {}).unwrap();
    assert_eq!(reports[0].resumed, 2);
    assert_eq!(*counting.0.lock().unwrap(), [(6, 0)]);
    assert_eq!(counting.1.load(Ordering::Relaxed), 6);
    for (i, config) in CONFIGS.iter().enumerate() {
        let name = format!("{i}.npz");
        let bytes = |folder: &Path| std::fs::read(folder.join(&name)).unwrap();
        assert!(bytes(&whole) == bytes(&out), "{config:?}");
    }
}

#[test]
fn failures_are_counted_for_each_run() {
    let dir = tempfile::tempdir().unwrap();
    let audio = dir.path().join("audio");
    recordings(&audio);
    let few = |o: &mut RunOptions| o.max_errors = Some(1);
    let stopped = together(&audio, dir.path(), 2, &Quiet, &Arc::default(), few);
    assert!(matches!(stopped, Err(RunError::TooManyErrors { failed: 2, limit: 1, .. })));
}

#[test]
fn frames_are_no_row() {
    let dir = tempfile::tempdir().unwrap();
    let audio = dir.path().join("audio");
    recordings(&audio);
    let inputs = inputs_of(&audio, 0);
    let config = Arc::new(Config::preset("logmel").unwrap());
    let options = options(&dir.path().join("out.npz"), |_| {});
    let stop = Arc::default();
    let begun = Begun::new(&inputs, &config, &options, &Quiet, &stop).unwrap();
    let refused = run::together(vec![begun], 1, &Quiet, &stop);
    assert!(matches!(refused, Err(RunError::NoSummary)));
}
