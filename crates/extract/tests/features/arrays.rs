//! Features by way of the engine against the array functions of `corsmal_dsp`.

use std::sync::Arc;

use corsmal_dsp::chroma::{ChromaParams, chroma, chroma_filter};
use corsmal_dsp::corsmal::af193::Af193;
use corsmal_dsp::corsmal::paa::{PaaPlan, Peak};
use corsmal_dsp::corsmal::{
    M2Mfcc, M3Spectrogram, M4LogMel, M5A34f136, M5VggishPatches, M6Spectrogram, Spec9216, Variant,
};
use corsmal_dsp::cqt::{ChromaCqtParams, CqtParams, SignalTuning, chroma_cqt, cqt};
use corsmal_dsp::decibel::Decibel;
use corsmal_dsp::frequency::fft_frequencies;
use corsmal_dsp::hpss::{HarmonicPart, HpssParams, Work, masks};
use corsmal_dsp::librosa::LibrosaVersion;
use corsmal_dsp::mel::{MelParams, SparseBank, mel_filter};
use corsmal_dsp::normalize::Norm;
use corsmal_dsp::onset::{OnsetParams, onset_strength};
use corsmal_dsp::pitch::{PitchParams, estimate_tuning};
use corsmal_dsp::spectral::{
    Bandwidth, ContrastParams, Flatness, Frequencies, poly_features, spectral_bandwidth,
    spectral_centroid, spectral_contrast, spectral_flatness, spectral_rolloff,
};
use corsmal_dsp::stft::{PadMode, StftParams, spectrogram};
use corsmal_dsp::tonnetz::tonnetz;
use corsmal_extract::config::{Config, Preset};
use corsmal_extract::engine::{Extractor, Features, Plan, Signals};
use ndarray::{Array2, Array3, ArrayView2, Axis, concatenate, s};

use crate::support::{SR, alone, features, frames, signal};

fn close(name: &str, got: &Array3<f32>, want: &Array3<f64>, tolerance: f64) {
    assert_eq!(got.dim(), want.dim(), "{name}");
    let largest = want.iter().fold(0.0, |m: f64, x| m.max(x.abs()));
    let off = got.iter().zip(want).fold(0.0, |m: f64, (g, w)| m.max((f64::from(*g) - w).abs()));
    assert!(off <= tolerance * largest.max(1e-12), "{name}: {off} of {largest}");
}

/// librosa's contrast of each channel by itself.
fn contrast(s: &Array3<f32>, params: &ContrastParams) -> Array3<f64> {
    let freqs = fft_frequencies(SR, 2048).unwrap();
    let parts: Vec<_> = (0..s.dim().0)
        .map(|c| spectral_contrast(s.slice(s![c..c + 1, .., ..]), &freqs, SR, params).unwrap())
        .collect();
    concatenate(Axis(0), &parts.iter().map(Array3::view).collect::<Vec<_>>()).unwrap()
}

#[test]
fn spectral_features_are_those_of_arrays_whatever_the_blocks() {
    for (channels, n) in [(1, 30_000), (3, 9_001), (2, 700), (1, 1)] {
        let y = signal(channels, n);
        let s = spectrogram(y.view(), &StftParams::new(2048, 512), 1.0).unwrap();
        let freqs = fft_frequencies(SR, 2048).unwrap();
        let f = Frequencies::Bins(&freqs);
        let default = ContrastParams::default();
        let linear = ContrastParams { linear: true, n_bands: 4, ..default };
        let cubic = Bandwidth { p: 3.0, norm: true };
        let cases = [
            ("spectral_centroid", "", spectral_centroid(s.view(), f).unwrap()),
            (
                "spectral_bandwidth",
                "p = 3.0",
                spectral_bandwidth(s.view(), f, None, cubic).unwrap(),
            ),
            ("spectral_rolloff", "roll_percent = 0.5", spectral_rolloff(s.view(), f, 0.5).unwrap()),
            (
                "spectral_flatness",
                "",
                spectral_flatness(s.view(), Flatness::default()).unwrap().mapv(f64::from),
            ),
            ("spectral_contrast", "", contrast(&s, &default)),
            ("spectral_contrast", "linear = true\nn_bands = 4", contrast(&s, &linear)),
            ("poly_features", "order = 2", poly_features(s.view(), f, 2).unwrap().0),
        ];
        for (kind, parameters, want) in &cases {
            let toml = format!("[features.{kind}]\n{parameters}");
            let got = frames(&toml, y.view(), n);
            close(kind, &got, want, 1e-6);
            for block in [1, 977] {
                assert_eq!(frames(&toml, y.view(), block), got, "{kind} in blocks of {block}");
            }
        }
    }
}

