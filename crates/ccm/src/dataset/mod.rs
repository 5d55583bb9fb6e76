//! The CCM data set: containers, fillings, names, annotations, folders and splits.

mod actions;
mod annotation;
mod check;
mod container;
mod filling;
mod index;
mod layout;
mod name;
mod oddity;
mod recording;
mod splits;

pub use actions::{Actions, read_actions};
pub use annotation::{Annotation, Annotations, Dimensions};
pub use check::{ContainerFindings, Findings, check};
pub use container::{CONTAINER_FOLDS, Container, Subset};
pub use corsmal_vision::Category;
pub use filling::{Filling, FillingLevel, FillingType};
pub use layout::DataSet;
pub(crate) use layout::PathParts;
pub use name::SequenceName;
pub use oddity::Oddity;
pub use recording::Recording;
pub use splits::{PublishedSplit, training_order};
