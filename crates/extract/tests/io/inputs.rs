//! From names to inputs.

use std::fs;
use std::path::Path;

use crate::support::{folder, text};
use corsmal_extract::inputs::{self, Input, InputSource};
use corsmal_files::shard::Shard;
use proptest::prelude::*;

pub fn ids(names: &[&str]) -> Result<Vec<String>, String> {
    let names: Vec<String> = names.iter().map(|name| name.to_string()).collect();
    match inputs::collect(&names) {
        Ok(found) => Ok(found.inputs.into_iter().map(|input| input.id).collect()),
        Err(error) => Err(error.to_string()),
    }
}

pub fn in_folder(root: &Path, names: &[&str]) -> Result<Vec<String>, String> {
    let names: Vec<String> = names.iter().map(|n| text(&root.join(n)).to_string()).collect();
    ids(&names.iter().map(String::as_str).collect::<Vec<_>>())
}

#[test]
fn a_folder_is_searched_in_byte_order() {
    let dir = folder(&[
        "b.wav",
        "a/z.WAV",
        "a/é.flac",
        "a.ogg",
        "B.mp3",
        "notes.txt",
        ".x.wav",
        ".git/y.wav",
    ]);
    assert_eq!(ids(&[text(dir.path())]).unwrap(), ["B", "a", "a/z", "a/é", "b"]);
}

#[test]
fn a_glob_is_named_from_its_fixed_part() {
    let dir = folder(&["t/1/audio/x.wav", "t/2/audio/x.wav", "t/2/audio/x.txt", "u/x.wav"]);
    let expected = ["1/audio/x", "2/audio/x"];
    assert_eq!(in_folder(dir.path(), &["t/*/audio/*"]).unwrap(), expected);
    assert_eq!(in_folder(dir.path(), &["t/*/audio"]).unwrap(), expected);
    assert_eq!(in_folder(dir.path(), &["t/**"]).unwrap(), expected);
    let error = in_folder(dir.path(), &["t/*/video/*"]).unwrap_err();
    assert!(error.contains("t/*/video/*: no file with an audio extension (wav, "), "{error}");
}

#[test]
fn colliding_ids_take_the_extension_then_the_path() {
    let dir = folder(&["a/x.wav", "a/x.flac", "a/y.wav", "b/y.wav"]);
    assert_eq!(in_folder(dir.path(), &["a"]).unwrap(), ["x.flac", "x.wav", "y"]);
    let ids = in_folder(dir.path(), &["a/y.wav", "b/y.wav", "a/x.wav"]).unwrap();
    let prefix = text(dir.path()).trim_start_matches('/').to_string();
    assert_eq!(ids, [format!("{prefix}/a/y"), format!("{prefix}/b/y"), "x".to_string()]);
    let error = in_folder(dir.path(), &["a/y.wav", "a/y.wav"]).unwrap_err();
    assert!(error.contains("both have the id"), "{error}");
}

/// Two files stopped all others.
#[cfg(unix)]
#[test]
fn names_that_ids_cannot_tell_apart_get_a_hash() {
    use std::os::unix::ffi::OsStrExt;
    let dir = folder(&["a\tb.wav", "a\nb.wav", "ok.wav", "\\xff.wav"]);
    let odd = dir.path().join(std::ffi::OsStr::from_bytes(b"\xff.wav"));
    if fs::write(&odd, "").is_err() {
        return;
    }
    let ids = in_folder(dir.path(), &["."]).unwrap();
    let mut once = ids.clone();
    once.sort_unstable();
    once.dedup();
    assert_eq!((once.len(), ids.contains(&"ok".to_owned())), (5, true), "{ids:?}");
    assert_eq!(ids.iter().filter(|id| id.contains(".wav~")).count(), 4, "{ids:?}");
    assert_eq!(ids, in_folder(dir.path(), &["."]).unwrap());
    let error = in_folder(dir.path(), &["a\tb.wav", "./a\tb.wav"]).unwrap_err();
    assert!(error.contains("both have the id"), "{error}");
}

#[test]
fn ids_never_look_like_arrays_of_the_output() {
    let dir = folder(&["__ids__.wav", "x.npy.wav", "__MACOSX/x.wav"]);
    assert_eq!(ids(&[text(dir.path())]).unwrap(), ["./__MACOSX/x", "./__ids__", "x.npy.wav"]);
}

