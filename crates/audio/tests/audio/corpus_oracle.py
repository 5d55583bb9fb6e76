"""Checks corpus.csv against other readers: python corpus_oracle.py CORPUS_FOLDER (needs soundfile, scipy).

Every accepted file that libsndfile reads, too, must give libsndfile's samples; integers of more than 32 bits, which
libsndfile refuses, must give scipy's. Prints which reader vouches for each accepted file.
"""

import csv
import sys
import warnings
from pathlib import Path

import numpy as np
import soundfile
from scipy.io import wavfile


def checksum(samples):
    """FNV-1a (64 bits) over little-endian float32."""
    h = 0xCBF29CE484222325
    for byte in np.ascontiguousarray(samples, "<f4").tobytes():
        h = (h ^ byte) * 0x100000001B3 & 0xFFFFFFFFFFFFFFFF
    return f"{h:016x}"


def by_libsndfile(path):
    """Samples as float32 [frames, channels]."""
    return soundfile.read(path, dtype="float32", always_2d=True)[0]


def by_scipy(path):
    """Samples as float32 [frames, channels]; scipy left-justifies wide integers."""
    _, x = wavfile.read(path)
    scale = 2.0 ** (8 * x.dtype.itemsize - 1) if x.dtype.kind == "i" else 1.0
    if x.dtype == np.uint8:
        x, scale = x.astype(int) - 128, 128.0
    return (x.astype(np.float32) / np.float32(scale)).reshape(len(x), -1)


def main():
    """Prints the verdicts; exit code 1 where a reader contradicts the table."""
    root = Path(sys.argv[1])
    wrong = 0
    votes = {}
    warnings.simplefilter("ignore")
    for row in csv.DictReader(open(Path(__file__).with_name("corpus.csv"))):
        if row["status"] != "ok":
            continue
        vouching = []
        for name, reader in [("libsndfile", by_libsndfile), ("scipy", by_scipy)]:
            try:
                x = reader(root / row["file"])
            except Exception:
                continue
            same = checksum(x) == row["checksum"] and len(x) == int(row["frames"])
            vouching += [name] if same else []
            if name == "libsndfile" and not same:
                wrong += 1
                print(row["file"], "differs from libsndfile")
        key = "+".join(vouching) or "nobody"
        votes.setdefault(key, []).append(row["file"])
    for key, files in votes.items():
        shown = files if len(files) < 8 else files[:3] + ["..."]
        print(f"{key}: {len(files)}", *shown, sep="\n  ")
    sys.exit(wrong > 0)


main()
