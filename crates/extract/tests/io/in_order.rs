//! Recordings one by one, beside the same recordings all at once.

use std::io::Cursor;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use corsmal_extract::config::Config;
use corsmal_extract::engine::Features;
use corsmal_extract::inputs::{Input, InputSource};
use corsmal_extract::run::{Batch, Recorded, Recordings, RunError};
use corsmal_files::outcome::Outcome;

/// Twenty recordings of one channel, but for one of two and one that is none.
fn inputs() -> Vec<Input> {
    let wav = |number: u32| {
        let channels = if number == 7 { 2 } else { 1 };
        let spec = hound::WavSpec {
            channels,
            sample_rate: 8000,
            bits_per_sample: 16,
            sample_format: hound::SampleFormat::Int,
        };
        let mut bytes = Cursor::new(Vec::new());
        let mut writer = hound::WavWriter::new(&mut bytes, spec).unwrap();
        for i in 0..4000 + 100 * number {
            for _ in 0..channels {
                writer.write_sample((i.wrapping_mul(2_654_435_761 + number) >> 17) as i16).unwrap();
            }
        }
        writer.finalize().unwrap();
        bytes.into_inner()
    };
    let input = |number: u32| {
        let bytes = if number == 11 { b"no sound".to_vec() } else { wav(number) };
        let source = InputSource::Memory(bytes.into());
        Input { id: number.to_string(), source, start: None, end: None, labels: Vec::new() }
    };
    (0..20).map(input).collect()
}

fn values(features: Option<Features>) -> Vec<f32> {
    match features {
        None => Vec::new(),
        Some(Features::Summary(row)) => row,
        Some(Features::Frames(arrays)) => {
            arrays.into_iter().flat_map(|a| a.values.into_vec().unwrap()).collect()
        }
    }
}

/// What one call gives for all: outcomes, and values one after the other.
fn together(batch: Batch) -> (Vec<Outcome>, Vec<f32>) {
    let frames = batch.frames.into_iter().flatten();
    let frames = frames.flat_map(|(_, arrays)| values(Some(Features::Frames(arrays))));
    (batch.outcomes, batch.values.into_iter().chain(frames).collect())
}

#[test]
fn recordings_one_by_one_are_those_of_one_call() {
    let (inputs, stop) = (inputs(), Arc::new(AtomicBool::new(false)));
    for preset in ["esc26", "logmel"] {
        let recordings = Recordings::new(Arc::new(Config::preset(preset).unwrap()));
        let (outcomes, all) = together(recordings.extract((&inputs, &[]), None, 2, &stop).unwrap());
        assert!(!all.is_empty());
        for jobs in [1, 3] {
            let (mut found, mut row) = (Vec::new(), Vec::new());
            let each = recordings.in_order(&inputs, jobs, &stop).unwrap();
            for (recorded, input) in each.zip(&inputs) {
                let Recorded { input: of, outcome, features } = recorded.unwrap();
                assert_eq!(of.id, input.id);
                assert_eq!(features.is_some(), outcome.status.has_features(), "{}", of.id);
                found.push(outcome);
                row.extend(values(features));
            }
            assert_eq!(found, outcomes);
            assert_eq!(row, all);
        }
    }
}

#[test]
fn nothing_comes_after_a_stop() {
    let (inputs, stop) = (inputs(), Arc::new(AtomicBool::new(false)));
    let recordings = Recordings::new(Arc::new(Config::preset("esc26").unwrap()));
    let mut each = recordings.in_order(&inputs, 1, &stop).unwrap();
    assert!(each.next().is_some_and(|first| first.is_ok()));
    stop.store(true, Ordering::Relaxed);
    let after: Vec<_> = each.collect();
    assert!(matches!(after.last(), Some(Err(RunError::Interrupted))), "{}", after.len());
    assert!(after.len() < inputs.len() - 1);
}
