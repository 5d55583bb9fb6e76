//! A recording put together from its spans: values finished, statistics taken.

use std::io;
use std::path::Path;
use std::sync::Arc;

use corsmal_files::outcome::Status;

use super::extractor::Span;
use super::failed::{Failed, FinishError};
use super::plan::{Plan, PlannedFeature};
use super::store::{Finish, Store};
use crate::features::{Derived, FrameShape, TooFewFrames};
use crate::summary::{Accumulator, Stat};

/// Finished frames of one feature.
pub struct FeatureArray {
    /// Name of the feature.
    pub name: String,
    /// Coefficients.
    pub coefficients: usize,
    /// Frames.
    pub frames: usize,
    /// Whether values are pairs of real and imaginary parts.
    pub complex: bool,
    /// `[frames][coefficients][channels]` (twice as many values where complex).
    pub values: Store,
}

/// Everything that a recording gives.
pub enum Features {
    /// Frame-level features.
    Frames(Vec<FeatureArray>),
    /// Statistics, one value for each of [`Plan::summary_names`].
    Summary(Vec<f32>),
}

/// Collects spans in order of time.
pub struct Recording {
    plan: Arc<Plan>,
    raw: Vec<Store>,
    /// For each feature the maxima `[peaks][channels]`.
    peaks: Vec<Vec<f32>>,
    total: Option<u64>,
    folder: std::path::PathBuf,
}

impl Recording {
    /// A recording without spans. Long ones put temporary files into `folder`.
    pub fn new(plan: Arc<Plan>, folder: &Path) -> Self {
        let raw = plan.features.iter().map(|_| Store::new(folder)).collect();
        let peaks = plan
            .features
            .iter()
            .map(|f| {
                let peaks = f.finish.as_ref().map_or(0, |finish| finish.peaks().len());
                vec![f32::NEG_INFINITY; peaks * plan.channels]
            })
            .collect();
        Self { plan, raw, peaks, total: None, folder: folder.to_path_buf() }
    }

    /// Adds the next span, or the next part of one.
    ///
    /// # Errors
    /// The temporary file cannot be written.
    pub fn add(&mut self, span: Span) -> io::Result<()> {
        // The first span that sees the end knows where it is; one after it may still have frames
        // whose samples the first had as context.
        self.total = self.total.or(span.total);
        for (i, values) in span.raw.into_iter().enumerate() {
            let planned = &self.plan.features[i];
            if let Some(finish) = &planned.finish {
                let width = planned.raw_rows * self.plan.channels;
                for (p, (rows, _)) in finish.peaks().into_iter().enumerate() {
                    let channels = self.plan.channels;
                    let peaks = &mut self.peaks[i][p * channels..(p + 1) * channels];
                    let range = rows.start * channels..rows.end * channels;
                    raise_peaks(&values, width, range, peaks);
                }
            }
            self.raw[i].push(values)?;
        }
        Ok(())
    }

    /// Length of the signal in samples.
    pub fn total(&self) -> u64 {
        self.total.unwrap_or(0)
    }

    /// Name of the first feature without a frame.
    fn without_frames(&self) -> Option<&str> {
        let mut features = self.raw.iter().zip(&self.plan.features);
        let none = features.find(|(store, f)| f.raw_rows > 0 && store.is_empty())?;
        Some(&none.1.name)
    }

    /// The features of a recording of which every span is there.
    ///
    /// # Errors
    /// No samples, too few for one frame, or a temporary file that fails.
    pub fn complete(self) -> Result<Features, Failed> {
        let total = self.total();
        if total == 0 {
            let start = self.plan.config.signal.start;
            return Err(Failed::new(
                Status::Empty,
                match start > 0.0 {
                    true => format!("no samples from signal.start = {start} s on"),
                    false => "no samples".into(),
                },
            ));
        }
        if let Some(feature) = self.without_frames() {
            let needed = self.plan.shortest();
            let reason = if total < needed {
                format!("{total} samples; one frame needs at least {needed}")
            } else {
                // M4's code makes frames of shorter and longer recordings, but none of one frame's length.
                format!("{feature} makes no frame of exactly {total} samples")
            };
            return Err(Failed::new(Status::TooShort, reason));
        }
        let plan = self.plan.clone();
        match (&plan.config.projection, self.finish()?) {
            (Some(projection), Features::Summary(row)) => projection
                .apply(&row)
                .map(Features::Summary)
                .map_err(|reason| Failed::new(Status::Unsupported, reason)),
            (_, features) => Ok(features),
        }
    }

