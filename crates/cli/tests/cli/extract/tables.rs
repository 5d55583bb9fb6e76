//! Recordings that differ in channels or rate in one table; windows.

use std::path::Path;

use corsmal_files::outcome::Status;

use super::support::{ended, extract, spec, table, wav};
use crate::command::{done, text, tool};

/// A mono recording first in the list, three of four channels, and what is not a recording.
fn mixed(folder: &Path) {
    wav(&folder.join("a_mono.wav"), 1, 8000, 1);
    for (name, seed) in [("b.wav", 2), ("c.wav", 3), ("d.wav", 4)] {
        wav(&folder.join(name), 4, 8000, seed);
    }
    std::fs::write(folder.join("e.wav"), b"no recording").unwrap();
}

#[test]
fn one_odd_recording_does_not_set_the_width_of_a_table() {
    let folder = tempfile::tempdir().unwrap();
    let audio = folder.path().join("audio");
    std::fs::create_dir(&audio).unwrap();
    mixed(&audio);
    let out = folder.path().join("t.npz");
    let run = extract(&audio, &out, &["--preset", "mfcc-zcr"]).with(1);
    let warning = "3 of 4 recordings have 4 channels, which sets the width of the table (the first: \
                   b); 1 with another number (1 channel: a_mono) will have the status mismatch. \
                   --set signal.channels=mean or --set summary.average_channels=true gives one width";
    assert!(run.stderr.contains(warning), "{}", run.stderr);
    let found = table(&out);
    assert_eq!(found.ids(), ["b", "c", "d"]);
    assert_eq!(found.outcomes()[0].status, Status::Mismatch);
    let reason = "1 channel where the table has 4 (as b). --set signal.channels=mean or";
    assert!(found.outcomes()[0].reason.starts_with(reason), "{}", found.outcomes()[0].reason);

    // Any number of jobs and shards: the same rows.
    for i in 0..2 {
        let part = folder.path().join(format!("part{i}.npz"));
        let shard = format!("{i}/2");
        extract(&audio, &part, &["--preset", "mfcc-zcr", "--shard", &shard, "--jobs", "2"]).with(1);
    }
    let at = |name: &str| folder.path().join(name);
    done(&["merge", text(&at("part0.npz")), text(&at("part1.npz")), "--out", text(&at("m.npz"))]);
    assert_eq!(std::fs::read(at("m.npz")).unwrap(), std::fs::read(&out).unwrap());

    // One width for all.
    for set in ["signal.channels=mean", "summary.average_channels=true"] {
        let more = ["--preset", "mfcc-zcr", "--set", set, "--overwrite"];
        let run = extract(&audio, &out, &more).with(1);
        assert!(!run.stderr.contains("width"), "{}", run.stderr);
        assert_eq!(table(&out).ids(), ["a_mono", "b", "c", "d"]);
    }
    // Tensors have no common width.
    let run = extract(&audio, &out, &["--overwrite"]).with(1);
    assert!(!run.stderr.contains("warning"), "{}", run.stderr);
}

#[test]
fn different_rates_in_a_table_are_told() {
    let folder = tempfile::tempdir().unwrap();
    let audio = folder.path().join("audio");
    wav(&audio.join("a.wav"), 1, 8000, 1);
    wav(&audio.join("b.wav"), 1, 8000, 2);
    let mut half = hound::WavWriter::create(
        audio.join("c.wav"),
        hound::WavSpec { sample_rate: 8000, ..spec(1) },
    )
    .unwrap();
    (0..4000).for_each(|i| half.write_sample((i % 100) as i16).unwrap());
    half.finalize().unwrap();
    let out = folder.path().join("t.npz");
    let run = extract(&audio, &out, &["--preset", "mfcc-zcr"]).with(0);
    let warning = "the table mixes 2 sample rates (16000 Hz: 2, such as a; 8000 Hz: c): features of \
                   different rates are not comparable. --set signal.sample_rate=16000 gives one";
    assert!(run.stderr.contains(warning), "{}", run.stderr);
    let more = ["--preset", "mfcc-zcr", "--set", "signal.sample_rate=8000", "--overwrite"];
    assert!(!extract(&audio, &out, &more).with(0).stderr.contains("warning"));
    assert!(!extract(&audio, &out, &["--overwrite"]).with(0).stderr.contains("mixes"));

    let shown = done(&["inspect", text(&out)]);
    assert!(shown.contains("rates       16000 Hz × 2, 8000 Hz × 1  (mixed)"), "{shown}");
    assert!(shown.contains("channels    1 × 3"), "{shown}");
    assert!(shown.contains("durations   0.50 s each, 1.50 s in all"), "{shown}");
}

