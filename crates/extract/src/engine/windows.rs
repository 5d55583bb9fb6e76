//! A recording or an endless stream cut into windows, each computed as a recording of its own.

use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use corsmal_audio::BlockSource;

use super::failed::Failed;
use super::reading::{self, Part};
use super::recording::Features;
use super::signal::{SignalError, Signals};
use super::watch::Watch;
use crate::inputs::Input;
use corsmal_files::outcome::Status;

/// Frames read at a time.
const BLOCK: u64 = 1 << 14;
/// Shortest and longest window or hop in seconds; what a window covers is held in memory.
const SECONDS: std::ops::RangeInclusive<f64> = 0.01..=600.0;

/// Length of windows and distance from one to the next, in seconds.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Windowing {
    window: f64,
    hop: f64,
}

impl Windowing {
    /// `None` unless both are 0.01 to 600 seconds.
    pub fn new(window: f64, hop: f64) -> Option<Self> {
        (SECONDS.contains(&window) && SECONDS.contains(&hop)).then_some(Self { window, hop })
    }

    /// Seconds of a window.
    pub fn window(self) -> f64 {
        self.window
    }
}

/// A window and its features.
pub struct Window {
    /// Where it begins, in seconds of the recording.
    pub start: f64,
    /// Where it ends.
    pub end: f64,
    /// Why samples of it are missing.
    pub loss: Option<String>,
    /// What a recording of these samples alone has.
    pub features: Result<Features, SignalError>,
}

/// The windows of a recording, each as soon as its last sample is there. Only the samples of one
/// window are held.
///
/// Windows begin at multiples of the hop and are whole: what remains at the end is left out, but a
/// recording shorter than a window is one window. Window and hop are whole numbers of frames, rounded
/// once. The samples of a window are those of an input with
/// its start and end. A failure to read, or a file that changed meanwhile, is the last item.
pub struct Windows<'a> {
    source: Box<dyn BlockSource>,
    watch: Watch,
    signals: &'a Signals,
    /// Frames of a window, and from one to the next.
    window: u64,
    hop: u64,
    /// Where the input begins, in seconds, if it is a stretch.
    start: Option<f64>,
    /// Frames of the recording where the first window begins and where the input ends.
    base: u64,
    limit: u64,
    /// Interleaved samples from frame `first` on.
    held: Vec<f32>,
    first: u64,
    number: u64,
    ended: bool,
}

impl<'a> Windows<'a> {
    /// Opens an input. A stream on standard input fails once `stop` is set, also while nothing
    /// comes.
    ///
    /// # Errors
    /// What is wrong with it.
    pub fn open(
        input: &Input,
        signals: &'a Signals,
        windowing: Windowing,
        stop: &Arc<AtomicBool>,
    ) -> Result<Self, SignalError> {
        let watch = Watch::begin(input);
        let source = watch.settle(reading::open(input, &watch, Part::Whole, stop))?;
        let rate = source.spec().sample_rate;
        let frames = |seconds: f64| ((seconds * f64::from(rate)).round() as u64).max(1);
        Ok(Self {
            source,
            watch,
            signals,
            window: frames(windowing.window),
            hop: frames(windowing.hop),
            start: input.start,
            base: input.start.map_or(0, |start| reading::frame_at(start, rate)),
            limit: input.end.map_or(u64::MAX, |end| reading::frame_at(end, rate)),
            held: Vec::new(),
            first: 0,
            number: 0,
            ended: false,
        })
    }

    /// Why samples of the recording are missing; known once all windows are there.
    pub fn loss(&self) -> Option<String> {
        let stretch = self.base..self.limit;
        self.source.health().loss_in(&stretch).map(|loss| loss.to_string())
    }

    /// Sample rate in Hz and channels of the recording.
    pub fn format(&self) -> (u32, u32) {
        let spec = self.source.spec();
        (spec.sample_rate, u32::from(spec.channels))
    }

    fn channels(&self) -> usize {
        usize::from(self.source.spec().channels)
    }

    /// First frame that is not there yet.
    fn reached(&self) -> u64 {
        self.first + (self.held.len() / self.channels()) as u64
    }

    /// Reads at most `frames` frames; whether there were any.
    fn read(&mut self, frames: u64) -> Result<bool, Failed> {
        let (channels, before) = (self.channels(), self.held.len());
        self.held.resize(before + frames.min(BLOCK) as usize * channels, 0.0);
        let read = self.source.read(&mut self.held[before..]);
        self.held.truncate(before + read.as_ref().map_or(0, |n| n * channels));
        Ok(read? > 0)
    }

