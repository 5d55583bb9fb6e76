//! What the system does to a command: readers that go away, signals, names that are no text, quiet runs.

use std::ffi::{OsStr, OsString};
use std::os::unix::ffi::OsStrExt;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use crate::command::{done, names, run, text, tool, written};

/// A folder with twelve recordings of two kinds in `audio`, their statistics in `t.npz`, and a model of the kind.
struct Trained(tempfile::TempDir);

impl Trained {
    fn new() -> Self {
        let this = Self(tempfile::tempdir().unwrap());
        for number in 0..12 {
            let folder = this.at(["audio/low", "audio/high"][number % 2]);
            std::fs::create_dir_all(&folder).unwrap();
            wav(&folder.join(format!("{number}.wav")), number);
        }
        let (audio, table, model) = (this.at("audio"), this.at("t.npz"), this.at("m"));
        done(&["extract", text(&audio), "-o", text(&table), "--preset", "esc26", "-q"]);
        done(&["train", text(&table), "--labels", "folders", "-o", text(&model), "-q"]);
        this
    }

    fn at(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }
}

/// A second of noise of a level that tells the kind.
fn wav(path: &Path, number: usize) {
    let spec = hound::WavSpec {
        channels: 1,
        sample_rate: 8000,
        bits_per_sample: 16,
        sample_format: hound::SampleFormat::Int,
    };
    let mut writer = hound::WavWriter::create(path, spec).unwrap();
    for i in 0..8000_u32 {
        let noise = i.wrapping_add(number as u32).wrapping_mul(2_654_435_761) >> 19;
        writer.write_sample(noise as i16 >> (number % 2 * 4)).unwrap();
    }
    writer.finalize().unwrap();
}

/// Runs a command whose standard output nobody reads.
fn unread(arguments: &[&str]) -> Option<i32> {
    let (reader, writer) = std::io::pipe().unwrap();
    drop(reader);
    let mut child = tool().args(arguments).stdout(writer).stderr(Stdio::null()).spawn().unwrap();
    child.wait().unwrap().code()
}

/// Files that were to be written after the text were missing at exit code 0, and failures were successes.
#[test]
fn a_reader_that_goes_away_changes_no_file_and_no_exit_code() {
    let trained = Trained::new();
    let (table, report) = (trained.at("t.npz"), trained.at("report"));
    let validate = ["cross-validate", text(&table), "--labels", "folders", "--cv", "3"];
    // As a report leaves it that was killed at its first file.
    std::fs::create_dir(&report).unwrap();
    written(&report, ".report.json.unfinished-AbCdEf", "{");
    assert_eq!(unread(&[&validate[..], &["--report", text(&report)]].concat()), Some(0));
    assert!(report.join("report.html").is_file());
    let (one, picture) = (trained.at("audio/low/0.wav"), trained.at("p.svg"));
    assert_eq!(unread(&["inspect", text(&one), "--picture", text(&picture)]), Some(0));
    assert!(picture.is_file());
    let audio = trained.at("audio");
    written(&audio, "low/broken.wav", "RIFF");
    let out = trained.at("x.npz");
    let extract = ["extract", text(&audio), "-o", text(&out), "--preset", "esc26", "--json"];
    assert_eq!(unread(&extract), Some(1));
    assert_eq!(unread(&["inspect", text(&audio)]), Some(1));
    // It ends at the line that nobody reads, the first of which is of the broken file.
    let (model, broken) = (trained.at("m"), written(&audio, "a.wav", "RIFF"));
    assert_eq!(unread(&["classify", "-m", text(&model), text(&broken), text(&one)]), Some(1));
    assert_eq!(unread(&["classify", "-m", text(&model), text(&one)]), Some(0));
}

