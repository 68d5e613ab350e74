"""How much of a valve's corner a method needs: how often it calls echoes of a sticky loop sticky,
over the frequency at which they end, beside how often it calls the sticky loops so.

An echo that ends high holds nearly all of the corner and moves like the sticky loop; one that ends
low is smooth. A method that needs little tells echoes from sticky loops wherever they end.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from simbench.bench.score.answers import answers_of
from simbench.bench.score.names import ROLE_YARDSTICK
from simbench.bench.score.tally import counted, long_table, share_frame, tallied, with_names
from simbench.bench.store.reading import RunArrays

if TYPE_CHECKING:
    import pandas as pd

_Z = 1.96  # standard deviations of a 95 % interval
_TOLD = "told_apart"
_COLUMNS = (
    *("method", "home", "cut", "n", "called", "called_lo", "called_hi"),
    *("siblings", "called_siblings", "called_siblings_lo", "called_siblings_hi"),
    *(_TOLD, f"{_TOLD}_lo", f"{_TOLD}_hi"),
)


def resolution_curve(book: RunArrays) -> pd.DataFrame:
    """Return a row for every method and cut; see `Scores.resolution_curve`."""
    import pandas as pd

    cut = book.axes["cut"]
    block = book.axes["block"]
    label = book.truth["cycled"]
    echo = ~np.isnan(cut) & (label == 0)
    cuts = np.unique(cut[echo])
    everyone = [a for a in answers_of(book) if a.role != ROLE_YARDSTICK]
    if cuts.size < 2 or not everyone:
        return pd.DataFrame(columns=list(_COLUMNS))
    sibling = np.isnan(cut) & np.isin(block, np.unique(block[echo])) & (label == 1)
    # the siblings have the number after the last cut
    place = np.select([echo, sibling], [np.searchsorted(cuts, cut), cuts.size], -1)
    counts = counted(long_table(everyone), label=label, place=place)
    table = tallied(counts[counts["place"] >= 0], ["method", "place"])
    called = table["alarms"] + table["found"]
    rows = table[["applicable"]].rename(columns={"applicable": "n"})
    rows = rows.join(share_frame("called", called, table["applicable"])).reset_index()
    ends = rows[rows["place"] == cuts.size].drop(columns="place").rename(columns={"n": "siblings"})
    ends = ends.rename(columns=lambda c: c.replace("called", "called_siblings"))
    rows = rows[(rows["place"] < cuts.size) & (rows["n"] > 0)].merge(ends, on="method")
    rows["cut"] = cuts[rows["place"]]
    rows = rows.join(_differences(rows), on="method")
    rows = with_names(rows, everyone, "home")
    best_first = rows.sort_values([_TOLD, "cut"], ascending=[False, True], kind="stable")
    return best_first.reset_index(drop=True).loc[:, list(_COLUMNS)]


def _differences(rows: pd.DataFrame) -> pd.DataFrame:
    """Return by how much more often each method calls sticky loops sticky than their echoes, the
    mean over the cuts, with its 95 % interval.
    """
    import pandas as pd

    of = rows.assign(variance=_variance(rows["called"], rows["n"])).groupby("method")
    first = of[["called_siblings", "siblings"]].first()
    mean = first["called_siblings"] - of["called"].mean()
    spread = _variance(first["called_siblings"], first["siblings"])
    half = _Z * (spread + of["variance"].sum() / of.size() ** 2) ** 0.5
    ends = {
        _TOLD: mean,
        f"{_TOLD}_lo": (mean - half).clip(lower=-1.0),
        f"{_TOLD}_hi": (mean + half).clip(upper=1.0),
    }
    return pd.DataFrame(ends)


def _variance(share: pd.Series, n: pd.Series) -> pd.Series:
    """Return the variance of a share; one hit and one miss are added, as few loops never show a
    share exactly.
    """
    added = (share * n + 1.0) / (n + 2.0)
    return added * (1.0 - added) / n.clip(lower=1)
