//! `inspect` of files that are neither sound nor features.

use std::path::Path;
use std::process::Output;

use corsmal_ccm::dataset::{Container, SequenceName};
use corsmal_ccm::synth::write_views;

use crate::command::{refused, tool};

fn inspect(args: &[&Path]) -> Output {
    tool().arg("inspect").args(args).output().unwrap()
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8(bytes.to_vec()).unwrap()
}

#[test]
fn models_and_predictions_are_explained() {
    let folder = tempfile::tempdir().unwrap();
    let predictions = folder.path().join("p.csv");
    std::fs::write(&predictions, "id,true,predicted\na,dog,dog\nb,cat,dog\n").unwrap();
    let shown = text(&inspect(&[&predictions]).stdout);
    assert!(shown.contains("2 rows · 3 columns") && shown.contains("predicted  dog 2"), "{shown}");
    assert!(shown.contains("accuracy   50.00 %"), "{shown}");
    let json = inspect(&[&predictions, "--json".as_ref()]);
    let found: serde_json::Value = serde_json::from_slice(&json.stdout).unwrap();
    assert_eq!((&found["accuracy"], &found["counts"]["true"]["cat"]), (&0.5.into(), &1.into()));
    let torn = folder.path().join("torn.model");
    std::fs::write(&torn, b"CORSMDL\0 and no more").unwrap();
    let refused = inspect(&[&torn]);
    assert_eq!(refused.status.code(), Some(1));
    assert!(text(&refused.stderr).contains("torn.model: "));
}

