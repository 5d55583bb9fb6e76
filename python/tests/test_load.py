"""`load`, `stream`, `get_duration`, `get_samplerate` beside librosa."""

from __future__ import annotations

import copy
import errno
import io
import pickle
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import corsmal_feat as cf
import librosa
import numpy as np
import pytest
import soundfile

RATE = 44100
# librosa looks for readers among modules that Python has deprecated.
pytestmark = pytest.mark.filterwarnings("ignore::DeprecationWarning")


@pytest.fixture(scope="module")
def recordings(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    folder = tmp_path_factory.mktemp("recordings")
    rng = np.random.default_rng(3)
    t = np.arange(30000) / RATE
    tone = 0.3 * np.sin(2 * np.pi * 440 * t) + 0.01 * rng.standard_normal(len(t))
    stereo = np.stack([tone, 0.5 * np.roll(tone, 200)], axis=1)
    made = {}
    for name, samples, form, subtype in (
        ("mono.wav", tone, "WAV", "PCM_16"),
        ("stereo.wav", stereo, "WAV", "PCM_24"),
        ("float.wav", stereo, "WAV", "FLOAT"),
        ("stereo.flac", stereo, "FLAC", "PCM_16"),
        ("deep.flac", stereo, "FLAC", "PCM_24"),
        ("mono.mp3", tone, "MP3", None),
        ("stereo.mp3", stereo, "MP3", None),
        ("mono.ogg", tone, "OGG", "VORBIS"),
        ("stereo.ogg", stereo, "OGG", "VORBIS"),
    ):
        made[name] = folder / name
        soundfile.write(made[name], samples, RATE, format=form, subtype=subtype)
    return made


#: largest difference from librosa's samples: decoders of lossy formats round differently
TOLERANCE = {".wav": 1e-7, ".flac": 1e-7, ".mp3": 2e-6, ".ogg": 1e-6}
NAMES = (
    "mono.wav", "stereo.wav", "float.wav", "stereo.flac", "deep.flac", "mono.mp3", "stereo.mp3",
    "mono.ogg", "stereo.ogg",
)  # fmt: skip


PARTS: list[dict[str, Any]] = [
    {"sr": None},
    {"sr": None, "mono": False},
    {"sr": None, "offset": 0.1, "duration": 0.2},
    {"sr": None, "offset": 0.123456, "dtype": np.float64},
    {"sr": None, "duration": 99.0, "mono": False},
    {"sr": None, "duration": 0},
]


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("part", PARTS, ids=str)
def test_samples_are_librosas(recordings: dict[str, Path], name: str, part: dict[str, Any]) -> None:
    y, sr = cf.load(recordings[name], **part)
    want, rate = librosa.load(recordings[name], **part)
    assert sr == rate == RATE
    assert y.dtype == want.dtype and y.shape == want.shape
    np.testing.assert_allclose(y, want, rtol=0, atol=TOLERANCE[recordings[name].suffix])


@pytest.mark.parametrize("name", ["stereo.wav", "stereo.mp3", "mono.ogg", "deep.flac"])
@pytest.mark.parametrize("sr", [22050, 16000, 48000])
def test_resampled_is_librosas(recordings: dict[str, Path], name: str, sr: int) -> None:
    y, rate = cf.load(recordings[name], sr=sr)
    want, _ = librosa.load(recordings[name], sr=sr)
    assert rate == sr and y.shape == want.shape
    np.testing.assert_allclose(y, want, rtol=0, atol=2e-6)


def test_the_default_is_librosas(recordings: dict[str, Path]) -> None:
    y, sr = cf.load(str(recordings["mono.wav"]))
    want, rate = librosa.load(recordings["mono.wav"])
    assert sr == rate == 22050
    np.testing.assert_allclose(y, want, rtol=0, atol=2e-6)


def test_binary_files_are_read(recordings: dict[str, Path]) -> None:
    content = recordings["stereo.flac"].read_bytes()
    with recordings["stereo.flac"].open("rb") as file:
        opened, _ = cf.load(file, sr=None)
    kept, _ = cf.load(io.BytesIO(content), sr=None)
    by_name, _ = cf.load(recordings["stereo.flac"], sr=None)
    assert np.array_equal(opened, by_name) and np.array_equal(kept, by_name)


@pytest.mark.parametrize("name", ["mono.wav", "stereo.wav", "stereo.flac", "stereo.ogg"])
@pytest.mark.parametrize("mono", [True, False])
@pytest.mark.parametrize("fill_value", [None, 0.5])
@pytest.mark.parametrize(
    "part",
    [{}, {"offset": 0.05, "duration": 0.31}, {"duration": 0.01}],
    ids=["whole", "part", "short"],
)
def test_blocks_are_librosas(
    recordings: dict[str, Path],
    name: str,
    mono: bool,
    fill_value: float | None,
    part: dict[str, float],
) -> None:
    framing = {"block_length": 7, "frame_length": 1000, "hop_length": 300}

    def blocks(stream: Callable[..., Any]) -> list[Any]:
        return list(stream(recordings[name], mono=mono, fill_value=fill_value, **framing, **part))

    ours, theirs = blocks(cf.stream), blocks(librosa.stream)
    assert [b.shape for b in ours] == [b.shape for b in theirs]
    for block, want in zip(ours, theirs, strict=True):
        np.testing.assert_allclose(block, want, rtol=0, atol=TOLERANCE[recordings[name].suffix])


@pytest.mark.parametrize("name", NAMES)
def test_blocks_are_parts_of_the_whole(recordings: dict[str, Path], name: str) -> None:
    whole, _ = cf.load(recordings[name], sr=None, mono=False)
    blocks = cf.stream(
        recordings[name], block_length=4, frame_length=1000, hop_length=250, mono=False
    )
    for at, block in enumerate(blocks):
        start = 1000 * at
        assert np.array_equal(block, whole[..., start : start + block.shape[-1]])
    assert start + block.shape[-1] == whole.shape[-1] == 30000


def test_durations_and_rates(recordings: dict[str, Path]) -> None:
    for path in recordings.values():
        assert cf.get_duration(path=path) == librosa.get_duration(path=path)
        assert cf.get_samplerate(path) == RATE


@pytest.mark.parametrize("name", ["stereo.wav", "stereo.mp3"])
def test_no_samples_of_several_channels(recordings: dict[str, Path], name: str) -> None:
    for mono, shape in ((False, (2, 0)), (True, (0,))):
        for duration in (0, 1e-6):
            y, sr = cf.load(recordings[name], mono=mono, duration=duration)
            assert y.shape == shape and sr == 22050


def test_impossible_parts_are_refused(recordings: dict[str, Path], tmp_path: Path) -> None:
    path = recordings["mono.wav"]
    with pytest.raises(cf.DecodeError, match="no samples at offset"):
        cf.load(path, offset=100.0)
    for read in (cf.load, cf.get_samplerate, cf.load_features):
        with pytest.raises(cf.MissingFileError, match=r"nothing\.wav") as caught:
            read(tmp_path / "nothing.wav")
        assert isinstance(caught.value, FileNotFoundError)
    with pytest.raises(cf.CorsmalFeatError, match="folder without parts"):
        cf.load_features(tmp_path)
    np.savez(tmp_path / "features.npz", a=np.zeros(3))
    with pytest.raises(cf.DecodeError, match="load_features"):
        cf.load(tmp_path / "features.npz")
    refusals: list[dict[str, Any]] = [
        {"offset": -1.0},
        {"duration": float("nan")},
        {"duration": 1e300},
        {"dtype": np.int16},
        {"sr": 0},
        {"sr": 1e12},
        {"res_type": "best"},
    ]
    for refused in refusals:
        with pytest.raises(cf.ParameterError):
            cf.load(path, **refused)
    with pytest.raises(cf.ParameterError, match="whole number of at least 1"):
        cf.stream(path, block_length=0, frame_length=10, hop_length=5)
    with pytest.raises(cf.ParameterError, match="hop_length"):
        cf.stream(path, block_length=2, frame_length=10, hop_length=11)


def test_errors_name_the_file_wherever_they_come(
    recordings: dict[str, Path], tmp_path: Path
) -> None:
    chained = tmp_path / "chained.ogg"
    chained.write_bytes(b"".join(recordings[f"{n}.ogg"].read_bytes() for n in ("mono", "stereo")))
    with pytest.raises(cf.DecodeError, match=r"chained\.ogg: "):
        cf.load(chained)
    with pytest.raises(cf.MissingFileError, match="copy it to one"):
        cf.load("s3://bucket/x.wav")


def test_every_reader_names_a_missing_file(tmp_path: Path) -> None:
    """Those of networks and pictures spoke of parameters and models."""
    nothing, there = str(tmp_path / "nothing"), tmp_path / "there.csv"
    there.write_text("id,true,predicted\na,x,x\n")
    near = np.zeros((720, 1280), np.uint16)
    near[300:500, 600:720] = 500
    readers: list[Callable[[], object]] = [
        lambda: cf.vision.load_calibration(nothing),
        lambda: cf.vision.load_mask(nothing),
        lambda: cf.vision.load_depth(nothing),
        lambda: cf.nets.load(nothing),
        lambda: cf.nets.read_weights(nothing),
        lambda: cf.nets.embed("vggish", [there], nothing),
        lambda: cf.evaluate(nothing, there),
        lambda: cf.evaluate(there, nothing),
        lambda: cf.evaluate(there, there, baseline=nothing),
        lambda: cf.vision.m2_capacity(near, nothing),
        lambda: cf.score(there, labels=nothing),
        lambda: cf.load_model(nothing),
        lambda: cf.compare_predictions(there, nothing),
    ]
    for read in readers:
        with pytest.raises(cf.MissingFileError) as caught:
            read()
        assert caught.value.filename == nothing and str(caught.value).startswith(nothing)


def test_file_errors_keep_what_the_system_said(tmp_path: Path) -> None:
    """Process pools pickle them, and their numbers were lost."""
    errors = []
    for read in (cf.load, cf.load_features, cf.extract):
        with pytest.raises(cf.MissingFileError) as caught:
            read(str(tmp_path / "nothing.wav"))
        errors.append(caught.value)
    with pytest.raises(cf.FileError) as caught:
        cf.load(tmp_path / ("x" * 300))
    errors.append(caught.value)
    for error in errors:
        for same in (pickle.loads(pickle.dumps(error)), copy.copy(error), copy.deepcopy(error)):
            assert type(same) is type(error) and str(same) == str(error)
            assert (same.errno, same.filename) == (error.errno, error.filename)
            assert same.strerror == error.strerror
    assert [error.errno for error in errors] == [errno.ENOENT] * 3 + [errno.ENAMETOOLONG]


def test_what_was_odd_is_told(tmp_path: Path, recordings: dict[str, Path]) -> None:
    content = recordings["mono.wav"].read_bytes()
    cut = tmp_path / "cut.wav"
    cut.write_bytes(content[: len(content) // 2])
    with pytest.warns(UserWarning, match="ends after"):
        y, _ = cf.load(cut, sr=None)
    assert 0 < len(y) < 30000


@pytest.mark.parametrize("frames", [50000, 200000])
def test_durations_are_those_of_the_samples(tmp_path: Path, frames: int) -> None:
    """Lengths in the headers of cut and joined files were taken for theirs."""
    # Long enough for FLAC to be looked at in several places.
    noise = 0.1 * np.random.default_rng(5).standard_normal((frames, 2))
    for name in ("a.flac", "a.mp3", "a.ogg"):
        path = tmp_path / name
        soundfile.write(path, noise, RATE)
        whole = path.read_bytes()
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            assert cf.get_duration(path=path) == pytest.approx(frames / RATE, abs=1e-9)
        other = tmp_path / f"other-{name}"
        kinds = {"half": whole[: len(whole) // 2], "noise": whole + bytes(999)}
        if not name.endswith("ogg"):
            kinds |= {"two": 2 * whole, "five": 5 * whole}
        for kind, content in kinds.items():
            other.write_bytes(content)
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                samples, rate = cf.load(other, sr=None, mono=False)
                found = cf.get_duration(path=other)
            assert found == samples.shape[-1] / rate, (name, kind)
        if name.endswith("flac"):
            other.write_bytes(kinds["half"])
            with pytest.warns(UserWarning, match="the file ends after"):
                cf.get_duration(path=other)
