"""Prediction files: scores against scikit-learn, and the functions that make and join them."""

from __future__ import annotations

import csv
from pathlib import Path

import corsmal_feat
import numpy as np
import pytest
from corsmal_feat import ParameterError

metrics = pytest.importorskip("sklearn.metrics")

NAMES = np.array(["a", "b", "c", "d"])


def predictions(path: Path, rows: int = 240, seed: int = 0, classes: int = 4) -> tuple:
    """Random probabilities that lean towards the true class; ties among them."""
    rng = np.random.default_rng(seed)
    truth = rng.integers(0, classes, rows)
    proba = rng.random((rows, classes)) + 0.7 * (np.arange(classes) == truth[:, None])
    proba = np.round(proba / proba.sum(axis=1, keepdims=True), 2)
    proba[:, -1] = np.round(1 - proba[:, :-1].sum(axis=1), 12)
    proba = np.clip(proba, 0, 1)
    predicted = proba.argmax(axis=1)
    with path.open("w", newline="") as file:
        writer = csv.writer(file)
        names = NAMES[:classes]
        writer.writerow(["id", "group", "true", "predicted", *[f"p_{name}" for name in names]])
        for i in range(rows):
            group = f"g{i % 12}"
            writer.writerow([f"r{i}", group, names[truth[i]], names[predicted[i]], *proba[i]])
    return truth, predicted, proba


@pytest.mark.parametrize("classes", [2, 4])
def test_scores_are_those_of_scikit_learn(tmp_path: Path, classes: int) -> None:
    path = tmp_path / "p.csv"
    truth, predicted, proba = predictions(path, classes=classes)
    report = corsmal_feat.score(path)
    expected = {
        "accuracy": metrics.accuracy_score(truth, predicted),
        "weighted_f1": metrics.f1_score(truth, predicted, average="weighted"),
        "macro_f1": metrics.f1_score(truth, predicted, average="macro"),
    }
    one_hot = np.eye(classes)[truth]
    brier = ((proba - one_hot) ** 2).sum(axis=1).mean()
    expected["brier"] = brier / 2 if classes == 2 else brier
    of_class = [metrics.roc_auc_score(one_hot[:, c], proba[:, c]) for c in range(classes)]
    expected["roc_auc"] = np.mean(of_class)
    precision = [
        metrics.average_precision_score(one_hot[:, c], proba[:, c]) for c in range(classes)
    ]
    expected["average_precision"] = np.mean(precision)
    for name, value in expected.items():
        assert report[name] == pytest.approx(value, abs=1e-12), name
    assert (
        report.report["scores"]["confusion"] == metrics.confusion_matrix(truth, predicted).tolist()
    )
    per_class = metrics.precision_recall_fscore_support(truth, predicted)
    for c, scores in enumerate(report.report["scores"]["classes"]):
        found = [scores[name] for name in ("precision", "recall", "f1", "support")]
        assert found == pytest.approx([column[c] for column in per_class], abs=1e-12)
    # Curves: the same area under the points that are kept.
    for c, curves in enumerate(report.report["curves"]):
        rates = np.array(curves["roc"])
        assert metrics.auc(rates[:, 0], rates[:, 1]) == pytest.approx(of_class[c], abs=1e-12)


def test_calibration_error_is_the_mean_gap_of_its_bins(tmp_path: Path) -> None:
    path = tmp_path / "p.csv"
    truth, _, proba = predictions(path, rows=500, seed=3)
    confidence, right = proba.max(axis=1), proba.argmax(axis=1) == truth
    bins = np.clip(np.ceil(confidence * 15).astype(int), 1, 15)
    gaps = [
        (bins == b).sum() * abs(right[bins == b].mean() - confidence[bins == b].mean())
        for b in np.unique(bins)
    ]
    assert corsmal_feat.score(path)["ece"] == pytest.approx(sum(gaps) / len(truth), abs=1e-12)


def test_intervals_over_groups_hold_the_score_and_are_repeatable(tmp_path: Path) -> None:
    path = tmp_path / "p.csv"
    predictions(path)
    first, again = (corsmal_feat.score(path, resamples=300).report for _ in range(2))
    assert first["intervals"] == again["intervals"]
    assert (first["drawn"], first["units"]) == ("group", 12)
    for name, interval in first["intervals"].items():
        assert interval["low"] < first["scores"][name] < interval["high"]


def test_rejected_predictions_are_unknown_and_wrong(tmp_path: Path) -> None:
    path = tmp_path / "p.csv"
    truth, predicted, proba = predictions(path)
    known = proba.max(axis=1) >= 0.4
    report = corsmal_feat.score(path, reject=0.4).report
    assert report["unknown"] == (~known).sum()
    assert report["scores"]["accuracy"] == pytest.approx((known & (truth == predicted)).mean())
    assert report["accuracy_of_known"] == pytest.approx((truth == predicted)[known].mean())
    # A class of its own without support, as scikit-learn counts it.
    answers = np.where(known, predicted, -1)
    weighted = metrics.f1_score(truth, answers, average="weighted", labels=range(4))
    assert report["scores"]["weighted_f1"] == pytest.approx(weighted)


