//! A report as a page and as files.

use std::path::Path;

use corsmal_files::draft;

use crate::Source;
use crate::error::{ReportError, Result};
use crate::report::Report;
use crate::{latex, page};

impl Report {
    /// The page: no other file is needed to read it.
    pub fn html(&self) -> String {
        page::page(self)
    }

    /// Writes `report.html`, `report.json`, `tables/NAME.csv`, `tables/NAME.tex`,
    /// `figures/NAME.svg` and `figures/NAME.pdf` below `dir`. Tables and figures of a report that was
    /// there before are removed.
    ///
    /// # Errors
    /// [`ReportError`] when something cannot be written.
    pub fn write(&self, dir: &Path) -> Result<()> {
        let folder = |name: &str| {
            let path = dir.join(name);
            std::fs::create_dir_all(&path)
                .map_err(|source| ReportError::Folder { path: path.clone(), source })?;
            Ok::<_, ReportError>(path)
        };
        let (tables, figures) = (folder("tables")?, folder("figures")?);
        // What another report left here would pass as part of this one.
        if dir.join("report.json").is_file() {
            for (folder, extensions) in [(&tables, ["csv", "tex"]), (&figures, ["svg", "pdf"])] {
                for entry in std::fs::read_dir(folder).into_iter().flatten().flatten() {
                    let path = entry.path();
                    if extensions.iter().any(|e| path.extension().is_some_and(|found| found == *e))
                    {
                        std::fs::remove_file(&path)
                            .map_err(|source| ReportError::Folder { path: path.clone(), source })?;
                    }
                }
            }
        }
        let mut rows = self.sections.iter().flat_map(|s| &s.tables).flat_map(|t| &t.rows);
        let mixed = rows.any(|row| row.source != Source::Ours);
        let put = |path: &Path, bytes: &[u8]| draft::write(path, bytes).map_err(ReportError::Write);
        for table in self.sections.iter().flat_map(|s| &s.tables) {
            put(&tables.join(format!("{}.csv", table.name)), table.csv(mixed)?.as_bytes())?;
            put(&tables.join(format!("{}.tex", table.name)), latex::table(table).as_bytes())?;
        }
        for section in &self.sections {
            let grouped = section.groups.iter().flat_map(|g| &g.figures);
            for figure in section.figures.iter().chain(grouped) {
                figure.write(&figures)?;
            }
        }
        let json = serde_json::to_string_pretty(self)?;
        put(&dir.join("report.json"), json.as_bytes())?;
        put(&dir.join("report.html"), self.html().as_bytes())
    }
}
