"""Scores of a run, for a terminal and for a program: the same rows in a fixed order, with what the run can resolve."""

from __future__ import annotations

import json
import math
import textwrap
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from detectors.report.report import columns
from detectors.views import page_part
from simbench.bench.score.ranks import Ranks, loops_needed
from simbench.bench.store.place import Place, place_of
from simbench.files import csv_text

if TYPE_CHECKING:
    import pandas as pd

FRONT, RAW = "front end", "raw"
ALL = "all"
UNDECIDED = 0.5  # cost of no decision; an error costs 1
LEAST = 20  # loops: a rate of fewer says nothing, and is not shown
ROLE_YARDSTICK = "yardstick"
# behind a method's name, by where its constants were fitted: on loops of this grid, of one with the same blocks, of neither
HOME_MARKS = {"fitted here": "*", "siblings": "+", "no": ""}
_ROWS = (
    "method", "truth", "front_end", "process", "n", "applicable", "accuracy_applicable", "accuracy_decided", "no_decision",
    "found", "false_alarms", "accuracy_all", "auc", "lo", "hi", "sees_mv", "rank", "found_at_5", "cost", "risk_coverage",
    "home",
)  # fmt: skip
_PLACE = ("method", "truth", "front_end", "process")
_INTERVALS = (
    *_PLACE, "cost_lo", "cost_hi", "found_at_5_lo", "found_at_5_hi", "positives", "oscillating", "cost_oscillating",
    "cost_oscillating_lo", "cost_oscillating_hi", "cost_over_blind", "cost_over_blind_lo", "cost_over_blind_hi",
    "risk_coverage_lo", "risk_coverage_hi",
)  # fmt: skip
_PLANNED = (0.01, 0.03)  # differences for which the table says how many loops they take
_KINDS = ("", "see the valve position MV, ranked apart", "yardsticks, not ranked", "nonlinearity tests, not ranked")
HEAD = (
    "rank", "method", "n", "cost", "95 %", "accuracy", "95 %", "none", "found", "false al.", "at 5 %", "95 %", "AUC", "risk",
    "of all",
)  # fmt: skip


