"""Recordings as arrays (librosa.load, librosa.stream, librosa.get_duration)."""

from __future__ import annotations

import os
from collections.abc import Iterator
from typing import Any, BinaryIO

import numpy as np
import numpy.typing as npt

from . import _core
from ._arrays import Floats, number, precision, size
from ._mono import to_mono
from ._refusals import existing, refuses
from ._resample import resample
from ._warnings import warn
from .errors import DecodeError, ParameterError

Source = str | os.PathLike[str] | BinaryIO


def _open(path: Source) -> _core.Recording:
    if isinstance(path, (str, os.PathLike)):
        existing(path)
        try:
            return _core.Recording.open(path)
        except DecodeError as error:
            name = os.fspath(path)
            hint = ""
            if name.lower().endswith((".npz", ".parquet")):
                hint = "; corsmal_feat.load_features reads the output of a run"
            raise DecodeError(f"{name}: {error}{hint}") from error
    if hasattr(path, "read"):
        content = path.read()
        if isinstance(content, bytes):
            return _core.Recording.from_bytes(content)
    raise ParameterError(f"path must be a path or a file opened in binary mode, not {path!r}")


def _seconds(name: str, value: float, rate: int) -> int:
    """Seconds as frames, cut as librosa does."""
    if not 0 <= value * rate <= 2**53:
        raise ParameterError(f"{name} must be at least 0 seconds, not {value}")
    return int(value * rate)


def _tell(recording: _core.Recording, path: Source) -> None:
    for repair in recording.repairs:
        warn(f"{path}: {repair}")


@refuses
def load(
    path: Source,
    *,
    sr: float | None = 22050,
    mono: bool = True,
    offset: float = 0.0,
    duration: float | None = None,
    dtype: npt.DTypeLike = np.float32,
    res_type: str = "soxr_hq",
) -> tuple[Floats, float]:
    """Reads a recording (librosa.load): WAV, FLAC, Ogg, MP3 and others, recognised by content.

    Parameters
    ----------
    path : path, or binary file
        The recording.
    sr : float, optional
        Sample rate in Hz to resample to; None keeps that of the file.
    mono : bool
        Whether to average the channels.
    offset, duration : float
        Start and length in seconds of the part to read; without `duration`, up to the end.
    dtype : float32 or float64
        Type of the samples, which are decoded in single precision.
    res_type : str
        See `resample`.

    Returns
    -------
    samples [shape=(n,) or (channels, n)] in -1..1, and their rate

    Examples
    --------
    >>> y, sr = corsmal_feat.load("recording.wav")
    >>> y.shape, sr
    ((22050,), 22050)
    """
    kind = precision(dtype)
    recording = _open(path)
    rate = recording.sample_rate
    start = _seconds("offset", offset, rate)
    frames = None if duration is None else _seconds("duration", duration, rate)
    if start:
        recording.skip(start)
    samples = recording.read(frames)
    if not len(samples) and frames != 0:
        what = f"has no samples at offset = {offset} s or later" if start else "has no samples"
        raise DecodeError(f"{path} {what}")
    _tell(recording, path)
    y: Floats = samples[:, 0] if samples.shape[1] == 1 else samples.T
    y = y.astype(kind, copy=False)
    if mono and y.ndim > 1:
        y = to_mono(y)
    if sr is None:
        return y, rate
    return (resample(y, orig_sr=rate, target_sr=sr, res_type=res_type) if y.size else y), sr