    /// Finishes every value.
    ///
    /// # Errors
    /// A temporary file fails, or a derived feature has too few frames.
    pub fn finish(mut self) -> Result<Features, FinishError> {
        for (peaks, f) in self.peaks.iter_mut().zip(&self.plan.features) {
            let Some(finish) = &f.finish else { continue };
            for (p, (_, joint)) in finish.peaks().into_iter().enumerate() {
                let peaks = &mut peaks[p * self.plan.channels..(p + 1) * self.plan.channels];
                if joint {
                    let top = peaks.iter().copied().fold(f32::NEG_INFINITY, f32::max);
                    peaks.fill(top);
                }
            }
        }
        let mut arrays: Vec<FeatureArray> = Vec::new();
        let raw = std::mem::take(&mut self.raw);
        for (i, store) in raw.into_iter().enumerate() {
            let planned = &self.plan.features[i];
            let values = match (planned.source, &planned.derived) {
                (Some(source), Some(derived)) => {
                    let FeatureArray { name, values, .. } = &mut arrays[source];
                    self.in_time(values, name, planned, derived.as_ref())?
                }
                (None, Some(derived)) => {
                    let mut finished = self.finished(store, i);
                    self.in_time(&mut finished, &planned.name, planned, derived.as_ref())?
                }
                (_, None) => self.finished(store, i),
            };
            let coefficients = planned.labels.len();
            let per_frame = coefficients * self.plan.channels * if planned.complex { 2 } else { 1 };
            arrays.push(FeatureArray {
                name: planned.name.clone(),
                coefficients,
                frames: values.len() / per_frame.max(1),
                complex: planned.complex,
                values,
            });
        }
        match &self.plan.config.summary {
            None => Ok(Features::Frames(arrays)),
            Some(summary) => {
                let mut row = Vec::new();
                for (mut array, planned) in arrays.into_iter().zip(&self.plan.features) {
                    let channels = self.plan.channels;
                    let average = summary.average_channels && channels > 1;
                    let width = array.coefficients * if average { 1 } else { channels };
                    // The mean of one frame is that frame.
                    let stats =
                        if planned.is_vector() { &[Stat::Mean][..] } else { &summary.stats };
                    let mut statistics = Accumulator::new(stats, width);
                    let mut means = Vec::new();
                    array.values.chunks(|chunk| {
                        if average {
                            means.clear();
                            means.extend(chunk.chunks_exact(channels).map(|values| {
                                let sum: f64 = values.iter().map(|x| f64::from(*x)).sum();
                                (sum / channels as f64) as f32
                            }));
                            statistics.push(&means);
                        } else {
                            statistics.push(chunk);
                        }
                        io::Result::Ok(())
                    })?;
                    let series = if average { 1 } else { channels };
                    // [stats][coefficients][channels] to [stats][channels][coefficients].
                    for block in statistics.finish().chunks_exact(width) {
                        for c in 0..series {
                            row.extend(block.iter().skip(c).step_by(series));
                        }
                    }
                }
                Ok(Features::Summary(row))
            }
        }
    }

