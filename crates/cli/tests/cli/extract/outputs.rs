//! What goes in, what comes out, and that it is the same however it was computed.

use std::io::Write;
use std::path::Path;
use std::process::Stdio;

use corsmal_files::npz::NpzFile;

use super::support::{Ended, ended, extract, extraction, folder, table, wav};
use crate::command::{names, tool};

fn bytes(path: &Path) -> Vec<u8> {
    std::fs::read(path).unwrap()
}

const SUMMARY: &[&str] = &["--preset", "mfcc-zcr"];

#[test]
fn a_glob_of_everything_has_the_current_folder_and_those_below() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    for name in ["a.wav", "d/b.wav", "d/e/c.wav"] {
        wav(&at("in").join(name), 1, 4000, 1);
    }
    for (pattern, out) in [("**", "all.npz"), (".", "folder.npz")] {
        let mut command = tool();
        command.current_dir(at("in")).args(["extract", pattern, "-o"]).arg(at(out)).args(SUMMARY);
        ended(&mut command).with(0);
        assert_eq!(table(&at(out)).ids(), ["a", "d/b", "d/e/c"], "{pattern}");
    }
}

#[test]
fn every_kind_of_input_gives_the_same_numbers() {
    let folder = folder(6);
    let at = |name: &str| folder.path().join(name);
    let rows: Vec<String> =
        (0..6).map(|i| format!("audio/{:02}/r{i:04}.wav,l{i}", i % 3)).collect();
    std::fs::write(at("list.csv"), format!("path,label\n{}\n", rows.join("\n"))).unwrap();
    let lines: Vec<String> =
        (0..6).map(|i| format!("{{\"path\": \"audio/{:02}/r{i:04}.wav\"}}", i % 3)).collect();
    std::fs::write(at("list.jsonl"), lines.join("\n")).unwrap();

    extract(&at("audio"), &at("folder.npz"), SUMMARY).with(0);
    extract(&at("audio/**/*.wav"), &at("glob.npz"), SUMMARY).with(0);
    extract(&at("list.csv"), &at("csv.npz"), SUMMARY).with(0);
    extract(&at("list.jsonl"), &at("jsonl.npz"), SUMMARY).with(0);
    let by_folder = table(&at("folder.npz"));
    assert_eq!(by_folder.ids()[..3], ["00/r0000", "00/r0003", "01/r0001"]);
    // 2 channels of (20 + 1) features, mean and standard deviation.
    assert_eq!(by_folder.values().dim(), (6, 84));
    assert_eq!(table(&at("glob.npz")).values(), by_folder.values());
    let by_list = table(&at("csv.npz"));
    assert_eq!(by_list.values(), table(&at("jsonl.npz")).values());
    for (id, row) in by_list.ids().iter().zip(by_list.values().rows()) {
        let id = id.strip_prefix("audio/").unwrap();
        let id = id.strip_suffix(".wav").unwrap_or(id);
        let place = by_folder.ids().iter().position(|other| other == id).unwrap();
        assert_eq!(row, by_folder.values().row(place));
    }

    // A file and standard input.
    let file = at("audio/00/r0000.wav");
    extract(&file, &at("file.npz"), SUMMARY).with(0);
    assert_eq!(table(&at("file.npz")).ids(), ["r0000"]);
    let mut stream = extraction(Path::new("-"), &at("stream.npz"), SUMMARY);
    let mut child = stream.stdin(Stdio::piped()).spawn().unwrap();
    child.stdin.take().unwrap().write_all(&bytes(&file)).unwrap();
    assert!(child.wait().unwrap().success());
    let stream = table(&at("stream.npz"));
    assert_eq!(stream.ids(), ["stdin"]);
    assert_eq!(stream.values().row(0), by_folder.values().row(0));
    assert_eq!(table(&at("file.npz")).values().row(0), by_folder.values().row(0));

    // Parquet holds the same table.
    extract(&at("list.csv"), &at("feats.parquet"), SUMMARY).with(0);
    let parquet =
        corsmal_files::feature_file::FeatureTable::open(&at("feats.parquet")).unwrap().table;
    assert_eq!(parquet, by_list);
}

#[test]
fn frame_level_arrays_have_their_times() {
    let folder = folder(2);
    let out = folder.path().join("feats.npz");
    extract(&folder.path().join("audio"), &out, &[]).with(0);
    let mut npz = NpzFile::open(&out).unwrap();
    let array = npz.f32("00/r0000").unwrap();
    assert_eq!(array.shape(), [2, 128, 1 + 8000 / 512]);
    let times = npz.f64("__times__/00/r0000").unwrap();
    assert_eq!(times.len(), 16);
    assert_eq!(times[[3]], 3.0 * 512.0 / 16_000.0);
    // The same numbers in a smaller file.
    let packed = folder.path().join("packed.npz");
    extract(&folder.path().join("audio"), &packed, &["--compress"]).with(0);
    assert_eq!(NpzFile::open(&packed).unwrap().f32("00/r0000").unwrap(), array);
    assert!(bytes(&packed).len() < bytes(&out).len());
}

