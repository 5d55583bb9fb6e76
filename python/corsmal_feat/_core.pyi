"""The extension module; private: use the functions of `corsmal_feat`."""

import os
from collections.abc import Callable
from typing import Any, final

import numpy as np
import numpy.typing as npt

from ._arrays import Complexes, Floats
from ._params import (
    ChromaParams,
    CqtChromaParams,
    CqtParams,
    FrameParams,
    HpssParams,
    MelParams,
    PaaFrames,
    PcenParams,
    PeakParams,
    PitchParams,
    StftParams,
    WindowSpec,
)

__all__ = [
    "Network",
    "Recording",
    "Recordings",
    "Signal",
    "Signals",
    "TrainedModel",
    "TrainedNetwork",
    "__version__",
    "a34_short",
    "a34f136",
    "af193",
    "all_finite",
    "apply_mel",
    "check_parquet",
    "chroma",
    "chroma_cqt",
    "chroma_filter",
    "chroma_of_cqt",
    "classifier_inputs",
    "classifier_parameters",
    "collect",
    "compare_predictions",
    "cqt",
    "cross_validate",
    "cross_validate_network",
    "cuboid",
    "delta",
    "detrend",
    "effective_config",
    "embed_recordings",
    "estimate_tuning",
    "evaluate",
    "extract",
    "fetch",
    "fft_frequencies",
    "fit_projection",
    "fuse",
    "get_window",
    "hear_recordings",
    "hpss_masks",
    "in_python",
    "is_statistic",
    "is_stored",
    "istft",
    "jobs",
    "lengths",
    "load_calibration",
    "load_depth",
    "load_mask",
    "lode",
    "m1_stft",
    "m2_capacity",
    "m2_mfcc",
    "m3_spectrogram",
    "m4_logmel",
    "m4_windows",
    "m5_a34f136",
    "m5_vggish_patches",
    "m6_spectrogram",
    "mel",
    "melspectrogram",
    "mfcc",
    "network_recipe",
    "networks_published",
    "onset_backtrack",
    "onset_detect",
    "onset_rises",
    "onset_strength",
    "paa_fbank",
    "pca_fit",
    "pca_project",
    "pcen",
    "piptrack",
    "pitch_tuning",
    "poly_features",
    "power_to_db",
    "read_weights",
    "region",
    "require_store",
    "resample",
    "rms",
    "rms_of_spectrogram",
    "score",
    "separate",
    "shown",
    "sk_resize",
    "spec9216",
    "spectral_bandwidth",
    "spectral_centroid",
    "spectral_contrast",
    "spectral_flatness",
    "spectral_rolloff",
    "spectrogram",
    "stft",
    "times_refusal",
    "to_mono",
    "tonnetz",
    "train_network",
    "upright_box",
    "write_weights",
    "zero_crossing_rate",
]

_Singles = npt.NDArray[np.float32]
_Doubles = npt.NDArray[np.float64]
_Source = Floats | tuple[Floats, StftParams]

__version__: str