    /// Drops what lies before a frame.
    fn forget(&mut self, frame: u64) -> Result<(), Failed> {
        loop {
            let dropped = self.reached().min(frame) - self.first;
            self.held.drain(..dropped as usize * self.channels());
            self.first += dropped;
            if self.first >= frame || !self.read(frame - self.first)? {
                return Ok(());
            }
        }
    }

    fn cut(&mut self) -> Result<Option<Window>, Failed> {
        let spec = self.source.spec();
        let (sample_rate, channels) = (spec.sample_rate, spec.channels);
        let start = self.base + self.number * self.hop;
        let end = start + self.window;
        self.forget(start)?;
        let wanted = end.min(self.limit);
        while self.reached() < wanted && self.read(wanted - self.reached())? {}
        if self.held.is_empty() && self.number == 0 {
            let reason = match self.start.filter(|_| self.base > 0) {
                _ if self.base >= self.limit => reading::no_frame(sample_rate),
                None => "no samples".into(),
                Some(start) => reading::behind_the_end(start),
            };
            return Err(Failed::new(Status::Empty, reason));
        }
        if self.reached() < end && self.number > 0 {
            return Ok(None);
        }
        self.number += 1;
        let frames = wanted.min(self.reached()).saturating_sub(self.first) as usize;
        let samples = &self.held[..frames * usize::from(channels)];
        let features = self.signals.start(sample_rate, channels).and_then(|signal| {
            let mut signal = signal.within(self.first);
            signal.push(samples)?;
            signal.finish()
        });
        let seconds = |frame: u64| frame as f64 / f64::from(sample_rate);
        let loss = self.source.health().loss_in(&(self.first..wanted)).map(|loss| loss.to_string());
        let (start, end) = (seconds(self.first), seconds(self.first + frames as u64));
        Ok(Some(Window { start, end, loss, features }))
    }
}

