"""Run detectors on a record, a file, a folder or a simulated run: the functions that notebooks and
the command line call.

The steps of `detect`: name the methods, start the plug-ins' processes, read the record
(`as_record`, or `read_records` and `read_folder` for files), judge it by every method (`judge`),
and collect the verdicts in a `Report`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from simbench.detectors.errors import ParameterError
from simbench.detectors.faults import sentence_of
from simbench.detectors.judge import judge, refuse_wrong_forms
from simbench.detectors.plugins.host import SECONDS
from simbench.detectors.plugins.registry import methods as registry
from simbench.detectors.record import LoopRecord
from simbench.detectors.records.io import read_folder, read_labels, read_records
from simbench.detectors.records.isdb import read_loops
from simbench.detectors.repaired import repair_record
from simbench.detectors.report.events import event_numbers
from simbench.detectors.report.report import Report, ShownConclusion, choose_methods, score_units
from simbench.detectors.sources import (
    Methods,
    as_plugin,
    as_record,
    named_methods,
)

if TYPE_CHECKING:
    from simbench.detectors.sources import Source


def detect(
    source: Source | None = None,
    methods: Methods = "all",
    *,
    plugins: Iterable[str | Path] = (),
    conclude: Callable[[LoopRecord], ShownConclusion] | None = None,
    **about: Any,
) -> Report:
    """Ask one or all detectors, and whoever concludes; see `simbench.detect`."""
    asked, custom = named_methods(methods)
    settings = _JudgeSettings(conclude=conclude)
    with registry.adopted({name: as_plugin(name, detector) for name, detector in custom.items()}):
        signals = about.get("op"), about.get("pv")
        if isinstance(source, (str, Path)) and all(signal is None for signal in signals):
            known = {k: v for k, v in about.items() if k not in ("op", "pv", "sp", "mv")}
            return _judge_files(source, asked, settings, plugins, **known)
        record = repair_record(as_record(source, **about))
        with registry.hosted(plugins) as added:
            names = choose_methods([*asked, *added])
            refuse_wrong_forms(names)
            verdicts = judge(record, names)
        conclusions = {} if conclude is None else {None: conclude(record)}
        return Report(
            [(None, v) for v in verdicts], records={None: record}, conclusions=conclusions
        )


def judge_files(
    path: str | Path,
    methods: Iterable[str] = ("all",),
    *,
    plugins: Iterable[str | Path] = (),
    time_limit: float = SECONDS,
    conclude: Callable[[LoopRecord], ShownConclusion] | None = None,
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
    time_limit : float
        Seconds that a plug-in may take for one record.
    conclude : callable, optional
        Weighs all evidence of one record.
    **about
        What is known of the record: process, kind, op_span, pv_span, columns, Ts, longest_segment;
        tag or loop where a file has several; loops, a table with what is known of each; labels, by
        which a folder is scored.

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
    settings = _JudgeSettings(time_limit, conclude)
    return _judge_files(path, methods, settings, plugins, **about)


@dataclass(frozen=True)
class _JudgeSettings:
    """How every record is judged."""

    time_limit: float = SECONDS
    conclude: Callable[[LoopRecord], ShownConclusion] | None = None


def _judge_files(
    path: str | Path,
    methods: Iterable[str],
    settings: _JudgeSettings,
    plugins: Iterable[str | Path],
    *,
    labels: str | Path | None = None,
    **about: Any,
) -> Report:
    # 1. choose the methods; plug-ins answer in separate processes
    with registry.hosted(plugins, settings.time_limit) as added:
        names = choose_methods([*methods, *added])
        # 2. read the records
        known = {} if labels is None else read_labels(labels)
        refuse_wrong_forms(names)
        records, refused, alone = _read(Path(path), known, labels, **about)
        # 3. judge each by every method, and weigh all evidence where that is asked for
        verdicts, conclusions = [], {}
        for name, record in records.items():
            try:
                record = records[name] = repair_record(record)
                judged = judge(record, names)
                if settings.conclude is not None:
                    conclusions[name] = settings.conclude(record)
            except Exception as error:
                if name is None:
                    raise
                refused[name] = sentence_of(error)  # the other records are answered
            else:
                verdicts += [(name, verdict) for verdict in judged]
        records = {name: record for name, record in records.items() if name not in refused}
        # 4. score against the labels
        scores = score_units(verdicts, known) if known else []
        events = {} if alone else event_numbers(records)
        return Report(verdicts, refused, scores, records, conclusions, events)


def _read(
    path: Path,
    known: Mapping[str, Mapping[str, str]],
    labels: str | Path | None,
    *,
    tag: str | None = None,
    loop: str | None = None,
    longest_segment: bool = False,
    **about: Any,
) -> tuple[dict[str | None, LoopRecord], dict[str, str], bool]:
    """Return records by name (None for a single one), the sentences of those left out, and whether
    one record alone was asked for.
    """
    about |= {
        "tag": tag if tag is not None else loop,
        "longest_segment": longest_segment or None,
    }
    folder = path.is_dir() or (
        path.suffix.lower() == ".mat"
        and path.exists()
        and about["tag"] is None
        and len(read_loops(path)) > 1
    )
    if folder:
        each = {
            name: {"kind": row["kind"], "process": row["process"]} for name, row in known.items()
        }
        records, refused = read_folder(path, names=known or None, each=each, **about)
        return {**records}, refused, False
    if labels is not None:
        raise ParameterError(
            f"labels score a folder of records; {path} is no folder, which is needed"
        )
    records, refused = read_records(path, **about)
    alone = len(records) + len(refused) == 1
    return {None if alone else name: record for name, record in records.items()}, refused, alone
