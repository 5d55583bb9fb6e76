//! Tests of the networks as their users see them.

#![allow(clippy::unwrap_used)]

mod checkpoints;
mod dataset;
mod golden;
mod layers;
mod published;
mod resnet;
mod selection;
mod training;
mod weights;

use std::path::PathBuf;

/// A file of the shared material, when it is there.
fn shared(path: &str) -> Option<PathBuf> {
    let shared = std::env::var_os("CORSMAL_SHARED").map_or_else(
        || PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../../shared"),
        PathBuf::from,
    );
    let path = shared.join(path);
    if path.exists() {
        return Some(path);
    }
    eprintln!("skipped: {} is not there", path.display());
    None
}
