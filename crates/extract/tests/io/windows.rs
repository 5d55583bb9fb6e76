//! Recordings cut into windows.

use std::path::Path;
use std::sync::Arc;

use corsmal_audio::Repair;
use corsmal_extract::config::Config;
use corsmal_extract::cut::{WindowSpan, into_windows, name_recordings};
use corsmal_extract::engine::{Signals, Window, Windowing, Windows};
use corsmal_extract::inputs::{Input, InputSource};
use corsmal_extract::run::{Batch, Recordings};
use corsmal_files::outcome::Outcome;

/// 30,000 frames at 44.1 kHz.
const MP3: &[u8] = include_bytes!("../../../audio/tests/audio/samples/sine-1ch.mp3");

fn input(path: &Path) -> Input {
    let source = InputSource::File(path.to_owned());
    Input { id: "x".into(), source, start: None, end: None, labels: Vec::new() }
}

/// Windows of a tenth of a second.
fn windows(bytes: &[u8]) -> Vec<Input> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("x");
    std::fs::write(&path, bytes).unwrap();
    into_windows(vec![input(&path)], WindowSpan { window: 0.1, hop: 0.1 }, &Arc::default())
        .unwrap()
        .inputs
}

#[test]
fn lengths_in_headers_do_not_say_how_many_windows_there_are() {
    let plain = windows(MP3);
    assert_eq!(plain.len(), 30_000 / 4410);
    let count = MP3.windows(4).position(|w| w == b"Info" || w == b"Xing").unwrap() + 8;
    // Where the count is too large, nobody knows the padding: it stays.
    for (claim, frames) in [(0u32, 30_000), (5, 30_000), (5000, 31_151)] {
        let mut bytes = MP3.to_vec();
        bytes[count..count + 4].copy_from_slice(&claim.to_be_bytes());
        assert_eq!(windows(&bytes).len(), frames / 4410, "{claim} frames claimed");
    }
    assert_eq!(windows(&[MP3, MP3].concat()).len(), 60_000 / 4410);
}

#[test]
fn what_cannot_be_read_stays_one_input_for_its_row() {
    // Another sample rate in the middle is refused while reading.
    let mut slow = vec![0xff, 0xe3, 0x18, 0xc4];
    slow.resize(72, 0);
    for bytes in [b"no audio at all".to_vec(), [MP3, &slow.repeat(5)].concat()] {
        let windows = windows(&bytes);
        assert_eq!((windows.len(), windows[0].id.as_str()), (1, "x"));
        assert_eq!((windows[0].start, windows[0].end), (None, None));
    }
}

#[test]
fn stretches_are_named_after_their_file_however_it_is_written() {
    let stretch = |path: &str, start: Option<f64>| Input { start, ..input(Path::new(path)) };
    let named = |inputs: Vec<Input>| -> Vec<Vec<(String, String)>> {
        name_recordings(inputs).into_iter().map(|input| input.labels).collect()
    };
    let x = stretch("a/x.wav", Some(0.0));
    let others = [stretch("./a/../a/x.wav", Some(1.0)), stretch("b/y.wav", None)];
    let found = named([std::slice::from_ref(&x), &others[..]].concat());
    let recording = |path: &str| vec![("recording".to_string(), path.to_string())];
    assert_eq!(found, ["a/x.wav", "a/x.wav", "b/y.wav"].map(recording));
    // Each is a file of its own; a label of that name is there; nothing is cut.
    let unnamed = |inputs: Vec<Input>| named(inputs).iter().all(Vec::is_empty);
    assert!(unnamed(vec![x.clone(), others[1].clone()]));
    assert!(unnamed(vec![others[1].clone(), others[1].clone()]));
    let own = Input { labels: recording("mine"), ..x.clone() };
    assert_eq!(named(vec![own.clone(), own]), [recording("mine"), recording("mine")]);
}

