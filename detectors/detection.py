"""What a notebook calls: a record, a file or a simulated run in, the detectors' answers out."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any, Protocol

from detectors.errors import RecordError
from detectors.judge import judge
from detectors.plugins.registry import methods as registry
from detectors.procedure import Diagnosis
from detectors.procedure import diagnose as procedure
from detectors.record import LoopRecord
from detectors.records.io import read_record
from detectors.report.report import Report, choose_methods, judge_files


class _Recorded(Protocol):
    """Anything that carries a record, such as a simulated run."""

    @property
    def record(self) -> LoopRecord:
        """The record."""
        ...


Source = LoopRecord | _Recorded | str | Path


def detect(
    source: Source,
    methods: str | Iterable[str] = "all",
    *,
    raw: bool = False,
    front_end: str = "acf",
    plugins: Iterable[str | Path] = (),
    thresholds: Mapping[str, Mapping[str, float]] | None = None,
    **about: Any,
) -> Report:
    """Does this valve stick? Ask one or all detectors.

    Parameters
    ----------
    source : LoopRecord, run, str or Path
        A record, a simulated run, a record file, or a folder of them.
    methods : str or iterable of str
        Method ids, or "all", "fast", "full".
    raw : bool
        Without the oscillation front end.
    front_end : {"acf", "hagglund"}
        What says whether a loop oscillates, see `detectors.judge.judge`.
    plugins : iterable of str or Path
        Detector files outside the package; they are judged too.
    thresholds : dict of method id to dict of str to float, optional
        Other thresholds than the methods' own.
    **about
        What is known of the record: process, kind, op_span, pv_span; for files also columns, loop, Ts and labels.

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
    """
    asked = [methods] if isinstance(methods, str) else list(methods)
    if isinstance(source, (str, Path)):
        return judge_files(source, asked, raw=raw, front_end=front_end, plugins=plugins, thresholds=thresholds, **about)
    record = _as_record(source, **about)
    with registry.hosted(plugins) as added:
        names = choose_methods(asked)
        names += [a for a in added if a not in names]
        verdicts = judge(record, names, raw=raw, front_end=front_end, thresholds=thresholds)
    return Report([(None, v) for v in verdicts], records={None: record})


def diagnose(source: Source, **about: Any) -> Diagnosis:
    """Take one record through the chapter's whole procedure, step by step.

    Parameters
    ----------
    source : LoopRecord, run, str or Path
        A record, a simulated run, or a record file.
    **about
        What is known of it, as in `detect`; also odds_low, odds_high and follow_min, see `detectors.procedure.diagnose`.

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
    bounds = {k: about.pop(k) for k in ("odds_low", "odds_high", "follow_min") if k in about}
    return procedure(_as_record(source, **about), **bounds)


def _as_record(source: Source, **about: Any) -> LoopRecord:
    """Return the record that a source holds.

    Examples
    --------
    >>> _as_record(LoopRecord([1, 2, 3], [1, 2, 3], 1.0), kind="flow").kind
    'flow'
    """
    if isinstance(source, (str, Path)):
        return read_record(source, **about)
    record = source if isinstance(source, LoopRecord) else getattr(source, "record", None)
    if not isinstance(record, LoopRecord):
        raise RecordError(f"{type(source).__name__} is no record; a LoopRecord, a simulated run or a file is needed")
    return replace(record, **about) if about else record
