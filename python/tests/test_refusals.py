"""What a public function does not take, it refuses by an error of this package.

Each function has a call that it answers. Every argument of it is then replaced by values of other
types and by numbers that are none; the call may be answered still, or refused by a
`CorsmalFeatError`.
"""

from __future__ import annotations

import inspect
import re
import warnings
from collections.abc import Callable, Iterator
from importlib import import_module
from pathlib import Path
from typing import Any, get_type_hints

import corsmal_feat
import numpy as np
import pytest

#: module, and the calls of its functions
CALLS = {
    "": """
        A4_to_tuning(A4=440.0)
        A_weighting(frequencies=[100.0])
        B_weighting(frequencies=[100.0])
        C_weighting(frequencies=[100.0])
        D_weighting(frequencies=[100.0])
        Z_weighting(frequencies=[100.0])
        amplitude_to_db(S=S)
        blocks_to_frames(blocks=[1], block_length=2)
        blocks_to_samples(blocks=[1], block_length=2, hop_length=3)
        blocks_to_time(blocks=[1], block_length=2, hop_length=3, sr=100)
        compare_predictions(first=table, second=table)
        cqt(y=y, n_bins=12)
        cqt_frequencies(n_bins=3, fmin=110)
        cross_validate(features=table)
        db_to_amplitude(S_db=S)
        db_to_power(S_db=S)
        estimate_tuning(y=y)
        evaluate(submission=table, annotations=table)
        extract(paths=wav, preset="mfcc-zcr")
        fft_frequencies(sr=8000, n_fft=8)
        fourier_tempo_frequencies(sr=8000, win_length=8, hop_length=2)
        frames_to_samples(frames=[1])
        frames_to_time(frames=[1])
        frequency_weighting(frequencies=[100.0])
        fuse(predictions=[table])
        get_duration(y=y)
        get_samplerate(path=wav)
        hz_to_mel(frequencies=[100.0])
        hz_to_midi(frequencies=[100.0])
        hz_to_octs(frequencies=[100.0])
        istft(stft_matrix=D)
        load(path=wav)
        load_features(path=table)
        load_model(path=table)
        magphase(D=D)
        mel_frequencies(n_mels=3)
        mel_to_hz(mels=[3.0])
        midi_to_hz(notes=[60])
        multi_frequency_weighting(frequencies=[100.0])
        note_to_hz(note="A4")
        note_to_midi(note=["A4"])
        octs_to_hz(octs=[1.0])
        pcen(S=S)
        perceptual_weighting(S=S, frequencies=[100.0] * 129)
        piptrack(y=y)
        pitch_tuning(frequencies=[440.5])
        power_to_db(S=S)
        resample(y=y, orig_sr=8000, target_sr=4000)
        samples_like(X=S)
        samples_to_frames(samples=[1])
        samples_to_time(samples=[1])
        score(predictions=table)
        stft(y=y)
        stream(path=wav, block_length=2, frame_length=64, hop_length=32)
        tempo_frequencies(n_bins=3)
        time_to_frames(times=[1.0])
        time_to_samples(times=[1.0])
        times_like(X=S)
        to_mono(y=y)
        tuning_to_A4(tuning=0.1)
        yin(y=y, fmin=100, fmax=400, sr=8000)
    """,
    "corsmal": """
        a34_short(y=y, sr=8000, window=400, step=400)
        a34f136(y=y, sr=8000, mid_window=800, mid_step=800, window=400, step=400)
        a34f136_mean(y=y, sr=8000, mid_window=800, mid_step=800, window=400, step=400)
        abs_cqt(y=y)
        af193(y=y, sr=22050)
        esc26(y=y, sr=8000)
        fit_projection(features=table, out=table)
        hpss_audio(y=y)
        hpss_mags(S=S)
        hpss_masks(S=S)
        m1_stft(y=y)
        m2_mfcc(y=y, sr=8000)
        m3_spectrogram(y=y, sr=8000)
        m4_logmel(y=y, sr=8000)
        m4_windows(features=S)
        m5_a34f136(y=y, sr=8000)
        m5_vggish_patches(y=y, sr=8000)
        m6_spectrogram(y=y, sr=8000)
        paa_fbank(sr=8000, num_fft=400)
        pca_fit(X=S, n_components=2)
        pca_fit_transform(X=S, n_components=2)
        pca_project(X=S, components=S, mean=S[0])
        piptrack_both(y=y)
        sk_resize(S=S, shape=(4, 4))
        spec9216(y=y, sr=8000)
    """,
    "decompose": """
        hpss(S=S)
    """,
    "effects": """
        harmonic(y=y)
        hpss(y=y)
        percussive(y=y)
        preemphasis(y=y)
        split(y=y)
        trim(y=y)
    """,
    "feature": """
        chroma_cens(y=y, fmin=220.0, n_octaves=2)
        chroma_cqt(y=y, fmin=220.0, n_octaves=2)
        chroma_stft(y=y)
        delta(data=S)
        melspectrogram(y=y)
        mfcc(y=y)
        poly_features(y=y)
        rms(y=y)
        spectral_bandwidth(y=y)
        spectral_centroid(y=y)
        spectral_contrast(y=y)
        spectral_flatness(y=y)
        spectral_rolloff(y=y)
        stack_memory(data=S)
        tonnetz(y=y)
        zero_crossing_rate(y=y)
    """,
    "filters": """
        chroma(sr=8000, n_fft=256)
        get_window(window="hann", Nx=64)
        mel(sr=8000, n_fft=256)
    """,
    "nets": """
        build(name="m3_mlp")
        cross_validate(name="m1", recordings=[wav], y=["a"])
        embed(name="vggish", recordings=[wav], weights=table)
        load(path=table)
        read_weights(path=table)
        train(name="m1", recordings=[wav], y=["a"])
        write_weights(path=table, state={"x": S})
    """,
    "onset": """
        onset_backtrack(events=[3], energy=[1.0, 0.5, 1.0, 2.0])
        onset_detect(y=y)
        onset_strength(y=y)
        onset_strength_multi(y=y)
    """,
    "util": """
        fix_frames(frames=[3])
        fix_length(data=y, size=4)
        frame(x=y, frame_length=64, hop_length=32)
        normalize(S=S)
        pad_center(data=y, size=5000)
        tiny(x=y)
        valid_audio(y=y)
    """,
    "vision": """
        cuboid(depth=depth, mask=mask, calibration=table)
        load_calibration(path=table)
        load_depth(path=table)
        load_mask(path=table)
        lode(masks=[mask, mask], calibrations=[table, table])
        m2_capacity(depth=depth, weights=table)
        region(depth=depth)
        upright_box(depths=[depth], masks=[mask], calibrations=[table])
    """,
}
#: those without arguments, and of modules that need more than this package
OTHERS = {"nets.names"}
APART = {"arrow", "display", "ray"}
NO_VALUES: list[Any] = [
    None, "a", b"a", float("nan"), float("inf"), -1, 0, 2.5, 1 + 2j, object(), [], [None], ["a"],
    {}, (1, "a"), np.array(1.0), np.zeros(0), np.zeros((2, 2, 2)), lambda *_: "a", "no/such/file",
]  # fmt: skip


