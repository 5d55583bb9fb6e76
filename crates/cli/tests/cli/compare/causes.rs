//! Every likely cause.

use corsmal_files::npy::{DType, Header, Kind};
use corsmal_files::npz::{Compression, NpzWriter};
use ndarray::{Array3, Axis, s};
use serde_json::Value;

use super::support::{Files, levels, npz, powers, text};

/// The report on one array `x` of two values.
fn report(a: &Array3<f32>, b: &Array3<f32>) -> Value {
    let files = Files::new();
    npz(&files.path("a.npz"), &[("x", a)]);
    npz(&files.path("b.npz"), &[("x", b)]);
    files.json("a.npz", "b.npz", &[])
}

/// Kind, cause and evidence of the first cause.
fn first_cause(report: &Value) -> (String, String, String) {
    let cause = &report["features"][0]["causes"][0];
    let word = |key: &str| cause[key].as_str().unwrap_or_default().to_string();
    (word("kind"), word("cause"), word("evidence"))
}

#[track_caller]
fn expect(a: &Array3<f32>, b: &Array3<f32>, kind: &str, words: &[&str]) {
    let report = report(a, b);
    let (found, cause, evidence) = first_cause(&report);
    assert_eq!(found, kind, "{report:#}");
    for word in words {
        assert!(format!("{cause}; {evidence}").contains(word), "{word:?}: {cause}; {evidence}");
    }
    assert_eq!(report["within"], false);
}

#[test]
fn equal_files_are_equal() {
    let files = Files::new();
    npz(&files.path("a.npz"), &[("x", &levels())]);
    let out = files.run("a.npz", "a.npz", &[]);
    assert_eq!(out.status.code(), Some(0));
    let shown = text(&out.stdout);
    assert!(shown.contains("100.0 %") && shown.contains("equal within the tolerance"), "{shown}");
    assert!(out.stderr.is_empty());
}

#[test]
fn statistics_name_the_largest_difference() {
    let (a, mut b) = (levels(), levels());
    b[(1, 12, 30)] += 0.25;
    b[(2, 3, 4)] -= 0.125;
    let report = report(&a, &b);
    let feature = &report["features"][0];
    assert_eq!(feature["values"], 7200);
    assert_eq!(feature["equal"], 7198);
    assert_eq!(feature["largest"]["index"], serde_json::json!([1, 12, 30]));
    let close = |key: &str, expected: f64| {
        let value = feature[key].as_f64().unwrap();
        assert!((value / expected - 1.0).abs() < 1e-4, "{key} = {value}, expected {expected}");
    };
    close("rms", ((0.0625 + 0.015_625) / 7200.0f64).sqrt());
    let relative = |at: (usize, usize, usize)| {
        f64::from((a[at] - b[at]).abs()) / f64::from(a[at].abs().max(b[at].abs()))
    };
    close("max_relative", relative((1, 12, 30)).max(relative((2, 3, 4))));
    assert!(feature["correlation"].as_f64().unwrap() > 0.9999);
    assert!(feature["causes"].as_array().unwrap().iter().all(|c| c["kind"] != "offset"));
}

#[test]
fn tolerances_decide_the_exit_code() {
    let files = Files::new();
    npz(&files.path("a.npz"), &[("x", &levels())]);
    npz(&files.path("b.npz"), &[("x", &levels().mapv(|v| v + 1e-3))]);
    let code = |more: &[&str]| files.run("a.npz", "b.npz", more).status.code();
    assert_eq!(code(&[]), Some(1));
    assert_eq!(code(&["--tolerance", "1e-4"]), Some(0));
    assert_eq!(code(&["--atol", "2e-3"]), Some(0));
    assert_eq!(code(&["--rtol", "1e-4"]), Some(1));
    assert_eq!(code(&["--atol", "1e-3", "--rtol", "1e-2"]), Some(0));
    assert_eq!(code(&["--atol", "-1"]), Some(2));
    assert_eq!(code(&["--tolerance", "1e-4", "--atol", "1"]), Some(2));
}

#[test]
fn rounding_is_told_from_change() {
    let (files, a) = (Files::new(), levels());
    npz(&files.path("a.npz"), &[("x", &a)]);
    npz(&files.path("b.npz"), &[("x", &a.mapv(|v| f32::from_bits(v.to_bits() + 1)))]);
    let report = files.json("a.npz", "b.npz", &["--atol", "0"]);
    let (kind, cause, _) = first_cause(&report);
    assert_eq!((kind.as_str(), cause.as_str()), ("rounding", "the same within float rounding"));
    assert_eq!(report["within"], false);
    assert_eq!(files.run("a.npz", "b.npz", &[]).status.code(), Some(0));
}

