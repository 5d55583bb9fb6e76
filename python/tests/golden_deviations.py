"""Prints how far the package is from each function's golden cases; docs/parity.md quotes it.

Of every function: cases, refusals, the largest deviation, the largest one relative to the largest
value of its case, and the largest one relative to the case's own tolerance.
"""

from __future__ import annotations

import warnings

import numpy as np
from test_golden import CASES, FUNCTIONS, archive, arguments_of, function_of


def deviations(function: str) -> tuple[int, int, float, float, float]:
    refusals, absolute, relative, of_tolerance = 0, 0.0, 0.0, 0.0
    cases = [case for case in CASES if case["function"] == function]
    for case in cases:
        if "raises" in case:
            refusals += 1
            continue
        got = np.asarray(function_of(function)(**arguments_of(case)))
        if "select" in case:
            got = np.take(got, case["select"]["indices"], case["select"]["axis"])
        want, tolerance = archive(case["file"])[case["key"]], case["tolerance"]
        error = np.abs(got - want)
        if not error.size:
            continue
        limit = tolerance["atol"] + tolerance["rtol"] * np.abs(want)
        absolute = max(absolute, float(error.max()))
        relative = max(relative, float(error.max() / max(np.abs(want).max(), 1e-300)))
        of_tolerance = max(of_tolerance, float((error / np.maximum(limit, 1e-300)).max()))
    return len(cases), refusals, absolute, relative, of_tolerance


def main() -> None:
    print("| function | cases | refused | largest | of the maximum | of the tolerance |")
    print("|---|---|---|---|---|---|")
    for function in FUNCTIONS:
        cases, refusals, absolute, relative, of_tolerance = deviations(function)
        values = f"{absolute:.1e} | {relative:.1e} | {of_tolerance:.2f}"
        print(f"| `{function}` | {cases} | {refusals} | {values} |")


if __name__ == "__main__":
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        main()
