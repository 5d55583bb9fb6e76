"""The 12 CORSMAL audio baselines on ESC-10, from the .ogg files, as a Markdown table.

    python experiments/esc10_baselines.py [--tool corsmal-feat] [--shared ../shared] [--work DIR]
        [--librosa 0.8]

Runs `corsmal-feat extract` and `corsmal-feat cross-validate --cv fold=fold`, and prints mean
accuracy over the five published folds next to the reference runs; for forests, the mean of seeds 0
to 4. The settings are those of the published baselines; nothing is chosen. Classes are numbers, as
in the reference, where the lower one wins a tie; with names, their order would decide.
"""

from __future__ import annotations

import argparse
import csv
import json
import pathlib
import statistics
import subprocess
import tempfile

#: row of the reference file: preset, options before the classifier
INPUTS = {
    "ZCR+MFCC 26": ("esc26", []),
    "AF193": ("af193", []),
    "Spectrogram 9216": ("spec9216-code", []),
    "Spectrogram PCA128 fitted on train": ("spec9216-code", ["--pca", "128"]),
}
CLASSIFIERS = {
    "kNN5": ["--classifier", "knn"],
    "SVC_C20_g1e-5": ["--classifier", "svm", "--set", "C=20", "--set", "gamma=1e-5"],
    "RF100": ["--classifier", "rf"],
}


def manifest(data: pathlib.Path, target: pathlib.Path) -> None:
    """Path, class number and fold of every clip."""
    with open(data / "meta.csv", newline="") as source, open(target, "w", newline="") as to:
        rows = csv.writer(to)
        rows.writerow(["path", "class_id", "fold"])
        for clip in csv.DictReader(source):
            path = (data / "audio" / clip["file"]).resolve()
            rows.writerow([path, clip["class_id"], clip["fold"]])


def accuracy(tool: str, features: pathlib.Path, options: list[str]) -> float:
    command = [tool, "cross-validate", "--features", features, "--target", "class_id", "--json"]
    run = subprocess.run(
        [*command, "--cv", "fold=fold", *options], check=True, stdout=subprocess.PIPE
    )
    return 100 * json.loads(run.stdout)["result"]["accuracy"]["mean"]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--tool", default="corsmal-feat")
    parser.add_argument("--shared", default="../shared", type=pathlib.Path)
    parser.add_argument("--work", type=pathlib.Path, help="folder in which to keep the features")
    parser.add_argument("--librosa", help="librosa version whose conventions are used")
    arguments = parser.parse_args()
    data = arguments.shared / "data" / "esc10"
    reference: dict[tuple[str, str], list[float]] = {}
    with open(data / "esc10_reference_runs.csv", newline="") as source:
        for row in csv.DictReader(source):
            key = (row["features"], row["classifier"])
            reference.setdefault(key, []).append(float(row["mean_fold_accuracy"]))
    with tempfile.TemporaryDirectory() as temporary:
        work = arguments.work or pathlib.Path(temporary)
        manifest(data, work / "esc10.csv")
        print("| input | classifier | reference | measured | difference |\n|---|---|---|---|---|")
        for name, (preset, steps) in INPUTS.items():
            features = work / f"{preset}.npz"
            if not features.exists():
                inputs = ["--in", work / "esc10.csv", "--out", features, "--preset", preset]
                switch = ["--set", f"librosa={arguments.librosa}"] if arguments.librosa else []
                subprocess.run([arguments.tool, "extract", *inputs, *switch], check=True)
            for classifier, options in CLASSIFIERS.items():
                seeds = range(5) if classifier.startswith("RF") else range(1)
                runs = [
                    accuracy(arguments.tool, features, [*steps, *options, "--seed", str(seed)])
                    for seed in seeds
                ]
                expected = statistics.mean(reference[name, classifier])
                found = statistics.mean(runs)
                print(
                    f"| {name} | {classifier} | {expected:.2f} | {found:.2f} | "
                    f"{found - expected:+.2f} |",
                    flush=True,
                )


if __name__ == "__main__":
    main()
