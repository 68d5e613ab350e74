"""`simbench trust`: which method is most reliable on loops like one record's, and from which size
of stiction on it finds it there: a run over the loops that copy the record.
"""

from __future__ import annotations

import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, Unpack

import numpy as np

from simbench.detectors.errors import ParameterError, UserError
from simbench.detectors.judge import judge, refuse_wrong_forms
from simbench.detectors.plugins.registry import methods as registry
from simbench.detectors.record import LoopRecord
from simbench.detectors.repaired import repair_record
from simbench.detectors.report.report import choose_methods, columns
from simbench.detectors.sources import Methods, RecordSignals, as_plugin, as_record, named_methods
from simbench.detectors.verdict import PROBABILITY, STICTION, Verdict
from simbench.gap.benchmark.near_loop import NearLoop, loop_of
from simbench.gap.diagnosis import diagnose
from simbench.gap.stiction.conclusion import Conclusion, judged

if TYPE_CHECKING:
    import pandas as pd

    from simbench.bench.score.result import Scores
    from simbench.detectors.sources import Source

_REPEATS = 3  # draws of loads and noise in each of twelve cells of S and J
FOUND = 0.8  # share of the loops of a size and of every larger one that are called sticking
_FEW_CYCLING = 5  # loops that cycle, below which methods are counted by whether the valve sticks
_SILENT = 0.5  # cost of a method that never decides
_MOST_RIVALS = 4  # names of methods that a sentence holds


@dataclass(frozen=True)
class MethodTrust:
    """What one method says of the record, and how right it is on loops that copy it.

    `accuracy`, `cost` with the upper end of its interval, `sensitivity` and `false_positives` are
    those of a score; None where it was not counted. `smallest_S` is the size (% of travel) from
    which on it finds four of five sticking valves, None where it does not.
    """

    verdict: Verdict
    rank: int | None = None
    cost: float | None = None
    cost_hi: float | None = None
    accuracy: float | None = None
    sensitivity: float | None = None
    false_positives: float | None = None
    smallest_S: float | None = None

    def as_json(self) -> dict[str, Any]:
        """Return a row as JSON types."""
        keys = ("rank", "cost", "accuracy", "sensitivity", "false_positives", "smallest_S")
        said = {"method": self.verdict.method, "verdict": self.verdict.verdict}
        numbers = {key: getattr(self, key) for key in keys}
        return {**said, "applicable": self.verdict.applicable, **numbers}


