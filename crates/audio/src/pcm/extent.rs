//! Which bytes of a file are samples.

use super::format::Format;
use crate::input::Input;
use crate::report::Repair;

/// The bytes of the samples.
#[derive(Debug)]
pub(crate) struct Extent {
    /// The first of them.
    pub(crate) start: u64,
    /// How many, whole frames or not; `None`: to the end of a pipe.
    pub(crate) len: Option<u64>,
    /// How many the header declares, where it does.
    pub(crate) declared: Option<u64>,
}

impl Extent {
    /// Samples from the position of `input` on: as many bytes as declared, or to the end. Notes where
    /// the file ends before.
    pub(super) fn new(
        input: &Input,
        format: &Format,
        declared: Option<u64>,
        repairs: &mut Vec<Repair>,
    ) -> Self {
        let start = input.position();
        let available = input.len().map(|len| len.saturating_sub(start));
        let len = match (declared, available) {
            (Some(declared), Some(there)) if declared > there => {
                let (declared, actual) =
                    (Some(format.frames_in(declared)), format.frames_in(there));
                repairs.push(Repair::Truncated { declared, actual });
                Some(there)
            }
            (Some(declared), _) => Some(declared),
            (None, there) => there,
        };
        Self { start, len, declared }
    }
}

/// Notes that the header does not say where the samples end.
pub(super) fn to_end(repair: Repair, repairs: &mut Vec<Repair>) -> Option<u64> {
    repairs.push(repair);
    None
}