#[test]
fn what_is_not_there_is_named() {
    assert_eq!(ids(&["nowhere/x.wav"]).unwrap_err(), "nowhere/x.wav: no such file or folder");
    let dir = folder(&["notes.txt"]);
    assert!(ids(&[text(dir.path())]).unwrap_err().contains("no file with an audio extension"));
    assert!(in_folder(dir.path(), &["x[.wav"]).unwrap_err().contains("not a glob"));
    let unread = folder(&["a.wma", "b/c.wma"]);
    let error = in_folder(unread.path(), &["*"]).unwrap_err();
    assert!(error.contains("*: no file with an audio extension (wav, "), "{error}");
    assert!(error.contains("; 2 files were skipped because"), "{error}");
    assert!(ids(&[text(unread.path())]).unwrap_err().contains("a.wma, "));
    // A file named outright is taken at its word; its outcome row will say what it is.
    assert_eq!(in_folder(dir.path(), &["notes.txt"]).unwrap(), ["notes"]);
    assert_eq!(ids(&["-"]).unwrap(), ["stdin"]);
}

#[cfg(target_os = "linux")]
#[test]
fn names_that_are_not_utf8_are_kept_apart() {
    use std::ffi::OsStr;
    use std::os::unix::ffi::OsStrExt;

    let dir = folder(&["a/ü.wav"]);
    for name in [&b"x\xfe.wav"[..], b"x\xff.wav"] {
        fs::write(dir.path().join("a").join(OsStr::from_bytes(name)), b"").unwrap();
    }
    let expected = ["x\\xfe", "x\\xff", "ü"];
    assert_eq!(in_folder(dir.path(), &["a"]).unwrap(), expected);
    assert_eq!(in_folder(dir.path(), &["a/*.wav"]).unwrap(), expected);
    assert_eq!(in_folder(dir.path(), &["**/*.wav"]).unwrap(), expected.map(|id| format!("a/{id}")));
    let named = dir.path().join("a").join(OsStr::from_bytes(b"x\xff.wav"));
    let found = inputs::collect(&[&named]).unwrap().inputs;
    assert_eq!((found[0].id.as_str(), &found[0].source), ("x\\xff", &InputSource::File(named)));
}

#[test]
fn globs_follow_the_rules_of_shells() {
    let dir = folder(&["1/a.wav", "1/b/c.wav", "1/.d/e.wav", "1/.f.wav", "2/a.wav", "x[1].wav"]);
    let at = |pattern: &str| in_folder(dir.path(), &[pattern]);
    assert_eq!(at("*/a.wav").unwrap(), ["1/a", "2/a"]);
    assert_eq!(at("[12]/*.wav").unwrap(), ["1/a", "2/a"]);
    assert_eq!(at("[!2]/*.wav").unwrap(), ["1/a"]);
    assert_eq!(at("**/?.wav").unwrap(), ["1/a", "1/b/c", "2/a"]);
    assert_eq!(at("1/**").unwrap(), ["a", "b/c"]);
    assert_eq!(at("1/*").unwrap(), ["a", "b/c"]);
    assert_eq!(at("x[1].wav").unwrap(), ["x[1]"]);
    assert!(at("*/nothing.wav").unwrap_err().contains("no file with an audio extension"));
    assert!(at("**x/*.wav").unwrap_err().contains("not a glob"));
}

#[cfg(unix)]
#[test]
fn links_are_followed_but_not_in_circles() {
    use std::os::unix::fs::symlink;
    let dir = folder(&["a/x.wav", "b/y.wav"]);
    let at = |name: &str| dir.path().join(name);
    symlink(at("b"), at("a/more")).unwrap();
    symlink(at("a"), at("b/circle")).unwrap();
    symlink(at("gone"), at("a/README")).unwrap();
    symlink(at("gone.wav"), at("a/z.wav")).unwrap();
    assert_eq!(in_folder(dir.path(), &["a"]).unwrap(), ["more/y", "x", "z"]);
}

