"""Run detectors on a record, a file, a folder or a simulated run: the functions that notebooks and
the command line call.

The steps of `detect`: name the methods, load the plug-ins, read the record
(`as_record`, or `read_records` and `read_folder` for files), weigh all evidence about it
(`conclude`), judge it by every method (`judge`), and collect verdicts and conclusions in a
`Report`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, Unpack, overload

from numpy.typing import ArrayLike

from simbench.detectors.errors import ParameterError
from simbench.detectors.faults import sentence_of
from simbench.detectors.judge import judge, refuse_wrong_forms
from simbench.detectors.plugins.registry import methods as registry
from simbench.detectors.record import LoopRecord
from simbench.detectors.records.folder import read_folder
from simbench.detectors.records.io import read_records
from simbench.detectors.records.isdb import read_loops
from simbench.detectors.records.labels import read_labels
from simbench.detectors.repaired import repair_record
from simbench.detectors.report.events import event_numbers
from simbench.detectors.report.report import Report, choose_methods, score_units
from simbench.detectors.sources import (
    About,
    AboutFile,
    Methods,
    as_plugin,
    as_record,
    named_methods,
)
from simbench.detectors.verdict import Verdict

if TYPE_CHECKING:
    from simbench.detectors.sources import Source
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
    asked, custom = named_methods(methods)
    with registry.adopted({name: as_plugin(name, detector) for name, detector in custom.items()}):
        signals = about.get("op"), about.get("pv")
        if isinstance(source, (str, Path)) and all(signal is None for signal in signals):
            known = {k: v for k, v in about.items() if k not in ("op", "pv", "sp", "mv")}
            return judge_files(source, asked, plugins=plugins, **known)
        record = repair_record(as_record(source, **about))
        with registry.added(plugins) as added:
            names = choose_methods([*asked, *added])
            refuse_wrong_forms(names)
            verdicts = judge(record, names)
        conclusions = {None: _conclude(record)} if _weighs(asked) else {}
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
    concludes = _weighs(asked) if concludes is None else concludes
    # 1. choose the methods
    with registry.added(plugins) as added:
        names = choose_methods([*asked, *added])
        # 2. read the records
        known = {} if labels is None else read_labels(labels)
        refuse_wrong_forms(names)
        records, refused, alone = _read_all(Path(path), known, labels, **about)
        # 3. weigh all evidence about each where that is asked for, and judge it by every method
        verdicts = []
        conclusions = {}
        for name, record in records.items():
            try:
                record = records[name] = repair_record(record)
                concluded = {name: _conclude(record)} if concludes else {}
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
        scores = score_units([*answers, *verdicts], known) if known else []
        events = {} if alone else event_numbers(records)
        return Report(verdicts, refused, scores, records, conclusions, events)


def _weighs(methods: Iterable[str]) -> bool:
    """Return whether all evidence about a record is weighed where these methods are asked."""
    return bool(_WEIGHED & {one.strip() for text in methods for one in text.split(",")})


def _as_verdict(conclusion: Conclusion) -> Verdict:
    """Return a conclusion as the answer of a method of this name."""
    p = float("nan") if conclusion.probability is None else conclusion.probability
    return Verdict("conclusion", conclusion.verdict, p, reason=conclusion.reason)


def _conclude(record: LoopRecord) -> Conclusion:
    """Weigh all evidence about one record."""
    # its models take a second to load, and single methods need none
    from simbench.gap.diagnosis import conclude

    return conclude(record)


def _read_all(
    path: Path,
    known: Mapping[str, Mapping[str, str]],
    labels: str | Path | None,
    *,
    tag: str | None = None,
    **about: Any,
) -> tuple[dict[str | None, LoopRecord], dict[str, str], bool]:
    """Return records by name (None for a single one), the sentences of those left out, and whether
    one record alone was asked for.
    """
    about["tag"] = tag
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
