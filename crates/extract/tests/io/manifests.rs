//! From manifests to inputs.

use std::fs;

use crate::inputs::ids;
use crate::support::{folder, text};
use corsmal_extract::inputs::{self, Input, InputSource};

#[test]
fn manifests_bring_stretches_and_labels() {
    let dir = folder(&["data/a.wav", "data/b.wav"]);
    let csv = dir.path().join("list.csv");
    fs::write(
        &csv,
        "\u{feff}level,path,id,start,end\n0,data/a.wav,,,\nhalf,data/a.wav,a-2,0.5,1.25\n\"a,b\",data/b.wav,,2,\n",
    )
    .unwrap();
    let found = inputs::collect(&[&csv]).unwrap().inputs;
    let row = |id: &str, file: &str, start, end, level: &str| Input {
        id: id.into(),
        source: InputSource::File(dir.path().join(file)),
        start,
        end,
        labels: vec![("level".into(), level.into())],
    };
    let expected = [
        row("data/a", "data/a.wav", None, None, "0"),
        row("a-2", "data/a.wav", Some(0.5), Some(1.25), "half"),
        row("data/b", "data/b.wav", Some(2.0), None, "a,b"),
    ];
    assert_eq!(found, expected);

    let json = dir.path().join("list.jsonl");
    let lines = [
        r#"{"path": "data/a.wav", "level": 0}"#,
        "",
        r#"{"level": "half", "end": 1.25, "path": "data/a.wav", "id": "a-2", "start": 0.5}"#,
        r#"{"path": "data/b.wav", "id": null, "start": 2, "level": "a,b"}"#,
    ];
    fs::write(&json, lines.join("\n")).unwrap();
    assert_eq!(inputs::collect(&[&json]).unwrap().inputs, expected);
}

#[test]
fn labels_of_different_lists_are_joined() {
    let dir = folder(&["a.wav", "b.wav", "c.wav"]);
    fs::write(dir.path().join("1.jsonl"), "{\"path\": \"a.wav\", \"x\": true}\n").unwrap();
    fs::write(dir.path().join("2.csv"), "path,y\nb.wav,2\n").unwrap();
    let names = ["1.jsonl", "2.csv", "c.wav"].map(|n| text(&dir.path().join(n)).to_string());
    let found = inputs::collect(&names).unwrap().inputs;
    let labels: Vec<Vec<&str>> =
        found.iter().map(|i| i.labels.iter().map(|(_, v)| v.as_str()).collect()).collect();
    assert_eq!(labels, [["true", ""], ["", "2"], ["", ""]]);
}

#[test]
fn stretches_of_one_file_get_ids_by_their_times() {
    let dir = folder(&["a.wav", "b.wav"]);
    let csv = dir.path().join("m.csv");
    fs::write(&csv, "path,start,end\na.wav,0.5,1\na.wav,1,\nb.wav,2,3\na.wav,,2\na.wav,,\n")
        .unwrap();
    let expected = ["a@0.5-1.0", "a@1.0-", "b", "a@0.0-2.0", "a"];
    assert_eq!(ids(&[text(&csv)]).unwrap(), expected);
    fs::write(&csv, "path,start,end\na.wav,0.5,1\na.wav,0.5,1\n").unwrap();
    let error = ids(&[text(&csv)]).unwrap_err();
    assert!(error.contains("both have the id") && error.contains("\"a@0.5-1.0\""), "{error}");
    assert!(error.contains("(line 2)") && error.contains("(line 3)"), "{error}");
}

#[test]
fn index_columns_of_pandas_are_no_labels() {
    let dir = folder(&["a.wav"]);
    let csv = dir.path().join("m.csv");
    fs::write(&csv, ",Unnamed: 0,path,y,\n0,0,a.wav,1,9\n").unwrap();
    let found = inputs::collect(&[&csv]).unwrap().inputs;
    assert_eq!(found[0].labels, [("y".to_string(), "1".to_string())]);
}

#[test]
fn manifest_errors_name_the_line() {
    let dir = folder(&["a.wav"]);
    let cases = [
        (
            "m.csv",
            "file\na.wav\n",
            "no column `path`: file; if file names the recordings, call it `path`",
        ),
        (
            "m.csv",
            "path,x,x\na.wav,1,2\n",
            "line 1: column 3 (\"x\") must have a name that no other column has",
        ),
        ("m.csv", "path,x\na.wav,1\na.wav\n", "line 3: "),
        ("m.csv", "path\na.wav\nb.wav\n", "line 3: "),
        ("m.csv", "path,start\na.wav,soon\n", "line 2: start = \"soon\" is not a time in seconds"),
        ("m.csv", "path,start\na.wav,nan\n", "line 2: start = \"nan\""),
        ("m.csv", "path,start\r\na.wav,\r\na.wav,x\r\n", "line 3: start = \"x\""),
        ("m.csv", "path,end\na.wav,-1\n", "line 2: end = \"-1\""),
        ("m.csv", "path,start,end\na.wav,2,2\n", "line 2: end = 2 is not after start = 2"),
        ("m.csv", "path,id\n,x\n", "line 2: no path"),
        ("m.csv", "path,id\na.wav,__x\n", "line 2: id \"__x\" must not begin with __"),
        ("m.csv", "path,id\na.wav,x.npy\n", "line 2: id \"x.npy\" must not end in .npy"),
        ("m.csv", "path,id\na.wav,../x\n", "line 2: id \"../x\" must not be an absolute path"),
        ("m.csv", "path,id\na.wav,/x\n", "line 2: id \"/x\" must not be an absolute path"),
        ("m.csv", "path,../../x\na.wav,1\n", "m.csv: the label \"../../x\" must not contain .."),
        ("m.csv", "path\n.\n", "is a folder"),
        ("m.jsonl", "{\"path\": \"a.wav\"}\n[1]\n", "line 2: "),
        ("m.jsonl", "{\"path\": \"a.wav\", \"x\": [1]}\n", "line 1: \"x\" must be a string"),
        ("m.jsonl", "{\"path\": \"a.wav\", \"path\": \"a.wav\"}\n", "line 1: key \"path\""),
        ("m.jsonl", "{\"path\": \"a.wav\"\n", "line 1: "),
    ];
    for (name, content, message) in cases {
        let path = dir.path().join(name);
        fs::write(&path, content).unwrap();
        let error = ids(&[text(&path)]).unwrap_err();
        assert!(error.starts_with(text(&path)) && error.contains(message), "{content:?}: {error}");
    }
}

