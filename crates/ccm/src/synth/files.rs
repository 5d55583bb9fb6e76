//! The files of a synthetic data set: its notice, recordings and images.

use std::path::Path;

use super::array::MICROPHONES;
use super::physics::SAMPLE_RATE;
use super::take::Size;
use crate::error::{CcmError, Result};

/// The file that marks a folder as synthetic.
pub const NOTICE: &str = "SYNTHETIC.txt";

/// States that everything here is synthetic. Refuses a folder of other recordings, which would stay among these.
pub(super) fn write_notice(dir: &Path, size: Size, seed: u64, vision: bool) -> Result<()> {
    let (path, text) = (dir.join(NOTICE), notice(size, seed, vision));
    // Views may be added to the same recordings.
    let is_same = |found: Vec<u8>| {
        found == text.as_bytes() || vision && found == notice(size, seed, false).as_bytes()
    };
    if std::fs::read(&path).is_ok_and(|found| !is_same(found)) {
        return Err(CcmError::Request(format!(
            "{}: has synthetic recordings of another size, seed or version, or with views, which would stay among these: \
             remove them, or name another folder",
            dir.display()
        )));
    }
    write(&path, text.as_bytes())
}

fn notice(size: Size, seed: u64, vision: bool) -> String {
    let text = format!(
        "SYNTHETIC RECORDINGS - NOT THE CORSMAL DATA SET\n\n\
         Made by `corsmal-feat synth` (size {size:?}, seed {seed}) with simple \
         physics, in the folder\n\
         layout and naming of the CORSMAL Containers Manipulation data set, for demonstrations and\n\
         tests. No real recording is in here. Scores, features and models from these files mean\n\
         nothing about the real data set or about any method evaluated on it.\n\n\
         Containers 1 to 9 have the published capacities and masses and nearly the published\n\
         dimensions; everything about containers 10 to 15 is invented.\n\n\
         train/<container>/audio/       labelled by file name\n\
         test/<container>/audio/        numbered files, labels in ccm_test_pub_annotation.csv\n\
         test_private/<container>/audio/  the same, ccm_test_priv_annotation.csv (full size only)\n\
         ccm_train_annotation.csv       official format of 2021 and later\n\
         ccm_test_*_annotation.csv      official format of 2020 (container and file number)\n\
         man_annotations.csv            start and end of the action in seconds, -1 for empty\n"
    );
    let views = "\
        calib/, rgb/, depth/           beside audio/: four views of two frames, by ray casting\n\
        detections/                    what a detector would report: boxes, labels, masks\n";
    text + if vision { views } else { "" }
}

/// Writes a file and the folders above it.
pub(super) fn write_new(path: &Path, bytes: &[u8]) -> Result<()> {
    if let Some(parent) = path.parent() {
        std::fs::create_dir_all(parent).map_err(|e| CcmError::io(parent, e))?;
    }
    write(path, bytes)
}

/// Writes interleaved PCM16; the file appears only when complete.
pub(super) fn write_wav(path: &Path, pcm: &[i16]) -> Result<()> {
    let spec = hound::WavSpec {
        channels: MICROPHONES as u16,
        sample_rate: SAMPLE_RATE,
        bits_per_sample: 16,
        sample_format: hound::SampleFormat::Int,
    };
    let mut bytes = std::io::Cursor::new(Vec::with_capacity(pcm.len() * 2 + 128));
    let encoded = hound::WavWriter::new(&mut bytes, spec).and_then(|mut writer| {
        let mut block = writer.get_i16_writer(pcm.len() as u32);
        pcm.iter().for_each(|&sample| block.write_sample(sample));
        block.flush()?;
        writer.finalize()
    });
    encoded.map_err(|e| CcmError::Request(format!("{}: {e}", path.display())))?;
    write_new(path, bytes.get_ref())
}

/// Writes a file, which appears only when complete.
pub(super) fn write(path: &Path, bytes: &[u8]) -> Result<()> {
    corsmal_files::draft::write(path, bytes).map_err(CcmError::Write)
}
