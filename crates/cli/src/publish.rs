//! Whether an output may be written, asked before the work begins.

use std::path::Path;

use corsmal_files::draft::{check_place, folder, is_device, same};

use crate::failure::Failure;

/// Refuses what no file or folder on a disk is called: standard output, and addresses.
pub fn require_disk(path: &Path) -> Result<(), Failure> {
    if path == Path::new("-") {
        return Err(Failure::new(
            "-: this output is not written to standard output: give a name (./- for one called so)",
        ));
    }
    // Not a drive.
    let is_scheme = |scheme: &str| scheme.len() > 1 && !scheme.contains(['/', '.', ' ']);
    let scheme = path.to_str().and_then(|name| name.split_once("://"));
    if scheme.is_some_and(|(scheme, _)| is_scheme(scheme)) && !path.exists() {
        return Err(Failure::new(format!(
            "{}: this output is written to a disk: name a place there, and copy it when it is complete",
            path.display()
        )));
    }
    Ok(())
}

/// As [`check`] for a table, which a device takes as well.
pub fn check_table(path: &Path, overwrite: bool) -> Result<(), Failure> {
    match is_device(path) {
        true => Ok(()),
        false => check(path, overwrite),
    }
}

/// Refuses a name that is taken, unless it is of a file that may be replaced, and a folder that is
/// not there or takes no files.
pub fn check(path: &Path, overwrite: bool) -> Result<(), Failure> {
    require_disk(path)?;
    if is_device(path) {
        return Err(Failure::new(format!(
            "{} is a device; this output gets its name when it is whole: name a file",
            path.display()
        )));
    }
    if path.exists() && !path.is_file() {
        return Err(Failure::new(format!("{} exists and is not a regular file", path.display())));
    }
    if path.exists() && !overwrite {
        return Err(Failure::new(format!("{} exists; --overwrite replaces it", path.display())));
    }
    if folder(path).is_dir() {
        return Ok(check_place(path)?);
    }
    Err(Failure::new(format!("{}: there is no folder {}", path.display(), folder(path).display())))
}

/// Refuses an output that would take the place of something that the command reads.
pub fn spare<P: AsRef<Path>>(out: &Path, read: impl IntoIterator<Item = P>) -> Result<(), Failure> {
    match read.into_iter().any(|input| same(input.as_ref(), out)) {
        true => Err(Failure::new(format!(
            "{}: the output would replace an input: give it another name",
            out.display()
        ))),
        false => Ok(()),
    }
}
