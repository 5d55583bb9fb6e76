//! What cannot work is refused before work starts: exit code 2, one message, nothing written.

use std::path::Path;

use super::support::{ended, extract, extraction, wav};
use crate::command::{names, tool};

/// The one message of a refused run, which must have these words.
#[track_caller]
fn refused(input: &Path, out: &Path, more: &[&str], words: &[&str]) {
    let run = extract(input, out, more).with(2);
    assert!(run.stderr.starts_with("error: "), "{}", run.stderr);
    assert_eq!(run.stderr.matches("error: ").count(), 1, "{}", run.stderr);
    assert!(run.stdout.is_empty());
    for word in words {
        assert!(run.stderr.contains(word), "{word:?} is not in: {}", run.stderr);
    }
}

#[test]
fn impossible_values_name_key_value_and_what_is_allowed() {
    let folder = tempfile::tempdir().unwrap();
    let input = wav(&folder.path().join("a.wav"), 1, 4000, 1);
    let out = folder.path().join("feats.npz");
    for (set, words) in [
        ("mfcc.n_melz=4", &["features.mfcc.n_melz", "unknown", "n_mels"][..]),
        ("signal.chanels=mean", &["chanels", "channels"]),
        ("summary.stat=mean", &["stat"]),
        ("summary.stats=[\"mode\"]", &["mode", "median"]),
        ("summary.stats=[\"median\",\"p50\"]", &["summary.stats", "median", "twice"]),
        ("mfcc.hop_length=0", &["features.mfcc", "hop_length", "0", "at least 1"]),
        ("mfcc.n_fft=0", &["features.mfcc", "n_fft", "0", "1 to 16777216"]),
        ("mfcc.n_fft=-5", &["n_fft", "-5"]),
        ("mfcc.n_fft=1000000000000", &["n_fft", "1000000000000", "1 to 16777216"]),
        ("mfcc.n_mels=1000000000000", &["n_mels", "1000000000000", "at most"]),
        ("+rms rms.frame_length=1000000000000", &["frame_length", "1000000000000", "at most"]),
        ("mfcc.win_length=4096", &["win_length", "4096", "2048"]),
        ("mfcc.fmin=5000.0 mfcc.fmax=100.0", &["features.mfcc", "fm", "5000", "100"]),
        ("mfcc.window=hannn", &["features.mfcc.window", "hannn", "hamming"]),
        ("mfcc.pad_mode=wrap", &["features.mfcc.pad_mode", "wrap", "reflect"]),
        ("mfcc.top_db=-1", &["top_db", "-1"]),
        ("mfcc.amin=0", &["amin", "0"]),
        ("mfcc.power=3", &["power", "3", "1 or 2"]),
        ("mfcc.coefficients=[5,5]", &["coefficients", "first < end"]),
        ("mfcc.coefficients=[0,21]", &["coefficients", "21", "20 or before"]),
        ("+delta delta.of=nothing", &["features.delta.of", "nothing", "earlier"]),
        ("nonsense.kind=nonsense", &["nonsense", "mfcc"]),
        ("signal.sample_rate=-1", &["signal.sample_rate", "-1", "768000"]),
        ("signal.channels=left", &["signal.channels", "left", "downmix-7.1"]),
        ("signal.start=2 signal.end=1", &["signal.end", "1", "2"]),
        ("signal.preemphasis=nan", &["signal.preemphasis"]),
        ("signal.length=1e9", &["signal.length", "1000000000", "seconds"]),
        ("signal.sample_rate=8000 mfcc.fmin=4100.0", &["features.mfcc", "fmax", "4100"]),
        ("+delta delta.width=9223372036854775807", &["delta", "width", "at most"]),
        ("+x=onset_strength x.n_mels=1000000", &["n_mels", "1000000", "at most"]),
        ("+chroma_stft chroma_stft.n_chroma=1000000000", &["n_chroma", "at most"]),
        ("+chroma_cqt chroma_cqt.n_octaves=1000000000", &["n_octaves", "at most"]),
        ("+tonnetz tonnetz.n_octaves=9223372036854775807", &["n_octaves", "at most"]),
        ("+m3_spectrogram m3_spectrogram.n_fft=1000000000", &["n_fft", "1 to 16777216"]),
        ("+spec9216 spec9216.fixed_len=9223372036854775807", &["fixed_len", "at most"]),
        ("nonsense", &["--set nonsense", "key=value"]),
        ("rms.center=false", &["no feature rms", "mfcc.center=false or", "--add rms"]),
        ("sr=16000", &["did you mean signal.sample_rate=16000?"]),
        ("n_mels=64", &["did you mean mfcc.n_mels=64?"]),
        ("mfcc.n_mel=64", &["features.mfcc.n_mel", "did you mean \"n_mels\"?"]),
        ("mfcc.n_mels=many", &["features.mfcc.n_mels", "\"many\"", "a whole number"]),
        ("mfcc.center=1", &["features.mfcc.center", "true or false"]),
        ("signal.res_type=soxr", &["signal.res_type", "did you mean \"soxr_hq\"?"]),
        ("summary.stats=men", &["did you mean \"mean\"?"]),
        ("summary=3", &["expected a dotted key"]),
        ("+mfcc", &["already has mfcc"]),
        ("+mfc", &["did you mean \"mfcc\"?"]),
    ] {
        let mut more = vec!["--preset", "mfcc-zcr"];
        more.extend(set.split(' ').flat_map(|change| match change.strip_prefix('+') {
            Some(feature) => ["--add", feature],
            None => ["--set", change],
        }));
        refused(&input, &out, &more, words);
    }
    assert_eq!(names(folder.path()), ["a.wav"]);
}