/// What a feature of the whole recording is for one channel, `[coefficients, frames]`.
type Whole = fn(ArrayView2<f32>) -> Array2<f32>;

fn column(values: impl IntoIterator<Item = f64>) -> Array2<f32> {
    let values: Vec<f32> = values.into_iter().map(|x| x as f32).collect();
    Array2::from_shape_vec((values.len(), 1), values).unwrap()
}

fn chroma_of_cqt(y: ArrayView2<f32>) -> Array3<f32> {
    let tuning = SignalTuning::new(SR).unwrap().estimate([y.as_slice().unwrap()], 36).unwrap();
    let (n_bins, bins_per_octave, tuning) = (252, 36, tuning.unwrap_or(0.0));
    let cqt = CqtParams { n_bins, bins_per_octave, tuning, ..CqtParams::new(SR) };
    chroma_cqt(y, &cqt, &ChromaCqtParams::default()).unwrap()
}

#[test]
fn whole_recording_features_are_those_of_arrays_channel_by_channel() {
    let cases: [(&str, &str, Whole); 21] = [
        ("chroma_cqt", "", |y| chroma_of_cqt(y).index_axis_move(Axis(0), 0)),
        ("tonnetz", "", |y| {
            let chroma = chroma_of_cqt(y);
            tonnetz(chroma.view()).unwrap().index_axis_move(Axis(0), 0).mapv(|x| x as f32)
        }),
        ("chroma_cqt", "tuning = -0.25", |y| {
            let cqt =
                CqtParams { n_bins: 252, bins_per_octave: 36, tuning: -0.25, ..CqtParams::new(SR) };
            let chroma = chroma_cqt(y, &cqt, &ChromaCqtParams::default()).unwrap();
            chroma.index_axis_move(Axis(0), 0)
        }),
        ("chroma_stft", "tuning = 0.4", |y| {
            let power = spectrogram(y, &StftParams::new(2048, 512), 2.0).unwrap();
            let params = ChromaParams { tuning: 0.4, ..ChromaParams::new(SR, 2048) };
            let bank = chroma_filter::<f32>(&params).unwrap();
            let chroma = chroma(power.view(), bank.view(), Some(Norm::Max)).unwrap();
            chroma.index_axis_move(Axis(0), 0)
        }),
        ("chroma_stft", "", |y| {
            let power = spectrogram(y, &StftParams::new(2048, 512), 2.0).unwrap();
            let pitch = PitchParams::new(SR, 2048);
            let tuning = estimate_tuning(power.view(), None, pitch, 0.01, 12).unwrap().unwrap();
            let params = ChromaParams { tuning, ..ChromaParams::new(SR, 2048) };
            let bank = chroma_filter::<f32>(&params).unwrap();
            let chroma = chroma(power.view(), bank.view(), Some(Norm::Max)).unwrap();
            chroma.index_axis_move(Axis(0), 0)
        }),
        ("af193", "", |y| {
            let vector = Af193::new(SR).unwrap().compute(y.as_slice().unwrap()).unwrap();
            column(vector.map(f64::from))
        }),
        ("af193", "librosa = '0.8'", |y| {
            let plan = Af193::of(SR, LibrosaVersion::V08).unwrap();
            column(plan.compute(y.as_slice().unwrap()).unwrap().map(f64::from))
        }),
        ("tonnetz", "librosa = '0.8'\nharmonic = true", |y| {
            let harmonic = HarmonicPart::new(LibrosaVersion::V08).unwrap();
            let mut part = Vec::new();
            harmonic.of(y.as_slice().unwrap(), &mut part, &mut Work::default(), |_| {}).unwrap();
            let tuning = SignalTuning::padded(SR, PadMode::Reflect).unwrap();
            let tuning = tuning.estimate([part.as_slice()], 36).unwrap().unwrap_or(0.0);
            let (n_bins, bins_per_octave) = (252, 36);
            let cqt = CqtParams { n_bins, bins_per_octave, tuning, ..CqtParams::new(SR) };
            let part = ArrayView2::from_shape((1, part.len()), &part).unwrap();
            let cqt = cqt.of(LibrosaVersion::V08);
            let chroma = chroma_cqt(part, &cqt, &ChromaCqtParams::default()).unwrap();
            tonnetz(chroma.view()).unwrap().index_axis_move(Axis(0), 0).mapv(|x| x as f32)
        }),
        ("hpss", "component = 'percussive'\nkernel_size = [17, 31]", |y| {
            let magnitude = spectrogram(y, &StftParams::new(2048, 512), 1.0).unwrap();
            let params = HpssParams { kernel_harmonic: 17, ..HpssParams::default() };
            let (_, percussive) = masks(magnitude.view(), &params).unwrap();
            (magnitude * percussive).index_axis_move(Axis(0), 0)
        }),
        ("hpss", "kernel_size = 9\nmargin = 2", |y| {
            let magnitude = spectrogram(y, &StftParams::new(2048, 512), 1.0).unwrap();
            let params = HpssParams {
                kernel_harmonic: 9,
                kernel_percussive: 9,
                margin_harmonic: 2.0,
                margin_percussive: 2.0,
                ..HpssParams::default()
            };
            let (harmonic, _) = masks(magnitude.view(), &params).unwrap();
            (magnitude * harmonic).index_axis_move(Axis(0), 0)
        }),
        ("cqt", "tuning = 0.25", |y| {
            let params = CqtParams { tuning: 0.25, ..CqtParams::new(SR) };
            cqt(y, &params).unwrap().index_axis_move(Axis(0), 0).mapv(|z| z.norm())
        }),
        ("a34_short", "window = 0.04\nstep = 0.02\ndeltas = true", |y| {
            let counts = y.row(0).mapv(|x| f64::from(x) * 32768.0);
            let plan = PaaPlan::new(SR, 882, 441).unwrap();
            plan.short_term(counts.view(), true).unwrap().mapv(|x| x as f32)
        }),
        ("a34f136", "", |y| column(M5A34f136::new(SR).unwrap().run(y).unwrap())),
        ("a34f136", "peak = 'centred'", |y| {
            column(M5A34f136::with_peak(SR, Peak::Centred).unwrap().run(y).unwrap())
        }),
        ("spec9216", "fixed_len = 30000", |y| {
            let plan = Spec9216 { fixed_len: Some(30_000), ..Spec9216::default() };
            column(plan.run(y.row(0)).unwrap())
        }),
        ("m2_mfcc", "", |y| M2Mfcc::default().run(y, SR).unwrap().reversed_axes()),
        ("m3_spectrogram", "", |y| M3Spectrogram::default().run(y, SR).unwrap()),
        ("m4_logmel", "variant = 'paper'", |y| {
            let plan = M4LogMel { variant: Variant::Paper };
            plan.run(y, SR).unwrap().index_axis_move(Axis(2), 0).reversed_axes()
        }),
        ("vggish_patches", "", |y| {
            let patches = M5VggishPatches::default().run(y, SR).unwrap();
            let (count, frames, bands) = patches.dim();
            patches.into_shape_with_order((count * frames, bands)).unwrap().reversed_axes()
        }),
        ("m6_spectrogram", "", |y| {
            column(M6Spectrogram::default().run(y, SR).unwrap().into_iter().map(f64::from))
        }),
        ("onset_strength", "", |y| {
            let power = spectrogram(y, &StftParams::new(2048, 512), 2.0).unwrap();
            let bank = mel_filter(&MelParams::new(SR, 2048)).unwrap();
            let mut mel = SparseBank::new(&bank).apply(power.view());
            Decibel::default().power(mel.as_slice_mut().unwrap()).unwrap();
            onset_strength(mel.view(), None, &OnsetParams::new(2048, 512).unwrap()).unwrap()
        }),
    ];
    let y = signal(2, 44_100);
    for (kind, parameters, array) in cases {
        let got = frames(&format!("[features.{kind}]\n{parameters}"), y.view(), 4099);
        for c in 0..2 {
            let want = array(alone(&y, c)).mapv(f64::from).insert_axis(Axis(0));
            close(kind, &got.slice(s![c..c + 1, .., ..]).to_owned(), &want, 1e-7);
        }
    }
}

