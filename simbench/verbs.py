"""The verbs of the command line as functions: the same words, the same answers."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, TypedDict, Unpack

from simbench.detectors.errors import UserError, nearest
from simbench.detectors.procedure import Diagnosis
from simbench.detectors.procedure import diagnose as procedure
from simbench.detectors.record import LoopRecord
from simbench.detectors.repaired import repair_record
from simbench.detectors.sources import Methods, RecordSignals, as_record, named_methods
from simbench.detectors.verdict import PROBABILITY
from simbench.detectors.views import page_part

if TYPE_CHECKING:
    import pandas as pd

    from simbench.bench.score.check_result import Check
    from simbench.bench.score.result import Scores
    from simbench.detectors.contract import Contract
    from simbench.detectors.sources import Source
    from simbench.gap.stiction.causes import Causes
    from simbench.gap.stiction.conclusion import Conclusion
    from simbench.scenarios.expansion import Grid


class _Settings(TypedDict, total=False):
    """Further settings of a run."""

    resume: bool
    sets: Mapping[str, Any] | None
    axes: Mapping[str, Sequence[Any]] | None
    plugins: Iterable[str | Path]
    valve_plugins: Iterable[str | Path]
    effect_plugins: Iterable[str | Path]
    plant_plugins: Iterable[str | Path]
    controller_plugins: Iterable[str | Path]
    n: int | None
    keep: int
    fresh_seeds: bool
    with_reference: bool
    progress: bool | None
    add: bool
    answers: Iterable[str | Path]
    backend: Literal["loky", "dask", "ray"]
    address: str | None


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
            "notes": [*self.record.notes],
        }

    def as_text(self) -> str:
        """Return conclusion, causes and procedure for a terminal."""
        return "\n".join(
            [
                *self.conclusion.as_lines(),
                "Causes with their confidence (0 to 1; several may act):",
                *self.causes.as_lines(self.conclusion.reason),
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
    from simbench.bench.score.check import MARGIN, check_run

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
    **settings: Unpack[_Settings],
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
    **settings
        Further arguments of `simbench.bench.execute.run.run_grid`: resume, n, sets,
        axes, plugins, valve_plugins, effect_plugins, plant_plugins, controller_plugins,
        keep, fresh_seeds, progress, backend, address, with_reference; and of
        `simbench.bench.execute.add.add_to_run`: add and answers, which add methods, or answers from
        files, to the finished run whose folder is `grid`.

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

    names, own = named_methods(methods)
    if not (settings.get("add") or settings.get("answers")):
        settings.pop("add", None)
        settings.pop("answers", None)
        if is_records(grid):
            from simbench.gap.benchmark.from_records import plan_of_records

            out = Path("runs") / Path(str(grid)).stem if out is None else Path(out)
            keys = ("sets", "axes", "fresh_seeds", "with_reference")
            deciding = {key: settings.pop(key) for key in keys if key in settings}
            resume = settings.get("resume", False)
            grid = plan_of_records(str(grid), out, deciding, resume=resume, jobs=jobs).grid
        return run_grid(grid, out, names, jobs, own=own, **settings)
    if isinstance(grid, Grid):
        raise UserError("add and answers add methods to a finished run: its folder is needed")
    add = {"add": False, **settings}
    return add_to_run(grid, names, out, jobs, own=own, **add).folder


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
    from simbench.bench.score.scoring import score_run
    from simbench.bench.score.show import paper

    scores = score_run(folder)
    kinds = {
        "paper": lambda: paper.ranking_text(scores, truth),
        "ranking": lambda: paper.ranking_numbers(scores, truth),
        "pairs": lambda: scores.compare(truth).pairs,
    }
    if kind not in kinds:
        raise UserError(f"table {kind!r}: {nearest(kind, kinds)}")
    return kinds[kind]()
