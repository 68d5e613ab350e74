"""How the answers of each method depend on one axis of a grid, or on two together."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from simbench.bench.score.answers import answers_of, axis_codes
from simbench.bench.score.names import ROLE_YARDSTICK
from simbench.bench.score.tally import counted, long_table, tallied, with_names
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
    axes = [axis] if isinstance(axis, str) else list(axis)
    for name in axes:
        if name not in book.along:
            raise ParameterError(f"no axis {name!r} in this run: {nearest(name, book.along)}")
    if not 0 < len(set(axes)) == len(axes) <= _MOST:
        raise ParameterError(f"axes {', '.join(axes) or '(none)'}: one axis or two different ones")
    if truth not in TRUTHS:
        raise ParameterError(f"truth {truth!r}: {nearest(truth, TRUTHS)}")
    values, codes = zip(*(axis_codes(book, name) for name in axes), strict=True)
    everyone = [a for a in answers_of(book) if a.role != ROLE_YARDSTICK]
    label = book.truth[truth]
    counts = counted(long_table(everyone), label=label, **dict(zip(axes, codes, strict=True)))
    table = tallied(counts, [*axes, "method"])[["n", "applicable", "sticky", *_SHOWN]]
    table = table[table["n"] > 0].drop(columns="n").reset_index()
    table = table.rename(columns={"applicable": "n", "sticky": "positives"})
    # one more value than there are: of loops that have none
    texts = [np.array([*of, None], dtype=object) for of in values]
    for name, text in zip(axes, texts, strict=True):
        table[name] = text[table[name]]
    table = table[table[axes].notna().all(axis=1)]
    table = with_names(table, everyone)
    return table.loc[:, ["method", *axes, "n", "positives", *_SHOWN]].reset_index(drop=True)
