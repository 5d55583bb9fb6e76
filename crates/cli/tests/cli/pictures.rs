//! `crops`, and networks that take pictures: trained, applied, in the benchmark.

use std::path::Path;

use corsmal_files::npz::{Compression, NpzWriter};
use corsmal_vision::Rgb;
use serde_json::Value;

use crate::command::{done, refused, run, text};

fn write(path: &Path, bytes: &[u8]) {
    std::fs::create_dir_all(path.parent().unwrap()).unwrap();
    std::fs::write(path, bytes).unwrap();
}

/// Names of the recordings of even and of odd containers.
const NAMES: [&str; 2] = ["s0_fi3_fu2_b0_l0", "s0_fi1_fu1_b0_l0"];

/// A recording of each of six containers, seen as a few pixels by views 1 and 2, where a detector finds
/// something everywhere but in the first recording's view 2.
fn data(folder: &Path) {
    for container in 1..=6u8 {
        let name = NAMES[usize::from(container % 2)];
        let base = folder.join(format!("train/{container}"));
        write(&base.join(format!("audio/{name}_audio.wav")), b"");
        let mut table = String::from("frame,view,label,score,x_min,y_min,x_max,y_max,mask\n");
        for view in [1, 2] {
            let pixel =
                |i: usize| [100 * (container % 2), (i % 16 * 16) as u8, 90 * view + container];
            let data = (0..16 * 12).flat_map(pixel).collect();
            let image = Rgb { width: 16, height: 12, data }.to_png().unwrap();
            write(&base.join(format!("rgb/{name}/c{view}/0003.png")), &image);
            let label = if container < 4 { "cup" } else { "wine glass" };
            if (container, view) != (1, 2) {
                table += &format!("3,{view},{label},0.8,2,1,14,11,\n");
            }
        }
        write(&base.join(format!("detections/{name}.csv")), table.as_bytes());
    }
}

