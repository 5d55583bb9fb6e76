//! Data sets on disk, and the published splits and actions.

#![allow(clippy::unwrap_used)]

mod shared_data;

use corsmal_ccm::dataset::{
    Annotations, Container, DataSet, PublishedSplit, SequenceName, Subset, check, read_actions,
    training_order,
};
use corsmal_ccm::synth::{self, Size};
use shared_data::ccm;

#[test]
fn published_splits_are_met_exactly() {
    let Some(path) = ccm("splits.csv") else { return };
    let mut reader = csv::Reader::from_path(path).unwrap();
    let header = reader.headers().unwrap().clone();
    let rows: Vec<_> = reader.records().map(|r| r.unwrap()).collect();
    let column = |name: &str| header.iter().position(|h| h == name).unwrap();
    for ((container, name), row) in training_order().zip(&rows) {
        assert_eq!(row[column("container")], container.number().to_string());
        assert_eq!(row[column("sequence")], name.to_string());
        assert_eq!(row[column("joint")], name.filling.joint().to_string());
        let fold = corsmal_ccm::dataset::CONTAINER_FOLDS[container.fold().unwrap()];
        assert_eq!(row[column("fold3")], fold.map(|c| c.to_string()).join("_"));
    }
    for (split, name) in [
        (PublishedSplit::Baselines, "ml_baselines_split"),
        (PublishedSplit::M6Stratified, "m6_split_val_ids"),
        (PublishedSplit::M6Plain, "m6_split_filename_list"),
    ] {
        let column = column(name);
        let mut held: Vec<_> = split.rows().unwrap().test;
        held.sort_unstable();
        let expected: Vec<_> = (0..rows.len()).filter(|&i| &rows[i][column] != "train").collect();
        assert_eq!(held, expected, "{split:?}");
    }
}

#[test]
fn actions_are_missing_exactly_for_empty_containers() {
    let Some(path) = ccm("man_annotations.csv") else { return };
    let actions = read_actions(&path).unwrap();
    assert_eq!(actions.len(), 684);
    for (key, action) in training_order().map(|k| (k, actions[&k])) {
        assert_eq!(action.is_none(), key.1.filling.joint() == 0, "{key:?}");
    }
}

#[test]
fn odd_files_of_actions_are_said() {
    let folder = tempfile::tempdir().unwrap();
    let put = |name: &str, text: &str| {
        let path = folder.path().join(name);
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        std::fs::write(path, text).unwrap();
    };
    put("train/1/audio/s0_fi0_fu0_b0_l0_audio.wav", "RIFF");
    let head = "folder_num,file_name,start,end\n";
    let row = "1,s0_fi1_fu1_b0_l0_c2,1,2\n";
    let odd = || {
        let found = corsmal_ccm::dataset::check(&DataSet::open(folder.path()).unwrap());
        found.odd.iter().map(|odd| odd.what.clone()).collect::<Vec<_>>().join("; ")
    };
    put("man_annotations.csv", &format!("{head}{row}"));
    let before = odd();
    put("man_annotations.csv", &format!("{head}garbage,x,y,z\n"));
    assert!(odd().contains("line 2"), "{}", odd());
    put("man_annotations.csv", &format!("{head}{row}{row}"));
    assert!(odd().contains("one line for each recording"), "{}", odd());
    put("man_annotations.csv", &format!("{head}{row}"));
    put("man_annotations_old.csv", &format!("{head}garbage,x,y,z\n"));
    assert_ne!(odd(), before);
    assert!(
        odd().contains("is not used: ") && odd().contains("man_annotations.csv has"),
        "{}",
        odd()
    );
}

#[test]
fn official_annotations_name_every_training_recording_once() {
    for file in ["ccm_train_annotation.csv", "ccm_train_annotation_2020-08.csv"] {
        let Some(path) = ccm(file) else { return };
        let annotations = Annotations::read(&path).unwrap();
        let mut keys: Vec<_> =
            annotations.rows.iter().map(|r| (r.container, r.sequence.unwrap())).collect();
        keys.sort_unstable();
        let expected: Vec<_> =
            training_order().map(|(c, n)| (c.number(), n.number(c).unwrap())).collect();
        assert_eq!(keys, expected, "{file}");
    }
}

