//! Folders that tell recordings of one number apart.

use std::path::{Component, Path};

use corsmal_files::spelling;

/// Folders above a part of a data set, or above those that hold single recordings, which differ between
/// copies of it.
const NEAREST: usize = 2;

/// How many folders of two names are compared.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Depth {
    /// All: of ids, which begin below the folder that was read.
    All,
    /// The nearest: of paths, which may begin anywhere.
    Nearest,
}

/// Whether two ids or paths of one number may be of one recording: the folders of one are the last of the
/// other, but for those of a sensor or a view. Of a part of the data set, copies may lie anywhere.
pub(crate) fn are_alike(one: &str, other: &str, depth: Depth) -> bool {
    let (one, other) = (telling(one), telling(other));
    let part = |folders: &[String]| folders.iter().position(|folder| is_part(folder));
    if let (Some(at), Some(of_other)) = (part(&one), part(&other)) {
        return one[..=at] == other[..=of_other];
    }
    let most = match depth {
        Depth::All => usize::MAX,
        Depth::Nearest => NEAREST,
    };
    one.iter().zip(&other).take(most).all(|(one, other)| one == other)
}

/// The folders of a name that say which recording it is, the nearest first.
fn telling(name: &str) -> Vec<String> {
    let name = spelling::plain(name);
    let folders = Path::new(&name).components().rev().skip(1);
    let names = folders.filter_map(|folder| match folder {
        Component::Normal(folder) => Some(folder.to_string_lossy().to_lowercase()),
        _ => None,
    });
    names.filter(|folder| !is_sensor(folder)).collect()
}

/// `train`, `test_pub`, `testing`, ...
fn is_part(folder: &str) -> bool {
    folder.starts_with("train") || folder.starts_with("test")
}

/// Of what all recordings have.
fn is_sensor(folder: &str) -> bool {
    let view = folder.strip_prefix("view");
    matches!(folder, "audio" | "rgb" | "depth" | "ir" | "video")
        || view.is_some_and(|number| number.bytes().all(|byte| byte.is_ascii_digit()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn folders_tell_recordings_of_one_number_apart() {
        for (one, other) in [
            ("7", "000007"),
            ("7", "anna/7"),
            ("./audio/7", "/data/audio/7.wav"),
            ("anna/x/../7", "anna/7"),
            ("train/audio/000001", "train/view1/rgb/000001.mp4"),
            ("/copy/test_pub/audio/000001.wav", "d/test_pub/view3/rgb/000001.mp4"),
            ("anna/rgb/1", "anna/depth/1"),
        ] {
            assert!(are_alike(one, other, Depth::All), "{one} {other}");
        }
        for (one, other) in [
            ("anna/1", "ben/1"),
            ("anna/audio/1", "ben/audio/1"),
            ("test_pub/audio/000001", "test_priv/audio/000001"),
            ("train/anna/1", "train/ben/1"),
        ] {
            for depth in [Depth::All, Depth::Nearest] {
                assert!(!are_alike(one, other, depth), "{one} {other}");
            }
        }
        let copies = ("/home/anna/lab/a/1.wav", "/data/copy/lab/a/1.wav");
        assert!(are_alike(copies.0, copies.1, Depth::Nearest));
    }
}
