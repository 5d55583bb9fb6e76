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
mod output;
mod overview;
mod page;
mod report;
pub mod study;
mod table;

pub use bands::FrequencyAxis;
pub use error::{ReportError, Result};
pub use figure::{Figure, FigureGroup};
pub use look::{Excerpt, Look, look};
pub use overview::{Overview, View};
pub use report::{Fact, Report, Section, Snippet, capitalised};
pub use table::{Cell, Row, Source, Table};