#[test]
fn a_synthetic_set_is_found_whole() {
    let dir = tempfile::tempdir().unwrap();
    synth::generate(dir.path(), Size::Reduced, 2).unwrap();
    let set = DataSet::open(dir.path()).unwrap();
    assert!(set.synthetic);
    assert_eq!(set.recordings.len(), 133);
    assert!(set.recordings.iter().all(|r| r.name.is_some()));
    let training = set.recordings.iter().filter(|r| r.container.unwrap().number() <= 9);
    assert!(training.clone().all(|r| set.annotation(r).unwrap().id == r.id && r.id.is_some()));
    let actions = set.actions().unwrap();
    assert_eq!(actions.len(), training.count());
    let findings = check(&set);
    assert!(findings.sound(), "{:?}", findings.odd);
    assert_eq!(findings.absent.len(), 3);
    assert!(findings.formats.keys().all(|f| f.starts_with("8 channels, 44100 Hz")));
}

#[test]
fn the_flat_release_is_explained_by_its_annotations() {
    let dir = tempfile::tempdir().unwrap();
    synth::generate(dir.path(), Size::Small, 2).unwrap();
    let tree = DataSet::open(dir.path()).unwrap();
    let flat = tempfile::tempdir().unwrap();
    let audio = flat.path().join("train/audio");
    std::fs::create_dir_all(&audio).unwrap();
    for recording in &tree.recordings {
        let name = format!("{:06}.wav", recording.id.unwrap());
        std::fs::rename(&recording.path, audio.join(name)).unwrap();
    }
    let annotation = "ccm_train_annotation.csv";
    std::fs::copy(dir.path().join(annotation), flat.path().join(annotation)).unwrap();
    let set = DataSet::open(flat.path()).unwrap();
    let names = |set: &DataSet| -> Vec<(Option<Container>, Option<SequenceName>)> {
        set.recordings.iter().map(|r| (r.container, r.name)).collect()
    };
    assert_eq!(names(&set), names(&tree));
}

#[test]
fn flat_test_files_are_told_apart_by_their_folders() {
    let dir = tempfile::tempdir().unwrap();
    for part in ["train", "test_pub", "test_priv"] {
        let audio = dir.path().join(part).join("audio");
        std::fs::create_dir_all(&audio).unwrap();
        std::fs::write(audio.join("000000.wav"), "").unwrap();
    }
    let set = DataSet::open(dir.path()).unwrap();
    assert!(set.odd.is_empty(), "{:?}", set.odd);
    let parts: Vec<_> = set.recordings.iter().map(|r| (r.part, r.id)).collect();
    assert_eq!(parts, Subset::ALL.map(|part| (part, Some(0))));
    assert_eq!(check(&set).unplaced, 3);
}

#[test]
fn what_is_wrong_is_said() {
    let dir = tempfile::tempdir().unwrap();
    let put = |name: &str, bytes: &[u8]| {
        let path = dir.path().join(name);
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        std::fs::write(path, bytes).unwrap();
    };
    let error = DataSet::open(dir.path()).unwrap_err().to_string();
    assert!(error.contains("no recording"), "{error}");
    put("train/1/audio/s0_fi0_fu0_b0_l0_audio.wav", b"");
    put("train/7/audio/s0_fi3_fu1_b0_l0_audio.wav", b"");
    put("train/1/audio/hello.wav", b"");
    put("train/22/audio/s0_fi0_fu0_b0_l0_audio.wav", b"");
    put("train/audio/s0_fi0_fu0_b0_l0_audio.wav", b"");
    put("train/1/again/s0_fi0_fu0_b0_l0_audio.wav", b"");
    let findings = check(&DataSet::open(dir.path()).unwrap());
    assert!(!findings.sound());
    let all: String = findings.odd.iter().map(|o| format!("{}\n", o.what)).collect();
    for expected in [
        "never filled with water half",
        "not one of the data set's",
        "no container 22",
        "no folder above it",
        "present twice",
    ] {
        assert!(all.contains(expected), "{expected}: {all}");
    }
    assert_eq!(findings.containers[0].missing.len(), 83);
}

/// The benchmark said nothing of a recording that had lost half of its bytes.
#[test]
fn a_recording_that_is_cut_off_is_odd() {
    let dir = tempfile::tempdir().unwrap();
    synth::generate(dir.path(), Size::Small, 2).unwrap();
    let path = DataSet::open(dir.path()).unwrap().recordings[0].path.clone();
    let bytes = std::fs::read(&path).unwrap();
    std::fs::write(&path, &bytes[..bytes.len() / 2]).unwrap();
    let findings = check(&DataSet::open(dir.path()).unwrap());
    let odd: Vec<_> = findings.odd.iter().filter(|odd| odd.what.contains("cut off")).collect();
    assert!(!findings.sound() && odd.len() == 1 && odd[0].path == path, "{:?}", findings.odd);
}

