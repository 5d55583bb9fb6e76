//! The sections of the report in their order.

use super::content::{Score, Study};
use super::{data, errors, scores};
use crate::{Report, Result};

impl Study {
    /// The report.
    ///
    /// # Errors
    /// [`crate::ReportError`] when a figure cannot be drawn.
    pub fn report(&self) -> Result<Report> {
        let mut sections = Vec::new();
        sections.extend(scores::section(self)?);
        sections.extend(scores::confusion(self)?);
        sections.extend(scores::curves(self)?);
        sections.extend(errors::section(self));
        sections.extend(data::section(self)?);
        sections.extend(data::classes(self)?);
        sections.extend(scores::importances(self)?);
        sections.extend(scores::learning(self)?);
        Ok(Report {
            title: self.title.clone(),
            summary: self.summary(),
            warning: None,
            facts: self.facts.clone(),
            sections,
        })
    }

    /// The main result in a sentence.
    fn summary(&self) -> String {
        let rows = self.predictions.len();
        let classes = self.classes.len();
        match self.scores.first() {
            Some(Score { name, value, interval }) => {
                let range = interval
                    .map_or(String::new(), |(low, high)| format!(" ({low:.1} to {high:.1})"));
                format!(
                    "{}: {name} {value:.2} %{range} on {rows} rows of {classes} classes.",
                    self.target
                )
            }
            None => format!("{}: {classes} classes.", self.target),
        }
    }
}
