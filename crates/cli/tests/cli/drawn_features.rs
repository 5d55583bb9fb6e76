//! Pictures of features.

use std::path::{Path, PathBuf};
use std::process::Output;

use crate::command::{done, run, text};

const RATE: u32 = 8000;

/// A recording of some channels and seconds of noise.
fn recording(path: &Path, channels: u16, seconds: f64) {
    std::fs::create_dir_all(path.parent().unwrap()).unwrap();
    let spec = hound::WavSpec {
        channels,
        sample_rate: RATE,
        bits_per_sample: 16,
        sample_format: hound::SampleFormat::Int,
    };
    let mut writer = hound::WavWriter::create(path, spec).unwrap();
    let mut state = 1u32;
    for _ in 0..(seconds * f64::from(RATE)) as usize * usize::from(channels) {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        writer.write_sample((state >> 18) as i16).unwrap();
    }
    writer.finalize().unwrap();
}

/// Features of the recordings of a folder, as `.npz` and as Parquet.
fn extracted(folder: &Path, options: &[&str]) -> [PathBuf; 2] {
    ["frames.npz", "frames.parquet"].map(|name| {
        let out = folder.join(name);
        let audio = folder.join("audio");
        done(&[&["extract", text(&audio), "-o", text(&out), "-q"], options].concat());
        out
    })
}

fn draw(file: &Path, options: &[&str]) -> Output {
    let picture = file.with_extension("svg");
    let args = ["inspect", text(file), "--picture", text(&picture), "--overwrite"];
    run(&[&args, options].concat())
}

/// The SVG that `inspect --picture` draws.
fn drawn(file: &Path, options: &[&str]) -> String {
    let out = draw(file, options);
    assert!(out.status.success(), "{}", String::from_utf8_lossy(&out.stderr));
    std::fs::read_to_string(file.with_extension("svg")).unwrap()
}

#[track_caller]
fn refused(file: &Path, options: &[&str], words: &str) {
    let out = draw(file, options);
    let message = String::from_utf8_lossy(&out.stderr).into_owned();
    assert!(out.status.code() == Some(2) && message.contains(words), "{options:?}: {message}");
}

#[test]
fn features_are_drawn() {
    let folder = tempfile::tempdir().unwrap();
    recording(&folder.path().join("audio/four.wav"), 4, 1.0);
    for file in extracted(folder.path(), &["--preset", "logmel"]) {
        let svg = drawn(&file, &["--recording", "four", "--channels", "0,2"]);
        assert!(
            svg.contains(">four</text>") && svg.contains("channel 2") && !svg.contains("channel 1")
        );
        refused(&file, &["--recording", "five"], "no recording 'five'; it has 1 (four)");
    }
}

/// What a picture has no use for was passed over, `--start` and `--end` for frames, too.
#[test]
fn options_have_an_effect_or_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let wav = folder.path().join("audio/x.wav");
    recording(&wav, 1, 3.0);
    for file in extracted(folder.path(), &["--preset", "logmel"]) {
        let part = drawn(&file, &["--start", "1", "--end", "2"]);
        assert!(part.contains(">1.2<") && !part.contains(">0.8<") && !part.contains(">2.2<"));
        let single = drawn(&file, &["--start", "1", "--end", "1.06"]);
        assert!(single.contains("time, seconds") && !single.contains("frame</text>"), "{single}");
        refused(&file, &["--start", "9"], "--start 9: ");
        for option in [["--fmax", "900"], ["--frequency-axis", "log"], ["--wave-scale", "channel"]]
        {
            refused(&file, &option, &format!("{} has no effect on a picture of frames", option[0]));
        }
    }
    refused(&wav, &["--recording", "x"], "--recording has no effect on a picture of a recording");
    let table = folder.path().join("table.npz");
    done(&["extract", text(&wav), "-o", text(&table), "-q", "--preset", "mfcc-zcr"]);
    refused(&table, &["--start", "1"], "--start has no effect on a picture of a table");
}

/// Those of `a/b` were drawn as features of `a`.
#[test]
fn recordings_below_others_are_not_theirs() {
    let folder = tempfile::tempdir().unwrap();
    for name in ["a.wav", "a/b.wav"] {
        recording(&folder.path().join("audio").join(name), 1, 1.0);
    }
    let config = folder.path().join("config.toml");
    std::fs::write(&config, "[features.rms]\n[features.melspectrogram]\n").unwrap();
    for (options, features) in [(["--preset", "logmel"], 1), (["--config", text(&config)], 2)] {
        for file in extracted(folder.path(), &options) {
            let svg = drawn(&file, &["--recording", "a"]);
            assert_eq!(svg.matches("channel 0</text>").count(), features, "{svg}");
            std::fs::remove_file(&file).unwrap();
        }
    }
}

/// All were drawn over the time of the first.
#[test]
fn features_of_other_hops_share_an_axis() {
    let folder = tempfile::tempdir().unwrap();
    recording(&folder.path().join("audio/x.wav"), 1, 2.95);
    let config = folder.path().join("config.toml");
    let features = "[features.zero_crossing_rate]\nhop_length = 8000\n[features.melspectrogram]\n";
    std::fs::write(&config, features).unwrap();
    for file in extracted(folder.path(), &["--config", text(&config)]) {
        let svg = drawn(&file, &[]);
        // Crossings count seconds 0, 1 and 2; the last of 47 frames of 512 samples is at 2.944 s.
        let (hop, from) = (512.0 / f64::from(RATE), -0.5);
        let to = 46.5 * hop;
        let image = svg.split("<image ").nth(1).unwrap();
        let number = |name: &str| -> f64 {
            let value = image.split(&format!("{name}=\"")).nth(1).unwrap();
            value.split('"').next().unwrap().parse().unwrap()
        };
        let (left, width) = (76.0, 840.0);
        let expected = left + width * (-0.5 * hop - from) / (to - from);
        assert!((number("x") - expected).abs() < 0.1, "{} is not {expected}", number("x"));
        assert!((number("x") + number("width") - left - width).abs() < 0.1);
        // Where only one of them has a frame; where one has a single frame; a single one alone.
        let part = drawn(&file, &["--start", "1.2", "--end", "1.8"]);
        assert!(part.contains("melspectrogram") && !part.contains("zero_crossing_rate"));
        let part = drawn(&file, &["--start", "0.9", "--end", "1.8"]);
        assert!(part.contains("zero_crossing_rate") && part.contains("time, seconds"));
        refused(&file, &["--start", "9"], "has no frame there");
    }
}
