"""The helpers beside values kept from librosa 0.11 (see librosa_cases.py)."""

from __future__ import annotations

import corsmal_feat
import numpy as np
import pytest
from librosa_cases import Case, cases, load, values

GOLDENS = load()


def test_every_case_has_a_golden_value() -> None:
    assert GOLDENS.keys() == cases().keys()


@pytest.mark.parametrize(("name", "case"), cases().items(), ids=cases().keys())
def test_golden(name: str, case: Case) -> None:
    found, wanted = values(case, corsmal_feat), GOLDENS[name]
    if isinstance(wanted, str):
        assert found == wanted
        return
    assert found != "refused" and len(found) == len(wanted)
    for part, want in zip(found, wanted, strict=True):
        assert part.shape == want.shape
        assert part.dtype == want.dtype
        if want.dtype.kind in "iub":
            assert np.array_equal(part, want)
            continue
        # Single precision is that of the signal, also where the result is in hertz.
        single = want.dtype in (np.float32, np.complex64) or name.endswith(" single")
        scale = np.abs(want[np.isfinite(want)]).max(initial=0.0)
        tolerance = (3e-6 if single else 1e-9) * scale
        assert np.allclose(part, want, rtol=0, atol=tolerance, equal_nan=True)
