//! What holds for every registered feature, whatever it computes: registration alone enrols it.

use corsmal_extract::config::Config;
use corsmal_extract::engine::{Extractor, Features, Plan, Recording};
use corsmal_extract::features::{Entry, registry};
use ndarray::{Array2, Array3, Axis, concatenate, s};
use std::sync::Arc;

use crate::support::{SR, alone, frames, signal, try_frames};

/// A configuration of the feature with its defaults, and what it is derived from before it.
fn configuration(feature: &Entry) -> String {
    let source = feature.defaults()["of"].as_str().map(|of| format!("[features.{of}]\n"));
    format!("{}[features.{}]\n", source.unwrap_or_default(), feature.kind())
}

/// Whether the feature holds the whole recording.
fn is_whole(feature: &Entry) -> bool {
    plan(feature, 1).needs_whole()
}

fn plan(feature: &Entry, channels: usize) -> Arc<Plan> {
    let config = Config::with_overrides(&configuration(feature), "test", &[]).unwrap();
    Arc::new(Plan::new(&Arc::new(config), SR, channels).unwrap())
}

/// Whether frames of the feature depend on all frames before them.
fn is_recursive(feature: &Entry) -> bool {
    let plan = plan(feature, 1);
    plan.features.last().unwrap().derived.as_ref().is_some_and(|derived| derived.is_recursive())
}

fn is_finite(values: &Array3<f32>) -> bool {
    !values.is_empty() && values.iter().all(|x| x.is_finite())
}

/// A second and a half: enough for a patch of every feature.
const SAMPLES: usize = 33_000;

#[test]
fn silence_is_finite_or_refused_as_silence() {
    let y = Array2::zeros((2, SAMPLES));
    for feature in registry() {
        match try_frames(&configuration(feature), y.view(), SAMPLES) {
            Ok(values) => assert!(is_finite(&values), "{}", feature.kind()),
            Err(reason) => assert!(reason.contains("silence"), "{}: {reason}", feature.kind()),
        }
    }
}

#[test]
fn single_samples_are_finite_or_refused_as_too_few() {
    for value in [0.5, -1.0] {
        let y = Array2::from_elem((2, 1), value);
        for feature in registry() {
            let kind = feature.kind();
            match try_frames(&configuration(feature), y.view(), 1) {
                Ok(values) => assert!(values.iter().all(|x| x.is_finite()), "{kind}"),
                Err(reason) => {
                    let says = reason.contains("needed") || reason.contains("at least");
                    assert!(says, "{kind}: {reason}");
                }
            }
        }
    }
}

#[test]
fn any_split_into_blocks_gives_the_same_bits() {
    let y = signal(2, SAMPLES);
    for feature in registry() {
        let toml = configuration(feature);
        let whole = frames(&toml, y.view(), SAMPLES);
        assert!(is_finite(&whole), "{}", feature.kind());
        let blocks: &[usize] = if is_whole(feature) { &[977] } else { &[1, 977, 16_384] };
        for block in blocks {
            let split = frames(&toml, y.view(), *block);
            assert_eq!(split, whole, "{} in blocks of {block}", feature.kind());
        }
    }
}

/// The values of a recording of two channels that is cut into spans of time at `cuts`, each of them
/// read in blocks and handed on in parts, with the context that a run gives it.
fn in_spans(plan: &Arc<Plan>, y: &Array2<f32>, cuts: &[u64], block: usize) -> Vec<f32> {
    let samples: Vec<f32> = y.t().iter().copied().collect();
    let (channels, total) = (y.nrows(), y.ncols() as u64);
    let starts = std::iter::once(0).chain(cuts.iter().copied());
    let ends = cuts.iter().copied().chain([u64::MAX]);
    let (before, after) = plan.context();
    let mut recording = Recording::new(plan.clone(), &std::env::temp_dir());
    for (start, end) in starts.zip(ends) {
        let first = start.saturating_sub(2 * before as u64 + 1);
        let last = end.saturating_add(after as u64);
        let part = first as usize * channels..last.min(total) as usize * channels;
        let mut extractor = Extractor::new(plan.clone(), start..end, first);
        for block in samples[part].chunks(block * channels) {
            extractor.push(block);
            recording.add(extractor.take()).unwrap();
        }
        recording.add(extractor.finish(last > total).unwrap()).unwrap();
    }
    let Features::Frames(mut arrays) = recording.finish().unwrap() else {
        panic!("no summary was asked for")
    };
    arrays.pop().unwrap().values.into_vec().unwrap()
}

