"""Judge one record by one or several methods: check that the method applies, that the record is fit
and that it oscillates, then run the method.
"""

from __future__ import annotations

import sys
import threading
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager, nullcontext, redirect_stdout
from dataclasses import replace
from types import ModuleType
from typing import Any

import numpy as np

from simbench.detectors.errors import AnswerError, ParameterError, nearest, printable
from simbench.detectors.example_loop import example_record
from simbench.detectors.faults import JUDGING
from simbench.detectors.method import Method
from simbench.detectors.plugins.registry import methods as registry
from simbench.detectors.prepared import Prepared, prepare
from simbench.detectors.quality import resolution
from simbench.detectors.record import RECORDED_SIGNALS, LoopRecord
from simbench.detectors.verdict import (
    NO_DECISION,
    NO_STICTION,
    NOT_OSCILLATING,
    Level,
    Verdict,
    wrong_types,
)

# A record with one of these flags gives no information about its valve, whatever the method.
UNFIT = ("dead_op", "dead_pv", "manual", "saturated", "outside_span")
FEWEST = 100  # samples; below this the spread of every statistic swallows what is sought

_ASKS_OTHERS = "procedure"  # its S and J are already widened by the methods it asked
_HIDES = 0.5  # share of S that the archive may hide; above it no S is stated
_LONGEST = 300  # characters of an error's text
FAILED = "failed: "  # begins the reason of a method that gave no verdict


def judge(
    record: LoopRecord,
    methods: Iterable[str],
    *,
    raw: bool = False,
    thresholds: Mapping[str, Mapping[str, float]] | None = None,
) -> list[Verdict]:
    """Judge one record by several methods, sharing what they have in common.

    Examples
    --------
    >>> t = np.arange(600.0)
    >>> judge(LoopRecord(op=np.sin(t / 8), pv=-np.sin(t / 8), Ts=1.0), ["horch"])[0].verdict
    'no_stiction'
    """
    JUDGING["record"] = record.tag or "the record"
    blind = prepare(record.without_mv())
    sighted = replace(record, meta={})
    verdicts = []
    for name in methods:
        method = registry.load(name).METHOD
        prepared = blind.seen_by(
            method, sighted if method.needs_mv or method.takes_mv else sighted.without_mv()
        )
        chosen = check_thresholds(name, method, (thresholds or {}).get(name, {}))
        verdicts.append(answer_of(name, prepared, chosen, raw=raw)[0])
    return verdicts


def answer_of(
    name: str, prepared: Prepared, thresholds: dict[str, float], raw: bool = False
) -> tuple[Verdict, str | None]:
    """Ask one method about one record, and return the error, too, if it raised one; whatever it
    does, it costs no other method its answer.
    """
    try:
        verdict = _ask_method(name, prepared, thresholds, raw)
        error = None
    except (Exception, SystemExit) as wrong:  # a detector may fail in any way; the others must not
        error = printable(" ".join(f"{type(wrong).__name__}: {wrong}".split())[:_LONGEST])
        verdict = Verdict(name, NO_DECISION, reason=f"{FAILED}{error}")
    return verdict, error


def _ask_method(name: str, prepared: Prepared, thresholds: dict[str, float], raw: bool) -> Verdict:
    module = registry.load(name)
    JUDGING["detector"] = name
    try:
        with nullcontext() if registry.built_in(name) else _guard_record(prepared.record):
            return judge_one(name, module, prepared, raw, dict(thresholds))
    finally:
        # an interrupt leaves it there, and so names the detector
        if not isinstance(sys.exc_info()[1], KeyboardInterrupt):
            JUDGING.pop("detector", None)  # another thread may have been first


@contextmanager
def _guard_record(record: LoopRecord) -> Iterator[None]:
    """Let a plug-in write neither into the record, which other methods see, nor to stdout, which is
    the answer's.
    """
    signals = []
    for name in RECORDED_SIGNALS:
        signal = getattr(record, name)
        if signal is not None:
            signals.append(signal)
    writeable = [x.flags.writeable for x in signals]
    try:
        for x in signals:
            x.flags.writeable = False
        # the stream is the process's: of several threads the main one alone may change it
        alone = threading.current_thread() is threading.main_thread()
        with redirect_stdout(sys.stderr) if alone else nullcontext():
            yield
    finally:
        for x, before in zip(signals, writeable, strict=True):
            x.flags.writeable = before