def get_window(window: WindowSpec, nx: int, fftbins: bool) -> _Doubles: ...
def all_finite(array: Floats) -> bool: ...
def in_python(message: str) -> str: ...
def is_statistic(column: str) -> bool: ...
def jobs() -> int: ...
def stft(y: Floats, params: StftParams) -> Complexes: ...
def spectrogram(y: Floats, params: StftParams, power: float) -> Floats: ...
def mel(params: MelParams) -> tuple[npt.NDArray[np.float32], bool]: ...
def apply_mel(s: Floats, params: MelParams) -> tuple[Floats, bool]: ...
def melspectrogram(
    y: Floats, stft: StftParams, power: float, params: MelParams
) -> tuple[Floats, bool]: ...
def power_to_db(s: Floats, reference: float, amin: float, top_db: float | None) -> Floats: ...
def mfcc(log_mel: Floats, n_mfcc: int, dct_type: int, ortho: bool, lifter: float) -> Floats: ...
def delta(data: Floats, width: int, order: int, mode: str) -> Floats: ...
def zero_crossing_rate(
    y: Floats, frame: FrameParams, threshold: float, zero_pos: bool, pad: bool
) -> _Doubles: ...
def rms(y: Floats, frame: FrameParams, padding: str) -> _Singles: ...
def rms_of_spectrogram(s: Floats, frame_length: int) -> _Singles: ...
def resample(
    y: Floats, orig_sr: float, target_sr: float, res_type: str, fix: bool, scale: bool
) -> Floats: ...
def fft_frequencies(sr: float, n_fft: int) -> _Doubles: ...
def to_mono(y: Floats) -> Floats: ...
def spectral_centroid(s: _Source, freq: _Doubles) -> _Doubles: ...
def spectral_bandwidth(
    s: _Source, freq: _Doubles, centroid: _Doubles | None, norm: bool, p: float
) -> _Doubles: ...
def spectral_rolloff(s: _Source, freq: _Doubles, roll_percent: float) -> _Doubles: ...
def spectral_flatness(s: _Source, amin: float, power: float) -> Floats: ...
def spectral_contrast(
    s: _Source,
    freq: _Doubles,
    sr: float,
    fmin: float,
    n_bands: int,
    quantile: float,
    linear: bool,
) -> tuple[_Doubles, bool]: ...
def poly_features(s: _Source, freq: _Doubles, order: int) -> tuple[_Doubles, bool]: ...
def piptrack(s: Floats, reference: Floats | None, params: PitchParams) -> tuple[Floats, Floats]: ...
def estimate_tuning(
    s: Floats,
    reference: Floats | None,
    params: PitchParams,
    resolution: float,
    bins_per_octave: int,
) -> float | None: ...
def pitch_tuning(frequencies: Floats, resolution: float, bins_per_octave: int) -> float | None: ...
def chroma_filter(params: ChromaParams) -> _Doubles: ...
def chroma(s: Floats, params: ChromaParams, norm: float | None, double_bank: bool) -> Floats: ...
def onset_strength(
    s: Floats, reference: Floats | None, lag: int, max_size: int, center: int | None
) -> Floats: ...
def onset_rises(s: Floats, reference: Floats | None, lag: int, max_size: int) -> Floats: ...
def detrend(envelope: Floats) -> _Doubles: ...
def onset_detect(
    envelope: Floats, sr: float, hop_length: int, normalize: bool, peaks: PeakParams
) -> list[list[int]]: ...
def pcen(
    s: Floats, reference: Floats | None, zi: _Doubles | None, keys: PcenParams
) -> tuple[_Doubles, _Doubles]: ...
def onset_backtrack(events: list[int], energy: Floats) -> list[int]: ...
def istft(
    spectrogram: npt.NDArray[np.complex64] | npt.NDArray[np.complex128],
    params: StftParams,
    length: int | None,
) -> Floats: ...
def hpss_masks(s: Floats, params: HpssParams) -> tuple[Floats, Floats]: ...
def separate(
    y: Floats,
    stft: StftParams,
    params: HpssParams,
    mask: bool,
    harmonic: bool,
    percussive: bool,
) -> list[Floats]: ...
def cqt(y: Floats, params: CqtParams) -> Complexes: ...
def chroma_cqt(y: Floats, cqt: CqtParams, chroma: CqtChromaParams) -> Floats: ...
def chroma_of_cqt(c: Floats, chroma: CqtChromaParams) -> Floats: ...
def tonnetz(chroma: Floats) -> Floats: ...
def af193(y: _Singles, sr: float, librosa: str) -> _Singles: ...
def paa_fbank(sr: float, num_fft: int) -> _Doubles: ...
def a34_short(y: _Doubles, sr: float, window: int, step: int, deltas: bool) -> _Doubles: ...
def a34f136(y: _Doubles, sr: float, frames: PaaFrames) -> _Doubles: ...
def sk_resize(
    image: Floats, rows: int, columns: int, mode: str, anti_aliasing: bool | None
) -> Floats: ...
def pca_fit(x: _Doubles, n_components: int) -> list[_Doubles]: ...
def pca_project(
    x: _Doubles, components: _Doubles, mean: list[float], variance: list[float] | None
) -> _Doubles: ...
def spec9216(y: Floats, fixed_len: int | None, librosa: str) -> Floats: ...
def m1_stft(y: _Singles, n_fft: int, hop_length: int) -> _Singles: ...
def m2_mfcc(y: _Singles, sr: float, padded: bool, librosa: str) -> _Singles: ...
def m3_spectrogram(y: _Singles, sr: float, n_fft: int, hop_length: int) -> _Singles: ...
def m4_logmel(y: _Singles, sr: float, variant: str) -> _Singles: ...
def m4_windows(features: _Singles) -> _Singles: ...
def m5_a34f136(y: _Singles, sr: float) -> _Doubles: ...
def m5_vggish_patches(y: _Singles, sr: float, converter: str) -> _Singles: ...
def m6_spectrogram(y: _Singles, sr: float, start: float | None, librosa: str) -> _Singles: ...
def evaluate(
    submission: str | os.PathLike[str],
    annotations: str | os.PathLike[str],
    rules: str,
    baseline: str | os.PathLike[str] | None,
    seed: int | None,
    containers: list[int] | None,
) -> tuple[list[tuple[str, float]], int, list[str]]: ...
def effective_config(config: tuple[str, str], overrides: list[str]) -> tuple[str, str]: ...
def fit_projection(
    features: str | os.PathLike[str], n_components: int | None, out: str | os.PathLike[str]
) -> None: ...
def extract(
    paths: list[str],
    config: tuple[str, str],
    overrides: list[str],
    window: tuple[float, float] | None,
    places: tuple[str, str | None, str | None],
    jobs: int | None,
    resume: bool,
    overwrite: bool,
    progress: Callable[[int, int], object] | None,
) -> list[str]: ...

