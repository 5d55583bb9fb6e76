//! A report as a page and as files.

use std::collections::HashSet;
use std::io::ErrorKind;
use std::path::{Component, Path, PathBuf};

use corsmal_files::draft;
use serde::{Deserialize, Serialize};

use crate::Source;
use crate::error::{ReportError, Result};
use crate::figure::Figure;
use crate::report::Report;
use crate::{latex, page};

/// Folders of tables and of figures.
const FOLDERS: [&str; 2] = ["tables", "figures"];
/// The report for people, which is written last.
const PAGE: &str = "report.html";
/// The report for programs.
const DOCUMENT: &str = "report.json";

/// `report.json`.
#[derive(Serialize)]
struct Document<'a> {
    #[serde(flatten)]
    report: &'a Report,
    /// What else was written, to be removed by the next report in the same folder.
    files: &'a [String],
}

impl Report {
    /// The page: no other file is needed to read it.
    pub fn html(&self) -> String {
        page::page(self)
    }

    /// Writes `report.html`, `report.json`, `tables/NAME.csv`, `tables/NAME.tex`,
    /// `figures/NAME.svg` and `figures/NAME.pdf` below `dir`, with `more` figures that the page does not show. Tables
    /// and figures of a report that was there before are removed.
    ///
    /// # Errors
    /// [`ReportError`] when something cannot be written.
    pub fn write(&self, dir: &Path, more: &[Figure]) -> Result<()> {
        let made = |path: PathBuf| match std::fs::create_dir_all(&path) {
            Ok(()) => Ok(path),
            Err(source) => Err(ReportError::Folder { path, source }),
        };
        made(dir.into())?;
        let [tables, figures] = FOLDERS;
        // What another report left here would pass as part of this one.
        let page = dir.join(PAGE);
        for path in earlier(dir).into_iter().map(|name| dir.join(name)).chain([page.clone()]) {
            let removed = std::fs::remove_file(&path);
            removed
                .or_else(|e| if e.kind() == ErrorKind::NotFound { Ok(()) } else { Err(e) })
                .map_err(|source| ReportError::Remove { path, source })?;
        }
        let drawn = self.drawn(more);
        let shown = self.sections.iter().flat_map(|s| &s.tables);
        let of_tables = shown
            .clone()
            .flat_map(|table| ["csv", "tex"].map(|e| format!("{tables}/{}.{e}", table.name)));
        let of_figures = drawn
            .iter()
            .flat_map(|(name, _)| ["svg", "pdf"].map(|e| format!("{figures}/{name}.{e}")));
        let files: Vec<String> = of_tables.chain(of_figures).collect();
        let document = serde_json::to_string_pretty(&Document { report: self, files: &files })?;
        let put = |path: &Path, bytes: &[u8]| draft::write(path, bytes).map_err(ReportError::Write);
        // First, so that the next report removes what this one leaves if it breaks off.
        put(&dir.join(DOCUMENT), document.as_bytes())?;
        let places = [made(dir.join(tables))?, made(dir.join(figures))?];
        let mut rows = shown.clone().flat_map(|t| &t.rows);
        let mixed = rows.any(|row| row.source != Source::Ours);
        for table in shown {
            put(&places[0].join(format!("{}.csv", table.name)), table.csv(mixed)?.as_bytes())?;
            put(&places[0].join(format!("{}.tex", table.name)), latex::table(table).as_bytes())?;
        }
        for (name, figure) in drawn {
            figure.write(&places[1], &name)?;
        }
        put(&page, self.html().as_bytes())
    }

    /// All figures, each under a name of its own: methods of other names may have one name in small letters.
    fn drawn<'r>(&'r self, more: &'r [Figure]) -> Vec<(String, &'r Figure)> {
        let grouped = self.sections.iter().flat_map(|s| &s.groups).flat_map(|g| &g.figures);
        let shown = self.sections.iter().flat_map(|s| &s.figures);
        let mut names = HashSet::new();
        let named = |figure: &'r Figure| {
            let numbered = (2..).map(|n| format!("{}-{n}", figure.name));
            let mut names_of = std::iter::once(figure.name.clone()).chain(numbered);
            names_of.find(|name| names.insert(name.clone())).map(|name| (name, figure))
        };
        shown.chain(grouped).chain(more).filter_map(named).collect()
    }
}

/// An earlier `report.json`.
#[derive(Default, Deserialize)]
#[serde(default)]
struct Earlier {
    /// Not in the first reports.
    files: Option<Vec<String>>,
    sections: Vec<EarlierSection>,
}

#[derive(Default, Deserialize)]
#[serde(default)]
struct EarlierSection {
    tables: Vec<Named>,
    figures: Vec<Named>,
    groups: Vec<EarlierSection>,
}

#[derive(Deserialize)]
struct Named {
    name: String,
}

impl EarlierSection {
    fn files(&self) -> Vec<String> {
        let [tables, figures] = FOLDERS;
        let of_tables = self
            .tables
            .iter()
            .flat_map(|t| ["csv", "tex"].map(|e| format!("{tables}/{}.{e}", t.name)));
        let of_figures = self
            .figures
            .iter()
            .flat_map(|f| ["svg", "pdf"].map(|e| format!("{figures}/{}.{e}", f.name)));
        let of_groups = self.groups.iter().flat_map(Self::files);
        of_tables.chain(of_figures).chain(of_groups).collect()
    }
}

/// The files that an earlier report says it wrote.
fn earlier(dir: &Path) -> Vec<String> {
    let written = std::fs::read(dir.join(DOCUMENT)).ok();
    let written = written.and_then(|text| serde_json::from_slice::<Earlier>(&text).ok());
    let Earlier { files, sections } = written.unwrap_or_default();
    let named = || sections.iter().flat_map(EarlierSection::files).collect();
    let mut files = files.unwrap_or_else(named);
    files.retain(|name| is_ours(Path::new(name)));
    files
}

/// Whether it names a file in one of our folders, and nothing outside.
fn is_ours(name: &Path) -> bool {
    let mut parts = name.components();
    let folder = |part: Component<'_>| FOLDERS.iter().any(|f| part.as_os_str() == *f);
    let file = |part: Component<'_>| matches!(part, Component::Normal(_));
    parts.next().is_some_and(folder) && parts.next().is_some_and(file) && parts.next().is_none()
}