#[test]
fn vectors_pass_through_summaries_without_a_statistic() {
    let y = signal(1, 30_000);
    let text = "[features.af193]\n[features.rms]\n[summary]\nstats = ['std', 'max']";
    let config = Arc::new(Config::with_overrides(text, "test", &[]).unwrap());
    let names = Plan::new(&config, SR, 1).unwrap().summary_names();
    assert_eq!(names.len(), 195);
    assert_eq!([&names[0], &names[193]], ["af193[mfcc_0]", "rms.std"]);
    let Ok(Features::Summary(row)) = features(&config, y.view(), SR, 977) else {
        panic!("a summary was asked for")
    };
    let want = Af193::new(SR).unwrap().compute(y.as_slice().unwrap()).unwrap();
    assert_eq!(row[..193], want);
    assert_eq!(row.len(), names.len());
}

#[test]
fn what_silence_cannot_have_is_refused_by_name() {
    let config = Arc::new(Config::with_overrides("[features.spec9216]", "test", &[]).unwrap());
    let mut extractor =
        Extractor::new(Arc::new(Plan::new(&config, SR, 1).unwrap()), 0..u64::MAX, 0);
    extractor.push(&[0.0; 100]);
    let message = extractor.finish(true).unwrap_err().to_string();
    assert!(message.starts_with("spec9216: y must be a signal with an RMS above 0"), "{message}");
}

