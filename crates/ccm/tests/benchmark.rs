//! The benchmark on synthetic recordings, and its features on the real one.

#![allow(clippy::unwrap_used)]

mod shared_data;

use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use corsmal_ccm::benchmark::{
    Baseline, BenchmarkOptions, CapacityTable, Estimate, FeatureSet, Made, Prepared, System, Work,
};
use corsmal_ccm::synth::{self, Size};
use corsmal_extract::engine::{Features, Signals};
use corsmal_files::npz::NpzFile;
use corsmal_report::{Cell, Report};
use ndarray::Axis;
use shared_data::ccm;

/// Features of librosa 0.8.0 on the one real recording.
#[test]
fn features_are_those_of_the_published_code() {
    let Some(path) = ccm("baseline_feature_reference.npz") else { return };
    let wav = ccm("audio/s1_fi0_fu0_b1_l0_audio.wav").unwrap();
    let mut reference = NpzFile::open(&path).unwrap();
    for (set, name) in [
        (FeatureSet::ZcrMfcc, "zcr_mfcc26"),
        (FeatureSet::Af193, "af193"),
        (FeatureSet::Spectrogram, "spectrogram96"),
    ] {
        let expected = reference.f64(name).unwrap().index_axis(Axis(0), 0).to_owned();
        let ours = vector(set, &wav);
        assert_eq!(ours.len(), expected.len(), "{name}");
        for (i, (a, b)) in ours.iter().zip(&expected).enumerate() {
            let limit = if set == FeatureSet::Spectrogram { 0.02 } else { 1e-3 * b.abs().max(1.0) };
            assert!((f64::from(*a) - b).abs() < limit, "{name} {i}: {a} {b}");
        }
    }
}

fn vector(set: FeatureSet, wav: &Path) -> Vec<f32> {
    let signals = Signals::new(Arc::new(set.config().unwrap()));
    let mut source = corsmal_audio::open(wav).unwrap();
    let (rate, channels) = (source.spec().sample_rate, source.spec().channels);
    let mut signal = signals.start(rate, channels).unwrap();
    let mut block = vec![0.0; 4096 * usize::from(channels)];
    loop {
        let frames = source.read(&mut block).unwrap();
        if frames == 0 {
            break;
        }
        signal.push(&block[..frames * usize::from(channels)]).unwrap();
    }
    match signal.finish().unwrap() {
        Features::Summary(row) => row,
        Features::Frames(_) => panic!("a summary is configured"),
    }
}

fn options(data: &Path, out: &Path, baselines: Vec<Baseline>) -> BenchmarkOptions {
    BenchmarkOptions {
        data: data.into(),
        out: out.into(),
        baselines,
        systems: Vec::new(),
        added: Vec::new(),
        capacities: Vec::new(),
        detections: None,
        jobs: 2,
        seed: 1,
        made: Made {
            on: Some("2026-11-27".into()),
            command: Some("corsmal-feat benchmark".into()),
        },
    }
}

fn run(options: &BenchmarkOptions) -> corsmal_ccm::Result<Report> {
    corsmal_ccm::benchmark::run(options, &|_| {}, &Arc::new(AtomicBool::new(false)))
}