/// They were groups of their own, so that folds had windows of one recording on both sides.
#[test]
fn windows_of_stretches_belong_to_their_file() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("x");
    std::fs::write(&path, MP3).unwrap();
    let stretch = |id: &str, start: f64, end: f64| Input {
        id: id.into(),
        start: Some(start),
        end: Some(end),
        ..input(&path)
    };
    let cut = |inputs: Vec<Input>| {
        into_windows(inputs, WindowSpan { window: 0.1, hop: 0.1 }, &Arc::default()).unwrap().inputs
    };
    let windows = cut(vec![stretch("a", 0.0, 0.2), stretch("b", 0.3, 0.5)]);
    let recording = vec![("recording".to_string(), path.to_str().unwrap().to_string())];
    assert_eq!(windows.len(), 4);
    assert!(windows.iter().all(|window| window.labels == recording), "{windows:?}");
    // A stretch alone has the name that it was given.
    let windows = cut(vec![stretch("a", 0.0, 0.2)]);
    assert!(windows.iter().all(|window| window.labels[0].1 == "a"), "{windows:?}");
}

/// Seconds of a recording, up to what cannot be read.
fn length(path: &Path) -> f64 {
    let Ok(mut source) = corsmal_audio::open(path) else { return 1.0 };
    let _ = source.go_to(u64::MAX);
    source.health().decoded_frames as f64 / f64::from(source.spec().sample_rate)
}

/// Decoders go on from one stretch to the next; nothing may tell.
#[test]
fn stretches_together_are_as_stretches_alone() {
    let folder = tempfile::tempdir().unwrap();
    let samples = Path::new("../audio/tests/audio/samples");
    // In lengths of the recording: one after the other, inside of others, backwards, one twice, over the end,
    // after it.
    let mut times: Vec<(f64, Option<f64>)> =
        (0..14).map(|i| (f64::from(i) * 0.07, Some(f64::from(i) * 0.07 + 0.15))).collect();
    times.extend([(0.3, Some(0.9)), (0.4, Some(0.6)), (0.1, Some(0.3)), (0.1, Some(0.3))]);
    times.extend([(0.7, None), (0.9, Some(3.0)), (0.9, Some(0.95)), (4.0, Some(5.0))]);
    // Only one that asks for more learns that a file ends too early.
    times.extend([(0.8, Some(1.5)), (0.8, Some(1.0)), (0.5, Some(1.0))]);
    for name in [
        "sine-1ch.mp3",
        "bursts-2ch-cbr.mp3",
        "steps-2ch-blocks.flac",
        "sines-2ch.ogg",
        "levels-8ch.opus",
        "sines-2ch.m4a",
        "sines-2ch.aac",
    ] {
        let plain = std::fs::read(samples.join(name)).unwrap();
        let (mut hurt, middle) = (plain.clone(), plain.len() / 2);
        hurt[middle..middle + 64].fill(0x55);
        let cut = plain[..plain.len() * 2 / 3].to_vec();
        // Longer than a block of samples, where recordings can follow each other in a file.
        let long = if name.ends_with(".m4a") { plain.clone() } else { plain.repeat(8) };
        for (damage, bytes) in [("none", plain), ("hurt", hurt), ("cut", cut), ("long", long)] {
            let path = folder.path().join(format!("{damage}-{name}"));
            std::fs::write(&path, bytes).unwrap();
            // A file of just now could change unseen, so that nothing of it is kept.
            let file = std::fs::File::options().append(true).open(&path).unwrap();
            let hour = std::time::Duration::from_secs(3600);
            file.set_modified(std::time::SystemTime::now() - hour).unwrap();
            let length = length(&path);
            let stretch = |(i, (start, end)): (usize, &(f64, Option<f64>))| Input {
                id: i.to_string(),
                start: Some(start * length),
                end: end.map(|end| end * length),
                ..input(&path)
            };
            let inputs: Vec<Input> = times.iter().enumerate().map(stretch).collect();
            let of = |inputs: &[Input], jobs: usize| -> Batch {
                let config = Arc::new(Config::preset("esc26").unwrap());
                let stop = Arc::default();
                Recordings::new(config).extract((inputs, &[]), None, jobs, &stop).unwrap()
            };
            let told = |batch: &Batch| {
                let outcomes = batch.outcomes.iter();
                outcomes.map(|o| serde_json::to_string(o).unwrap()).collect::<Vec<_>>()
            };
            let alone: Vec<Batch> = inputs.chunks(1).map(|one| of(one, 1)).collect();
            let values: Vec<f32> = alone.iter().flat_map(|b| b.values.iter().copied()).collect();
            for (input, batch) in inputs.iter().zip(&alone) {
                let outcome = &batch.outcomes[0];
                let first = |rate| (input.start.unwrap() * f64::from(rate) + 1e-3) as u64;
                assert_eq!(outcome.start_frame, outcome.sample_rate.map(first), "{outcome:?}");
            }
            let outcomes: Vec<String> = alone.iter().flat_map(&told).collect();
            let whole = outcomes.iter().filter(|o| o.contains("\"status\":\"ok\"")).count();
            assert!(whole > 4 || damage != "none", "{name}: {outcomes:#?}");
            for jobs in [1, 2, 3] {
                let together = of(&inputs, jobs);
                assert_eq!(told(&together), outcomes, "{damage} {name}, {jobs} jobs");
                assert_eq!(together.values, values, "{damage} {name}, {jobs} jobs");
            }
        }
    }
}

