//! When and how a run was started.

/// When and how a run was started.
#[derive(Clone, Debug, Default)]
pub struct Made {
    /// The date.
    pub on: Option<String>,
    /// The command line.
    pub command: Option<String>,
}