#[test]
fn the_report_is_complete_and_features_are_kept() {
    let dir = tempfile::tempdir().unwrap();
    let data = dir.path().join("data");
    synth::generate(&data, Size::Reduced, 3).unwrap();
    let out = dir.path().join("report");
    let zcr = |b: &Baseline| b.features == FeatureSet::ZcrMfcc;
    let options = options(&data, &out, Baseline::all().into_iter().filter(zcr).collect());
    let report = run(&options).unwrap();
    assert!(report.warning.unwrap().contains("SYNTHETIC"));

    let read = |name: &str| std::fs::read_to_string(out.join(name)).unwrap();
    let html = read("report.html");
    assert!(html.contains("SYNTHETIC") && html.contains("<svg"));
    for outside in ["src=", "@import", "<link", "url("] {
        assert!(!html.contains(outside), "the page needs {outside}");
    }
    // The only addresses are links and the name of the SVG format.
    let links = html.matches("<a href=\"https://").count();
    let names = html.matches("xmlns=\"http://www.w3.org/2000/svg\"").count();
    assert_eq!(html.matches("https://").count(), links);
    assert_eq!(html.matches("http://").count(), names);
    for told in [
        "https://doi.org/10.1109/ACCESS.2022.3166906",
        "https://corsmal.eecs.qmul.ac.uk/containers_manip.html",
        "CC BY-NC 4.0",
        "@article{",
        "Because It's Tactile",
        "2026-11-27",
        "corsmal-feat benchmark",
    ] {
        assert!(html.contains(told), "{told}");
    }
    let level = read("tables/level.csv");
    let mut table = csv::Reader::from_reader(level.as_bytes());
    let head = table.headers().unwrap().clone();
    let place = |name: &str| head.iter().position(|h| h == name).unwrap();
    let rows: Vec<csv::StringRecord> = table.records().map(|r| r.unwrap()).collect();
    let m6 = rows.iter().find(|r| &r[1] == "M6").unwrap();
    let figures = ["Training", "Public", "Private", "Combined"].map(|name| &m6[place(name)]);
    assert_eq!(figures, ["", "80.2200", "81.4600", "80.8400"]);
    // What was estimated here lies in its interval; the paper prints none.
    for row in &rows {
        let number = |name: &str| row[place(name)].parse::<f64>().ok();
        let (low, high) = (number("Training, low"), number("Training, high"));
        assert_eq!(low.is_some(), &row[0] == "ours", "{row:?}");
        if let (Some(low), Some(high)) = (low, high) {
            let value = number("Training").unwrap();
            assert!((low..=high).contains(&value), "{row:?}");
        }
    }
    let latex = read("tables/level.tex");
    assert!(latex.contains("\\toprule") && latex.contains("80.84"), "{latex}");
    // Three baselines in two variants and the random estimates, each with a public figure.
    assert_eq!(level.lines().filter(|l| l.starts_with("ours,")).count(), 7);
    let json: serde_json::Value = serde_json::from_str(&read("report.json")).unwrap();
    assert_eq!(json["sections"][1]["id"], "level");
    let submission = read("submissions/zcr-mfcc-rf-corrected-public-test.csv");
    assert_eq!(submission.lines().count(), 1 + 19);
    for figure in [
        "zcr-mfcc-rf-corrected-joint-confusion.svg",
        "zcr-mfcc-knn-published-type-confusion.pdf",
        "methods-level.svg",
        "corrections-type.pdf",
        "level-by-container-training.svg",
    ] {
        assert!(out.join("figures").join(figure).exists(), "{figure}");
    }
    let with_ids = read("submissions/zcr-mfcc-rf-corrected-held-out-2022.csv");
    assert!(with_ids.starts_with("Configuration ID,") && with_ids.lines().count() == 1 + 114);
    assert!(read("submissions/random-training.csv").lines().count() == 1 + 114);
    let model =
        corsmal_models::model_file::Model::load(&out.join("models/zcr-mfcc-rf-corrected.model"));
    let header = model.unwrap().header().clone();
    let config = FeatureSet::ZcrMfcc.config().unwrap();
    assert_eq!((header.feature_config_hash, header.feature_names.len()), (config.hash(), 26));

    // The second run takes the features that are there; changed recordings are computed anew.
    let features = std::fs::read_dir(out.join("features")).unwrap();
    let kept: Vec<_> = features.map(|f| f.unwrap().path()).collect();
    let times = || -> Vec<_> {
        kept.iter().map(|f| std::fs::metadata(f).unwrap().modified().unwrap()).collect()
    };
    let before = times();
    assert_eq!(kept.len(), 2);
    run(&options).unwrap();
    assert_eq!(times(), before, "kept features were not used");
    assert!(read("tables/level.csv") == level, "a second run differs");
    let copy = data.join("train/1/audio/s0_fi0_fu0_b1_l0_audio.wav");
    let bytes = std::fs::read(&copy).unwrap();
    std::fs::write(&copy, &bytes[..bytes.len() / 2]).unwrap();
    run(&options).unwrap();
    let changed = times().iter().zip(&before).filter(|(now, then)| now != then).count();
    assert_eq!(changed, 1, "training features are those of the recordings as they are now");
    std::fs::write(&copy, "RIFF").unwrap();
    let error = run(&options).unwrap_err().to_string();
    assert!(error.contains("s0_fi0_fu0_b1_l0_audio.wav: corrupt"), "{error}");
}

