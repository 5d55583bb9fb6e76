//! Pieces of recordings: the frames of all of them are those of the whole recording, bit for bit, or they
//! are refused.

use std::path::Path;
use std::sync::Arc;

use corsmal_extract::config::Config;
use corsmal_extract::engine::{FeatureArray, Store};
use corsmal_extract::inputs::{Input, InputSource};
use corsmal_extract::run::{Batch, Piece, Recordings};
use corsmal_files::outcome::Status;

const FRAMES: usize = 70_000;
const RATE: u32 = 16_000;

/// Noise and a click, so that no two frames are alike.
fn recording(path: &Path, channels: u16) {
    let spec = hound::WavSpec {
        channels,
        sample_rate: RATE,
        bits_per_sample: 16,
        sample_format: hound::SampleFormat::Int,
    };
    let mut wav = hound::WavWriter::create(path, spec).unwrap();
    let mut state = 1_u32;
    for _ in 0..FRAMES * usize::from(channels) {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        wav.write_sample((state >> 18) as i16 - 4096).unwrap();
    }
    wav.finalize().unwrap();
}

fn input(path: &Path, start: Option<f64>, end: Option<f64>) -> Input {
    let source = InputSource::File(path.to_owned());
    Input { id: "x".into(), source, start, end, labels: Vec::new() }
}

/// Pieces that begin at these samples, the last one open.
fn pieces(starts: &[u64]) -> Vec<Piece> {
    let ends = starts[1..].iter().copied().chain([u64::MAX]);
    starts.iter().zip(ends).map(|(start, end)| Some(*start..end)).collect()
}

fn compute(config: &str, input: &Input, pieces: &[Piece]) -> Batch {
    let config = Config::with_overrides(config, "test", &[]).unwrap();
    let recordings = Recordings::new(Arc::new(config));
    let inputs = vec![input.clone(); pieces.len()];
    recordings.extract((&inputs, pieces), None, 2, &Arc::default()).unwrap()
}

/// The bits of every feature, pieces one after the other.
fn bits(batch: Batch) -> Vec<Vec<u32>> {
    let statuses: Vec<_> = batch.outcomes.iter().map(|o| (o.status, o.reason.clone())).collect();
    assert!(statuses.iter().all(|(status, _)| *status == Status::Ok), "{statuses:?}");
    let mut features: Vec<Vec<u32>> = Vec::new();
    for (_, arrays) in batch.frames.into_iter().flatten() {
        features.resize(arrays.len(), Vec::new());
        for (all, FeatureArray { values, .. }) in features.iter_mut().zip(arrays) {
            let values: Vec<f32> = Store::into_vec(values).unwrap();
            all.extend(values.into_iter().map(f32::to_bits));
        }
    }
    features
}

const EXACT: [&str; 9] = [
    "[features.melspectrogram]\n[features.rms]\n[features.zero_crossing_rate]",
    "[features.melspectrogram]\ncenter = false\nhop_length = 300\nn_fft = 1024",
    "[features.stft]\noutput = \"magnitude\"\npad_mode = \"reflect\"",
    "[features.stft]\noutput = \"complex\"\nhop_length = 7001",
    "[features.mfcc]\ntop_db = \"none\"\n[features.spectral_centroid]\nn_fft = 400\nhop_length = 160",
    "[signal]\npreemphasis = 0.97\n[features.melspectrogram]",
    "[signal]\npreemphasis = 0.97\n[features.stft]\noutput = \"power\"\ncenter = false",
    "[signal]\nchannels = \"mean\"\nstart = 0.25\n[features.spectral_contrast]\nlinear = true\n[features.rms]\nhop_length = 64",
    "[features.spectral_rolloff]\n[features.spectral_bandwidth]\n[features.poly_features]\n[features.spectral_flatness]",
];

#[test]
fn frames_of_pieces_are_those_of_the_recording() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("x.wav");
    recording(&path, 2);
    // At frames and between them; far apart and closer than a transform is long; near both ends.
    let cuts: [&[u64]; 5] = [
        &[0, 32_768],
        &[0, 1, 2, 3],
        &[0, 511, 1024, 1500, 1501, 40_000, 69_999],
        &[0, 16_000, 32_000, 48_000, 64_000],
        &[0, 69_000, 69_900, 69_990],
    ];
    for config in EXACT {
        for (start, end) in [(None, None), (Some(0.1), None), (Some(0.05), Some(4.2))] {
            let input = input(&path, start, end);
            let whole = bits(compute(config, &input, &[None]));
            assert!(whole.iter().all(|feature| !feature.is_empty()), "{config}");
            for starts in cuts {
                let cut = compute(config, &input, &pieces(starts));
                let frames: u64 = cut.outcomes.iter().map(|outcome| outcome.decoded_frames).sum();
                let decoded = compute(config, &input, &[None]).outcomes[0].decoded_frames;
                assert_eq!(frames, decoded, "{config} {starts:?}");
                assert!(bits(cut) == whole, "{config} {start:?} {starts:?}");
            }
        }
    }
}

#[test]
fn what_depends_on_the_whole_recording_has_no_pieces() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("x.wav");
    recording(&path, 1);
    let input = input(&path, None, None);
    for (config, reason) in [
        (
            "[features.rms]\n[summary]\nstats = [\"mean\"]",
            "statistics are computed over the whole recording",
        ),
        ("[features.mfcc]", "maximum of the whole recording: set its top_db to \"none\""),
        ("[features.spectral_contrast]", "maximum of the whole recording: set its linear to true"),
        (
            "[features.melspectrogram]\n[features.delta]\nof = \"melspectrogram\"",
            "delta depends on neighbouring frames",
        ),
        ("[features.pcen]", "pcen depends on neighbouring frames"),
        ("[features.spectral_flux]", "spectral_flux depends on neighbouring frames"),
        ("[features.cqt]", "cqt is computed from the whole recording"),
        ("[features.hpss]", "from the whole recording"),
        ("[features.af193]", "from the whole recording"),
        ("[signal]\nnormalize = \"peak\"\n[features.rms]", "signal.normalize"),
        ("[signal]\nlength = 2.0\n[features.rms]", "signal.length"),
        ("[signal]\nsample_rate = 8000.0\n[features.rms]", "is resampled"),
    ] {
        let made = Config::with_overrides(config, "test", &[]).unwrap();
        let refusal = Recordings::new(Arc::new(made)).piece_refusal();
        if reason == "is resampled" {
            // Which recordings are, only they say.
            assert_eq!(refusal, None);
        } else {
            assert!(refusal.as_ref().is_some_and(|r| r.contains(reason)), "{config}: {refusal:?}");
        }
        let found = compute(config, &input, &pieces(&[0, 30_000]));
        for outcome in &found.outcomes {
            assert_eq!(outcome.status, Status::Unsupported, "{config}");
            assert!(outcome.reason.contains(reason), "{config}: {}", outcome.reason);
        }
    }
}