#[test]
fn only_stretches_with_a_gap_are_truncated() {
    let folder = tempfile::tempdir().unwrap();
    let samples = Path::new("../audio/tests/audio/samples");
    let mut gaps = 0;
    for (name, tenth) in ["bursts-2ch-cbr.mp3", "sines-2ch.ogg", "levels-8ch.opus", "sines-2ch.m4a"]
        .into_iter()
        .flat_map(|name| [4, 5, 6, 7].map(|tenth| (name, tenth)))
    {
        let mut bytes = std::fs::read(samples.join(name)).unwrap();
        let at = bytes.len() * tenth / 10;
        bytes[at..at + 16].fill(0x55);
        let path = folder.path().join(name);
        std::fs::write(&path, bytes).unwrap();
        let mut source = corsmal_audio::open(&path).unwrap();
        source.go_to(u64::MAX).unwrap();
        let (report, rate) = (source.health(), f64::from(source.spec().sample_rate));
        let lost = report.repairs.iter().find_map(|repair| match repair {
            Repair::LostFrames { first, count } => Some((*first, first + count)),
            _ => None,
        });
        let total = report.decoded_frames;
        let inside = |(first, end): &(u64, u64)| *first > 100 && *end + 100 < total;
        let Some((first, end)) = lost.filter(inside) else { continue };
        gaps += 1;
        let stretches = [(0, first), (first - 1, first + 1), (end - 1, total), (end, total)];
        let stretch = |(from, to): (u64, u64)| Input {
            id: from.to_string(),
            start: Some(from as f64 / rate),
            end: Some(to as f64 / rate),
            ..input(&path)
        };
        let inputs: Vec<Input> = stretches.into_iter().map(stretch).collect();
        let engine = Recordings::new(Arc::new(Config::preset("esc26").unwrap()));
        let batch = engine.extract((&inputs, &[]), None, 1, &Arc::default()).unwrap();
        let status: Vec<&str> = batch.outcomes.iter().map(|o| o.status.name()).collect();
        assert_eq!(status, ["ok", "truncated", "truncated", "ok"], "{name}: {:#?}", batch.outcomes);
        let told = |o: &Outcome| o.repairs.iter().any(|repair| repair == "lost_frames");
        let told: Vec<bool> = batch.outcomes.iter().map(told).collect();
        assert_eq!(told, [false, true, true, false], "{name}");
        let signals = Signals::new(Arc::new(Config::preset("esc26").unwrap()));
        let windowing = Windowing::new(0.03, 0.02).unwrap();
        let windows = Windows::open(&input(&path), &signals, windowing, &Arc::default()).unwrap();
        for window in windows {
            let Window { start, end: until, loss, .. } = window.unwrap();
            let frame = |seconds: f64| (seconds * rate).round() as u64;
            let is_hurt = frame(start) < end && first < frame(until);
            assert_eq!(loss.is_some(), is_hurt, "{name}, {start} s: {loss:?}");
            let count = end.min(frame(until)).saturating_sub(first.max(frame(start)));
            assert!(
                loss.is_none_or(|loss| loss.starts_with(&format!("{count} damaged or missing")))
            );
        }
    }
    assert!(gaps > 3, "{gaps}");
}

