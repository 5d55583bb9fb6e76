"""Checks that an installed wheel works; `tools/release` runs this in fresh environments."""

from __future__ import annotations

import sys
import tempfile
import wave
from pathlib import Path

import corsmal_feat
import numpy as np


def main() -> None:
    assert "site-packages" in corsmal_feat.__file__, corsmal_feat.__file__
    y = 0.5 * np.sin(2 * np.pi * 440 * np.arange(22050) / 22050)
    mfcc = corsmal_feat.feature.mfcc(y=y.astype(np.float32), sr=22050)
    assert mfcc.shape == (20, 44) and np.isfinite(mfcc).all()
    assert abs(corsmal_feat.yin(y, fmin=110, fmax=880)[10] - 440) < 1
    with tempfile.TemporaryDirectory() as folder:
        paths = [Path(folder, f"{name}.wav") for name in "ab"]
        for gain, path in enumerate(paths, start=1):
            with wave.open(str(path), "wb") as file:
                file.setnchannels(1)
                file.setsampwidth(2)
                file.setframerate(22050)
                file.writeframes((y[::gain] * 32767).astype("<i2").tobytes())
        loaded, sr = corsmal_feat.load(paths[0])
        assert sr == 22050 and np.abs(loaded - y).max() < 1e-4
        features = corsmal_feat.extract(paths, preset="esc26")
        model = corsmal_feat.KNN(1).fit(features.summary, ["a", "b"])
        model.save(Path(folder, "model"), features=features)
        assert corsmal_feat.load_model(Path(folder, "model")).predict(paths).tolist() == ["a", "b"]
    python, numpy = sys.version.split()[0], np.__version__
    print(f"works: corsmal_feat {corsmal_feat.__version__}, Python {python}, numpy {numpy}")


if __name__ == "__main__":
    main()