def calls() -> Iterator[tuple[str, Callable[..., Any], str]]:
    for module, lines in CALLS.items():
        there = import_module(f"corsmal_feat.{module}") if module else corsmal_feat
        for line in lines.split("\n"):
            if line.strip():
                name, _, rest = line.strip().partition("(")
                yield f"{module}.{name}".strip("."), getattr(there, name), rest[:-1]


def functions() -> set[str]:
    names = corsmal_feat.__all__
    found = {name for name in names if inspect.isroutine(getattr(corsmal_feat, name))}
    for path in Path(corsmal_feat.__file__).parent.glob("[!_]*.py"):
        if path.stem in APART:
            continue
        module = import_module(f"corsmal_feat.{path.stem}")
        for name in module.__all__:
            function = getattr(module, name)
            if inspect.isroutine(function) and function is not getattr(corsmal_feat, name, None):
                found.add(f"{path.stem}.{name}")
    return found - OTHERS


def test_every_public_function_is_called() -> None:
    assert {name for name, _, _ in calls()} == functions()


def mentioned(error: Exception) -> set[str]:
    """Words of a message that may name an argument."""
    text = str(error)
    found = {word for name in re.findall(r"\w+", text) for word in (name, name.split("_")[-1])}
    return found | ({"No such"} if "No such file" in text else set())


