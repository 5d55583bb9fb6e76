//! Every figure draws as SVG, PNG and PDF, odd contents included.

// Helper functions of tests may unwrap as tests do.
#![allow(clippy::unwrap_used)]

use std::collections::HashSet;

use corsmal_plot::{
    ChannelPicture, ConfusionMatrix, DEFAULT_DPI, FeaturePanel, FeaturePicture, Figure, HeatMap,
    Histogram, Line, LinePlot, Mark, RecordingPicture, Rgb, ScorePlot, ScoreRow, Slope, Slopes,
    WaveScale, sequential, to_pdf, to_png, to_svg,
};
use ndarray::{Array2, arr2};

fn recording(channels: usize) -> RecordingPicture {
    let level = |(b, t): (usize, usize)| -80.0 + (b as f32 * 1.3 + t as f32 * 0.4) % 80.0;
    let channel = |i: usize| ChannelPicture {
        label: format!("ch {i}"),
        notes: if i == 1 { vec!["clipped in 3 places".into()] } else { Vec::new() },
        envelope: (0..300).map(|t| (-0.4 * (t as f32 * 0.05).sin().abs(), 0.2)).collect(),
        levels: Array2::from_shape_fn((64, 300), level),
    };
    RecordingPicture {
        title: "s1_fi0_fu0_b1_l0_audio.wav".into(),
        subtitle: "8 channels · 44100 Hz · 1.249 s".into(),
        time: (2.0, 3.249),
        frequencies: vec![(1000.0, 0.3), (10_000.0, 0.8), (100.0, 0.03)],
        level_range: (-80.0, 0.0),
        level_label: "dB re loudest band".into(),
        wave_scale: WaveScale::Shared,
        channels: (0..channels).map(channel).collect(),
    }
}

fn scores() -> ScorePlot {
    let mark =
        |series, value: f64| Mark { series, value, interval: Some((value - 3.0, value + 2.0)) };
    let row = |name: &str, marks| ScoreRow { name: name.into(), marks };
    ScorePlot {
        title: "Filling type & level <test>".into(),
        value_label: "weighted F1, percent".into(),
        series: vec!["published".into(), "corrected".into()],
        rows: vec![
            row("kNN", vec![mark(0, 61.2), mark(1, 55.0)]),
            row("a forest with a name that is far longer than there is room for it", vec![]),
            row("SVM", vec![Mark { series: 1, value: f64::NAN, interval: None }]),
        ],
        range: Some((0.0, 100.0)),
    }
}

fn confusion() -> ConfusionMatrix {
    ConfusionMatrix {
        title: "Filling type".into(),
        labels: ["none", "pasta", "rice", "water"].map(String::from).to_vec(),
        counts: arr2(&[[200, 4, 0, 12], [0, 190, 20, 6], [3, 31, 180, 2], [9, 0, 0, 0]]),
        f1: vec![94.3, 86.2, f64::NAN, 0.0],
    }
}

fn features() -> FeaturePicture {
    let panel = |rows: usize| FeaturePanel {
        label: format!("{rows} rows, channel 0"),
        values: Array2::from_shape_fn((rows, 90), |(r, t)| (r as f32 - 2.0) * (t as f32).sin()),
        span: (rows == 12).then_some((0.5, 1.5)),
        rows: Vec::new(),
        unit: "value".into(),
    };
    FeaturePicture {
        title: "x".into(),
        subtitle: "mfcc, zcr".into(),
        time: (0.0, 2.0),
        time_label: "time, seconds".into(),
        panels: [1, 12, 128].map(panel).to_vec(),
    }
}

fn lines() -> LinePlot {
    let points: Vec<_> = (1..9).map(|i| (f64::from(i) * 40.0, 60.0 + f64::from(i) * 3.0)).collect();
    let band = points.iter().map(|p| (p.1 - 4.0, p.1 + 4.0)).collect();
    let nothing = Line { name: "none".into(), points: vec![], band: vec![] };
    LinePlot {
        title: "Learning curve".into(),
        x_label: "training recordings".into(),
        y_label: "accuracy, percent".into(),
        x_range: None,
        y_range: None,
        lines: vec![Line { name: "held out".into(), points, band }, nothing],
        diagonal: true,
        dots: true,
        joined: true,
    }
}

/// Width and height of a PNG, and the share of its pixels that are not white.
fn decode(bytes: &[u8]) -> (u32, u32, f64) {
    let mut reader = png::Decoder::new(std::io::Cursor::new(bytes)).read_info().unwrap();
    let mut pixels = vec![0; reader.output_buffer_size().unwrap()];
    let info = reader.next_frame(&mut pixels).unwrap();
    let inked = pixels.chunks(3).filter(|p| *p != [255; 3]).count();
    (info.width, info.height, inked as f64 / (pixels.len() / 3) as f64)
}

