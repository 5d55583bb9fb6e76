//! Pictures for `inspect` and for reports: each figure is drawn once, onto a [`Surface`], which is
//! an SVG document or a PNG.
//!
//! ```
//! use corsmal_plot::{BarChart, Series, to_svg};
//!
//! let chart = BarChart {
//!     title: "Filling type".into(),
//!     value_label: "F1 (%)".into(),
//!     groups: vec!["kNN".into(), "SVM".into()],
//!     series: vec![Series { name: "fold 1".into(), values: vec![71.2, 78.4], errors: vec![] }],
//! };
//! let svg = to_svg(&chart)?;
//! assert!(svg.starts_with("<svg"));
//! # Ok::<(), corsmal_plot::PlotError>(())
//! ```

mod bars;
mod color;
mod confusion;
mod font;
mod raster;
mod recording;
mod surface;
mod svg;
mod ticks;

pub use bars::{BarChart, Series};
pub use color::{Rgb, sequential};
pub use confusion::ConfusionMatrix;
pub use recording::{ChannelPicture, RecordingPicture};
pub use surface::{Anchor, Figure, Pixels, PlotError, Rect, Surface, TextStyle, to_png, to_svg};
