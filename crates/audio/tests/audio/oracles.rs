//! The samples against ffmpeg's and libsndfile's, where these are installed; otherwise it is said
//! that the comparison is skipped.

use std::path::Path;
use std::process::Command;

use crate::common::{Wav, read_file, read_pipe};

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
    // decodes Opus in its own way and rounds IMA ADPCM in another; libsndfile keeps Vorbis' own order
    // of channels.
    let cases = [
        ("steps-8ch-16bit.flac", "both", 0.0),
        ("steps-2ch-blocks.flac", "both", 0.0),
        ("sine-1ch.mp3", "ffmpeg", 2e-6),
        ("sines-2ch.ogg", "both", 1e-6),
        ("levels-4ch.ogg", "both", 1e-6),
        ("levels-6ch.ogg", "ffmpeg", 1e-6),
        ("levels-8ch.ogg", "ffmpeg", 1e-6),
        ("levels-8ch.opus", "libsndfile", 1e-6),
        ("noise-2ch.opus", "ffmpeg", 2e-6),
        ("clicks-2ch.opus", "libsndfile", 2e-6),
        ("sines-2ch.aac", "ffmpeg", 2e-6),
        ("sines-2ch.m4a", "ffmpeg", 2e-6),
        ("sines-2ch-fragments.mp4", "ffmpeg", 2e-6),
        ("steps-6ch.m4a", "ffmpeg", 0.0),
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

/// AAC has the frames that were encoded, and ffmpeg's samples; ffmpeg keeps the padding of the last
/// packet. ALAC has the samples that were encoded.
#[test]
fn mp4_of_ffmpeg_is_read_as_ffmpeg_reads_it() {
    const FRAMES: usize = 10_000;
    let folder = tempfile::tempdir().unwrap();
    let (wav, muxed) = (folder.path().join("in.wav"), folder.path().join("out"));
    let cases: [(&str, u16, u32, &[&str]); 12] = [
        ("aac", 1, 8000, &["-f", "ipod"]),
        ("aac", 2, 16_000, &["-f", "mov"]),
        ("aac", 1, 22_050, &["-f", "ipod"]),
        ("aac", 2, 44_100, &["-f", "mp4", "-movflags", "faststart"]),
        ("aac", 2, 48_000, &["-f", "ipod", "-b:a", "40k"]),
        ("aac", 1, 96_000, &["-f", "3gp"]),
        ("alac", 1, 44_100, &["-f", "ipod"]),
        ("alac", 2, 96_000, &["-f", "mov"]),
        ("alac", 3, 48_000, &["-f", "ipod", "-af", "channelmap=0|1|2:3.0"]),
        ("alac", 6, 48_000, &["-f", "ipod"]),
        ("alac", 7, 48_000, &["-f", "ipod", "-af", "channelmap=0|1|2|3|4|5|6:6.1(back)"]),
        ("alac", 8, 48_000, &["-f", "ipod", "-af", "channelmap=0|1|2|3|4|5|6|7:7.1(wide)"]),
    ];
    for (codec, channels, sample_rate, options) in cases {
        let count = FRAMES * usize::from(channels);
        // A triangle and a little noise.
        let sample =
            |n: usize| ((n * 97) % 20_000).abs_diff(10_000) as i16 + (n * 7919 % 301) as i16;
        let samples: Vec<i16> = (0..count).map(sample).collect();
        std::fs::write(&wav, Wav { sample_rate, ..Wav::pcm16(channels, &samples) }.bytes())
            .unwrap();
        let mut encode = Command::new("ffmpeg");
        encode.args(["-v", "error", "-y"]);
        encode.arg("-i").arg(&wav).args(["-c:a", codec]).args(options).arg(&muxed);
        if output(&mut encode).is_none() {
            eprintln!("skipped: ffmpeg absent");
            return;
        }
        let bytes = std::fs::read(&muxed).unwrap();
        let ours = read_file(bytes.clone()).unwrap();
        assert_eq!(ours, read_pipe(bytes).unwrap());
        let theirs = by_ffmpeg(&muxed).unwrap();
        let name = format!("{codec}, {channels} channels, {sample_rate} Hz");
        assert_eq!((ours.samples.len(), ours.repairs()), (count, vec![]), "{name}");
        let kept = theirs.len() - count;
        if codec == "alac" {
            let expected: Vec<f32> = samples.iter().map(|s| f32::from(*s) / 32768.0).collect();
            assert!(kept == 0 && ours.samples == expected && theirs == expected, "{name}");
        } else {
            assert!(kept < 1024 * usize::from(channels), "{name}: {kept}");
            let worst = difference(&ours.samples, &theirs);
            assert!(worst <= 1e-5, "{name}: {worst}");
        }
    }
}