#[test]
fn windows_are_rows_with_the_labels_and_the_id_of_their_recording() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    wav(&at("long.wav"), 2, 20_100, 1);
    wav(&at("short.wav"), 2, 4000, 2);
    std::fs::write(at("list.csv"), "path,class\nlong.wav,dog\nshort.wav,rain\n").unwrap();
    let out = at("w.npz");
    let windows = ["--preset", "esc26", "--window", "0.5", "--hop", "0.25"];
    extract(&at("list.csv"), &out, &windows).with(0);
    let found = table(&out);
    let ids = ["long@0", "long@0.25", "long@0.5", "long@0.75", "short@0"];
    assert_eq!(found.ids(), ids);
    let labels: Vec<(&str, &[String])> = found.labels().collect();
    assert_eq!(labels[0].0, "class");
    assert_eq!(labels[0].1, ["dog", "dog", "dog", "dog", "rain"]);
    assert_eq!(labels[1].0, "recording");
    assert_eq!(labels[1].1, ["long", "long", "long", "long", "short"]);

    // What a manifest with these times gives.
    let rows = "path,id,start,end\nlong.wav,a,0,0.5\nlong.wav,b,0.25,0.75\nlong.wav,c,0.5,1\n\
                long.wav,d,0.75,1.25\nshort.wav,e,,\n";
    std::fs::write(at("by_hand.csv"), rows).unwrap();
    extract(&at("by_hand.csv"), &at("h.npz"), &["--preset", "esc26"]).with(0);
    let by_hand = table(&at("h.npz"));
    assert_eq!(found.values(), by_hand.values());
    let (column, recordings) = by_hand.labels().next().unwrap();
    assert_eq!(column, "recording");
    assert!(recordings[..4].iter().all(|r| r.ends_with("long.wav")), "{recordings:?}");

    // The hop is half a window unless it is given, as for `classify`.
    let listed =
        extract(&at("list.csv"), &at("dry.npz"), &["--window", "0.5", "--dry-run"]).with(0);
    let listed: Vec<&str> =
        listed.stdout.lines().filter_map(|line| line.split('\t').next()).collect();
    assert_eq!(listed, ids);
    // A part of a recording is cut where it begins.
    std::fs::write(at("part.csv"), "path,start,end\nlong.wav,0.1,1.2\n").unwrap();
    let listed =
        extract(&at("part.csv"), &at("dry.npz"), &["--window", "0.5", "--dry-run"]).with(0);
    assert!(listed.stdout.starts_with("long@0.1\t"), "{}", listed.stdout);
    assert_eq!(listed.stdout.lines().count(), 3);

    for wrong in [["--window", "0"], ["--window", "nan"], ["--hop", "1"]] {
        assert_eq!(extract(&at("list.csv"), &out, &wrong).code, Some(2), "{wrong:?}");
    }
}

#[test]
fn folds_keep_the_windows_of_a_recording_together() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let mut list = "path,class\n".to_string();
    for i in 0..6 {
        wav(&at(&format!("r{i}.wav")), 1, 16_000, 60 * (i % 2) + i);
        list += &format!("r{i}.wav,{}\n", ["low", "high"][i as usize % 2]);
    }
    std::fs::write(at("list.csv"), list).unwrap();
    extract(&at("list.csv"), &at("w.npz"), &["--preset", "esc26", "--window", "0.4"]).with(0);
    let features = at("w.npz");
    let arguments = [
        "cross-validate",
        "--features",
        text(&features),
        "--target",
        "class",
        "--classifier",
        "knn",
    ];
    let shown = done(&arguments);
    assert!(shown.contains("recording"), "{shown}");
}

