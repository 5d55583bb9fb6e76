//! Frames in a Parquet file.

use std::path::Path;

use corsmal_files::layout;
use corsmal_files::npz::NpzFile;
use corsmal_files::parquet::ParquetFile;

use super::support::{ended, extract, folder, table, wav};
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
