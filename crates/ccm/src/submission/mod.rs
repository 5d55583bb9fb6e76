//! Submissions in the official formats of 2020 and 2022.

mod baseline;
mod reader;
mod stand_in;
mod writer;

pub use baseline::pseudo_random;
pub(crate) use reader::listed;
pub use stand_in::{official_stand_in, stand_in};
pub use writer::SubmissionRow;

use std::fmt;
use std::path::PathBuf;

use crate::dataset::Subset;

/// How a row names its recording.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum RowKey {
    /// Flat number (2022 format, column `Configuration ID`).
    Id(u32),
    /// Container and sequence number within it (2020 format).
    Sequence(u8, u16),
}

impl fmt::Display for RowKey {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Id(id) => write!(f, "id {id}"),
            Self::Sequence(container, sequence) => {
                write!(f, "container {container} sequence {sequence}")
            }
        }
    }
}

/// Which of the two official formats.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Format {
    /// `Container ID,Sequence,Filling level,Filling type,Container Capacity` in any order.
    Y2020,
    /// `Configuration ID,Container capacity,…,Execution time` (20 columns).
    Y2022,
}

/// One column of estimates, -1 where not estimated.
///
/// `float` tells that some cell was written with a decimal point. The official evaluators compare
/// labels as text, so there a float column of labels matches nothing.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Estimates {
    /// One value per row.
    pub values: Vec<f64>,
    /// Written as floating-point numbers.
    pub float: bool,
}

impl Estimates {
    /// Whether the task counts as addressed: some entry is not -1.
    pub fn addressed(&self) -> bool {
        self.values.iter().any(|&v| v != -1.0)
    }
}

/// A submission: estimates for every recording, columns absent from the 2020 format filled with -1.
#[derive(Clone, Debug)]
pub struct Submission {
    /// Where it was read from, or a name.
    pub path: PathBuf,
    /// Format it was written in.
    pub format: Format,
    /// The recordings, in the order of the file.
    pub keys: Vec<RowKey>,
    /// Filling type 0 to 3.
    pub kind: Estimates,
    /// Filling level 0 to 2, or 0, 50, 90.
    pub level: Estimates,
    /// Capacity in mL.
    pub capacity: Estimates,
    /// Mass of the empty container in g.
    pub container_mass: Estimates,
    /// Width at the top in mm.
    pub width_top: Estimates,
    /// Width at the bottom in mm.
    pub width_bottom: Estimates,
    /// Height in mm.
    pub height: Estimates,
    /// Object safety measured in the simulator, 0 to 1.
    pub safety: Estimates,
    /// Distance from the delivery place in mm, measured in the simulator.
    pub distance: Estimates,
    /// Angle difference measured in the simulator.
    pub angle: Estimates,
    /// What was odd but usable.
    pub notes: Vec<String>,
}

/// The rows of a whole part in the order of the official files: ids from 0 in 2022, sequence numbers
/// container by container in 2020.
pub fn official_rows(part: Subset, format: Format) -> Vec<RowKey> {
    let sizes = part.containers().map(|c| (c.number(), c.recordings()));
    match format {
        Format::Y2022 => (0..sizes.map(|(_, n)| n as u32).sum()).map(RowKey::Id).collect(),
        Format::Y2020 => sizes
            .flat_map(|(container, n)| (0..n as u16).map(move |s| RowKey::Sequence(container, s)))
            .collect(),
    }
}

impl Submission {
    /// Name for tables: the file's stem.
    pub fn name(&self) -> String {
        self.path.file_stem().unwrap_or_default().to_string_lossy().into_owned()
    }

    /// All columns of estimates.
    fn columns_mut(&mut self) -> [&mut Estimates; 10] {
        [
            &mut self.kind,
            &mut self.level,
            &mut self.capacity,
            &mut self.container_mass,
            &mut self.width_top,
            &mut self.width_bottom,
            &mut self.height,
            &mut self.safety,
            &mut self.distance,
            &mut self.angle,
        ]
    }

    /// The same columns for the given rows, in that order.
    fn select(&self, rows: &[usize]) -> Self {
        let mut selected = self.clone();
        selected.keys = rows.iter().map(|&r| self.keys[r]).collect();
        for column in selected.columns_mut() {
            column.values = rows.iter().map(|&r| column.values[r]).collect();
        }
        selected
    }
}