@dataclass(frozen=True, eq=False)
class Scores:
    """What a run says about its detectors.

    Parameters
    ----------
    table : DataFrame
        One row per method, truth, mode ("front end" or "raw") and process ("all", "self-regulating", "integrating"): n
        scenarios with a truth, positives; applicable: on how many the method's source covers the loop; over those, with
        Wilson intervals (NAME_lo, NAME_hi), accuracy_applicable (no decision is wrong), accuracy_decided, no_decision, found
        (of positives, no decision is not found), false_alarms (of negatives), auc over records with a score, with DeLong's
        interval; cost (an error 1, no decision `undecided`) and rank by it among its kind (none where it covers less than 95 %
        of the loops); found_at_5 (found at 5 % false alarms, threshold from other groups); risk_coverage (area under the
        curve: mean error of the surest answers); cost_oscillating over the loops that oscillate, so many of them, and
        cost_over_blind, the same less what the blind classifier costs there; accuracy_all over everything; home, where its
        constants were fitted; errors; median runtime in ms.
    by_axis : DataFrame
        The same against `cycled` by axis and value, without AUC's interval and rank.
    disagreement : DataFrame
        How often sticky, predicted and cycled say what together.
    left_out : DataFrame
        method, mode, of ("entrained", "unclear", "does not apply"), n, and the shares of the three answers with intervals.
    quantification : DataFrame
        method, family of valves, parameter (S or J), n sticky loops for which the method gave it, median_error (from the middle
        of an interval) and width in shares of the valve's S, coverage of intervals that are said to hold nine in ten.
    standing : dict of (truth, mode, process) to Ranks
        What the run can resolve, among methods that see OP and PV only.
    manifest : dict
        Of the run.
    first : str
        The mode shown first.
    undecided : float
        Cost of no decision.
    """

    table: pd.DataFrame
    by_axis: pd.DataFrame
    disagreement: pd.DataFrame
    left_out: pd.DataFrame
    quantification: pd.DataFrame
    standing: dict[tuple[str, str, str], Ranks]
    manifest: dict[str, Any]
    first: str = FRONT
    undecided: float = UNDECIDED

    @property
    def resolution(self) -> float:
        """Smallest difference of cost against `cycled` that the run resolves, all loops, the mode shown first."""
        return self.standing["cycled", self.first, ALL].resolution

    def ranking(self, truth: str = "cycled", mode: str | None = None, process: str = ALL) -> pd.DataFrame:
        """Return the rows of one block, best first: methods that see OP and PV, those that see MV, yardsticks, other tests."""
        t = self.table
        rows = t[(t.truth == truth) & (t["mode"] == (mode or self.first)) & (t.process == process)]
        kind = [kind_of(role, mv) for role, mv in zip(rows.role, rows.sees_mv)]
        keys = {"kind": kind, "partial": rows["rank"].isna()}
        return rows.assign(**keys).sort_values(["kind", "partial", "cost"], kind="stable")

    def as_text(self) -> str:
        """Return the tables for a terminal."""
        m, table = self.manifest, self.table
        size = int(table.n_all.max()) if len(table) else 0
        lines = [f"grid {m['grid']} ({m['grid_hash']}), {size} scenarios, seed {m.get('seed')}{benchmark_text(m)}"]
        modes = (self.first, next(x for x in ("front end", "raw") if x != self.first))
        blocks = [(modes[0], p) for p in ("all", "self-regulating", "integrating")] + [(modes[1], "all")]
        for mode, process in blocks:
            rows = self.ranking("cycled", mode, process)
            if len(rows):
                lines += ["", _title(rows, mode, process), *_block(rows), _resolved(self, mode, process), *_over_blind(rows)]
        lines += ["", *_legend(self), "", *_left_out(self), "", *_dead_band(self), "", *_quantified(self)]
        lines += ["", "labels that disagree", *_plain(self.disagreement)]
        return "\n".join(lines)

    def as_json(self) -> dict[str, Any]:
        """Return rows, resolution and what stands beside them as JSON types; NaN and infinity become null."""
        table = self.table.rename(columns={"accuracy_applicable_lo": "lo", "accuracy_applicable_hi": "hi"})
        resolution = self.resolution
        return {
            "grid": self.manifest["grid"],
            "grid_hash": self.manifest["grid_hash"],
            "benchmark": self.manifest.get("benchmark"),
            "undecided": self.undecided,
            "rows": _records(table[list(_ROWS)] if len(table) else table),
            "intervals": _records(table[list(_INTERVALS)] if len(table) else table),
            "resolution": None if math.isnan(resolution) else resolution,
            "by_axis": _records(self.by_axis),
            "disagreement": _records(self.disagreement),
            "left_out": _records(self.left_out),
            "quantification": _records(self.quantification),
        }

    def to_frame(self) -> pd.DataFrame:
        """Return the ranking against `cycled`, all loops.

        Returns
        -------
        DataFrame
            One row per method, best first; `table` holds every truth, mode and process.
        """
        return self.ranking().reset_index(drop=True)

    def plot(self, **options: Any) -> Any:
        """Draw each method's accuracy where it applies, with its interval.

        Parameters
        ----------
        **options
            As `pandas.DataFrame.plot.barh` takes them, such as figsize.

        Returns
        -------
        matplotlib.axes.Axes
        """
        rows = self.ranking().set_index("method")[::-1]
        value = rows.accuracy_applicable
        around = [[(value - rows.accuracy_applicable_lo).to_numpy(), (rows.accuracy_applicable_hi - value).to_numpy()]]
        look = {"xerr": around, "xlim": (0, 1), "xlabel": "accuracy where applicable", "color": "0.7", "legend": False}
        # a frame opens a figure of its own, a series draws over the last one
        return rows[["accuracy_applicable"]].plot.barh(**{**look, **options})

    def _repr_html_(self) -> str:
        keys = ["rank", "method", "n", "applicable", "cost", "accuracy_applicable", "accuracy_decided", "no_decision", "found"]
        said = f"methods closer than {self.resolution:.3f} in cost share a rank"
        return page_part(said, self.to_frame()[[*keys, "false_alarms", "auc"]])

    def write(self, folder: str | Path | Place) -> None:
        """Write scores.csv and scores_by_axis.csv."""
        for name, frame in (("scores", self.table), ("scores_by_axis", self.by_axis)):
            place_of(folder).write(f"{name}.csv", csv_text(frame, float_format="%.5g").encode())


