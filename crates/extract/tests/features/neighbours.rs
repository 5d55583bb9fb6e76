//! Features that look at neighbouring frames.

use corsmal_dsp::delta::{DeltaMode, DeltaParams, delta};
use corsmal_dsp::pcen::{Pcen, PcenParams};
use corsmal_extract::config::Config;
use ndarray::{Array2, Array3, Axis, s};
use serde_json::{Map, Value};

use crate::support::{SR, frames, signal};

/// Values of librosa 0.11, made by `golden/librosa_values.py`.
fn golden() -> Value {
    serde_json::from_str(include_str!("../golden/librosa_values.json")).unwrap()
}

fn matrix(rows: &Value) -> Array2<f64> {
    let rows: Vec<Vec<f64>> = serde_json::from_value(rows.clone()).unwrap();
    let shape = (rows.len(), rows[0].len());
    Array2::from_shape_vec(shape, rows.concat()).unwrap()
}

/// The numbers of the generator script, within -1 and 1.
fn noise(n: usize) -> Vec<f32> {
    let mut state = 7_u32;
    let mut next = || {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (f64::from(state >> 8) / f64::from(1 << 23) - 1.0) as f32
    };
    (0..n).map(|_| next()).collect()
}

/// Largest deviation in parts of the largest value.
fn deviation(got: &Array2<f64>, want: &Array2<f64>) -> f64 {
    assert_eq!(got.dim(), want.dim());
    let largest = want.iter().fold(0.0, |m: f64, x| m.max(x.abs()));
    let off = got.iter().zip(want).fold(0.0, |m: f64, (g, w)| m.max((g - w).abs()));
    assert!(got.iter().all(|x| x.is_finite()));
    off / largest
}

#[test]
fn pcen_of_arrays_is_librosas() {
    let spectrogram = Array2::from_shape_vec((5, 12), noise(60)).unwrap().mapv(f32::abs);
    let golden = golden();
    let cases = golden["pcen"].as_array().unwrap();
    assert_eq!(cases.len(), 7);
    for case in cases {
        let key = |name: &str| case["keys"].get(name).and_then(Value::as_f64);
        let usual = PcenParams::default();
        let params = PcenParams {
            gain: key("gain").unwrap_or(usual.gain),
            bias: key("bias").unwrap_or(usual.bias),
            power: key("power").unwrap_or(usual.power),
            time_constant: key("time_constant").unwrap_or(usual.time_constant),
            eps: key("eps").unwrap_or(usual.eps),
            b: key("b"),
            max_size: key("max_size").map_or(usual.max_size, |size| size as usize),
        };
        let pcen = Pcen::new(&params, SR, 512).unwrap();
        let (got, _) = pcen.of(spectrogram.view().insert_axis(Axis(0)), None, None).unwrap();
        let off = deviation(&got.index_axis_move(Axis(0), 0), &matrix(&case["values"]));
        assert!(off < 2e-7, "{}: {off}", case["keys"]);
    }
}

#[test]
fn features_of_signals_are_librosas() {
    let levels = [0.0, 1.0, 8.0, 2.0, 64.0, 16.0, 4.0, 0.0].map(|level: f32| level / 128.0);
    let samples: Vec<f32> =
        noise(4800).iter().enumerate().map(|(i, x)| x * levels[i / 600]).collect();
    let y = Array2::from_shape_vec((1, 4800), samples).unwrap();
    let golden = golden();
    let cases = golden["features"].as_array().unwrap();
    assert_eq!(cases.len(), 5);
    for case in cases {
        let kind = case["kind"].as_str().unwrap();
        let keys: &Map<String, Value> = case["keys"].as_object().unwrap();
        let keys: String = keys.iter().map(|(key, value)| format!("{key} = {value}\n")).collect();
        let got = frames(&format!("[features.{kind}]\n{keys}"), y.view(), 700);
        let got = got.index_axis_move(Axis(0), 0).mapv(f64::from);
        let off = deviation(&got, &matrix(&case["values"]));
        assert!(off < 2e-6, "{kind} {keys}: {off}");
    }
}

/// Frames pass a derivative in pieces; the whole array at once has the same bits.
#[test]
fn delta_in_pieces_is_delta_of_the_array() {
    let y = signal(2, 250_000);
    for n in [5_000, 20_000, 250_000] {
        let y = y.slice(s![.., ..n]).to_owned();
        let source = frames("[features.rms]\nhop_length = 256", y.view(), 4099);
        for (mode, name) in [
            (DeltaMode::Interp, "interp"),
            (DeltaMode::Nearest, "nearest"),
            (DeltaMode::Mirror, "mirror"),
            (DeltaMode::Constant, "constant"),
            (DeltaMode::Wrap, "wrap"),
        ] {
            for (width, order) in [(3, 1), (9, 2), (19, 1)] {
                let text = format!(
                    "[features.rms]\nhop_length = 256\n[features.delta]\nof = 'rms'\n\
                     width = {width}\norder = {order}\nmode = '{name}'"
                );
                let got = frames(&text, y.view(), 4099);
                let params = DeltaParams { width, order, mode };
                for c in 0..2 {
                    let want = delta(source.index_axis(Axis(0), c), &params).unwrap();
                    assert_eq!(got.index_axis(Axis(0), c), want, "{name} {width} {order} {n}");
                }
            }
        }
    }
}

#[test]
fn coefficients_of_what_is_derived_are_cut_from_it() {
    let y = signal(3, 20_000);
    for (all, some) in [
        ("[features.mfcc]\n[features.delta]", "coefficients = [2, 5]"),
        ("[features.pcen]", "coefficients = [2, 5]"),
        ("[features.spectral_flux]", "coefficients = [2, 5]"),
    ] {
        let whole: Array3<f32> = frames(all, y.view(), 4099);
        let cut = frames(&format!("{all}\n{some}"), y.view(), 4099);
        assert_eq!(cut, whole.slice(s![.., 2..5, ..]), "{all}");
    }
}

#[test]
fn sources_that_cannot_be_read_are_refused() {
    let refused = |text: &str| Config::with_overrides(text, "test", &[]).unwrap_err().to_string();
    let complex = "[features.stft]\noutput = 'complex'\n[features.delta]\nof = 'stft'";
    let message = refused(complex);
    assert!(
        message
            .contains("features.delta.of: must name a feature of real values; \"stft\" is complex"),
        "{message}"
    );
    let message = refused("[features.mfcc]\n[features.delta]\nof = 'mfc'");
    assert!(message.contains("did you mean \"mfcc\"?"), "{message}");
}