/// Everything else that the tool writes or reads is known by its content.
#[test]
fn every_kind_of_file_is_known() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    let shown = |file: &Path| -> (String, serde_json::Value) {
        let out = inspect(&[file]);
        assert!(out.status.success(), "{}", text(&out.stderr));
        let json = inspect(&[file, "--json".as_ref()]);
        (text(&out.stdout), serde_json::from_slice(&json.stdout).unwrap())
    };
    let written = |name: &str, content: &[u8]| {
        std::fs::write(path(name), content).unwrap();
        path(name)
    };
    let run = |words: &[&str]| {
        let out = tool().args(words).current_dir(folder.path()).output().unwrap();
        assert!(out.status.success(), "{words:?}: {}", text(&out.stderr));
        text(&out.stdout)
    };
    let container = Container::new(3).unwrap();
    let base = path("ccm/train/3");
    std::fs::create_dir_all(base.join("audio")).unwrap();
    for stem in ["s0_fi1_fu1_b0_l0", "s0_fi2_fu2_b0_l0"] {
        std::fs::write(base.join(format!("audio/{stem}_audio.wav")), b"").unwrap();
        let name = SequenceName::parse(stem).unwrap();
        write_views(&base, stem, container, name, 1).unwrap();
    }
    let name = "s0_fi1_fu1_b0_l0";

    let (calibration, json) = shown(&base.join(format!("calib/{name}_c1_calib.pickle")));
    assert!(calibration.contains("focal lengths 920.0, 920.0, principal point 645.0, 358.0"));
    assert!(calibration.contains("at -0.550, -1.100, 0.620"), "{calibration}");
    assert_eq!(json["cameras"]["rgb"]["intrinsic"][0][0], 920.0);
    let (detections, json) = shown(&base.join(format!("detections/{name}.json")));
    assert!(detections.contains("table of detections · json") && detections.contains("person × "));
    assert_eq!((&json["frames"], json["views"].as_object().unwrap().len()), (&2.into(), 4));
    let depth = shown(&base.join(format!("depth/{name}/c1/0000.png"))).0;
    assert!(depth.contains("depth image · 1280 × 720 px · ") && depth.contains("% measured"));
    let colour = shown(&base.join(format!("rgb/{name}/c1/0000.png"))).0;
    assert!(colour.contains("colour image · 1280 × 720 px"), "{colour}");
    let mut mask = corsmal_vision::Mask::empty(6, 5);
    mask.data[8] = true;
    // As other programs write them, too: 1 inside, of 8 and of 16 bits, grey as colour.
    let inside = |value: u16| mask.data.iter().map(move |&inside| u16::from(inside) * value);
    let (width, height) = (mask.width, mask.height);
    let deep = |value| corsmal_vision::Depth { width, height, data: inside(value).collect() };
    let bytes = inside(1).flat_map(|v| [v as u8; 3]).collect();
    let colour = corsmal_vision::Rgb { width, height, data: bytes };
    for png in [mask.to_png(), colour.to_png(), deep(1).to_png(), deep(u16::MAX).to_png()] {
        let mask = shown(&written("mask.png", &png.unwrap())).0;
        let want = "mask · 6 × 5 px · 1 px inside, columns 2 to 2, rows 1 to 1";
        assert!(mask.contains(want), "{mask}");
    }
    for other in [deep(700), deep(0)] {
        let depth = shown(&written("depth.png", &other.to_png().unwrap())).0;
        assert!(depth.contains("depth image · 6 × 5 px"), "{depth}");
    }

    run(&["capacity", "--method", "m5", "--data", "ccm", "--out", "m5.csv", "--quiet"]);
    let capacities = shown(&path("m5.csv")).0;
    assert!(capacities.contains("capacities · 2 rows") && capacities.contains("m5 2"));
    run(&["capacity", "train", "--method", "m3", "--data", "ccm", "--out", "m3.capacity", "-q"]);
    let (model, json) = shown(&path("m3.capacity"));
    assert!(
        model.contains("capacity model · json") && model.contains("categories     cup"),
        "{model}"
    );
    assert!(model.contains("capacity --method m3 --model"), "{model}");
    assert_eq!((&json["fused"], &json["provenance"]["recordings"]), (&false.into(), &2.into()));

    let line = r#"{"id":"a","status":"ok","true":"cup","predicted":"cup"}"#;
    let other =
        line.replace("\"predicted\":\"cup\"", "\"predicted\":\"box\"").replace("\"a\"", "\"b\"");
    let (lines, json) = shown(&written("p.jsonl", format!("{line}\n{other}\n").as_bytes()));
    assert!(lines.contains("predictions · jsonl · 2 rows") && lines.contains("50.00 %"), "{lines}");
    assert_eq!(json["counts"]["predicted"]["box"], 1);
    // One record is a line as well; marks and empty lists are known.
    for (name, text) in [
        ("one.jsonl", "{\"id\":\"a\",\"score\":1}\n".to_owned()),
        ("one.json", format!("{line}\n")),
        ("marked.jsonl", format!("\u{feff}{line}\n{line}\n")),
    ] {
        let (found, json) = shown(&written(name, text.as_bytes()));
        assert!(found.contains(" · jsonl · "), "{name}: {found}");
        assert_eq!(json["rows"], text.lines().count(), "{name}");
    }
    let found = shown(&written("none.json", b"\xef\xbb\xbf[]\n")).0;
    assert!(found.contains("table of detections · json"), "{found}");
    let (submission, _) =
        shown(&written("s.csv", b"Container ID,Sequence,Filling type,Filling level\n10,0,1,2\n"));
    assert!(submission.contains("submission in the format of 2020 · 1 row"), "{submission}");
    let cells = "frame,view,label,score,x_min,y_min,x_max,y_max\n0,1,cup,0.5,0,0,9,9\n";
    let table = shown(&written("d.csv", cells.as_bytes())).0;
    assert!(table.contains("table of detections · 1 row") && table.contains("cup 1"), "{table}");
    let other = shown(&written("x.json", br#"{"title": "T", "sections": [{"title": "S"}]}"#)).0;
    assert!(other.contains("report · json") && other.contains("sections       S"), "{other}");

    let preset = run(&["presets", "esc26", "--toml"]);
    let configuration = shown(&written("esc26.toml", preset.as_bytes())).0;
    assert!(configuration.contains("is preset esc26"), "{configuration}");
    let out = inspect(&[&written("bad.toml", b"[features.mfcc]\nn_mefl = 3\n")]);
    assert_eq!(out.status.code(), Some(1));
    assert!(text(&out.stderr).contains("n_mefl"), "{}", text(&out.stderr));
    for (name, content) in
        [("r.html", "<!DOCTYPE html><p>"), ("f.svg", "<svg xmlns=''/>"), ("f.pdf", "%PDF-1.7")]
    {
        assert!(
            shown(&written(name, content.as_bytes())).0.contains("open it in a browser or viewer")
        );
    }

    let tensors = |text: &str| {
        let bytes = [&(text.len() as u64).to_le_bytes(), text.as_bytes(), &[0; 16]].concat();
        String::from_utf8(inspect(&[&written("t.safetensors", &bytes)]).stderr).unwrap()
    };
    for (shape, offsets, reason) in [
        ("[3]", "[0,16]", "tensor w: 3 numbers of type F32 are 12 bytes, not 16"),
        ("[4,4294967296,4294967296]", "[0,16]", "tensor w: shape"),
        ("[4]", "[16,0]", "tensor w: bytes 16 to 0"),
        ("[3]", "[4,16]", "its tensors are not adjacent"),
    ] {
        let said = tensors(&format!(
            "{{\"w\":{{\"dtype\":\"F32\",\"shape\":{shape},\"data_offsets\":{offsets}}}}}"
        ));
        assert!(said.contains(reason), "{said}");
    }

    // What is damaged is said to be so, and never taken for sound.
    for (name, content, reason) in [
        ("b.json", &b"{\"kind\": \"corsmal-feat capacity model\", \"format\": 9}"[..], "b.json"),
        ("b.pickle", b"(dp0\n.", "no colour camera"),
        ("b.png", b"\x89PNG\r\n\x1a\n", "PNG"),
        ("b.safetensors", b"\xff\0\0\0\0\0\0\0{", "a header of 255 bytes in a file of 9"),
        ("b.jsonl", b"{\"a\": 1}\n{\"a\"\n", "line 2"),
        ("c.json", b"[1, 2", "not readable as JSON"),
    ] {
        let out = inspect(&[&written(name, content)]);
        assert_eq!(out.status.code(), Some(1), "{name}");
        let said = text(&out.stderr);
        assert!(said.contains(reason) && !said.contains("audio"), "{said}");
        let json = inspect(&[&path(name), "--json".as_ref()]);
        let refusal: serde_json::Value = serde_json::from_slice(&json.stdout).unwrap();
        assert_eq!(refusal["status"], "corrupt", "{name}");
    }
    let drawn = inspect(&[&path("x.json"), "--picture".as_ref(), &path("x.png")]);
    assert!(text(&drawn.stderr).contains("neither sound nor features"));
}

/// The accuracy is that of `score`: by the classes that it reads, not by the text of cells.
#[test]
fn predictions_are_as_right_as_their_score() {
    let folder = tempfile::tempdir().unwrap();
    let shown = |name: &str, text: &str| -> (String, serde_json::Value) {
        let path = folder.path().join(name);
        std::fs::write(&path, text).unwrap();
        let json = inspect(&[&path, "--json".as_ref()]);
        (self::text(&inspect(&[&path]).stdout), serde_json::from_slice(&json.stdout).unwrap())
    };
    // Without a class, the most probable one; "unknown" is none.
    let rows = [
        "id,true,predicted,p_cup,p_box",
        "a,cup,,0.9,0.1",
        "b,box,box,0.2,0.8",
        "c,box,unknown,0.4,0.6",
        "d,jug,cup,0.7,0.3",
    ];
    let (text, json) = shown("p.csv", &rows.join("\n"));
    assert!(text.contains("accuracy   50.00 %"), "{text}");
    // They were called no known audio format, and UTF-16 a part of MPEG audio.
    for separator in [";", "\t"] {
        let (_, json) = shown("s.csv", &rows.join("\n").replace(',', separator));
        assert_eq!(json["accuracy"], 0.5, "{separator:?}");
    }
    let wide: Vec<u8> = "\u{feff}id,x\n".encode_utf16().flat_map(u16::to_le_bytes).collect();
    std::fs::write(folder.path().join("w.csv"), wide).unwrap();
    let told = inspect(&[&folder.path().join("w.csv")]).stderr;
    assert!(self::text(&told).contains("text in UTF-16"), "{}", self::text(&told));
    let scored =
        tool().args(["score", "--json"]).arg(folder.path().join("p.csv")).output().unwrap();
    let scored: serde_json::Value = serde_json::from_slice(&scored.stdout).unwrap();
    assert_eq!(json["accuracy"], scored["scores"]["accuracy"]);
    let lines = rows[1..].iter().map(|row| {
        let cells: Vec<&str> = row.split(',').collect();
        serde_json::json!({"id": cells[0], "true": cells[1], "predicted": cells[2],
            "p_cup": cells[3].parse::<f64>().unwrap(), "p_box": cells[4].parse::<f64>().unwrap()})
    });
    let lines: Vec<String> = lines.map(|line| line.to_string()).collect();
    assert_eq!(shown("p.jsonl", &lines.join("\n")).1["accuracy"], 0.5);
    // What `score` refuses, and numbers, have none.
    assert_eq!(
        shown("e.csv", "id,true,predicted\na,cup,cup\nb,,cup\n").1["accuracy"],
        serde_json::Value::Null
    );
    assert_eq!(
        shown("n.csv", "id,true,predicted\na,1.5,1.5\nb,2.5,1.5\n").1["accuracy"],
        serde_json::Value::Null
    );
    // Values are counted up to a limit, and the most frequent shown.
    let many = |n: usize| (0..n).map(|i| format!("{i},{i},x\n")).collect::<String>();
    let (text, json) = shown("m.csv", &format!("id,predicted,status\n{}", many(1001)));
    assert!(text.contains("predicted  more than 1000 different values"), "{text}");
    assert_eq!(
        (&json["counts"]["predicted"], &json["counts"]["status"]["x"]),
        (&serde_json::Value::Null, &1001.into())
    );
    let (text, json) = shown("f.csv", &format!("id,predicted,status\n{}", many(25)));
    assert!(text.contains("and 5 more"), "{text}");
    assert_eq!(json["counts"]["predicted"].as_object().unwrap().len(), 25);
}

/// It was said to be no audio, in "0 recordings: -0.00 s".
#[test]
fn files_of_other_kinds_are_inspected_one_at_a_time() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("a.npz");
    std::fs::write(&file, b"PK\x03\x04 and so on").unwrap();
    let out = inspect(&[&file, folder.path()]);
    assert_eq!(out.status.code(), Some(2));
    assert!(text(&out.stderr).contains("a.npz: no recording: files of other kinds"));
    let out = inspect(&["-".as_ref()]);
    assert!(text(&out.stderr).contains("inspect reads files, not standard input"));
}

#[test]
fn addresses_and_pipes_are_no_files() {
    for command in
        [&["inspect"][..], &["pca", "--out", "x.npz"], &["train", "--target", "y", "--out", "x"]]
    {
        let told = refused(&[command, &["s3://secret/x.npz"]].concat());
        assert!(told.contains("copy it to one first"), "{told}");
    }
    let told = refused(&["train", "--target", "y", "--out", "x", "/dev/null"]);
    assert!(told.contains("gives its bytes once"), "{told}");
}