/// Every file below a folder, with its bytes.
fn files(folder: &Path) -> std::collections::BTreeMap<std::path::PathBuf, Vec<u8>> {
    let mut all = std::collections::BTreeMap::new();
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            let inside = files(&path).into_iter();
            all.extend(inside.map(|(name, bytes)| (path.join(name), bytes)));
        } else {
            all.insert(path.clone(), std::fs::read(&path).unwrap());
        }
    }
    all
}

/// Two feature sets in one reading, and baselines side by side, on any number of threads.
#[test]
fn threads_change_no_byte() {
    let dir = tempfile::tempdir().unwrap();
    let data = dir.path().join("data");
    synth::generate(&data, Size::Small, 7).unwrap();
    let wanted = ["zcr-mfcc-knn", "spectrogram-svm", "spectrogram-pca-knn"];
    let wanted = |b: &Baseline| wanted.contains(&b.slug().as_str());
    let baselines: Vec<Baseline> = Baseline::all().into_iter().filter(wanted).collect();
    let written = |jobs: usize| {
        let out = dir.path().join("report");
        let options = options(&data, &out, baselines.clone());
        run(&BenchmarkOptions { jobs, ..options }).unwrap();
        let all = files(&out);
        std::fs::remove_dir_all(&out).unwrap();
        all
    };
    let one = written(1);
    assert!(one.len() > 30);
    for jobs in [2, 5] {
        let others = written(jobs);
        assert!(one.keys().eq(others.keys()));
        for (name, bytes) in &one {
            // A PDF has the second of its making.
            let is_pdf = name.extension().is_some_and(|e| e == "pdf");
            assert!(is_pdf || others[name] == *bytes, "{} with {jobs} threads", name.display());
        }
    }
}

/// The flat release withholds which container a test file shows: it is predicted and named by id.
#[test]
fn flat_test_recordings_are_submitted_by_id() {
    let dir = tempfile::tempdir().unwrap();
    let data = dir.path().join("data");
    synth::generate(&data, Size::Small, 4).unwrap();
    let test = data.join("test_pub/audio");
    std::fs::create_dir_all(&test).unwrap();
    for (id, name) in [(0, "s0_fi1_fu1_b1_l0"), (1, "s0_fi3_fu2_b1_l0")] {
        let from = data.join(format!("train/1/audio/{name}_audio.wav"));
        std::fs::copy(from, test.join(format!("{id:06}.wav"))).unwrap();
    }
    let out = dir.path().join("report");
    let knn = Baseline::all().into_iter().take(1).collect();
    let options = options(&data, &out, knn);
    run(&options).unwrap();
    let by_id = out.join("submissions/zcr-mfcc-knn-corrected-public-test-2022.csv");
    let table = std::fs::read_to_string(by_id).unwrap();
    let rows: Vec<Vec<&str>> = table.lines().skip(1).map(|l| l.split(',').collect()).collect();
    assert_eq!(rows.iter().map(|r| r[0]).collect::<Vec<_>>(), ["0", "1"]);
    for row in rows {
        let sum: f64 = row[4..8].iter().map(|p| p.parse::<f64>().unwrap()).sum();
        assert!((sum - 1.0).abs() < 1e-5 && row[1] == "-1", "{row:?}");
    }
    assert!(!out.join("submissions/zcr-mfcc-knn-corrected-public-test.csv").exists());
}

/// The published code fits components to the test recordings: of one recording there are none.
#[test]
fn a_test_part_of_one_recording_is_classified() {
    let dir = tempfile::tempdir().unwrap();
    let data = dir.path().join("data");
    synth::generate(&data, Size::Small, 5).unwrap();
    let test = data.join("test_pub/audio");
    std::fs::create_dir_all(&test).unwrap();
    let from = data.join("train/1/audio/s0_fi1_fu1_b1_l0_audio.wav");
    std::fs::copy(from, test.join("000000.wav")).unwrap();
    let out = dir.path().join("report");
    let knn = Baseline::all().into_iter().filter(|b| b.slug() == "spectrogram-pca-knn").collect();
    let options = options(&data, &out, knn);
    run(&options).unwrap();
    for variant in ["published", "corrected"] {
        let name = format!("submissions/spectrogram-pca-knn-{variant}-public-test-2022.csv");
        assert_eq!(std::fs::read_to_string(out.join(name)).unwrap().lines().count(), 2);
    }
}

