//! The page and the files beside it.

#![allow(clippy::unwrap_used)]

use corsmal_plot::{Mark, ScorePlot, ScoreRow};
use corsmal_report::{
    Cell, Fact, Figure, FigureGroup, Report, Row, Section, Snippet, Source, Table,
};

fn figure(name: &str) -> Figure {
    let mark = Mark { series: 0, value: 50.0, interval: None };
    let plot = ScorePlot {
        title: format!("Plot <{name}>"),
        value_label: "percent".into(),
        series: vec!["one".into()],
        rows: vec![ScoreRow { name: "kNN".into(), marks: vec![mark] }],
        range: Some((0.0, 100.0)),
    };
    Figure::new(name, "What is seen.", &plot).unwrap()
}

fn table(columns: usize) -> Table {
    let row = |source, score: Cell| {
        let scores = std::iter::repeat_n(score, columns);
        Row { source, cells: std::iter::once(Cell::text("A & <B>")).chain(scores).collect() }
    };
    Table {
        name: format!("t{columns}"),
        caption: "Scores".into(),
        columns: std::iter::once("Method".to_owned())
            .chain((0..columns).map(|c| format!("C{c}")))
            .collect(),
        rows: vec![
            row(Source::Ours, Cell::Score(91.31, Some((88.0, 94.0)))),
            row(Source::Paper, Cell::Score(87.59, None)),
            row(Source::Paper, Cell::None),
        ],
    }
}

fn report() -> Report {
    let section = Section {
        text: vec!["One < two.".into()],
        terms: vec![Fact::new("M1", "a team")],
        figures: vec![figure("first")],
        tables: vec![table(2), table(12)],
        groups: ["open", "closed"]
            .map(|title| FigureGroup { title: title.into(), figures: vec![figure(title)] })
            .to_vec(),
        snippets: vec![Snippet { title: "BibTeX".into(), text: "@article{x,\n}".into() }],
        ..Section::new("s", "Section")
    };
    Report {
        warning: Some("Beware".into()),
        facts: vec![Fact::linked("Paper", "its name", "https://example.org/a?b&c")],
        sections: vec![section],
        ..Report::new("A report")
    }
}

#[test]
fn the_page_stands_alone_and_escapes() {
    let html = report().html();
    for outside in ["src=", "@import", "<link ", "url("] {
        assert!(!html.contains(outside), "the page needs {outside}");
    }
    assert!(html.contains("<a href=\"https://example.org/a?b&amp;c\">its name</a>"));
    assert!(html.contains("One &lt; two.") && html.contains("A &amp; &lt;B&gt;"));
    assert!(html.contains("@article{x,\n}"));
    assert_eq!(html.matches("<details").count(), html.matches("</details>").count());
    assert_eq!(html.matches("<details open>").count(), 1);
}

/// A bar is a share of its own track, which is as long in every column.
#[test]
fn bars_have_one_scale() {
    let html = report().html();
    assert!(html.contains("<i class=\"bar\" style=\"--share:91.31%\">"));
    assert!(html.contains("--share:87.59%") && html.contains("88.0\u{2013}94.0"));
    assert!(html.contains(".bar{align-self:center;flex:none;width:64px"));
    assert!(!html.contains("<td style="), "no bar is a share of its cell");
    // Wide tables have numbers only.
    assert_eq!(html.matches("class=\"bar\"").count(), 4);
}

/// The script takes cells without a value for missing, and leaves them at the end.
#[test]
fn missing_values_have_no_value_to_sort_by() {
    let html = report().html();
    assert!(html.contains("<td class=\"unknown\">\u{2013}</td>"));
    assert!(!html.contains("data-value=\"-1\""));
    assert!(html.contains("(x === null) - (y === null)"));
}

#[test]
fn paper_shows_everything() {
    let html = report().html();
    let print = html.split("@media print{").nth(1).unwrap();
    for rule in [
        ".scroll,.card,.drawing{overflow:visible}",
        "white-space:normal",
        "details::details-content{content-visibility:visible",
        "break-inside:avoid",
        "thead{display:table-header-group}",
    ] {
        assert!(print.contains(rule), "{rule}");
    }
    assert!(html.contains("@page{size:A4") && html.contains("beforeprint"));
}

