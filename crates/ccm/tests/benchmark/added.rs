//! Prediction files of others, added to the report.

use std::sync::Arc;

use corsmal_ccm::benchmark::{BenchmarkOptions, Made};
use corsmal_ccm::synth::{self, Size};
use corsmal_report::Report;

use crate::run;

/// Nothing of nothing.
fn none() -> BenchmarkOptions {
    BenchmarkOptions {
        data: "nowhere".into(),
        out: "nowhere".into(),
        baselines: Vec::new(),
        systems: Vec::new(),
        added: Vec::new(),
        capacities: Vec::new(),
        detections: None,
        jobs: 1,
        seed: 1,
        made: Made::default(),
    }
}

#[test]
fn one_name_is_not_added_twice() {
    let added = vec![("x".into(), "a.csv".into()), ("x".into(), "b.csv".into())];
    let options = BenchmarkOptions { added, ..none() };
    assert_eq!(run(&options).unwrap_err().to_string(), "x: given twice; names must differ");
    // Files have their names in small letters and digits: one would have replaced the other.
    let add = |names: [&str; 2]| {
        let added = names.map(|name| (name.to_owned(), "a.csv".into())).into();
        run(&BenchmarkOptions { added, ..none() }).unwrap_err().to_string()
    };
    let said = add(["Cap A", "cap-a"]);
    assert!(said.starts_with("cap-a: its files would overwrite those of Cap A"), "{said}");
    assert!(
        add(["x", "容量"]).starts_with("容量: files are named after it"),
        "{}",
        add(["x", "容量"])
    );
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
        let result = result.map(|finished| finished.report);
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
    assert_eq!(said, ["warning: theirs: has no recording of this data set"]);
    let report = report.unwrap();
    let notes = report.sections.iter().find(|s| s.id == "notes").unwrap();
    assert!(notes.text.last().unwrap().contains("predictions of theirs"), "{:?}", notes.text);
}

/// Its methods left the tables without a word, but for scores of what has labels by scenario.
#[test]
fn a_test_part_with_few_labels_is_said_not_to_be_scored() {
    let adding = Adding::new();
    let data = adding.dir.path().join("data");
    let test = data.join("test_pub/audio");
    std::fs::create_dir_all(&test).unwrap();
    let from = data.join("train/1/audio/s0_fi1_fu1_b1_l0_audio.wav");
    for id in 0..3 {
        std::fs::copy(&from, test.join(format!("{id:06}.wav"))).unwrap();
    }
    let table = std::fs::read_to_string(data.join("ccm_train_annotation.csv")).unwrap();
    let (header, row) = (table.lines().next().unwrap(), table.lines().nth(1).unwrap());
    let (_, about) = row.split_once(",1,").unwrap();
    let rows = |ids: u32| (0..ids).map(|id| format!("{id},10,{about}\n")).collect::<String>();
    let annotations = data.join("test_pub/ccm_test_pub_annotation.csv");
    let lines: Vec<String> = adding.lines();
    for (labelled, expected) in [(2, true), (3, false)] {
        std::fs::write(&annotations, format!("{header}\n{}", rows(labelled))).unwrap();
        let (report, said) = adding.run(&lines);
        report.unwrap();
        let told = "warning: public test: 2 of 3 recordings have labels, so it is not scored.";
        assert_eq!(said.iter().any(|line| line == told), expected, "{said:?}");
    }
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
    // All that there is of the part, though the official one has more.
    assert!(!submission(3).map_err(|e| e.to_string()).unwrap(), "public test, without labels");
    let error = submission(5).unwrap_err().to_string();
    assert!(error.contains("only 3 of its 5 ids are public test recordings"), "{error}");
    let error = submission(60).unwrap_err().to_string();
    assert!(error.contains("its ids fit several parts"), "{error}");
}
