//! Bad recordings become outcomes; the run goes on.

use std::path::{Path, PathBuf};

use corsmal_files::outcome::{Outcome, Status};

use super::support::{extract, spec, table, wav};
use crate::command::{done, run, text};

/// Two good recordings and every kind of bad one.
fn zoo(folder: &Path) -> PathBuf {
    let audio = folder.join("audio");
    let at = |name: &str| audio.join(name);
    let good = wav(&at("good.wav"), 2, 8000, 1);
    let bytes = std::fs::read(&good).unwrap();
    std::fs::write(at("empty.wav"), b"").unwrap();
    std::fs::write(at("garbage.wav"), b"this was once a recording, honestly").unwrap();
    std::fs::write(at("header.wav"), &bytes[..30]).unwrap();
    std::fs::write(at("no_samples.wav"), &bytes[..44]).unwrap();
    // One frame and a half are missing.
    std::fs::write(at("truncated.wav"), &bytes[..bytes.len() - 6]).unwrap();
    let mut adpcm = bytes.clone();
    adpcm[20] = 2;
    std::fs::write(at("adpcm.wav"), adpcm).unwrap();
    let float = hound::WavSpec {
        bits_per_sample: 32,
        sample_format: hound::SampleFormat::Float,
        ..spec(2)
    };
    for (name, bad) in [("nan.wav", f32::NAN), ("inf.wav", f32::INFINITY)] {
        let mut writer = hound::WavWriter::create(at(name), float).unwrap();
        for i in 0..16_000 {
            writer.write_sample(if i == 9001 { bad } else { 0.1 }).unwrap();
        }
        writer.finalize().unwrap();
    }
    std::fs::write(at("noise.flac"), [b"fLaC".as_slice(), &[7; 400]].concat()).unwrap();
    std::fs::write(at("noise.ogg"), [b"OggS".as_slice(), &[7; 400]].concat()).unwrap();
    std::fs::write(at("noise.mp3"), [b"ID3".as_slice(), &[7; 400]].concat()).unwrap();
    wav(&at("short.wav"), 2, 2047, 1);
    wav(&at("three.wav"), 3, 8000, 1);
    wav(&at("z.wav"), 2, 8000, 2);
    audio
}

const NOT_CENTERED: &[&str] = &[
    "--preset",
    "mfcc-zcr",
    "--set",
    "mfcc.center=false",
    "--set",
    "zero_crossing_rate.center=false",
];

fn row<'a>(outcomes: &'a [Outcome], id: &str) -> &'a Outcome {
    outcomes.iter().find(|o| o.id == id).unwrap()
}

#[test]
fn each_has_its_outcome() {
    let folder = tempfile::tempdir().unwrap();
    let audio = zoo(folder.path());
    let out = folder.path().join("feats.npz");
    let run = extract(&audio, &out, NOT_CENTERED).with(1);
    let table = table(&out);
    let outcomes = table.outcomes();
    assert_eq!(outcomes.len(), 15);
    assert_eq!(table.ids(), ["good", "truncated", "z"]);
    assert!(table.values().iter().all(|x| x.is_finite()));
    for (id, status, words) in [
        ("empty", Status::Empty, ""),
        ("garbage", Status::NotAudio, "starts with"),
        ("header", Status::Corrupt, "byte"),
        ("no_samples", Status::Empty, "no samples"),
        ("adpcm", Status::Unsupported, "format tag 0x0002"),
        ("nan", Status::NonFinite, "frame 4500 on (channel 1"),
        ("inf", Status::NonFinite, "frame 4500 on (channel 1"),
        ("short", Status::TooShort, "2047 samples; one frame needs at least 2048"),
        ("three", Status::Mismatch, "channels"),
    ] {
        let outcome = row(outcomes, id);
        assert_eq!(outcome.status, status, "{id}: {}", outcome.reason);
        assert!(outcome.reason.contains(words), "{id}: {}", outcome.reason);
        assert_eq!(run.stderr.matches(&format!("/{id}.wav: {status}")).count(), 1, "{id}");
    }
    for id in ["noise.flac", "noise.ogg", "noise.mp3"] {
        let outcome = row(outcomes, id);
        assert!(!outcome.status.has_features() && !outcome.reason.is_empty(), "{outcome:?}");
    }
    // The header of hound's float files is 68 bytes long, a frame 8.
    assert_eq!(row(outcomes, "nan").byte_offset, Some(68 + 8 * 4500));
    assert_eq!(row(outcomes, "nan").decoded_frames, 8000);
    let truncated = row(outcomes, "truncated");
    assert_eq!(truncated.status, Status::Truncated);
    assert_eq!((truncated.declared_frames, truncated.decoded_frames), (Some(8000), 7998));
    assert_eq!(truncated.repairs, ["truncated", "partial_frame"]);
    let good = row(outcomes, "good");
    assert_eq!((good.sample_rate, good.channels), (Some(16_000), Some(2)));
    // What sets the width of the table, a line for each, and two that sum up.
    assert_eq!(run.stderr.lines().count(), 1 + 12 + 2, "{}", run.stderr);
    let mut last = run.stderr.lines().rev();
    assert!(last.next().unwrap().ends_with("2 repaired: 1 partial_frame, 2 truncated"));
    assert!(last.next().unwrap().contains("2 ok, 1 too_short, 1 truncated"));
}