#[test]
fn crops_train_a_network_that_classifies_pictures() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    let (ccm, crops, model) = (path("ccm"), path("crops"), path("level.safetensors"));
    data(&ccm);
    let made = done(&["crops", "--data", text(&ccm), "--out", text(&crops), "--json"]);
    let made: Value = serde_json::from_str(&made).unwrap();
    assert_eq!([&made["crops"], &made["recordings"], &made["views_without"]], [11, 6, 13]);

    // A damaged picture is left out; the label column is the one that the network is named after.
    std::fs::write(crops.join("6_s0_fi3_fu2_b0_l0_c2.png"), b"no picture").unwrap();
    let train = ["train", "--net", "resnet18-level", "--crops", text(&crops), "-o", text(&model)];
    let output =
        run(&[&train[..], &["--set", "epochs=1", "--json", "--checkpoints", text(&path("kept"))]]
            .concat());
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{said}");
    let file = crops.join("6_s0_fi3_fu2_b0_l0_c2.png");
    let line = said.lines().find(|line| line.contains(text(&file))).unwrap();
    assert!(line.ends_with(": left out of training"), "{said}");
    assert_eq!(said.matches(text(&file)).count(), 1, "{said}");
    let report: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!((&report["items"], &report["target"]), (&10.into(), &"level".into()));
    assert_eq!(report["labels"], serde_json::json!(["full", "half", "opaque"]));

    let shown = done(&["inspect", text(&model)]);
    for words in [
        "trained network · corsmal-feat",
        "resnet18_level",
        "11187651 numbers",
        "full, half, opaque",
        "1 epoch; epoch 1, kept: loss",
    ] {
        assert!(shown.contains(words), "{words}: {shown}");
    }
    let kept = path("kept/training.safetensors");
    let shown = done(&["inspect", text(&kept), "--json"]);
    let shown: Value = serde_json::from_str(&shown).unwrap();
    assert_eq!(
        (&shown["kind"], &shown["header"]["steps"]),
        (&"checkpoint of a training run".into(), &1.into())
    );

    let output = run(&["classify", "-m", text(&model), text(&crops)]);
    assert_eq!(output.status.code(), Some(1));
    let table = String::from_utf8(output.stdout).unwrap();
    assert_eq!(table.lines().count(), 12, "{table}");
    assert!(
        table.lines().any(|l| l.starts_with("6_s0_fi3_fu2_b0_l0_c2,") && l.contains(",corrupt,"))
    );
    let one = done(&[
        "classify",
        "-m",
        text(&model),
        text(&crops.join("1_s0_fi1_fu1_b0_l0_c1.png")),
        "-q",
    ]);
    let of = |table: &str, id: &str| table.lines().find(|l| l.starts_with(id)).map(str::to_owned);
    assert_eq!(of(&one, "1_s0_fi1_fu1_b0_l0_c1"), of(&table, "1_s0_fi1_fu1_b0_l0_c1"));

    // Only the labels given by --labels count: those among the pictures are not read.
    let (few, labels) = (path("few"), path("labels.csv"));
    std::fs::create_dir(&few).unwrap();
    let mut table = String::from("id,held\n");
    for (at, container) in [1, 2, 3, 4].into_iter().enumerate() {
        let name = std::fs::read_dir(&crops).unwrap().map(|entry| entry.unwrap().file_name());
        let name = name.map(|name| name.into_string().unwrap());
        let name =
            name.into_iter().find(|name| name.starts_with(&format!("{container}_"))).unwrap();
        std::fs::copy(crops.join(&name), few.join(&name)).unwrap();
        let id = name.strip_suffix(".png").unwrap();
        table += &format!("{id},{}\n", ["left", "right"][at % 2]);
    }
    std::fs::write(few.join("labels.csv"), "id,level\nsomething else,full\n").unwrap();
    std::fs::write(&labels, table).unwrap();
    let other = path("held.safetensors");
    let words = ["train", "--net", "resnet18-level", "--crops", text(&few), "-o", text(&other)];
    assert!(refused(&words).contains("something else"));
    let named = ["--labels", text(&labels), "--target", "held", "--set", "epochs=1", "--json"];
    let report: Value = serde_json::from_str(&done(&[&words[..], &named].concat())).unwrap();
    assert_eq!(report["labels"], serde_json::json!(["left", "right"]));

    // Several with the same fault share a line, and the file of the first is named once.
    std::fs::write(few.join("more.jpg"), b"no picture").unwrap();
    std::fs::create_dir(few.join("sub")).unwrap();
    for name in ["again.png", "once.png"] {
        std::fs::write(few.join("sub").join(name), b"no picture").unwrap();
    }
    let output = run(&[&words[..], &named, &["--overwrite"]].concat());
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{said}");
    let lines: Vec<&str> = said.lines().filter(|line| line.contains("left out")).collect();
    assert_eq!(lines.len(), 2, "{said}");
    assert!(lines[0].starts_with(&format!("warning: {}: ", text(&few.join("more.jpg")))), "{said}");
    assert!(lines[1].starts_with("warning: 2 more left out ("), "{said}");
    assert!(lines[1].ends_with("): sub/again, sub/once"), "{said}");

    let refuse = |words: &[&str], expected: &str| {
        let message = refused(words);
        assert!(message.contains(expected), "{message}");
    };
    // A network of ours may have seen what a fold holds out; weights of others are named where they do not fit.
    let validate =
        ["cross-validate", "--net", "resnet18-level", "--crops", text(&crops), "--cv", "2"];
    for own in [&model, &kept] {
        refuse(
            &[&validate[..], &["--weights", text(own)]].concat(),
            "a network that this tool trained",
        );
    }
    let again = [&train[..], &["--overwrite"]].concat();
    let weights = path("w.npz");
    let mut npz = NpzWriter::create(&weights, Compression::Stored).unwrap();
    npz.floats("conv1.weight", &[2, 2], &[0.0; 4]).unwrap();
    npz.finish().unwrap();
    refuse(&[&again[..], &["--weights", text(&weights)]].concat(), "conv1.weight is [2, 2]");
    let message = refused(&[&validate[..], &["--weights", text(&weights)]].concat());
    assert!(message.contains("w.npz: ") && message.contains("conv1.weight is [2, 2]"), "{message}");
    refuse(&[&again[..], &["--x", "Y"]].concat(), "recordings have none");
    let empty = path("empty");
    std::fs::create_dir(&empty).unwrap();
    let none = path("no.safetensors");
    let train = |net: &str, crops: &Path| {
        refused(&["train", "--net", net, "--crops", text(crops), "-o", text(&none)])
    };
    assert!(train("resnet18-level", &empty).contains("has no PNG or JPEG picture"));
    assert!(train("m1", &crops).contains("not pictures"));
    refuse(&["classify", "-m", text(&model), text(&crops), "--window", "1"], "for recordings");
}