#[test]
fn recordings_of_other_formats_are_counted() {
    let dir = folder(&["a.wav", "b.MOV", "c.txt", "d/e.wma", "._f.wav", ".g.m4a", "d/._h.wma"]);
    let found = inputs::collect(&[text(dir.path())]).unwrap();
    assert_eq!(found.inputs.len(), 1);
    let names: Vec<_> = found.skipped.iter().map(|p| p.file_name().unwrap()).collect();
    assert_eq!(names, ["b.MOV", "e.wma"]);
    let warning = found.warning().unwrap();
    assert!(
        warning
            .starts_with("2 files were skipped because their formats are not read from folders: "),
        "{warning}"
    );
    assert_eq!(inputs::collect(&[text(&dir.path().join("a.wav"))]).unwrap().warning(), None);
}

#[test]
fn metadata_of_macos_is_skipped_wherever_it_is_named() {
    let dir = folder(&["x.wav", "._own.wav", "notes/._x.wav"]);
    let mac = dir.path().join("._x.wav");
    fs::write(&mac, b"\0\x05\x16\x07\0\x02\0\0Mac OS X").unwrap();
    let csv = dir.path().join("m.csv");
    // What is not metadata by its content may have such a name.
    fs::write(&csv, "path,label\nx.wav,a\n._x.wav,a\n._own.wav,b\n").unwrap();
    let found = inputs::collect(&[text(&csv)]).unwrap();
    let ids: Vec<_> = found.inputs.iter().map(|input| input.id.as_str()).collect();
    assert_eq!((ids, found.skipped.as_slice()), (vec!["x", "._own"], [mac.clone()].as_slice()));
    assert!(found.warning().unwrap().contains("._x.wav"));
    let found = inputs::collect(&[text(&mac), text(&dir.path().join("x.wav"))]).unwrap();
    assert_eq!((found.inputs.len(), found.skipped), (1, vec![mac.clone()]));
    let error = inputs::collect(&[text(&mac)]).unwrap_err().to_string();
    assert!(error.contains("._x.wav: no file with an audio extension"), "{error}");
}

#[test]
fn the_list_hash_sees_every_field() {
    let base = Input {
        id: "a".into(),
        source: InputSource::File("a.wav".into()),
        start: None,
        end: None,
        labels: vec![("x".into(), "1".into())],
    };
    let mut variants = vec![vec![base.clone()], vec![], vec![base.clone(), base.clone()]];
    variants.push(vec![Input { id: "b".into(), ..base.clone() }]);
    variants.push(vec![Input { source: InputSource::Stdin, ..base.clone() }]);
    variants.push(vec![Input { start: Some(1.0), ..base.clone() }]);
    variants.push(vec![Input { end: Some(1.0), ..base.clone() }]);
    variants.push(vec![Input { labels: vec![("x".into(), "2".into())], ..base.clone() }]);
    variants.push(vec![Input { labels: vec![], ..base }]);
    let hashes: std::collections::HashSet<_> =
        variants.iter().map(|list| inputs::list_hash(list)).collect();
    assert_eq!(hashes.len(), variants.len());
}

#[test]
fn shards_are_read_as_written() {
    assert_eq!("2/3".parse::<Shard>().unwrap(), Shard { index: 2, count: 3 });
    assert_eq!("2/3".parse::<Shard>().unwrap().to_string(), "2/3");
    for text in ["3/3", "0/0", "1", "-1/2", "a/b", "", "1/2/3"] {
        let error = text.parse::<Shard>().unwrap_err().to_string();
        assert!(error.contains("must be i/n with 0 <= i < n"), "{error}");
    }
}

proptest! {
    #[test]
    fn shards_in_order_are_the_list(length in 0usize..200, count in 1usize..40) {
        let list: Vec<usize> = (0..length).collect();
        let parts: Vec<&[usize]> = (0..count).map(|index| Shard { index, count }.of(&list)).collect();
        prop_assert_eq!(&parts.concat(), &list);
        let longest = parts.iter().map(|p| p.len()).max().unwrap();
        let shortest = parts.iter().map(|p| p.len()).min().unwrap();
        prop_assert!(longest - shortest <= 1);
    }

    #[test]
    fn any_manifest_gives_an_answer(content in "\\PC{0,80}", json in any::<bool>()) {
        let dir = folder(&["a.wav"]);
        let path = dir.path().join(if json { "m.jsonl" } else { "m.csv" });
        fs::write(&path, content).unwrap();
        let _ = ids(&[text(&path)]);
    }
}
