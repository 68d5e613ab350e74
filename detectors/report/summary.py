"""Print the verdicts of `detect`: one sentence, one table, every note once; the reasons on
request.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Iterable, Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from simbench.detectors.plugins.registry import methods as registry
from simbench.detectors.verdict import (
    NO_DECISION,
    NO_STICTION,
    NOT_OSCILLATING,
    STICTION,
    Level,
    Verdict,
)
from simbench.detectors.views import columns

if TYPE_CHECKING:
    import pandas as pd

    from simbench.detectors.record import LoopRecord

VERDICT_WORDS = {STICTION: "stiction", NO_STICTION: "no stiction", NO_DECISION: "no decision"}
CONCLUDED = {**VERDICT_WORDS, NO_DECISION: "cannot tell"}
_SIGNS = {STICTION: "S", NO_STICTION: "-", NO_DECISION: "?"}
_LEGEND = (
    "S: stiction, -: no stiction, ?: no decision, blank: the method does not apply to the loop."
)
_IN_DATA = f"JSON and CSV have {NO_STICTION} and {NO_DECISION}."
_COLUMNS = f"Score: on each method's own scale, more is stickier. {_IN_DATA}"
_NOT_ASKED = f"not asked: {NOT_OSCILLATING}"
FITS = {True: "yes", False: "no", None: "cannot tell"}  # whether a method applies
_NAMED = 5  # records named in a sentence


def sentence(verdicts: Sequence[Verdict]) -> str:
    """Count the verdicts of the methods; they are evidence, no conclusion."""
    # one method has no count
    if len(verdicts) == 1 and not _is_at_rest(verdicts[0]):
        return f"{verdicts[0].method} reports {VERDICT_WORDS[verdicts[0].verdict]}"

    # which methods count
    asked = []
    for v in verdicts:
        if not _is_test(v.method):
            asked.append(v)
    others = [v for v in asked if v.applicable is not False]
    left_out = len(asked) - len(others)
    resting = len(others) - len(others := [v for v in others if not _is_at_rest(v)])

    # how many say what
    count = Counter(v.verdict for v in others)
    if resting and not others:
        return f"{resting} {_NOT_ASKED}"
    text = (
        f"{count[STICTION]} of {len(others)} methods"
        f" {'reports' if count[STICTION] == 1 else 'report'} stiction, "
    )
    text += f"{count[NO_STICTION]} no stiction, {count[NO_DECISION]} no decision"
    if resting:
        text += f"; {resting} {_NOT_ASKED}"
    return text + (f"; {left_out} not applicable to this loop" if left_out else "")


def _most_report_stiction(verdicts: Sequence[Verdict]) -> bool:
    """Return whether more than half of the applicable methods report stiction."""
    asked = []
    for v in verdicts:
        if v.applicable is not False and not _is_test(v.method):
            asked.append(v)
    return sum(v.verdict == STICTION for v in asked) > 0.5 * len(asked)


def notes_of(verdicts: Sequence[Verdict], record: LoopRecord | None = None) -> list[str]:
    """Return what is true of the record and not of one method: stated by most of several, or by the
    loader.
    """
    clauses = Counter()
    for v in verdicts:
        clauses.update(list(dict.fromkeys(_split_clauses(v.reason))))
    least = max(2, (len(verdicts) + 1) // 2)
    return list(record.notes if record else ()) + [c for c, n in clauses.items() if n >= least]


def own_reason(verdict: Verdict, shared: Collection[str]) -> str:
    """Return a verdict's reason without what is said of the whole record already."""
    clauses = _split_clauses(verdict.reason)
    return "; ".join([c for c in clauses if c not in shared] or clauses[:1])


def as_text(
    groups: Iterable[tuple[str | None, list[Verdict], LoopRecord | None]],
    concluded: Mapping[str | None, Sequence[str]] | None = None,
    *,
    why: bool = False,
) -> str:
    """Return what was concluded of each record, summary and table, and the reasons where asked
    for.
    """
    # one record: conclusion, methods, notes
    records = list(groups)
    concluded = concluded or {}
    lines = []
    if len(records) == 1:
        name, verdicts, record = records[0]
        # tests of nonlinearity have a line, where methods have a table
        counted = [v for v in verdicts if not _is_test(v.method)] or verdicts
        beside = " (no votes)" if name in concluded else ""
        lines += (
            ([opening(name, record, concluded.get(name, ()))] if record is not None else [])
            + [f"Methods: {sentence(verdicts)}{beside}."]
            + _verdict_lines(counted)
            + [_COLUMNS]
            + [f"note: {n}" for n in _not_counted(verdicts) + notes_of(verdicts, record)]
        )
    elif records:
        methods = [f"{i}={v.method}" for i, v in enumerate(records[0][1], 1)]
        sticky = [str(name) for name, verdicts, _ in records if _most_report_stiction(verdicts)]
        lines.append(
            f"Most methods report stiction in {len(sticky)} of {len(records)} records"
            f"{': ' if sticky else ''}{', '.join(sticky[:_NAMED])}"
            f"{' and others' if len(sticky) > _NAMED else ''}."
        )
        # beside the conclusions, on request
        if why or not concluded:
            lines += [f"Columns: {', '.join(methods)}.", f"{_LEGEND} {_IN_DATA}"] + _matrix_lines(
                records
            )
        else:
            lines.append(f"What each method says: --why, or --csv FILE. {_IN_DATA}")

    # the reason of each method
    if why:
        for name, verdicts, record in records:
            shared = set(notes_of(verdicts, record))
            if name is None:
                where = ""
            else:
                where = f"{name}: "
            lines += [""] + [
                f"{where}{v.method}: {VERDICT_WORDS[v.verdict]}. {own_reason(v, shared)}."
                for v in verdicts
            ]
    return "\n".join(lines).rstrip()


