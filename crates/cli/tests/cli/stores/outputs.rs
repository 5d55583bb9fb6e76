//! Outputs in stores: the bytes of a file, whole or not there.

use std::process::Stdio;
use std::time::Duration;

use super::*;
use crate::command::{interrupt, names};

const SUMMARY: [&str; 2] = ["--preset", "mfcc-zcr"];

impl Twins {
    /// `extract` of the local folder into the store, made in the folder `work`.
    fn send(&self, out: &str, more: &[&str]) -> std::process::Command {
        fs::create_dir_all(self.at("work")).unwrap();
        let mut command = self.store.tool();
        command.args([OsStr::new("extract"), self.at("audio").as_ref(), "--out".as_ref()]);
        command.args([OsStr::new(out), "--work".as_ref(), self.at("work").as_ref()]).args(more);
        command
    }

    fn left(&self) -> Vec<String> {
        names(&self.at("work"))
    }
}

#[test]
fn an_output_in_a_bucket_has_the_bytes_of_a_file() {
    let twins = Twins::new();
    // 25 MB of frames, which go in parts; a table, which goes at once.
    twins.wav("audio/long.wav", 2, 1_600_000);
    let frames = ["--add", "stft", "--set", "stft.output=magnitude"];
    for (name, more) in [
        ("frames.npz", &frames[..]),
        ("frames.parquet", &frames[..]),
        ("table.npz", &SUMMARY[..]),
        ("table.parquet", &SUMMARY[..]),
    ] {
        twins.local("audio", name, more).with(0);
        let uri = format!("s3://lab/out/{name}");
        let ran = ended(&mut twins.send(&uri, more)).with(0);
        assert!(ran.stderr.contains(&uri), "{}", ran.stderr);
        let key = format!("lab/out/{name}");
        let sent = twins.store.get(&key).unwrap();
        assert!(sent == fs::read(twins.at(name)).unwrap(), "{name}");
        assert_eq!(twins.left(), Vec::<String>::new(), "{name}");
        let parts = sent.len() > 8 << 20;
        assert_eq!(parts, name.starts_with("frames"), "{name}: {} bytes", sent.len());
        let asked = twins.store.asked();
        let puts = asked.iter().filter(|asked| asked.starts_with("PUT")).count();
        assert_eq!(puts > 1, parts, "{asked:?}");
        // Again: it is looked at, and nothing is done.
        let again = ended(&mut twins.send(&uri, more)).with(0);
        assert!(again.stderr.contains("up to date"), "{}", again.stderr);
        assert!(!twins.store.asked().iter().any(|asked| asked.starts_with("PUT")));
        assert_eq!(twins.left(), Vec::<String>::new(), "{name}");
    }
    assert_eq!((twins.store.unsigned(), twins.store.uploads()), (0, 0));
}

#[test]
fn what_is_there_stays_unless_it_may_be_replaced() {
    let twins = Twins::new();
    let uri = "s3://lab/out/x.parquet";
    twins.store.put("lab/out/x.parquet", b"of somebody else");
    let refused = ended(&mut twins.send(uri, &SUMMARY)).with(2);
    assert!(
        refused.stderr.contains("s3://lab/out/x.parquet exists and is not an output"),
        "{}",
        refused.stderr
    );
    ended(&mut twins.send(uri, &[&SUMMARY[..], &["--overwrite"]].concat())).with(0);
    // With --resume, what is right already is not made again.
    let both = [&SUMMARY[..], &["--overwrite", "--resume"]].concat();
    let again = ended(&mut twins.send(uri, &both)).with(0);
    assert!(again.stderr.contains("up to date"), "{}", again.stderr);
    let refused =
        ended(&mut twins.send(uri, &["--preset", "esc26", "--set", "signal.channels=mean"]))
            .with(2);
    assert!(refused.stderr.contains("another configuration"), "{}", refused.stderr);
    twins.wav("audio/a.wav", 2, 8100);
    let refused = ended(&mut twins.send(uri, &SUMMARY)).with(2);
    assert!(refused.stderr.contains("have changed since"), "{}", refused.stderr);
    assert_eq!(twins.left(), Vec::<String>::new());
    for (out, reason) in [
        ("s3://lab/out/", "must end in .npz or .parquet"),
        ("s3://lab/x.csv", "must end in .npz or .parquet"),
        ("https://host/x.npz?secret", "outputs cannot be written"),
        ("https://host/x.npz", "outputs cannot be written"),
        ("hdfs://n/x.npz", "must begin with one of"),
        ("s3://lab//x.npz", "begins with a slash"),
    ] {
        let refused = ended(&mut twins.send(out, &SUMMARY)).with(2);
        assert!(refused.stderr.contains(reason), "{out}: {}", refused.stderr);
        assert!(!refused.stderr.contains("secret"), "{out}: {}", refused.stderr);
    }
}

