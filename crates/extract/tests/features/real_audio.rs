//! Real recordings against what the original programs computed of them (`../shared/data`).
//!
//! `CORSMAL_ALL=1` takes every recording instead of a few. `--nocapture` prints the deviations.

use std::path::Path;
use std::sync::Arc;

use corsmal_extract::config::{Config, Preset};
use corsmal_extract::engine::{Features, Signals};
use corsmal_files::npz::NpzFile;
use ndarray::{ArrayD, ArrayView1, Axis};

use crate::support::shared;

/// Values of the only feature `[frames][coefficients][channels]`, or of the summary.
fn values(preset: &str, overrides: &[&str], path: &Path) -> Vec<f32> {
    let overrides: Vec<String> = overrides.iter().map(|s| s.to_string()).collect();
    let toml = Preset::find(preset).unwrap().toml;
    let config = Arc::new(Config::with_overrides(toml, preset, &overrides).unwrap());
    let mut source = corsmal_audio::open(path).unwrap();
    let spec = source.spec().clone();
    let mut signal = Signals::new(config).start(spec.sample_rate, spec.channels).unwrap();
    let mut block = vec![0.0; 4096 * usize::from(spec.channels)];
    loop {
        let frames = source.read(&mut block).unwrap();
        if frames == 0 {
            break;
        }
        signal.push(&block[..frames * usize::from(spec.channels)]).unwrap();
    }
    match signal.finish().unwrap() {
        Features::Summary(row) => row,
        Features::Frames(mut arrays) => arrays.remove(0).values.into_vec().unwrap(),
    }
}

/// Largest deviations of one part of the values.
struct Deviation {
    name: &'static str,
    /// What `relative` may be.
    limit: f64,
    values: usize,
    /// In the unit of the values.
    absolute: f64,
    /// Of the largest magnitude of the part in the recording, or of `unit` where that is larger.
    relative: f64,
    unit: f64,
}

impl Deviation {
    fn of(name: &'static str, limit: f64) -> Self {
        let unit = f64::MIN_POSITIVE;
        Self { name, limit, values: 0, absolute: 0.0, relative: 0.0, unit }
    }

    /// Of values up to 1, which may all be small.
    fn of_unit(name: &'static str, limit: f64) -> Self {
        Self { unit: 1.0, ..Self::of(name, limit) }
    }

    fn add<'a>(&mut self, got: &[f32], want: impl IntoIterator<Item = &'a f64>) {
        let want: Vec<f64> = want.into_iter().copied().collect();
        assert_eq!(got.len(), want.len(), "{}", self.name);
        let largest = want.iter().fold(0.0, |m: f64, x| m.max(x.abs()));
        let pairs = got.iter().zip(&want);
        let off = pairs.fold(0.0, |m: f64, (g, w)| m.max((f64::from(*g) - w).abs()));
        self.values += want.len();
        self.absolute = self.absolute.max(off);
        self.relative = self.relative.max(off / largest.max(self.unit));
    }
}

/// Prints deviations and holds them against their limits.
fn require(deviations: &[Deviation]) {
    for Deviation { name, limit, values, absolute, relative, .. } in deviations {
        println!("| {name} | {values} | {absolute:.1e} | {relative:.1e} | {limit:.0e} |");
    }
    for Deviation { name, limit, relative, .. } in deviations {
        assert!(relative <= limit, "{name}: {relative:e} of the largest, at most {limit:e}");
    }
}

fn open(root: &Path, file: &str) -> NpzFile {
    NpzFile::open(&root.join(file)).unwrap()
}

fn row(array: &ArrayD<f64>, index: usize) -> Vec<f64> {
    array.index_axis(Axis(0), index).iter().copied().collect()
}

/// Every `step`-th of `0..n`, or all where that is asked for.
fn chosen(n: usize, step: usize) -> impl Iterator<Item = usize> {
    (0..n).step_by(if std::env::var_os("CORSMAL_ALL").is_some() { 1 } else { step })
}

const CCM: &str = "ccm/audio/s1_fi0_fu0_b1_l0_audio.wav";
/// The baseline's features as librosa 0.8 computed them.
struct Baseline {
    /// esc26 and the parts of af193 with their ends.
    deviations: Vec<(Deviation, usize)>,
}

impl Baseline {
    /// Every limit is `limit`, but that of two parts.
    fn new(limit: f64, contrast: f64, tonnetz: f64) -> Self {
        let deviations = vec![
            (Deviation::of("esc26", limit), 0),
            (Deviation::of("mfcc", limit), 40),
            (Deviation::of("chroma", limit), 52),
            (Deviation::of("mel", limit), 180),
            (Deviation::of("contrast", contrast), 187),
            (Deviation::of_unit("tonnetz", tonnetz), 193),
        ];
        Self { deviations }
    }

    fn add(&mut self, path: &Path, esc: &[f64], af193: &[f64]) {
        let switch = ["librosa=0.8"];
        let got = values("af193", &switch, path);
        let mut first = 0;
        for (deviation, end) in &mut self.deviations {
            match *end {
                0 => deviation.add(&values("esc26", &switch, path), esc),
                end => {
                    deviation.add(&got[first..end], &af193[first..end]);
                    first = end;
                }
            }
        }
    }