#[test]
fn inputs_may_stand_by_themselves_and_options_be_short() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let (a, b) = (wav(&at("a.wav"), 1, 8000, 1), wav(&at("b.wav"), 1, 8000, 2));
    let out = at("long.npz");
    let long = ["extract", "--in", text(&a), text(&b), "--out", text(&out), "--jobs", "2"];
    done(&long);
    let shorts: [&[&str]; 3] = [
        &["extract", text(&a), text(&b), "-q", "-j", "2", "-o"],
        &["extract", "-i", text(&a), "-i", text(&b), "-q", "-o"],
        &["extract", text(&a), "--in", text(&b), "-q", "-o"],
    ];
    for (number, short) in shorts.into_iter().enumerate() {
        let out = at(&format!("short{number}.npz"));
        let run = ended(tool().args(short).arg(&out)).with(0);
        assert!(run.stderr.is_empty(), "{}", run.stderr);
        assert_eq!(std::fs::read(&out).unwrap(), std::fs::read(at("long.npz")).unwrap());
    }
    let none = ended(tool().args(["extract", "-o"]).arg(at("x.npz"))).with(2);
    assert!(none.stderr.contains("PATH"), "{}", none.stderr);
}

#[test]
fn what_there_is_is_explained_in_words() {
    let shown = done(&["features", "mfcc"]);
    for words in [
        "[features.mfcc]\n",
        "# Length of the window in samples, centred in the frame; 0: n_fft.\nwin_length = 0\n",
        "# Highest frequency of the bands in Hz; 0: half the sample rate.\nfmax = 0.0\n",
        "# In Python: corsmal_feat.feature.mfcc\n",
    ] {
        assert!(shown.contains(words), "{words} is not in {shown}");
    }
    // It is a part of a configuration file as it stands.
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    std::fs::write(at("mine.toml"), &shown).unwrap();
    wav(&at("a.wav"), 1, 8000, 1);
    extract(&at("a.wav"), &at("mine.npz"), &["--config", text(&at("mine.toml"))]).with(0);
    // What is not told apart from the defaults is not shown.
    let inspected = done(&["inspect", text(&at("mine.npz"))]);
    assert!(inspected.contains("every key at its default"), "{inspected}");
    assert!(!inspected.contains("n_fft"), "{inspected}");

    let refusal = crate::command::refused(&["features", "mfc"]);
    assert!(refusal.contains("did you mean \"mfcc\"?"), "{refusal}");
    let refusal = crate::command::refused(&["presets", "mfcc_zcr"]);
    assert!(refusal.contains("did you mean \"mfcc-zcr\"?"), "{refusal}");
    let presets = done(&["presets"]);
    assert!(presets.lines().all(|line| line.chars().count() <= 80), "{presets}");
    assert!(presets.contains("esc26"), "{presets}");
    let preset = done(&["presets", "esc26"]);
    assert!(preset.contains("  [features.mfcc]\n  n_mfcc = 20\n"), "{preset}");

    let more = ["--set", "melspectrogram.n_mels=64", "--add", "rms", "--overwrite"];
    extract(&at("a.wav"), &at("mine.npz"), &more).with(0);
    let inspected = done(&["inspect", text(&at("mine.npz"))]);
    assert!(inspected.contains("melspectrogram.n_mels = 64"), "{inspected}");
    let changed = ["--set", "melspectrogram.n_mels=64", "--overwrite"];
    extract(&at("a.wav"), &at("mine.npz"), &changed).with(0);
    let inspected = done(&["inspect", text(&at("mine.npz"))]);
    assert!(inspected.contains("preset logmel"), "{inspected}");
    assert!(inspected.contains("melspectrogram.n_mels = 64  (128)"), "{inspected}");
    assert!(inspected.contains("1 recording: melspectrogram 1 × 64 × 16 frames"), "{inspected}");
}
