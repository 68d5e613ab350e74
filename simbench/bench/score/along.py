"""How the answers of each method depend on one axis of a grid, or on two together."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product
from typing import TYPE_CHECKING

import numpy as np

from simbench.bench.score.answers import answers_of, axis_codes
from simbench.bench.score.names import ROLE_YARDSTICK
from simbench.bench.score.rates import coded, counted, rates_of
from simbench.bench.store.reading import TRUTHS, RunArrays
from simbench.detectors.errors import ParameterError, nearest

if TYPE_CHECKING:
    import pandas as pd

_MOST = 2  # axes of a table that can be read
_SHOWN = [
    f"{name}{end}"
    for name in ("accuracy", "sensitivity", "false_positives", "no_decision")
    for end in ("", "_lo", "_hi")
]


def along(book: RunArrays, axis: str | Sequence[str], truth: str = "cycled") -> pd.DataFrame:
    """Return rates by method and value of one axis or two; see `Scores.along`."""
    import pandas as pd

    axes = [axis] if isinstance(axis, str) else list(axis)
    for name in axes:
        if name not in book.along:
            raise ParameterError(f"no axis {name!r} in this run: {nearest(name, book.along)}")
    if not 0 < len(set(axes)) == len(axes) <= _MOST:
        raise ParameterError(f"axes {', '.join(axes) or '(none)'}: one axis or two different ones")
    if truth not in TRUTHS:
        raise ParameterError(f"truth {truth!r}: {nearest(truth, TRUTHS)}")
    values, codes = zip(*(axis_codes(book, name) for name in axes), strict=True)
    known = book.truth[truth].astype(int) + 1
    shape = (3, *(len(v) + 1 for v in values))
    everyone = [a for a in answers_of(book) if a.role != ROLE_YARDSTICK]
    found = counted(
        np.ravel_multi_index((known, *codes), shape), shape, [coded(a) for a in everyone]
    )
    columns = ["value"] if isinstance(axis, str) else axes
    rows = []
    for place in product(*map(range, map(len, values))):
        at = {name: v[k] for name, v, k in zip(columns, values, place, strict=True)}
        for a, counts in zip(everyone, found, strict=True):
            here = counts[(slice(None), *place)]
            if not here[1:].sum():
                continue
            rates = rates_of(here)
            shares = {name: rates[name] for name in _SHOWN}
            rows.append({"method": a.method, **at, "n": int(here[1:, :, 1].sum()), **shares})
    return pd.DataFrame(rows, columns=["method", *columns, "n", *_SHOWN])