    fn require(self) {
        require(&self.deviations.into_iter().map(|(deviation, _)| deviation).collect::<Vec<_>>());
    }
}

#[test]
fn the_published_baseline_features_of_the_ccm_recording() {
    let Some(root) = shared() else { return };
    let mut npz = open(&root, "ccm/baseline_feature_reference.npz");
    let [esc, af193, image] =
        ["zcr_mfcc26", "af193", "spectrogram96"].map(|name| row(&npz.f64(name).unwrap(), 0));
    let mut baseline = Baseline::new(1e-6, 1e-6, 1e-6);
    baseline.add(&root.join(CCM), &esc, &af193);
    baseline.require();
    let mut deviation = Deviation::of("spec9216", 1e-6);
    deviation.add(&values("spec9216-code", &["librosa=0.8"], &root.join(CCM)), &image);
    require(&[deviation]);
}

// Vorbis decoders round differently, 1e-7 of full scale. Contrast and tonnetz see that where a clip
// has next to nothing: in bands above its low-pass filter, in its silence.
const CLIPS: [f64; 3] = [1e-5, 1e-2, 1e-3];

#[test]
fn the_published_baseline_features_of_clips() {
    let Some(root) = shared() else { return };
    let mut npz = open(&root, "ccm/baseline_feature_reference.npz");
    let files = npz.strings("files").unwrap();
    let [esc, af193, image] =
        ["zcr_mfcc26", "af193", "spectrogram96"].map(|name| npz.f64(name).unwrap());
    let [limit, contrast, tonnetz] = CLIPS;
    let mut baseline = Baseline::new(limit, contrast, tonnetz);
    let mut deviation = Deviation::of("spec9216", limit);
    for i in chosen(files.len(), 5).skip(1) {
        let path = root.join(&files[i]);
        baseline.add(&path, &row(&esc, i), &row(&af193, i));
        let got = values("spec9216-code", &["librosa=0.8"], &path);
        deviation.add(&got, &row(&image, i));
    }
    baseline.require();
    require(&[deviation]);
}

#[test]
fn the_published_features_of_the_esc_10_clips() {
    let Some(root) = shared() else { return };
    let mut npz = open(&root, "esc10/esc10_features_librosa080.npz");
    let [esc, af193] = ["zcr_mfcc26", "af193"].map(|name| npz.f64(name).unwrap());
    let mut table = csv::Reader::from_path(root.join("esc10/meta.csv")).unwrap();
    let files: Vec<String> = table.records().map(|r| r.unwrap()[0].to_string()).collect();
    assert_eq!(files.len(), esc.shape()[0]);
    let [limit, contrast, tonnetz] = CLIPS;
    let mut baseline = Baseline::new(limit, contrast, tonnetz);
    for i in chosen(files.len(), 133) {
        let path = root.join("esc10/audio").join(&files[i]);
        baseline.add(&path, &row(&esc, i), &row(&af193, i));
    }
    baseline.require();
}

#[test]
fn the_inputs_of_the_compared_systems() {
    let Some(root) = shared() else { return };
    let path = root.join(CCM);
    let mut npz = open(&root, "ccm/method_input_reference.npz");
    let mut m4 = Deviation::of("m4-code", 1e-6);
    m4.add(&values("m4-code", &[], &path), &npz.f64("m4_logmel").unwrap());
    let got = values("m2", &[], &path);
    let want = npz.f64("m2_mfcc_norm").unwrap();
    let (frames, padding) = got.split_at(want.len());
    assert_eq!(got.len(), 1501 * 40);
    assert!(padding.iter().all(|x| *x == 0.0));
    let mut m2 = Deviation::of("m2", 1e-5);
    m2.add(frames, &want);
    let mut m6 = Deviation::of("m6-code", 1e-6);
    m6.add(&values("m6-code", &[], &path), &npz.f64("m6_spectrogram96").unwrap());
    require(&[m4, m2, m6]);
}

#[test]
fn the_row_of_the_ccm_recording_in_the_features_of_m5() {
    let Some(root) = shared() else { return };
    let mut npz = open(&root, "ccm/a34f_train.npz");
    let (x, containers) = (npz.f64("X").unwrap(), npz.f64("container").unwrap());
    let at = npz
        .strings("sequence")
        .unwrap()
        .iter()
        .zip(&containers)
        .position(|(name, c)| name == "s1_fi0_fu0_b1_l0" && *c == 3.0);
    let want = row(&x, at.unwrap());
    let got = values("a34f136", &[], &root.join(CCM));
    let off = ArrayView1::from(&got)
        .iter()
        .zip(&want)
        .fold(0.0, |m: f64, (g, w)| m.max((f64::from(*g) - w).abs() / w.abs().max(1.0)));
    println!("| a34f136, of max(1, value) | 136 | | {off:.1e} | 3e-4 |");
    assert!(off <= 3e-4, "{off:e}");
}
