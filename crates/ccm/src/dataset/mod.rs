//! The CCM data set: containers, fillings, names, annotations, folders and splits.

mod annotation;
mod container;
mod filling;
mod name;

pub use annotation::{Annotation, Annotations, Dimensions};
pub use container::{CONTAINER_FOLDS, Category, Container, Subset};
pub use filling::{Filling, FillingLevel, FillingType};
pub use name::SequenceName;
