//! Colour frames of a view one by one, for models.

use std::ops::ControlFlow;

use corsmal_ccm::capacity::{Problem, Views};
use corsmal_vision::Rgb;

/// Gives each colour image of a view that is `wanted` to `each`, in their order, until it fails.
pub fn each<E: From<Problem>>(
    views: &Views,
    view: u8,
    wanted: impl Fn(u32) -> bool,
    mut each: impl FnMut(u32, Rgb) -> Result<(), E>,
) -> Result<(), E> {
    let mut failed = None;
    views.colours(view, wanted, |number, image| match each(number, image) {
        Ok(()) => ControlFlow::Continue(()),
        Err(error) => {
            failed = Some(error);
            ControlFlow::Break(())
        }
    })?;
    failed.map_or(Ok(()), Err)
}

/// Why a recording is left out.
pub fn reason(problem: Problem) -> String {
    match problem {
        Problem::Missing(reason) | Problem::Damaged(reason) => reason,
    }
}
