//! What the engine promises whatever the signal: no number depends on how samples arrive, on other
//! channels, or on where a recording is cut; and the numbers are those of the array functions.

// Helpers outside of test functions are not covered by `allow-unwrap-in-tests`.
#![allow(clippy::unwrap_used)]

use std::sync::Arc;

use corsmal_dsp::decibel::Decibel;
use corsmal_dsp::mel::{MelParams, SparseBank, mel_filter};
use corsmal_dsp::mfcc::{MfccParams, mfcc};
use corsmal_dsp::stft::{PadMode, StftParams, spectrogram};
use corsmal_dsp::time_domain::{FrameParams, ZeroCrossingParams, rms, zero_crossing_rate};
use corsmal_extract::config::Config;
use corsmal_extract::engine::{Extractor, Features, Plan, Recording, Span};
use corsmal_extract::features::registry;
use ndarray::{Array2, Array3, ArrayView2, Axis};
use proptest::prelude::*;
use serde_json::json;

const SR: f64 = 16_000.0;

/// How frames are cut, for all features alike.
#[derive(Debug, Clone)]
struct Cutting {
    n_fft: usize,
    hop: usize,
    center: bool,
    pad_mode: &'static str,
}

impl Cutting {
    fn config(&self) -> Arc<Config> {
        let Self { n_fft, hop, center, pad_mode } = self;
        let stft = json!({
            "n_fft": n_fft, "hop_length": hop, "center": center, "pad_mode": pad_mode,
        });
        let with = |more: serde_json::Value| {
            let mut table = stft.clone();
            table.as_object_mut().unwrap().extend(more.as_object().unwrap().clone());
            table
        };
        let frame = json!({"frame_length": n_fft, "hop_length": hop, "center": center});
        // The second spectrum has a cutting of its own.
        let other = json!({"kind": "stft", "output": "complex", "n_fft": 300, "hop_length": 111});
        let value = json!({"features": {
            "mfcc": with(json!({"n_mels": 30, "n_mfcc": 13})),
            "melspectrogram": with(json!({"n_mels": 30})),
            "stft": stft,
            "zero_crossing_rate": frame,
            "rms": frame,
            "other": other,
        }});
        Arc::new(Config::from_value(value).unwrap())
    }

    fn plan(&self, channels: usize) -> Arc<Plan> {
        Arc::new(Plan::new(&self.config(), SR, channels).unwrap())
    }
}

fn cuttings() -> impl Strategy<Value = Cutting> {
    let modes = ["constant", "edge", "reflect", "symmetric"];
    (
        prop::sample::select(vec![512_usize, 2048, 401]),
        prop::sample::select(vec![64_usize, 160, 512, 700]),
        any::<bool>(),
        prop::sample::select(modes.to_vec()),
    )
        .prop_map(|(n_fft, hop, center, pad_mode)| Cutting { n_fft, hop, center, pad_mode })
}

fn channel_counts() -> impl Strategy<Value = usize> {
    prop::sample::select(vec![1_usize, 2, 3, 5, 8, 16])
}

/// Reproducible noise with a tone, interleaved.
fn signal(frames: usize, channels: usize, seed: u32) -> Vec<f32> {
    let mut state = seed | 1;
    let noise = move || {
        state ^= state << 13;
        state ^= state >> 17;
        state ^= state << 5;
        state as f32 / u32::MAX as f32 - 0.5
    };
    let noise = std::iter::repeat_with(noise).take(frames * channels);
    noise.enumerate().map(|(i, x)| 0.5 * x + 0.3 * (i as f32 * 0.01).sin()).collect()
}

/// One extractor over a whole recording, fed in blocks of the given sizes, over and over.
fn whole(plan: &Arc<Plan>, samples: &[f32], blocks: &[usize]) -> Span {
    let mut extractor = Extractor::new(plan.clone(), 0..u64::MAX, 0);
    feed(&mut extractor, samples, blocks, plan.channels);
    extractor.finish(true).unwrap()
}

