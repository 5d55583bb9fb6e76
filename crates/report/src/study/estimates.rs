//! The report on estimated numbers, such as capacities or masses.

use corsmal_plot::{Line, LinePlot};

use crate::{Cell, Fact, Figure, Report, Result, Row, Section, Source, Table};

/// Rows listed.
const LISTED: usize = 50;

/// Estimates with what they should be.
#[derive(Clone, Debug, Default)]
pub struct Estimates {
    /// Heading.
    pub title: String,
    /// What is estimated.
    pub target: String,
    /// Data, versions, command.
    pub facts: Vec<Fact>,
    /// Measures of the error: name and value as text.
    pub measures: Vec<(String, String)>,
    /// The rows.
    pub rows: Vec<Estimate>,
}

/// A row.
#[derive(Clone, Debug, PartialEq)]
pub struct Estimate {
    /// Its id.
    pub id: String,
    /// What is true.
    pub truth: f64,
    /// What was estimated; `None` where nothing was.
    pub estimate: Option<f64>,
}

impl Estimates {
    /// The report: measures, estimates against truth, the largest errors.
    ///
    /// # Errors
    /// [`crate::ReportError`] when the figure cannot be drawn.
    pub fn report(&self) -> Result<Report> {
        let missing = self.rows.iter().filter(|r| r.estimate.is_none()).count();
        let summary = format!(
            "{}: {} rows, {missing} of them without an estimate.",
            self.target,
            self.rows.len()
        );
        Ok(Report {
            title: self.title.clone(),
            summary,
            warning: None,
            facts: self.facts.clone(),
            sections: vec![self.scores()?, self.errors()],
        })
    }

    fn scores(&self) -> Result<Section> {
        let points: Vec<(f64, f64)> =
            self.rows.iter().filter_map(|r| Some((r.truth, r.estimate?))).collect();
        let all = points.iter().flat_map(|p| [p.0, p.1]);
        let ends = all.fold((f64::INFINITY, f64::NEG_INFINITY), |e, v| (e.0.min(v), e.1.max(v)));
        let range = (!points.is_empty()).then_some(ends);
        let plot = LinePlot {
            title: format!("Estimates of {}", self.target),
            x_label: "true value".into(),
            y_label: "estimate".into(),
            x_range: range,
            y_range: range,
            lines: vec![Line { name: "rows".into(), points, band: Vec::new() }],
            diagonal: true,
            dots: true,
            joined: false,
        };
        let caption = "Estimates on the dashed line are exact.";
        let row = |(name, value): &(String, String)| Row {
            source: Source::Ours,
            cells: vec![Cell::text(name), Cell::text(value)],
        };
        let table = Table {
            name: "measures".into(),
            caption: "Errors of the estimates".into(),
            columns: ["Measure", "Value"].map(String::from).to_vec(),
            rows: self.measures.iter().map(row).collect(),
        };
        Ok(Section {
            figures: vec![Figure::new("estimates", caption, &plot)?],
            tables: vec![table],
            ..Section::new("scores", "Scores")
        })
    }

    fn errors(&self) -> Section {
        let error = |r: &Estimate| r.estimate.map_or(f64::INFINITY, |e| (e - r.truth).abs());
        let mut rows: Vec<&Estimate> = self.rows.iter().collect();
        rows.sort_by(|a, b| error(b).total_cmp(&error(a)).then_with(|| a.id.cmp(&b.id)));
        let number = |v: f64| Cell::Number(v, format!("{v:.3}"));
        let row = |r: &&Estimate| Row {
            source: Source::Ours,
            cells: vec![
                Cell::text(&r.id),
                number(r.truth),
                r.estimate.map_or(Cell::None, number),
                r.estimate.map_or(Cell::None, |e| number((e - r.truth).abs())),
            ],
        };
        let shown = match rows.len() > LISTED {
            true => format!(" The first {LISTED} are shown."),
            false => String::new(),
        };
        Section {
            text: vec![format!(
                "Rows without an estimate come first, then the largest errors.{shown}"
            )],
            tables: vec![Table {
                name: "errors".into(),
                caption: "Rows, largest error first".into(),
                columns: ["Recording", "True", "Estimate", "Error"].map(String::from).to_vec(),
                rows: rows.iter().take(LISTED).map(row).collect(),
            }],
            ..Section::new("errors", "Largest errors")
        }
    }
}