#[test]
fn one_name_is_not_added_twice() {
    let options = BenchmarkOptions {
        data: "nowhere".into(),
        out: "nowhere".into(),
        baselines: Vec::new(),
        systems: Vec::new(),
        added: vec![("x".into(), "a.csv".into()), ("x".into(), "b.csv".into())],
        capacities: Vec::new(),
        detections: None,
        jobs: 1,
        seed: 1,
        made: Made::default(),
    };
    assert_eq!(run(&options).unwrap_err().to_string(), "x: added twice; names must differ");
}

#[test]
fn an_unusable_file_to_add_stops_before_the_work() {
    let dir = tempfile::tempdir().unwrap();
    let file = dir.path().join("p.csv");
    std::fs::write(&file, "a,b\n1,2\n").unwrap();
    let options = BenchmarkOptions {
        data: dir.path().join("nowhere"),
        out: dir.path().join("report"),
        baselines: Vec::new(),
        systems: Vec::new(),
        added: vec![("x".into(), file)],
        capacities: Vec::new(),
        detections: None,
        jobs: 1,
        seed: 1,
        made: Made::default(),
    };
    let error = run(&options).unwrap_err().to_string();
    assert!(error.contains("p.csv: no column"), "{error}");
    assert!(!options.out.exists());
}

/// Files to add to a small data set, without any baseline.
struct Adding {
    dir: tempfile::TempDir,
    /// Container and sequence, and id, of every training recording.
    keys: Vec<(String, u32)>,
}

const BY_SEQUENCE: &str = "Container ID,Sequence,Filling type,Filling level,Container Capacity";

impl Adding {
    fn new() -> Self {
        let dir = tempfile::tempdir().unwrap();
        synth::generate(&dir.path().join("data"), Size::Small, 6).unwrap();
        let set = corsmal_ccm::dataset::DataSet::open(&dir.path().join("data")).unwrap();
        let key = |r: &corsmal_ccm::dataset::Recording| {
            let (container, sequence) = (r.container.unwrap().number(), r.sequence.unwrap());
            (format!("{container},{sequence}"), r.id.unwrap())
        };
        let keys = set.recordings.iter().map(key).collect();
        Self { dir, keys }
    }

    /// Lines of a submission for every training recording.
    fn lines(&self) -> Vec<String> {
        self.keys.iter().map(|(key, _)| format!("{key},1,1,-1")).collect()
    }

    fn run(&self, lines: &[String]) -> (corsmal_ccm::Result<Report>, Vec<String>) {
        let path = self.dir.path().join("p.csv");
        std::fs::write(&path, format!("{BY_SEQUENCE}\n{}\n", lines.join("\n"))).unwrap();
        let options = BenchmarkOptions {
            data: self.dir.path().join("data"),
            out: self.dir.path().join("report"),
            baselines: Vec::new(),
            systems: Vec::new(),
            added: vec![("theirs".into(), path)],
            capacities: Vec::new(),
            detections: None,
            jobs: 1,
            seed: 1,
            made: Made::default(),
        };
        let said = std::sync::Mutex::new(Vec::new());
        let progress = |step: &str| said.lock().unwrap().push(step.to_string());
        let result = corsmal_ccm::benchmark::run(&options, &progress, &Arc::default());
        (result, said.into_inner().unwrap())
    }

    fn refusal(&self, lines: &[String]) -> String {
        self.run(lines).0.unwrap_err().to_string()
    }
}

