//! Pictures of a report.

use std::path::Path;

use corsmal_files::draft;
use corsmal_plot::{to_pdf, to_svg};
use serde::Serialize;

use crate::{ReportError, Result};

/// Widest picture that reads well on half of the page.
const HALF: f64 = 700.0;

/// A picture with what it shows.
#[derive(Clone, Debug, Serialize)]
pub struct Figure {
    /// Name of its files, without extension.
    pub name: String,
    /// Its heading.
    pub title: String,
    /// A sentence or two below it; may be empty.
    pub caption: String,
    /// Takes the whole width of the page.
    #[serde(skip)]
    pub wide: bool,
    #[serde(skip)]
    svg: String,
    #[serde(skip)]
    pdf: Vec<u8>,
}

/// Pictures that belong together.
#[derive(Clone, Debug, Serialize)]
pub struct FigureGroup {
    /// Heading.
    pub title: String,
    /// The pictures.
    pub figures: Vec<Figure>,
}

impl Figure {
    /// Draws a picture.
    ///
    /// # Errors
    /// [`ReportError::Figure`] when it cannot be drawn.
    pub fn new(
        name: impl Into<String>,
        caption: impl Into<String>,
        plot: &dyn corsmal_plot::Figure,
    ) -> Result<Self> {
        let name = name.into();
        let fault = |source| ReportError::Figure { name: name.clone(), source };
        let (svg, pdf) = (to_svg(plot).map_err(fault)?, to_pdf(plot).map_err(fault)?);
        let (title, caption) = (plot.title().to_owned(), caption.into());
        let wide = plot.size().0 > HALF;
        Ok(Self { name, title, caption, wide, svg, pdf })
    }

    /// The same, over the whole width of the page.
    #[must_use]
    pub fn wide(self) -> Self {
        Self { wide: true, ..self }
    }

    /// The SVG document.
    pub fn svg(&self) -> &str {
        &self.svg
    }

    /// Writes `NAME.svg` and `NAME.pdf` into a folder.
    pub(crate) fn write(&self, folder: &Path, name: &str) -> Result<()> {
        let put = |extension: &str, bytes: &[u8]| {
            let path = folder.join(format!("{name}.{extension}"));
            draft::write(&path, bytes).map_err(ReportError::Write)
        };
        put("svg", self.svg.as_bytes())?;
        put("pdf", &self.pdf)
    }
}
