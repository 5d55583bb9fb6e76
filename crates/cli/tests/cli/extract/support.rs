//! Recordings, and the tool run on them.

use std::ffi::OsStr;
use std::path::{Path, PathBuf};
use std::process::Command;

use corsmal_files::layout;
use corsmal_files::npz::NpzFile;
use corsmal_files::table::Table;

use crate::command::tool;

/// How a run ended.
pub struct Ended {
    pub code: Option<i32>,
    pub stdout: String,
    pub stderr: String,
}

impl Ended {
    /// The run must have ended with this code.
    #[track_caller]
    pub fn with(self, code: i32) -> Self {
        assert_eq!(self.code, Some(code), "{}{}", self.stdout, self.stderr);
        assert!(!self.stderr.contains("panicked"), "{}", self.stderr);
        self
    }
}

pub fn ended(command: &mut Command) -> Ended {
    let output = command.output().unwrap();
    Ended {
        code: output.status.code(),
        stdout: String::from_utf8(output.stdout).unwrap(),
        stderr: String::from_utf8(output.stderr).unwrap(),
    }
}

/// `extract --in INPUT --out OUT` and further arguments.
pub fn extraction(input: &Path, out: &Path, more: &[&str]) -> Command {
    let mut command = tool();
    command.args([OsStr::new("extract"), "--in".as_ref(), input.as_ref()]);
    command.args([OsStr::new("--out"), out.as_ref()]).args(more);
    command
}

pub fn extract(input: &Path, out: &Path, more: &[&str]) -> Ended {
    ended(&mut extraction(input, out, more))
}

pub fn spec(channels: u16) -> hound::WavSpec {
    hound::WavSpec {
        channels,
        sample_rate: 16_000,
        bits_per_sample: 16,
        sample_format: hound::SampleFormat::Int,
    }
}

/// A tone in noise, another for every `seed`.
pub fn wav(path: &Path, channels: u16, frames: usize, seed: u32) -> PathBuf {
    std::fs::create_dir_all(path.parent().unwrap()).unwrap();
    let mut writer = hound::WavWriter::create(path, spec(channels)).unwrap();
    let mut state = seed.wrapping_mul(2_654_435_761) | 1;
    let hz = 200.0 + seed as f32;
    let mut writer16 = writer.get_i16_writer((frames * usize::from(channels)) as u32);
    for t in 0..frames {
        let tone = 8000.0 * (std::f32::consts::TAU * hz * t as f32 / 16_000.0).sin();
        for _ in 0..channels {
            state ^= state << 13;
            state ^= state >> 17;
            state ^= state << 5;
            writer16.write_sample(tone as i16 + (state & 0x7ff) as i16);
        }
    }
    writer16.flush().unwrap();
    writer.finalize().unwrap();
    path.into()
}

/// A folder of `count` recordings of half a second.
pub fn folder(count: u32) -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    for i in 0..count {
        wav(&folder.path().join(format!("audio/{:02}/r{i:04}.wav", i % 3)), 2, 8000, i);
    }
    folder
}

/// The tables of an output.
pub fn table(out: &Path) -> Table {
    layout::read_table(&mut NpzFile::open(out).unwrap()).unwrap().0
}
