"""The verbs of the command line as functions: the same words, the same answers."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, Unpack, overload

from numpy.typing import ArrayLike

from simbench.detectors.errors import ParameterError, UserError, nearest
from simbench.detectors.faults import sentence_of
from simbench.detectors.judge import judge, refuse_wrong_forms
from simbench.detectors.plugins.registry import methods as registry
from simbench.detectors.procedure import Diagnosis
from simbench.detectors.procedure import diagnose as procedure
from simbench.detectors.record import LoopRecord
from simbench.detectors.records.folder import read_folder, read_labels
from simbench.detectors.repaired import repair_record
from simbench.detectors.report.events import event_numbers
from simbench.detectors.report.report import Report, choose_methods, score_units
from simbench.detectors.sources import (
    About,
    AboutFile,
    Methods,
    RecordSignals,
    as_plugin,
    as_record,
    named_methods,
    split_names,
)
from simbench.detectors.verdict import PROBABILITY, Verdict
from simbench.detectors.views import page_part

if TYPE_CHECKING:
    import pandas as pd

    from simbench.bench.check.check_result import Check
    from simbench.bench.execute.run_options import RunOptions
    from simbench.bench.score.result import Scores
    from simbench.detectors.contract import Contract
    from simbench.detectors.sources import Source
    from simbench.gap.stiction.causes import Causes
    from simbench.gap.stiction.conclusion import Conclusion
    from simbench.scenarios.expansion import Grid


# sets of methods, and the method, with which all evidence is weighed; single methods are asked for
# their verdicts alone, and answer at once
_WEIGHED = {"all", "full", "likelihood"}


@overload
def detect(
    source: Source,
    methods: Methods = "all",
    *,
    Ts: float | None = None,
    plugins: Iterable[str | Path] = (),
    **about: Unpack[AboutFile],
) -> Report: ...
@overload
def detect(
    *,
    op: ArrayLike,
    pv: ArrayLike,
    Ts: float,
    sp: ArrayLike | None = None,
    mv: ArrayLike | None = None,
    methods: Methods = "all",
    plugins: Iterable[str | Path] = (),
    **about: Unpack[About],
) -> Report: ...
def detect(
    source: Source | None = None,
    methods: Methods = "all",
    *,
    plugins: Iterable[str | Path] = (),
    **about: Any,
) -> Report:
    """Say whether a valve sticks: weigh all evidence, and ask one or all detectors.

    Parameters
    ----------
    source : LoopRecord, run, DataFrame, mapping, str or Path
        A record, a simulated run, a table or dict with columns op, pv and t, a record file, or a
        folder of them.
    methods : str, function, object with `detect`, or iterable of them
        Method ids, "all", "fast", "full"; a function of a LoopRecord that returns true (stiction),
        false, None, a verdict's word, one of these with a score, or a Verdict; an object whose
        `detect` does, copied before every record. The conclusion is drawn with "all", "full" and
        "likelihood"; other methods answer alone, and at once.
    plugins : iterable of str or Path
        Detector files outside the package; they are judged too.
    **about
        op, pv, sp, mv (shape (n,)) in place of a source: OP (%, or in `op_span` units), PV, SP (PV
        units), valve position (%); Ts (s), which a source may have itself; what is known of the
        record: process, kind, op_span, pv_span, tag; for tables columns; for files also loop and
        labels.

    Returns
    -------
    Report
        `conclusion` says whether the valve sticks; the report iterates over verdicts,
        `report["horch"]` is one of them, `to_frame()` all of them.

    Raises
    ------
    UserError
        For files and methods that do not exist or make no sense.

    Examples
    --------
    >>> from simbench.detectors.example_loop import example_loop
    >>> record = example_loop(noise=0.1)
    >>> detect(record, ["likelihood", "he"]).conclusion.verdict
    'stiction'
    >>> detect(record, "he").conclusion is None
    True
    >>> def half(record):
    ...     return record.op.std() < 0.1
    >>> report = detect(op=record.op, pv=record.pv, Ts=1.0, methods=[half, "horch"])
    >>> report["half"].verdict, len(report), report.to_frame().method.tolist()
    ('no_stiction', 2, ['half', 'horch'])
    """
    # Detectors of one's own take part under their names
    asked, custom = named_methods(methods)
    with registry.adopted({name: as_plugin(name, detector) for name, detector in custom.items()}):
        # A file, or a folder of them
        signals = about.get("op"), about.get("pv")
        if isinstance(source, (str, Path)) and all(signal is None for signal in signals):
            known = {}
            for k, v in about.items():
                if k not in ("op", "pv", "sp", "mv"):
                    known[k] = v
            return judge_files(source, asked, plugins=plugins, **known)

        # A record, repaired where it must be
        record = repair_record(as_record(source, **about))
        with registry.added(plugins) as added:
            names = choose_methods(asked + added)
            refuse_wrong_forms(names)
            verdicts = judge(record, names)

        # The conclusion, where all methods are asked
        if _weighs_evidence(asked):
            conclusions = {None: _conclude_record(record)}
        else:
            conclusions = {}
        return Report(
            [(None, v) for v in verdicts], records={None: record}, conclusions=conclusions
        )


def judge_files(
    path: str | Path,
    methods: Iterable[str] = ("all",),
    *,
    plugins: Iterable[str | Path] = (),
    concludes: bool | None = None,
    labels: str | Path | None = None,
    at_once: Callable[[Report], None] | None = None,
    **about: Any,
) -> Report:
    """Judge a record file, a folder of them, or an ISDB .mat file.

    Parameters
    ----------
    path : str or Path
        Record, folder of records, or ISDB .mat file.
    methods : iterable of str
        Method ids, "all", "fast", "full".
    plugins : iterable
        As in `detect`.
    concludes : bool, optional
        Whether all evidence about each record is weighed as well; by default with "all", "full"
        and "likelihood".
    labels : str or Path, optional
        Table of labels (CSV) by which a folder is scored.
    at_once : callable, optional
        Takes a `Report` of the conclusion about a single record, before any method is asked.
    **about
        What is known of the record: process, kind, op_span, pv_span, columns, Ts;
        tag or loop where a file has several; loops, a table with what is known of each.

    Returns
    -------
    Report
        One verdict per record and method; `to_frame()` has all of them as a table.

    Raises
    ------
    UserError
        For files and methods that do not exist or make no sense.

    Examples
    --------
    >>> import tempfile
    >>> file = Path(tempfile.mkdtemp(), "short.csv")
    >>> _ = file.write_text("t,op,pv\\n0,50,1\\n1,51,2\\n2,50,1\\n")
    >>> judge_files(file, ["horch"])["horch"].verdict
    'no_decision'
    """
    asked = list(methods)
    if concludes is None:
        concludes = _weighs_evidence(asked)

    # 1. choose the methods
    with registry.added(plugins) as added:
        names = choose_methods(asked + added)
        # 2. read the records
        if labels is None:
            known = {}
        else:
            known = read_labels(labels)
        refuse_wrong_forms(names)
        records, refused, alone = _read_all(Path(path), known, labels, **about)
        # 3. weigh all evidence about each where that is asked for, and judge it by every method
        verdicts = []
        conclusions = {}
        for name, record in records.items():
            try:
                record = records[name] = repair_record(record)
                if concludes:
                    concluded = {name: _conclude_record(record)}
                else:
                    concluded = {}
                if alone and at_once is not None:
                    at_once(Report([], records={name: record}, conclusions=concluded))
                judged = judge(record, names)
            except Exception as error:
                if name is None:
                    raise
                refused[name] = sentence_of(error)  # the other records are answered
            else:
                verdicts += [(name, verdict) for verdict in judged]
                conclusions |= concluded
        records = {name: record for name, record in records.items() if name not in refused}
        # 4. score against the labels
        answers = [(name, _as_verdict(one)) for name, one in conclusions.items()]
        if known:
            scores = score_units(answers + verdicts, known)
        else:
            scores = []
        if alone:
            events = {}
        else:
            events = event_numbers(records)
        return Report(verdicts, refused, scores, records, conclusions, events)


def _weighs_evidence(methods: Iterable[str]) -> bool:
    """Return whether all evidence about a record is weighed where these methods are asked."""
    return not _WEIGHED.isdisjoint(split_names(methods))


def _as_verdict(conclusion: Conclusion) -> Verdict:
    """Return a conclusion as the answer of a method of this name."""
    if conclusion.probability is None:
        p = float("nan")
    else:
        p = conclusion.probability
    return Verdict("conclusion", conclusion.verdict, p, reason=conclusion.reason)


def _conclude_record(record: LoopRecord) -> Conclusion:
    """Weigh all evidence about one record."""
    # its models take a second to load, and single methods need none
    from simbench.gap.diagnosis import conclude

    return conclude(record)


def _read_all(
    path: Path,
    known: Mapping[str, Mapping[str, str]],
    labels: str | Path | None,
    **about: Any,
) -> tuple[dict[str | None, LoopRecord], dict[str, str], bool]:
    """Return records by name (None for a single one), the sentences of those left out, and whether
    one record alone was asked for.
    """
    # labels are of several records
    if labels is not None and path.is_file() and path.suffix.lower() != ".mat":
        one = f"labels score a folder of records; {path} is no folder, which is needed"
        raise ParameterError(one)

    # a folder's records with what the labels say of them, or those of one file
    each = {}
    for name, row in known.items():
        each[name] = {"kind": row["kind"], "process": row["process"]}
    records, refused = read_folder(path, names=known or None, each=each, **about)
    alone = path.is_file() and len(records) + len(refused) == 1
    return {None if alone else name: record for name, record in records.items()}, refused, alone


@dataclass(frozen=True)
class LoopDiagnosis:
    """What makes one loop oscillate.

    Parameters
    ----------
    conclusion : Conclusion
        Whether the valve sticks, from all evidence.
    causes : Causes
        Every cause with its confidence.
    procedure : Diagnosis
        The chapter's procedure, question by question.
    record : LoopRecord
        The record as it was judged.
    """

    conclusion: Conclusion
    causes: Causes
    procedure: Diagnosis
    record: LoopRecord = field(repr=False)

    @property
    def verdict(self) -> str:
        """The verdict of the conclusion."""
        return self.conclusion.verdict

    def as_json(self) -> dict[str, Any]:
        """Return everything as JSON types; NaN becomes null."""
        # The procedure, and what the conclusion says in its place
        whole = self.procedure.as_json()
        concluded = self.conclusion
        told = ("verdict", "score", "conclusion", "reason", "next_test")
        return whole | {
            "verdict": concluded.verdict,
            "reason": concluded.reason,
            "next_test": concluded.next,
            "conclusion": concluded.as_json(),
            PROBABILITY: concluded.probability,
            "causes": self.causes.as_json(),
            "procedure": {key: whole[key] for key in told},
            "notes": list(self.record.notes),
        }

    def as_text(self) -> str:
        """Return conclusion, causes and procedure for a terminal."""
        return "\n".join(
            self.conclusion.as_lines()
            + ["Causes with their confidence (0 to 1; several may act):"]
            + self.causes.as_lines(self.conclusion.reason)
            + [
                "The diagnosis procedure of the book chapter (one method among others):",
                self.procedure.as_text(),
            ]
        )

    def to_frame(self) -> pd.DataFrame:
        """Return the path of the procedure, one row per question."""
        return self.procedure.to_frame()

    def __repr__(self) -> str:
        """Return one line."""
        return f"LoopDiagnosis: {self.conclusion.sentence()}"

    def _repr_html_(self) -> str:
        said = f"{self.conclusion.sentence()} Next: {self.conclusion.next}"
        return page_part(said, self.to_frame().drop(columns="step"))


def diagnose(source: Source | None = None, **about: Unpack[RecordSignals]) -> LoopDiagnosis:
    """Find what makes a loop oscillate: stiction, tuning, a disturbance or another cause.

    Parameters
    ----------
    source : LoopRecord, run, DataFrame, mapping, str or Path
        A record, a simulated run, a table or dict with columns op, pv and t, or a record file.
    **about
        Signals in place of a source, and what is known of it, as in `detect`.

    Returns
    -------
    LoopDiagnosis
        conclusion, causes and the steps of the chapter's procedure.

    Raises
    ------
    RecordError
        For a file that is no record.

    Examples
    --------
    >>> import numpy as np
    >>> t = np.arange(3000) / 10
    >>> diagnose(LoopRecord(np.sin(t), -np.sin(t), 1.0, process="self-regulating")).verdict
    'no_stiction'
    """
    from simbench.gap.stiction.conclusion import judged

    record = repair_record(as_record(source, **about))
    return LoopDiagnosis(*judged(record), procedure(record), record)


def check(
    folder: str | Path,
    against: str | Path,
    *,
    margin: float | None = None,
    exact: bool = False,
) -> Check:
    """Compare a run with a baseline, loop by loop, and say whether a detector lost accuracy.

    Parameters
    ----------
    folder : str or Path
        Folder of the run.
    against : str or Path
        Folder of the baseline, or of an earlier run.
    margin : float, optional
        Share of right answers that may be lost (0 to 1); 0.01 when absent.
    exact : bool
        Fail on every changed verdict or score of a method of the package.

    Returns
    -------
    Check
        `result` is "same", "worse" or "cannot tell"; `as_text()` says where.

    Raises
    ------
    RunError
        Where the two cannot be compared.
    """
    from simbench.bench.check.check import MARGIN, check_run

    return check_run(folder, against, MARGIN if margin is None else margin, exact)


def contract(path: str | Path) -> Contract:
    """Check whether a file keeps the contract of a detector.

    Parameters
    ----------
    path : str or Path
        The file (.py); it runs in this process.

    Returns
    -------
    Contract
        kept, and broken: one sentence, with its line, for every point that does not hold.

    Raises
    ------
    ParameterError
        For a file that is not there, or whose name is no id.

    Examples
    --------
    >>> from simbench.detectors.methods import horch
    >>> contract(horch.__file__).kept
    True
    """
    from simbench.detectors.contract import check_detector

    return check_detector(path)


def run(
    grid: str | Path | Grid,
    methods: Methods = ("fast", "oracle"),
    *,
    out: str | Path | None = None,
    jobs: int = 1,
    add: bool = False,
    answers: Iterable[str | Path] = (),
    **options: Unpack[RunOptions],
) -> Path:
    """Simulate a grid of scenarios, judge every record by every method, and write both tables.

    Parameters
    ----------
    grid : str, Path or Grid
        Name, TOML file, a grid at hand, the folder of a run, or a record or a folder of
        records: the loops that copy them, with sound valves and with sticking ones. Records that no
        loop is near are left out.
    methods : str, function, object with `detect`, or iterable of them
        Method ids, "fast", "full", "oracle", and detectors of the caller, as in `simbench.detect`.
    out : str or Path, optional
        Folder of the run; runs/GRID when absent.
    jobs : int
        Worker processes; -1 = all cores.
    add : bool
        Add the methods to the finished run whose folder is `grid`.
    answers : iterable of str or Path
        Files of answers that are added to that run.
    **options
        Keys of `simbench.bench.execute.run_options.RunOptions`: n, sets, axes, plugins, resume, ...

    Returns
    -------
    Path
        Folder of the run; give it to `score`.

    Raises
    ------
    UserError
        For what the user can put right.

    Examples
    --------
    >>> import tempfile
    >>> folder = run("smoke", "horch", out=tempfile.mkdtemp(), sets={"disturbance": "none"})
    >>> score(folder).to_frame().method.tolist()[0]
    'horch'
    """
    from simbench.bench.execute.add import add_to_run
    from simbench.bench.execute.run import run_grid
    from simbench.bench.store.benchmark import is_records
    from simbench.scenarios.expansion import Grid

    # add to a finished run
    if add or answers:
        if isinstance(grid, Grid):
            raise UserError("add and answers add methods to a finished run: its folder is needed")
        return add_to_run(grid, methods, out, jobs, add=add, answers=answers, **options).folder

    # make a grid of records
    if is_records(grid):
        from simbench.gap.benchmark.from_records import plan_of_records

        if out is None:
            out = Path("runs") / Path(str(grid)).stem
        else:
            out = Path(out)
        grid = plan_of_records(str(grid), out, options, jobs=jobs).grid
        options["sets"] = None
    return run_grid(grid, out, methods, jobs, **options)


def score(folder: str | Path) -> Scores:
    """Score a run: cost, accuracy, sensitivity, false positives and no decision, with intervals.

    Parameters
    ----------
    folder : str or Path
        Folder of a run.

    Returns
    -------
    Scores
        Tables of every method; `to_frame()` is the ranking.

    Raises
    ------
    UserError
        When the folder holds no complete run.
    """
    from simbench.bench.score.scoring import score_run

    return score_run(folder)


def table(folder: str | Path, kind: str = "paper", truth: str = "cycled") -> pd.DataFrame:
    """Return one table of a run's scores.

    Parameters
    ----------
    folder : str or Path
        Folder of a run.
    kind : str
        paper (values with their 95 % intervals as text, = after a rank that methods share), ranking
        (the same as numbers), or pairs (wins, ties, losses and p of every two methods).
    truth : str
        The label that answers are compared with: cycled, predicted or sticky.

    Returns
    -------
    DataFrame
        One row per method, best first; of pairs, one row per pair.

    Raises
    ------
    UserError
        When the folder holds no complete run, or for another kind.
    """
    from simbench.bench.score import paper
    from simbench.bench.score.scoring import score_run

    scores = score_run(folder)
    kinds = {
        "paper": lambda: paper.ranking_text(scores, truth),
        "ranking": lambda: paper.ranking_numbers(scores, truth),
        "pairs": lambda: scores.compare(truth).pairs,
    }
    if kind not in kinds:
        raise UserError(f"table {kind!r}: {nearest(kind, kinds)}")
    return kinds[kind]()
