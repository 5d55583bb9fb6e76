//! Reports of results: one self-contained HTML page that reads well on a screen, on a phone and on
//! paper, with the same tables as CSV, LaTeX and JSON and the same figures as SVG and PDF.
//!
//! ```
//! use corsmal_report::{Cell, Report, Row, Section, Source, Table};
//!
//! let table = Table {
//!     name: "scores".into(),
//!     caption: "Scores in percent".into(),
//!     columns: vec!["Method".into(), "Accuracy".into()],
//!     rows: vec![Row {
//!         source: Source::Ours,
//!         cells: vec![Cell::Text("Forest".into()), Cell::Score(90.0, Some((87.0, 92.8)))],
//!     }],
//! };
//! let section = Section { tables: vec![table], ..Section::new("scores", "Scores") };
//! let report = Report { sections: vec![section], ..Report::new("A study") };
//! assert!(report.html().contains("90.00"));
//! ```

mod bands;
mod error;
mod figure;
mod latex;
mod look;
mod overview;
mod page;
pub mod study;
mod table;

use std::path::Path;

use corsmal_files::draft;
use serde::Serialize;

pub use bands::FrequencyAxis;
pub use error::ReportError;
pub use figure::{Figure, FigureGroup};
pub use look::{Look, look};
pub use overview::{Overview, View};
pub use table::{Cell, Row, Source, Table};

/// Result with this crate's error.
pub type Result<T> = std::result::Result<T, ReportError>;

/// What a person reads.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Report {
    /// Heading.
    pub title: String,
    /// One sentence below it.
    pub summary: String,
    /// A warning that must not be missed, such as that the data are synthetic.
    pub warning: Option<String>,
    /// What was used: data, protocol, versions, command.
    pub facts: Vec<Fact>,
    /// The results.
    pub sections: Vec<Section>,
}

/// A name with its value.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Fact {
    /// What it is about.
    pub name: String,
    /// What is known.
    pub value: String,
    /// Where more is found.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub link: Option<String>,
}

impl Fact {
    /// A fact without a link.
    pub fn new(name: impl Into<String>, value: impl Into<String>) -> Self {
        Self { name: name.into(), value: value.into(), link: None }
    }

    /// A fact whose value leads to an address.
    pub fn linked(name: &str, value: &str, link: &str) -> Self {
        Self { name: name.into(), value: value.into(), link: Some(link.into()) }
    }
}

/// Text to copy, such as a BibTeX entry.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Snippet {
    /// What it is.
    pub title: String,
    /// The text, line by line.
    pub text: String,
}

/// A part of the report.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Section {
    /// Name in links: letters, digits and hyphens.
    pub id: String,
    /// Heading.
    pub title: String,
    /// Paragraphs.
    pub text: Vec<String>,
    /// Names with their meaning, in two columns.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub terms: Vec<Fact>,
    /// Pictures above the tables.
    pub figures: Vec<Figure>,
    /// Tables.
    pub tables: Vec<Table>,
    /// Pictures below the tables; the first group is shown, the others unfold.
    pub groups: Vec<FigureGroup>,
    /// Texts to copy.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub snippets: Vec<Snippet>,
}

impl Section {
    /// A section without content.
    pub fn new(id: &str, title: &str) -> Self {
        Self { id: id.into(), title: title.into(), ..Self::default() }
    }
}

impl Report {
    /// A report without content.
    pub fn new(title: &str) -> Self {
        Self { title: title.into(), ..Self::default() }
    }

    /// The page: no other file is needed to read it.
    pub fn html(&self) -> String {
        page::page(self)
    }

    /// Writes `report.html`, `report.json`, `tables/NAME.csv`, `tables/NAME.tex`,
    /// `figures/NAME.svg` and `figures/NAME.pdf` below `dir`.
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
        let put = |path: &Path, bytes: &[u8]| draft::write(path, bytes).map_err(ReportError::Write);
        for table in self.sections.iter().flat_map(|s| &s.tables) {
            put(&tables.join(format!("{}.csv", table.name)), table.csv()?.as_bytes())?;
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
