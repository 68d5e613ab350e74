"""What a notebook calls: a record, a file or a simulated run in, the detectors' answers out."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, Unpack, overload

from numpy.typing import ArrayLike

from detectors.judge import judge, refuse_wrong_forms
from detectors.plugins.registry import methods as registry
from detectors.procedure import Diagnosis
from detectors.procedure import diagnose as procedure
from detectors.record import LoopRecord
from detectors.report.report import Report, choose_methods, judge_files
from detectors.sources import (
    About,
    AboutFile,
    Methods,
    RecordSignals,
    as_plugin,
    as_record,
    named_methods,
)

if TYPE_CHECKING:
    from detectors.sources import Source
_Thresholds = Mapping[str, Mapping[str, float]]


@overload
def detect(
    source: Source,
    methods: Methods = "all",
    *,
    Ts: float | None = None,
    raw: bool = False,
    front_end: Literal["acf", "hagglund"] = "acf",
    plugins: Iterable[str | Path] = (),
    thresholds: _Thresholds | None = None,
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
    raw: bool = False,
    front_end: Literal["acf", "hagglund"] = "acf",
    plugins: Iterable[str | Path] = (),
    thresholds: _Thresholds | None = None,
    **about: Unpack[About],
) -> Report: ...
def detect(
    source: Source | None = None,
    methods: Methods = "all",
    *,
    op: ArrayLike | None = None,
    pv: ArrayLike | None = None,
    Ts: float | None = None,
    sp: ArrayLike | None = None,
    mv: ArrayLike | None = None,
    raw: bool = False,
    front_end: Literal["acf", "hagglund"] = "acf",
    plugins: Iterable[str | Path] = (),
    thresholds: _Thresholds | None = None,
    **about: Unpack[AboutFile],
) -> Report:
    """Does this valve stick? Ask one or all detectors.

    Parameters
    ----------
    source : LoopRecord, run, DataFrame, mapping, str or Path
        A record, a simulated run, a table or dict with columns op, pv and t, a record file, or a
        folder of them.
    methods : str, function, object with `detect`, or iterable of them
        Method ids, "all", "fast", "full"; a function of a LoopRecord that returns true (stiction),
        false, None, a verdict's word, one of these with a score, or a Verdict; an object whose
        `detect` does, copied before every record.
    op, pv, sp, mv : array_like, shape (n,)
        In place of a source: OP (%, or as `op_span` says), PV, SP (PV units), valve position (%).
    Ts : float
        Sampling period (s); of a source in place of its own.
    raw : bool
        Without the oscillation front end.
    front_end : {"acf", "hagglund"}
        What says whether a loop oscillates, see `detectors.judge.judge`.
    plugins : iterable of str or Path
        Detector files outside the package; they are judged too.
    thresholds : dict of method id to dict of str to float, optional
        Other thresholds than the methods' own.
    **about
        What is known of the record: process, kind, op_span, pv_span, tag; for tables columns; for
        files also loop and labels.

    Returns
    -------
    Report
        Iterates over verdicts; `report["horch"]` is one of them, `to_frame()` all of them.

    Raises
    ------
    UserError
        For files, methods and thresholds that do not exist or make no sense.

    Examples
    --------
    >>> import numpy as np
    >>> t = np.arange(600.0)
    >>> report = detect(LoopRecord(op=np.sin(t / 8), pv=-np.sin(t / 8), Ts=1.0), ["horch", "he"])
    >>> report["horch"].verdict, len(report)
    ('no_stiction', 2)
    >>> def half(record):
    ...     return record.op.mean() < 50.0
    >>> detect(op=np.sin(t / 8), pv=-np.sin(t / 8), Ts=1.0, methods=half).to_frame().method.tolist()
    ['half']
    """
    asked, own = named_methods(methods)
    with registry.adopted({name: as_plugin(name, detector) for name, detector in own.items()}):
        if isinstance(source, (str, Path)) and op is None and pv is None:
            given: dict[str, Any] = {**about, **({} if Ts is None else {"Ts": Ts})}
            return judge_files(
                source,
                asked,
                raw=raw,
                front_end=front_end,
                plugins=plugins,
                thresholds=thresholds,
                **given,
            )
        return _judged(
            as_record(source, op=op, pv=pv, sp=sp, mv=mv, Ts=Ts, **about),
            asked,
            raw,
            front_end,
            plugins,
            thresholds,
        )


def _judged(
    record: LoopRecord, asked: list[str], raw: bool, front_end: str, plugins: Any, thresholds: Any
) -> Report:
    with registry.hosted(plugins) as added:
        names = choose_methods(asked)
        names += [a for a in added if a not in names]
        refuse_wrong_forms(names)
        verdicts = judge(record, names, raw=raw, front_end=front_end, thresholds=thresholds)
    return Report([(None, v) for v in verdicts], records={None: record})


class _Procedure(RecordSignals, total=False):
    odds_low: float
    odds_high: float
    follow_min: float
    loop: str | None


def diagnose(source: Source | None = None, **about: Unpack[_Procedure]) -> Diagnosis:
    """Take one record through the chapter's whole procedure, step by step.

    Parameters
    ----------
    source : LoopRecord, run, DataFrame, mapping, str or Path
        A record, a simulated run, a table or dict with columns op, pv and t, or a record file.
    **about
        Signals in place of a source, and what is known of it, as in `detect`;
        also odds_low, odds_high and follow_min, see `detectors.procedure.diagnose`.

    Returns
    -------
    Diagnosis

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
    given: dict[str, Any] = {**about}
    bounds = {k: given.pop(k) for k in ("odds_low", "odds_high", "follow_min") if k in given}
    return procedure(as_record(source, **given), **bounds)