#[test]
fn impossible_bands_are_refused_with_the_key() {
    let refused = |text: &str| Config::with_overrides(text, "test", &[]).unwrap_err().to_string();
    assert!(refused("[features.spectral_contrast]\nfmin = -1.0").contains("fmin"));
    assert!(refused("[features.spectral_rolloff]\nroll_percent = 1.0").contains("roll_percent"));
    // Possible at some rate, not at this one.
    let text = "[features.spectral_contrast]\nn_fft = 512";
    let config = Arc::new(Config::with_overrides(text, "test", &[]).unwrap());
    assert!(Plan::new(&config, 8_000.0, 1).is_err());
    assert!(Plan::new(&config, 44_100.0, 1).is_ok());
}

/// `librosa.amplitude_to_db` by its definition: reference and smallest value are amplitudes, too.
#[test]
fn decibels_of_amplitudes() {
    let y = signal(1, 20_000);
    let magnitude = spectrogram(y.view(), &StftParams::new(2048, 512), 1.0).unwrap();
    let tones = cqt(y.view(), &CqtParams::new(SR)).unwrap().mapv(|z| z.norm());
    for (kind, amplitudes) in [("stft]\noutput = 'magnitude'", magnitude), ("cqt]", tones)] {
        for (keys, amin, reference) in
            [("", 1e-5, 1.0), ("\namin = 0.01", 0.01, 1.0), ("\namin = 1e-3\nref = 2.0", 1e-3, 2.0)]
        {
            let text = format!("[features.{kind}\nscale = 'amplitude_to_db'{keys}");
            let db = |x: f64| 20.0 * (x.max(amin).log10() - f64::max(amin, reference).log10());
            let want = amplitudes.mapv(|x| db(f64::from(x)));
            let floor = want.fold(f64::NEG_INFINITY, |top, x| top.max(*x)) - 80.0;
            close(&text, &frames(&text, y.view(), 4099), &want.mapv(|x| x.max(floor)), 1e-4);
        }
    }
}

#[test]
fn m4_makes_no_frame_of_exactly_one_frame() {
    let preset = Preset::find("m4-code").unwrap();
    let config = Arc::new(Config::with_overrides(preset.toml, "m4-code", &[]).unwrap());
    let signals = Signals::new(config);
    let run = |samples: usize| {
        let mut of = signals.start(22_050, 1).unwrap();
        of.push(&signal(1, samples).into_raw_vec_and_offset().0).unwrap();
        of.finish()
    };
    // A frame has 551 samples. As published, shorter and longer recordings have frames.
    assert!(run(550).is_ok() && run(552).is_ok());
    let error = run(551).err().unwrap().to_string();
    assert!(error.contains("m4_logmel makes no frame of exactly 551 samples"), "{error}");
}
