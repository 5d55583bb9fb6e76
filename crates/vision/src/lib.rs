//! The vision side of the CORSMAL containers benchmark: calibrations, images, masks, and the
//! capacity of a container from them. Everything runs from files, without any network.
//!
//! Lengths are in m or mm and capacities in mL, as each item says; pixels are (column, row) from the
//! upper left, whole numbers at their centres. `docs/vision.md` says what is published, what is
//! corrected and what is our reading.
//!
//! ```
//! use corsmal_vision::Camera;
//!
//! let intrinsic = [[920.0, 0.0, 640.0], [0.0, 920.0, 360.0], [0.0, 0.0, 1.0]];
//! let upright = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
//! let camera = Camera::new(intrinsic, upright, [0.0, 0.0, 0.0]);
//! let [column, row] = camera.project([0.1, 0.05, 1.0]);
//! assert_eq!([column, row], [732.0, 406.0]);
//! // A depth in m turns the pixel back into the point.
//! let view = camera.back_projection().expect("a camera that can be inverted");
//! assert!((view.point(column, row, 1.0)[0] - 0.1).abs() < 1e-12);
//! ```
//!
//! [`lode`] measures an object by the masks of two views, [`cuboid`] by a mask and a depth image,
//! [`region`] finds it in a depth image alone, [`fused`] weighs several estimates.

mod calibration;
mod capacity;
pub mod category;
pub mod cloud;
mod coco;
mod contour;
pub mod cuboid;
mod detections;
mod error;
mod forest;
pub mod fused;
mod gaussian_process;
mod image;
pub mod lode;
mod mask;
mod matrix;
mod pickle;
mod polygon;
pub mod region;
mod resize;
mod video;

pub use calibration::{BackProjection, Calibration, Camera};
pub use category::Category;
pub use coco::{category_name, compress};
pub use contour::{Contour, contours, largest};
pub use detections::{Detection, check_box, read_detections};
pub use error::{Result, VisionError};
pub use gaussian_process::{GaussianProcess, Normal};
pub use image::{Depth, Rgb};
pub use mask::Mask;
pub use matrix::{Matrix3, Matrix34};
pub use video::{Pictures, Video};