#[test]
fn a_run_of_bad_recordings_only_still_has_its_outcomes() {
    let folder = tempfile::tempdir().unwrap();
    let bad = folder.path().join("bad.wav");
    std::fs::write(&bad, b"").unwrap();
    let out = folder.path().join("feats.npz");
    for preset in ["logmel", "mfcc-zcr"] {
        extract(&bad, &out, &["--preset", preset, "--overwrite"]).with(1);
        assert!(table(&out).ids().is_empty());
        assert_eq!(table(&out).outcomes().len(), 1);
    }
    let parquet = folder.path().join("feats.parquet");
    extract(&bad, &parquet, &["--preset", "mfcc-zcr"]).with(1);
    assert_eq!(
        corsmal_files::feature_file::FeatureTable::open(&parquet).unwrap().table.outcomes().len(),
        1
    );
    // Nothing new: the same answer.
    extract(&bad, &parquet, &["--preset", "mfcc-zcr"]).with(1);
}

#[test]
fn strict_and_max_errors_stop_early_and_can_be_continued() {
    let folder = tempfile::tempdir().unwrap();
    let audio = zoo(folder.path());
    let whole = folder.path().join("whole.npz");
    extract(&audio, &whole, NOT_CENTERED).with(1);
    let out = folder.path().join("feats.npz");
    for stop in [&["--strict"][..], &["--max-errors", "2", "--resume"]] {
        let run = extract(&audio, &out, &[NOT_CENTERED, stop].concat()).with(2);
        let allowed = if stop[0] == "--strict" { "(0 allowed)" } else { "(2 allowed)" };
        assert!(run.stderr.contains(allowed) && run.stderr.contains("--resume"), "{}", run.stderr);
        // Nothing is written after the one that was too many.
        let failed = if stop[0] == "--strict" { "after 1 failed" } else { "after 3 failed" };
        assert!(run.stderr.contains(failed), "{}", run.stderr);
        assert!(!out.exists());
    }
    let pending = extract(&audio, &out, NOT_CENTERED).with(2);
    assert!(pending.stderr.contains("--resume") && pending.stderr.contains("--overwrite"));
    extract(&audio, &out, &[NOT_CENTERED, &["--resume", "--max-errors", "100"]].concat()).with(1);
    assert!(std::fs::read(&out).unwrap() == std::fs::read(&whole).unwrap());
}

#[test]
fn crops_beyond_the_end_are_empty_and_manifests_crop() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let one = wav(&at("a.wav"), 2, 16_000, 1);
    let out = at("feats.npz");
    extract(&one, &out, &["--preset", "mfcc-zcr", "--set", "signal.start=1"]).with(1);
    assert_eq!(table(&out).outcomes()[0].status, Status::Empty);
    // Frames are counted in the file, not in the signal that features see.
    let resampled = ["--preset", "esc26", "--set", "signal.length=3", "--overwrite"];
    extract(&one, &out, &resampled).with(0);
    let outcome = table(&out).outcomes()[0].clone();
    assert_eq!((outcome.declared_frames, outcome.decoded_frames), (Some(16_000), 16_000));

    let list = "path,id,start,end,label\n\
                a.wav,all,,,x\na.wav,middle,0.25,0.75,y\na.wav,late,0.75,9,y\na.wav,after,2,3,z\n";
    std::fs::write(at("list.csv"), list).unwrap();
    extract(&at("list.csv"), &out, &["--preset", "mfcc-zcr", "--overwrite"]).with(1);
    let table_of = table(&out);
    assert_eq!(table_of.ids(), ["all", "middle", "late"]);
    let frames: Vec<_> = table_of.outcomes().iter().map(|o| o.decoded_frames).collect();
    assert_eq!(frames, [16_000, 8000, 4000, 0]);
    assert_eq!(table_of.outcomes()[3].status, Status::Empty);
    assert_eq!(table_of.labels().collect::<Vec<_>>()[0].1, ["x", "y", "y"]);

    // The middle is what a file of these samples gives.
    let mut reader = hound::WavReader::open(&one).unwrap();
    let samples: Vec<i16> = reader.samples().map(|s| s.unwrap()).collect();
    let mut writer = hound::WavWriter::create(at("middle.wav"), spec(2)).unwrap();
    samples[2 * 4000..2 * 12_000].iter().for_each(|s| writer.write_sample(*s).unwrap());
    writer.finalize().unwrap();
    let alone = at("alone.npz");
    extract(&at("middle.wav"), &alone, &["--preset", "mfcc-zcr"]).with(0);
    assert_eq!(table(&alone).values().row(0), table_of.values().row(1));
}

