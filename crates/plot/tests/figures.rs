//! Every figure draws as SVG and as PNG, odd contents included.

// Helper functions of tests may unwrap as tests do.
#![allow(clippy::unwrap_used)]

use corsmal_plot::{
    BarChart, ChannelPicture, ConfusionMatrix, Figure, RecordingPicture, Series, to_png, to_svg,
};
use ndarray::{Array2, arr2};

fn recording(channels: usize) -> RecordingPicture {
    let level = |(b, t): (usize, usize)| -80.0 + (b as f32 * 1.3 + t as f32 * 0.4) % 80.0;
    let channel = |i: usize| ChannelPicture {
        label: format!("channel {i}"),
        envelope: (0..300).map(|t| (-0.4 * (t as f32 * 0.05).sin().abs(), 0.2)).collect(),
        levels: Array2::from_shape_fn((64, 300), level),
    };
    RecordingPicture {
        title: "s1_fi0_fu0_b1_l0_audio.wav".into(),
        subtitle: "8 channels · 44100 Hz · 1.249 s".into(),
        seconds: 1.249,
        frequencies: vec![(100.0, 0.03), (1000.0, 0.3), (10_000.0, 0.8)],
        level_range: (-80.0, 0.0),
        level_label: "dB re full scale".into(),
        channels: (0..channels).map(channel).collect(),
    }
}

fn bars() -> BarChart {
    let series = |name: &str, values: &[f64], errors: &[f64]| Series {
        name: name.into(),
        values: values.to_vec(),
        errors: errors.to_vec(),
    };
    BarChart {
        title: "Filling type & level <test>".into(),
        value_label: "weighted F1 (%)".into(),
        groups: vec!["kNN".into(), "random forest".into(), "SVM".into()],
        series: vec![
            series("ESC-26", &[61.2, 78.4, f64::NAN], &[2.0, 3.1]),
            series("A34F", &[66.0, 83.9, 81.2], &[]),
        ],
    }
}

fn confusion() -> ConfusionMatrix {
    ConfusionMatrix {
        title: "Filling type".into(),
        labels: ["none", "pasta", "rice", "water"].map(String::from).to_vec(),
        counts: arr2(&[[200, 4, 0, 12], [0, 190, 20, 6], [3, 31, 180, 2], [9, 0, 0, 0]]),
    }
}

fn decode(bytes: &[u8]) -> (u32, u32) {
    let mut reader = png::Decoder::new(std::io::Cursor::new(bytes)).read_info().unwrap();
    let mut pixels = vec![0; reader.output_buffer_size().unwrap()];
    let info = reader.next_frame(&mut pixels).unwrap();
    assert!(pixels.iter().any(|p| *p != pixels[0]), "a blank picture");
    (info.width, info.height)
}

/// Element names are closed in order: enough of a parser to notice broken markup.
fn well_formed(svg: &str) {
    let mut open = Vec::new();
    for tag in svg.split('<').skip(1) {
        let (tag, _) = tag.split_once('>').expect("closed tag");
        if let Some(name) = tag.strip_prefix('/') {
            assert_eq!(open.pop(), Some(name));
        } else if !tag.ends_with('/') {
            open.push(tag.split(' ').next().expect("name"));
        }
    }
    assert!(open.is_empty(), "unclosed {open:?}");
}

fn check(figure: &dyn Figure, name: &str) -> String {
    let svg = to_svg(figure).unwrap();
    well_formed(&svg);
    assert!(!svg.contains("NaN") && !svg.contains("inf"), "{name}");
    let png = to_png(figure).unwrap();
    let (width, height) = figure.size();
    assert_eq!(decode(&png), ((2.0 * width).ceil() as u32, (2.0 * height).ceil() as u32));
    if let Some(folder) = std::env::var_os("CORSMAL_PICTURES") {
        let path = std::path::Path::new(&folder).join(name);
        std::fs::write(path.with_extension("svg"), &svg).unwrap();
        std::fs::write(path.with_extension("png"), &png).unwrap();
    }
    svg
}

#[test]
fn recordings() {
    for channels in [0, 1, 4, 8, 16] {
        let svg = check(&recording(channels), &format!("recording-{channels}"));
        assert_eq!(svg.matches("<image").count(), channels + usize::from(channels > 0));
        assert_eq!(svg.matches("<path").count(), channels);
    }
}

#[test]
fn recordings_without_content() {
    let mut picture = recording(2);
    picture.seconds = 0.0;
    for channel in &mut picture.channels {
        channel.envelope.clear();
        channel.levels = Array2::zeros((64, 0));
    }
    check(&picture, "recording-empty");
}

#[test]
fn bar_charts() {
    let svg = check(&bars(), "bars");
    assert!(svg.contains("Filling type &amp; level &lt;test&gt;"));
    assert!(svg.contains("78.4") && svg.contains("A34F"));
    let nothing = BarChart { groups: vec![], series: vec![], ..bars() };
    check(&nothing, "bars-none");
    let mut negative = bars();
    negative.series[0].values = vec![-20.0, 5.0, 0.0];
    check(&negative, "bars-negative");
}

#[test]
fn confusion_matrices() {
    let svg = check(&confusion(), "confusion");
    assert!(svg.contains(">200<") && svg.contains(">93%<"));
    let ragged = ConfusionMatrix { counts: Array2::zeros((2, 1)), ..confusion() };
    check(&ragged, "confusion-ragged");
}

#[test]
fn absurd_sizes_are_refused() {
    let labels = vec!["x".repeat(10); 400];
    let huge = ConfusionMatrix { labels, ..confusion() };
    assert!(to_png(&huge).is_err());
}
