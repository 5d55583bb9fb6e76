//! The official annotation files.

use std::path::{Path, PathBuf};

use super::container::{Container, Subset};
use super::filling::{Filling, FillingLevel, FillingType};
use super::name::SequenceName;
use crate::error::{CcmError, Result};
use crate::table::Table;

/// Outer dimensions of a container in mm.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Dimensions {
    /// Width at the top.
    pub width_top: f64,
    /// Width at the bottom.
    pub width_bottom: f64,
    /// Height.
    pub height: f64,
}

/// Ground truth of one recording.
#[derive(Clone, Debug)]
pub struct Annotation {
    /// Flat number of the 2021 release.
    pub id: Option<u32>,
    /// Container number as written (ACC's file goes up to 19).
    pub container: u8,
    /// Sequence number within the container, in the order of the 2020 release; `None` in flat files
    /// of test parts, whose numbers were given at random.
    pub sequence: Option<u16>,
    /// 0, 1 or 2; `None` where withheld, as the other settings.
    pub scenario: Option<u8>,
    /// 0 or 1.
    pub background: Option<u8>,
    /// 0 or 1.
    pub illumination: Option<u8>,
    /// Dimensions, in the files from 2021 on.
    pub dimensions: Option<Dimensions>,
    /// Capacity in mL, -1 where withheld.
    pub capacity_ml: f64,
    /// Mass of the empty container in g, -1 where withheld.
    pub container_mass_g: f64,
    /// Type and level; `None` where withheld.
    pub filling: Option<Filling>,
    /// Density in g/mL.
    pub density: f64,
    /// Mass of the filling in g.
    pub filling_mass_g: f64,
}

impl Annotation {
    /// The recording's name, where filling and settings are known.
    pub fn name(&self) -> Option<SequenceName> {
        Some(SequenceName {
            scenario: self.scenario?,
            filling: self.filling?,
            background: self.background?,
            illumination: self.illumination?,
        })
    }
}

/// The rows of one annotation file, in its order.
#[derive(Clone, Debug)]
pub struct Annotations {
    /// Where they were read from.
    pub path: PathBuf,
    /// One row per recording.
    pub rows: Vec<Annotation>,
    /// Levels are written 0, 50, 90 rather than 0, 1, 2.
    pub levels_in_percent: bool,
}

impl Annotations {
    /// Reads the format of 2021 and later (`id,container id,…`) or of 2020
    /// (`Container ID,Sequence,…`), levels written 0, 1, 2 or 0, 50, 90.
    ///
    /// # Errors
    /// [`CcmError`] with line and column for a value that is not allowed, and for duplicate rows.
    pub fn read(path: &Path) -> Result<Self> {
        Self::from_table(&Table::read(path)?)
    }

