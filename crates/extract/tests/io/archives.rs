//! Recordings in tar archives, and archives that are not what they should be.

use std::fs;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use crate::support::text;
use corsmal_extract::config::Config;
use corsmal_extract::inputs::{self, Collected, Fault, Input, InputSource};
use corsmal_extract::run::{self, Quiet, Recordings};
use corsmal_files::outcome::Status;
use tar::{Builder, EntryType, Header};
use tempfile::TempDir;

/// A recording of 16 bits at 8 kHz.
fn wav(seed: u32) -> Vec<u8> {
    let spec = hound::WavSpec {
        channels: 1,
        sample_rate: 8000,
        bits_per_sample: 16,
        sample_format: hound::SampleFormat::Int,
    };
    let mut bytes = std::io::Cursor::new(Vec::new());
    let mut writer = hound::WavWriter::new(&mut bytes, spec).unwrap();
    for i in 0..4000_u32 {
        writer.write_sample((i.wrapping_mul(2_654_435_761 + seed) >> 17) as i16).unwrap();
    }
    writer.finalize().unwrap();
    bytes.into_inner()
}

fn member(tar: &mut Builder<fs::File>, name: &str, bytes: &[u8]) {
    let mut header = Header::new_gnu();
    header.set_size(bytes.len() as u64);
    tar.append_data(&mut header, name, bytes).unwrap();
}

/// An archive with these members, in a folder.
fn archive(folder: &TempDir, name: &str, members: &[(&str, &[u8])]) -> PathBuf {
    let path = folder.path().join(name);
    let mut tar = Builder::new(fs::File::create(&path).unwrap());
    members.iter().for_each(|(name, bytes)| member(&mut tar, name, bytes));
    tar.finish().unwrap();
    path
}

fn collect(name: &Path) -> Result<Collected, String> {
    inputs::collect(&[text(name)]).map_err(|e| e.to_string())
}

fn ids(found: &[Input]) -> Vec<&str> {
    found.iter().map(|input| input.id.as_str()).collect()
}

fn outcomes(found: &[Input]) -> Vec<(Status, String)> {
    let recordings = Recordings::new(Arc::new(Config::preset("esc26").unwrap()));
    let stop = Arc::new(AtomicBool::new(false));
    let batch = recordings.extract((found, &[]), None, 1, &stop).unwrap();
    batch.outcomes.into_iter().map(|outcome| (outcome.status, outcome.reason)).collect()
}