#[test]
fn bytes_do_not_depend_on_jobs_shards_or_the_time() {
    let folder = folder(23);
    let audio = folder.path().join("audio");
    std::fs::write(audio.join("00/bad.wav"), b"RIFF").unwrap();
    wav(&audio.join("01/longer.wav"), 2, 100_000, 77);
    for more in [&[][..], SUMMARY, &["--compress"]] {
        let at = |name: String| folder.path().join(name + ".npz");
        let first = at("jobs1".into());
        let again = [more, &["--overwrite"]].concat();
        extract(&audio, &first, &[&again[..], &["--jobs", "1"]].concat()).with(1);
        let expected = bytes(&first);
        for jobs in ["2", "5"] {
            let out = at(format!("jobs{jobs}"));
            extract(&audio, &out, &[&again[..], &["--jobs", jobs]].concat()).with(1);
            assert!(bytes(&out) == expected, "--jobs {jobs} {more:?}");
        }
        let mut merge = tool();
        merge.arg("merge").arg("--out").arg(at("merged".into()));
        for i in [2, 0, 1] {
            let (out, part) = (at(format!("part{i}")), format!("{i}/3"));
            let code = extract(&audio, &out, &[&again[..], &["--shard", &part]].concat()).code;
            assert_eq!(code, Some(i32::from(i == 0)));
            merge.arg(out);
        }
        ended(&mut merge).with(0);
        assert!(bytes(&at("merged".into())) == expected, "shards {more:?}");
        std::fs::remove_file(at("merged".into())).unwrap();
    }
    assert!(names(folder.path()).iter().all(|n| !n.contains("part.") && !n.contains("ledger")));
}

#[test]
fn a_finished_run_does_nothing_again() {
    let folder = folder(3);
    let (audio, out) = (folder.path().join("audio"), folder.path().join("feats.npz"));
    extract(&audio, &out, SUMMARY).with(0);
    let (before, content) = (std::fs::metadata(&out).unwrap(), bytes(&out));
    for more in [&[][..], &["--resume"], &["--jobs", "1"]] {
        let run = extract(&audio, &out, &[SUMMARY, more].concat()).with(0);
        assert!(run.stderr.contains("up to date"), "{}", run.stderr);
        let after = std::fs::metadata(&out).unwrap();
        assert_eq!(after.modified().unwrap(), before.modified().unwrap());
    }
    assert_eq!(bytes(&out), content);
    assert_eq!(names(folder.path()), ["audio", "feats.npz"]);
}

#[test]
fn a_dry_run_lists_and_writes_nothing() {
    let folder = folder(4);
    let out = folder.path().join("feats.npz");
    let run = extract(&folder.path().join("audio"), &out, &["--dry-run"]).with(0);
    let ids: Vec<&str> = run.stdout.lines().map(|l| l.split('\t').next().unwrap()).collect();
    assert_eq!(ids, ["00/r0000", "00/r0003", "01/r0001", "02/r0002"]);
    let run = extract(&folder.path().join("audio"), &out, &["--dry-run", "--shard", "1/2"]);
    assert_eq!(run.with(0).stdout.lines().count(), 2);
    assert_eq!(names(folder.path()), ["audio"]);
}

#[test]
fn a_log_for_machines_is_json_lines() {
    let folder = folder(3);
    let audio = folder.path().join("audio");
    std::fs::write(audio.join("bad.wav"), b"RIFF").unwrap();
    let out = folder.path().join("feats.npz");
    let log = |run: &Ended| -> Vec<serde_json::Value> {
        run.stderr.lines().map(|line| serde_json::from_str(line).unwrap()).collect()
    };
    let run = extract(&audio, &out, &["--log-format", "json"]).with(1);
    let events = log(&run);
    let of = |name: &str| events.iter().filter(|e| e["event"] == name).collect::<Vec<_>>();
    assert_eq!(of("started")[0]["inputs"], 4);
    assert_eq!(of("file").len(), 4);
    assert_eq!(of("file").iter().filter(|e| e["outcome"]["status"] == "ok").count(), 3);
    assert_eq!(of("finished")[0]["statuses"]["ok"], 3);
    let again = extract(&audio, &out, &["--log-format", "json"]).with(1);
    assert_eq!(log(&again).last().unwrap()["up_to_date"], true);
    // What ends a run is an event, too.
    let json = |more: &[&str]| {
        let run = extract(&audio, &out, &[&["--log-format", "json"], more].concat());
        let last = log(&run).pop().unwrap();
        (run.code, last["event"].as_str().unwrap().to_string())
    };
    assert_eq!(json(&["--overwrite", "--strict"]), (Some(2), "error".into()));
    assert_eq!(json(&["--overwrite", "--preset", "nope"]), (Some(2), "error".into()));
    assert_eq!(json(&["--preset", "esc26"]), (Some(2), "error".into()));
    assert_eq!(json(&["--dry-run"]), (Some(0), "checked".into()));
    let quiet = extract(&audio, &out, &["--quiet", "--overwrite"]).with(1);
    let lines: Vec<_> = quiet.stderr.lines().collect();
    assert!(matches!(lines[..], [line] if line.contains("bad.wav")), "errors only: {lines:?}");
    assert!(quiet.stdout.is_empty());
}