#[test]
fn any_cut_into_spans_gives_the_same_bits() {
    let y = signal(2, SAMPLES);
    for feature in registry() {
        let plan = plan(feature, 2);
        if plan.needs_whole() {
            // Never cut.
            continue;
        }
        let bits = |values: Vec<f32>| values.iter().map(|x| x.to_bits()).collect::<Vec<_>>();
        let whole = bits(in_spans(&plan, &y, &[], SAMPLES));
        assert!(!whole.is_empty());
        for (cuts, block) in [
            (&[SAMPLES as u64 / 2][..], SAMPLES),
            (&[1, 700, 9_001, 20_000][..], 977),
            (&[512, 1024, 1536, 30_000][..], 64),
        ] {
            let cut = bits(in_spans(&plan, &y, cuts, block));
            assert!(cut == whole, "{} cut at {cuts:?}", feature.kind());
        }
    }
}

#[test]
fn every_key_is_explained_and_every_explanation_has_its_key() {
    for feature in registry() {
        let defaults = feature.defaults();
        let keys = defaults.as_object().unwrap();
        for key in keys.keys() {
            let about = feature.explain(key).unwrap_or_default();
            let sentence = about.len() > 10 && about.ends_with('.');
            assert!(sentence, "{}: KEYS lack {key}: \"{about}\"", feature.kind());
        }
        for key in feature.keys() {
            assert!(keys.contains_key(key), "{}: KEYS has {key}, which is no key", feature.kind());
        }
    }
}

#[test]
fn channels_are_independent() {
    let y = signal(3, SAMPLES);
    for feature in registry() {
        let toml = configuration(feature);
        let together = frames(&toml, y.view(), SAMPLES);
        for c in 0..3 {
            let by_itself = frames(&toml, alone(&y, c), SAMPLES);
            let of_it = together.slice(s![c..c + 1, .., ..]);
            assert_eq!(of_it, by_itself, "{}: channel {c}", feature.kind());
        }
    }
}

#[test]
fn a_delay_of_one_hop_is_a_delay_of_one_frame_or_the_feature_says_that_it_sees_the_whole() {
    // Silence around the sound keeps what depends on the maximum of the recording.
    let quiet = Array2::<f32>::zeros((1, 8192));
    let sound = signal(1, 12_000);
    let y = concatenate(Axis(1), &[quiet.view(), sound.view(), quiet.view()]).unwrap();
    for feature in registry() {
        let kind = feature.kind();
        if is_whole(feature) {
            assert!(feature.about().contains("whole"), "{kind}: {}", feature.about());
            continue;
        }
        let toml = configuration(feature);
        let config = Config::with_overrides(&toml, "test", &[]).unwrap();
        let hop = Plan::new(&Arc::new(config), SR, 1).unwrap().hop(kind) as usize;
        let before = Array2::<f32>::zeros((1, hop));
        let delayed = concatenate(Axis(1), &[before.view(), y.view()]).unwrap();
        let (plain, delayed) =
            (frames(&toml, y.view(), SAMPLES), frames(&toml, delayed.view(), SAMPLES));
        let n = plain.dim().2;
        assert_eq!(delayed.dim().2, n + 1, "{kind}");
        // Frames whose neighbours all lie in the signal.
        let (first, last) = (8, n - 8);
        let plain = plain.slice(s![.., .., first..last]);
        let delayed = delayed.slice(s![.., .., first + 1..last + 1]);
        if !is_recursive(feature) {
            assert_eq!(plain, delayed, "{kind}");
            continue;
        }
        // What is carried from the first frame on fades.
        let largest = plain.iter().fold(0.0, |m: f32, x| m.max(x.abs()));
        let off = plain.iter().zip(delayed).fold(0.0, |m: f32, (a, b)| m.max((a - b).abs()));
        assert!(off <= 1e-5 * largest, "{kind}: {off} of {largest}");
    }
}
