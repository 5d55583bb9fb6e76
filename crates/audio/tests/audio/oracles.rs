//! The samples against ffmpeg's and libsndfile's, where these are installed; otherwise it is said
//! that the comparison is skipped.

use std::path::Path;
use std::process::Command;

use crate::common::read_file;

/// What a command writes to its output; `None` where it is not installed or refuses.
fn output(command: &mut Command) -> Option<Vec<u8>> {
    command.output().ok().filter(|output| output.status.success()).map(|output| output.stdout)
}

fn floats(bytes: &[u8]) -> Vec<f32> {
    bytes.as_chunks::<4>().0.iter().map(|b| f32::from_le_bytes(*b)).collect()
}

fn by_ffmpeg(path: &Path) -> Option<Vec<f32>> {
    let mut ffmpeg = Command::new("ffmpeg");
    ffmpeg.args(["-v", "error", "-i"]).arg(path).args(["-f", "f32le", "-"]);
    output(&mut ffmpeg).map(|bytes| floats(&bytes))
}

/// By way of a WAV of 32 bits, which sndfile-convert scales rightly but for MP3.
fn by_libsndfile(path: &Path, folder: &Path) -> Option<Vec<f32>> {
    let wav = folder.join("out.wav");
    output(Command::new("sndfile-convert").arg("-pcm32").arg(path).arg(&wav))?;
    read_file(std::fs::read(wav).ok()?).ok().map(|recording| recording.samples)
}

/// Largest difference, over the shorter of both.
fn difference(x: &[f32], y: &[f32]) -> f32 {
    x.iter().zip(y).map(|(x, y)| (x - y).abs()).fold(0.0, f32::max)
}

#[test]
fn ffmpeg_and_libsndfile_give_the_same_samples() {
    let folder = tempfile::tempdir().unwrap();
    let samples = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/audio/samples"));
    // Name, whom to ask, tolerance. ffmpeg keeps the end of Vorbis that its last page cuts off,
    // limits Opus softly and rounds IMA ADPCM in another way; libsndfile keeps Vorbis' own order of
    // channels.
    let cases = [
        ("steps-8ch-16bit.flac", "both", 0.0),
        ("steps-2ch-blocks.flac", "both", 0.0),
        ("sine-1ch.mp3", "ffmpeg", 2e-6),
        ("sines-2ch.ogg", "both", 1e-6),
        ("levels-4ch.ogg", "both", 1e-6),
        ("levels-6ch.ogg", "ffmpeg", 1e-6),
        ("levels-8ch.ogg", "ffmpeg", 1e-6),
        ("levels-8ch.opus", "libsndfile", 4e-5),
        ("sines-2ch-ima.wav", "libsndfile", 0.0),
        ("sines-2ch-ms.wav", "libsndfile", 0.0),
    ];
    let mut asked = 0;
    for (name, whom, tolerance) in cases {
        let path = samples.join(name);
        let ours = read_file(std::fs::read(&path).unwrap()).unwrap().samples;
        let ffmpeg = (whom != "libsndfile").then(|| by_ffmpeg(&path)).flatten();
        let libsndfile = (whom != "ffmpeg").then(|| by_libsndfile(&path, folder.path())).flatten();
        if let Some(theirs) = &libsndfile {
            assert_eq!(ours.len(), theirs.len(), "{name}");
        }
        for theirs in [ffmpeg, libsndfile].into_iter().flatten() {
            assert!(!theirs.is_empty() && difference(&ours, &theirs) <= tolerance, "{name}");
            asked += 1;
        }
    }
    if asked < cases.len() {
        eprintln!("skipped: ffmpeg or sndfile-convert absent, {asked} comparisons made");
    }
}
