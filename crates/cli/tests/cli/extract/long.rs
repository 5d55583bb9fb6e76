//! A recording that is cut into spans gives what one pass over it gives.

use std::path::Path;
use std::sync::Arc;

use corsmal_extract::config::Config;
use corsmal_extract::engine::{Extractor, Features, Plan, Recording};
use corsmal_files::npz::NpzFile;
use corsmal_files::outcome::Status;

use super::support::{ended, extract, extraction, table, wav};

/// More than three spans (2^20 frames each).
const FRAMES: usize = 3 * (1 << 20) + 54_321;

/// Log-mel of a mono recording in one pass, `[frames][bands]`.
fn single_pass(path: &Path) -> Vec<f32> {
    let config = Arc::new(Config::preset("logmel").unwrap());
    let plan = Arc::new(Plan::new(&config, 16_000.0, 1).unwrap());
    let mut reader = hound::WavReader::open(path).unwrap();
    let samples: Vec<f32> =
        reader.samples::<i16>().map(|s| f32::from(s.unwrap()) / 32_768.0).collect();
    let mut extractor = Extractor::new(plan.clone(), 0..u64::MAX, 0);
    extractor.push(&samples);
    let mut recording = Recording::new(plan, path.parent().unwrap());
    recording.add(extractor.finish(true).unwrap()).unwrap();
    let Features::Frames(arrays) = recording.finish().unwrap() else { panic!("no summary") };
    arrays.into_iter().next().unwrap().values.into_vec().unwrap()
}

#[test]
fn long_recordings() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let long = wav(&at("long.wav"), 1, FRAMES, 5);
    let expected = single_pass(&long);
    let one = at("one.npz");
    extract(&long, &one, &["--jobs", "1"]).with(0);
    let array = NpzFile::open(&one).unwrap().f32("long").unwrap();
    assert_eq!(array.shape(), [1, 128, 1 + FRAMES / 512]);
    // In memory order, frames last: the transposed view is in standard order.
    let values = array.t();
    assert!(values.iter().zip(&expected).all(|(a, b)| a.to_bits() == b.to_bits()));
    for jobs in ["2", "5"] {
        let out = at("more.npz");
        extract(&long, &out, &["--jobs", jobs, "--overwrite"]).with(0);
        assert!(std::fs::read(&out).unwrap() == std::fs::read(&one).unwrap(), "--jobs {jobs}");
    }

    // Cut off after the first span: the header promises two more.
    let kept = (1 << 20) + 1000;
    let bytes = std::fs::read(&long).unwrap();
    std::fs::write(at("cut.wav"), &bytes[..44 + 2 * kept]).unwrap();
    wav(&at("cut-ref.wav"), 1, kept, 5);
    let out = at("cut.npz");
    extract(&at("cut.wav"), &out, &["--jobs", "2"]).with(0);
    let cut = table(&out);
    let outcome = &cut.outcomes()[0];
    assert_eq!((outcome.status, outcome.decoded_frames), (Status::Truncated, kept as u64));
    let expected = single_pass(&at("cut-ref.wav"));
    let array = NpzFile::open(&out).unwrap().f32("cut").unwrap();
    assert_eq!(array.len(), expected.len());
    assert!(array.t().iter().zip(&expected).all(|(a, b)| a.to_bits() == b.to_bits()));

    // A crop that is itself cut into spans, from the middle of the recording.
    let crop = ["--set", "signal.start=10.0", "--jobs", "2"];
    let out = at("crop.npz");
    extract(&long, &out, &crop).with(0);
    assert_eq!(table(&out).outcomes()[0].decoded_frames, FRAMES as u64 - 160_000);
    let samples = &bytes[44 + 2 * 160_000..];
    let mut head = bytes[..44].to_vec();
    head[40..44].copy_from_slice(&(samples.len() as u32).to_le_bytes());
    head[4..8].copy_from_slice(&(samples.len() as u32 + 36).to_le_bytes());
    std::fs::write(at("crop-ref.wav"), [&head, samples].concat()).unwrap();
    let expected = single_pass(&at("crop-ref.wav"));
    let array = NpzFile::open(&out).unwrap().f32("long").unwrap();
    assert!(array.t().iter().zip(&expected).all(|(a, b)| a.to_bits() == b.to_bits()));

    // Pre-emphasis, which is cut, and peak normalisation, which holds the whole signal, give what a stream
    // gives, which cannot be cut.
    for set in ["signal.preemphasis=0.5", "signal.normalize=peak"] {
        let (a, b) = (at("a.npz"), at("b.npz"));
        extract(&long, &a, &["--set", set, "--jobs", "2", "--overwrite"]).with(0);
        let mut stream = extraction(Path::new("-"), &b, &["--set", set, "--overwrite"]);
        ended(stream.stdin(std::fs::File::open(&long).unwrap())).with(0);
        let array = |out: &Path, id: &str| NpzFile::open(out).unwrap().f32(id).unwrap();
        assert!(array(&a, "long") == array(&b, "stdin"), "{set}");
    }
}

/// Memory stays flat, finished values included: 512 MiB of eight channels, most of it a hole.
#[cfg(target_os = "linux")]
#[test]
fn memory_does_not_grow_with_the_recording() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let sparse = wav(&at("sparse.wav"), 8, 1000, 3);
    let length = 512_u32 << 20;
    let mut bytes = std::fs::read(&sparse).unwrap();
    let data = bytes.windows(4).position(|name| name == b"data").unwrap() + 8;
    bytes[data - 4..data].copy_from_slice(&length.to_le_bytes());
    bytes[4..8].copy_from_slice(&(length + data as u32 - 8).to_le_bytes());
    std::fs::write(&sparse, bytes).unwrap();
    let file = std::fs::OpenOptions::new().write(true).open(&sparse).unwrap();
    file.set_len(data as u64 + u64::from(length)).unwrap();
    let more = ["--preset", "mfcc-zcr", "--jobs", "2"];
    let mut run = super::support::extraction(&sparse, &at("out.npz"), &more).spawn().unwrap();
    let mut peak = 0;
    while run.try_wait().unwrap().is_none() {
        peak = crate::command::peak_memory(&run).unwrap_or(0).max(peak);
        std::thread::sleep(std::time::Duration::from_millis(5));
    }
    assert!(run.wait().unwrap().success());
    assert!(table(&at("out.npz")).values().iter().all(|x| x.is_finite()));
    assert!((1..150 << 10).contains(&peak), "{peak} KiB");
}
