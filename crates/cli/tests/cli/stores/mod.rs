//! Recordings in stores: the same numbers as from a folder, whatever the network does.

mod interrupts;
mod listing;
mod loopback;
mod outputs;

use std::ffi::OsStr;
use std::fs;
use std::path::{Path, PathBuf};

use corsmal_files::npz::NpzFile;
use corsmal_files::outcome::{Outcome, Status};
use tempfile::TempDir;

use crate::command::refused;
use crate::extract::support::{Ended, ended, extract, table, wav};
use loopback::{Fault, Loopback};

/// Recordings in a folder, and in the bucket `lab` below the same names.
struct Twins {
    folder: TempDir,
    store: Loopback,
}

impl Twins {
    fn new() -> Self {
        let twins = Self { folder: tempfile::tempdir().unwrap(), store: Loopback::start() };
        for (name, frames) in [
            ("audio/a.wav", 8000),
            ("audio/b/c d%.wav", 5000),
            ("audio/b/e&ü.wav", 9000),
            ("audio/f.wav", 4000),
        ] {
            twins.wav(name, 2, frames);
        }
        twins.file("audio/.hidden/g.wav", b"no recording");
        twins.file("audio/notes.txt", b"no recording");
        twins
    }

    fn at(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    fn wav(&self, name: &str, channels: u16, frames: usize) -> Vec<u8> {
        let bytes = fs::read(wav(&self.at(name), channels, frames, frames as u32)).unwrap();
        self.store.put(&format!("lab/{name}"), &bytes);
        bytes
    }

    fn file(&self, name: &str, bytes: &[u8]) {
        fs::create_dir_all(self.at(name).parent().unwrap()).unwrap();
        fs::write(self.at(name), bytes).unwrap();
        self.store.put(&format!("lab/{name}"), bytes);
    }

    fn local(&self, input: &str, out: &str, more: &[&str]) -> Ended {
        extract(&self.at(input), &self.at(out), more)
    }

    fn stored(&self, input: impl AsRef<OsStr>, out: &str, more: &[&str]) -> Ended {
        let mut command = self.store.tool();
        command.args([OsStr::new("extract"), "--in".as_ref(), input.as_ref(), "--out".as_ref()]);
        ended(command.arg(self.at(out)).args(more))
    }
}

/// Outcomes without what tells where the bytes were.
fn apart(out: &Path) -> Vec<Outcome> {
    let mut outcomes = table(out).outcomes().to_vec();
    for outcome in &mut outcomes {
        outcome.path.clear();
        outcome.identity.clear();
    }
    outcomes
}

#[track_caller]
fn assert_same_table(stored: &Path, local: &Path) {
    let (found, expected) = (table(stored), table(local));
    assert_eq!(found.ids(), expected.ids());
    assert_eq!(found.feature_names(), expected.feature_names());
    let bits = |t: &corsmal_files::table::Table| t.values().map(|x| x.to_bits());
    assert_eq!(bits(&found), bits(&expected));
    assert!(found.labels().eq(expected.labels()));
    assert_eq!(apart(stored), apart(local));
}

#[test]
fn a_bucket_gives_the_bytes_of_a_folder() {
    let twins = Twins::new();
    for (name, faults) in [
        ("lab/audio/a.wav", vec![Fault::Broken, Fault::Busy, Fault::Broken]),
        ("lab/audio/b/c d%.wav", vec![Fault::Slow]),
        ("lab/audio/f.wav", vec![Fault::Busy]),
    ] {
        twins.store.fail(name, &faults);
    }
    twins.local("audio", "local.npz", &[]).with(0);
    twins.stored("s3://lab/audio/", "stored.npz", &[]).with(0);
    assert_eq!(twins.store.unsigned(), 0);
    let mut local = NpzFile::open(&twins.at("local.npz")).unwrap();
    let mut stored = NpzFile::open(&twins.at("stored.npz")).unwrap();
    let names = local.names().to_vec();
    assert_eq!(stored.names(), names);
    for name in names.iter().filter(|name| !name.starts_with("__")) {
        let read = |file: &mut NpzFile| {
            let mut bytes = Vec::new();
            std::io::Read::read_to_end(&mut file.raw(name).unwrap().1, &mut bytes).unwrap();
            bytes
        };
        assert_eq!(read(&mut stored), read(&mut local), "{name}");
    }
    assert_eq!(apart(&twins.at("stored.npz")), apart(&twins.at("local.npz")));
    let first = table(&twins.at("stored.npz")).outcomes()[0].clone();
    assert_eq!(first.path, "s3://lab/audio/a.wav");
    assert!(first.identity.contains(":etag:"), "{}", first.identity);

    // A finished run asks for no object again.
    twins.store.asked();
    let again = twins.stored("s3://lab/audio/", "stored.npz", &[]).with(0);
    assert!(again.stderr.contains("up to date"), "{}", again.stderr);
    assert_eq!(twins.store.asked(), Vec::<String>::new());
    twins.wav("audio/a.wav", 2, 8001);
    let changed = twins.stored("s3://lab/audio/", "stored.npz", &[]).with(2);
    assert!(changed.stderr.contains("changed since"), "{}", changed.stderr);
}

#[test]
fn names_globs_and_lists_find_what_a_disk_has() {
    let twins = Twins::new();
    twins.local("audio", "local.npz", &["--preset", "mfcc-zcr"]).with(0);
    let ids = |input: &str| {
        twins.stored(input, "x.npz", &["--preset", "mfcc-zcr", "--overwrite"]).with(0);
        table(&twins.at("x.npz")).ids().to_vec()
    };
    for name in ["lab/list.csv", "lab/x.tar.gz"] {
        twins.store.put(name, b"path\n");
    }
    let all = ["a", "b/c d%", "b/e&ü", "f"];
    assert_eq!(ids("s3://lab/audio"), all, "without its slash");
    assert_same_table(&twins.at("x.npz"), &twins.at("local.npz"));
    assert_eq!(ids("s3://lab"), all.map(|id| format!("audio/{id}")));
    assert_eq!(ids("s3://lab/audio/**/*.wav"), all);
    assert_eq!(ids("s3://lab/audio/*.wav"), ["a", "f"]);
    assert_eq!(ids("s3://lab/audi?/b"), ["audio/b/c d%", "audio/b/e&ü"]);
    assert_eq!(ids("s3://lab/audio/{f,a}.wav"), ["f", "a"]);
    // An object of that very name comes first, and archives in matched folders are passed over.
    let bytes = fs::read(twins.at("audio/a.wav")).unwrap();
    for name in ["lab/odd/x[1].wav", "lab/odd/x1.wav", "lab/odd/{a,b}.wav", "lab/data/a.wav"] {
        twins.store.put(name, &bytes);
    }
    twins.store.put("lab/data/old.tar", b"no archive");
    assert_eq!(ids("s3://lab/odd/x[1].wav"), ["x[1]"]);
    assert_eq!(ids("s3://lab/odd/{a,b}.wav"), ["{a,b}"]);
    assert_eq!(ids("s3://lab/dat*"), ["data/a"]);
    for (input, reason) in [
        ("s3://lab/none/", "no file with an audio extension"),
        ("s3://lab/none.wav", "no such file"),
        ("s3://lab/list.csv", "manifests are read from files"),
        ("s3://lab/a/../b.wav", "s3://lab/a/../b.wav: "),
        ("http://127.0.0.1:9/audio/", "no file with an audio extension"),
    ] {
        twins.store.put("lab/list.csv", b"path\n");
        let run = twins.stored(input, "y.npz", &[]);
        assert!(run.code == Some(2) || input.starts_with("http"), "{input}: {}", run.stderr);
        assert!(
            run.stderr.contains(reason) || input.starts_with("http"),
            "{input}: {}",
            run.stderr
        );
    }
}

#[test]
fn long_recordings_are_cut_and_read_by_ranges() {
    let twins = Twins::new();
    // Three spans of 2^20 frames, 13 MB.
    twins.wav("long/x.wav", 2, 3_300_000);
    let rows = ["--preset", "mfcc-zcr", "--jobs", "2"];
    twins.store.fail("lab/long/x.wav", &[Fault::Broken, Fault::Broken]);
    twins.local("long", "local.npz", &rows).with(0);
    twins.stored("s3://lab/long/", "stored.npz", &rows).with(0);
    assert_same_table(&twins.at("stored.npz"), &twins.at("local.npz"));
    let asked = twins.store.asked();
    let longest = asked.iter().filter_map(|asked| {
        let (first, last) = asked.split_once("bytes=")?.1.split_once('-')?;
        Some(last.parse::<u64>().ok()? - first.parse::<u64>().ok()? + 1)
    });
    assert_eq!(longest.max(), Some(4 << 20));
}

#[test]
fn an_object_that_is_replaced_while_it_is_read_has_changed() {
    let twins = Twins::new();
    let bytes = twins.wav("audio/a.wav", 2, 2_000_000);
    let mut other = bytes.clone();
    other[1000] ^= 1;
    // The header of the survey, the first block; the second finds another object.
    for jobs in ["1", "2"] {
        twins.store.put("lab/audio/a.wav", &bytes);
        let answers = [Fault::Slow, Fault::Slow, Fault::Replaced(other.clone())];
        twins.store.fail("lab/audio/a.wav", &answers);
        let more = ["--preset", "mfcc-zcr", "--overwrite", "--jobs", jobs];
        twins.stored("s3://lab/audio/", "x.npz", &more).with(1);
        let found = table(&twins.at("x.npz")).outcomes().to_vec();
        let statuses: Vec<Status> = found.iter().map(|o| o.status).collect();
        assert_eq!(statuses, [Status::Changed, Status::Ok, Status::Ok, Status::Ok], "{found:?}");
        assert_eq!(found[0].reason, "was replaced by another object while it was read");
        assert_eq!(found[0].identity, "");
    }
    // One whose bytes never come is worth another try, and the others are there.
    twins.store.fail("lab/audio/f.wav", &vec![Fault::Broken; 100]);
    let run = twins.stored(
        "s3://lab/audio/",
        "y.npz",
        &["--preset", "esc26", "--set", "signal.channels=mean"],
    );
    let found = table(&twins.at("y.npz")).outcomes().to_vec();
    assert_eq!(found[3].status, Status::Io, "{}", run.with(1).stderr);
    assert!(found[3].reason.contains("the store failed"), "{}", found[3].reason);
}

#[test]
fn shards_in_a_bucket_give_the_rows_of_shards_on_a_disk() {
    let twins = Twins::new();
    let path = twins.at("shards/0.tar");
    fs::create_dir_all(path.parent().unwrap()).unwrap();
    let mut tar = tar::Builder::new(fs::File::create(&path).unwrap());
    tar.append_path_with_name(twins.at("audio/a.wav"), "x.wav").unwrap();
    fs::write(twins.at("x.json"), "{\"type\": \"rice\", \"n\": 3}").unwrap();
    tar.append_path_with_name(twins.at("x.json"), "x.json").unwrap();
    tar.append_path_with_name(twins.at("audio/f.wav"), "deep/y.wav").unwrap();
    tar.into_inner().unwrap();
    let bytes = fs::read(&path).unwrap();
    twins.store.put("lab/shards/0.tar", &bytes);
    let rows = ["--preset", "mfcc-zcr"];
    twins.local("shards/{0..0}.tar", "local.npz", &rows).with(0);
    twins.stored("s3://lab/shards/{0..0}.tar", "stored.npz", &rows).with(0);
    assert_same_table(&twins.at("stored.npz"), &twins.at("local.npz"));
    assert_eq!(table(&twins.at("stored.npz")).ids(), ["0/x", "0/deep/y"]);

    // Members lie where they lay when the headers were read.
    let mut other = bytes.clone();
    other[2000] ^= 1;
    let members = [Fault::Slow, Fault::Slow, Fault::Slow, Fault::Replaced(other)];
    twins.store.fail("lab/shards/0.tar", &members);
    twins.stored("s3://lab/shards/*.tar", "x.npz", &["--preset", "mfcc-zcr"]).with(1);
    let found = table(&twins.at("x.npz")).outcomes().to_vec();
    assert!(found.iter().any(|outcome| outcome.status == Status::Changed), "{found:?}");
}

#[test]
fn manifests_name_objects_files_and_web_addresses() {
    let twins = Twins::new();
    let bytes = fs::read(twins.at("audio/f.wav")).unwrap();
    twins.store.put("web/f 1.wav", &bytes);
    let web = twins.store.web("f%201.wav?signature=the-web-secret");
    let none = twins.store.web("none.wav");
    let rows = |names: [&str; 5]| {
        let lines = names.map(|name| format!("{name},rice"));
        format!(
            "path,type,start,end\n{},,\n{},0.1,0.2\n{},0.3,0.4\n{},,\n{},,\n",
            lines[0], lines[1], lines[2], lines[3], lines[4]
        )
    };
    fs::write(
        twins.at("stored.csv"),
        rows([
            "s3://lab/audio/a.wav",
            "s3://lab/audio/b/e&ü.wav",
            "s3://lab/audio/b/e&ü.wav",
            &web,
            &none,
        ]),
    )
    .unwrap();
    let run = twins.stored(twins.at("stored.csv"), "stored.npz", &["--preset", "mfcc-zcr"]).with(1);
    let found = table(&twins.at("stored.npz"));
    assert_eq!(found.ids(), ["audio/a", "audio/b/e&ü@0.1-0.2", "audio/b/e&ü@0.3-0.4", "web/f%201"]);
    let last = &found.outcomes()[4];
    assert_eq!((last.id.as_str(), last.status), ("web/none", Status::Io));
    assert!(last.reason.contains("no such object"), "{}", last.reason);
    fs::write(
        twins.at("local.csv"),
        rows([
            "audio/a.wav",
            "audio/b/e&ü.wav",
            "audio/b/e&ü.wav",
            "audio/f.wav",
            "audio/b/c d%.wav",
        ]),
    )
    .unwrap();
    twins.local("local.csv", "local.npz", &["--preset", "mfcc-zcr"]).with(0);
    let local = table(&twins.at("local.npz"));
    for i in 0..4 {
        assert_eq!(found.values().row(i), local.values().row(i), "{i}");
    }
    // What signs an address stands nowhere.
    let told = format!("{}{}{:?}", run.stdout, run.stderr, found.outcomes());
    assert!(!told.contains("the-web-secret") && told.contains("/web/f%201.wav"), "{told}");

    let first = "path,start,end\ns3://lab/audio/a.wav,0,0.1\ns3://lab/audio/a.wav,0.1,0.2\n";
    fs::write(twins.at("first.csv"), first).unwrap();
    twins.stored(twins.at("first.csv"), "first.npz", &["--preset", "mfcc-zcr"]).with(0);
    assert_eq!(table(&twins.at("first.npz")).ids(), ["audio/a@0.0-0.1", "audio/a@0.1-0.2"]);

    // Recordings that only their queries tell apart are groups of their own, with windows and without.
    let (one, two) = (twins.store.web("f%201.wav?v=1"), twins.store.web("f%201.wav?v=2"));
    let rows = format!("id,path,start,end\na,{one},0,0.1\nb,{one},0.1,0.2\nc,{two},0,0.1\n");
    fs::write(twins.at("queries.csv"), &rows).unwrap();
    for (name, options) in [("whole.npz", &[][..]), ("cut.npz", &["--window", "0.1"])] {
        let options = [&["--preset", "mfcc-zcr"], options].concat();
        twins.stored(twins.at("queries.csv"), name, &options).with(0);
        let found = table(&twins.at(name));
        let (_, groups) = found.labels().find(|(label, _)| *label == "recording").unwrap();
        assert_eq!(groups, ["a", "a", "c"], "{name}");
    }

    fs::write(twins.at("tar.csv"), "path\ns3://lab/s.tar\n").unwrap();
    let run = twins.stored(twins.at("tar.csv"), "x.npz", &[]).with(2);
    assert!(
        run.stderr.contains("line 2") && run.stderr.contains("give it as an input"),
        "{}",
        run.stderr
    );
}

#[test]
fn a_store_that_refuses_is_told_before_the_run_and_nothing_secret_is() {
    let twins = Twins::new();
    let denied = |name: &str| twins.store.fail(name, &vec![Fault::Denied; 10]);
    denied("lab/audio/a.wav");
    let run = twins.stored("s3://lab/audio/", "x.npz", &["--preset", "mfcc-zcr", "-vv"]);
    let run = if run.code == Some(2) {
        twins.stored("s3://lab/audio/", "x.npz", &["--preset", "mfcc-zcr"])
    } else {
        run
    };
    let run = run.with(1);
    assert!(run.stderr.contains("403 Forbidden (AccessDenied)"), "{}", run.stderr);
    let mut told = format!("{}{}", run.stdout, run.stderr).into_bytes();
    told.extend(fs::read(twins.at("x.npz")).unwrap());
    let told = String::from_utf8_lossy(&told);
    for secret in ["the-key-id", "the-secret-key", "the-session-token", "Signature"] {
        assert!(!told.contains(secret), "{secret}");
    }
    // No store at all.
    let mut command = twins.store.tool();
    command.env("AWS_ENDPOINT_URL", "http://127.0.0.1:9").args(["extract", "s3://lab/audio/"]);
    let run = ended(command.args([OsStr::new("-o"), twins.at("y.npz").as_ref()])).with(2);
    assert!(run.stderr.contains("Connection refused"), "{}", run.stderr);
    assert!(refused(&["extract", "hdfs://n/x.wav", "-o", "z.npz"]).contains("hdfs://n/x.wav: "));
}
