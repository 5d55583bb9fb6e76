//! Figures of recordings, features and scores. Each is drawn once, as SVG; PNG and PDF are made
//! from that SVG by resvg and svg2pdf with a bundled font, so that all three look the same on every
//! machine.
//!
//! ```
//! use corsmal_plot::{Mark, ScorePlot, ScoreRow, to_svg};
//!
//! let plot = ScorePlot {
//!     title: "Filling type".into(),
//!     value_label: "weighted F1, percent".into(),
//!     series: vec!["container folds".into()],
//!     rows: vec![ScoreRow {
//!         name: "Forest".into(),
//!         marks: vec![Mark { series: 0, value: 93.2, interval: Some((91.2, 95.0)) }],
//!     }],
//!     range: Some((0.0, 100.0)),
//! };
//! let svg = to_svg(&plot)?;
//! assert!(svg.starts_with("<svg"));
//! # Ok::<(), corsmal_plot::PlotError>(())
//! ```

mod axis;
mod box_plot;
mod color;
mod confusion;
mod drawing;
mod error;
mod export;
mod feature;
mod font;
mod heat_map;
mod histogram;
mod legend;
mod lines;
mod raster;
mod recording;
mod scores;
mod slopes;
mod ticks;

pub use box_plot::{BoxPlot, BoxRow};
pub use color::{Paint, Rgb, sequential};
pub use confusion::ConfusionMatrix;
pub use drawing::Drawing;
pub use error::PlotError;
pub use export::{DEFAULT_DPI, Figure, to_pdf, to_png, to_svg};
pub use feature::{FeaturePanel, FeaturePicture};
pub use heat_map::HeatMap;
pub use histogram::Histogram;
pub use lines::{Line, LinePlot};
pub use recording::{ChannelPicture, RecordingPicture, WaveScale};
pub use scores::{Mark, ScorePlot, ScoreRow};
pub use slopes::{Slope, Slopes};