fn feed(extractor: &mut Extractor, samples: &[f32], blocks: &[usize], channels: usize) {
    let mut rest = samples;
    for (i, block) in blocks.iter().cycle().enumerate() {
        if rest.is_empty() {
            break;
        }
        let (now, later) = rest.split_at((block * channels).min(rest.len()));
        // Both ways in.
        if i % 2 == 0 {
            extractor.push(now);
        } else {
            let wanted = block + 7;
            extractor.room(wanted)[..now.len()].copy_from_slice(now);
            extractor.commit(wanted, now.len() / channels);
        }
        rest = later;
    }
}

fn bits(raw: &[Vec<f32>]) -> Vec<Vec<u32>> {
    raw.iter().map(|values| values.iter().map(|x| x.to_bits()).collect()).collect()
}

/// Finished features as `[channels, coefficients, frames]`; for real ones only.
fn finished(plan: &Arc<Plan>, samples: &[f32]) -> Vec<(String, Array3<f32>)> {
    let mut recording = Recording::new(plan.clone(), &std::env::temp_dir());
    recording.add(whole(plan, samples, &[1 << 16])).unwrap();
    let Features::Frames(arrays) = recording.finish().unwrap() else { panic!("no summary") };
    let real = arrays.into_iter().filter(|a| !a.complex);
    real.map(|a| {
        let shape = (a.frames, a.coefficients, plan.channels);
        let values = Array3::from_shape_vec(shape, a.values.into_vec().unwrap()).unwrap();
        (a.name, values.permuted_axes([2, 1, 0]))
    })
    .collect()
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(96))]

    #[test]
    fn any_split_into_blocks_gives_the_same_bits(
        cutting in cuttings(),
        channels in channel_counts(),
        frames in 1_usize..6000,
        blocks in prop::collection::vec(1_usize..3000, 1..6),
    ) {
        let plan = cutting.plan(channels);
        let samples = signal(frames, channels, 7);
        let once = whole(&plan, &samples, &[frames]);
        let split = whole(&plan, &samples, &blocks);
        prop_assert_eq!(once.total, Some(frames as u64));
        prop_assert_eq!(split.total, once.total);
        prop_assert_eq!(bits(&split.raw), bits(&once.raw));
    }

    #[test]
    fn taking_parts_on_the_way_loses_nothing(
        cutting in cuttings(),
        channels in channel_counts(),
        frames in 1_usize..6000,
        block in 1_usize..3000,
    ) {
        let plan = cutting.plan(channels);
        let samples = signal(frames, channels, 8);
        let once = whole(&plan, &samples, &[frames]);
        let mut extractor = Extractor::new(plan.clone(), 0..u64::MAX, 0);
        let mut joined = vec![Vec::new(); once.raw.len()];
        let mut append = |span: Span| {
            joined.iter_mut().zip(span.raw).for_each(|(all, part)| all.extend(part));
        };
        for block in samples.chunks(block * channels) {
            extractor.push(block);
            append(extractor.take());
            prop_assert_eq!(extractor.stored(), 0);
        }
        append(extractor.finish(true).unwrap());
        prop_assert_eq!(bits(&joined), bits(&once.raw));
    }

    #[test]
    fn any_cut_into_spans_gives_the_same_bits(
        cutting in cuttings(),
        channels in channel_counts(),
        frames in 1_usize..9000,
        mut cuts in prop::collection::vec(1_u64..10_000, 0..5),
        blocks in prop::collection::vec(1_usize..3000, 1..4),
    ) {
        let plan = cutting.plan(channels);
        let samples = signal(frames, channels, 9);
        let once = whole(&plan, &samples, &[frames]);
        cuts.sort_unstable();
        cuts.dedup();
        let starts = std::iter::once(0).chain(cuts.iter().copied());
        let ends = cuts.iter().copied().chain([u64::MAX]);
        let (before, after) = plan.context();
        let mut joined = vec![Vec::new(); once.raw.len()];
        let mut total = None;
        for (start, end) in starts.zip(ends) {
            // What a run reads for a span: see `run/reader.rs`.
            let first = start.saturating_sub(2 * before as u64 + 1);
            let last = end.saturating_add(after as u64);
            let part = (first as usize).min(frames)..(last.min(frames as u64) as usize);
            let mut extractor = Extractor::new(plan.clone(), start..end, first);
            let part = &samples[part.start * channels..part.end * channels];
            feed(&mut extractor, part, &blocks, channels);
            let span = extractor.finish(last > frames as u64).unwrap();
            joined.iter_mut().zip(span.raw).for_each(|(all, part)| all.extend(part));
            total = total.or(span.total);
        }
        prop_assert_eq!(total, Some(frames as u64));
        prop_assert_eq!(bits(&joined), bits(&once.raw));
    }

    #[test]
    fn eight_channels_are_eight_times_one(
        cutting in cuttings(),
        channels in channel_counts(),
        frames in 1_usize..5000,
    ) {
        let plan = cutting.plan(channels);
        let samples = signal(frames, channels, 10);
        let together = whole(&plan, &samples, &[1000]);
        let one = cutting.plan(1);
        for c in 0..channels {
            let alone: Vec<f32> = samples[c..].iter().step_by(channels).copied().collect();
            let alone = whole(&one, &alone, &[777]);
            for (planned, (all, alone)) in
                plan.features.iter().zip(together.raw.iter().zip(&alone.raw))
            {
                // Complex values are stored in pairs.
                let width = if planned.complex { 2 } else { 1 };
                let channel: Vec<f32> = all
                    .chunks(width)
                    .skip(c)
                    .step_by(channels)
                    .flatten()
                    .copied()
                    .collect();
                prop_assert_eq!(bits(&[channel]), bits(std::slice::from_ref(alone)));
            }
        }
    }

    #[test]
    fn numbers_are_those_of_the_array_functions(
        cutting in cuttings(),
        channels in channel_counts(),
        frames in 2048_usize..6000,
    ) {
        let plan = cutting.plan(channels);
        let samples = signal(frames, channels, 11);
        let y = ArrayView2::from_shape((frames, channels), &samples).unwrap();
        let y: Array2<f64> = y.t().mapv(f64::from);
        let pad_mode = match cutting.pad_mode {
            "edge" => PadMode::Edge,
            "reflect" => PadMode::Reflect,
            "symmetric" => PadMode::Symmetric,
            _ => PadMode::Constant,
        };
        let (n_fft, hop_length, center) = (cutting.n_fft, cutting.hop, cutting.center);
        let stft = StftParams { center, pad_mode, ..StftParams::new(n_fft, hop_length) };
        let frame = FrameParams { frame_length: n_fft, hop_length, center };
        let power = spectrogram(y.view(), &stft, 2.0).unwrap();
        let bank = mel_filter(&MelParams { n_mels: 30, ..MelParams::new(SR, n_fft) }).unwrap();
        let mel = SparseBank::new(&bank).apply(power.view());
        let mut log_mel = mel.clone();
        for mut channel in log_mel.axis_iter_mut(Axis(0)) {
            let decibel = Decibel { reference: 1.0, amin: 1e-10, top_db: Some(80.0) };
            let mut values: Vec<f64> = channel.iter().copied().collect();
            decibel.power(&mut values).unwrap();
            channel.iter_mut().zip(values).for_each(|(x, v)| *x = v);
        }
        let cepstrum = MfccParams { n_mfcc: 13, ..MfccParams::default() };
        let crossings = ZeroCrossingParams::default();
        for (name, actual) in finished(&plan, &samples) {
            let (expected, tolerance) = match name.as_str() {
                "stft" => (power.mapv(f64::sqrt), 1e-6),
                "melspectrogram" => (mel.clone(), 1e-6),
                "mfcc" => (mfcc(log_mel.view(), &cepstrum).unwrap(), 1e-5),
                "zero_crossing_rate" => {
                    (zero_crossing_rate(y.view(), &frame, &crossings).unwrap(), 1e-7)
                }
                _ => {
                    let level = rms(y.view(), &frame, PadMode::Constant).unwrap();
                    (level.mapv(f64::from), 1e-6)
                }
            };
            prop_assert_eq!(actual.shape(), expected.shape());
            let largest = expected.iter().fold(0.0, |m: f64, x| m.max(x.abs()));
            let worst = actual.iter().zip(&expected).map(|(a, b)| (f64::from(*a) - b).abs());
            let worst = worst.fold(0.0, f64::max) / largest;
            prop_assert!(worst < tolerance, "{}: {} of the largest value", name, worst);
        }
    }
}

