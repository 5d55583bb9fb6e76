//! Frames in a Parquet file.

use std::path::Path;

use corsmal_files::layout;
use corsmal_files::npz::NpzFile;
use corsmal_files::parquet::ParquetFile;

use super::support::{ended, extract, folder, spec, table, wav};
use crate::command::{names, tool};

/// Every array and every time of frame of an `.npz` is in the Parquet file, and nothing else is.
fn same_frames(npz: &Path, parquet: &Path) {
    let (mut npz, mut parquet) = (NpzFile::open(npz).unwrap(), ParquetFile::open(parquet).unwrap());
    let (expected, made) = layout::read_table(&mut npz).unwrap();
    assert_eq!(parquet.table().unwrap(), (expected.clone(), made.clone()));
    let features = parquet.frame_features();
    assert_eq!(features, made.features());
    for (row, id) in expected.ids().iter().enumerate() {
        for feature in &features {
            let named = (features.len() > 1).then_some(feature.as_str());
            let frames = parquet.frames(row, feature).unwrap();
            let values = npz.f32(&layout::frames_name(id, named)).unwrap();
            assert_eq!(frames.values, values, "{id} {feature}");
            let times = npz.f64(&layout::times_name(id, named)).unwrap();
            assert!(frames.times.iter().eq(times.iter()), "{id} {feature}");
        }
    }
}

#[test]
fn parquet_holds_the_frames_of_the_npz() {
    let folder = folder(7);
    let at = |name: &str| folder.path().join(name);
    wav(&at("audio/00/mono.wav"), 1, 3000, 5);
    wav(&at("audio/00/short.wav"), 1, 10, 5);
    std::fs::write(at("audio/01/bad.wav"), b"RIFF").unwrap();
    for (i, more) in [&[][..], &["--add", "rms"]].iter().enumerate() {
        let (npz, parquet) = (at(&format!("{i}.npz")), at(&format!("{i}.parquet")));
        extract(&at("audio"), &npz, more).with(1);
        extract(&at("audio"), &parquet, more).with(1);
        same_frames(&npz, &parquet);
        assert!(extract(&at("audio"), &parquet, more).stderr.contains("up to date"));

        // Shards give the same bytes.
        let mut merge = tool();
        merge.arg("merge").arg("--out").arg(at(&format!("merged{i}.parquet")));
        for part in ["0/3", "1/3", "2/3"] {
            let out = at(&format!("{i}-{}.parquet", &part[..1]));
            extract(&at("audio"), &out, &[more, &["--shard", part][..]].concat());
            merge.arg(out);
        }
        ended(&mut merge).with(0);
        let merged = std::fs::read(at(&format!("merged{i}.parquet"))).unwrap();
        assert!(merged == std::fs::read(&parquet).unwrap());

        let compared = ended(tool().arg("compare").args([&npz, &parquet])).with(0);
        assert!(compared.stdout.ends_with("\nequal within the tolerance\n"), "{}", compared.stdout);
    }
    let inspected = ended(tool().arg("inspect").arg(at("1.parquet"))).with(0);
    let line = "9 recordings: frames of melspectrogram, rms";
    assert!(inspected.stdout.contains(line), "{}", inspected.stdout);
    // The same panels as those of the npz, under the other file's name.
    let drawn = ["npz", "parquet"].map(|kind| {
        let (file, svg) = (at(&format!("1.{kind}")), at(&format!("{kind}.svg")));
        let picture = ended(tool().arg("inspect").arg(&file).arg("--picture").arg(&svg));
        picture.with(0);
        std::fs::read_to_string(svg).unwrap().replace(&format!("1.{kind}"), "")
    });
    assert!(drawn[0] == drawn[1]);
    let refused = ended(tool().arg("train").arg(at("1.parquet"))).code;
    assert_eq!(refused, Some(2), "frames are no rows of statistics");
    assert!(names(folder.path()).iter().all(|n| !n.contains(".part") && !n.contains("unfinished")));
}