@final
class Recordings:
    def __new__(cls, config: tuple[str, str], overrides: list[str]) -> Recordings: ...
    def extract(
        self, rows: list[Any], channels: int | None, jobs: int
    ) -> tuple[str, list[str], _Singles, list[list[_Singles] | None]]: ...
    def usual_channels(self, rows: list[Any]) -> int | None: ...
    def piece_refusal(self) -> str | None: ...

_Place = tuple[str, int, int, str | None]

def collect(
    paths: list[str],
) -> tuple[
    list[tuple[str, str, _Place | None, float | None, float | None, list[tuple[str, str]]]],
    str | None,
]: ...
def is_stored(name: str) -> bool: ...
def lengths(rows: list[Any]) -> list[tuple[int, int] | None]: ...
def require_store(name: str) -> None: ...
def shown(name: str) -> str: ...
def times_refusal(given: tuple[bool, bool, bool], names: list[str]) -> str | None: ...
def fetch(name: str, to: str | os.PathLike[str]) -> None: ...
def check_parquet(path: str) -> None: ...

@final
class Recording:
    @staticmethod
    def open(path: str | os.PathLike[str]) -> Recording: ...
    @staticmethod
    def from_bytes(bytes: bytes) -> Recording: ...
    @property
    def sample_rate(self) -> int: ...
    @property
    def channels(self) -> int: ...
    def confirmed_frames(self) -> int | None: ...
    @property
    def repairs(self) -> list[str]: ...
    def skip(self, frames: int) -> None: ...
    def read(self, frames: int | None = None) -> _Singles: ...
    def count(self) -> int: ...

@final
class Signals:
    def __new__(cls, config: tuple[str, str], overrides: list[str]) -> Signals: ...
    def start(self, sample_rate: int, channels: int) -> Signal: ...

@final
class Signal:
    def push(self, block: _Singles) -> None: ...
    def summary_names(self) -> list[str]: ...
    def finish(self) -> tuple[_Singles | None, list[tuple[str, bool, _Singles]]]: ...

@final
class TrainedModel:
    @staticmethod
    def fit(
        pipeline: str,
        x: npt.NDArray[np.float64],
        y: list[int],
        labels: list[str],
        target: str,
        feature_names: list[str],
        provenance: str,
        weights: list[float] | None,
    ) -> TrainedModel: ...
    def predict(self, x: npt.NDArray[np.float64]) -> npt.NDArray[np.int64]: ...
    def predict_proba(self, x: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]: ...
    def decision_function(self, x: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]: ...
    def neighbours(
        self, x: npt.NDArray[np.float64] | None, k: int
    ) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.int64]]: ...
    def feature_importances(self) -> npt.NDArray[np.float64] | None: ...
    def out_of_bag(self) -> npt.NDArray[np.float64] | None: ...
    def header(self) -> str: ...
    def n_features(self) -> int: ...
    def to_bytes(self) -> bytes: ...
    @staticmethod
    def from_bytes(bytes: bytes) -> TrainedModel: ...
    def save(self, path: str, features: str | None) -> None: ...
    def format_rule(self) -> tuple[list[int] | None, list[int] | None]: ...
    def length_warning(self, recordings: list[tuple[str, float]]) -> str | None: ...
    @staticmethod
    def load(path: str | os.PathLike[str]) -> TrainedModel: ...