#[test]
fn added_files_cover_a_part_or_are_refused() {
    let adding = Adding::new();
    let mut lines = adding.lines();
    // Of other parts and of ACC's own containers, which this data set has not.
    lines.extend(["10,0,1,1,-1".into(), "19,3,1,1,-1".into()]);
    let (report, said) = adding.run(&lines);
    assert!(report.is_ok() && said.is_empty(), "{said:?}");
    let level = adding.dir.path().join("report/tables/level.csv");
    assert!(std::fs::read_to_string(level).unwrap().contains("added,theirs,"));

    let removed = lines.remove(5);
    let error = adding.refusal(&lines);
    let key = removed.split(',').collect::<Vec<_>>();
    let expected = format!("missing rows: container {} sequence {};", key[0], key[1]);
    assert!(error.contains("p.csv") && error.contains(&expected), "{error}");
    assert!(error.contains("each of the 57 training recordings"), "{error}");
    lines.push(removed);
    lines.push("1,9999,1,1,-1".into());
    let error = adding.refusal(&lines);
    assert!(error.contains("the data set lacks: container 1 sequence 9999"), "{error}");
}

#[test]
fn an_added_file_about_nothing_here_is_said() {
    let adding = Adding::new();
    let (report, said) = adding.run(&["13,0,1,1,-1".into(), "13,1,1,1,-1".into()]);
    assert_eq!(said, ["theirs: has no recording of this data set"]);
    let report = report.unwrap();
    let notes = report.sections.iter().find(|s| s.id == "notes").unwrap();
    assert!(notes.text.last().unwrap().contains("predictions of theirs"), "{:?}", notes.text);
}

/// Ids start at 0 in every part.
#[test]
fn a_file_of_ids_is_about_the_part_that_it_fits() {
    let adding = Adding::new();
    let test = adding.dir.path().join("data/test_pub/audio");
    std::fs::create_dir_all(&test).unwrap();
    let from = adding.dir.path().join("data/train/1/audio/s0_fi1_fu1_b1_l0_audio.wav");
    for id in 0..3 {
        std::fs::copy(&from, test.join(format!("{id:06}.wav"))).unwrap();
    }
    let path = adding.dir.path().join("ids.csv");
    let submission = |rows: u32| {
        let keys: Vec<_> = (0..rows).map(corsmal_ccm::submission::RowKey::Id).collect();
        let estimates = corsmal_ccm::submission::pseudo_random(&keys, 1);
        let format = corsmal_ccm::submission::Format::Y2022;
        let _ = std::fs::remove_file(&path);
        corsmal_ccm::submission::Submission::write(&path, format, &estimates, &keys).unwrap();
        let options = BenchmarkOptions {
            data: adding.dir.path().join("data"),
            out: adding.dir.path().join("report"),
            baselines: Vec::new(),
            systems: Vec::new(),
            added: vec![("theirs".into(), path.clone())],
            capacities: Vec::new(),
            detections: None,
            jobs: 1,
            seed: 1,
            made: Made::default(),
        };
        let result = run(&options);
        let level = adding.dir.path().join("report/tables/level.csv");
        result.map(|_| std::fs::read_to_string(level).unwrap().contains("added,theirs,"))
    };
    assert!(submission(684).unwrap(), "training");
    assert!(!submission(228).map_err(|e| e.to_string()).unwrap(), "public test, without labels");
    let error = submission(60).unwrap_err().to_string();
    assert!(error.contains("its ids fit several parts"), "{error}");
}

/// Says what it knows, and always the same.
struct Constant;

struct Ready<'a>(&'a Work<'a>);

impl System for Constant {
    fn name(&self) -> &'static str {
        "M4"
    }

    fn prepare<'a>(&'a self, work: &'a Work<'a>) -> corsmal_ccm::Result<Box<dyn Prepared + 'a>> {
        for (place, subject) in work.subjects.iter().enumerate() {
            // Nothing tells what a test recording holds.
            let training = place < work.training;
            assert_eq!(subject.filling.is_some(), training);
            assert_eq!(subject.name.is_some(), training);
            assert_eq!(subject.action.is_some(), training);
            assert!(subject.input.labels.is_empty());
        }
        Ok(Box::new(Ready(work)))
    }
}

impl Prepared for Ready<'_> {
    fn notes(&self) -> Vec<String> {
        vec!["it always says rice.".into()]
    }

    fn predict(
        &self,
        train: &[usize],
        wanted: &[usize],
    ) -> corsmal_ccm::Result<Vec<Vec<Estimate>>> {
        let container = |row: &usize| self.0.subjects[*row].container;
        let known: Vec<_> = train.iter().map(container).collect();
        assert!(train.iter().all(|&row| row < self.0.training));
        assert!(wanted.iter().all(|row| !known.contains(&container(row))));
        let rice = || Estimate { kind: Some(2), ..Estimate::default() };
        Ok(vec![wanted.iter().map(|_| rice()).collect()])
    }
}

