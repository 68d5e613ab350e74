"""What every method of a run said, one row a method, what the reference rows say, and how often
each answer was given.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import pyarrow as pa

from simbench.bench.score.names import CONSTANTS, NO_WAVEFORM, ROLE_YARDSTICK, WITH_RHYTHM
from simbench.bench.score.no_waveform import is_told, no_waveform
from simbench.bench.statistics import wilson
from simbench.bench.store.reading import CODES, RunArrays
from simbench.bench.store.tables import CELL_S_OVER_2J
from simbench.detectors.verdict import NO_DECISION, NO_STICTION, STICTION
from simbench.scenarios.grid import packaged_grid
from simbench.scenarios.packaged import grid_names

if TYPE_CHECKING:
    import pandas as pd

# of a healthy loop the cell's place on the axis, so that false positives have one
_AXIS_OF_CELL = {"S_over_2J": CELL_S_OVER_2J}


# axis of dead time of each process
_RATIO_OF = {"foptd": "Td_over_T", "integrating": "Td_over_Ti"}
_MOSTLY = 0.5  # share of a run's loops within a grid's ranges from which the run is alike


class Answers(NamedTuple):
    """What one method said on all n scenarios of a run."""

    method: str
    role: str
    sees_mv: bool
    said: np.ndarray
    score: np.ndarray
    applies: np.ndarray
    failed: np.ndarray
    runtime: np.ndarray
    home: str = "no"
    # "published", "tuned" (here, to simulated loops), "learned" or "reference"; None: not stated
    division: str | None = "reference"
    name: str = ""  # with every threshold that is not the method's default
    answered: str = "package"  # who asked the method; "file" where its answers were joined
    own: bool = False  # a plug-in or a detector of whoever ran it


def answers_of(book: RunArrays) -> Iterator[Answers]:
    """Yield what every method of a run said, and two yardsticks that always say the same."""
    # Every method, with what the run's manifest says of it
    for i, method in enumerate(book.methods):
        about = book.manifest["methods"][method]
        answered = about.get("answered", "package")
        added = {method, f"own {method}"} & set(book.manifest.get("plugins", ()))
        foreign = bool(added) or answered != "package"
        applies = book.applicable[i] != 0
        yield Answers(
            method,
            about["role"],
            about["needs_mv"],
            book.verdict[i],
            book.score[i],
            applies,
            book.failed[i],
            book.runtime[i],
            home_of(method, book),
            None if foreign else about.get("division"),
            _full_name(method, about.get("changed", {})),
            answered,
            foreign,
        )

    # Two yardsticks that know nothing
    nothing = np.zeros(book.ids.size)
    for name, word in CONSTANTS.items():
        said = np.full(book.ids.size, CODES[word])
        yield Answers(
            name,
            ROLE_YARDSTICK,
            False,
            said,
            nothing,
            nothing == 0,
            nothing != 0,
            nothing,
            name=name,
        )


def _full_name(method: str, changed: Mapping[str, float]) -> str:
    stated = ", ".join(f"{name} = {value:g}" for name, value in changed.items())
    if stated:
        return f"{method} ({stated})"
    return method


def home_of(method: str, book: RunArrays) -> str:
    """Return where a method's constants were fitted: on this grid ("fitted here"), on loops like
    most of these ("siblings"), or on neither ("no").
    """
    known = []
    for name in book.manifest["methods"][method].get("fitted_on", ()):
        if name in grid_names():
            known.append(name)
    if book.manifest["grid"] in known:
        return "fitted here"
    return "siblings" if any(_share_within(book, name) >= _MOSTLY for name in known) else "no"


def _share_within(book: RunArrays, grid: str) -> float:
    """Return the share of a run's loops that lie within the ranges of a grid of the package, in
    dead time and shape of stiction.
    """
    # For every kind of plant: within the grid's range on both axes
    within = np.zeros(book.ids.size, dtype=bool)
    blocks = packaged_grid(grid).content.block
    for process, axis in _RATIO_OF.items():
        here = [b.axes for b in blocks if b.process == process]
        if not here:
            continue
        inside = book.axes["process"] == process
        for name, values in ((axis, book.axes[axis]), ("S_over_2J", book.axes[CELL_S_OVER_2J])):
            known = []
            for axes in here:
                for v in axes.get(name, ()):
                    known.append(float(v))
            inside = inside & (values >= min(known)) & (values <= max(known))
        within |= inside

    # An empty run lies in no grid
    if within.size:
        return float(within.mean())
    return 0.0


def failures(book: RunArrays) -> dict[str, int]:
    """Return on how many simulated records each method raised an error."""
    counts = (book.failed & (book.hashes != b"")).sum(axis=1)
    return dict(zip(book.methods, counts.tolist(), strict=True))


def failing_methods(book: RunArrays, allowed: float) -> dict[str, int]:
    """Return the methods that raised an error on more than a share of the simulated records, and on
    how many.
    """
    most = allowed * int((book.hashes != b"").sum())
    return {method: count for method, count in failures(book).items() if count > most}


def reference_answers(book: RunArrays) -> list[Answers]:
    """Return what classifiers answer of an oscillating loop from everything but its waveform,
    learned on other groups: `no_waveform`, and `rhythm`; nothing where a run was stored without
    what they see, as shipped verdicts are.
    """
    if not is_told(book):
        return []
    nothing = np.zeros(book.ids.size)
    rows = []
    for name in (NO_WAVEFORM, WITH_RHYTHM):
        chance, verdicts, asked = no_waveform(book, rhythm=name == WITH_RHYTHM)
        told = verdicts, chance, asked, nothing != 0, nothing
        rows.append(Answers(name, ROLE_YARDSTICK, False, *told, name=name))
    return rows


def axis_codes(book: RunArrays, axis: str) -> tuple[list[str], np.ndarray]:
    """Return the values of an axis as text, in order, and which of them each scenario has; one more
    than there are where it has none.
    """
    import pandas as pd

    codes, values = pd.factorize(book.axes[_AXIS_OF_CELL.get(axis, axis)], sort=True)
    texts = [v if isinstance(v, str) else f"{v:g}" for v in values]
    if texts[:1] == [""]:
        codes = codes - 1
        texts = texts[1:]
    return texts, np.where(codes < 0, len(texts), codes)


# --- How often methods answer what: the answers of a run as one long table, counted by groups of
# loops.

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

    # Which loops count as what
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

    # Their sums, and the rates of these
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
