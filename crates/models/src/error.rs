//! What this crate refuses, and why.

use thiserror::Error;

/// A refusal. Texts name the place, what was found and what would be accepted.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum ModelError {
    /// A parameter of a classifier or step that does not exist.
    #[error("{owner} has no parameter {key}: {allowed}")]
    UnknownParameter {
        /// classifier or step
        owner: &'static str,
        /// the key given
        key: String,
        /// the keys it has
        allowed: String,
    },
    /// A parameter value of the wrong type or outside its range.
    #[error("{owner}: {key} must be {allowed}, not {value}")]
    ParameterValue {
        /// classifier or step
        owner: &'static str,
        /// the key
        key: String,
        /// the value given
        value: String,
        /// what it may be
        allowed: String,
    },
    /// A parameter that is given twice.
    #[error("{owner}: {key} is given twice: {remedy}")]
    GivenTwice {
        /// classifier or step
        owner: &'static str,
        /// the key
        key: String,
        /// what to do
        remedy: String,
    },
    /// A key that several texts of the form `key=value` set.
    #[error("{key} is given twice, as {first} and as {second}: keep one of them")]
    KeyTwice {
        /// the key
        key: String,
        /// its first value
        first: String,
        /// the other one
        second: String,
    },
    /// A name outside a table (classifier, step, metric).
    #[error("there is no {kind} {name}: {allowed}")]
    UnknownName {
        /// what the name should be
        kind: &'static str,
        /// the name given
        name: String,
        /// the names there are
        allowed: String,
    },
    /// Text that is not a list of `key=value`.
    #[error("{text:?} is not of the form key=value")]
    NotKeyValue {
        /// the text
        text: String,
    },
    /// No rows, or no columns.
    #[error("the feature table is empty: {rows} rows x {features} features")]
    Empty {
        /// rows
        rows: usize,
        /// columns
        features: usize,
    },
    /// NaN or infinity among the features.
    #[error("row {row}, feature {feature} is {value}: features must be finite")]
    NonFinite {
        /// first row concerned
        row: usize,
        /// its column
        feature: usize,
        /// the value
        value: f64,
    },
    /// A column without any variation where that is refused.
    #[error(
        "feature {feature} has the same value in all {rows} rows (so do {count} of {features} features)"
    )]
    ConstantFeature {
        /// first column concerned
        feature: usize,
        /// rows looked at
        rows: usize,
        /// how many columns are constant
        count: usize,
        /// columns in all
        features: usize,
    },
    /// Two things that must have the same number of entries do not.
    #[error("{what}: expected {expected}, found {actual}")]
    Length {
        /// what is counted
        what: &'static str,
        /// count needed
        expected: usize,
        /// count found
        actual: usize,
    },
    /// A class index outside the label table.
    #[error("row {row} has class {class}, but there are only {n_classes} classes")]
    ClassOutOfRange {
        /// row
        row: usize,
        /// its class
        class: usize,
        /// classes in the table
        n_classes: usize,
    },
    /// Fewer different classes in the training rows than the method needs.
    #[error("{owner} needs rows of at least 2 classes; the {rows} rows have {classes}")]
    TooFewClasses {
        /// classifier
        owner: &'static str,
        /// rows
        rows: usize,
        /// classes among them
        classes: usize,
    },
    /// More different classes than are learned and scored.
    #[error(
        "{classes} different classes, but at most {most} are learned and scored; does the column have \
         ids or numbers? `score --numeric` measures estimates of numbers"
    )]
    TooManyClasses {
        /// how many
        classes: usize,
        /// as many as are allowed
        most: usize,
    },
    /// A class with fewer rows than asked for.
    #[error("class {class} has {rows} rows; {purpose} needs {needed}")]
    TooFewRows {
        /// class index
        class: usize,
        /// its rows
        rows: usize,
        /// rows needed
        needed: usize,
        /// what for
        purpose: &'static str,
    },
    /// Fewer groups than folds.
    #[error(
        "{groups} groups are too few for {folds} folds: ask for at most {groups}, or name no number to hold out each \
         group once"
    )]
    TooFewGroups {
        /// different groups
        groups: usize,
        /// folds asked
        folds: usize,
    },
    /// A cross-validation plan that cannot be carried out.
    #[error("folds: {reason}")]
    Folds {
        /// why
        reason: String,
    },
    /// Rows whose group is not known.
    #[error("groups: {reason}")]
    Groups {
        /// why
        reason: String,
    },
    /// Probabilities asked of a model that has none.
    #[error("this {owner} has no probabilities: {remedy}")]
    NoProbability {
        /// classifier
        owner: &'static str,
        /// how to train one that has
        remedy: &'static str,
    },
    /// Something asked of a classifier that only others have.
    #[error("this classifier has no {what}: {which}")]
    Lacks {
        /// what was asked
        what: &'static str,
        /// which classifiers have it
        which: &'static str,
    },
    /// A weight of a training row that is no weight.
    #[error("the weight of row {row} must be a finite number of at least 0, not {value}")]
    SampleWeight {
        /// the row
        row: usize,
        /// its weight
        value: f64,
    },
    /// A classifier registered under a name that another one has.
    #[error("the name {name:?} already belongs to a classifier: register yours under another one")]
    NameTaken {
        /// the name
        name: &'static str,
    },
    /// A numerical method that failed.
    #[error("{owner}: {reason}")]
    Numerical {
        /// classifier or step
        owner: &'static str,
        /// what went wrong
        reason: String,
    },
    /// A model whose parts contradict one another (only from damaged or hostile files).
    #[error("inconsistent model: {0}")]
    Inconsistent(String),
    /// From linfa itself.
    #[error(transparent)]
    Linfa(#[from] linfa::Error),
}

/// `Result` with [`ModelError`].
pub type Result<T> = std::result::Result<T, ModelError>;