    /// Finished and kept coefficients of the feature with this index.
    fn finished(&self, store: Store, index: usize) -> Store {
        let planned = &self.plan.features[index];
        let channels = self.plan.channels;
        let rows = planned.raw_rows;
        let values_per = if planned.complex { 2 * channels } else { channels };
        let all = planned.finished;
        // What is derived needs all coefficients.
        let [first, end] = if planned.derived.is_some() { [0, all] } else { planned.kept };
        if planned.finish.is_none() && end - first == all {
            return store;
        }
        // In the memory of the stored values, which are never fewer than the finished ones.
        let (stored, kept) = (rows * channels, (end - first) * values_per);
        let (plan, peaks) = (self.plan.clone(), self.peaks[index].clone());
        let finish_chunk = move |mut values: Vec<f32>| {
            let finish = &plan.features[index].finish;
            let frames = values.len() / stored;
            let mut raw = vec![0.0; stored];
            let mut finished = vec![0.0; all * values_per];
            for t in 0..frames {
                raw.copy_from_slice(&values[t * stored..(t + 1) * stored]);
                let out = &mut values[t * kept..(t + 1) * kept];
                match finish {
                    Some(finish) if end - first == all => finish.frame(&raw, &peaks, channels, out),
                    Some(finish) => {
                        finish.frame(&raw, &peaks, channels, &mut finished);
                        out.copy_from_slice(&finished[first * values_per..end * values_per]);
                    }
                    None => out.copy_from_slice(&raw[first * values_per..end * values_per]),
                }
            }
            values.truncate(frames * kept);
            if kept < stored {
                // Chunks wait in memory by their length: what they no longer need goes back.
                values.shrink_to_fit();
            }
            values
        };
        store.finish(Finish { per_frame: (stored, kept), of: Box::new(finish_chunk) })
    }

    /// The kept coefficients of what is computed of finished frames in their order of time; `of`
    /// is the name of the feature that has made them.
    fn in_time(
        &self,
        finished: &mut Store,
        of: &str,
        planned: &PlannedFeature,
        derived: &dyn Derived,
    ) -> Result<Store, FinishError> {
        let channels = self.plan.channels;
        let mut state = derived.start(FrameShape { coefficients: planned.finished, channels });
        let (all, [first, end]) = (planned.coefficients, planned.kept);
        let mut out = Store::new(&self.folder);
        let mut keep = |mut values: Vec<f32>| {
            if end - first < all {
                let frames = values.len() / (all * channels);
                let kept = (end - first) * channels;
                for t in 0..frames {
                    let from = (t * all + first) * channels;
                    values.copy_within(from..from + kept, t * kept);
                }
                values.truncate(frames * kept);
            }
            out.push(values)
        };
        finished.chunks(|chunk| {
            let mut values = Vec::new();
            state.push(chunk, &mut values);
            keep(values)
        })?;
        let mut rest = Vec::new();
        state.finish(&mut rest).map_err(|TooFewFrames { frames, needed }| {
            let (feature, of) = (planned.name.clone(), of.to_string());
            FinishError::TooFewFrames { feature, of, frames, needed }
        })?;
        keep(rest)?;
        Ok(out)
    }
}

/// Raises `peaks [channels]` to the maxima of the values `range` of every frame of `width` values.
fn raise_peaks(values: &[f32], width: usize, range: std::ops::Range<usize>, peaks: &mut [f32]) {
    const LANES: usize = 16;
    let channels = peaks.len();
    corsmal_dsp::simd::vectorized(
        #[inline(always)]
        || {
            let mut lanes = [f32::NEG_INFINITY; LANES];
            for frame in values.chunks_exact(width) {
                let frame = &frame[range.clone()];
                if LANES.is_multiple_of(channels) {
                    let (blocks, rest) = frame.as_chunks::<LANES>();
                    for block in blocks {
                        for (lane, x) in lanes.iter_mut().zip(block) {
                            *lane = if *x > *lane { *x } else { *lane };
                        }
                    }
                    for (i, x) in rest.iter().enumerate() {
                        peaks[i % channels] = peaks[i % channels].max(*x);
                    }
                } else {
                    for (i, x) in frame.iter().enumerate() {
                        peaks[i % channels] = peaks[i % channels].max(*x);
                    }
                }
            }
            if LANES.is_multiple_of(channels) {
                for (i, x) in lanes.iter().enumerate() {
                    peaks[i % channels] = peaks[i % channels].max(*x);
                }
            }
        },
    );
}
