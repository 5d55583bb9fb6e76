//! A projection: fitted on one feature file, applied to recordings, refused with anything else.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use corsmal_dsp::pca::Pca;
use corsmal_extract::config::Config;
use corsmal_extract::inputs;
use corsmal_extract::projection::Projection;
use corsmal_extract::run::{self, Quiet, RunOptions};
use corsmal_files::layout;
use corsmal_files::npz::{Compression, NpzFile};
use corsmal_files::shard::Shard;
use corsmal_files::table::Table;
use tempfile::TempDir;

use crate::support::text;

const PLAIN: &str = "[features.melspectrogram]\nn_mels = 12\n[summary]\nstats = ['mean', 'std']";

/// Recordings of noise, some with a second channel.
fn recordings(folder: &Path, channels: &[u16]) {
    std::fs::create_dir(folder).unwrap();
    let mut state = 1_u32;
    for (i, &channels) in channels.iter().enumerate() {
        let spec = hound::WavSpec {
            channels,
            sample_rate: 16_000,
            bits_per_sample: 16,
            sample_format: hound::SampleFormat::Int,
        };
        let mut wav = hound::WavWriter::create(folder.join(format!("{i}.wav")), spec).unwrap();
        for _ in 0..8000 * u32::from(channels) {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            wav.write_sample((state >> 17) as i16 / (i as i16 + 1)).unwrap();
        }
        wav.finalize().unwrap();
    }
}

fn extract(folder: &Path, config: Config, out: &Path) -> Table {
    let found = inputs::collect(&[text(folder).to_string()]).unwrap().inputs;
    let options = RunOptions {
        out: out.to_path_buf(),
        work: None,
        partition_by: None,
        compression: Compression::Stored,
        jobs: 2,
        shard: Shard::default(),
        resume: false,
        overwrite: true,
        max_errors: None,
    };
    run::run(&found, &Arc::new(config), &options, &Quiet, &Arc::new(AtomicBool::new(false)))
        .unwrap();
    layout::read_table(&mut NpzFile::open(out).unwrap()).unwrap().0
}

fn config(toml: &str, overrides: &[String]) -> Result<Config, String> {
    Config::with_overrides(toml, "test", overrides).map_err(|e| e.to_string())
}

/// Six training recordings with their features, and a projection to three components.
fn fitted(folder: &Path) -> (Table, PathBuf) {
    recordings(&folder.join("train"), &[1; 6]);
    let features = folder.join("train.npz");
    let table = extract(&folder.join("train"), config(PLAIN, &[]).unwrap(), &features);
    let file = folder.join("pca.npz");
    Projection::fit(&features, Some(3)).unwrap().save(&file).unwrap();
    (table, file)
}

#[test]
fn recordings_get_the_coordinates_of_the_fitted_components() {
    let folder = TempDir::new().unwrap();
    let (train, file) = fitted(folder.path());
    let projected = config(PLAIN, &[format!("projection.file={}", text(&file))]).unwrap();
    let again = Config::from_value(projected.to_value()).unwrap();
    assert_eq!(again.hash(), projected.hash());
    // Where the file lies is not a part of the configuration's identity, what it holds is.
    let moved = folder.path().join("moved.npz");
    std::fs::copy(&file, &moved).unwrap();
    let elsewhere = config(PLAIN, &[format!("projection.file={}", text(&moved))]).unwrap();
    assert_eq!(elsewhere.hash(), projected.hash());
    let whiten = [format!("projection.file={}", text(&file)), "projection.whiten=true".into()];
    assert_ne!(config(PLAIN, &whiten).unwrap().hash(), projected.hash());

    let table = extract(&folder.path().join("train"), projected, &folder.path().join("out.npz"));
    assert_eq!(table.feature_names(), ["pca[0]", "pca[1]", "pca[2]"]);
    let x = train.values().mapv(f64::from);
    let want = Pca::fit(x.view(), 3).unwrap().project(x.view(), false).unwrap();
    assert_eq!(table.values(), want.mapv(|v| v as f32));
}

#[test]
fn recordings_of_other_shape_fail_by_themselves() {
    let folder = TempDir::new().unwrap();
    let (_, file) = fitted(folder.path());
    recordings(&folder.path().join("test"), &[1, 2]);
    let projected = config(PLAIN, &[format!("projection.file={}", text(&file))]).unwrap();
    let table = extract(&folder.path().join("test"), projected, &folder.path().join("out.npz"));
    assert_eq!(table.ids().len(), 1);
    assert!(table.outcomes()[1].reason.contains("24 columns"), "{}", table.outcomes()[1].reason);
}

#[test]
fn what_a_projection_was_not_fitted_for_is_refused() {
    let folder = TempDir::new().unwrap();
    let (_, file) = fitted(folder.path());
    let with = [format!("projection.file={}", text(&file))];
    let refused = |toml: &str, overrides: &[String]| config(toml, overrides).unwrap_err();
    let other = PLAIN.replace("12", "13");
    assert!(refused(&other, &with).contains("projection.file"));
    assert!(refused("[features.mfcc]", &with).contains("[summary]"));
    let missing = ["projection.file=nowhere.npz".to_string()];
    assert!(refused(PLAIN, &missing).contains("nowhere.npz"));
    let unknown = ["projection.n_components=3".to_string()];
    assert!(refused(PLAIN, &unknown).contains("n_components"));
    // A stored configuration means the content that the file had.
    let stored = config(PLAIN, &with).unwrap().to_value();
    Projection::fit(&folder.path().join("train.npz"), Some(2)).unwrap().save(&file).unwrap();
    let changed = Config::from_value(stored).unwrap_err().to_string();
    assert!(changed.contains("has changed"), "{changed}");
    // Neither a feature file nor any bytes are a projection.
    let features = [format!("projection.file={}", text(&folder.path().join("train.npz")))];
    assert!(refused(PLAIN, &features).contains("meta"));
    std::fs::write(&file, b"PK\x03\x04 not really").unwrap();
    assert!(refused(PLAIN, &with).contains("pca.npz"));
}

#[test]
fn fits_that_are_impossible_are_refused() {
    let folder = TempDir::new().unwrap();
    let (_, _) = fitted(folder.path());
    let features = folder.path().join("train.npz");
    let message = Projection::fit(&features, Some(7)).unwrap_err().to_string();
    assert!(
        message.contains("n_components must be 1 to 6") && message.contains("train.npz"),
        "{message}"
    );
    let frames = folder.path().join("frames.npz");
    let config = config("[features.melspectrogram]", &[]).unwrap();
    extract(&folder.path().join("train"), config, &frames);
    assert!(Projection::fit(&frames, Some(1)).unwrap_err().to_string().contains("[summary]"));
}
