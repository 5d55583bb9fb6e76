//! Features that look at neighbouring frames.

/// Computes from finished frames in their order of time: those that the feature has made itself, or
/// those of an earlier feature.
///
/// A recording may be read in any blocks and computed in spans of time at once; its finished frames
/// pass here once, in order, so that a state carried from frame to frame is exact.
pub trait Derived: Send + Sync {
    /// Names of its coefficients, given those of the frames that it reads.
    fn labels(&self, source: &[String]) -> Vec<String> {
        source.to_vec()
    }

    /// Whether every frame depends on all frames before it, ever less, as after a recursive filter.
    fn is_recursive(&self) -> bool {
        false
    }

    /// Begins a recording.
    fn start(&self, shape: FrameShape) -> Box<dyn InTime + '_>;
}

/// Size of the frames that are read, `[coefficients][channels]`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct FrameShape {
    /// Coefficients.
    pub coefficients: usize,
    /// Channels, side by side.
    pub channels: usize,
}

impl FrameShape {
    /// Values of a frame.
    pub fn len(&self) -> usize {
        self.coefficients * self.channels
    }

    /// Whether a frame has no values.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }
}

/// The frames of one recording, as they pass. Any split into calls must give the same bits; the
/// conformance tests check it.
pub trait InTime {
    /// Takes whole frames `[frames][coefficients][channels]` and appends those that they complete,
    /// in the same layout.
    fn push(&mut self, frames: &[f32], out: &mut Vec<f32>);

    /// Appends what remains at the end of the recording.
    ///
    /// # Errors
    /// Too few frames.
    fn finish(&mut self, out: &mut Vec<f32>) -> Result<(), TooFewFrames>;
}

/// A recording of fewer frames than a feature needs.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct TooFewFrames {
    /// Frames that there are.
    pub frames: usize,
    /// Frames that it takes.
    pub needed: usize,
}
