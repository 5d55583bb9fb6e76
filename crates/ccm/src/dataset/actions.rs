//! When pouring or shaking starts and ends (manual annotations of the M4 team).

use std::collections::HashMap;
use std::path::Path;

use super::container::Container;
use super::name::SequenceName;
use crate::error::Result;
use crate::table::Table;

/// Start and end in seconds of each training recording's action, `None` where there is none.
pub type Actions = HashMap<(Container, SequenceName), Option<(f64, f64)>>;

/// Reads a file with columns `folder_num,file_name,start,end`; -1 stands for no action.
///
/// # Errors
/// [`crate::CcmError`] with line and column for values that are not allowed.
pub fn read_actions(path: &Path) -> Result<Actions> {
    let table = Table::read(path)?;
    let folder = table.column("folder_num")?;
    let file = table.column("file_name")?;
    let (start, end) = (table.column("start")?, table.column("end")?);
    let mut actions = Actions::new();
    for row in 0..table.rows() {
        let container = u8::try_from(table.integer(row, folder)?)
            .ok()
            .and_then(Container::new)
            .ok_or_else(|| table.fault(row, folder, "a container number"))?;
        let name = SequenceName::parse(table.text(row, file))
            .ok_or_else(|| table.fault(row, file, "a name such as s0_fi1_fu2_b0_l0_c2"))?;
        let span = (table.number(row, start)?, table.number(row, end)?);
        let action = match span {
            (-1.0, -1.0) => None,
            (from, to) if from >= 0.0 && to > from => Some(span),
            _ => return Err(table.fault(row, end, "an end after the start, or -1 for both")),
        };
        if actions.insert((container, name), action).is_some() {
            return Err(table.fault(row, file, "one line for each recording"));
        }
    }
    Ok(actions)
}
