"""Tables and charts of the macro benchmarks in docs/speed.md and docs/speed.svg."""

from __future__ import annotations

import pathlib
import re
import statistics
from collections.abc import Callable, Iterable, Sequence
from typing import Any


def write(results: dict[str, Any], docs: pathlib.Path) -> None:
    """Replaces the text between `<!-- NAME -->` and `<!-- /NAME -->`, and draws the charts."""
    page = docs / "speed.md"
    text = page.read_text()
    for name, section in SECTIONS.items():
        if name not in results:
            continue
        result = results[name]
        stamp = f"{result['date']}, {result['machine']}, {result['version']}."
        body = "\n".join([*section(result["rows"]), "", stamp])
        pattern = re.compile(rf"(<!-- {name} -->\n).*?(<!-- /{name} -->)", re.DOTALL)
        if not pattern.search(text):
            raise SystemExit(f"{page} has no markers <!-- {name} --> … <!-- /{name} -->")
        replacement = f"\n{body}\n\n"
        text = pattern.sub(lambda m, r=replacement: m[1] + r + m[2], text)
    page.write_text(text)
    if "peers" in results:
        (docs / "speed.svg").write_text(chart(results["peers"]))
    if "presets" in results:
        (docs / "speed-presets.svg").write_text(preset_chart(results["presets"]))


def table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> list[str]:
    """A Markdown table."""
    lines = ["| " + " | ".join(cells) + " |" for cells in (head, *rows)]
    return [lines[0], "|" + "---|" * len(head), *lines[1:]]


def median(run: dict[str, Any], name: str = "seconds") -> float:
    return statistics.median(run[name])


def spread(run: dict[str, Any]) -> str:
    """Median and extremes of the seconds."""
    low, high = min(run["seconds"]), max(run["seconds"])
    return f"{median(run):.3f} s ({low:.3f}-{high:.3f})"


def peers(rows: dict[str, Any]) -> list[str]:
    seconds, cells = rows["seconds"], []
    head = ["workload", "corsmal-feat", "x real time", "peer", "its time", "ratio"]
    head += ["CPU s", "peak MiB", "largest difference"]
    for key, row in sorted(rows["workloads"].items()):
        mine, theirs = row["ours"], row["theirs"]
        ratio = median(theirs) / median(mine)
        cells.append(
            [
                f"{key} {row['title']}",
                spread(mine),
                f"{seconds / median(mine):,.0f}",
                f"{row['peer']} {row['peer_version']}",
                spread(theirs),
                f"**{ratio:.1f}**",
                f"{median(mine, 'cpu'):.2f} / {median(theirs, 'cpu'):.2f}",
                f"{median(mine, 'mib'):.0f} / {median(theirs, 'mib'):,.0f}",
                f"{row['difference']['largest']:.1e}",
            ]
        )
    repeats = min(len(row["ours"]["seconds"]) for row in rows["workloads"].values())
    note = f"Medians (least-most) of {repeats} runs in turn; {seconds:.0f} s of recordings."
    return [*table(head, cells), "", note]


def presets(rows: dict[str, Any]) -> list[str]:
    cells = []
    for preset, run in rows["runs"].items():
        mine, theirs = median(run["ours"], "cpu"), median(run["theirs"], "cpu")
        each = 1e3 * mine / rows["number"]
        cells.append([f"`{preset}`", f"{mine:.2f}", f"{theirs:.2f}", f"**{theirs / mine:.1f}**"])
        cells[-1].append(f"{each:.1f} ms")
    head = ["preset", "corsmal-feat, CPU s", "original, CPU s", "ratio", "ours a recording"]
    note = f"{rows['number']} recordings of 8 channels, {rows['seconds']:.0f} s together."
    return [*table(head, cells), "", note]


def scaling(rows: dict[str, Any]) -> list[str]:
    cells = [
        [title, spread(one), spread(two), f"{median(one) / median(two):.2f}"]
        for title, (one, two) in rows.items()
    ]
    return table(["", "1 job", "2 jobs", "ratio"], cells)


def benchmark(rows: dict[str, Any]) -> list[str]:
    cells = [
        [title, spread(one), spread(two), f"{median(two, 'cpu'):.1f}", f"{median(two, 'mib'):,.0f}"]
        for title, (one, two) in rows.items()
    ]
    return table(["", "1 job", "2 jobs", "CPU s", "peak MiB"], cells)


def channels(rows: dict[str, Any]) -> list[str]:
    cells = []
    for title, runs in rows["runs"].items():
        costs = {n: 1e6 * median(run) / rows["channel_seconds"] for n, run in runs.items()}
        row = [f"{cost:.0f} us ({cost / costs['8']:.2f})" for cost in costs.values()]
        cells.append([title, *row])
    head = ["cost of a channel-second", *(f"{n} channels" for n in ("1", "2", "8"))]
    return table([cell.replace("1 channels", "1 channel") for cell in head], cells)


def nfft(rows: dict[str, Any]) -> list[str]:
    cells = [
        [
            n,
            spread(run["ours"]),
            spread(run["theirs"]),
            f"{median(run['theirs']) / median(run['ours']):.1f}",
        ]
        for n, run in rows["runs"].items()
    ]
    return table(["`n_fft`", "corsmal-feat", "librosa", "ratio"], cells)


