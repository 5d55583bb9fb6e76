//! What the targets share: hostile bytes as a file, every reader of a feature file, and which panics
//! are findings.

use std::panic;
use std::path::{Path, PathBuf};

use corsmal_extract::projection::Projection;
use corsmal_files::feature_file::FeatureFile;
use corsmal_models::dataset::{LabelledTable, MemberNames};

/// Lets our code catch panics of the decoders that it uses, as it promises. A panic of our own is a
/// finding even where it would be caught; one of others where it escapes.
pub fn ours_only() {
    let fatal = panic::take_hook();
    // The reader of Parquet silences panics by a hook of its own, once: ours takes its place.
    let _ = FeatureFile::open(&file("first.parquet", b"PAR1"));
    panic::set_hook(Box::new(move |info| {
        let foreign = |file: &str| file.contains("/registry/src/");
        if !info.location().is_some_and(|place| foreign(place.file())) {
            fatal(info);
        }
    }));
}

/// A folder of this process in `CORSMAL_FUZZ_FOLDER`, or else that of temporary files.
pub fn folder() -> &'static Path {
    thread_local! {
        static FOLDER: &'static Path = {
            let given = std::env::var_os("CORSMAL_FUZZ_FOLDER").map(PathBuf::from);
            let base = given.unwrap_or_else(std::env::temp_dir);
            let folder = tempfile::Builder::new().prefix("corsmal-fuzz-").tempdir_in(base);
            Box::leak(folder.expect("a temporary folder").keep().into_boxed_path())
        };
    }
    FOLDER.with(|folder| *folder)
}

/// A file of these bytes.
pub fn file(name: &str, bytes: &[u8]) -> PathBuf {
    let path = folder().join(name);
    std::fs::write(&path, bytes).expect("room in the temporary folder");
    path
}

/// Reads all that a feature file holds, in each way in which a command does.
pub fn read_features(path: &Path) {
    let _ = LabelledTable::read(path, &MemberNames::default());
    let _ = Projection::load(path);
    let _ = corsmal_nets::weights::read(path);
    let Ok(mut file) = FeatureFile::open(path) else { return };
    let _ = file.provenance();
    let _ = file.table();
    match &mut file {
        FeatureFile::Npz(npz) => {
            for name in npz.names().to_vec() {
                let _ = npz.header(&name);
                let _ = npz.components(&name);
                let _ = npz.strings(&name);
            }
        }
        FeatureFile::Npy(npy) => {
            let _ = npy.components();
        }
        FeatureFile::Parquet(parquet) => {
            let _ = parquet.numbers();
            let rows = parquet.table().map_or(0, |(table, _)| table.ids().len());
            for feature in parquet.frame_features() {
                for row in (0..rows).rev().chain(0..rows) {
                    let _ = parquet.frames(row, &feature);
                }
            }
        }
    }
}
