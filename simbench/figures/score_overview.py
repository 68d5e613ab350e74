"""Score overview: all detectors on one sheet, best first, healthy and sticky loops apart.

One row per method, sorted by cost where it applies; methods that need MV, reference rows and
nonlinearity tests are in groups of their own. Under "healthy" and "sticky, at rest" the share of
the answer no stiction, under "cycling" the share of the answer stiction; below it half the width of
its 95 % interval; pale: fewer than 20 loops.
"""

from itertools import product
from pathlib import Path

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from simbench.bench.score.answers import answers_of, reference_answers
from simbench.bench.score.names import ALL, CONSTANTS, HOME_MARKS
from simbench.bench.score.result import Scores
from simbench.bench.score.scoring import score_book
from simbench.bench.score.shipped import read_joined
from simbench.bench.score.tally import counted, long_table, tallied
from simbench.bench.statistics import wilson
from simbench.bench.store.reading import RunArrays
from simbench.figures._score import share_map
from simbench.figures._style import panels, styled

SOURCE = "own"
PROCESSES = {"self-regulating": "foptd", "integrating": "integrating"}
LOOP_KINDS = (
    "healthy",
    "healthy, disturbed",
    "sticky, at rest",
    "cycling, stick-slip",
    "cycling, dead-band",
)
ROW_GROUPS = ("OP and PV", "see MV", "yardsticks", "other tests")


def data(run: str | Path) -> pd.DataFrame:
    """Count right answers against `cycled`, with the oscillation front end, by kind of loop.

    Columns: method, home, kind, rank, accuracy (where it applies), process, loops, n, applicable,
    right (share of the applicable); best method first.
    """
    return overview(read_joined(run))


def overview(book: RunArrays, scores: Scores | None = None) -> pd.DataFrame:
    """Count for a run in memory, whose scores may be known already; see `data`."""
    healthy, still = book.truth["sticky"] == 0, book.axes["disturbance"] == "none"
    # of echoes that end high nobody can tell that they are healthy: no ranking counts them
    cycles, rests = (~book.apart & (book.truth["cycled"] == label) for label in (1, 0))
    band = np.isinf(book.axes["S_over_2J"])
    parts = (
        healthy & rests & still,
        healthy & rests & ~still,
        ~healthy & rests,
        cycles & ~band,
        cycles & band,
    )
    everyone = [*answers_of(book), *reference_answers(book)]
    label = np.where(book.apart, -1, book.truth["cycled"])
    part = np.select(parts, range(len(parts)), -1)
    process = np.select([book.axes["process"] == x for x in PROCESSES.values()], [0, 1], -1)
    counts = counted(long_table(everyone), label=label, part=part, process=process)
    number = {a.method: k for k, a in enumerate(everyone)}
    whole = tallied(counts, ["method"])["accuracy"]
    cells = tallied(counts, ["method", "process", "part"])[["n", "applicable", "accuracy"]]
    rows = []
    ranking = (scores or score_book(book)).rows("cycled", population=ALL)
    # what always says the same is a row of the table, and no news in a picture
    for r in ranking[~ranking.method.isin(list(CONSTANTS))].itertuples():
        k = number[str(r.method)]
        for (i, shown), (j, loops) in product(enumerate(PROCESSES), enumerate(LOOP_KINDS)):
            rank = np.nan if r.partial else r.rank  # one on other loops would mislead here
            place = r.method, r.home, ROW_GROUPS[int(r.kind)], rank, whole[k]
            n, given, right = cells.loc[k, i, j] if (k, i, j) in cells.index else (0, 0, np.nan)
            rows.append((*place, shown, loops, int(n), int(given), right))
    columns = "method home kind rank accuracy process loops n applicable right"
    return pd.DataFrame(rows, columns=columns.split())


@styled
def draw(data: pd.DataFrame) -> Figure:
    """Draw one table of shares per process, and accuracy at its left."""
    methods = data.drop_duplicates("method")
    size = len(methods)
    there = data[data.n > 0]
    columns = {
        process: [x for x in LOOP_KINDS if x in set(there.loops[there.process == process])]
        for process in PROCESSES
    }
    columns = {process: loops for process, loops in columns.items() if loops}
    wide = sum(map(len, columns.values()))
    ratios = [1.0, *(float(len(loops)) for loops in columns.values())]
    figure, axes = panels(
        1,
        len(ratios),
        2.7 + 0.66 * (wide + 1),
        0.27 * size + 1.75,
        sharey=True,
        width_ratios=ratios,
    )
    ranks = pd.to_numeric(methods["rank"])  # reference rows and methods that failed have none
    names = [
        f"{method}{HOME_MARKS[home]}  {rank:.0f}".replace("  nan", "   ")
        for method, home, rank in zip(methods["method"], methods["home"], ranks)
    ]
    whole = methods["accuracy"].to_numpy(dtype=float)[:, None]
    covered = np.asarray(data.groupby("method", sort=False)["applicable"].sum(), dtype=float)
    image = _cells(axes[0, 0], whole, covered[:, None])
    axes[0, 0].set(xticks=[0], yticks=range(size))
    axes[0, 0].set_xticklabels(["accuracy"], rotation=35, ha="right")
    axes[0, 0].set_yticklabels(names)
    axes[0, 0].set_title("all")
    for place, (process, loops) in zip(axes[0, 1:], columns.items(), strict=True):
        part = data[data.process == process]
        shares, n, applies = (
            part.pivot(index="method", columns="loops", values=v).reindex(
                index=methods.method, columns=loops
            )
            for v in ("right", "n", "applicable")
        )
        _cells(place, shares.to_numpy(dtype=float), applies.to_numpy(dtype=float))
        place.set(xticks=range(len(loops)))
        place.set_xticklabels([f"{x} ({n[x].max()})" for x in loops], rotation=35, ha="right")
        place.set_title(f"{process}: right answers")
        place.axvline(
            sum(not x.startswith("cycling") for x in loops) - 0.5, color="white", linewidth=3
        )
    for place in axes[0]:
        for k in range(1, size):
            if methods.kind.iloc[k] != methods.kind.iloc[k - 1]:
                place.axhline(k - 0.5, color="white", linewidth=3)
    bar = figure.colorbar(image, ax=axes, location="right", shrink=0.7, aspect=30)
    about = (
        "number after a name: rank; * fitted on this grid, + on loops like these; hatched: does not"
        " apply"
    )
    bar.set_label(f"share right where it applies (no decision is not right)\n{about}")
    return figure


def _cells(axes, shares: np.ndarray, applies: np.ndarray):
    lo, hi = wilson(np.nan_to_num(shares) * applies, applies)
    texts = np.char.mod("%.2f\n", shares) + np.char.mod("±%.2f", (hi - lo) / 2)
    image = share_map(axes, shares, applies, texts, 5.5)
    axes.set_ylim(shares.shape[0] - 0.5, -0.5)
    axes.tick_params(length=0)
    return image