def benchmark_text(manifest: dict[str, Any]) -> str:
    """Return the version of a run's benchmark as its tables and pages show it; empty for one of an older simbench."""
    stated = manifest.get("benchmark")
    return f", benchmark {stated['name']} ({stated['hash']})" if stated else ""


def kind_of(role: str, sees_mv: bool) -> int:
    """Return 0 for a stiction method on OP and PV, 1 for one that sees MV, 2 for yardsticks and the oracle, 3 for other tests.
    """
    if role in ("oracle", ROLE_YARDSTICK):
        return 2
    return 3 if role == "nonlinearity" else int(sees_mv)


def _title(rows: pd.DataFrame, mode: str, process: str) -> str:
    first = rows.iloc[0]
    loops = {"all": "all loops", "self-regulating": "self-regulating loops", "integrating": "integrating loops"}[process]
    front = "with" if mode == "front end" else "without"
    return f"{loops} against cycled ({first.n}, {first.positives} cycling), {front} the oscillation front end"


def _block(rows: pd.DataFrame) -> list[str]:
    lines, kinds = [HEAD], []
    for r in rows.itertuples():
        few = r.applicable < LEAST

        def ends(lo: float, hi: float, few: bool = few) -> str:
            return "-" if few or math.isnan(lo) else f"{lo:.2f}-{hi:.2f}"

        accuracy = ends(r.accuracy_applicable_lo, r.accuracy_applicable_hi)
        rates = (r.cost, ends(r.cost_lo, r.cost_hi), r.accuracy_applicable, accuracy, r.no_decision, r.found, r.false_alarms,
                 r.found_at_5, ends(r.found_at_5_lo, r.found_at_5_hi), r.auc, r.risk_coverage, r.accuracy_all)  # fmt: skip
        lines.append(
            (
                ("" if r.kind else "-") if r.rank is None or math.isnan(r.rank) else f"{r.rank:.0f}",
                r.method + HOME_MARKS[r.home],
                str(r.applicable),
                *(x if isinstance(x, str) else "-" if few else _short(x) for x in rates),
            )
        )
        kinds.append(r.kind)
    text = columns(lines)
    out = [text[0]]
    for line, kind, before in zip(text[1:], kinds, [0, *kinds], strict=False):
        out += [f"-- {_KINDS[kind]}"] * (kind != before) + [line]
    return out


def _resolved(scores: Scores, mode: str, process: str) -> str:
    standing = scores.standing["cycled", mode, process]
    if math.isnan(standing.resolution):
        return "no method covers these loops"
    more = " and ".join(f"{d:g} by {loops_needed(d, standing.spread)} loops" for d in _PLANNED)
    near = f"methods closer than {standing.resolution:.3f} share a rank"
    return f"{near}; a difference of {more} would be resolved in 9 of 10 runs"


def _over_blind(rows: pd.DataFrame) -> list[str]:
    """Return what methods cost where the front end tells no label, beside the classifier that sees no signal."""
    judged, blind = rows[rows.kind < 2], rows[rows.method == "no_waveform"].iloc[0]
    if blind.oscillating < LEAST:
        return []
    covering = judged[~judged.partial]
    said = (
        f"{(covering.cost > blind.cost).sum()} of {len(covering)} methods cost more than the blind classifier, "
        f"{(covering.accuracy_applicable < blind.accuracy_applicable).sum()} are right less often: whether a loop oscillates "
        f"is most of its label. On the {blind.oscillating} that oscillate it costs {blind.cost_oscillating:.3f} "
        f"({blind.cost_oscillating_lo:.2f}-{blind.cost_oscillating_hi:.2f}), and methods there:"
    )
    lines = [("method", "n", "cost", "95 %", "over blind", "95 %", "less than blind")]
    for r in judged[judged.oscillating >= LEAST].itertuples():
        ends = f"{r.cost_oscillating_lo:.2f}-{r.cost_oscillating_hi:.2f}"
        over = f"{r.cost_over_blind_lo:+.2f} to {r.cost_over_blind_hi:+.2f}"
        less = "yes" if r.cost_over_blind_hi < 0 else "no" if r.cost_over_blind_lo > 0 else "cannot tell"
        name, cost = r.method + HOME_MARKS[r.home], _short(r.cost_oscillating)
        lines.append((name, str(r.oscillating), cost, ends, f"{r.cost_over_blind:+.3f}", over, less))
    return [*textwrap.wrap(said, 126), *columns(lines)]