#[test]
fn an_output_that_did_not_arrive_is_sent_again() {
    let twins = Twins::new();
    twins.local("audio", "x.npz", &SUMMARY).with(0);
    let (uri, key) = ("s3://lab/out/x.npz", "PUT lab/out/x.npz");
    twins.store.fail(key, &vec![Fault::Denied; 9]);
    let failed = ended(&mut twins.send(uri, &SUMMARY)).with(2);
    let told = "denied access: 403 Forbidden (AccessDenied); the finished output is in ";
    assert!(
        failed.stderr.contains(told) && failed.stderr.contains("to send it"),
        "{}",
        failed.stderr
    );
    assert_eq!((twins.left().len(), twins.store.get("lab/out/x.npz")), (1, None));
    // Killed while it is on its way.
    twins.store.fail(key, &[Fault::Silent]);
    twins.store.asked();
    let mut sending = twins.send(uri, &SUMMARY).stderr(Stdio::null()).spawn().unwrap();
    while !twins.store.asked().iter().any(|asked| asked.starts_with(key)) {
        assert!(sending.try_wait().unwrap().is_none(), "it should wait");
        std::thread::sleep(Duration::from_millis(5));
    }
    sending.kill().unwrap();
    sending.wait().unwrap();
    // Interrupted there.
    twins.store.fail(key, &[Fault::Silent]);
    let mut sending = twins.send(uri, &SUMMARY).stderr(Stdio::null()).spawn().unwrap();
    while !twins.store.asked().iter().any(|asked| asked.starts_with(key)) {
        std::thread::sleep(Duration::from_millis(5));
    }
    assert_eq!(interrupt(&mut sending), Some(130));
    assert_eq!((twins.left().len(), twins.store.get("lab/out/x.npz")), (1, None));
    twins.store.fail(key, &[Fault::Busy]);
    let sent = ended(&mut twins.send(uri, &SUMMARY)).with(0);
    assert!(!sent.stderr.contains("up to date"), "{}", sent.stderr);
    assert!(twins.store.get("lab/out/x.npz").unwrap() == fs::read(twins.at("x.npz")).unwrap());
    assert_eq!(twins.left(), Vec::<String>::new());
}

#[test]
fn a_run_that_is_killed_goes_on_to_the_same_object() {
    let twins = Twins::new();
    for i in 0..40 {
        twins.wav(&format!("audio/more/{i:02}.wav"), 2, 20_000 + i);
    }
    twins.local("audio", "x.npz", &[]).with(0);
    let uri = "s3://lab/out/x.npz";
    let resume = ["--resume", "--jobs", "1"];
    for kills in [5, 20] {
        let mut run = twins.send(uri, &resume).stderr(Stdio::null()).spawn().unwrap();
        let done = || {
            let ledger = twins.left().into_iter().find(|name| name.ends_with(".ledger"));
            let text = ledger.map(|name| fs::read(twins.at("work").join(name)).unwrap_or_default());
            text.unwrap_or_default().iter().filter(|byte| **byte == b'\n').count()
        };
        while done() < kills && run.try_wait().unwrap().is_none() {
            std::thread::sleep(Duration::from_millis(1));
        }
        run.kill().unwrap();
        run.wait().unwrap();
        assert_eq!(twins.store.get("lab/out/x.npz"), None, "too fast for the test");
    }
    let pending = ended(&mut twins.send(uri, &[])).with(2);
    assert!(pending.stderr.contains("--resume continues it"), "{}", pending.stderr);
    ended(&mut twins.send(uri, &resume)).with(0);
    assert!(twins.store.get("lab/out/x.npz").unwrap() == fs::read(twins.at("x.npz")).unwrap());
    assert_eq!(twins.left(), Vec::<String>::new());
}

