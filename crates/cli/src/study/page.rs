//! Writing a report.

use std::path::Path;

use corsmal_files::identity;
use corsmal_report::{Fact, Report};

use crate::failure::Failure;
use crate::{made, publish};

/// Makes the folder of a report before anything is computed for it. Refuses a folder that holds
/// something else, and a report that may not be replaced.
pub fn prepare(folder: &Path, overwrite: bool) -> Result<(), Failure> {
    let refuse = |why: &str| Err(Failure::new(format!("--report {}: {why}", folder.display())));
    publish::require_disk(folder)?;
    // A report that broke off before its first file leaves no more than the draft of that.
    let is_file = |entry: &std::fs::DirEntry| {
        !entry.file_name().as_encoded_bytes().starts_with(b".report.json.")
    };
    let mut entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
    if entries.any(|entry| is_file(&entry)) {
        match folder.join("report.json").is_file() {
            true if overwrite => {}
            true => return refuse("has a report already; --overwrite replaces it"),
            false => return refuse("has other files; name a new or empty folder"),
        }
    }
    std::fs::create_dir_all(folder)
        .map_err(|e| Failure::new(format!("--report {}: {e}", folder.display())))
}

/// A file that the report is made of, and its identity, as feature files and models record it.
pub(super) fn add_file(facts: &mut Vec<Fact>, name: &str, path: &Path) {
    facts.push(Fact::new(name, path.display().to_string()));
    match identity::of_file(path) {
        Ok(identity) if identity != identity::STREAM => {
            facts.push(Fact::new(format!("Identity of the {}", name.to_lowercase()), identity));
        }
        // A folder of tables, or a file that was moved away meanwhile.
        Ok(_) | Err(_) => {}
    }
}

/// What stands in every report, after what the report is about.
pub(super) fn add_made(facts: &mut Vec<Fact>) {
    let (version, os, arch) =
        (env!("CARGO_PKG_VERSION"), std::env::consts::OS, std::env::consts::ARCH);
    facts.push(Fact::new("Made by", format!("corsmal-feat {version}, {os} {arch}")));
    facts.push(Fact::new("Date", made::today()));
    facts.push(Fact::new("Command", made::command()));
}

/// Writes a report and says where it is.
pub(super) fn write(folder: &Path, report: &Report, quiet: bool) -> Result<(), Failure> {
    report.write(folder, &[])?;
    if !quiet {
        eprintln!("report: {}", folder.join("report.html").display());
    }
    Ok(())
}

pub(super) fn file_name(path: &Path) -> String {
    path.file_name().unwrap_or_default().to_string_lossy().into_owned()
}