impl Iterator for Windows<'_> {
    type Item = Result<Window, SignalError>;

    fn next(&mut self) -> Option<Self::Item> {
        if self.ended {
            return None;
        }
        let item = match self.cut() {
            Ok(Some(window)) => Ok(Some(window)),
            // The end, or a failure that a change of the file explains.
            end => self.watch.settle(end),
        };
        let item = item.map_err(SignalError::from).transpose();
        self.ended = !matches!(item, Some(Ok(_)));
        item
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::Config;
    use crate::inputs::InputSource;

    fn go_on() -> Arc<AtomicBool> {
        Arc::new(AtomicBool::new(false))
    }

    fn input(path: &std::path::Path, span: (Option<f64>, Option<f64>)) -> Input {
        let source = InputSource::File(path.into());
        Input { id: "x".into(), source, start: span.0, end: span.1, labels: Vec::new() }
    }

    /// Two channels of noise at 8 kHz.
    fn recording(folder: &std::path::Path, frames: u32) -> std::path::PathBuf {
        recording_at(8000, folder, frames)
    }

    fn recording_at(rate: u32, folder: &std::path::Path, frames: u32) -> std::path::PathBuf {
        let path = folder.join(format!("{frames}.wav"));
        let spec = hound::WavSpec {
            channels: 2,
            sample_rate: rate,
            bits_per_sample: 16,
            sample_format: hound::SampleFormat::Int,
        };
        let mut writer = hound::WavWriter::create(&path, spec).unwrap();
        for i in 0..2 * frames {
            writer.write_sample((i.wrapping_mul(2_654_435_761) >> 17) as i16).unwrap();
        }
        writer.finalize().unwrap();
        path
    }

    fn spans(path: &std::path::Path, span: (Option<f64>, Option<f64>)) -> Vec<(f64, f64)> {
        let signals = Signals::new(Arc::new(Config::preset("esc26").unwrap()));
        let windowing = Windowing::new(1.0, 0.25).unwrap();
        let windows = Windows::open(&input(path, span), &signals, windowing, &go_on()).unwrap();
        windows.map(|w| w.map(|w| (w.start, w.end)).unwrap()).collect()
    }

    #[test]
    fn windows_are_whole_and_a_short_recording_is_one() {
        let folder = tempfile::tempdir().unwrap();
        let long = recording(folder.path(), 12_100);
        assert_eq!(spans(&long, (None, None)), [(0.0, 1.0), (0.25, 1.25), (0.5, 1.5)]);
        assert_eq!(spans(&long, (Some(0.2), Some(1.3))), [(0.2, 1.2)]);
        assert_eq!(spans(&long, (Some(0.5), Some(0.75))), [(0.5, 0.75)]);
        let short = recording(folder.path(), 4000);
        assert_eq!(spans(&short, (None, None)), [(0.0, 0.5)]);
    }

    /// Times that binary fractions cannot hold, cut by truncation, gave 44,099 frames here and there.
    #[test]
    fn windows_are_equally_long_and_their_times_name_their_frames() {
        let folder = tempfile::tempdir().unwrap();
        let path = recording_at(44_100, folder.path(), 5 * 44_100);
        let signals = Signals::new(Arc::new(Config::preset("esc26").unwrap()));
        let windowing = Windowing::new(1.0, 0.1).unwrap();
        let all = Windows::open(&input(&path, (None, None)), &signals, windowing, &go_on());
        let crop = |start: f64, end: f64| {
            reading::crop(&Default::default(), (Some(start), Some(end)), 44_100)
        };
        let mut number = 0;
        for window in all.unwrap() {
            let window = window.unwrap();
            let expected = number * 4410..number * 4410 + 44_100;
            assert_eq!(crop(window.start, window.end), expected);
            // As they are printed.
            let printed = |seconds: f64| format!("{seconds:.9}").parse().unwrap();
            assert_eq!(crop(printed(window.start), printed(window.end)), expected);
            number += 1;
        }
        assert_eq!(number, 41);
        // A third of a second is not a whole number of nanoseconds.
        for frame in [14_700, 14_701, 123_457] {
            let seconds: f64 = format!("{:.9}", f64::from(frame) / 44_100.0).parse().unwrap();
            assert_eq!(reading::frame_at(seconds, 44_100), frame as u64);
        }
    }

    #[test]
    fn a_window_has_the_features_of_its_samples_alone() {
        let folder = tempfile::tempdir().unwrap();
        let path = recording(folder.path(), 12_100);
        let signals = Signals::new(Arc::new(Config::preset("esc26").unwrap()));
        let windows = |hop, span| {
            let windowing = Windowing::new(1.0, hop).unwrap();
            let windows =
                Windows::open(&input(&path, span), &signals, windowing, &go_on()).unwrap();
            windows.map(|w| match w.unwrap().features.unwrap() {
                Features::Summary(row) => row,
                Features::Frames(_) => panic!("a summary was configured"),
            })
        };
        let all: Vec<_> = windows(0.25, (None, None)).collect();
        for (number, row) in all.iter().enumerate() {
            let start = number as f64 * 0.25;
            let alone: Vec<_> = windows(9.0, (Some(start), Some(start + 1.0))).collect();
            assert_eq!(alone, std::slice::from_ref(row));
        }
        assert_ne!(all[0], all[1]);
    }

    #[test]
    fn what_cannot_be_read_is_the_last_item() {
        let folder = tempfile::tempdir().unwrap();
        let signals = Signals::new(Arc::new(Config::preset("esc26").unwrap()));
        let empty = recording(folder.path(), 0);
        let windowing = Windowing::new(1.0, 1.0).unwrap();
        let mut windows =
            Windows::open(&input(&empty, (None, None)), &signals, windowing, &go_on()).unwrap();
        assert_eq!(windows.next().unwrap().err().unwrap().status, Status::Empty);
        assert!(windows.next().is_none());
        let short = recording(folder.path(), 8000);
        let odd = recording_at(11_025, folder.path(), 11_025);
        for (path, span, reason) in [
            (&empty, (None, None), "no samples"),
            (&short, (Some(1.3), None), "the stretch begins at 1.3 s, after the end"),
            (&odd, (Some(1.1), None), "the stretch begins at 1.1 s, after the end"),
            (&short, (Some(0.5), Some(0.5)), "the stretch has no frame at 8000 Hz"),
        ] {
            let mut windows =
                Windows::open(&input(path, span), &signals, windowing, &go_on()).unwrap();
            let found = windows.next().unwrap().err().unwrap();
            assert!(found.reason.starts_with(reason), "{}", found.reason);
        }
        let absent = input(&folder.path().join("absent.wav"), (None, None));
        assert!(Windows::open(&absent, &signals, windowing, &go_on()).is_err());
        assert!(Windowing::new(0.0, 1.0).is_none() && Windowing::new(1.0, f64::NAN).is_none());
    }
}
