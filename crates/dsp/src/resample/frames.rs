//! A stretch of a signal on its way through the filters.

/// Interleaved frames with the absolute number of the first one.
#[derive(Debug, Clone, Copy)]
pub(super) struct Frames<'a> {
    pub data: &'a [f32],
    pub start: i64,
}
