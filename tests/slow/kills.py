"""Kills runs of `extract` at random moments and resumes them.

    python tests/slow/kills.py --kills 200

For each of five kinds of run, this checks that the finished output has the bytes of an undisturbed
run, and counts the recordings that are read again because they were read but not yet recorded when
the kill came. The system reports opened files (inotify, so Linux only). Results are written in the
order of the inputs, and at most four per job wait for their turn: the exit code is 1 if bytes
differ, or if a kill costs more than that.
"""

from __future__ import annotations

import argparse
import ctypes
import os
import random
import struct
import subprocess
import sys
import tempfile
import time
import wave
from collections import Counter
from pathlib import Path

FILES = 200
IN_OPEN, IN_CLOSE_NOWRITE, IN_Q_OVERFLOW = 0x20, 0x10, 0x4000

KINDS = {
    "frames.npz": ["--preset", "logmel", "--jobs", "2"],
    "compressed.npz": ["--preset", "logmel", "--compress", "--jobs", "2"],
    "resampled.npz": ["--preset", "logmel", "--set", "signal.sample_rate=16000", "--jobs", "4"],
    "table.npz": ["--preset", "mfcc-zcr", "--jobs", "2"],
    "table.parquet": ["--preset", "mfcc-zcr", "--jobs", "1"],
}


class Opened:
    """Counts how often each file of a folder is opened."""

    def __init__(self, folder: Path) -> None:
        libc = ctypes.CDLL(None, use_errno=True)
        self.fd = libc.inotify_init1(os.O_NONBLOCK)
        # Closing too: events that are equal and follow each other are reported as one.
        wanted = IN_OPEN | IN_CLOSE_NOWRITE
        if self.fd < 0 or libc.inotify_add_watch(self.fd, os.fsencode(folder), wanted) < 0:
            raise OSError(ctypes.get_errno(), "inotify")

    def take(self) -> Counter[str]:
        """The files opened since the last call."""
        names: Counter[str] = Counter()
        while True:
            try:
                events = os.read(self.fd, 1 << 20)
            except BlockingIOError:
                return names
            at = 0
            while at < len(events):
                _, mask, _, length = struct.unpack_from("iIII", events, at)
                at += 16 + length
                if mask & IN_Q_OVERFLOW:
                    raise OSError("more files were opened than inotify could record")
                if mask & IN_OPEN and length:  # else the folder itself
                    names[events[at - length : at].rstrip(b"\0").decode()] += 1


def recordings(folder: Path, rng: random.Random) -> None:
    """Recordings of unequal length, an hour old, since the content of new files is also read."""
    for i in range(FILES):
        path = folder / f"r{i:04}.wav"
        with wave.open(str(path), "wb") as file:
            file.setnchannels(2)
            file.setsampwidth(2)
            file.setframerate(22_050)
            file.writeframes(rng.randbytes(4 * 22_050 * rng.randrange(1, 6)))
        os.utime(path, (time.time() - 3600,) * 2)


def done(out: Path) -> int:
    """Number of recordings in the ledger."""
    ledger = Path(f"{out}.ledger")
    return max(0, ledger.read_bytes().count(b"\n") - 1) if ledger.exists() else 0


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--kills", type=int, default=200)
    parser.add_argument("--command", default=os.environ.get("CORSMAL_FEAT", "corsmal-feat"))
    parser.add_argument("--seed", type=int, default=1)
    args = parser.parse_args()
    rng = random.Random(args.seed)
    failed = False
    print("| output | jobs | kills | read again: mean | most | bytes |\n|---|---|---|---|---|---|")
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        audio = folder / "audio"
        audio.mkdir()
        recordings(audio, rng)
        opened = Opened(audio)
        for kind, options in KINDS.items():
            whole, out = folder / f"whole-{kind}", folder / kind
            command = [args.command, "extract", str(audio), *options, "--resume", "--quiet"]
            started = time.monotonic()
            subprocess.run([*command, "--out", str(whole)], check=True)
            seconds = time.monotonic() - started
            # A table's run opens each recording once more, for the number of its channels.
            times = opened.take()
            [opens] = set(times.values())
            jobs = int(options[-1])
            again: list[int] = []
            while len(again) < args.kills // len(KINDS):
                before = done(out)
                child = subprocess.Popen([*command, "--out", str(out)])
                time.sleep(rng.uniform(0, seconds / 4))
                child.kill()
                child.wait()
                read = sum(count == opens for count in opened.take().values())
                if out.exists():
                    # The next run removes the ledger of one that was killed after its last step.
                    subprocess.run([*command, "--out", str(out)], check=True)
                    opened.take()
                    failed |= out.read_bytes() != whole.read_bytes() or done(out) > 0
                    out.unlink()
                else:
                    again.append(read - (done(out) - before))
            subprocess.run([*command, "--out", str(out)], check=True)
            opened.take()
            same = out.read_bytes() == whole.read_bytes()
            failed |= not same or max(again) > 4 * jobs
            mean = sum(again) / len(again)
            print(
                f"| {kind} | {jobs} | {len(again)} | {mean:.2f} | {max(again)} "
                f"| {'the same' if same else 'OTHERS'} |",
                flush=True,
            )
    return int(failed)


if __name__ == "__main__":
    sys.exit(main())