    pub(crate) fn from_table(table: &Table) -> Result<Self> {
        let flat = table.find("id").is_some();
        // The 2020 files write units after some names, or not.
        let col = |new: &str, old: &str| {
            let bare = old.split(" [").next().unwrap_or(old);
            let name = if flat { new } else { old };
            table.find(bare).filter(|_| !flat).map_or_else(|| table.column(name), Ok)
        };
        let container = col("container id", "Container ID")?;
        let scenario = col("scenario", "Scenario")?;
        let background = col("background", "Background")?;
        let illumination = col("illumination", "Illumination")?;
        let capacity = col("container capacity", "Container Capacity [mL]")?;
        let mass = col("container mass", "Container mass [g]")?;
        let kind = col("filling type", "Filling type")?;
        let level = col("filling level", "Filling level")?;
        let density = col("filling density", "Filling density [g/mL]")?;
        let filling_mass = col("filling mass", "Filling mass [g]")?;
        let key = if flat { table.column("id")? } else { table.column("Sequence")? };
        let dimensions = if flat {
            Some((
                table.column("width at the top")?,
                table.column("width at the bottom")?,
                table.column("height")?,
            ))
        } else {
            None
        };

        let mut rows = Vec::with_capacity(table.rows());
        let mut levels_in_percent = false;
        for row in 0..table.rows() {
            let number = table.integer(row, container)?;
            let number = u8::try_from(number)
                .map_err(|_| table.fault(row, container, "a container number"))?;
            let filling = read_filling(table, row, kind, level)?;
            levels_in_percent |= filling.is_some() && table.integer(row, level)? > 2;
            let mut annotation = Annotation {
                id: None,
                container: number,
                sequence: None,
                scenario: setting(table, row, scenario, 's', 3)?,
                background: setting(table, row, background, 'b', 2)?,
                illumination: setting(table, row, illumination, 'l', 2)?,
                dimensions: match dimensions {
                    Some((top, bottom, height)) => Some(Dimensions {
                        width_top: table.number(row, top)?,
                        width_bottom: table.number(row, bottom)?,
                        height: table.number(row, height)?,
                    }),
                    None => None,
                },
                capacity_ml: withheld(table, row, capacity)?,
                container_mass_g: withheld(table, row, mass)?,
                filling,
                density: withheld(table, row, density)?,
                filling_mass_g: withheld(table, row, filling_mass)?,
            };
            let key_value = u32::try_from(table.integer(row, key)?)
                .map_err(|_| table.fault(row, key, "a number from 0"))?;
            if flat {
                annotation.id = Some(key_value);
                annotation.sequence = Container::new(number)
                    .filter(|container| container.subset() == Subset::Training)
                    .zip(annotation.name())
                    .and_then(|(container, name)| name.number(container));
            } else {
                let sequence = u16::try_from(key_value)
                    .map_err(|_| table.fault(row, key, "a sequence number"))?;
                annotation.sequence = Some(sequence);
            }
            rows.push(annotation);
        }
        let annotations = Self { path: table.path().to_path_buf(), rows, levels_in_percent };
        annotations.check_keys(flat)?;
        Ok(annotations)
    }

    fn check_keys(&self, flat: bool) -> Result<()> {
        let mut seen = std::collections::HashSet::new();
        for row in &self.rows {
            let key = if flat {
                (0, row.id.unwrap_or_default())
            } else {
                (row.container, u32::from(row.sequence.unwrap_or_default()))
            };
            if !seen.insert(key) {
                return Err(CcmError::Rows {
                    path: self.path.clone(),
                    problem: "more than one row",
                    rows: if flat {
                        format!("id {}", key.1)
                    } else {
                        format!("container {} sequence {}", key.0, key.1)
                    },
                    expected: "the recordings".into(),
                });
            }
        }
        Ok(())
    }

    /// Only the rows of some containers.
    pub fn of_containers(&self, containers: &[u8]) -> Self {
        let rows = self.rows.iter().filter(|r| containers.contains(&r.container));
        Self { rows: rows.cloned().collect(), path: self.path.clone(), ..*self }
    }
}

/// A number, -1 where the cell is empty.
fn withheld(table: &Table, row: usize, column: usize) -> Result<f64> {
    if table.text(row, column).is_empty() { Ok(-1.0) } else { table.number(row, column) }
}

/// A setting written as a number or, in 2020, with its letter (`s0`, `b1`); empty if withheld.
fn setting(
    table: &Table,
    row: usize,
    column: usize,
    letter: char,
    below: u8,
) -> Result<Option<u8>> {
    let text = table.text(row, column);
    if text.is_empty() {
        return Ok(None);
    }
    let digits = text.strip_prefix(letter).unwrap_or(text);
    match digits.parse::<u8>() {
        Ok(value) if value < below => Ok(Some(value)),
        _ => Err(table.fault(row, column, "a setting of the data set")),
    }
}

/// Type and level of a row; -1 in either means that they are withheld.
fn read_filling(table: &Table, row: usize, kind: usize, level: usize) -> Result<Option<Filling>> {
    let (k, l) = (table.integer(row, kind)?, table.integer(row, level)?);
    if k == -1 || l == -1 {
        return Ok(None);
    }
    let k = FillingType::from_number(k)
        .ok_or_else(|| table.fault(row, kind, "a filling type (0, 1, 2, 3, or -1 if withheld)"))?;
    let l = FillingLevel::from_number(l)
        .ok_or_else(|| table.fault(row, level, "a filling level (0, 1, 2, 50, 90, or -1)"))?;
    match Filling::new(k, l) {
        Some(filling) => Ok(Some(filling)),
        None => Err(table.fault(row, level, "a level that goes with the filling type")),
    }
}