def startup(rows: dict[str, Any]) -> list[str]:
    cells = [
        [f"`{command}`", f"{1e3 * median(run):.1f} ms", f"{1e3 * min(run['seconds']):.1f} ms"]
        for command, run in rows.items()
    ]
    return table(["command", "median", "least"], cells)


def memory(rows: dict[str, float]) -> list[str]:
    return table(["workload", "peak MiB"], [[key, f"{mib:.0f}"] for key, mib in rows.items()])


def instructions(rows: dict[str, Any]) -> list[str]:
    cells = [[key, f"{count / 1e6:,.1f}"] for key, count in rows["counts"].items()]
    note = f"One recording of 8 channels and {rows['seconds']:.1f} s, one job."
    return [*table(["run", "million instructions"], cells), "", note]


SECTIONS: dict[str, Callable[[Any], list[str]]] = {
    "peers": peers,
    "presets": presets,
    "scaling": scaling,
    "benchmark": benchmark,
    "channels": channels,
    "nfft": nfft,
    "startup": startup,
    "memory": memory,
    "instructions": instructions,
}

STYLE = """
  text { font: 13px system-ui, sans-serif; fill: #24292f; }
  .note { font-size: 11px; fill: #57606a; }
  .head { font-weight: 600; }
  .ours { fill: #0969da; }
  .theirs { fill: #8c959f; }
  @media (prefers-color-scheme: dark) {
    text { fill: #e6edf3; }
    .note { fill: #9198a1; }
    .ours { fill: #4493f8; }
    .theirs { fill: #656c76; }
  }
"""


def chart(result: dict[str, Any]) -> str:
    """Bars of speed relative to real time, on one scale for all workloads."""
    rows = result["rows"]
    workloads = sorted(rows["workloads"].items())
    speeds = [
        [rows["seconds"] / median(row[side]) for side in ("ours", "theirs")] for _, row in workloads
    ]
    width, left, bar, group = 720, 240, 17, 52
    scale = (width - left - 150) / max(max(pair) for pair in speeds)
    parts = [
        '<text class="head" x="10" y="22">Times real time, whole run with two jobs</text>',
        f'<text class="note" x="10" y="40">{result["date"]}, {result["machine"]}</text>',
    ]
    for i, ((key, row), (ours, theirs)) in enumerate(zip(workloads, speeds, strict=True)):
        top = 58 + i * group
        title = row["title"].replace("`", "")
        parts.append(f'<text x="10" y="{top + 22}">{key} {title}</text>')
        faster = f"{ours:,.0f} x ({ours / theirs:.1f} times {row['peer']})"
        for kind, y, speed, label in (
            ("ours", top, ours, faster),
            ("theirs", top + bar + 2, theirs, f"{theirs:,.0f} x"),
        ):
            length = max(speed * scale, 1.0)
            shape = f'x="{left}" y="{y}" width="{length:.1f}" height="{bar}" rx="2"'
            parts.append(f'<rect class="{kind}" {shape}/>')
            place = f'x="{left + length + 6:.1f}" y="{y + 13}"'
            parts.append(f'<text class="note" {place}>{label}</text>')
    height = 58 + len(workloads) * group
    label = 'role="img" aria-label="Speed of corsmal-feat and its peers"'
    size = f'viewBox="0 0 {width} {height}"'
    open_tag = f'<svg xmlns="http://www.w3.org/2000/svg" {size} {label}>'
    return "\n".join([open_tag, f"<style>{STYLE}</style>", *parts, "</svg>", ""])


def preset_chart(result: dict[str, Any]) -> str:
    """A bar for each preset: CPU time of the original divided by ours."""
    runs = result["rows"]["runs"]
    ratios = {
        preset: median(run["theirs"], "cpu") / median(run["ours"], "cpu")
        for preset, run in runs.items()
    }
    width, left, bar, step = 720, 130, 15, 22
    scale = (width - left - 90) / max(ratios.values())
    head = "CPU seconds of the original code over those of the preset"
    parts = [
        f'<text class="head" x="10" y="22">{head}</text>',
        f'<text class="note" x="10" y="40">{result["date"]}, {result["machine"]}</text>',
    ]
    for i, (preset, ratio) in enumerate(ratios.items()):
        top = 54 + i * step
        length = ratio * scale
        parts.append(f'<text x="10" y="{top + 12}">{preset}</text>')
        shape = f'x="{left}" y="{top}" width="{length:.1f}" height="{bar}" rx="2"'
        parts.append(f'<rect class="ours" {shape}/>')
        place = f'x="{left + length + 6:.1f}" y="{top + 12}"'
        parts.append(f'<text class="note" {place}>{ratio:.0f} times</text>')
    height = 62 + len(ratios) * step
    label = 'role="img" aria-label="Speed of every preset against its original"'
    size = f'viewBox="0 0 {width} {height}"'
    open_tag = f'<svg xmlns="http://www.w3.org/2000/svg" {size} {label}>'
    return "\n".join([open_tag, f"<style>{STYLE}</style>", *parts, "</svg>", ""])