#[test]
fn a_system_is_run_on_containers_that_it_never_heard() {
    let dir = tempfile::tempdir().unwrap();
    let (data, out) = (dir.path().join("data"), dir.path().join("report"));
    synth::generate(&data, Size::Reduced, 3).unwrap();
    let systems: Vec<Box<dyn System>> = vec![Box::new(Constant)];
    let report = run(&BenchmarkOptions { systems, ..options(&data, &out, Vec::new()) }).unwrap();
    let tables: Vec<_> = report.sections.iter().flat_map(|s| &s.tables).collect();
    let rows = |table: &str| {
        let table = tables.iter().find(|t| t.name == table).unwrap();
        table.rows.iter().filter(|r| r.cells[0] == Cell::Text("M4".into())).count()
    };
    // The paper's row and that of this run; only the paper's where nothing is estimated.
    assert_eq!((rows("type"), rows("level")), (2, 1));
    let texts: Vec<_> = report.sections.iter().flat_map(|s| &s.text).collect();
    assert!(texts.iter().any(|t| *t == "M4 of this run: it always says rice."));
    assert!(report.sections.iter().all(|s| s.id != "corrections"));
    for name in ["submissions/m4-held-out.csv", "submissions/m4-public-test.csv"] {
        assert!(out.join(name).exists(), "{name}");
    }
    assert!(out.join("figures/m4-type-confusion.svg").exists());
    assert!(!out.join("figures/m4-level-confusion.svg").exists());

    let systems: Vec<Box<dyn System>> = vec![Box::new(Constant), Box::new(Constant)];
    let twice = BenchmarkOptions { systems, ..options(&data, &out, Vec::new()) };
    assert_eq!(run(&twice).unwrap_err().to_string(), "M4 is given twice");
}

/// One table has the capacities of all parts, of which two have the same ids.
#[test]
fn capacities_of_the_same_ids_go_to_their_parts() {
    let dir = tempfile::tempdir().unwrap();
    let (data, out) = (dir.path().join("data"), dir.path().join("report"));
    synth::generate(&data, Size::Small, 3).unwrap();
    let mut table = String::from("fileName,capacity[mL],part\n");
    for recording in corsmal_ccm::dataset::DataSet::open(&data).unwrap().recordings {
        let (container, sequence) =
            (recording.container.unwrap().number(), recording.sequence.unwrap());
        table += &format!("id{container}_{sequence:04}.png,300,\n");
    }
    for (folder, part, capacity) in
        [("test_pub", "public test", 400), ("test_priv", "private test", 500)]
    {
        let audio = data.join(folder).join("audio");
        std::fs::create_dir_all(&audio).unwrap();
        for id in 0..2 {
            std::fs::write(audio.join(format!("{id:06}.wav")), b"").unwrap();
            table += &format!("id{id:06}.png,{capacity},{part}\n");
        }
    }
    let path = dir.path().join("capacity.csv");
    std::fs::write(&path, table).unwrap();
    let given = CapacityTable { name: "X".into(), path, own: None, learned_from: Vec::new() };
    let systems: Vec<Box<dyn System>> = vec![Box::new(Constant)];
    let made =
        BenchmarkOptions { systems, capacities: vec![given], ..options(&data, &out, Vec::new()) };
    run(&made).unwrap();
    for (part, capacity) in [("public-test", "400"), ("private-test", "500")] {
        let path = out.join(format!("submissions/m4-x-{part}-2022.csv"));
        let rows = std::fs::read_to_string(&path).unwrap();
        let cells: Vec<&str> = rows.lines().skip(1).map(|r| r.split(',').nth(1).unwrap()).collect();
        assert_eq!(cells, [capacity; 2], "{rows}");
    }
}