#[test]
fn half_precision_is_recognised() {
    let (files, a) = (Files::new(), levels());
    npz(&files.path("a.npz"), &[("x", &a)]);
    let mut writer = NpzWriter::create(&files.path("b.npz"), Compression::Stored).unwrap();
    let half = DType { kind: Kind::Float, itemsize: 2, big_endian: false };
    let bytes: Vec<u8> = a.iter().flat_map(|&v| half::f16::from_f32(v).to_le_bytes()).collect();
    writer.array("x", &Header::new(half, &[3, 40, 60]), &bytes).unwrap();
    writer.finish().unwrap();
    let report = files.json("a.npz", "b.npz", &[]);
    assert_eq!(first_cause(&report).0, "precision", "{report:#}");
    assert_eq!(report["features"][0]["dtypes"], serde_json::json!(["<f4", "<f2"]));
}

#[test]
fn a_side_without_a_sound() {
    let a = levels();
    expect(&a, &a.mapv(|_| 0.0), "constant", &["b has one value", "values of b are 0, those of a"]);
    expect(&a.mapv(|_| -100.0), &a, "constant", &["a has one value", "of a are -100"]);
}

#[test]
fn offsets() {
    let a = levels();
    expect(&a, &a.mapv(|v| v + 90.308_99), "offset", &["the square of 32768", "b - a = 90.30"]);
    expect(&a, &a.mapv(|v| v + 3.010_3), "offset", &["differ by 2: "]);
    let top = a.iter().copied().fold(f32::MIN, f32::max);
    expect(&a, &a.mapv(|v| v - top), "offset", &["ref = max"]);
    expect(&a, &a.mapv(|v| v + 1.234), "offset", &["another reference level (ref)"]);
    let mut own = a.clone();
    for mut channel in own.axis_iter_mut(Axis(0)) {
        let top = channel.iter().copied().fold(f32::MIN, f32::max);
        channel.mapv_inplace(|v| v - top - 1.0);
    }
    expect(&a, &own, "offset", &["each channel has its own reference"]);
    let mut own = a.clone();
    for (t, mut frame) in own.axis_iter_mut(Axis(2)).enumerate() {
        frame.mapv_inplace(|v| v + t as f32 * 0.3 - 2.0);
    }
    expect(&a, &own, "offset", &["each frame has its own reference"]);
}

#[test]
fn ratios() {
    let (a, p) = (levels(), powers());
    expect(&a, &a.mapv(|v| 2.0 * v), "ratio", &["20 log10 against 10 log10"]);
    expect(&a, &a.mapv(|v| v * 0.230_258_5), "ratio", &["natural logarithms"]);
    expect(&p, &p.mapv(|v| v * 32768.0 * 32768.0), "ratio", &["the square of 32768"]);
    expect(&p, &p.mapv(|v| v / 1024.0), "ratio", &["1 / n_fft = 1024"]);
    expect(&p, &p.mapv(|v| v * 1.7), "ratio", &["another normalisation"]);
    let mut own = p.clone();
    for (c, mut channel) in own.axis_iter_mut(Axis(0)).enumerate() {
        channel.mapv_inplace(|v| v * (1.5 + c as f32));
    }
    expect(&p, &own, "ratio", &["each channel has its own factor"]);
    for (norm, words) in [(0, "norm = inf"), (1, "norm = 1"), (2, "norm = 2")] {
        let mut own = p.clone();
        for mut frame in own.lanes_mut(Axis(1)) {
            let norm = match norm {
                0 => frame.iter().fold(0f32, |m, &v| m.max(v)),
                1 => frame.sum(),
                _ => frame.dot(&frame).sqrt(),
            };
            frame.mapv_inplace(|v| v / norm);
        }
        expect(&p, &own, "ratio", &[words]);
    }
}