/// Every container had the table of one, and a frame of two images counted twice.
#[test]
fn tables_and_images_belong_to_one_recording_and_frame() {
    let folder = tempfile::tempdir().unwrap();
    data(folder.path());
    let flat = folder.path().join("flat");
    std::fs::create_dir(&flat).unwrap();
    let table = format!("{}.csv", NAMES[1]);
    let own = folder.path().join("train/1/detections").join(&table);
    std::fs::copy(own, flat.join(&table)).unwrap();
    let out = folder.path().join("crops");
    let crops =
        ["crops", "--data", text(folder.path()), "--detections", text(&flat), "-o", text(&out)];
    let said = refused(&crops);
    assert!(said.contains("this would be the table of ") && said.contains("flat/1 and "), "{said}");
    // By container, the others have none.
    std::fs::create_dir(flat.join("1")).unwrap();
    std::fs::rename(flat.join(&table), flat.join("1").join(&table)).unwrap();
    done(&crops);
    let pictures = std::fs::read_dir(&out).unwrap().map(|entry| entry.unwrap().file_name());
    let pictures: Vec<_> = pictures.map(|name| name.into_string().unwrap()).collect();
    assert!(pictures.iter().filter(|n| n.ends_with(".png")).all(|n| n.starts_with("1_")));

    let images = folder.path().join(format!("train/1/rgb/{}/c1", NAMES[1]));
    std::fs::copy(images.join("0003.png"), images.join("3.png")).unwrap();
    let again = folder.path().join("again");
    let output = run(&["crops", "--data", text(folder.path()), "-o", text(&again)]);
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.code() == Some(1) && said.contains("images of the same frame"), "{said}");
}

