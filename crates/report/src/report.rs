//! What a report says.

use serde::Serialize;

use crate::figure::{Figure, FigureGroup};
use crate::table::Table;

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
}

/// A text with a capital at its beginning, as the first cell of a row has it.
pub fn capitalised(text: &str) -> String {
    let mut chars = text.chars();
    chars.next().map_or_else(String::new, |c| c.to_uppercase().chain(chars).collect())
}