def classifier_parameters(name: str, parameters: str) -> str: ...
def cross_validate(
    features: str,
    target: str,
    labels: dict[str, str | None],
    groups: str | None,
    cv: str | None,
    recipe: dict[str, Any],
) -> tuple[str, str]: ...
def fuse(
    paths: list[str],
    weights: list[float] | None,
    vote: str | None,
    background: str | None,
    least: int,
) -> tuple[str, list[str]]: ...
def compare_predictions(
    first: str, second: str, target: str | None, groups: str | None, resamples: int, seed: int
) -> str: ...
def score(
    predictions: str,
    labels: dict[str, str | None],
    target: str | None,
    groups: str | None,
    reject: float,
    numeric: bool,
    resamples: int,
    seed: int,
) -> str: ...
def load_calibration(path: str) -> list[tuple[str, list[float]]]: ...
def load_mask(path: str) -> npt.NDArray[np.bool_]: ...
def load_depth(path: str) -> npt.NDArray[np.uint16]: ...
def lode(
    masks: tuple[npt.NDArray[np.bool_], npt.NDArray[np.bool_]],
    cameras: tuple[list[float], list[float]],
    published: bool,
) -> tuple[
    float, float, float, float | None, float | None, list[list[float]], list[float], float
]: ...
def cuboid(
    depth_mm: npt.NDArray[np.uint16],
    pixels: npt.NDArray[np.bool_],
    numbers: list[float],
    outliers: str,
    seed: int,
) -> tuple[list[float], list[float], float, float, int]: ...
def upright_box(
    views: list[tuple[npt.NDArray[np.uint16], npt.NDArray[np.bool_], list[float]]],
) -> tuple[list[float], float, int]: ...
def region(
    depth_mm: npt.NDArray[np.uint16],
) -> tuple[tuple[int, int, int, int], npt.NDArray[np.float32], tuple[float, float]] | None: ...
def m2_capacity(
    image: npt.NDArray[np.float32], size: tuple[float, float], weights: str
) -> float: ...

@final
class Network:
    @staticmethod
    def build(name: str, outputs: int | None, seed: int) -> Network: ...
    def name(self) -> str: ...
    def num_parameters(self) -> int: ...
    def layers(self) -> list[tuple[str, str]]: ...
    def inputs(self) -> list[tuple[str, str]]: ...
    def outputs(self) -> int: ...
    def state(self) -> dict[str, _Singles]: ...
    def load_state(self, state: list[tuple[str, _Singles]]) -> None: ...
    def forward(self, arrays: list[_Singles], lengths: list[int] | None) -> _Singles: ...
    def features(self, arrays: list[_Singles]) -> _Singles: ...
    def train_steps(
        self,
        arrays: list[_Singles],
        classes: list[int] | None,
        numbers: list[float] | None,
        steps: int,
        recipe: str,
        dropout: int | None,
        lengths: list[int] | None,
    ) -> tuple[list[float], dict[str, float]]: ...

def networks_published() -> list[tuple[str, str]]: ...
def classifier_inputs(name: str) -> list[tuple[str, str]]: ...
def network_recipe(name: str, changes: str) -> str: ...
def read_weights(path: str | os.PathLike[str]) -> dict[str, _Singles]: ...
def write_weights(path: str | os.PathLike[str], state: list[tuple[str, _Singles]]) -> None: ...
def train_network(
    name: str,
    rows: list[tuple[str, str, str | None]],
    kind: str,
    recipe: str,
    checkpoints: str | None,
    progress: Any,
    jobs: int | None,
) -> tuple[TrainedNetwork, list[str], list[tuple[str, str]]]: ...
def cross_validate_network(
    name: str,
    rows: list[tuple[str, str, str | None]],
    recipe: str,
    cv: str | None,
    seed: int,
    checkpoints: str | None,
    progress: Any,
    jobs: int | None,
) -> tuple[str, str, list[str], list[tuple[str, str]]]: ...
def hear_recordings(
    network: TrainedNetwork,
    paths: list[str],
    any_rate: bool,
    jobs: int | None,
) -> tuple[npt.NDArray[np.float64], list[tuple[str, str]], str | None]: ...
def embed_recordings(
    name: str,
    paths: list[str],
    weights: str,
    jobs: int | None,
) -> tuple[list[tuple[str, _Singles]], list[tuple[str, str]]]: ...

@final
class TrainedNetwork:
    @staticmethod
    def fit(
        name: str,
        columns: list[tuple[_Singles, list[int]]],
        classes: list[int],
        train: list[int],
        watched: list[int],
        labels: list[str],
        recipe: str,
        checkpoint: str | None,
        provenance: str,
        progress: Any,
    ) -> TrainedNetwork: ...
    def predict_proba(
        self, columns: list[tuple[_Singles, list[int]]]
    ) -> npt.NDArray[np.float64]: ...
    def header(self) -> str: ...
    def state(self) -> dict[str, _Singles]: ...
    def to_bytes(self) -> bytes: ...
    @staticmethod
    def from_bytes(bytes: bytes) -> TrainedNetwork: ...
    def save(self, path: str | os.PathLike[str]) -> None: ...
    @staticmethod
    def load(path: str | os.PathLike[str]) -> TrainedNetwork: ...