#[test]
fn each_view_answers_alone_in_the_benchmark() {
    let folder = tempfile::tempdir().unwrap();
    let (ccm, out) = (folder.path().join("ccm"), folder.path().join("report"));
    data(&ccm);
    // Tables in a folder of their own.
    let tables = folder.path().join("tables");
    std::fs::create_dir(&tables).unwrap();
    for container in 1..=6 {
        let beside = ccm.join(format!("train/{container}/detections"));
        std::fs::rename(beside, tables.join(container.to_string())).unwrap();
    }
    // A box of nothing is one recording's outcome.
    let table = tables.join("5/s0_fi1_fu1_b0_l0.csv");
    let rows = std::fs::read_to_string(&table).unwrap();
    std::fs::write(&table, rows.replacen("2,1,14,11", "14,1,14,11", 1)).unwrap();
    // So is a damaged image.
    std::fs::write(ccm.join("train/6/rgb/s0_fi3_fu2_b0_l0/c2/0003.png"), b"no image").unwrap();
    let words = ["benchmark", "--data", text(&ccm), "--out", text(&out), "--methods", "mask-rn"];
    let words = [&words[..], &["--detections", text(&tables)]].concat();
    let said = done(&[&words[..], &["--epochs", "1"]].concat());
    let scored = |view: u8| {
        let name = format!("Mask + RN, RGB {view} ");
        said.lines().find(|line| line.starts_with(&name)).map(str::to_owned)
    };
    for view in 1..=2 {
        assert!(scored(view).is_some(), "{said}");
    }
    let read = |name: &str| std::fs::read_to_string(out.join(name)).unwrap();
    // Beside the paper's row of the same view.
    let table = read("tables/level.csv");
    let rows: Vec<&str> = table.lines().filter(|line| line.contains("Mask + RN")).collect();
    let ours = rows.iter().position(|row| row.contains("\"Mask + RN, RGB 2\"")).unwrap();
    assert!(rows[ours - 1].contains("RGB 2,paper"), "{rows:?}");
    // Nothing was detected in one recording, and views 3 and 4 have no images.
    let submission = read("submissions/mask-rn-rgb2-held-out.csv");
    assert!(submission.lines().any(|line| line.ends_with(",-1,-1,-1")), "{submission}");
    assert!(out.join("figures/mask-rn-rgb1-level-confusion.svg").exists());
    let report = read("report.json");
    for note in [
        "view 1: no picture of a cup or wine glass in the last frame of 1 of 6 recordings",
        "view 2: no picture of a cup or wine glass in the last frame of 2 of 6 recordings",
        "1 damaged files count as if nothing was detected; the first, ",
        "c2/0003.png",
        "view 4: no picture of a cup or wine glass in the last frame of 6 of 6 recordings",
        "resnet18_level was trained for 1 epoch; its recipe has 30.",
    ] {
        assert!(report.contains(note), "{note}");
    }
    let message = refused(&[&words[..], &["--weights", "m1=w.pth"]].concat());
    assert!(message.contains("no system of this run has that network"), "{message}");
    for container in 1..=6 {
        std::fs::write(tables.join(format!("{container}/{}.csv", NAMES[container % 2])), "x")
            .unwrap();
    }
    let message = refused(&[&words[..], &["--quiet"]].concat());
    assert!(message.contains("no view of a training recording shows a container"), "{message}");
    assert!(message.contains("the first damaged one, "), "{message}");
}

#[test]
fn crops_of_videos_need_the_feature() {
    let folder = tempfile::tempdir().unwrap();
    let (ccm, out) = (folder.path().join("ccm"), folder.path().join("crops"));
    data(&ccm);
    // A video instead of the images of one view; the table tells of its last frame.
    let base = ccm.join("train/3");
    let shades = Path::new(env!("CARGO_MANIFEST_DIR")).join("../vision/tests/shades.mp4");
    std::fs::remove_dir_all(base.join(format!("rgb/{}/c1", NAMES[1]))).unwrap();
    std::fs::copy(shades, base.join(format!("rgb/{}_c1.mp4", NAMES[1]))).unwrap();
    let table = base.join(format!("detections/{}.csv", NAMES[1]));
    let rows = std::fs::read_to_string(&table).unwrap();
    std::fs::write(&table, format!("{rows}19,1,cup,0.8,2,3,10,20,\n")).unwrap();
    let output = run(&["crops", "--data", text(&ccm), "--out", text(&out)]);
    let picture = out.join(format!("3_{}_c1.png", NAMES[1]));
    if cfg!(feature = "video") {
        assert_eq!(output.status.code(), Some(0));
        let cup = corsmal_vision::Rgb::read(&picture).unwrap();
        // The brightest of its frames, red on the left.
        assert_eq!((cup.width, cup.height), (8, 17));
        assert!(cup.data[0] > 190 && cup.data[1] < 20, "{:?}", &cup.data[..3]);
    } else {
        assert_eq!(output.status.code(), Some(1));
        let said = String::from_utf8_lossy(&output.stderr).into_owned();
        assert!(said.contains("_c1.mp4: this program was built without video"), "{said}");
        assert!(!picture.exists() && out.join("labels.csv").exists());
        // Where there are only videos, that is said at once.
        let others = ccm.join("train");
        for container in [1, 2, 4, 5, 6] {
            std::fs::remove_dir_all(others.join(container.to_string())).unwrap();
        }
        std::fs::remove_dir_all(base.join(format!("rgb/{}", NAMES[1]))).unwrap();
        let again = folder.path().join("again");
        let message = refused(&["crops", "--data", text(&ccm), "--out", text(&again)]);
        assert!(message.contains("built without video") && !again.exists(), "{message}");
    }
}