#[test]
fn wrong_names_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let input = wav(&folder.path().join("a.wav"), 1, 4000, 1);
    let at = |name: &str| folder.path().join(name);
    let out = at("feats.npz");
    std::fs::create_dir(at("empty")).unwrap();
    std::fs::create_dir(at("folder.npz")).unwrap();
    std::fs::write(at("broken.toml"), "[features.mfcc\n").unwrap();
    std::fs::write(at("none.toml"), "[signal]\n").unwrap();
    std::fs::write(at("list.csv"), "path,start\na.wav,soon\n").unwrap();
    std::fs::write(at("gone.csv"), "path\ngone.wav\n").unwrap();

    refused(&at("gone.wav"), &out, &[], &["gone.wav", "no such file"]);
    refused(&at("empty"), &out, &[], &["empty", "audio extension"]);
    refused(&at("*.flac"), &out, &[], &["*.flac", "no"]);
    refused(&at("list.csv"), &out, &[], &["list.csv, line 2", "start", "soon"]);
    refused(&at("gone.csv"), &out, &[], &["gone.csv, line 2", "gone.wav"]);
    refused(&input, &out, &["--in", input.to_str().unwrap()], &["a.wav"]);
    refused(&input, &out, &["--preset", "nope"], &["nope", "logmel", "esc26"]);
    refused(&input, &out, &["--config", at("gone.toml").to_str().unwrap()], &["gone.toml"]);
    refused(&input, &out, &["--config", at("broken.toml").to_str().unwrap()], &["broken.toml"]);
    refused(&input, &out, &["--config", at("none.toml").to_str().unwrap()], &["features"]);
    for dry in [&[][..], &["--dry-run"]] {
        refused(&input, &at("nowhere/feats.npz"), dry, &["nowhere/feats.npz", "no folder"]);
        refused(&input, &at("folder.npz"), dry, &["folder.npz", "is a folder"]);
    }
    refused(&input, &input, &["--overwrite"], &["a.wav", ".npz"]);
    refused(&input, &at("folder.npz"), &["--overwrite"], &["folder.npz", "is a folder"]);
    refused(&input, &at("feats.csv"), &[], &["feats.csv", ".npz", ".parquet"]);
    refused(&input, &at("feats"), &[], &["feats", ".npz", ".parquet"]);
    let complex = &["--add", "stft", "--set", "stft.output=complex"];
    refused(&input, &at("feats.parquet"), complex, &["feats.parquet", "complex", ".npz"]);
    if cfg!(target_os = "linux") {
        // Not even root can write there.
        refused(&input, Path::new("/proc/feats.npz"), &[], &["/proc/feats.npz"]);
    }
    let before = ["a.wav", "broken.toml", "empty", "folder.npz", "gone.csv", "list.csv"];
    assert_eq!(names(folder.path()), [&before[..], &["none.toml"]].concat());
}