@refuses
def stream(
    path: Source,
    *,
    block_length: int,
    frame_length: int,
    hop_length: int,
    mono: bool = True,
    offset: float = 0.0,
    duration: float | None = None,
    fill_value: float | None = None,
    dtype: npt.DTypeLike = np.float32,
) -> Iterator[Floats]:
    """Blocks of a recording at its own sample rate, for frames that are not centred
    (librosa.stream).

    Parameters
    ----------
    path : path, or binary file
        The recording.
    block_length : int
        Frames per block.
    frame_length, hop_length : int
        Samples per frame, and from one frame to the next (at most `frame_length`).
    mono, offset, duration, dtype
        See `load`.
    fill_value : float, optional
        Value to pad the last block with; without it, the last block is shorter.

    Yields
    ------
    samples [shape=(n,) or (channels, n)]; each block begins with the end of the previous one

    Examples
    --------
    >>> blocks = corsmal_feat.stream(
    ...     "recording.wav", block_length=32, frame_length=2048, hop_length=512
    ... )
    >>> for y in blocks:
    ...     print(y.shape, corsmal_feat.feature.rms(y=y, center=False).shape)
    (17920,) (1, 32)
    (17920,) (1, 32)
    (11332,) (1, 19)
    """
    sizes = {"block_length": block_length, "frame_length": frame_length, "hop_length": hop_length}
    for name, value in sizes.items():
        if not isinstance(value, (int, np.integer)) or value < 1:
            raise ParameterError(f"{name} must be a whole number of at least 1, not {value!r}")
        size(name, value)
    if fill_value is not None:
        number("fill_value", fill_value)
    if hop_length > frame_length:
        raise ParameterError(
            f"hop_length must be at most frame_length ({frame_length}), not {hop_length}"
        )
    kind = precision(dtype)
    recording = _open(path)
    rate = recording.sample_rate
    start = _seconds("offset", offset, rate)
    left = _seconds("duration", duration, rate) if duration else None
    if start:
        recording.skip(start)
    wanted = frame_length + (block_length - 1) * hop_length
    overlap = frame_length - hop_length
    blocks = _blocks(recording, wanted, overlap, left, bool(mono), fill_value, kind)
    fault = f"{path} has no samples at offset = {offset} s or later"
    return _not_empty(blocks, fault) if start else blocks


def _not_empty(blocks: Iterator[Floats], fault: str) -> Iterator[Floats]:
    first = next(blocks, None)
    if first is None:
        raise DecodeError(fault)
    yield first
    yield from blocks


def _blocks(
    recording: _core.Recording,
    length: int,
    overlap: int,
    left: int | None,
    mono: bool,
    fill_value: float | None,
    dtype: np.dtype[Any],
) -> Iterator[Floats]:
    kept: Any = np.empty((0, recording.channels), dtype=dtype)
    while left is None or left > 0:
        wanted = length - len(kept)
        new = recording.read(wanted if left is None else min(wanted, left))
        if not len(new):
            return
        left = None if left is None else left - len(new)
        block = np.concatenate([kept, new.astype(dtype, copy=False)])
        kept = block[len(block) - overlap :].copy() if overlap else block[:0]
        if len(block) < length and fill_value is not None:
            rest = np.full((length - len(block), block.shape[1]), fill_value, dtype=dtype)
            block = np.concatenate([block, rest])
        y = block[:, 0] if block.shape[1] == 1 else np.ascontiguousarray(block.T)
        yield to_mono(y) if mono else y


@refuses
def get_samplerate(path: Source) -> float:
    """Sample rate of a recording in Hz (librosa.get_samplerate).

    Parameters
    ----------
    path : path, or binary file
        The recording.

    Returns
    -------
    Hz

    Examples
    --------
    >>> corsmal_feat.get_samplerate("recording.wav")
    44100
    """
    return _open(path).sample_rate


@refuses
def get_duration(
    *,
    y: npt.ArrayLike | None = None,
    sr: float = 22050,
    S: npt.ArrayLike | None = None,
    n_fft: int = 2048,
    hop_length: int = 512,
    center: bool = True,
    path: Source | None = None,
) -> float:
    """Duration of a signal, of a recording, or of the signal behind a spectrogram
    (librosa.get_duration).

    Parameters
    ----------
    y : [shape=(..., n)], optional
        Signal at the sample rate `sr` in Hz.
    S : [shape=(..., d, t)], optional
        Spectrogram, made with `n_fft`, `hop_length` and `center`.
    path : path, or binary file, optional
        Recording; takes precedence over `y` and `S`. It is decoded where the end of the file does
        not bear out the length in its header.

    Returns
    -------
    seconds

    Examples
    --------
    >>> corsmal_feat.get_duration(y=np.zeros(11025), sr=22050)
    0.5
    """
    if path is not None:
        recording = _open(path)
        frames = recording.confirmed_frames()
        if frames is None:
            frames = recording.count()
            _tell(recording, path)
        return frames / recording.sample_rate
    if not sr > 0:
        raise ParameterError(f"sr must be a positive sample rate in Hz, not {sr}")
    if y is None and S is None:
        raise ParameterError("y, S or path must be given")
    given = np.asarray(S if y is None else y)
    if given.ndim == 0:
        raise ParameterError(f"{'S' if y is None else 'y'} has 0 dimensions, expected at least 1")
    if y is not None:
        return float(given.shape[-1] / sr)
    n_fft, hop_length = size("n_fft", n_fft), size("hop_length", hop_length)
    samples = n_fft + hop_length * (given.shape[-1] - 1)
    return float(samples - 2 * (n_fft // 2) if center else samples) / sr