#[test]
fn what_librosa_warns_of_is_warned_of_once() {
    let folder = folder(3);
    let out = folder.path().join("feats.npz");
    let more = ["--set", "melspectrogram.n_fft=256", "--overwrite"];
    let run = extract(&folder.path().join("audio"), &out, &more).with(0);
    let warnings: Vec<_> = run.stderr.lines().filter(|l| l.starts_with("warning: ")).collect();
    assert_eq!(warnings.len(), 1, "{}", run.stderr);
    assert!(warnings[0].contains("melspectrogram") && warnings[0].contains("empty"));

    let short = wav(&folder.path().join("short.wav"), 1, 1000, 1);
    let run = extract(&short, &out, &["--overwrite"]).with(0);
    assert!(run.stderr.contains("warning: short: 1000 samples"), "{}", run.stderr);
}

#[test]
fn a_shard_without_recordings_says_so() {
    let folder = folder(1);
    let out = folder.path().join("feats.npz");
    let run = extract(&folder.path().join("audio"), &out, &["--shard", "0/2"]).with(0);
    assert!(run.stderr.contains("feats.npz: no recordings in "), "{}", run.stderr);
    assert!(table(&out).ids().is_empty());
}

/// It had no label columns, and `merge` refused the others for theirs.
#[test]
fn a_shard_without_recordings_has_the_labels_of_the_others() {
    let folder = tempfile::tempdir().unwrap();
    wav(&folder.path().join("a.wav"), 1, 8000, 1);
    let at = |name: &str| folder.path().join(name);
    std::fs::write(at("list.csv"), "path,kind\na.wav,x\n").unwrap();
    for (out, more) in
        [("0.npz", &["--shard", "0/2"][..]), ("1.npz", &["--shard", "1/2"]), ("whole.npz", &[])]
    {
        extract(&at("list.csv"), &at(out), &[&["--preset", "mfcc-zcr"], more].concat()).with(0);
    }
    let merge = [at("0.npz"), at("1.npz"), "-o".into(), at("merged.npz")];
    ended(tool().arg("merge").args(&merge)).with(0);
    assert!(bytes(&at("merged.npz")) == bytes(&at("whole.npz")));
}

#[test]
fn every_command_has_help_with_an_example_and_a_manual_page() {
    let commands = ended(tool().arg("--help")).with(0).stdout;
    let commands = commands.split("Usage:").nth(1).unwrap().split("Options:").next().unwrap();
    let commands: Vec<&str> =
        commands.lines().filter_map(|l| l.strip_prefix("  ")?.split(' ').next()).collect();
    for command in commands.into_iter().filter(|c| !c.is_empty() && *c != "help") {
        let help = ended(tool().args([command, "--help"])).with(0).stdout;
        assert!(help.contains("Example"), "{command}");
        let page = ended(tool().args(["completions", "man", command])).with(0).stdout;
        assert!(page.contains(&format!(".TH corsmal-feat-{command} 1")), "{command}: {page}");
    }
    let all = ended(tool().args(["completions", "man"])).with(0).stdout;
    assert!(all.contains("extract") && all.contains(".TH corsmal-feat 1"));
    let unknown = ended(tool().args(["completions", "man", "nope"])).with(2);
    assert!(unknown.stderr.contains("nope") && unknown.stderr.contains("extract"));
}

#[test]
fn repairs_are_counted_at_the_end() {
    let folder = tempfile::tempdir().unwrap();
    wav(&folder.path().join("a.wav"), 1, 8000, 1);
    let (list, out) = (folder.path().join("list.csv"), folder.path().join("out.npz"));
    std::fs::write(&list, "path,start,end\na.wav,0,0.2\na.wav,0.3,9\n").unwrap();
    let run = extract(&list, &out, &["--preset", "mfcc-zcr"]).with(0);
    assert!(run.stderr.contains(": 1 repaired: 1 end_beyond_recording\n"), "{}", run.stderr);
    assert_eq!(table(&out).outcomes()[1].repairs, ["end_beyond_recording"]);
    let run = extract(&list, &out, &["--overwrite", "--log-format", "json"]).with(0);
    let last = run.stderr.lines().last().unwrap();
    let event: serde_json::Value = serde_json::from_str(last).unwrap();
    assert_eq!(event["repairs"], serde_json::json!({"end_beyond_recording": 1}));
}
