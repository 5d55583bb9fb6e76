//! Real recordings against what the original programs computed of them (`../shared/data`).
//!
//! `CORSMAL_ALL=1` takes every recording instead of a few. `--nocapture` prints the deviations.

use std::path::Path;
use std::sync::Arc;

use corsmal_extract::config::{Config, Preset};
use corsmal_extract::engine::Features;
use corsmal_extract::npz::NpzFile;
use corsmal_extract::run::Signals;
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
#[derive(Default)]
struct Deviation {
    name: &'static str,
    values: usize,
    /// In the unit of the values.
    absolute: f64,
    /// Of the largest magnitude of the part in the recording.
    relative: f64,
}

impl Deviation {
    fn of(name: &'static str) -> Self {
        Self { name, ..Self::default() }
    }

    fn add<'a>(&mut self, got: &[f32], want: impl IntoIterator<Item = &'a f64>) {
        let want: Vec<f64> = want.into_iter().copied().collect();
        assert_eq!(got.len(), want.len(), "{}", self.name);
        let largest = want.iter().fold(0.0, |m: f64, x| m.max(x.abs()));
        let pairs = got.iter().zip(&want);
        let off = pairs.fold(0.0, |m: f64, (g, w)| m.max((f64::from(*g) - w).abs()));
        self.values += want.len();
        self.absolute = self.absolute.max(off);
        self.relative = self.relative.max(off / largest.max(f64::MIN_POSITIVE));
    }

    /// Prints the deviation and holds it against a limit on the relative one.
    fn within(&self, limit: f64) {
        let Self { name, values, absolute, relative } = self;
        println!("| {name} | {values} | {absolute:.1e} | {relative:.1e} | {limit:.0e} |");
        assert!(relative <= &limit, "{name}: {relative:e} of the largest, at most {limit:e}");
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
const PARTS: [(&str, usize); 5] =
    [("mfcc", 40), ("chroma", 52), ("mel", 180), ("contrast", 187), ("tonnetz", 193)];

fn add_af193(parts: &mut [Deviation], got: &[f32], want: &[f64]) {
    let mut first = 0;
    for (part, (_, end)) in parts.iter_mut().zip(PARTS) {
        part.add(&got[first..end], &want[first..end]);
        first = end;
    }
}

#[test]
fn the_published_baseline_features_of_the_ccm_recording_and_clips() {
    let Some(root) = shared() else { return };
    let mut npz = open(&root, "ccm/baseline_feature_reference.npz");
    let files = npz.strings("files").unwrap();
    let [esc, af193, image] =
        ["zcr_mfcc26", "af193", "spectrogram96"].map(|name| npz.f64(name).unwrap());
    let switch = ["librosa=0.8"];
    let (mut of_esc, mut of_image) = (Deviation::of("esc26"), Deviation::of("spec9216"));
    let mut of_parts = PARTS.map(|(name, _)| Deviation::of(name));
    for i in chosen(files.len(), 5) {
        let path = root.join(&files[i]);
        of_esc.add(&values("esc26", &switch, &path), &row(&esc, i));
        add_af193(&mut of_parts, &values("af193", &switch, &path), &row(&af193, i));
        of_image.add(&values("spec9216-code", &switch, &path), &row(&image, i));
    }
    of_esc.within(1e-4);
    of_image.within(1e-4);
    of_parts.iter().for_each(|part| part.within(1e-4));
}

#[test]
fn the_published_features_of_the_esc_10_clips() {
    let Some(root) = shared() else { return };
    let mut npz = open(&root, "esc10/esc10_features_librosa080.npz");
    let [esc, af193] = ["zcr_mfcc26", "af193"].map(|name| npz.f64(name).unwrap());
    let mut table = csv::Reader::from_path(root.join("esc10/meta.csv")).unwrap();
    let files: Vec<String> = table.records().map(|r| r.unwrap()[0].to_string()).collect();
    assert_eq!(files.len(), esc.shape()[0]);
    let mut of_esc = Deviation::of("esc26");
    let mut of_parts = PARTS.map(|(name, _)| Deviation::of(name));
    for i in chosen(files.len(), 67) {
        let path = root.join("esc10/audio").join(&files[i]);
        of_esc.add(&values("esc26", &["librosa=0.8"], &path), &row(&esc, i));
        add_af193(&mut of_parts, &values("af193", &["librosa=0.8"], &path), &row(&af193, i));
    }
    of_esc.within(1e-4);
    of_parts.iter().for_each(|part| part.within(1e-4));
}

#[test]
fn the_inputs_of_the_compared_systems() {
    let Some(root) = shared() else { return };
    let path = root.join(CCM);
    let mut npz = open(&root, "ccm/method_input_reference.npz");
    let mut m4 = Deviation::of("m4-code");
    m4.add(&values("m4-code", &[], &path), &npz.f64("m4_logmel").unwrap());
    m4.within(1e-6);
    let got = values("m2", &[], &path);
    let want = npz.f64("m2_mfcc_norm").unwrap();
    let (frames, padding) = got.split_at(want.len());
    assert_eq!(got.len(), 1501 * 40);
    assert!(padding.iter().all(|x| *x == 0.0));
    let mut m2 = Deviation::of("m2");
    m2.add(frames, &want);
    m2.within(1e-5);
    let mut m6 = Deviation::of("m6-code");
    m6.add(&values("m6-code", &[], &path), &npz.f64("m6_spectrogram96").unwrap());
    m6.within(1e-5);
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