@dataclass(frozen=True, eq=False)
class Trust:
    """The conclusion about one record, and how reliable each method is on loops that copy it."""

    conclusion: Conclusion
    methods: tuple[MethodTrust, ...]  # the cheapest first; those that do not apply last
    loops: int  # simulated, with a clear label
    reason: str  # why there are none; "" where there are
    record: LoopRecord = field(repr=False)
    notes: tuple[str, ...] = ()
    scores: Scores | None = field(default=None, repr=False)

    def __repr__(self) -> str:
        """Return one line."""
        return f"Trust: {self.conclusion.sentence()}"

    @property
    def probability(self) -> float | None:
        """Probability of stiction; None where the record cannot be judged."""
        return self.conclusion.probability

    @property
    def best(self) -> MethodTrust | None:
        """The method that costs least on loops like this one, of those that apply to it; None where
        none was counted.
        """
        first = next(iter(self.methods), None)
        counted = first is not None and first.cost is not None and self._applies(first)
        return first if counted else None

    def line(self) -> str:
        """Return in one line which method is most reliable here, and what it finds."""
        best = self.best
        if best is None or best.cost is None or best.accuracy is None:
            return f"which method is reliable on loops like this one is unknown: {self.reason}"
        found = (
            f"finds stiction from S = {best.smallest_S:.2g} % of travel on"
            if best.smallest_S is not None
            else "finds none of the sizes of stiction that were tried in four of five loops"
        )
        # what is neither right nor wrong is no decision, which costs half
        wrong = 2.0 * best.cost + best.accuracy - 1.0
        line = (
            f"on {self.loops} simulations of loops like this one {best.verdict.method} is right in"
            f" {best.accuracy:.0%}, wrong in {abs(wrong):.0%}, and {found}{self._ties()}"
        )
        if best.cost_hi is not None and best.cost_hi < _SILENT:
            return line
        return f"no method is known to be worth more here than no answer: {line}"

    def _ties(self) -> str:
        """Return, after a semicolon, from which methods the first one cannot be told."""
        same = [m.verdict.method for m in self.methods[1:] if m.rank == 1 and self._applies(m)]
        if not same or self.methods[0].rank != 1:
            return ""
        more = len(same[_MOST_RIVALS:])
        *names, last = [*same[:_MOST_RIVALS], *([f"{more} more"] if more else [])]
        named = f"{', '.join(names)} and {last}" if names else last
        return f"; these loops do not tell it from {named}"

    @staticmethod
    def _applies(m: MethodTrust) -> bool:
        return m.verdict.applicable is not False

    def as_json(self) -> dict[str, Any]:
        """Return the answer in JSON types."""
        best = self.best
        return {
            "conclusion": self.conclusion.as_json(),
            "probability": self.probability,
            PROBABILITY: self.probability,
            "best": None if best is None else best.verdict.method,
            "smallest_S": None if best is None else best.smallest_S,
            "methods": [m.as_json() for m in self.methods],
            "loops": self.loops,
            "reason": self.reason,
            "notes": [self.line(), *self.notes, *self.record.notes],
        }

    def as_text(self) -> str:
        """Return conclusion, best method and a table for a terminal."""
        line = self.line()
        lines = [*self.conclusion.as_lines(), f"{line[0].upper()}{line[1:]}.", ""]
        head = ("method", "on the record", "right", "false positives", "finds S (%) from")
        rows = [head]
        for m in self.methods:
            said = m.verdict.verdict.replace("_", " ") if self._applies(m) else "not applicable"
            shown = ["" if x is None else f"{x:.2f}" for x in (m.accuracy, m.false_positives)]
            size = "-" if m.smallest_S is None else f"{m.smallest_S:.2g}"
            rows.append((m.verdict.method, said, *shown, size if m.cost is not None else ""))
        lines += columns(rows)
        return "\n".join([*lines, "", *(f"note: {n}" for n in self.notes)]).rstrip()


def trust(
    record: Source | None = None,
    methods: Methods = "all",
    *,
    repeats: int = _REPEATS,
    seed: int = 0,
    jobs: int = 1,
    **signals: Unpack[RecordSignals],
) -> Trust:
    """Return which method is most reliable on loops like this record's, from which size of stiction
    on it finds it there, and how probable stiction is.

    Parameters
    ----------
    record : LoopRecord, run, DataFrame, mapping, str or Path
        SP, OP, PV and, where recorded, MV, as `simbench.detect` takes them.
    methods : str, function, object with `detect`, or iterable of them
        Method ids, "all", "fast" or "full", and detectors of the caller, as in `simbench.detect`.
    repeats : int
        Draws of loads and noise in each of twelve cells of S and J.
    seed : int
        Root of every random stream.
    jobs : int
        Worker processes, -1 for one on every core; the answer is the same.
    **signals
        op, pv, sp, mv, Ts in place of a record, and what is known of it, as in `simbench.detect`.

    Returns
    -------
    Trust
        The conclusion, and what each method is right of on loops that copy the record.

    Raises
    ------
    simbench.detectors.errors.UserError
        For an unknown method, or a record that cannot be read.

    Notes
    -----
    It is `simbench run` on the record, asked several times over: the run itself has every table.
    Not for a record to which no loop is near: it is said, and no method is ranked.

    Examples
    --------
    >>> from simbench.detectors.example_loop import example_loop
    >>> trusted = trust(example_loop(noise=0.1), methods=["fast"], repeats=1)
    >>> 0.0 <= trusted.probability <= 1.0
    True
    """
    if repeats < 1:
        raise ParameterError(f"trust: repeats = {repeats}; at least 1 is needed")
    asked, own = named_methods(methods)
    adopted = {name: as_plugin(name, detector) for name, detector in own.items()}
    record = repair_record(as_record(record, **signals))
    with registry.adopted(adopted):
        names = choose_methods(asked)
        refuse_wrong_forms(names)
        verdicts = judge(record, names)
    try:
        report = diagnose(record, identify=True)
    except UserError as why:
        return Trust(judged(record)[0], _rows(verdicts), 0, str(why), record)
    try:
        near = loop_of(report, record)
    except UserError as why:
        return Trust(report.conclusion, _rows(verdicts), 0, str(why), record)
    scores, sizes = _score_copies(near, record.tag or "the record", names, own, repeats, seed, jobs)
    return _weigh_answer(report.conclusion, record, verdicts, scores, sizes)