#[test]
fn arguments_that_clap_refuses_end_with_two_as_well() {
    let folder = tempfile::tempdir().unwrap();
    let input = wav(&folder.path().join("a.wav"), 1, 4000, 1);
    let out = folder.path().join("feats.npz");
    for more in [
        &["--shard", "2/2"][..],
        &["--jobs", "0"],
        &["--jobs", "1025"],
        &["--shard", "x"],
        &["--max-errors", "-1"],
        &["--strict", "--max-errors", "3"],
        &["--log-format", "xml"],
        &["--preset", "logmel", "--config", "x.toml"],
        &["--unknown"],
    ] {
        let run = extract(&input, &out, more).with(2);
        assert!(run.stderr.starts_with("error: "), "{}", run.stderr);
    }
    ended(tool().arg("extract")).with(2);
    assert!(!out.exists());
}

#[test]
fn an_output_of_something_else_is_kept() {
    let folder = tempfile::tempdir().unwrap();
    let input = wav(&folder.path().join("a.wav"), 1, 4000, 1);
    let other = wav(&folder.path().join("b.wav"), 1, 4000, 2);
    let out = folder.path().join("feats.npz");
    extract(&input, &out, &["--preset", "mfcc-zcr"]).with(0);
    let bytes = std::fs::read(&out).unwrap();
    let exists = "another configuration";
    refused(&input, &out, &["--preset", "esc26"], &["feats.npz", exists, "--overwrite"]);
    refused(&other, &out, &["--preset", "mfcc-zcr"], &["feats.npz", "other inputs"]);
    wav(&input, 1, 4001, 1);
    refused(&input, &out, &["--preset", "mfcc-zcr"], &["feats.npz", "changed"]);
    assert_eq!(std::fs::read(&out).unwrap(), bytes);
    extract(&input, &out, &["--preset", "esc26", "--overwrite"]).with(0);
    assert_ne!(std::fs::read(&out).unwrap(), bytes);

    let shard = folder.path().join("shard.npz");
    extract(&input, &shard, &[]).with(0);
    std::fs::write(&out, "my thesis").unwrap();
    refused(&input, &out, &[], &["feats.npz", "not an output of this tool"]);
    let merge = |out: &Path, more: &[&str]| {
        ended(tool().arg("merge").arg(&shard).arg("--out").arg(out).args(more))
    };
    let refusal = merge(&out, &[]).with(2).stderr;
    assert!(refusal.contains("feats.npz exists; --overwrite"), "{refusal}");
    let refusal = merge(&folder.path().join("feats.txt"), &[]).with(2).stderr;
    assert!(refusal.contains("feats.txt: must end in .npz or .parquet"), "{refusal}");
    assert_eq!(std::fs::read(&out).unwrap(), b"my thesis");
    merge(&out, &["--overwrite"]).with(0);
    assert!(std::fs::read(&out).unwrap() == std::fs::read(&shard).unwrap());
    assert_eq!(names(folder.path()), ["a.wav", "b.wav", "feats.npz", "shard.npz"]);
}

#[test]
fn no_space_is_an_error_and_the_run_can_go_on() {
    if !cfg!(unix) {
        println!("skipped: no ulimit");
        return;
    }
    let folder = super::support::folder(30);
    let input = folder.path().join("audio");
    wav(&input.join("long.wav"), 2, 420_000, 1);
    std::fs::create_dir(folder.path().join("full")).unwrap();
    // The long recording's values, 25 MiB, go to a temporary file before they are summarised.
    let summary = &["--set", "melspectrogram.hop_length=16", "--set", "summary.stats=[\"mean\"]"];
    for (name, more, place) in
        [("frames", &[][..], "frames.npz"), ("rows", summary, "full: temporary file")]
    {
        let out = folder.path().join(format!("full/{name}.npz"));
        let whole = folder.path().join(format!("{name}.npz"));
        // A limit on the size of files stands for a full disk.
        let limited = extraction(&input, &out, more);
        let mut shell = std::process::Command::new("sh");
        shell.args(["-c", "trap '' XFSZ; ulimit -f 256; exec \"$0\" \"$@\""]);
        shell.arg(limited.get_program()).args(limited.get_args());
        let run = ended(&mut shell).with(2);
        assert_eq!(run.stderr.matches("error: ").count(), 1, "{}", run.stderr);
        assert!(run.stderr.contains(place), "{}", run.stderr);
        assert!(!out.exists());
        extract(&input, &out, &[more, &["--resume"]].concat()).with(0);
        extract(&input, &whole, more).with(0);
        assert!(std::fs::read(&out).unwrap() == std::fs::read(&whole).unwrap());
    }
}