/// Colours that occur in a PNG.
fn colors(bytes: &[u8]) -> HashSet<[u8; 3]> {
    let mut reader = png::Decoder::new(std::io::Cursor::new(bytes)).read_info().unwrap();
    let mut pixels = vec![0; reader.output_buffer_size().unwrap()];
    reader.next_frame(&mut pixels).unwrap();
    pixels.chunks(3).map(|p| [p[0], p[1], p[2]]).collect()
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
    assert!(!svg.contains("NaN") && !svg.contains("\"inf"), "{name}");
    let png = to_png(figure, DEFAULT_DPI).unwrap();
    let (width, height) = figure.size();
    let (across, down, inked) = decode(&png);
    assert_eq!((across, down), ((2.0 * width).ceil() as u32, (2.0 * height).ceil() as u32));
    assert!(inked > 0.001, "{name} is blank");
    if let Some(folder) = std::env::var_os("CORSMAL_PICTURES") {
        let path = std::path::Path::new(&folder).join(name);
        std::fs::write(path.with_extension("svg"), &svg).unwrap();
        std::fs::write(path.with_extension("png"), &png).unwrap();
        std::fs::write(path.with_extension("pdf"), to_pdf(figure).unwrap()).unwrap();
    }
    svg
}

#[test]
fn recordings() {
    for channels in [0, 1, 4, 8, 16] {
        let svg = check(&recording(channels), &format!("recording-{channels}"));
        assert_eq!(svg.matches("<image").count(), channels + usize::from(channels > 0));
        assert_eq!(svg.contains("clipped in 3 places"), channels > 1, "notes are in the picture");
        // The time axis begins where the excerpt does.
        assert!(svg.contains(">2.2<") && !svg.contains(">1.8<"));
    }
}

#[test]
fn a_quiet_channel_fills_its_own_scale() {
    let mut picture = recording(2);
    picture.channels[1].envelope = vec![(-0.001, 0.001); 300];
    let shared = check(&picture, "recording-shared");
    assert_eq!((shared.matches(">0.40<").count(), shared.matches(">0.0010<").count()), (2, 0));
    picture.wave_scale = WaveScale::Channel;
    let own = check(&picture, "recording-own");
    assert_eq!((own.matches(">0.40<").count(), own.matches(">0.0010<").count()), (1, 1));
}

#[test]
fn recordings_without_content() {
    let mut picture = recording(2);
    picture.time = (0.0, 0.0);
    for channel in &mut picture.channels {
        channel.envelope.clear();
        channel.levels = Array2::zeros((64, 0));
    }
    check(&picture, "recording-empty");
}

#[test]
fn features_are_curves_or_colours() {
    let svg = check(&features(), "features");
    // Two panels of several rows and their colour bars; one curve.
    assert_eq!(svg.matches("<image").count(), 4);
    let mut odd = features();
    odd.panels[0].values.fill(f32::NAN);
    odd.panels[1].values.fill(f32::NAN);
    odd.panels[2].values = Array2::zeros((0, 0));
    check(&odd, "features-odd");
}

#[test]
fn score_plots() {
    let svg = check(&scores(), "scores");
    assert!(svg.contains("Filling type &amp; level &lt;test&gt;") && svg.contains("…</text>"));
    assert!(svg.contains("kNN corrected: 55.00 (52.00 to 57.00)"));
    // 0 and 100 are on the scale.
    assert!(svg.contains(">0</text>") && svg.contains(">100</text>"));
    check(&ScorePlot { rows: vec![], series: vec![], range: None, ..scores() }, "scores-none");
}

#[test]
fn confusion_matrices() {
    let svg = check(&confusion(), "confusion");
    assert!(svg.contains(">200<") && svg.contains(">93 %<") && svg.contains(">94.3<"));
    assert!(!svg.contains("none given"));
    let ragged = ConfusionMatrix { counts: Array2::zeros((2, 1)), f1: vec![], ..confusion() };
    check(&ragged, "confusion-ragged");
    let mut missing = Array2::zeros((4, 5));
    missing[[1, 4]] = 7;
    let svg = check(&ConfusionMatrix { counts: missing, ..confusion() }, "confusion-missing");
    assert!(svg.contains("pasta estimated as none given: 7 of 7"));
    let many = (0..50).map(|i| format!("class number {i}")).collect();
    let many = ConfusionMatrix { labels: many, counts: Array2::eye(50), ..confusion() };
    let svg = check(&many, "confusion-many");
    assert_eq!(svg.matches("estimated as").count(), 50, "empty cells are left out");
}

