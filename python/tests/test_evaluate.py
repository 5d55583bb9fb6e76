"""Scores of submissions, beside those that the official evaluator gave."""

from __future__ import annotations

import csv
import os
from pathlib import Path

import corsmal_feat
import pytest

SHARED = Path(os.environ.get("CORSMAL_SHARED", Path(__file__).parents[3] / "shared"))
CCM = SHARED / "data" / "ccm"
needs_ccm = pytest.mark.skipif(not CCM.is_dir(), reason=f"skipped: {CCM} absent")
SUBMISSION = CCM / "submissions" / "train_2020-08_team1.csv"
ANNOTATIONS = CCM / "ccm_train_annotation.csv"


@needs_ccm
def test_official_scores() -> None:
    with (CCM / "reference_scores_evaluator_head_3e689d8.csv").open() as table:
        rows = list(csv.DictReader(table))
    assert len(rows) == 24
    for row in rows:
        submission = CCM / "submissions" / f"train_{row.pop('submission')}.csv"
        baseline = CCM / "submissions" / "train_random1.csv"
        scores = corsmal_feat.evaluate(submission, ANNOTATIONS, baseline=baseline)
        expected = {name: pytest.approx(float(value), abs=0.0101) for name, value in row.items()}
        assert {name: scores[name] for name in row} == expected, submission


@needs_ccm
def test_scores_by_name() -> None:
    scores = corsmal_feat.evaluate(SUBMISSION, ANNOTATIONS, rules="paper", seed=3)
    assert {"T1", "T2", "T3", "mass"} <= set(scores.values)
    assert all(0 <= scores[name] <= 100 for name in ("T1", "T2", "T3"))
    assert scores.rules == "paper" and scores.recordings > 0
    part = corsmal_feat.evaluate(SUBMISSION, ANNOTATIONS, rules="paper", containers=[3, 6, 9])
    assert 0 < part.recordings < scores.recordings


@needs_ccm
def test_what_cannot_be_scored_is_refused(tmp_path: Path) -> None:
    with pytest.raises(corsmal_feat.ParameterError, match=r"rules must be .*, not best"):
        corsmal_feat.evaluate(SUBMISSION, ANNOTATIONS, rules="best")
    with pytest.raises(corsmal_feat.MissingFileError, match=r"none\.csv"):
        corsmal_feat.evaluate(tmp_path / "none.csv", ANNOTATIONS)
    with pytest.raises(corsmal_feat.ParameterError, match="0 to 255, not 300"):
        corsmal_feat.evaluate(SUBMISSION, ANNOTATIONS, containers=[300])
    with pytest.raises(corsmal_feat.ParameterError, match="seed must be a whole number from 0"):
        corsmal_feat.evaluate(SUBMISSION, ANNOTATIONS, seed=-1)