#[test]
fn factors_of_coefficients() {
    let a = levels();
    let scaled = |factor: &dyn Fn(usize) -> f32| {
        let mut scaled = a.clone();
        for (k, mut coefficient) in scaled.axis_iter_mut(Axis(1)).enumerate() {
            coefficient.mapv_inplace(|v| v * factor(k));
        }
        scaled
    };
    let lifter = |k: usize| 1.0 + 11.0 * (std::f32::consts::PI * (k + 1) as f32 / 22.0).sin();
    expect(&a, &scaled(&lifter), "ratio", &["b with lifter = 22"]);
    expect(&scaled(&lifter), &a, "ratio", &["a with lifter = 22"]);
    // scipy's dct without and with norm="ortho" over 128 bands.
    let plain = |k: usize| if k == 0 { 4.0 * 128f32 } else { 2.0 * 128.0 }.sqrt();
    expect(&a, &scaled(&plain), "ratio", &["ortho in a, none in b, over 128 bands"]);
    expect(&scaled(&plain), &a, "ratio", &["none in a, ortho in b, over 128 bands"]);
    expect(&a, &scaled(&|k| if k % 3 == 1 { -1.0 } else { 1.0 }), "ratio", &["signs of PCA"]);
    // Slaney's norm divides by the width of a band: constant to 1 kHz, then growing.
    let width = |k: usize| if k < 12 { 200.0 } else { 200.0 * 1.1f32.powi(k as i32 - 12) };
    let p = powers();
    let mut slaney = p.clone();
    for (k, mut coefficient) in slaney.axis_iter_mut(Axis(1)).enumerate() {
        coefficient.mapv_inplace(|v| v * 2.0 / width(k));
    }
    expect(&p, &slaney, "ratio", &["norm slaney against none"]);
    let mut standard = a.clone();
    for mut series in standard.lanes_mut(Axis(2)) {
        let (mean, deviation) = (series.mean().unwrap(), series.std(0.0));
        series.mapv_inplace(|v| (v - mean) / deviation);
    }
    expect(&a, &standard, "affine", &["b is standardised"]);
}

#[test]
fn changes_of_unit() {
    let (a, p) = (levels(), powers());
    let (least, most) = a.iter().fold((f32::MAX, f32::MIN), |(l, m), &v| (l.min(v), m.max(v)));
    expect(&a, &a.mapv(|v| (v - least) / (most - least)), "affine", &["range 0 to 1"]);
    expect(&a, &a.mapv(|v| 2.0 * v + 7.0), "affine", &["20 log10", "another reference"]);
    expect(&p, &a, "transform", &["decibels of powers"]);
    expect(&a, &p, "transform", &["decibels of powers", "a = 10 log10 of b"]);
    expect(&p, &a.mapv(|v| 2.0 * v), "transform", &["decibels of magnitudes"]);
    expect(&p, &p.mapv(|v| v * v), "transform", &["powers against magnitudes"]);
    expect(&p, &p.mapv(f32::sqrt), "transform", &["powers against magnitudes"]);
    expect(&p, &p.mapv(f32::ln), "transform", &["natural logarithms"]);
}

#[test]
fn moved_values() {
    let a = levels();
    let ordered = a.select(Axis(0), &[1, 2, 0]);
    expect(&a, &ordered, "channel_order", &["are channels 1, 2, 0 of a"]);
    let transposed = a.clone().permuted_axes([2, 1, 0]).as_standard_layout().to_owned();
    expect(&a, &transposed, "axes", &["a.transpose(2, 1, 0)"]);
    let square = a.slice(s![.., .., ..40]).to_owned();
    let turned = square.clone().permuted_axes([0, 2, 1]).as_standard_layout().to_owned();
    expect(&square, &turned, "axes", &["coefficient and frame axes exchanged"]);
    let cut = |from: usize, to: usize| a.slice(s![.., from..to, ..]).to_owned();
    expect(&cut(0, 13), &cut(1, 13), "coefficients", &["coefficient k + 1 of a", "a has 13, b 12"]);
    expect(&cut(0, 20), &cut(1, 21), "coefficients", &["b begins at coefficient 1 of the other"]);
    expect(&cut(0, 20), &cut(0, 13), "coefficients", &["a keeps more coefficients"]);
    let roll: Vec<usize> = (0..12).map(|k| (k + 9) % 12).collect();
    expect(&cut(0, 12), &cut(0, 12).select(Axis(1), &roll), "coefficients", &["(k + 9) mod 12"]);
    let frames = |from: usize, to: usize| a.slice(s![.., .., from..to]).to_owned();
    expect(&a, &frames(2, 58), "frames", &["frame k + 2 of a; a has 60, b 56", "center"]);
    expect(&frames(0, 59), &a, "frames", &["b has more frames at the end"]);
    expect(&frames(0, 50), &frames(3, 53), "frames", &["b begins at frame 3 of the other"]);
    expect(&a, &a.select(Axis(0), &[1]), "channel_count", &["b has only channel 1 of the 3 of a"]);
    let mean = a.mean_axis(Axis(0)).unwrap().insert_axis(Axis(0));
    expect(&a, &mean, "channel_count", &["mean over the 3 channels of a"]);
}