/// The partial table of a list took the place of a whole one.
#[test]
fn an_interrupted_list_writes_nothing() {
    let trained = Trained::new();
    let (out, pipe) = (trained.at("w.csv"), trained.at("open.wav"));
    assert!(Command::new("mkfifo").arg(&pipe).status().unwrap().success());
    let audio = trained.at("audio");
    let old = written(trained.0.path(), "w.csv", "old");
    let mut child = tool()
        .args(["classify", "-m", text(&trained.at("m")), text(&audio), text(&pipe)])
        .args(["--window", "0.5", "--hop", "0.5", "-j", "1", "--overwrite", "-o", text(&out)])
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    // Opened by both ends: the command has come to it.
    let held = std::fs::File::options().write(true).open(&pipe).unwrap();
    assert_eq!(crate::command::interrupt(&mut child), Some(130));
    drop(held);
    let message = std::io::read_to_string(child.stderr.take().unwrap()).unwrap();
    assert!(message.contains("interrupted; nothing was written"), "{message}");
    assert_eq!(std::fs::read_to_string(&old).unwrap(), "old");
}

/// A run over night ended with its terminal although `nohup` had begun it.
#[cfg(target_os = "linux")]
#[test]
fn nohup_is_heeded() {
    use std::io::{BufRead, BufReader, Read, Write};

    let trained = Trained::new();
    let bytes = std::fs::read(trained.at("audio/low/0.wav")).unwrap();
    // No shell hears again what was ignored when it began, as under `nohup cargo test`, which hung.
    let status = std::fs::read_to_string("/proc/self/status").unwrap();
    let ignored = status.lines().find_map(|line| line.strip_prefix("SigIgn:")).unwrap();
    let is_ignored = u64::from_str_radix(ignored.trim(), 16).unwrap() & 1 == 1;
    for (before, code) in [("trap '' HUP; ", 0), ("", 130)] {
        if code == 130 && is_ignored {
            eprintln!("skipped: hang-ups are ignored here");
            continue;
        }
        let script =
            format!("{before}exec \"$0\" classify -m \"$1\" --in - --window 0.5 --hop 0.5");
        let mut child = Command::new("sh")
            .args([OsStr::new("-c"), OsStr::new(&script)])
            .args([OsStr::new(env!("CARGO_BIN_EXE_corsmal-feat")), trained.at("m").as_os_str()])
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn()
            .unwrap();
        let mut stdin = child.stdin.take().unwrap();
        stdin.write_all(&bytes[..bytes.len() / 2 + 44]).unwrap();
        let mut stdout = BufReader::new(child.stdout.take().unwrap());
        let mut lines = [String::new(), String::new()];
        lines.iter_mut().for_each(|line| assert!(stdout.read_line(line).unwrap() > 0));
        let sent = Command::new("kill").args(["-HUP", &child.id().to_string()]).status().unwrap();
        assert!(sent.success());
        if code == 0 {
            stdin.write_all(&bytes[bytes.len() / 2 + 44..]).unwrap();
            drop(stdin);
        }
        let mut rest = String::new();
        stdout.read_to_string(&mut rest).unwrap();
        assert_eq!(child.wait().unwrap().code(), Some(code), "{rest}");
        assert_eq!(rest.lines().count(), usize::from(code == 0), "{rest}");
    }
}

/// JSON of a path that is no text panicked when all was written.
#[test]
fn names_that_are_no_text_are_said_as_well_as_can_be() {
    let trained = Trained::new();
    let name = |end: &str| {
        let name = [b"x\xff", end.as_bytes()].concat();
        trained.0.path().join(OsStr::from_bytes(&name))
    };
    let (table, audio) = (trained.at("t.npz"), trained.at("audio"));
    let (predictions, model) = (trained.at("p.csv"), trained.at("m"));
    let classify = ["classify", "-m", text(&model), text(&audio), "-q", "-o"];
    done(&[&classify[..], &[text(&predictions)]].concat());
    let shards: Vec<PathBuf> = (0..2).map(|i| name(&format!("{i}.npz"))).collect();
    for (i, shard) in shards.iter().enumerate() {
        let part = format!("{i}/2");
        let arguments = ["extract", text(&audio), "--preset", "esc26", "-q", "--shard", &part];
        assert!(tool().args(arguments).arg("-o").arg(shard).status().unwrap().success());
    }
    let said = |arguments: &[&str], paths: &[&Path], out: &Path| {
        let output = tool().args(arguments).args(paths).arg("-o").arg(out).arg("--json").output();
        let output = output.unwrap();
        let message = String::from_utf8_lossy(&output.stderr);
        assert!(output.status.success() && out.exists(), "{arguments:?}: {message}");
        let value: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
        assert_eq!(value["out"], out.display().to_string(), "{arguments:?}");
    };
    said(&["pca"], &[&table], &name("p.npz"));
    said(&["merge"], &[&shards[0], &shards[1]], &name("m.npz"));
    said(&["fuse"], &[&predictions, &predictions], &name("f.csv"));
    said(&["synth", "--small"], &[], &name("s"));
    let whole = trained.at("whole.npz");
    done(&["extract", text(&audio), "--preset", "esc26", "-q", "-o", text(&whole)]);
    assert!(std::fs::read(&whole).unwrap() == std::fs::read(name("m.npz")).unwrap());
}