def _legend(scores: Scores) -> list[str]:
    text = (
        f"n: loops that the method's source covers; all columns but the last are over those, - where fewer than {LEAST}. "
        f"cost, which ranks: an error 1, no decision {scores.undecided:g}. accuracy: no decision is not right; none: its share."
        " found: of cycling loops, false al.: of the others. at 5 %: found at 5 % false alarms, threshold from other groups. "
        "risk: area under the risk-coverage curve, threshold from other groups. of all: accuracy over everything, where a "
        "method that does not apply is wrong. * behind a method: its constants were fitted to other loops of this grid, + of "
        "one with the same blocks. A method made for a part of the loops (rank -) is ranked among those. "
        "no_waveform: gradient boosting on all that loops that oscillate show but the waveform, learned on others;"
        " over blind: a method's cost less its own, same loops, interval by groups."
    )
    return textwrap.wrap(text, 126)


def _marked(scores: Scores) -> dict[str, str]:
    """Return the names of the methods that are scored, with their marks; of loops left out alone there are others."""
    return {r.method: r.method + HOME_MARKS[r.home] for r in scores.table.itertuples()}


def _left_out(scores: Scores) -> list[str]:
    rows, names = scores.left_out, _marked(scores)
    rows = rows[(rows["mode"] == scores.first) & (rows.role != ROLE_YARDSTICK) & (rows.n > 0)] if len(rows) else rows
    lines = [("method", "of", "n", "stiction", "95 %", "no stiction", "no decision")]
    for r in rows.itertuples():
        ends = f"{r.stiction_lo:.2f}-{r.stiction_hi:.2f}"
        shares = (f"{r.stiction:.3f}", ends, f"{r.no_stiction:.3f}", f"{r.no_decision:.3f}")
        lines.append((names.get(r.method, r.method), r.of, str(r.n), *(shares if r.n >= LEAST else ("-",) * 4)))
    title = "left out of every row above: what detectors say of entrained and unclear loops, and of those they do not apply to"
    return [title, *columns(lines)] if len(lines) > 1 else ["no loop is left out"]


def _dead_band(scores: Scores) -> list[str]:
    rows = scores.by_axis
    rows = rows[(rows.axis == "S_over_2J") & (rows["mode"] == scores.first) & (rows.value == "inf") & (rows.positives > 0)]
    rows = rows[(rows.role != "yardstick") & (rows.applicable > 0)]
    if rows.empty:
        return ["no dead-band cell cycles here"]
    found = ", ".join(f"{r.method}{HOME_MARKS[r.home]} {r.found:.2f}" for r in rows.itertuples() if not math.isnan(r.found))
    return textwrap.wrap(f"dead-band alone ({int(rows.positives.max())} cycling): found by {found}", 126)


def _quantified(scores: Scores) -> list[str]:
    """Return S and J beside each other, one row for a method on a family of valves."""
    t, names = scores.quantification, _marked(scores)
    lines = [("method", "family", *(f"{what} {p}" for p in "SJ" for what in ("n", "error", "held", "width")))]
    for key, rows in t[t.n >= LEAST].groupby(["method", "family"], sort=False):
        method, family = tuple(key)  # type: ignore[arg-type]
        found = {r.parameter: (str(r.n), *map(_short, (r.median_error, r.coverage, r.width))) for r in rows.itertuples()}
        lines.append((names.get(method, method), family, *found.get("S", ("-",) * 4), *found.get("J", ("-",) * 4)))
    if len(lines) == 1:
        return [f"no method gives S or J of {LEAST} sticky loops of a family"]
    text = (
        "S and J of sticky loops by family of valves: median error and width in shares of the valve's S; held: share of the "
        "intervals that hold the truth, nine in ten are said to; - where a method states no level."
    )
    return [*textwrap.wrap(text, 126), *columns(lines)]


def _short(x: float) -> str:
    return "-" if math.isnan(x) else f"{x:.3f}"


def _plain(frame: pd.DataFrame) -> list[str]:
    return columns([tuple(frame.columns), *(tuple(map(str, row)) for row in frame.itertuples(index=False))])


def _records(frame: pd.DataFrame) -> list[dict[str, Any]]:
    return json.loads(frame.to_json(orient="records", double_precision=6))