def test_doubtful_scores_are_refused_or_warned_of(tmp_path: Path) -> None:
    path = tmp_path / "p.csv"
    path.write_text("id,true,predicted,p_x,p_y\na,x,x,0.1,0.9\nb,y,y,0.8,0.2\n")
    with pytest.warns(UserWarning, match="no class predicted is the most probable one"):
        assert corsmal_feat.score(path)["accuracy"] == 1.0
    path.write_text("id,true,predicted\na,1,1.0\nb,2,2.0\n")
    with pytest.raises(ParameterError, match="are the same number"):
        corsmal_feat.score(path)
    path.write_text("id,true,predicted\na,x,x\nb,y,y\n")
    labels = tmp_path / "labels.csv"
    labels.write_text("id,class\na,y\nb,x\n")
    assert corsmal_feat.score(path, labels=labels)["accuracy"] == 0.0


def test_numbers_are_scored(tmp_path: Path) -> None:
    path = tmp_path / "p.csv"
    truth = np.array([100.0, 250.5, 0.0, 80.0])
    found = np.array([110.0, 200.0, 0.5, 80.0])
    lines = [f"r{i},{t},{e}\n" for i, (t, e) in enumerate(zip(truth, found, strict=True))]
    path.write_text("id,true,predicted\n" + "".join(lines))
    report = corsmal_feat.score(path)
    assert report.kind == "numbers"
    assert report["mean_absolute_error"] == pytest.approx(metrics.mean_absolute_error(truth, found))
    assert report["r2"] == pytest.approx(metrics.r2_score(truth, found))
    errors = np.array([0.1, 50.5 / 250.5, 0.5, 0.0])
    assert report["score"] == pytest.approx(np.exp(-errors).mean())
    assert report["mean_relative_error"] == pytest.approx(errors[[0, 1, 3]].mean())


@pytest.fixture
def table(tmp_path: Path) -> Path:
    """Sixty rows of two classes in six groups."""
    rng = np.random.default_rng(5)
    y = np.arange(60) % 2
    path = tmp_path / "x.npz"
    kind = np.array(["rice", "water"])[y]
    group = np.array([f"g{i // 10}" for i in range(60)])
    np.savez(path, X=rng.normal(size=(60, 4)) + y[:, None], kind=kind, group=group)
    return path


def test_cross_validation_gives_scores_and_predictions(table: Path, tmp_path: Path) -> None:
    result = corsmal_feat.cross_validate(
        table, "kind", groups="group", classifier="knn", parameters={"n_neighbors": 3}
    )
    assert len(result.report["result"]["folds"]) == 6
    assert len(result.predictions) == 60
    held_out = result.predictions
    pairs = zip(held_out.columns["true"], held_out.predicted, strict=True)
    right = np.mean([truth == predicted for truth, predicted in pairs])
    assert result.report["result"]["pooled"]["accuracy"] == pytest.approx(right)
    out = tmp_path / "held-out.csv"
    result.predictions.save(out)
    result.predictions.save(out)
    with pytest.raises(ParameterError, match="already exists"):
        result.predictions.save(out, overwrite=False)
    assert corsmal_feat.score(out)["accuracy"] == pytest.approx(right)
    with pytest.warns(UserWarning, match="rows of one group are in both training and test"):
        tuned = corsmal_feat.cross_validate(
            table, "kind", cv=3, classifier="knn", tune={"k": [1, 5]}
        )
    assert len(tuned.report["candidates"]) == 2
    with pytest.raises(ParameterError, match="did you mean"):
        corsmal_feat.cross_validate(table, "kinds", cv=3)
    with pytest.raises(ParameterError, match="expected a number of folds"):
        corsmal_feat.cross_validate(table, "kind", cv="leave-one")


