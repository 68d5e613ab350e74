"""How often methods answer what: the answers of a run as one long table, counted by groups of
loops.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
import pyarrow as pa

from simbench.bench.score.answers import Answers
from simbench.bench.statistics import wilson
from simbench.bench.store.reading import CODES
from simbench.detectors.verdict import NO_DECISION, NO_STICTION, STICTION

if TYPE_CHECKING:
    import pandas as pd

# with Wilson intervals, in the order they are shown
RATES = (
    "accuracy",
    "accuracy_decided",
    "no_decision",
    "sensitivity",
    "false_positives",
    "accuracy_all",
)
_COUNT = "count"


def long_table(everyone: Sequence[Answers]) -> pa.Table:
    """Return one row per method (its number among `everyone`) and loop: what it said, whether it
    applies, and whether it failed.
    """
    number = np.repeat(np.arange(len(everyone), dtype=np.int16), everyone[0].said.size)
    columns = {}
    for name in ("said", "applies", "failed"):
        columns[name] = np.concatenate([getattr(a, name) for a in everyone])
    return pa.table({"method": number, **columns})


def counted(answers: pa.Table, **of_loops: np.ndarray) -> pd.DataFrame:
    """Return how often each combination of a long table's columns, and of numbers given for its
    loops, occurs; `count` is the last column.
    """
    for name, values in of_loops.items():
        methods = answers.num_rows // max(values.size, 1)
        answers = answers.append_column(name, pa.array(np.tile(values.astype(np.int16), methods)))
    groups = answers.group_by(answers.column_names, use_threads=False)
    found = groups.aggregate([([], "count_all")])
    return found.rename_columns([*answers.column_names, _COUNT]).to_pandas()


def tallied(counts: pd.DataFrame, by: Sequence[str]) -> pd.DataFrame:
    """Return what the answers of each group come to, in the order of its keys.

    `counts` are `counted`, with a `label` (1 stiction, 0 none, -1 unknown). n and positives are
    loops with a label, n_all any; applicable and sticky those of them, and of the positives, that
    the method covers. Rates come with their 95 % intervals (_lo, _hi).
    """
    import pandas as pd

    known = counts["label"] >= 0
    positive = counts["label"] == 1
    covered = known & counts["applies"]
    sticky = covered & positive
    other = covered & ~positive
    says = {}
    for word, code in CODES.items():
        says[word] = counts["said"] == code
    kinds = {
        "n": known,
        "n_all": known | ~known,
        "positives": positive,
        "applicable": covered,
        "sticky": sticky,
        "found": sticky & says[STICTION],
        "missed": sticky & says[NO_STICTION],
        "rejected": other & says[NO_STICTION],
        "alarms": other & says[STICTION],
        "open_sticky": sticky & says[NO_DECISION],
        "open_other": other & says[NO_DECISION],
        "errors": known & counts["failed"],
    }
    kinds["right"] = kinds["found"] | kinds["rejected"]
    kinds["open"] = kinds["open_sticky"] | kinds["open_other"]
    parts = pd.DataFrame({name: counts[_COUNT].where(kind, 0) for name, kind in kinds.items()})
    table = pd.DataFrame(parts.groupby([counts[name] for name in by]).sum())
    return pd.concat([table] + _rates_of_sums(table), axis=1)


def _rates_of_sums(t: pd.DataFrame) -> list[pd.DataFrame]:
    """Return `RATES` of the sums of `tallied`."""
    # where a method does not apply it does not decide: nothing right is added
    of = (
        (t.right, t.applicable),
        (t.right, t.applicable - t.open),
        (t.open, t.applicable),
        (t.found, t.sticky),
        (t.alarms, t.applicable - t.sticky),
        (t.right, t.n),
    )
    return [share_frame(name, hits, trials) for name, (hits, trials) in zip(RATES, of, strict=True)]


def share_frame(name: str, hits: pd.Series, trials: pd.Series) -> pd.DataFrame:
    """Return a share with its 95 % interval (Wilson's) in the columns NAME, NAME_lo and NAME_hi;
    NaN (0, 1) without trials.
    """
    import pandas as pd

    lo, hi = wilson(hits, trials)
    share = {name: share_of(hits, trials), f"{name}_lo": lo, f"{name}_hi": hi}
    return pd.DataFrame(share, index=hits.index)


def share_of(hits: pd.Series, trials: pd.Series) -> pd.Series:
    """Return a share, NaN without trials."""
    return hits / trials.where(trials > 0)


def with_names(table: pd.DataFrame, everyone: Sequence[Answers], *about: str) -> pd.DataFrame:
    """Return a table with names in place of the methods' numbers, and what else is asked `about`
    each behind them.
    """
    asked = [everyone[k] for k in table["method"]]
    place = list(table.columns).index("method")
    table = table.assign(method=[a.method for a in asked])
    for i, what in enumerate(about, 1):
        table.insert(place + i, what, [getattr(a, what) for a in asked])
    return table