/// Ids that mean other recordings, as in the two annotation files that were published for the flat
/// release.
#[test]
fn annotation_files_must_not_contradict_each_other() {
    let dir = tempfile::tempdir().unwrap();
    synth::generate(dir.path(), Size::Small, 2).unwrap();
    let path = dir.path().join("ccm_train_annotation.csv");
    let text = std::fs::read_to_string(&path).unwrap();
    let copy = dir.path().join("ccm_train_annotation_copy.csv");
    std::fs::write(&copy, &text).unwrap();
    assert!(check(&DataSet::open(dir.path()).unwrap()).sound(), "the same twice is fine");

    let (header, rows) = text.split_once('\n').unwrap();
    let mut rows: Vec<String> = rows.lines().map(String::from).collect();
    let without_id = |row: &str| row.split_once(',').unwrap().1.to_string();
    let (a, b) = (without_id(&rows[0]), without_id(&rows[1]));
    (rows[0], rows[1]) = (format!("0,{b}"), format!("1,{a}"));
    std::fs::write(&copy, format!("{header}\n{}\n", rows.join("\n"))).unwrap();
    let set = DataSet::open(dir.path()).unwrap();
    assert_eq!(set.contradictions.len(), 1);
    let findings = check(&set);
    let odd = &findings.odd[0];
    assert!(!findings.sound() && odd.path == copy, "{odd:?}");
    assert!(odd.what.contains("about id 0") && odd.what.contains(path.to_str().unwrap()));
    let error = corsmal_ccm::benchmark::run(
        &corsmal_ccm::benchmark::BenchmarkOptions {
            data: dir.path().into(),
            out: dir.path().join("report"),
            baselines: Vec::new(),
            systems: Vec::new(),
            added: Vec::new(),
            capacities: Vec::new(),
            detections: None,
            jobs: 1,
            seed: 1,
            made: Default::default(),
        },
        &|_| {},
        &Default::default(),
    );
    let error = error.unwrap_err().to_string();
    assert!(
        error.contains("annotation_copy.csv contradicts") && error.contains("about id 0"),
        "{error}"
    );

    // A capacity that the file of 2020 gives otherwise.
    let tree = "Container ID,Sequence,Scenario,Background,Illumination,Container Capacity [mL],\
                Container mass [g],Filling type,Filling density [g/mL],Filling level,\
                Filling mass [g]\n1,2,s0,b1,l0,521,10,-1,-1,-1,-1\n";
    std::fs::write(&copy, tree).unwrap();
    let sequence = Annotations::read(&path).unwrap().rows[2].sequence.unwrap();
    std::fs::write(&copy, tree.replace("1,2,", &format!("1,{sequence},"))).unwrap();
    let what = &DataSet::open(dir.path()).unwrap().contradictions[0].what;
    assert!(what.contains(&format!("about container 1 sequence {sequence}")), "{what}");
}

/// Ids start at 0 in every part.
#[test]
fn annotations_of_one_part_do_not_label_another() {
    let dir = tempfile::tempdir().unwrap();
    synth::generate(dir.path(), Size::Small, 2).unwrap();
    let tree = DataSet::open(dir.path()).unwrap();
    let flat = tempfile::tempdir().unwrap();
    for part in ["train", "test_pub"] {
        let audio = flat.path().join(part).join("audio");
        std::fs::create_dir_all(&audio).unwrap();
        for recording in &tree.recordings {
            let name = format!("{:06}.wav", recording.id.unwrap());
            std::fs::copy(&recording.path, audio.join(name)).unwrap();
        }
    }
    let text = std::fs::read_to_string(dir.path().join("ccm_train_annotation.csv")).unwrap();
    std::fs::write(flat.path().join("ccm_train_annotation.csv"), &text).unwrap();
    let header = text.lines().next().unwrap();
    let public = format!("{header}\n0,10,0,0,0,1,1,1,-1,300,5,1,1,0.3,45,50,-1,-1,-1\n");
    std::fs::write(flat.path().join("ccm_test_pub_annotation.csv"), public).unwrap();
    let set = DataSet::open(flat.path()).unwrap();
    assert!(set.contradictions.is_empty(), "{:?}", set.contradictions);
    let of = |part| set.recordings.iter().filter(move |r| r.part == part);
    let training: Vec<_> = of(Subset::Training).map(|r| (r.container, r.name)).collect();
    let expected: Vec<_> = tree.recordings.iter().map(|r| (r.container, r.name)).collect();
    assert_eq!(training, expected);
    let labelled: Vec<_> = of(Subset::Public).filter(|r| r.name.is_some()).collect();
    assert_eq!(labelled.len(), 1);
    assert_eq!((labelled[0].id, labelled[0].container), (Some(0), Container::new(10)));
    assert_eq!(labelled[0].sequence, None, "files of test parts are numbered at random");
}
