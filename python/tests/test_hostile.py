"""Sizes from outside: each public function refuses what there is no memory for.

All calls run in one child process under a limit of its address space, since a failed allocation
would end the process; the last call it names is the one it died of.
"""

from __future__ import annotations

import subprocess
import sys

import pytest

pytest.importorskip("resource")

#: One call a line. Every one is refused by an error of this package, or answered.
CALLS = """
c.filters.mel(sr=22050, n_fft=2048, n_mels=2**31)
c.filters.mel(sr=22050, n_fft=2**40, n_mels=128)
c.filters.chroma(sr=22050, n_fft=2**40)
c.filters.chroma(sr=22050, n_fft=2048, n_chroma=2**34)
c.filters.get_window("hann", 2**40)
c.filters.get_window(np.hanning, 2**40)
c.stft(y, n_fft=2**40)
c.stft(y, n_fft=2**26)
c.stft(y, n_fft=2**70)
c.stft(y, hop_length=-1)
c.stft(y, win_length=2**40)
c.feature.melspectrogram(y=y, n_mels=2**34)
c.feature.mfcc(y=y, n_mfcc=2**40)
c.feature.mfcc(y=y, n_mels=2**34)
c.feature.mfcc(y=y, dct_type=2**40)
c.cqt(y, n_bins=2**34)
c.cqt(y, bins_per_octave=2**34)
c.cqt(y, fmin=1e-9)
c.cqt(y, hop_length=2**40)
c.feature.chroma_cqt(y=y, n_octaves=2**40)
c.feature.chroma_cqt(y=y, n_chroma=2**34, bins_per_octave=2**34)
c.feature.chroma_cens(y=y, win_len_smooth=2**40)
c.resample(y, orig_sr=1, target_sr=10**12)
c.resample(np.zeros(2**24, np.float32), orig_sr=1, target_sr=2**16)
c.resample(y, orig_sr=1e-3, target_sr=1e9)
c.resample(y, orig_sr=1e12, target_sr=1)
c.resample(y, orig_sr=1, target_sr=10**7, res_type="fft")
c.resample(y, orig_sr=1, target_sr=10**7, res_type="polyphase")
c.resample(y, orig_sr=1, target_sr=10**7, res_type="linear")
c.feature.zero_crossing_rate(y, frame_length=2**40)
c.feature.rms(y=y, frame_length=2**40)
c.feature.rms(y=y, frame_length=2**70)
c.feature.delta(np.zeros((4, 100)), width=2**40 + 1, mode="nearest")
c.feature.delta(np.zeros((4, 100)), order=2**40)
c.feature.stack_memory(np.zeros((4, 100)), n_steps=2**40)
c.feature.stack_memory(np.zeros((4, 100)), delay=2**34)
c.istft(np.zeros((1025, 4), np.complex64), length=2**40)
c.istft(np.zeros((1025, 4), np.complex64), length=2**33)
c.decompose.hpss(np.ones((64, 64)), kernel_size=2**40)
c.effects.hpss(y, n_fft=2**40)
c.feature.poly_features(y=y, order=2**34)
c.feature.spectral_contrast(y=y, n_bands=2**34)
c.feature.spectral_centroid(y=y, n_fft=2**30)
c.feature.chroma_stft(y=y, n_chroma=2**34)
c.feature.tonnetz(y=y, n_octaves=2**40)
c.onset.onset_strength(y=y, lag=2**40)
c.onset.onset_strength(y=y, max_size=2**40)
c.onset.onset_detect(y=y, wait=2**70)
c.pitch_tuning(np.ones(10) * 440.5, resolution=1e-12)
c.pitch_tuning(np.ones(10) * 440.5, bins_per_octave=2**40)
c.estimate_tuning(y=y, resolution=1e-12)
c.piptrack(y=y, n_fft=2**40)
c.yin(y, fmin=1e-9, fmax=400, frame_length=2**40)
c.util.frame(y, frame_length=2**40, hop_length=1)
c.util.fix_length(y, size=2**38)
c.util.pad_center(y, size=2**38)
c.util.fix_length(y, size=-1)
c.fft_frequencies(n_fft=2**40)
c.mel_frequencies(2**40)
c.cqt_frequencies(2**40, fmin=1)
c.tempo_frequencies(2**40)
c.effects.trim(y, frame_length=2**40)
c.effects.split(y, hop_length=2**70)
c.corsmal.a34_short(y, 16000, 2**40, 10)
c.corsmal.a34f136(y, 16000, 2**40, 2**40, 10, 10)
c.corsmal.paa_fbank(16000, 2**40)
c.corsmal.sk_resize(np.ones((9, 9)), (2**40, 9))
c.corsmal.pca_fit(np.ones((9, 9)), 2**40)
c.corsmal.spec9216(y, 16000, 2**40)
c.corsmal.m5_a34f136(y, 1e30)
c.corsmal.m5_a34f136(y, 2**32 - 1)
c.corsmal.m4_logmel(y, 1e30)
c.feature.delta(np.zeros((4, 100)), axis=2**100)
c.times_like(np.zeros((4, 100)), axis=2**100)
c.decompose.hpss(np.ones((64, 64)), power=2**100)
c.util.normalize(np.ones((4, 100)), axis=True)
c.corsmal.m1_stft(y, n_fft=2**40)
c.corsmal.m3_spectrogram(y, 16000, n_fft=2**40)
c.SignalExtractor(10**18, channels=1, preset="esc26")
c.SignalExtractor(16000, channels=2**40, preset="mfcc-zcr")
c.extract(["nothing"], jobs=2**70)
c.RandomForest(n_estimators=2**62).fit(X, t)
c.KNN(n_neighbors=2**63 - 1).fit(X, t)
"""

CHILD = """
import resource, sys, time, warnings
resource.setrlimit(resource.RLIMIT_AS, (6 << 30, 6 << 30))
warnings.simplefilter("ignore")
import numpy as np
import corsmal_feat as c
y = np.zeros(4096, np.float32)
X, t = np.random.default_rng(0).standard_normal((40, 3)), [0, 1] * 20
for call in sys.stdin.read().split("\\n"):
    print(call, flush=True)
    start = time.monotonic()
    try:
        eval(call)
    except c.CorsmalFeatError:
        pass
    assert time.monotonic() - start < 60, call
print("survived", flush=True)
"""


def test_hostile_sizes() -> None:
    calls = CALLS.strip()
    child = subprocess.run(
        [sys.executable, "-c", CHILD], input=calls, capture_output=True, text=True, timeout=600
    )
    assert child.stdout.split("\n")[-2:] == ["survived", ""], (
        child.stdout.strip().split("\n")[-1], child.stderr[-2000:]
    )  # fmt: skip