#[test]
fn other_figures() {
    check(&lines(), "lines");
    let (counts, range) = Histogram::of(&[1.0, 2.0, 2.1, f64::NAN, 9.0], 8);
    assert_eq!((counts.iter().sum::<u64>(), range), (4, (1.0, 9.0)));
    let histogram = Histogram {
        title: "Durations".into(),
        value_label: "seconds".into(),
        count_label: "recordings".into(),
        range,
        counts,
    };
    check(&histogram, "histogram");
    let slope = |name: &str, before, after| Slope { name: name.into(), before, after };
    let slopes = Slopes {
        title: "What correcting changes".into(),
        before: "published".into(),
        after: "corrected".into(),
        lines: vec![slope("kNN", 80.0, 61.0), slope("SVM", 40.0, 62.0), slope("?", f64::NAN, 1.0)],
    };
    let svg = check(&slopes, "slopes");
    assert!(svg.contains("61.0  kNN") && !svg.contains("1.0  ?"));
    let heat = HeatMap {
        title: "By container".into(),
        value_label: "weighted F1, percent".into(),
        rows: vec!["kNN".into(), "Forest".into()],
        columns: vec!["1".into(), "Scenario 2".into()],
        values: arr2(&[[10.0, f64::NAN], [99.0, 50.0]]),
        range: (0.0, 100.0),
    };
    let svg = check(&heat, "heat");
    assert!(svg.contains("Forest, 1: 99.00") && svg.contains(">–<"));
}

#[test]
fn the_resolution_is_asked_for_and_told() {
    let png = to_png(&confusion(), 300).unwrap();
    let reader = png::Decoder::new(std::io::Cursor::new(&png[..])).read_info().unwrap();
    let pixels = reader.info().pixel_dims.unwrap();
    assert_eq!((pixels.xppu, pixels.unit), (11_811, png::Unit::Meter));
    let (width, _) = confusion().size();
    assert_eq!(reader.info().width, (width * 300.0 / 96.0).ceil() as u32);
}

/// Letters are drawn, in the bundled font: a longer text inks more of the paper.
#[test]
fn text_is_drawn_in_png_and_kept_as_text_in_pdf() {
    let titled = |title: &str| ConfusionMatrix { title: title.into(), ..confusion() };
    let inked = |title: &str| decode(&to_png(&titled(title), DEFAULT_DPI).unwrap()).2;
    assert!(inked("Filling type of all") > inked(""));
    let pdf = to_pdf(&titled("Filling type")).unwrap();
    assert!(pdf.starts_with(b"%PDF-"));
    let has = |what: &[u8]| pdf.windows(what.len()).any(|w| w == what);
    assert!(has(b"Inter") && has(b"ToUnicode"), "the font is embedded and text can be copied");
}

/// The spectrogram is in the PNG, in its own colours and without smoothing.
#[test]
fn images_are_drawn() {
    let mut picture = recording(1);
    picture.channels[0].levels = Array2::from_elem((64, 300), -40.0);
    let Rgb(r, g, b) = sequential(0.5);
    assert!(colors(&to_png(&picture, DEFAULT_DPI).unwrap()).contains(&[r, g, b]));
    let without = colors(&to_png(&confusion(), DEFAULT_DPI).unwrap());
    assert!(!without.contains(&[r, g, b]));
    let pdf = to_pdf(&picture).unwrap();
    assert!(pdf.windows(14).any(|w| w == b"/Subtype/Image" || w.starts_with(b"/Subtype /Imag")));
}

/// Headings are set in the heavier weight.
#[test]
fn both_weights_are_drawn() {
    let plain = ConfusionMatrix { title: "M".repeat(12), ..confusion() };
    let svg = to_svg(&plain).unwrap();
    assert!(svg.contains("font-weight=\"600\""));
    let pdf = to_pdf(&plain).unwrap();
    assert!(pdf.windows(14).any(|w| w == b"Inter-SemiBold"));
}

#[test]
fn absurd_sizes_are_refused() {
    let labels = vec!["x".repeat(10); 600];
    let huge = ConfusionMatrix { labels, ..confusion() };
    let error = to_png(&huge, DEFAULT_DPI).unwrap_err().to_string();
    assert!(error.contains("lower resolution"), "{error}");
    assert!(to_png(&confusion(), u16::MAX).is_err());
}
