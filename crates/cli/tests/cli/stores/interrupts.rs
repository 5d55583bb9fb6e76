//! Many requests wait at the same time, and Ctrl-C ends waiting.

use std::process::Stdio;
use std::time::Duration;

use super::*;
use crate::command::{interrupt, text};

const SUMMARY: [&str; 2] = ["--preset", "mfcc-zcr"];

impl Twins {
    /// A manifest of `count` objects.
    fn manifest(&self, count: usize) -> PathBuf {
        let bytes = fs::read(self.at("audio/f.wav")).unwrap();
        let mut text = String::from("path\n");
        for i in 0..count {
            self.store.put(&format!("lab/many/{i:03}.wav"), &bytes);
            text.push_str(&format!("s3://lab/many/{i:03}.wav\n"));
        }
        fs::write(self.at("many.csv"), text).unwrap();
        self.at("many.csv")
    }
}

#[test]
fn objects_of_a_manifest_are_asked_for_at_the_same_time() {
    let twins = Twins::new();
    let manifest = twins.manifest(40);
    twins.stored(&manifest, "x.npz", &SUMMARY).with(0);
    let late = || {
        for i in 0..40 {
            let key = format!("HEAD lab/many/{i:03}.wav");
            // The first of the store is asked for twice.
            twins.store.fail(&key, &vec![Fault::Late(Duration::from_millis(100)); 2]);
        }
    };
    late();
    twins.store.asked();
    let again = twins.stored(&manifest, "x.npz", &SUMMARY).with(0);
    assert!(again.stderr.contains("up to date"), "{}", again.stderr);
    assert!(twins.store.most_at_once() > 8, "{}", twins.store.most_at_once());
    let asked = twins.store.asked();
    assert_eq!(asked.len(), 41, "{asked:?}");
    // Shards of a list, too.
    let mut tar = tar::Builder::new(Vec::new());
    tar.append_path_with_name(twins.at("audio/a.wav"), "x.wav").unwrap();
    let tar = tar.into_inner().unwrap();
    for i in 0..8 {
        let key = format!("lab/shards/{i}.tar");
        twins.store.put(&key, &tar);
        twins.store.fail(&format!("HEAD {key}"), &[Fault::Late(Duration::from_millis(100))]);
    }
    twins.stored("s3://lab/shards/{0..7}.tar", "y.npz", &SUMMARY).with(0);
    let expected: Vec<String> = (0..8).map(|i| format!("{i}/x")).collect();
    assert_eq!(table(&twins.at("y.npz")).ids(), expected, "in the order of the list");
}

#[cfg(unix)]
#[test]
fn ctrl_c_ends_waiting_for_a_store_wherever_it_is() {
    let twins = Twins::new();
    let manifest = twins.manifest(3);
    twins.stored(&manifest, "x.npz", &SUMMARY).with(0);
    for (input, key, out) in [
        // Finding recordings, looking at headers, reading, and asking whether they are what they were.
        ("s3://lab/audio/a.wav", "HEAD lab/audio/a.wav", "y.npz"),
        ("s3://lab/audio/", "lab/audio/b/c d%.wav", "y.npz"),
        (text(&manifest), "HEAD lab/many/002.wav", "x.npz"),
    ] {
        twins.store.fail(key, &[Fault::Silent]);
        twins.store.asked();
        let mut command = twins.store.tool();
        command.args(["extract", input, "--out"]).arg(twins.at(out)).args(SUMMARY);
        let mut run = command.stderr(Stdio::null()).spawn().unwrap();
        let wanted = if key.starts_with("HEAD") { key.to_owned() } else { format!("GET {key}") };
        while !twins.store.asked().iter().any(|asked| asked.starts_with(&wanted)) {
            assert!(run.try_wait().unwrap().is_none(), "{input}: it should wait");
            std::thread::sleep(Duration::from_millis(5));
        }
        assert_eq!(interrupt(&mut run), Some(130), "{input}");
    }
}

#[test]
fn the_name_of_an_object_is_never_one_of_a_file() {
    let twins = Twins::new();
    // What the name would be on a disk, seen from here.
    let here = twins.at("here");
    for name in ["s3:/lab/audio/a.wav", "s3:/lab/none/a.wav"] {
        fs::create_dir_all(here.join(name).parent().unwrap()).unwrap();
        fs::write(here.join(name), b"not the object").unwrap();
    }
    fs::write(here.join("list.csv"), "path\ns3://lab/audio/a.wav\ns3://lab/none/a.wav\n").unwrap();
    let run = |input: &str, code: i32| {
        let mut command = twins.store.tool();
        command.current_dir(&here).args(["extract", input, "--out", "../x.npz", "--overwrite"]);
        ended(command.args(SUMMARY)).with(code)
    };
    run("s3://lab/audio/a.wav", 0);
    assert_eq!(table(&twins.at("x.npz")).outcomes()[0].status, Status::Ok);
    let missing = run("s3://lab/none/a.wav", 2);
    assert!(missing.stderr.contains("no such file"), "{}", missing.stderr);
    run("list.csv", 1);
    let found = table(&twins.at("x.npz")).outcomes().to_vec();
    assert_eq!(found.iter().map(|o| o.status).collect::<Vec<_>>(), [Status::Ok, Status::Io]);
    assert!(found[1].reason.contains("no such object"), "{}", found[1].reason);
}