/// Capacities have their rows, complete what is heard, and give whole submissions and figures of their errors.
#[test]
fn capacities_complete_what_is_heard() {
    let dir = tempfile::tempdir().unwrap();
    let (data, out) = (dir.path().join("data"), dir.path().join("report"));
    synth::generate(&data, Size::Reduced, 3).unwrap();
    let set = corsmal_ccm::dataset::DataSet::open(&data).unwrap();
    let mut table = String::from(
        "fileName,capacity[mL],width top[mm],width bottom[mm],height[mm],execution[ms]\n",
    );
    let known = |r: &&corsmal_ccm::dataset::Recording| set.annotation(r).is_some();
    let silent = set.recordings.iter().find(known).unwrap().path.clone();
    for recording in &set.recordings {
        let (container, sequence) =
            (recording.container.unwrap().number(), recording.sequence.unwrap());
        // A tenth too large where it is known, and nothing for one recording.
        let capacity = set.annotation(recording).map_or(700.0, |a| 1.1 * a.capacity_ml);
        let capacity = if recording.path == silent { -1.0 } else { capacity };
        table += &format!("id{container}_{sequence:04}.png,{capacity},80,60,120,4.5\n");
    }
    let file = dir.path().join("capacity.csv");
    std::fs::write(&file, table).unwrap();
    let forest = Baseline::all().into_iter().filter(|b| b.slug() == "zcr-mfcc-rf").collect();
    let learned_from = vec![2, 11];
    let capacities =
        vec![CapacityTable { name: "M 2".into(), path: file, own: None, learned_from }];
    let report = run(&BenchmarkOptions { capacities, ..options(&data, &out, forest) }).unwrap();

    let tables: Vec<_> = report.sections.iter().flat_map(|s| &s.tables).collect();
    let find = |table: &str, method: &str| {
        let table = tables.iter().find(|t| t.name == table).unwrap();
        let row = table.rows.iter().find(|r| r.cells[0] == Cell::text(method));
        let place = table.columns.iter().position(|c| c == "Training").unwrap();
        row.map(|row| row.cells[place].value())
    };
    let (heard, whole) = ("ZCR + MFCCs + RF", "ZCR + MFCCs + RF, capacity M 2");
    let set_size = set.recordings.iter().filter(|r| r.container.unwrap().number() < 10).count();
    let expected = 100.0 * (-0.1f64).exp() * (set_size - 1) as f64 / set_size as f64;
    assert!((find("capacity", "M 2").unwrap().unwrap() - expected).abs() < 1e-9);
    let mass = |method| find("mass", method).unwrap().unwrap();
    assert!(mass(whole) > mass(heard), "{} {}", mass(whole), mass(heard));
    assert!(find("weight", whole).unwrap().unwrap() > 0.0);
    assert_eq!((find("weight", heard), find("level", whole)), (None, None));
    let by_container = tables.iter().find(|t| t.name == "mass-by-container-training").unwrap();
    assert!(by_container.rows.iter().any(|r| r.cells[0] == Cell::text(whole)));
    assert!(by_container.rows.iter().all(|r| r.cells[0] != Cell::text(heard)));

    let read = |name: &str| std::fs::read_to_string(out.join(name)).unwrap();
    let submission = read("submissions/zcr-mfcc-rf-corrected-m-2-held-out-2022.csv");
    let rows: Vec<Vec<&str>> = submission.lines().skip(1).map(|l| l.split(',').collect()).collect();
    assert_eq!(rows.len(), set_size);
    assert_eq!(rows.iter().filter(|row| row[1] == "-1").count(), 1);
    for row in rows {
        let given = [2, 13, 14, 15, 19].map(|place| row[place]);
        assert_eq!(given, ["15", "80", "60", "120", "4.5"], "{row:?}");
        let sum: f64 = row[4..8].iter().map(|p| p.parse::<f64>().unwrap()).sum();
        assert!((sum - 1.0).abs() < 1e-5, "{row:?}");
    }
    let public = read("submissions/zcr-mfcc-rf-corrected-m-2-public-test.csv");
    assert!(public.lines().count() > 1 && !public.contains(",-1\n"), "{public}");
    for by in ["container", "type-and-level"] {
        let figure = read(&format!("figures/capacity-error-m-2-by-{by}.svg"));
        assert!(figure.contains("median 10.0"), "{figure}");
    }
    // Of what is only completed no figure says anything new.
    assert!(!out.join("figures/zcr-mfcc-rf-corrected-m-2-type-confusion.svg").exists());
}