#[test]
fn members_are_recordings_with_the_labels_beside_them() {
    let folder = TempDir::new().unwrap();
    let path = archive(
        &folder,
        "000007.tar",
        &[
            ("a/x.json", br#"{"level": 3, "who": "me", "id": "no", "tags": [1], "sure": null}"#),
            ("a/x.wav", &wav(1)),
            ("a/x.cls", b"12\n"),
            ("./y.left.wav", &wav(2)),
            ("y.json", br#"{"who": "you"}"#),
            ("notes.txt", b"not a recording"),
            ("._y.wav", b"what macOS leaves"),
            ("z.wma", b"not read"),
        ],
    );
    let found = collect(&path).unwrap();
    assert_eq!(ids(&found.inputs), ["000007/a/x", "000007/y.left"]);
    let labels = |input: &Input| {
        let pairs = input.labels.iter().map(|(name, value)| format!("{name}={value}"));
        pairs.collect::<Vec<_>>().join(" ")
    };
    assert_eq!(labels(&found.inputs[0]), "level=3 who=me sure= cls=12");
    assert_eq!(labels(&found.inputs[1]), "level= who=you sure= cls=");
    assert_eq!(found.skipped, [path.join("z.wma")]);
    let InputSource::Member(member) = &found.inputs[0].source else { panic!("no member") };
    let (from, size) = (member.offset as usize, member.size as usize);
    assert_eq!(fs::read(&path).unwrap()[from..from + size], wav(1));
    assert_eq!(found.inputs[0].source.to_string(), text(&path.join("a/x.wav")));
}

#[test]
fn a_run_over_shards_has_the_values_of_the_files() {
    let folder = TempDir::new().unwrap();
    let mut files = Vec::new();
    for shard in 0..2_u32 {
        let wavs: Vec<Vec<u8>> = (0..3).map(|i| wav(10 * shard + i)).collect();
        let names: Vec<String> = (0..3).map(|i| format!("r{i}.wav")).collect();
        let members: Vec<(&str, &[u8])> =
            names.iter().zip(&wavs).map(|(n, w)| (n.as_str(), w.as_slice())).collect();
        archive(&folder, &format!("{shard:03}.tar"), &members);
        for (name, bytes) in members {
            let file = folder.path().join(format!("{shard}-{name}"));
            fs::write(&file, bytes).unwrap();
            files.push(file);
        }
    }
    let braces = collect(&folder.path().join("{000..001}.tar")).unwrap();
    let glob = collect(&folder.path().join("*.tar")).unwrap();
    assert_eq!(braces, glob);
    assert_eq!(ids(&braces.inputs)[2..4], ["000/r2", "001/r0"]);
    let config = Arc::new(Config::preset("mfcc-zcr").unwrap());
    let go_on = Arc::new(AtomicBool::new(false));
    let table =
        |inputs: &[Input]| run::table(inputs, &config, (2, folder.path()), &Quiet, &go_on).unwrap();
    let of_files = inputs::collect(&files).unwrap().inputs;
    let (shards, plain) = (table(&braces.inputs), table(&of_files));
    assert_eq!(shards.values(), plain.values());
    assert!(shards.outcomes().iter().all(|o| o.status == Status::Ok));
    let identities = |table: &corsmal_files::table::Table| {
        table.outcomes().iter().map(|o| o.identity.clone()).collect::<Vec<_>>()
    };
    assert_eq!(identities(&shards), identities(&plain));
    assert!(collect(&folder.path().join("{000..002}.tar")).unwrap_err().contains("002.tar"));
}

#[test]
fn an_archive_that_changes_while_it_is_read_says_so() {
    let folder = TempDir::new().unwrap();
    let path = archive(&folder, "s.tar", &[("x.wav", &wav(1)), ("y.wav", &wav(2))]);
    let found = collect(&path).unwrap().inputs;
    let watch = corsmal_extract::engine::Watch::begin(&found[0]);
    let before = found[0].source.identity();
    assert!(watch.check_content(&before).is_ok());
    let mut bytes = fs::read(&path).unwrap();
    bytes[600] ^= 1;
    fs::write(&path, bytes).unwrap();
    assert_eq!(watch.check_content(&before).unwrap_err().status, Status::Changed);
}

#[test]
fn links_sparse_files_and_what_is_cut_are_rows() {
    let folder = TempDir::new().unwrap();
    let path = folder.path().join("s.tar");
    let mut tar = Builder::new(fs::File::create(&path).unwrap());
    member(&mut tar, "x.wav", &wav(1));
    for (name, kind) in [("soft.wav", EntryType::Symlink), ("hard.wav", EntryType::Link)] {
        let mut header = Header::new_gnu();
        header.set_entry_type(kind);
        header.set_size(0);
        tar.append_link(&mut header, name, "x.wav").unwrap();
    }
    let mut holes = Header::new_gnu();
    holes.set_entry_type(EntryType::GNUSparse);
    holes.set_size(512);
    let gnu = holes.as_gnu_mut().unwrap();
    gnu.sparse[0].numbytes = *b"00000001000\0";
    gnu.sparse[0].offset = *b"00000001000\0";
    gnu.realsize = *b"00000002000\0";
    tar.append_data(&mut holes, "holes.wav", &[7_u8; 512][..]).unwrap();
    tar.append_pax_extensions([("GNU.sparse.major", &b"1"[..])]).unwrap();
    member(&mut tar, "pax.wav", &wav(1));
    tar.append_dir("folder.wav", folder.path()).unwrap();
    member(&mut tar, "last.wav", &wav(3));
    tar.finish().unwrap();
    let file = fs::OpenOptions::new().write(true).open(&path).unwrap();
    file.set_len(file.metadata().unwrap().len() - 1024 - 300).unwrap();

    let found = collect(&path).unwrap();
    assert!(found.warning().unwrap().contains("no end mark"), "{:?}", found.warning());
    let names = ["s/x", "s/soft", "s/hard", "s/holes", "s/pax", "s/last"];
    assert_eq!(ids(&found.inputs), names);
    let expected = [
        (Status::Ok, ""),
        (Status::Unsupported, "a link in a tar"),
        (Status::Unsupported, "a link in a tar"),
        (Status::Unsupported, "a sparse file in a tar"),
        (Status::Unsupported, "a sparse file in a tar"),
        (Status::Corrupt, "a tar that ends 152 bytes too early"),
    ];
    for ((status, reason), (wanted, part)) in outcomes(&found.inputs).into_iter().zip(expected) {
        assert!(status == wanted && reason.contains(part), "{status}: {reason}");
    }
    let InputSource::Member(last) = &found.inputs[5].source else { panic!("no member") };
    assert!(matches!(last.fault, Some(Fault::Cut(missing)) if missing > 0));
}

#[test]
fn names_that_lead_out_stay_inside() {
    let folder = TempDir::new().unwrap();
    let path = folder.path().join("s.tar");
    let mut tar = Builder::new(fs::File::create(&path).unwrap());
    for name in ["../../x.wav", "/etc/y.wav", "__z.wav"] {
        let (mut header, bytes) = (Header::new_gnu(), wav(1));
        header.set_size(bytes.len() as u64);
        header.as_gnu_mut().unwrap().name[..name.len()].copy_from_slice(name.as_bytes());
        header.set_cksum();
        tar.append(&header, bytes.as_slice()).unwrap();
    }
    let long = format!("{}/w.wav", "d".repeat(300));
    member(&mut tar, &long, &wav(1));
    tar.finish().unwrap();
    let found = collect(&path).unwrap().inputs;
    let long = format!("s/{}/w", "d".repeat(300));
    assert_eq!(ids(&found), ["s/x", "s/etc/y", "s/__z", &long]);
    assert!(outcomes(&found).iter().all(|(status, _)| *status == Status::Ok));
}

#[test]
fn archives_one_behind_the_other_are_read_to_the_end() {
    let folder = TempDir::new().unwrap();
    let one = archive(&folder, "a.tar", &[("x.wav", &wav(1))]);
    let two = archive(&folder, "b.tar", &[("y.wav", &wav(2))]);
    let both = folder.path().join("both.tar");
    fs::write(&both, [fs::read(one).unwrap(), fs::read(two).unwrap()].concat()).unwrap();
    let found = collect(&both).unwrap();
    assert_eq!(ids(&found.inputs), ["both/x", "both/y"]);
    assert_eq!(found.warning(), None);
}

#[test]
fn archives_in_which_recordings_may_be_missed_are_refused() {
    let folder = TempDir::new().unwrap();
    let good =
        fs::read(archive(&folder, "good.tar", &[("x.wav", &wav(1)), ("y.wav", &wav(2))])).unwrap();
    let refused = |name: &str, bytes: &[u8], part: &str| {
        let path = folder.path().join(name);
        fs::write(&path, bytes).unwrap();
        let message = collect(&path).unwrap_err();
        assert!(message.contains(name) && message.contains(part), "{name}: {message}");
    };
    let second = 512 + wav(1).len().div_ceil(512) * 512;
    let mut damaged = good.clone();
    damaged[second + 5] ^= 1;
    refused("checksum.tar", &damaged, "checksum");
    refused("header.tar", &good[..second + 100], "entire block");
    refused("text.tar", "no tar at all".repeat(100).as_bytes(), "");
    refused("empty.tar", b"", "no file with an audio extension");
    refused("x.tar.gz", &good, "decompress");
    refused("x.tgz", &good, "decompress");
    refused("gzip.tar", b"\x1f\x8b\x08\0\0\0\0\0\0\x03", "decompress");
    refused("zstd.tar", b"\x28\xb5\x2f\xfd\x24", "decompress");
    // The name of a member that would be a gigabyte long.
    let mut long = Header::new_gnu();
    long.set_entry_type(EntryType::GNULongName);
    long.set_size(1 << 30);
    long.set_cksum();
    let path = folder.path().join("long.tar");
    fs::write(&path, long.as_bytes()).unwrap();
    fs::OpenOptions::new().write(true).open(&path).unwrap().set_len(1 << 31).unwrap();
    assert!(collect(&path).unwrap_err().contains("before the next member"));
    // Sizes that no file has.
    for size in [u64::MAX, i64::MAX as u64, 1 << 62] {
        let mut header = Header::new_gnu();
        header.as_gnu_mut().unwrap().name[..5].copy_from_slice(b"x.wav");
        header.set_size(size);
        header.set_cksum();
        let path = folder.path().join("size.tar");
        fs::write(&path, header.as_bytes()).unwrap();
        match collect(&path) {
            Err(message) => assert!(message.contains("size.tar"), "{message}"),
            Ok(found) => assert_eq!(outcomes(&found.inputs)[0].0, Status::Corrupt),
        }
    }
}

#[test]
fn labels_that_cannot_be_read_are_refused() {
    let folder = TempDir::new().unwrap();
    let large = vec![b' '; (1 << 20) + 1];
    for (json, part) in [
        (&b"{\"a\": }"[..], "expected value"),
        (b"{\"a\": 1, \"a\": 2}", "given twice"),
        (b"[1]", "JSON object"),
        (b"\xff", "UTF-8"),
        (&large, "at most 1048576 bytes"),
    ] {
        let path = archive(&folder, "s.tar", &[("x.wav", &wav(1)), ("x.json", json)]);
        let message = collect(&path).unwrap_err();
        assert!(message.contains("\"x.json\"") && message.contains(part), "{message}");
    }
    // Its column would be a member that is unpacked elsewhere.
    let climbing = b"{\"../../a\": 1}";
    let path = archive(&folder, "s.tar", &[("x.wav", &wav(1)), ("x.json", climbing)]);
    assert!(collect(&path).unwrap_err().contains("the label \"../../a\" must not contain .."));
}

/// Where all labels of `take` were taken for those of one sample, each recording had the last.
#[test]
fn labels_of_names_with_dots_are_those_of_their_recording() {
    let folder = TempDir::new().unwrap();
    let sound = wav(1);
    let path = archive(
        &folder,
        "s.tar",
        &[
            ("take.1.wav", &sound),
            ("take.1.json", br#"{"y": "first"}"#),
            ("take.2.wav", &sound),
            ("take.2.json", br#"{"y": "second"}"#),
            ("take.3.wav", &sound),
            ("take.4.json", br#"{"y": "of none"}"#),
            ("take.cls", b"7"),
            ("x.meta.json", br#"{"y": "beside"}"#),
            ("x.wav", &sound),
        ],
    );
    let found = collect(&path).unwrap().inputs;
    let labels: Vec<String> = found
        .iter()
        .map(|input| input.labels.iter().map(|(_, value)| value.as_str()).collect::<Vec<_>>())
        .map(|values| values.join(","))
        .collect();
    assert_eq!(labels, ["first,7", "second,7", ",7", "beside,"]);
}

#[test]
fn a_label_that_is_given_twice_is_refused() {
    let folder = TempDir::new().unwrap();
    let sound = wav(1);
    let one = ("x.json", &br#"{"y": 1, "cls": 3}"#[..]);
    for second in [one, ("x.cls", b"4"), ("x.more.json", br#"{"y": 2}"#)] {
        let path = archive(&folder, "s.tar", &[("x.wav", &sound), one, second]);
        let message = collect(&path).unwrap_err();
        assert!(message.contains("of \"x.wav\" is given twice"), "{message}");
    }
}

/// A member of 20 KB labels 10,000 recordings: 20 million labels.
#[test]
fn labels_that_one_member_gives_to_many_recordings_are_counted() {
    let folder = TempDir::new().unwrap();
    let names: Vec<String> = (0..10_000).map(|i| format!("x.{i}.wav")).collect();
    let mut members: Vec<(&str, &[u8])> =
        names.iter().map(|n| (n.as_str(), &b"RIFF"[..])).collect();
    let json = serde_json::to_string(
        &(0..2000).map(|i| (format!("c{i}"), 0.into())).collect::<serde_json::Map<_, _>>(),
    )
    .unwrap();
    members.push(("x.json", json.as_bytes()));
    let path = archive(&folder, "s.tar", &members);
    let message = collect(&path).unwrap_err();
    assert!(message.contains("more than 16777216 labels"), "{message}");
}

#[test]
fn archives_in_manifests_are_refused_in_words() {
    let folder = TempDir::new().unwrap();
    archive(&folder, "s.tar", &[("x.wav", &wav(1))]);
    let manifest = folder.path().join("m.csv");
    fs::write(&manifest, "path\ns.tar\n").unwrap();
    assert!(collect(&manifest).unwrap_err().contains("line 2: "));
    assert!(collect(&manifest).unwrap_err().contains("give it as an input"));
}

/// One member of a megabyte labelled every recording, each with a copy.
#[test]
fn labels_of_many_recordings_are_bounded() {
    let folder = tempfile::tempdir().unwrap();
    let names: Vec<String> = (0..1200).map(|i| format!("x.{i}.wav")).collect();
    let label = format!("{{\"t\": \"{}\"}}", "v".repeat(1_000_000));
    let mut members: Vec<(&str, &[u8])> =
        names.iter().map(|name| (&**name, &b"RIFF"[..])).collect();
    members.push(("x.json", label.as_bytes()));
    let refused = collect(&archive(&folder, "a.tar", &members)).unwrap_err();
    assert!(refused.contains("adds 1000001 to each of 1200 recordings"), "{refused}");
}

#[test]
fn a_member_that_is_there_twice_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let (one, two) = (wav(1), wav(2));
    let members: [(&str, &[u8]); 2] = [("r.wav", &one), ("r.wav", &two)];
    let refused = collect(&archive(&folder, "a.tar", &members)).unwrap_err();
    assert!(
        refused.contains("a.tar/r.wav: the archive is named twice, or has this member twice"),
        "{refused}"
    );
}

/// A folder with one recording beside tars was one recording, without a word.
#[test]
fn archives_in_folders_are_told() {
    let folder = TempDir::new().unwrap();
    fs::write(folder.path().join("x.wav"), wav(1)).unwrap();
    let tar = archive(&folder, "s.tar", &[("a.wav", &wav(2))]);
    let found = collect(folder.path()).unwrap();
    assert_eq!(ids(&found.inputs), ["x"]);
    assert!(found.warning().unwrap().contains("s.tar lies in a folder, so it is not read"));
    let respelt = folder.path().join(".").join("s.tar");
    let found = inputs::collect(&[text(folder.path()), text(&respelt)]).unwrap();
    assert_eq!((found.inputs.len(), found.warning()), (2, None));
    assert_eq!(collect(&tar).unwrap().warning(), None);
    fs::remove_file(folder.path().join("x.wav")).unwrap();
    assert!(collect(folder.path()).unwrap_err().contains("to read its recordings, name it"));
}