/// That members may be missing was not said.
#[test]
fn quiet_runs_warn() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    wav(&at("a.wav"), 0);
    let mut tar = tar::Builder::new(Vec::new());
    tar.append_path_with_name(at("a.wav"), "a.wav").unwrap();
    let bytes = tar.into_inner().unwrap();
    // Without the blocks of zeros at its end.
    std::fs::write(at("cut.tar"), &bytes[..bytes.len() - 1024]).unwrap();
    let (cut, out) = (at("cut.tar"), at("o.npz"));
    let extract = ["extract", text(&cut), "-o", text(&out), "--preset", "esc26", "-q"];
    let output = run(&extract);
    let message = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(0));
    assert!(message.contains("warning: ") && message.contains("no end mark"), "{message}");
    let json = [&extract[..], &["--overwrite", "--log-format", "json"]].concat();
    let message = String::from_utf8(run(&json).stderr).unwrap();
    assert!(message.contains(r#""event":"warning""#), "{message}");
}

/// `merge --resume` named itself as the remedy, and a pipe was replaced; `train -o -` made a file called `-`.
#[test]
fn outputs_that_cannot_be_are_refused_in_words() {
    let trained = Trained::new();
    let (audio, out) = (trained.at("audio"), trained.at("all.npz"));
    let shard = trained.at("0.npz");
    done(&["extract", text(&audio), "--preset", "esc26", "-q", "-o", text(&shard)]);
    let refused = |arguments: &[&str], expected: &str| {
        let output = tool().args(arguments).current_dir(trained.0.path()).output().unwrap();
        let message = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(2), "{message}");
        assert!(message.contains(expected), "{message}");
    };
    let merge = ["merge", text(&shard), "-o"];
    done(&[&merge[..], &[text(&out)]].concat());
    let whole = "all.npz is whole: no interrupted merge is left";
    refused(&[&merge[..], &[text(&out), "--resume"]].concat(), whole);
    let pipe = trained.at("pipe.npz");
    assert!(Command::new("mkfifo").arg(&pipe).status().unwrap().success());
    let irregular = "pipe.npz exists and is not a regular file";
    refused(&[&merge[..], &[text(&pipe), "--overwrite"]].concat(), irregular);
    let table = trained.at("t.npz");
    let train = ["train", text(&table), "--labels", "folders", "-o"];
    refused(&[&train[..], &["-"]].concat(), "is not written to standard output");
    refused(&[&train[..], &["s3://bucket/m"]].concat(), "is written to a disk");
    let validate = ["cross-validate", text(&table), "--labels", "folders", "--report"];
    refused(&[&validate[..], &["s3://bucket/r"]].concat(), "is written to a disk");
    refused(&["synth", "--small", "-o", "-"], "is not written to standard output");
    let long = OsString::from("n".repeat(300));
    refused(&[&train[..], &[long.to_str().unwrap()]].concat(), "too long");
    let left = names(trained.0.path());
    assert!(!left.iter().any(|name| name == "-" || name.starts_with('.')), "{left:?}");
}
