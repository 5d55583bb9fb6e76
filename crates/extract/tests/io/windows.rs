//! Recordings cut into windows.

use std::path::Path;
use std::sync::Arc;

use corsmal_extract::cut::{WindowSpan, into_windows, name_recordings};
use corsmal_extract::inputs::{Input, InputSource};

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
    into_windows(vec![input(&path)], WindowSpan { window: 0.1, hop: 0.1 }, &Arc::default()).unwrap()
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