#[test]
fn a_rate_that_would_make_billions_of_samples_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let input = wav(&folder.path().join("slow.wav"), 1, 200_000, 1);
    let mut bytes = std::fs::read(&input).unwrap();
    bytes[24..28].copy_from_slice(&1u32.to_le_bytes());
    std::fs::write(&input, bytes).unwrap();
    let out = folder.path().join("feats.npz");
    extract(&input, &out, &["--preset", "esc26"]).with(1);
    let outcome = table(&out).outcomes()[0].clone();
    assert_eq!(outcome.status, Status::Unsupported);
    assert!(outcome.reason.contains("22050 is more than 100 times the 1 Hz"), "{}", outcome.reason);
}

#[test]
fn the_class_of_one_is_kept_so_that_it_counts_as_wrong() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let mut list = String::from("path,type,take\n");
    for i in 0..6 {
        wav(&at(&format!("{i}.wav")), 1, 8000, 100 * (1 + i % 2));
        list.push_str(&format!("{i}.wav,{},{i}\n", ["rice", "water"][i as usize % 2]));
    }
    std::fs::write(at("list.csv"), &list).unwrap();
    extract(&at("list.csv"), &at("good.npz"), &["--preset", "mfcc-zcr"]).with(0);
    let (good, model, csv) = (at("good.npz"), at("x.model"), at("p.csv"));
    let (good, model, csv) = (text(&good), text(&model), text(&csv));
    done(&["train", good, "--target", "type", "--classifier", "knn", "--out", model]);
    std::fs::write(at("5.wav"), "no recording").unwrap();
    for out in ["f.npz", "f.parquet"] {
        extract(&at("list.csv"), &at(out), &["--preset", "mfcc-zcr"]).with(1);
        let classified = ["classify", "--model", model, "--features"];
        let ended =
            run(&[&classified[..], &[text(&at(out)), "--out", csv, "--overwrite"]].concat());
        assert_eq!(ended.status.code(), Some(1), "{out}");
        let lines = std::fs::read_to_string(csv).unwrap();
        let failed = lines.lines().find(|line| line.starts_with("5,")).unwrap();
        assert!(failed.contains(",not_audio,water,5,"), "{out}: {lines}");
        let report: serde_json::Value =
            serde_json::from_str(&done(&["score", csv, "--json"])).unwrap();
        assert_eq!((&report["unknown"], &report["rows"]), (&1.into(), &6.into()), "{out}");
    }
}

/// A file in an archive of others could be called anything, such as a line of this program.
#[test]
fn no_name_makes_a_line_of_its_own() {
    let folder = tempfile::tempdir().unwrap();
    let (audio, out) = (folder.path().join("audio"), folder.path().join("x.npz"));
    wav(&audio.join("a.wav"), 1, 8000, 1);
    std::fs::write(audio.join("b\nx.npz: 2 ok\t.wav"), b"RIFF").unwrap();
    let said = run(&["extract", text(&audio), "-o", text(&out), "--preset", "mfcc-zcr"]);
    let said = String::from_utf8(said.stderr).unwrap();
    assert!(said.lines().count() == 2 && said.contains("b\\nx.npz: 2 ok\\t.wav: "), "{said}");
    let listed = done(&["extract", text(&audio), "-o", text(&out), "--dry-run", "--overwrite"]);
    assert_eq!(listed.lines().count(), 2, "{listed}");

    // Lines for programs are whole, however long.
    let long = ["x".repeat(250).as_str(); 10].join("/");
    wav(&audio.join(&long).join("c.wav"), 1, 2, 1);
    let json = ["--log-format", "json", "--preset", "mfcc-zcr", "--overwrite", "-o", text(&out)];
    let said = run(&[&["extract", text(&audio)], &json[..]].concat());
    let said = String::from_utf8(said.stderr).unwrap();
    let events = said.lines().map(|line| serde_json::from_str::<serde_json::Value>(line).unwrap());
    let paths = events.map(|event| event["outcome"]["path"].to_string());
    assert!(paths.into_iter().any(|path| path.contains(&long)), "{said}");
}