def refuse_wrong_forms(names: Iterable[str]) -> None:
    """Ask each method that is not built in about one plain record; AnswerError where what it
    answers is no verdict.

    Once per plug-in. What else it does wrong there, the records will show.
    """
    # Only detectors of others are asked, each once a process
    known = set(registry.names())
    for name in dict.fromkeys(n.partition("@")[0] for n in names):
        if name not in known:
            continue
        module = registry.load(name)
        if registry.built_in(name) or vars(module).setdefault("form_is_right", False):
            continue

        # One plain record with a sticky valve; without MV where the method needs none
        record = example_record("stiction", module.METHOD.process[0])
        prepared = Prepared(record if module.METHOD.needs_mv else record.without_mv())
        JUDGING["record"] = "an example record"
        try:
            _ask_method(name, prepared, module.METHOD.defaults(), raw=True)
        except AnswerError as wrong:
            raise AnswerError(f"detector {name!r}: {wrong}") from None
        except (Exception, SystemExit):
            continue
        module.__dict__["form_is_right"] = True


def check_thresholds(name: str, method: Method, chosen: Mapping[str, float]) -> dict[str, float]:
    """Return the method's thresholds with the chosen ones in their place."""
    # Each chosen threshold is known, and within its bounds
    values = method.defaults()
    for key, value in chosen.items():
        if key not in values:
            raise ParameterError(
                f"method {name!r} has no threshold {key!r}: {nearest(key, values)}"
            )
        rule = method.thresholds[key]
        if not rule.low <= value <= rule.high:
            raise ParameterError(
                f"method {name!r}: {key} = {value} {rule.unit}; allowed: {rule.low} to {rule.high}"
            )
        values[key] = float(value)
    return values


def judge_one(
    name: str, module: ModuleType, prepared: Prepared, raw: bool, thresholds: dict[str, float]
) -> Verdict:
    """Judge a prepared record by one method, with everything that comes before the method
    itself.
    """
    method: Method = module.METHOD
    record = prepared.record

    def answer(verdict: str, reason: str, applicable: bool | None = True) -> Verdict:
        return Verdict(name, verdict, applicable=applicable, reason=reason)

    def finished(verdict: Verdict) -> Verdict:
        joined = applicable if verdict.applicable is True else verdict.applicable
        if name == _ASKS_OTHERS:
            limited = verdict
        else:
            limited = _as_archived(verdict, prepared)
        reason = "; ".join([limited.reason] + [n for n in notes if n not in limited.reason])
        return limited.but(method=name, applicable=joined, reason=reason, S_unit=record.S_unit)

    applicable: bool | None = True
    notes = []
    if record.op_span is None:
        notes.append(
            "OP taken as 0..100 %" if record.op_percent is not None else _unknown_unit(record)
        )
    if prepared.part is not None:
        notes.append(
            f"judged on samples {prepared.part[0]} to {prepared.part[1] - 1}, which oscillate"
        )
    if record.process is None:
        applicable = None
        notes.append("process type unknown, judged as self-regulating")
    elif record.process not in method.process:
        made_for = " and ".join(method.process)
        return finished(
            answer(
                NO_DECISION, f"made for {made_for} processes; this one is {record.process}", False
            )
        )
    if record.n * prepared.step < method.min_samples:
        reason = (
            f"too short: {record.n * prepared.step} samples; at least {method.min_samples} are"
            " needed"
        )
        return finished(answer(NO_DECISION, reason))
    for flag in (UNFIT + method.cannot_cope) if prepared.flags else ():
        if flag in prepared.flags:
            return finished(
                answer(NO_DECISION, f"record unfit: {prepared.flags[flag].evidence} (flag {flag})")
            )
    if method.needs_mv:
        signal, fits, note = prepared.valve_position()
        if signal is None:
            return finished(answer(NO_DECISION, note, False))
        if fits is None:
            applicable = None
            notes.append(note)

    # the procedure asks the same methods about the same record
    key = ("verdict", name, record.mv is None, *thresholds.items())
    stopped = _front_end(method, prepared, raw, answer)
    verdict = stopped or prepared.share(
        key, lambda: _check_answer(name, module.detect(prepared, **thresholds))
    )
    if method.front_end:
        oscillation = prepared.oscillation
        common = {"regularity": oscillation.regularity, "period_s": oscillation.period_s}
        verdict = verdict.but(indices={**verdict.indices, **common})
    return finished(verdict)