/// Each took minutes, gigabytes or both: a manifest is read in time and memory that grow with its size.
#[test]
fn manifests_have_limits_that_are_named() {
    let dir = folder(&["a.wav"]);
    let columns = |n: usize| (0..n).map(|i| format!("c{i}")).collect::<Vec<_>>().join(",");
    let keys = |n: usize| (0..n).map(|i| format!(",\"k{i}\":1")).collect::<String>();
    let sparse = |n: usize| {
        let row = |i| format!("{{\"path\":\"a.wav\",\"id\":\"{i}\",\"k{i}\":1}}\n");
        (0..n).map(row).collect::<String>()
    };
    let long = "x".repeat(2 << 20);
    let tall = format!(
        "path,{}\n{}",
        columns(4000),
        "a.wav\n".repeat(4200).replace('\n', &format!("{}\n", ",".repeat(4000)))
    );
    let cases = [
        (
            "m.csv",
            format!("path,{}\na.wav\n", columns(100_000)),
            "more than 4096 different columns",
        ),
        ("m.jsonl", format!("{{\"path\":\"a.wav\"{}}}\n", keys(60_000)), "more than 4096"),
        ("m.jsonl", sparse(20_000), "line 4095: more than 4096 different columns"),
        ("m.csv", tall, "4195 rows with 4000 label columns are too many: at most 16777216"),
        ("m.csv", format!("path,id\na.wav,1\n{long}\n"), "line 3: longer than 1048576 bytes"),
        ("m.jsonl", format!("{{\"path\":\"a.wav\"}}\n{long}"), "line 2: longer than 1048576 bytes"),
        ("m.csv", format!("path,start\na.wav,{}\n", &long[..1 << 19]), "is not a time"),
        ("m.csv", format!("{}\na.wav\n", &long[..1 << 19]), "names no column `path`"),
        ("m.csv", format!("path,id\na.wav,__{}\n", &long[..1 << 19]), "must not begin with __"),
        ("m.csv", "path,id\na.wav,\u{1b}[2J\n".into(), "must not contain control characters"),
        (
            "m.jsonl",
            "\n{\"path\": \"a.wav\", \"x\": 1e999}\n".into(),
            "line 2: number out of range (column ",
        ),
    ];
    for (name, content, message) in cases {
        let path = dir.path().join(name);
        fs::write(&path, content).unwrap();
        let error = ids(&[text(&path)]).unwrap_err();
        assert!(error.contains(message), "{message}: {error:.500}");
        assert!(error.len() < 5000 && !error.contains('\u{1b}'), "{error:.500}");
    }
}

#[test]
fn times_of_events_are_refused_on_the_line_that_has_them() {
    let dir = folder(&["a.wav"]);
    let refused = |name: &str, lines: &str| {
        let path = dir.path().join(name);
        fs::write(&path, lines).unwrap();
        inputs::collect(&[text(&path)]).err().map(|e| e.to_string()).unwrap_or_default()
    };
    let json = "{\"path\": \"a.wav\", \"onset\": 1}\n\n{\"path\": \"a.wav\", \"onset\": 1, \"offset\": 2}\n";
    for (name, lines, place) in [
        ("m.jsonl", json, "m.jsonl, line 3: columns"),
        ("m.csv", "path,onset,offset\na.wav,1,2\n", "m.csv, line 2: columns"),
    ] {
        let why = refused(name, lines);
        assert!(why.contains(place) && why.contains("onset"), "{why}");
    }
}

#[test]
fn columns_that_look_like_times_are_told() {
    let dir = folder(&["a.wav"]);
    let csv = dir.path().join("m.csv");
    let told = |lines: &str| {
        fs::write(&csv, lines).unwrap();
        inputs::collect(&[text(&csv)]).unwrap().warning()
    };
    let warning = told("path,start_time,class\na.wav,0.5,x\n").unwrap();
    assert!(
        warning.starts_with("the column start_time is a label, so whole recordings are read"),
        "{warning}"
    );
    assert_eq!(told("path,start,onset\na.wav,0.5,1\n"), None);
    assert_eq!(told("path,class\na.wav,x\n"), None);
}

/// They became other labels in an `.npz`, whose texts end before it.
#[test]
fn labels_with_a_nul_are_refused() {
    let dir = folder(&["a.wav"]);
    let list = dir.path().join("m.jsonl");
    fs::write(&list, "{\"path\": \"a.wav\", \"room\": \"x\\u0000\"}\n").unwrap();
    let refused = inputs::collect(&[&list]).unwrap_err().to_string();
    assert!(refused.contains("the label \"room\" has a NUL character"), "{refused}");
}