@pytest.fixture(scope="module")
def inputs(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    folder = tmp_path_factory.mktemp("refusals")
    rng = np.random.default_rng(0)
    (folder / "table.csv").write_text("no table of any kind\n")
    samples = (8000 * rng.standard_normal(4096)).astype("<i2").tobytes()
    sizes = [np.uint32(n).tobytes() for n in (36 + len(samples), 16, 8000, 16000, len(samples))]
    head = b"RIFF" + sizes[0] + b"WAVEfmt " + sizes[1] + b"\1\0\1\0" + sizes[2] + sizes[3]
    (folder / "a.wav").write_bytes(head + b"\2\0\x10\0data" + sizes[4] + samples)
    return {
        "y": rng.standard_normal(4096).astype(np.float32),
        "S": rng.random((129, 9)),
        "D": rng.random((129, 9)) + 0j,
        "depth": np.full((48, 64), 900, np.uint16),
        "mask": np.zeros((48, 64), bool),
        "table": folder / "table.csv",
        "wav": folder / "a.wav",
    }


@pytest.mark.parametrize("name", sorted(name for name, _, _ in calls()))
@pytest.mark.filterwarnings("ignore")
def test_refusals(
    name: str,
    inputs: dict[str, Any],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.chdir(tmp_path)
    function, arguments = next(rest for at, *rest in calls() if at == name)
    good: dict[str, Any] = eval(f"dict({arguments})", inputs)
    hints = get_type_hints(function)
    wrong = []
    kinds = (inspect.Parameter.VAR_KEYWORD, inspect.Parameter.VAR_POSITIONAL)
    for parameter in inspect.signature(function).parameters.values():
        if parameter.kind in kinds:
            continue
        for value in NO_VALUES:
            # What a function that is given raises is its own.
            if callable(value) and "Callable" in str(hints[parameter.name]):
                continue
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                try:
                    result = function(**(good | {parameter.name: value}))
                    if inspect.isgenerator(result):
                        list(result)
                except corsmal_feat.CorsmalFeatError as error:
                    # A value of the right type may be refused in other words.
                    alien = type(value) is object
                    alien |= value is None and parameter.default is not None
                    alien &= name != "util.valid_audio"  # in librosa's words
                    if alien and not {parameter.name.split("_")[-1], "No such"} & mentioned(error):
                        wrong.append(f"{parameter.name}={value!r}: unnamed: {error}")
                except Exception as error:
                    wrong.append(f"{parameter.name}={value!r}: {type(error).__name__}: {error}")
    assert not wrong, f"{name}\n" + "\n".join(wrong)


#: Of these arrays, only the shape or the type counts.
SHAPES = {"Z_weighting", "get_duration", "samples_like", "times_like", "util.tiny"}
#: Optional arrays that some calls do not read.
UNREAD = {"energy", "variance", "window"}
#: `rms` takes `y` before `S`, as librosa does.
UNREAD_OF = {"feature.rms": {"S"}}


def arrays_of(values: dict[str, Any], change: Callable[[Any], Any]) -> Iterator[dict[str, Any]]:
    """The arguments of a call with one array of numbers changed, also one in a list."""
    for name, value in values.items():
        if isinstance(value, np.ndarray):
            yield values | {name: change(value)}
        elif isinstance(value, list) and value and isinstance(value[0], np.ndarray):
            yield values | {name: [*value[:-1], change(value[-1])]}
        elif isinstance(value, list) and value and isinstance(value[0], int | float):
            yield values | {name: change(np.array(value))}


def parts_of(result: Any) -> list[Any]:
    if isinstance(result, dict):
        result = tuple(result.values())
    return list(result) if isinstance(result, tuple) else [result]


@pytest.mark.parametrize("name", sorted({name for name, _, _ in calls()} - SHAPES))
@pytest.mark.filterwarnings("ignore")
def test_a_mask_is_refused_or_kept(name: str, inputs: dict[str, Any]) -> None:
    function, arguments = next(rest for at, *rest in calls() if at == name)
    good: dict[str, Any] = eval(f"dict({arguments})", inputs)

    def masked(value: Any) -> Any:
        hidden = np.zeros(value.shape, bool)
        hidden.flat[0] = True
        return np.ma.array(value, mask=hidden)

    hints = get_type_hints(function)
    tried = list(arrays_of(good, masked))
    unread = UNREAD | UNREAD_OF.get(name, set())
    for key in inspect.signature(function).parameters.keys() - good.keys() - unread:
        if "_NestedSequence" in str(hints.get(key)):  # an optional array in numpy's union
            tried += [good | {key: masked(inputs[other])} for other in "yS"]
    for arguments in tried:
        try:
            result = function(**arguments)
        except corsmal_feat.CorsmalFeatError as error:
            if arguments.keys() == good.keys():
                assert "mask" in str(error), name
        else:
            assert all(np.ma.is_masked(part) for part in parts_of(result)), (name, arguments)


@pytest.mark.parametrize("name", sorted(name for name, _, _ in calls()))
@pytest.mark.filterwarnings("ignore")
def test_arrays_need_no_alignment(name: str, inputs: dict[str, Any]) -> None:
    """As `numpy.frombuffer` and `numpy.memmap` give them for a file with a header."""
    function, arguments = next(rest for at, *rest in calls() if at == name)
    good: dict[str, Any] = eval(f"dict({arguments})", inputs)

    def shifted(value: Any) -> Any:
        buffer = bytearray(1) + value.tobytes()
        return np.frombuffer(buffer, value.dtype, offset=1).reshape(value.shape)

    for arguments in arrays_of(good, shifted):
        found = []
        for given in (good, arguments):
            try:
                found.append(parts_of(function(**given)))
            except corsmal_feat.CorsmalFeatError as error:
                found.append([str(error)])
        for expected, actual in zip(*found, strict=True):
            np.testing.assert_array_equal(actual, expected)


def test_errors_of_a_given_function_are_its_own(inputs: dict[str, Any]) -> None:
    class Mine(ValueError):
        pass

    def fails(*_: Any, **__: Any) -> Any:
        raise Mine("mine")

    y, wav = inputs["y"], inputs["wav"]
    for call in (
        lambda: corsmal_feat.onset.onset_strength(y=y, aggregate=fails, detrend=1),  # type: ignore[arg-type]
        lambda: corsmal_feat.power_to_db(inputs["S"], ref=fails),
        lambda: corsmal_feat.effects.trim(y, ref=fails),
        lambda: corsmal_feat.stft(y, window=fails),
        lambda: corsmal_feat.extract([wav], preset="esc26", progress=fails),
    ):
        with pytest.raises(Mine, match="mine"):
            call()


def test_warnings_point_to_the_caller(inputs: dict[str, Any]) -> None:
    y = inputs["y"]
    for call in (
        lambda: corsmal_feat.stft(y[:1000]),
        lambda: corsmal_feat.feature.mfcc(y=y[:1000]),
        lambda: corsmal_feat.power_to_db(inputs["D"]),
        lambda: corsmal_feat.filters.mel(sr=8000, n_fft=64, n_mels=99),
        lambda: corsmal_feat.KNN(1).fit([[0.0], [1.0]], [["a"], ["b"]]),
    ):
        with pytest.warns() as caught:
            call()
        assert {Path(one.filename) for one in caught} == {Path(__file__)}
