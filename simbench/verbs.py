"""The verbs of the command line as functions: the same words, the same answers."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, Unpack, overload

from numpy.typing import ArrayLike

from simbench.detectors import detection
from simbench.detectors.procedure import Diagnosis
from simbench.detectors.procedure import diagnose as procedure
from simbench.detectors.record import LoopRecord
from simbench.detectors.repaired import repair_record
from simbench.detectors.report.report import Report
from simbench.detectors.sources import (
    About,
    AboutFile,
    Methods,
    RecordSignals,
    as_record,
    named_methods,
)
from simbench.detectors.verdict import PROBABILITY
from simbench.detectors.views import page_part

if TYPE_CHECKING:
    import pandas as pd

    from simbench.bench.score.check_result import Check
    from simbench.detectors.contract.engine import Contract
    from simbench.detectors.sources import Source
    from simbench.gap.stiction.causes import Causes
    from simbench.gap.stiction.conclusion import Conclusion

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
    >>> from random_case import random_case
    >>> record = random_case(5, ("stiction",)).record
    >>> detect(record, ["likelihood", "he"]).conclusion.verdict
    'stiction'
    >>> detect(record, "he").conclusion is None
    True
    >>> def half(record):
    ...     return record.op.mean() < 50.0
    >>> report = detect(op=record.op, pv=record.pv, Ts=1.0, methods=[half, "horch"])
    >>> report["half"].verdict, len(report), report.to_frame().method.tolist()
    ('no_stiction', 2, ['half', 'horch'])
    """
    weighed = weighs(named_methods(methods)[0])
    return detection.detect(
        source, methods, plugins=plugins, conclude=concluded if weighed else None, **about
    )


def concluded(record: LoopRecord) -> Conclusion:
    """Return the conclusion of all evidence about one record."""
    from simbench.gap.diagnosis import conclude

    return conclude(record)


def weighs(methods: Iterable[str]) -> bool:
    """Return whether all evidence about a record is weighed where these methods are asked."""
    return bool(_WEIGHED & {one.strip() for text in methods for one in text.split(",")})


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
        whole, concluded = self.procedure.as_json(), self.conclusion
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
                "Causes with their confidence (0 to 1). Several may act, so they need not add up"
                " to 1:",
                *self.causes.as_lines(),
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
    'no_decision'
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
    plugins: Iterable[str | Path] = (),
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
    plugins : iterable of str or Path
        Files of plug-ins that the run used, which are asked again where bits differ.

    Returns
    -------
    Check
        `result` is "same", "worse" or "cannot tell"; `as_text()` says where.

    Raises
    ------
    RunError
        Where the two cannot be compared.
    """
    from simbench.bench.execute.again import check_and_ask_again
    from simbench.bench.score.check import MARGIN

    return check_and_ask_again(
        folder, against, MARGIN if margin is None else margin, exact, plugins
    )


def contract(path: str | Path) -> Contract:
    """Check whether a file can be used by simbench: a detector, valve, effect, plant, controller or
    grid.

    Parameters
    ----------
    path : str or Path
        The file (.py, or .toml of a grid); it runs in a process of its own.

    Returns
    -------
    Contract
        kept, broken (one sentence for every point that does not hold) and notes.

    Raises
    ------
    ParameterError
        For a file that is none of these.

    Examples
    --------
    >>> from simbench.loop.valves import deadband
    >>> contract(deadband.__file__).kept
    True
    """
    from simbench.contract import check_in_subprocess

    return check_in_subprocess(path)