#[test]
fn every_table_and_figure_has_its_files() {
    let dir = tempfile::tempdir().unwrap();
    report().write(dir.path(), &[]).unwrap();
    let read = |name: &str| std::fs::read(dir.path().join(name)).unwrap();
    for name in ["first", "open", "closed"] {
        assert!(read(&format!("figures/{name}.svg")).starts_with(b"<svg"));
        assert!(read(&format!("figures/{name}.pdf")).starts_with(b"%PDF"));
    }
    let csv = String::from_utf8(read("tables/t2.csv")).unwrap();
    assert!(csv.contains("ours,A & <B>,91.3100,88.0000,94.0000"), "{csv}");
    assert!(String::from_utf8(read("tables/t12.tex")).unwrap().contains("{lrrrrrrrrrrrr}"));
    let json: serde_json::Value = serde_json::from_slice(&read("report.json")).unwrap();
    assert_eq!(json["sections"][0]["tables"][0]["rows"][0]["cells"][1], 91.31);
    // The next report removes what this one wrote, and nothing else.
    let at = |name: &str| dir.path().join(name);
    let twice = [report().sections[0].figures[0].clone()];
    report().write(dir.path(), &twice).unwrap();
    assert!(at("figures/first-2.svg").exists());
    std::fs::write(at("figures/own.pdf"), "mine").unwrap();
    let outside = json.as_object().unwrap().clone();
    let mut outside = serde_json::Value::from(outside);
    // As the first reports were.
    let mut old = outside.clone();
    old.as_object_mut().unwrap().remove("files");
    std::fs::write(at("report.json"), old.to_string()).unwrap();
    corsmal_report::Report::new("empty").write(dir.path(), &[]).unwrap();
    let left = |folder: &str| std::fs::read_dir(at(folder)).unwrap().count();
    assert_eq!((left("tables"), left("figures")), (0, 3), "own and the second `first`");
    report().write(dir.path(), &twice).unwrap();
    let files = outside["files"].as_array_mut().unwrap();
    files.extend(["figures/first-2.svg", "figures/first-2.pdf"].map(Into::into));
    files.extend(["../file", "figures/../notes", "notes", "/figures/x"].map(Into::into));
    std::fs::write(at("report.json"), outside.to_string()).unwrap();
    std::fs::write(at("notes"), "mine").unwrap();
    let mut more = report().sections[0].figures[0].clone();
    more.name = "more".into();
    corsmal_report::Report::new("empty").write(dir.path(), &[more]).unwrap();
    let mut left: Vec<String> = std::fs::read_dir(at("figures"))
        .unwrap()
        .map(|entry| entry.unwrap().file_name().into_string().unwrap())
        .collect();
    left.sort();
    assert_eq!(left, ["more.pdf", "more.svg", "own.pdf"]);
    assert!(at("notes").exists() && std::fs::read_dir(at("tables")).unwrap().next().is_none());
    let blocked = dir.path().join("file");
    std::fs::write(&blocked, "").unwrap();
    let error = report().write(&blocked.join("x"), &[]).unwrap_err().to_string();
    assert!(error.starts_with("cannot make the folder"), "{error}");
}

/// It said that its own files were another's, also when it was to replace them.
#[test]
fn what_a_report_leaves_that_breaks_off_is_removed_by_the_next() {
    let dir = tempfile::tempdir().unwrap();
    let at = |name: &str| dir.path().join(name);
    std::fs::create_dir_all(at("figures/open.svg")).unwrap();
    report().write(dir.path(), &[]).unwrap_err();
    assert!(at("tables/t2.csv").is_file() && !at("report.html").exists());
    let said: serde_json::Value =
        serde_json::from_slice(&std::fs::read(at("report.json")).unwrap()).unwrap();
    let files: Vec<&str> =
        said["files"].as_array().unwrap().iter().filter_map(|file| file.as_str()).collect();
    assert!(files.contains(&"tables/t2.csv") && files.contains(&"figures/open.svg"), "{files:?}");
    std::fs::remove_dir(at("figures/open.svg")).unwrap();
    corsmal_report::Report::new("empty").write(dir.path(), &[]).unwrap();
    let left = |folder: &str| std::fs::read_dir(at(folder)).unwrap().count();
    assert_eq!((left("tables"), left("figures")), (0, 0));
    assert!(at("report.html").is_file());
}
