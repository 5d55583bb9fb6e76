//! Recordings in tar shards.

use std::fs::File;
use std::path::Path;

use super::support::{ended, extract, table, wav};
use crate::command::tool;

/// A shard of two recordings and what was said of the first.
fn shard(folder: &Path, index: u32) {
    let path = folder.join(format!("shards/{index:06}.tar"));
    std::fs::create_dir_all(folder.join("shards")).unwrap();
    let mut tar = tar::Builder::new(File::create(path).unwrap());
    let mut add = |name: &str, bytes: &[u8]| {
        let mut header = tar::Header::new_gnu();
        header.set_size(bytes.len() as u64);
        tar.append_data(&mut header, name, bytes).unwrap();
    };
    for i in 0..2 {
        let seed = 2 * index + i;
        let file =
            wav(&folder.join(format!("plain/{index:06}/kitchen/pour{i}.wav")), 1, 8000, seed);
        add(&format!("kitchen/pour{i}.wav"), &std::fs::read(file).unwrap());
        add(&format!("kitchen/pour{i}.json"), format!("{{\"level\": {seed}}}").as_bytes());
    }
    tar.finish().unwrap();
}

#[test]
fn tar_shards_give_the_features_of_the_files_in_them() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    (0..2).for_each(|index| shard(folder.path(), index));
    let preset = &["--preset", "mfcc-zcr"];
    let names = at("shards/{000000..000001}.tar");
    extract(&names, &at("tars.npz"), preset).with(0);
    extract(&at("plain"), &at("plain.npz"), preset).with(0);
    let (tars, plain) = (table(&at("tars.npz")), table(&at("plain.npz")));
    let ids = [
        "000000/kitchen/pour0",
        "000000/kitchen/pour1",
        "000001/kitchen/pour0",
        "000001/kitchen/pour1",
    ];
    assert_eq!(tars.ids(), ids);
    assert_eq!((plain.ids(), plain.values()), (&ids.map(String::from)[..], tars.values()));
    let labels: Vec<_> = tars.labels().collect();
    assert_eq!(labels, [("level", &["0", "1", "2", "3"].map(String::from)[..])]);

    // Parts of the shards, put together.
    let mut merge = tool();
    merge.arg("merge").arg("--out").arg(at("merged.npz"));
    for part in ["0/2", "1/2"] {
        let out = at(&format!("{}.npz", &part[..1]));
        extract(&names, &out, &[preset, &["--shard", part][..]].concat()).with(0);
        merge.arg(out);
    }
    ended(&mut merge).with(0);
    assert!(std::fs::read(at("merged.npz")).unwrap() == std::fs::read(at("tars.npz")).unwrap());

    let absent = extract(&at("shards/{000000..000002}.tar"), &at("more.npz"), preset).with(2);
    assert!(absent.stderr.contains("000002.tar"), "{}", absent.stderr);
    let bytes = std::fs::read(at("shards/000001.tar")).unwrap();
    std::fs::write(at("shards/000001.tar"), &bytes[..9000]).unwrap();
    extract(&names, &at("cut.npz"), preset).with(1);
    let cut: Vec<_> = table(&at("cut.npz")).outcomes().iter().map(|o| o.status.name()).collect();
    assert_eq!(cut, ["ok", "ok", "corrupt"]);
}