def _score_copies(
    near: NearLoop,
    name: str,
    methods: Sequence[str],
    own: Mapping[str, Any],
    repeats: int,
    seed: int,
    jobs: int,
) -> tuple[Scores, dict[str, float | None]]:
    """Return the scores of a run over the loops that copy a record, and the smallest S that each
    method finds in it.
    """
    # here, for it loads pandas
    from simbench.bench.execute.run import run_scored
    from simbench.bench.store.reading import read_table
    from simbench.gap.benchmark.from_records import grid_of_loops

    grid = grid_of_loops(
        {name: near}, "record", f"Loops that copy {name}", repeats=repeats, seed=seed, jobs=jobs
    )
    known = [m for m in methods if m not in own]
    with tempfile.TemporaryDirectory() as place:
        folder, scores = run_scored(
            grid, Path(place) / "run", known, 1 if own else jobs, own=own, progress=False
        )
        assert scores is not None
        tables = [
            read_table(folder, kind, names).to_pandas()
            for kind, names in (
                ("scenarios", ("scenario_id", "sticky", "S")),
                ("verdicts", ("scenario_id", "method", "verdict")),
            )
        ]
    return scores, _smallest(tables[1].merge(tables[0], on="scenario_id"))


def _smallest(answers: pd.DataFrame) -> dict[str, float | None]:
    """Return the smallest S from which on each method calls four of five sticking valves so."""
    stuck = answers[answers["sticky"].fillna(False).astype(bool)]
    called = stuck.assign(called=stuck["verdict"] == STICTION)
    shares = called.groupby(["method", "S"])["called"].mean()
    found: dict[str, float | None] = {}
    for method, share in shares.groupby(level="method"):
        enough = share.droplevel("method").sort_index(ascending=False) >= FOUND
        sizes = enough.index[enough.cummin().to_numpy()]
        found[str(method)] = float(sizes.min()) if len(sizes) else None
    return found


def _weigh_answer(
    conclusion: Conclusion,
    record: LoopRecord,
    verdicts: Sequence[Verdict],
    scores: Scores,
    sizes: Mapping[str, float | None],
) -> Trust:
    """Return the answer of a run: methods that see MV are counted where the record has it, and what
    the benchmark does not rank, such as a test for any nonlinearity, is not.
    """
    table = scores.table
    table = table[(table["process"] == "all") & (table["population"] == "all")]
    by = {truth: rows.set_index("method") for truth, rows in table.groupby("truth")}
    counted = by["cycled"]
    notes = []
    if float(counted["positives"].to_numpy().max()) < _FEW_CYCLING:
        counted = by["sticky"]
        notes.append(
            "friction of the sizes that were tried hardly makes this loop cycle: methods are"
            " counted by whether the valve sticks"
        )
    rows = []
    for verdict in verdicts:
        about = registry.load(verdict.method).METHOD if _is_known(verdict) else None
        left_out = about and (about.role != "stiction" or (about.needs_mv and record.mv is None))
        if verdict.method not in counted.index or left_out:
            rows.append(MethodTrust(verdict))
            continue
        row = counted.loc[verdict.method]
        numbers = {
            key: float(row[key]) if np.isfinite(row[key]) else None
            for key in ("cost", "cost_hi", "accuracy", "sensitivity", "false_positives")
        }
        rank = int(row["rank"]) if np.isfinite(float(row["rank"])) else None
        rows.append(MethodTrust(verdict, rank, **numbers, smallest_S=sizes.get(verdict.method)))
    return Trust(conclusion, _rows(rows), int(counted["n"].max()), "", record, tuple(notes), scores)


def _is_known(verdict: Verdict) -> bool:
    return verdict.method in registry.every_name()


def _rows(methods: Sequence[Verdict | MethodTrust]) -> tuple[MethodTrust, ...]:
    """Return methods that apply to the record first, the cheapest first."""
    rows = [m if isinstance(m, MethodTrust) else MethodTrust(m) for m in methods]

    def place(m: MethodTrust) -> tuple[bool, float]:
        return m.verdict.applicable is False, np.inf if m.cost is None else m.cost

    return tuple(sorted(rows, key=place))