def test_files_are_fused_and_compared(tmp_path: Path) -> None:
    one, two = tmp_path / "one.csv", tmp_path / "two.csv"
    truth, first, _ = predictions(one, seed=1)
    rows = one.read_text().splitlines()
    two.write_text("\n".join([rows[0], *reversed(rows[1:])]) + "\n")
    with pytest.warns(UserWarning, match="rows of one group are not independent"):
        same = corsmal_feat.compare_predictions(one, two, resamples=50)
    assert (same.only_first, same.only_second, same.p_value, same.difference) == (0, 0, 1.0, 0.0)
    # Ten windows of each of four recordings: the first errs in one of them, the second nowhere.
    for path, wrong in ((one, 10), (two, 0)):
        lines = [f"{w},{w // 10},x,{'y' if w < wrong else 'x'}\n" for w in range(40)]
        path.write_text("id,recording,true,predicted\n" + "".join(lines))
    with pytest.warns(UserWarning, match="rows of one recording are not independent"):
        grouped = corsmal_feat.compare_predictions(one, two, resamples=200)
    assert (grouped.low, grouped.report["bootstrap_groups"]["p_value"]) == (0.0, None)
    assert grouped.report["bootstrap_rows"]["low"] > 0.05
    with pytest.raises(ParameterError, match='no column "speaker" of groups'):
        corsmal_feat.compare_predictions(one, two, groups="speaker")
    lines = [f"{w},{w // 20},x,{'xy'[w % 2]}\n" for w in range(40)]
    two.write_text("id,fold,true,predicted\n" + "".join(lines))
    one.write_text("id,true,predicted\n" + "".join(f"{w},x,x\n" for w in range(40)))
    with pytest.warns(UserWarning, match=r"two\.csv has folds and .*one\.csv has none"):
        corsmal_feat.compare_predictions(one, two, resamples=50)
    with pytest.raises(ParameterError, match="resamples must be at least 1"):
        corsmal_feat.score(one, resamples=0)
    predictions(one, seed=1)
    two.write_text(one.read_text())
    fused = corsmal_feat.fuse([one, two], weights=[1, 2])
    assert fused.predicted == [NAMES[c] for c in first]
    assert fused.columns["true"] == [NAMES[c] for c in truth]
    with pytest.raises(ParameterError, match="weights"):
        corsmal_feat.fuse([one, two], weights=[1])
    windows = tmp_path / "windows.csv"
    windows.write_text("id,start,predicted,p_a,p_b\nx,0,a,1,0\nx,1,b,0,1\nx,2,b,0.4,0.6\n")
    assert corsmal_feat.fuse(windows, vote="majority").predicted == ["b"]
    with pytest.raises(ParameterError, match="more than one row"):
        corsmal_feat.fuse(windows)


def test_labels_come_from_a_file_or_from_folders(tmp_path: Path) -> None:
    path, labels = tmp_path / "p.csv", tmp_path / "meta.csv"
    path.write_text("id,path,predicted,p_cat,p_dog\nx,cat/x.ogg,cat,1,0\ny,dog/y.ogg,cat,0.6,0.4\n")
    labels.write_text("file,category\ny.ogg,cat\nx.ogg,cat\n")
    by_file = corsmal_feat.score(path, labels=labels, id_column="file", target="category")
    assert by_file["accuracy"] == 1.0
    assert corsmal_feat.score(path, labels="folders")["accuracy"] == 0.5
    with pytest.raises(ParameterError, match="true classes"):
        corsmal_feat.score(path)


def test_labels_without_recordings_are_told(tmp_path: Path) -> None:
    labels, file = tmp_path / "all.csv", tmp_path / "p.csv"
    file.write_text("id,predicted\na,x\nb,y\n")
    labels.write_text("id,class\na,x\nb,y\nc,x\n")
    with pytest.warns(UserWarning, match='line 4 of .*, "c", has no recording here'):
        assert corsmal_feat.score(file, labels=labels)["accuracy"] == 1.0
    file.write_text("id,predicted\na,1.5\nb,2.5\n")
    labels.write_text("id,n\na,1.5\nb,2.5\nc,1.5\n")
    with pytest.warns(UserWarning, match="has no recording here"):
        assert corsmal_feat.score(file, labels=labels)["score"] == 1.0
    table = {"X": np.arange(40.0).reshape(20, 2), "id": np.array([str(i) for i in range(20)])}
    np.savez(tmp_path / "x.npz", **table)
    labels.write_text("id,y\n" + "".join(f"{i},{i % 2}\n" for i in range(21)))
    with pytest.warns(UserWarning, match='"20", has no recording here'):
        corsmal_feat.cross_validate(
            tmp_path / "x.npz", "y", labels=labels, classifier="knn", cv="k=2"
        )


def test_the_only_label_column_replaces_the_true_classes_of_the_file(tmp_path: Path) -> None:
    path, labels = tmp_path / "p.csv", tmp_path / "labels.csv"
    path.write_text("id,true,predicted\na,x,x\nb,y,y\n")
    labels.write_text("id,class\na,y\nb,x\n")
    assert corsmal_feat.score(path)["accuracy"] == 1.0
    assert corsmal_feat.score(path, labels=labels)["accuracy"] == 0.0
    assert corsmal_feat.score(path, labels=labels, target="class")["accuracy"] == 0.0


def test_scores_are_read_as_from_a_mapping(tmp_path: Path) -> None:
    predictions(tmp_path / "p.csv", seed=3)
    scored = corsmal_feat.score(tmp_path / "p.csv")
    assert "accuracy" in scored and "nothing" not in scored
    assert list(scored) == list(scored.values) and len(scored) == len(scored.values)
    assert dict(scored) == scored.values