#[test]
fn shards_in_a_bucket_are_merged_into_the_object_of_one_run() {
    let twins = Twins::new();
    for (name, more) in [("x.npz", &[][..]), ("x.parquet", &SUMMARY[..])] {
        twins.local("audio", name, more).with(0);
        let part = |i| format!("s3://lab/parts/{i}-{name}");
        for (i, shard) in ["0/2", "1/2"].iter().enumerate() {
            ended(&mut twins.send(&part(i), &[more, &["--shard", shard]].concat())).with(0);
        }
        let out = format!("s3://lab/out/{name}");
        let merge = |more: &[&str]| {
            let mut command = twins.store.tool();
            command.arg("merge").args([part(1), part(0)]).args(["--out", &out]);
            command.arg("--work").arg(twins.at("work")).args(more);
            ended(&mut command)
        };
        twins.store.fail(&format!("PUT lab/out/{name}"), &[Fault::Denied]);
        assert!(merge(&[]).with(2).stderr.contains("the finished output is in"));
        merge(&["--resume"]).with(0);
        assert!(
            twins.store.get(&format!("lab/out/{name}")).unwrap()
                == fs::read(twins.at(name)).unwrap()
        );
        assert_eq!(twins.left(), Vec::<String>::new(), "{name}");
        assert!(merge(&[]).with(2).stderr.contains(&format!("{out} exists")));
        merge(&["--overwrite"]).with(0);
        assert_eq!(twins.left(), Vec::<String>::new(), "{name}");
        // A shard is named as it was given, not its copy, which is gone by now.
        let mut command = twins.store.tool();
        command.arg("merge").arg(part(1)).args(["--out", "s3://lab/out/one.npz"]);
        let said = ended(command.arg("--work").arg(twins.at("work"))).with(2).stderr;
        assert!(said.contains(&part(1)) && !said.contains("-merge-"), "{said}");
    }
}

#[test]
fn a_merge_leaves_an_unsent_output_of_extract_alone() {
    let twins = Twins::new();
    let (part, out) = ("s3://lab/parts/x.npz", "s3://lab/out/x.npz");
    ended(&mut twins.send(part, &[])).with(0);
    twins.store.fail("PUT lab/out/x.npz", &[Fault::Denied]);
    ended(&mut twins.send(out, &[])).with(2);
    let left = twins.left();
    assert_eq!(left.len(), 1, "{left:?}");
    let file = twins.at("work").join(&left[0]);
    fs::write(&file, "not to be lost").unwrap();
    let mut command = twins.store.tool();
    command.args(["merge", part, "--out", out, "--work"]).arg(twins.at("work"));
    ended(&mut command).with(0);
    assert_eq!(twins.left(), left);
    assert_eq!(fs::read(&file).unwrap(), b"not to be lost");
}

#[test]
fn a_work_folder_without_anything_in_a_store_is_refused() {
    let twins = Twins::new();
    let work = twins.at("work");
    let work = work.to_str().unwrap();
    let refused = twins.local("audio", "x.npz", &["--work", work]).with(2);
    assert!(refused.stderr.contains("is not in a store"), "{}", refused.stderr);
    twins.local("audio", "x.npz", &[]).with(0);
    let mut command = twins.store.tool();
    command.arg("merge").arg(twins.at("x.npz")).args(["--work", work, "--out"]);
    let refused = ended(command.arg(twins.at("y.npz"))).with(2);
    assert!(refused.stderr.contains("is not in a store"), "{}", refused.stderr);
}

#[test]
fn an_output_that_could_not_replace_another_is_sent_without_computing() {
    let twins = Twins::new();
    let (uri, key) = ("s3://lab/out/x.parquet", "lab/out/x.parquet");
    twins.store.put(key, b"the old one");
    let over = [&SUMMARY[..], &["--overwrite"]].concat();
    twins.store.fail(&format!("PUT {key}"), &[Fault::Denied]);
    ended(&mut twins.send(uri, &over)).with(2);
    let made = twins.at("work").join(&twins.left()[0]);
    let before = fs::metadata(&made).unwrap().modified().unwrap();
    twins.store.fail(&format!("PUT {key}"), &[Fault::Denied]);
    ended(&mut twins.send(uri, &over)).with(2);
    assert_eq!(fs::metadata(&made).unwrap().modified().unwrap(), before, "made again");
    ended(&mut twins.send(uri, &over)).with(0);
    twins.local("audio", "x.parquet", &SUMMARY).with(0);
    assert!(twins.store.get(key).unwrap() == fs::read(twins.at("x.parquet")).unwrap());
    assert_eq!(twins.left(), Vec::<String>::new());
}

#[test]
fn ctrl_c_ends_an_upload_in_parts_before_it_begins() {
    let twins = Twins::new();
    twins.wav("audio/long.wav", 2, 1_600_000);
    let (uri, key) = ("s3://lab/out/x.npz", "POST lab/out/x.npz");
    twins.store.fail(key, &[Fault::Silent]);
    let mut command = twins.send(uri, &["--add", "stft", "--set", "stft.output=magnitude"]);
    let mut sending = command.stderr(Stdio::null()).spawn().unwrap();
    while !twins.store.asked().iter().any(|asked| asked.starts_with(key)) {
        assert!(sending.try_wait().unwrap().is_none(), "it should wait");
        std::thread::sleep(Duration::from_millis(5));
    }
    assert_eq!(interrupt(&mut sending), Some(130));
    assert_eq!((twins.left().len(), twins.store.get("lab/out/x.npz")), (1, None));
}
