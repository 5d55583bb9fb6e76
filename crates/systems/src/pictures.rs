//! Pictures in folders, as networks take them.

use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};

use corsmal_files::{content, identity};
use corsmal_nets::networks::Definition;
use corsmal_nets::picture;
use corsmal_vision::Rgb;
use rayon::prelude::*;

use crate::error::{Result, SystemError};

/// Folders deeper than this are not searched.
const MAX_DEPTH: usize = 8;
/// Pictures of a folder at most.
const MAX_PICTURES: usize = 1 << 20;
/// Pictures that are read at a time.
const PART: usize = 256;

/// A picture of a folder.
#[derive(Clone, Debug, PartialEq)]
pub struct Picture {
    /// its path in the folder, without the ending
    pub id: String,
    /// the file
    pub path: PathBuf,
    /// [`corsmal_files::identity`] of the file; empty where it cannot be read
    pub identity: String,
    /// what the network takes of it, or why it cannot be read, without its path
    pub item: std::result::Result<Vec<f32>, String>,
}

/// The pictures (PNG, JPEG) in a folder and the folders in it, or a single one, in the order of their ids.
#[derive(Clone, Debug)]
pub struct Pictures {
    folder: PathBuf,
    named: Vec<(String, PathBuf)>,
    /// Width and height that the network takes.
    size: (usize, usize),
}

impl Pictures {
    /// Looks for them and reads none.
    ///
    /// # Errors
    /// [`SystemError::TakesNoPictures`]; a folder that cannot be read or has none.
    pub fn find(definition: &Definition, folder: &Path) -> Result<Self> {
        let Some(size) = definition.picture() else {
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
        Ok(Self { folder: folder.into(), named, size })
    }

    /// How many there are.
    pub fn len(&self) -> usize {
        self.named.len()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.named.is_empty()
    }

    /// Numbers that the network takes of each.
    pub fn numbers(&self) -> usize {
        3 * self.size.0 * self.size.1
    }

    /// Refuses more of them than memory holds at a time, as a training does; of what is free in bytes, where
    /// that is known.
    ///
    /// # Errors
    /// [`SystemError::TooMuchMemory`].
    pub fn require_memory(&self, available: Option<u64>) -> Result<()> {
        let needed = self.named.len() as u64 * (self.numbers() * size_of::<f32>()) as u64;
        match available.filter(|available| needed > *available) {
            None => Ok(()),
            Some(available) => {
                let (path, pictures) = (self.folder.clone(), self.named.len());
                Err(SystemError::TooMuchMemory { path, pictures, needed, available })
            }
        }
    }

    /// Stretches of them that are read at a time.
    pub fn parts(&self) -> impl Iterator<Item = Range<usize>> {
        let count = self.named.len();
        (0..count).step_by(PART).map(move |first| first..count.min(first + PART))
    }

    /// Reads a stretch, in the size that the network takes.
    ///
    /// # Errors
    /// [`SystemError::Interrupted`] once `stop` is set.
    pub fn read(&self, part: Range<usize>, stop: &AtomicBool) -> Result<Vec<Picture>> {
        let (width, height) = self.size;
        let read = |(id, path): &(String, PathBuf)| {
            if stop.load(Ordering::SeqCst) {
                return Err(SystemError::Interrupted);
            }
            let (item, identity) = match content::read(path, Rgb::MAX_BYTES) {
                Err(e) => (Err(e.to_string()), String::new()),
                Ok(bytes) => {
                    let image = Rgb::from_bytes(&bytes, path).map_err(|e| e.reason());
                    let item = image.map(|image| picture::item(&image.resized(width, height).data));
                    (item, identity::of_bytes(&bytes))
                }
            };
            Ok(Picture { id: id.clone(), path: path.clone(), identity, item })
        };
        self.named[part].par_iter().map(read).collect()
    }
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

#[cfg(test)]
mod tests {
    use super::*;
    use corsmal_nets::networks;

    #[test]
    fn memory_is_asked_for_before_a_picture_is_read() {
        let folder = tempfile::tempdir().unwrap();
        for name in ["a.png", "b.jpg", "in/c.PNG", ".hidden.png", "text.txt"] {
            let path = folder.path().join(name);
            std::fs::create_dir_all(path.parent().unwrap()).unwrap();
            std::fs::write(path, b"no picture").unwrap();
        }
        let network = networks::named("resnet18_level").unwrap();
        let pictures = Pictures::find(network, folder.path()).unwrap();
        let mut parts = pictures.parts();
        assert_eq!((parts.next(), parts.next()), (Some(0..3), None));
        let each = 112 * 112 * 3 * 4;
        assert!(pictures.require_memory(None).is_ok());
        assert!(pictures.require_memory(Some(3 * each)).is_ok());
        let refused = pictures.require_memory(Some(3 * each - 1)).unwrap_err().to_string();
        assert!(refused.contains("3 pictures take 0.0 GiB"), "{refused}");
        let read = pictures.read(0..3, &AtomicBool::new(false)).unwrap();
        let ids: Vec<&str> = read.iter().map(|picture| picture.id.as_str()).collect();
        assert_eq!(ids, ["a", "b", "in/c"]);
        assert!(read.iter().all(|picture| picture.item.is_err()));
        let file = identity::of_file(&folder.path().join("a.png")).unwrap();
        assert_eq!(read[0].identity, file);
        let stopped = pictures.read(0..3, &AtomicBool::new(true));
        assert!(matches!(stopped, Err(SystemError::Interrupted)));
    }
}
