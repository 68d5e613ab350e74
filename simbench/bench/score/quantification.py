"""S and J scored: how far a method's S and J lie from the valve's, and whether intervals hold as
often as they are said to.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from simbench.bench.score.compare import Paired, Pairs
from simbench.bench.store.reading import RunArrays

if TYPE_CHECKING:
    import pandas as pd

_COLUMNS = ("method", "family", "parameter", "n", "median_error", "coverage", "width")
_ENOUGH = 60  # estimates of a family of valves: fewer are scored, but not checked
COVERAGE = "coverage"
MEDIAN_ERROR = "median error"
_ALLOWED = {
    COVERAGE: 0.03,
    MEDIAN_ERROR: 0.02,
}  # moves that are no regression; errors in shares of S
# of the loops whose S or J a method gave before, that it must still give to be compared
_KEPT = 0.8


def estimates(book: RunArrays) -> pd.DataFrame:
    """Return every S and J that a method gave of a sticky valve, whose mapped S is the unit of
    errors and widths.

    Columns: loop (its number in the run), method, family, parameter, error, width and held; the
    last two are NaN where the method states no level for its interval, or gave a number.
    """
    import pandas as pd

    # Every size of a sticky loop that was stated
    loop, number = np.nonzero(~np.isnan(book.sizes).all(axis=0).T)
    sticky = book.friction[loop, 0] > 0.0
    loop = loop[sticky]
    number = number[sticky]
    method = np.array(book.methods, dtype=object)[number]
    about = {}
    for m in book.methods:
        about[m] = book.manifest["methods"][m].get("stated", ())

    # S and J by themselves: error, width, and whether the interval holds the truth
    parts = []
    for k, name in enumerate(("S", "J")):
        lo, hi = book.sizes[2 * k : 2 * k + 2, number, loop]
        truth = book.friction[loop, k]
        S = book.friction[loop, 0]
        stated = np.array([name in about[m] for m in method], dtype=bool) & (lo < hi)
        part = pd.DataFrame(
            {"loop": loop, "method": method, "family": book.axes["valve"][loop], "parameter": name}
        )
        part["error"] = np.abs(0.5 * (lo + hi) - truth) / S
        part["width"] = np.where(stated, (hi - lo) / S, np.nan)
        part["held"] = np.where(stated, (lo <= truth) & (truth <= hi), np.nan)
        parts.append(part[~np.isnan(lo)])
    return pd.concat(parts, ignore_index=True)


def quantification(book: RunArrays) -> pd.DataFrame:
    """Return how well every method tells S and J of each family of valves; errors and widths in
    shares of S.
    """
    # Median error, coverage and width by method, family and parameter
    found = estimates(book).groupby(["method", "family", "parameter"], sort=False)
    table = found.agg(
        n=("error", "size"),
        median_error=("error", "median"),
        coverage=("held", "mean"),
        width=("width", "median"),
    )

    # In the order of the run
    order = {}
    for i, method in enumerate(book.methods):
        order[method] = i
    table = table.reset_index().assign(
        _place=lambda t: t.method.map(order), _S=lambda t: t.parameter == "J"
    )
    return table.sort_values(["_place", "_S", "family"], ignore_index=True).reindex(
        columns=list(_COLUMNS)
    )


def compared(
    now: RunArrays, before: RunArrays, pairs: Pairs
) -> tuple[list[dict[str, Any]], list[str]]:
    """Return the tests of a gate, median error and coverage of S and J by method and family, and
    what cannot be told.

    `allowed` is what either may lose. A baseline that kept no S and J asks nothing.
    """
    # Both runs by the loops that they share
    old = estimates(before)
    new = estimates(now)
    new["loop"] = new["loop"].map(dict(zip(pairs.now, pairs.before, strict=True)))
    keys = ["method", "parameter", "family"]
    ours = dict(list(new.groupby(keys)))
    rows = []
    untold = []

    # A family that is too rare is not tested
    for key, one in old.groupby(keys, sort=False):
        method, parameter, family = tuple(key)  # type: ignore[arg-type]
        if len(one) < _ENOUGH or method not in now.methods:
            continue
        two = ours.get(key, new[:0])
        both = one.merge(two, on="loop", suffixes=("_old", "_new"))
        sides = [both.filter(like=end).rename(columns=lambda c: c[:-4]) for end in ("_old", "_new")]

        # A method that now gives few sizes cannot be compared
        if len(sides[1]) < _KEPT * len(one):
            untold.append(
                f"{method}: cannot tell of {parameter} of {family}: given {len(sides[1])} times,"
                f" before {len(one)}"
            )
            continue

        # Errors and coverage, loop by loop
        for what, column in ((MEDIAN_ERROR, "error"), (COVERAGE, "held")):
            a, b = (np.asarray(side[column], dtype=float) for side in sides)
            if np.isfinite(a).any():
                test = _test_errors(what, a, b)
                rows.append(
                    {"method": method, "truth": f"{parameter} of {family}", "what": what, **test}
                )
    return rows, untold


def _test_errors(what: str, before: np.ndarray, now: np.ndarray) -> dict[str, Any]:
    """Test loop by loop whether errors grew, or intervals hold less often."""
    # an interval that is no longer given holds nothing
    known = np.isfinite(before)
    before = before[known]
    now = np.nan_to_num(now[known])
    row: dict[str, Any] = {"n": before.size, "allowed": _ALLOWED[what]}
    middle = np.median if what == MEDIAN_ERROR else np.mean
    row.update(before=float(middle(before)), now=float(middle(now)))
    less = before < now
    more = now < before
    if what == MEDIAN_ERROR:
        paired = Paired.of(less, more)
    else:
        paired = Paired.of(more, less)
    return {**row, "lost": paired.win, "won": paired.loss, "p": paired.p_worse}