#[test]
fn a_start_of_the_signal_behind_a_stretch_is_said() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("x.mp3");
    std::fs::write(&path, MP3).unwrap();
    let of_stretch = |changes: &[String], (start, end): (f64, f64)| {
        let base = Config::preset("esc26").unwrap().to_value();
        let config = Config::from_tree(base, changes).unwrap();
        let input = Input { start: Some(start), end: Some(end), ..input(&path) };
        let engine = Recordings::new(Arc::new(config));
        let batch = engine.extract((&[input], &[]), None, 1, &Arc::default()).unwrap();
        (batch.outcomes[0].status.name(), batch.outcomes[0].reason.clone())
    };
    let of = |changes: &[String], end: f64| of_stretch(changes, (0.1, end));
    let behind = of_stretch(&[], (1e18, 2e18)).1;
    assert!(behind.ends_with("s, after the end of the recording"), "{behind}");
    let reason = "signal.start and signal.end leave nothing of the stretch";
    assert_eq!(of(&["signal.start=0.3".into()], 0.2), ("empty", reason.into()));
    assert_eq!(of(&[], 0.100001), ("empty", "the stretch has no frame at 44100 Hz".into()));
}

/// Half of a recording was missing, and every window was ok.
#[test]
fn what_is_missing_of_recordings_has_no_windows_and_is_told() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("x.wav");
    let spec = hound::WavSpec {
        channels: 1,
        sample_rate: 8000,
        bits_per_sample: 16,
        sample_format: hound::SampleFormat::Int,
    };
    let mut writer = hound::WavWriter::create(&path, spec).unwrap();
    (0..8000).for_each(|i| writer.write_sample((i * i % 997) as i16).unwrap());
    writer.finalize().unwrap();
    let cut = |inputs: Vec<Input>| {
        into_windows(inputs, WindowSpan { window: 0.1, hop: 0.1 }, &Arc::default()).unwrap()
    };
    let until = |end: f64| Input { id: "y".into(), end: Some(end), ..input(&path) };
    // Times are rounded where they come from.
    for end in [0.5, 1.0, 1.0004, 1.05] {
        assert!(cut(vec![input(&path), until(end)]).warnings().is_empty());
    }
    assert_eq!(
        cut(vec![until(3.0), input(&path)]).warnings(),
        ["y: the stretch ends at 3 s, its recording at 1 s; what is missing has no windows"]
    );
    let whole = std::fs::read(&path).unwrap();
    std::fs::write(&path, &whole[..44 + 2 * 5000]).unwrap();
    // What ends before the loss is complete, and what was lost may be less than a window.
    assert!(cut(vec![until(0.5)]).warnings().is_empty());
    let long = WindowSpan { window: 0.6, hop: 0.6 };
    let windows = into_windows(vec![input(&path)], long, &Arc::default()).unwrap();
    assert!(windows.inputs.len() == 1 && windows.warnings().is_empty());
    let windows = cut(vec![input(&path), Input { id: "y".into(), ..input(&path) }]);
    assert_eq!(windows.inputs.len(), 12);
    assert_eq!(
        windows.warnings(),
        [
            "x: the file ends after 5000 of 8000 frames, the first of 2 such inputs; what is missing has no windows"
        ]
    );
    // Counted by decoding.
    std::fs::write(&path, &MP3[..MP3.len() / 2]).unwrap();
    let windows = cut(vec![input(&path)]);
    let told = windows.warnings();
    assert!(windows.inputs.len() > 1 && told[0].contains(" of 30000 frames"), "{told:?}");
}