/// What a stretch holds, not only how much: the numbers of a recording of nothing else.
#[test]
fn stretches_of_a_manifest_hold_what_a_recording_of_them_holds() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let whole = wav(&at("whole.wav"), 2, 24_000, 3);
    let samples: Vec<i16> =
        hound::WavReader::open(&whole).unwrap().samples().map(Result::unwrap).collect();
    let mut list = String::from("id,path,start,end\n");
    // From the start, from within, and to the end.
    let stretches =
        [("a", 0, 6000), ("b", 4000, 12_000), ("c", 8008, 16_024), ("d", 16_000, 24_000)];
    for (id, first, end) in stretches {
        let seconds = |frame: usize| frame as f64 / 16_000.0;
        let end_of = if end == 24_000 { String::new() } else { seconds(end).to_string() };
        list += &format!("{id},whole.wav,{},{end_of}\n", seconds(first));
        std::fs::create_dir_all(at("cut")).unwrap();
        let path = at(&format!("cut/{id}.wav"));
        let mut writer = hound::WavWriter::create(path, spec(2)).unwrap();
        samples[2 * first..2 * end].iter().for_each(|s| writer.write_sample(*s).unwrap());
        writer.finalize().unwrap();
    }
    std::fs::write(at("list.csv"), list).unwrap();
    for (name, more) in [("frames", &["--add", "rms"][..]), ("table", &["--preset", "esc26"])] {
        let (stretched, cut) = (at(&format!("{name}.npz")), at(&format!("{name}-cut.npz")));
        extract(&at("list.csv"), &stretched, more).with(0);
        extract(&at("cut"), &cut, more).with(0);
        let (mut one, mut two) = (NpzFile::open(&stretched).unwrap(), NpzFile::open(&cut).unwrap());
        let ((one_table, made), (two_table, _)) =
            (layout::read_table(&mut one).unwrap(), layout::read_table(&mut two).unwrap());
        assert_eq!(one_table.ids(), ["a", "b", "c", "d"]);
        assert_eq!(one_table.ids(), two_table.ids());
        assert_eq!(one_table.values(), two_table.values());
        for feature in made.features().iter().filter(|_| name == "frames") {
            for (id, ..) in stretches {
                let frames = layout::frames_name(id, Some(feature));
                let values = one.f32(&frames).unwrap();
                assert!(values.iter().any(|v| *v != values[[0, 0, 0]]), "{frames}");
                assert_eq!(values, two.f32(&frames).unwrap(), "{frames}");
            }
        }
    }
}

#[test]
fn a_parquet_file_of_frames_says_how_it_was_made() {
    let folder = folder(2);
    let (npz, parquet) = (folder.path().join("a.npz"), folder.path().join("a.parquet"));
    extract(&folder.path().join("audio"), &npz, &[]).with(0);
    extract(&folder.path().join("audio"), &parquet, &[]).with(0);
    let made = ParquetFile::open(&parquet).unwrap().table().unwrap();
    assert_eq!(made.0, table(&npz));
    assert_eq!(made.0.outcomes().len(), 2);
    // A run of another configuration does not pass for it.
    let refused = extract(&folder.path().join("audio"), &parquet, &["--add", "rms"]).with(2);
    assert!(refused.stderr.contains("another configuration"), "{}", refused.stderr);
}

/// A table that nobody could read was written.
#[test]
fn labels_are_not_called_like_frames() {
    let folder = folder(1);
    let at = |name: &str| folder.path().join(name);
    for label in ["mfcc", "__times__/mfcc", "other"] {
        std::fs::write(at("l.csv"), format!("path,{label}\naudio/00/r0000.wav,x\n")).unwrap();
        let run = |out: &str, more: &[&str]| {
            let only = ["--config", crate::command::text(&at("mfcc.toml"))].map(str::to_owned);
            let only: Vec<&str> = only.iter().map(String::as_str).collect();
            extract(&at("l.csv"), &at(out), &[&only, more].concat())
        };
        std::fs::write(at("mfcc.toml"), "[features.mfcc]\n").unwrap();
        let code = if label == "other" { 0 } else { 2 };
        for more in [&["--dry-run"][..], &[], &["--partition-by", label]] {
            let name = if more.len() == 2 { format!("{code}") } else { format!("{code}.parquet") };
            let ended = run(&name, more).with(code);
            assert_eq!(ended.stderr.contains("two columns"), code == 2, "{}", ended.stderr);
        }
        run(&format!("{code}.npz"), &["--overwrite"]).with(0);
    }
}
