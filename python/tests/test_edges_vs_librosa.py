"""Arguments at the edge, against librosa: functions and arrays as references, NaN, wrong types."""

from pathlib import Path

import corsmal_feat as cf
import librosa
import numpy as np
import pytest
import soundfile
from corsmal_feat.errors import DecodeError, ParameterError

RNG = np.random.default_rng(7)


@pytest.mark.parametrize("reference", [np.median, np.mean, np.std, np.max])
@pytest.mark.parametrize("hop_length", [512, 5000])
@pytest.mark.parametrize("center", [True, False])
def test_a_function_finds_the_reference_of_zero_crossings_in_the_frames(
    reference: object, hop_length: int, center: bool
) -> None:
    y = np.linspace(-1, 1, 22_050).astype(np.float32) * np.tile(np.float32([1, -1]), 11_025)
    y += RNG.normal(0, 0.1, y.size).astype(np.float32)
    arguments = {"threshold": 0.5, "ref_magnitude": reference}
    arguments |= {"hop_length": hop_length, "center": center}
    ours = cf.feature.zero_crossing_rate(y, **arguments)
    np.testing.assert_array_equal(ours, librosa.feature.zero_crossing_rate(y, **arguments))


def test_a_reference_that_is_nan_leaves_no_decibels() -> None:
    powers = np.array([1.0, 4.0, np.nan, 2.0])
    for top_db in (None, 80.0):
        assert np.isnan(cf.power_to_db(powers, ref=np.max, top_db=top_db)).all()
        assert np.isnan(cf.power_to_db(powers[:2], ref=np.nan, top_db=top_db)).all()
        assert np.isnan(cf.amplitude_to_db(np.float32([1, 4]), ref=np.nan, top_db=top_db)).all()


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_the_loudest_value_is_0_dB_when_it_is_the_reference(dtype: type) -> None:
    for _ in range(200):
        powers = RNG.random(9).astype(dtype) ** 8
        assert cf.power_to_db(powers, ref=np.max).max() == 0


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_each_channel_can_have_its_own_reference(dtype: type) -> None:
    powers = RNG.random((2, 3, 4)).astype(dtype) ** 8
    powers[0, 0, 0] = 0

    def loudest(s: np.ndarray) -> np.ndarray:
        return s.max(axis=(1, 2), keepdims=True)

    for name in ("power_to_db", "amplitude_to_db"):
        for top_db in (None, 20.0):
            ours, theirs = (
                getattr(m, name)(powers, ref=loudest, top_db=top_db) for m in (cf, librosa)
            )
            assert ours.dtype == theirs.dtype == dtype
            np.testing.assert_allclose(ours, theirs, rtol=1e-6, atol=2e-5)
    with pytest.raises(ParameterError, match="ref has shape"):
        cf.power_to_db(powers, ref=np.ones(3))
    with pytest.raises(ParameterError, match="top_db must be 0 or more"):
        cf.power_to_db(powers, ref=np.ones(4), top_db=-1)


@pytest.mark.parametrize("max_size", [1, 3])
def test_nan_in_a_spectrogram_is_nan_in_its_onsets(max_size: int) -> None:
    s = RNG.standard_normal((5, 8))
    s[2, 3] = np.nan
    for name in ("onset_strength", "onset_strength_multi"):
        ours, theirs = (getattr(m.onset, name)(S=s, max_size=max_size) for m in (cf, librosa))
        assert np.isnan(ours[~np.isfinite(theirs)]).all()
        assert np.isnan(ours).any()


def test_nan_in_a_spectrum_leaves_it_without_pitches() -> None:
    s = np.abs(librosa.stft(RNG.standard_normal(8000), n_fft=512))
    s[40, 9] = np.nan
    with np.errstate(invalid="ignore"):
        ours, theirs = (m.piptrack(S=s, sr=8000, n_fft=512)[1] for m in (cf, librosa))
    np.testing.assert_array_equal((ours > 0)[:, 9], (theirs > 0)[:, 9])


def test_pcen_after_an_infinite_value_is_no_number() -> None:
    s = RNG.random((3, 6))
    s[1, 2] = np.inf
    assert np.isnan(cf.pcen(s)[1, 3:]).all()
    assert np.isfinite(cf.pcen(s)[[0, 2]]).all()


def test_samples_are_not_cut_to_whole_numbers() -> None:
    spectrogram = cf.stft(np.full(3000, 0.1), n_fft=256)
    for kind in (np.int16, bool):
        with pytest.raises(ParameterError, match="cannot hold samples"):
            cf.istft(spectrogram, dtype=kind)
        with pytest.raises(ParameterError, match="cannot hold samples"):
            cf.istft(spectrogram, out=np.zeros(3000, kind))
    big = spectrogram.astype(">c8")
    assert cf.istft(big).dtype == librosa.istft(big).dtype == np.float32


def test_a_stream_that_begins_behind_the_end_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "a.wav"
    soundfile.write(path, np.zeros(800, np.float32), 8000)
    sizes = {"block_length": 1, "frame_length": 64, "hop_length": 64}
    with pytest.raises(DecodeError, match="no samples at offset"):
        list(cf.stream(path, offset=5.0, **sizes))
    assert len(list(cf.stream(path, offset=0.05, **sizes))) == 7
