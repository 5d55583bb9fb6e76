//! Outputs that are no files.

use crate::command::{done, names, refused, text};
use crate::models::small_table;

/// Tables go to devices as they are; what gets its name when it is whole says why it does not.
#[test]
fn devices_take_tables() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let (file, model, csv) = (at("x.npz"), at("m"), at("p.csv"));
    small_table(&file, |_, _| {});
    let learn = ["--features", text(&file), "--target", "type", "--classifier", "knn"];
    done(&[&["train"], &learn[..], &["-o", text(&model), "-q"]].concat());
    let classify = ["classify", "--model", text(&model), "--features", text(&file), "-o"];
    let table = done(&[&classify[..], &["-"]].concat());
    done(&[&classify[..], &[text(&csv)]].concat());
    let held_out = [&["cross-validate"], &learn[..], &["-q", "-o"]].concat();
    let fuse = ["fuse", text(&csv), "-o"];
    for words in [&classify[..], &held_out, &fuse] {
        done(&[words, &["/dev/null"]].concat());
        let found = refused(&[words, &["/dev/full"]].concat());
        assert!(found.contains("/dev/full: No space left"), "{found}");
    }
    assert_eq!(done(&[&classify[..], &["/dev/stdout"]].concat()), table);
    assert_eq!(done(&[&classify[..], &["/dev/null", "--format", "jsonl"]].concat()), "");
    assert!(done(&[&fuse[..], &["/dev/stdout"]].concat()).starts_with("id,path,status,"));
    // A file called `-` was written.
    let printed = done(&[&held_out[..], &["-"]].concat());
    assert_eq!(printed.lines().count(), table.lines().count());
    for place in ["-", "/dev/stdout"] {
        let found = refused(&[&["cross-validate"], &learn[..], &["-o", place]].concat());
        assert!(found.contains("the scores are printed there, too"), "{found}");
    }
    let found = refused(&[&["train"], &learn[..], &["-o", "/dev/null"]].concat());
    assert!(found.contains("/dev/null is a device; this output gets its name when"), "{found}");
    let wav = at("a.wav");
    std::fs::write(&wav, "RIFF").unwrap();
    let found = refused(&["extract", text(&wav), "--preset", "esc26", "-o", "/dev/null"]);
    assert!(found.contains("/dev/null: is a device"), "{found}");
    assert_eq!(names(folder.path()), ["a.wav", "m", "p.csv", "x.npz"]);
}

/// A device that has no end was read until memory had one.
#[test]
fn endless_devices_are_read_up_to_a_limit() {
    let folder = tempfile::tempdir().unwrap();
    let (wav, out) = (folder.path().join("a.wav"), folder.path().join("x.npz"));
    std::fs::write(&wav, "RIFF").unwrap();
    let (wav, out, zero) = (text(&wav), text(&out), "/dev/zero");
    let of_limit = "it does not end within the";
    let data = text(folder.path());
    for (words, part) in [
        (&["extract", wav, "-o", out, "--config", zero][..], of_limit),
        (&["evaluate", "--annotations", zero, zero], of_limit),
        (&["capacity", "--method", "m3", "--model", zero, "--data", data, "-o", out], of_limit),
        (&["classify", "--model", zero, wav, "-o", out], "not a model file"),
    ] {
        let found = refused(words);
        assert!(found.contains(zero) && found.contains(part), "{words:?}: {found}");
    }
}
