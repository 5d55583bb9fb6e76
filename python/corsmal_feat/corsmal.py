"""Inputs of the benchmark's systems: re-exported from one private module per family."""

from ._af193 import af193
from ._compound import (
    a34_short,
    a34f136,
    a34f136_mean,
    fit_projection,
    paa_fbank,
    pca_fit,
    pca_fit_transform,
    pca_project,
    sk_resize,
)
from ._cqt import abs_cqt
from ._frontends import (
    esc26,
    m1_stft,
    m2_mfcc,
    m3_spectrogram,
    m4_logmel,
    m4_windows,
    m5_a34f136,
    m5_vggish_patches,
    m6_spectrogram,
    spec9216,
)
from ._hpss import hpss_audio, hpss_mags, hpss_masks
from ._mono import to_mono
from ._pitch import piptrack_both

__all__ = [
    "a34_short",
    "a34f136",
    "a34f136_mean",
    "abs_cqt",
    "af193",
    "esc26",
    "fit_projection",
    "hpss_audio",
    "hpss_mags",
    "hpss_masks",
    "m1_stft",
    "m2_mfcc",
    "m3_spectrogram",
    "m4_logmel",
    "m4_windows",
    "m5_a34f136",
    "m5_vggish_patches",
    "m6_spectrogram",
    "paa_fbank",
    "pca_fit",
    "pca_fit_transform",
    "pca_project",
    "piptrack_both",
    "sk_resize",
    "spec9216",
    "to_mono",
]
