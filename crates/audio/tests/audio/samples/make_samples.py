"""Writes the compressed samples beside it (soundfile 0.13, libsndfile 1.2): python make_samples.py."""

from pathlib import Path

import numpy as np
import soundfile

HERE = Path(__file__).parent
FRAMES = 3000

i, c = np.ogrid[:FRAMES, :8]
steps = ((i * 37 + c * 1001) % 20011 - 10005).astype(np.int16)
soundfile.write(HERE / "steps-8ch-16bit.flac", steps, 48000)

t = np.arange(30000) / 44100
sines = np.stack([0.5 * np.sin(2 * np.pi * hz * t) for hz in (440, 1000)], 1)
# A little noise makes the stream long enough for more than one Ogg page.
sines += 0.003 * np.random.default_rng(0).standard_normal(sines.shape)
soundfile.write(HERE / "sines-2ch.ogg", sines, 44100)
soundfile.write(HERE / "sine-1ch.mp3", sines[:, 0], 44100)