#[test]
fn differences_in_some_places() {
    let a = levels();
    let changed = |places: &dyn Fn(usize, usize, usize) -> bool| {
        let mut b = a.clone();
        for ((c, k, t), v) in b.indexed_iter_mut().filter(|((c, k, t), _)| places(*c, *k, *t)) {
            *v += 1.0 + ((c * 31 + k * 17 + t * 7) % 11) as f32 * 0.37;
        }
        b
    };
    let edges = changed(&|_, _, t| !(2..57).contains(&t));
    expect(
        &a,
        &edges,
        "edge_frames",
        &["first 2 and the last 3 of 60", "reflection (librosa 0.8)"],
    );
    expect(&a, &changed(&|_, _, t| t > 57), "edge_frames", &["another end"]);
    expect(&a, &changed(&|_, _, t| t == 0), "edge_frames", &["another start"]);
    expect(&a, &changed(&|_, k, _| k >= 36), "bands", &["coefficients 36 to 39", "resampler"]);
    expect(&a, &changed(&|_, k, _| k < 3), "bands", &["bottom of the spectrum"]);
    expect(&a, &changed(&|_, k, _| k == 0), "bands", &["coefficient 0", "log energy"]);
    expect(&a, &changed(&|c, _, _| c == 1), "channels", &["only channels 1 of 3"]);
    let mut level = a.clone();
    level.slice_mut(s![.., 0, ..]).mapv_inplace(|v| v + 90.309 * 128f32.sqrt());
    expect(&a, &level, "bands", &["another level", "90.309"]);
    // Counts: one bin of 21.53 Hz.
    let bins = a.mapv(|v| (v * -3.0).round() * 21.533_203);
    let mut flipped = bins.clone();
    flipped[(0, 3, 30)] += 21.533_203;
    flipped[(2, 39, 31)] -= 21.533_203;
    expect(&bins, &flipped, "steps", &["multiples of 21.53"]);
}

#[test]
fn clamps() {
    let mut a = levels();
    // Channels of different loudness.
    for (c, mut channel) in a.axis_iter_mut(Axis(0)).enumerate() {
        channel.mapv_inplace(|v| v - 15.0 * c as f32);
    }
    let top =
        |values: ndarray::ArrayView2<'_, f32>| values.iter().copied().fold(f32::MIN, f32::max);
    let mut separate = a.clone();
    for mut channel in separate.axis_iter_mut(Axis(0)) {
        let limit = top(channel.view()) - 40.0;
        channel.mapv_inplace(|v| v.max(limit));
    }
    let limit = top(a.slice(s![0, .., ..])) - 40.0;
    let joint = a.mapv(|v| v.max(limit));
    expect(&separate, &joint, "floor", &["b clamps 40 dB below the maximum of all channels"]);
    expect(&joint, &separate, "floor", &["a clamps 40 dB below the maximum of all channels"]);
    expect(&a, &joint, "floor", &["joint top_db: b clamps 40 dB", "a does not"]);
    let silent = a.mapv(|v| if v < -70.0 { -100.0 } else { v });
    expect(&silent, &joint, "floor", &["a ends at -100 dB"]);
}

#[test]
fn a_change_and_what_it_leaves() {
    let (a, mut b) = (levels(), levels().mapv(|v| v + 90.308_99));
    b.slice_mut(s![.., .., ..2]).mapv_inplace(|v| v * 1.1);
    let report = report(&a, &b);
    let causes = report["features"][0]["causes"].as_array().unwrap();
    assert_eq!((&causes[0]["kind"], &causes[1]["kind"]), (&"offset".into(), &"edge_frames".into()));
    assert!(causes[1]["evidence"].as_str().unwrap().starts_with("of what that leaves"));
}

#[test]
fn unrelated_values_have_no_cause() {
    let (a, b) =
        (levels(), levels().select(Axis(2), &(0..60).map(|t| t * 37 % 60).collect::<Vec<_>>()));
    let files = Files::new();
    npz(&files.path("a.npz"), &[("x", &a)]);
    npz(&files.path("b.npz"), &[("x", &b)]);
    let out = files.run("a.npz", "b.npz", &[]);
    assert_eq!(out.status.code(), Some(1));
    assert!(text(&out.stdout).contains("cause unknown"), "{}", text(&out.stdout));
}
