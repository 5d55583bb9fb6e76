//! Pictures in folders, as networks take them.

use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};

use corsmal_files::identity;
use corsmal_nets::networks::Definition;
use corsmal_nets::picture;
use corsmal_vision::Rgb;
use rayon::prelude::*;

use crate::error::{Result, SystemError};

/// Folders deeper than this are not searched.
const MAX_DEPTH: usize = 8;
/// Pictures of a folder at most.
const MAX_PICTURES: usize = 1 << 20;

/// A picture of a folder.
#[derive(Clone, Debug, PartialEq)]
pub struct Picture {
    /// its path in the folder, without the ending
    pub id: String,
    /// the file
    pub path: PathBuf,
    /// [`corsmal_files::identity`] of the file; empty where it cannot be read
    pub identity: String,
    /// what the network takes of it, or why it cannot be read
    pub item: std::result::Result<Vec<f32>, String>,
}

/// The pictures (PNG, JPEG) in a folder and the folders in it, or a single one, in the order of their
/// ids, in the size that the network takes.
///
/// # Errors
/// [`SystemError::TakesNoPictures`]; a folder that cannot be read or has none; [`SystemError::Interrupted`]
/// once `stop` is set.
pub fn read(definition: &Definition, folder: &Path, stop: &AtomicBool) -> Result<Vec<Picture>> {
    let Some((width, height)) = definition.picture() else {
        let (network, takes) = (definition.name, definition.takes);
        return Err(SystemError::TakesNoPictures { network, takes });
    };
    let mut paths = Vec::new();
    let root = match folder.is_dir() {
        true => {
            list(folder, 0, &mut paths)?;
            folder
        }
        false => {
            paths.push(folder.into());
            folder.parent().unwrap_or(Path::new(""))
        }
    };
    let id = |path: &Path| {
        let inner = path.strip_prefix(root).unwrap_or(path).with_extension("");
        let parts = inner.components().map(|part| part.as_os_str().to_string_lossy());
        parts.collect::<Vec<_>>().join("/")
    };
    let mut named: Vec<(String, PathBuf)> = paths.into_iter().map(|p| (id(&p), p)).collect();
    named.sort();
    if let Some(twice) = named.windows(2).find(|pair| pair[0].0 == pair[1].0) {
        let (first, second) = (twice[0].1.clone(), twice[1].1.clone());
        return Err(SystemError::SameId { id: twice[0].0.clone(), first, second });
    }
    if named.is_empty() {
        return Err(SystemError::NoPictures { path: folder.into() });
    }
    let read = |(id, path): (String, PathBuf)| {
        if stop.load(Ordering::SeqCst) {
            return Err(SystemError::Interrupted);
        }
        let image = Rgb::read(&path).map_err(|e| e.to_string());
        let item = image.map(|image| picture::item(&image.resized(width, height).data));
        let identity = identity::of_file(&path).unwrap_or_default();
        Ok(Picture { id, path, identity, item })
    };
    named.into_par_iter().map(read).collect()
}

fn list(folder: &Path, depth: usize, paths: &mut Vec<PathBuf>) -> Result<()> {
    let io = |source| SystemError::Io { path: folder.into(), source };
    for entry in std::fs::read_dir(folder).map_err(io)? {
        let entry = entry.map_err(io)?;
        // Hidden files are no pictures, such as those that macOS puts beside others.
        if entry.file_name().as_encoded_bytes().starts_with(b".") {
            continue;
        }
        let path = entry.path();
        if path.is_dir() {
            if depth < MAX_DEPTH {
                list(&path, depth + 1, paths)?;
            }
            continue;
        }
        let ending = path.extension().map(|e| e.to_string_lossy().to_lowercase());
        if matches!(ending.as_deref(), Some("png" | "jpg" | "jpeg")) {
            paths.push(path);
        }
        if paths.len() > MAX_PICTURES {
            return Err(SystemError::TooManyPictures { path: folder.into(), limit: MAX_PICTURES });
        }
    }
    Ok(())
}
