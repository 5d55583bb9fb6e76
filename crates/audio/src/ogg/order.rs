//! The order of channels: Vorbis and Opus have their own, callers get that of WAV files.

/// Where in a frame of WAV's order each channel of Vorbis' order (Vorbis I specification, 4.3.9)
/// goes; as they are where no order is defined.
pub(super) fn of(channels: usize) -> Vec<usize> {
    match channels {
        3 => vec![0, 2, 1],
        5 => vec![0, 2, 1, 3, 4],
        6 => vec![0, 2, 1, 4, 5, 3],
        7 => vec![0, 2, 1, 5, 6, 4, 3],
        8 => vec![0, 2, 1, 6, 7, 4, 5, 3],
        n => (0..n).collect(),
    }
}