def to_frame(verdicts: Iterable[tuple[str | None, Verdict]]) -> pd.DataFrame:
    """Return one row per verdict, intervals and indices as columns of their own."""
    import pandas as pd

    # Ends of the sizes, and the answer beside them
    rows = []
    for name, v in verdicts:
        if name is None:
            named = {}
        else:
            named = {"record": name}
        S_lo, S_hi = level_ends(v.S)
        J_lo, J_hi = level_ends(v.J)
        levels = {"S_lo": S_lo, "S_hi": S_hi, "J_lo": J_lo, "J_hi": J_hi, "S_unit": v.S_unit}
        answer = {"method": v.method, "verdict": v.verdict, "score": v.score}
        rows.append(
            {
                **named,
                **answer,
                **levels,
                "applicable": v.applicable,
                "reason": v.reason,
                **v.indices,
            }
        )
    return pd.DataFrame(rows)


def level(value: Level) -> str:
    """Write a stick band or slip jump: a number, an interval, or that the record does not fix
    it.
    """
    if value is None:
        return "not identifiable"
    if isinstance(value, (int, float)):
        return f"{value:.3g}"
    return "{:.3g} to {:.3g}".format(*value)


def opening(name: str | None, record: LoopRecord, concluded: Iterable[str] = ()) -> str:
    """Return the first lines about a single record: what was read, and what was concluded of it."""
    known = ", ".join(k for k in (record.kind, record.process) if k)
    tag = name or record.tag or "record"
    read = (
        f"{tag}: {record.n} samples, Ts = {record.Ts:g} s, {record.duration:g}"
        f" s{', ' + known if known else ''}"
    )
    return "\n".join([read, *concluded])


def _verdict_lines(verdicts: Sequence[Verdict]) -> list[str]:
    """Return one line per method: verdict, score, S and J where one gives them, and whether it
    applies where that is known of any.
    """
    # columns that say something
    units = " / ".join(
        dict.fromkeys(v.S_unit for v in verdicts if v.S is not None or v.J is not None)
    )
    if units:
        sizes = [f"S ({units})", "J"]
    else:
        sizes = []

    # of a loop of unknown kind a note says so once
    if any(v.applicable is not None for v in verdicts):
        applies = ["applicable"]
    else:
        applies = []

    # a line per method
    lines = [(["method", "verdict", "score"] + sizes + applies)]
    for v in verdicts:
        if _is_at_rest(v):
            word = _NOT_ASKED
        else:
            word = VERDICT_WORDS[v.verdict]
        if np.isfinite(v.score):
            score = f"{v.score:.3f}"
        else:
            score = ""
        if v.S is None:
            levels = ["", ""]
        else:
            levels = [level(v.S), level(v.J)]
        fits = [FITS[v.applicable]]
        lines.append([v.method, word, score] + levels[: len(sizes)] + fits[: len(applies)])
    return columns(lines, right=("score", *sizes))


def _matrix_lines(
    groups: Sequence[tuple[str | None, list[Verdict], LoopRecord | None]],
) -> list[str]:
    """Return one line per record, with a sign for each method, which has a number in the head."""
    numbers = [str(i) for i in range(1, len(groups[0][1]) + 1)]
    lines = [("record", numbers)]
    for name, verdicts, _ in groups:
        signs = [" " if v.applicable is False else _SIGNS[v.verdict] for v in verdicts]
        lines.append((str(name), signs))
    wide = len(numbers[-1])
    return columns([(name, " ".join(sign.rjust(wide) for sign in signs)) for name, signs in lines])


def _not_counted(verdicts: Iterable[Verdict]) -> list[str]:
    tests = []
    for v in verdicts:
        if _is_test(v.method):
            tests.append(v.method)
    said = "nonlinearity tests, not counted for or against stiction"
    if tests:
        return [f"{said}: {', '.join(tests)}"]
    return []


def _is_at_rest(verdict: Verdict) -> bool:
    """Whether the front end answered for a method: the loop does not oscillate."""
    return verdict.reason.startswith(NOT_OSCILLATING)


def _is_test(method: str) -> bool:
    """Whether a method tests for nonlinearity, which is not stiction yet."""
    return method in registry.names() and registry.load(method).METHOD.role == "nonlinearity"


def _split_clauses(reason: str) -> list[str]:
    return reason.split("; ")


def level_ends(value: Level) -> tuple[float, float]:
    """Return both ends of a stick band or slip jump, twice the same of a number, NaN where the
    record does not fix it.
    """
    if value is None:
        return np.nan, np.nan
    if isinstance(value, (int, float)):
        return (value, value)
    return value