/// Every registered feature by itself with its defaults; derived ones after their source.
fn each_feature(channels: usize) -> Vec<(&'static str, Arc<Plan>)> {
    let plan = |kind: &'static str| {
        let mut features = serde_json::Map::new();
        let source = registry().iter().find(|e| e.kind() == kind).unwrap().defaults();
        if let Some(of) = source.get("of").and_then(|of| of.as_str()) {
            features.insert(of.into(), json!({}));
        }
        features.insert(kind.into(), json!({}));
        let config = Config::from_value(json!({"features": features})).unwrap();
        (kind, Arc::new(Plan::new(&Arc::new(config), SR, channels).unwrap()))
    };
    registry().iter().map(|entry| plan(entry.kind())).collect()
}

#[test]
fn every_feature_is_finite_on_silence_dc_and_one_sample() {
    for channels in [1, 3, 8] {
        for (kind, plan) in each_feature(channels) {
            let long = 16_384 * channels;
            let mut click = vec![0.0; long];
            click[5 * channels] = 1.0;
            if plan.needs_whole() {
                // Silence or one sample may be too little for these; then they refuse with a reason.
                for samples in [vec![0.0; long], vec![1.0; long], click, vec![0.5; channels]] {
                    let mut extractor = Extractor::new(plan.clone(), 0..u64::MAX, 0);
                    extractor.push(&samples);
                    match extractor.finish(true) {
                        Ok(span) => {
                            let finite = span.raw.iter().flatten().all(|x| x.is_finite());
                            assert!(finite, "{kind}, {channels} channels");
                        }
                        Err(refused) => assert_eq!(refused.feature, kind),
                    }
                }
                continue;
            }
            for samples in [vec![0.0; long], vec![1.0; long], vec![-0.25; long], click] {
                for (name, values) in finished(&plan, &samples) {
                    let finite = values.iter().all(|x| x.is_finite());
                    assert!(finite && !values.is_empty(), "{kind}: {name}, {channels} channels");
                }
            }
            // A derivative needs several frames and says so.
            let mut recording = Recording::new(plan.clone(), &std::env::temp_dir());
            recording.add(whole(&plan, &vec![0.5; channels], &[1])).unwrap();
            match recording.finish() {
                Ok(Features::Frames(arrays)) => {
                    for array in arrays {
                        let values = array.values.into_vec().unwrap();
                        assert!(values.iter().all(|x| x.is_finite()), "{kind}: one sample");
                    }
                }
                Ok(Features::Summary(_)) => panic!("no summary was asked for"),
                Err(error) => assert!(error.to_string().contains("needs at least"), "{error}"),
            }
        }
    }
}

#[test]
fn a_signal_one_hop_later_has_the_same_frames_one_later() {
    const CHANNELS: usize = 2;
    for (kind, plan) in each_feature(CHANNELS) {
        if plan.needs_whole() {
            continue;
        }
        for (index, planned) in plan.features.iter().enumerate() {
            let hop = plan.hop(&planned.name) as usize;
            let width = planned.raw_rows * CHANNELS;
            if width == 0 {
                continue;
            }
            let samples = signal(20_000, CHANNELS, 12);
            let early = whole(&plan, &samples, &[4000]).raw.swap_remove(index);
            let late = whole(&plan, &samples[hop * CHANNELS..], &[4000]).raw.swap_remove(index);
            // Frames that see neither end.
            let (before, after) = plan.context();
            let from = before.div_ceil(hop);
            let to = late.len() / width - after.div_ceil(hop);
            assert!(to > from + 5);
            let (a, b) =
                (&early[(from + 1) * width..(to + 1) * width], &late[from * width..to * width]);
            assert_eq!(bits(&[a.to_vec()]), bits(&[b.to_vec()]), "{kind}: {}", planned.name);
        }
    }
}
