"""What the command says of doubtful results, the package warns of."""

from __future__ import annotations

import pathlib
import warnings

import corsmal_feat
import numpy as np
import pytest
import soundfile
from corsmal_feat import KNN, extract


def test_single_lines_leave_nothing_to_vote_on(tmp_path: pathlib.Path) -> None:
    path = tmp_path / "p.csv"
    path.write_text("id,predicted,p_x,p_y\na,x,0.9,0.1\nb,x,0.6,0.4\n")
    with pytest.warns(UserWarning, match="nothing to vote on"):
        assert corsmal_feat.fuse(path, vote="majority").proba.tolist() == [[1, 0], [1, 0]]


def test_numbers_in_other_folders_are_not_fused(tmp_path: pathlib.Path) -> None:
    for name in ("anna", "ben"):
        (tmp_path / f"{name}.csv").write_text(f"id,p_x,p_y\n{name}/1,0.9,0.1\n")
    with pytest.raises(corsmal_feat.errors.ParameterError, match="may be two recordings"):
        corsmal_feat.fuse([tmp_path / "anna.csv", tmp_path / "ben.csv"])


def test_predictions_of_truncated_recordings_warn(tmp_path: pathlib.Path) -> None:
    rng = np.random.default_rng(0)
    paths = [tmp_path / f"{number}.wav" for number in range(6)]
    for number, path in enumerate(paths):
        soundfile.write(path, rng.standard_normal(8000) * (0.01 + 0.1 * (number % 2)), 8000)
    found = extract(paths, preset="esc26")
    knn = KNN(n_neighbors=1).fit(found.summary, ["quiet", "loud"] * 3)
    knn.save(tmp_path / "knn.model", features=found)
    model = corsmal_feat.load_model(tmp_path / "knn.model")
    whole = paths[0].read_bytes()
    for path in paths[:2]:
        path.write_bytes(whole[: len(whole) * 2 // 3])
    with pytest.warns(UserWarning) as told:
        model.predict([str(path) for path in paths])
    (message,) = [str(warning.message) for warning in told]
    assert "0.wav: repaired (truncated): the file ends after" in message
    assert message.endswith("; 1 more was repaired")
    # A refusal comes alone.
    paths[5].write_bytes(b"no audio")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        with pytest.raises(corsmal_feat.errors.DecodeError, match=r"5\.wav"):
            model.predict([str(path) for path in paths])


def test_windows_that_are_missing_are_told(tmp_path: pathlib.Path) -> None:
    path = tmp_path / "x.wav"
    soundfile.write(path, np.linspace(-0.5, 0.5, 8000), 8000)
    whole = path.read_bytes()
    path.write_bytes(whole[: len(whole) // 2])
    with pytest.warns(UserWarning, match="what is missing has no windows"):
        extract(path, preset="esc26", window=0.1)