def _check_answer(name: str, answer: Any) -> Verdict:
    """Return a detector's answer where it is a verdict; AnswerError for another type, ValueError
    for wrong contents.
    """
    if not isinstance(answer, Verdict):
        form = f'return Verdict("{name}", "stiction", score=0.7, reason="why")'
        raise AnswerError(
            f"answers {answer!r:.60}; a simbench.detectors.verdict.Verdict is needed, for example:"
            f" {form}"
        )
    for wrong in wrong_types(answer):
        raise ValueError(wrong)
    return answer


def _as_archived(verdict: Verdict, prepared: Prepared) -> Verdict:
    """Return a verdict whose S and J are as wide as the archive leaves them, or not stated where it
    hides them.
    """
    # What the archive hides of OP and PV; nothing where it hides nothing
    if verdict.S is None and verdict.J is None:
        return verdict
    record = prepared.record
    op, pv = prepared.share("resolution", lambda: resolution(record, prepared.flags))
    if record.op_percent is None or record.op_span is None:
        percent = 1.0
    else:
        percent = 100.0 / (record.op_span[1] - record.op_span[0])
    lines = "compressed" in prepared.flags and isinstance(verdict.S, (int, float))
    if op == 0.0 and pv == 0.0 and not lines:
        return verdict

    # Straight lines of an archive leave no size; rounding widens each size by its band
    changes: dict[str, Level] = {}
    hidden = (
        "an archive drew straight lines between the values it kept: no size is stated"
        if lines
        else ""
    )
    for key in ("S", "J"):
        value = getattr(verdict, key)
        if value is None:
            continue
        if isinstance(value, (int, float)):
            lo = value
            hi = value
        else:
            lo, hi = value
        band = op * percent + pv * hi
        hides = key == "S" and band > _HIDES * hi
        if hides:
            changes[key] = None
        else:
            changes[key] = (max(float(lo - band), 0.0), float(hi + band))
        if hides:
            hidden = (
                f"the archive keeps OP to {op:.2g} and PV to {pv:.0%} of its range, which hides"
                f" {key}"
            )

    # One size that is hidden hides the other: both come from one fit
    if hidden:
        changes = {"S": None, "J": None}
    return verdict.but(
        **changes, reason=f"{verdict.reason}; {hidden}" if hidden else verdict.reason
    )


def _unknown_unit(record: LoopRecord) -> str:
    if record.op_share:
        return (
            "OP lies within 0..1, a share or %: give op_span (--op-span 0 1 or --op-span 0 100), S"
            " and J in OP units"
        )
    return "unit of OP unknown, S and J in OP units"


def _front_end(method: Method, prepared: Prepared, raw: bool, answer) -> Verdict | None:
    if not method.front_end:
        return None
    oscillation = prepared.oscillation
    if not raw and not oscillation.sustained:
        verdict = answer(NO_STICTION, f"{NOT_OSCILLATING} ({oscillation.evidence})")
        # below every score: scales differ between methods, some go below 0
        return verdict.but(score=-np.inf)
    if np.isfinite(oscillation.period_s):
        periods = prepared.record.duration / oscillation.period_s
    else:
        periods = 0.0
    if periods < method.min_periods:
        if raw and not np.isfinite(oscillation.period_s):
            return answer(NO_DECISION, "no period found in OP or PV")
        return answer(
            NO_DECISION,
            f"too short: {periods:.1f} periods; at least {method.min_periods:g} are needed",
        )
    return None
