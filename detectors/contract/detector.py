"""Test a detector against its contract: its description, and its behaviour on plain, rescaled and
dead records.

Six plain records for every process type the method is made for, judged as
`simbench.detectors.judge` does; the verdict must not follow the unit of PV, of OP or of time, nor
the sign of both, nor how densely a record is sampled, nor, where the method claims it, the
direction of time, nor change the second time, nor follow what was asked before, nor a noise of
1e-6. Wrong answers on plain records are remarks, no breach. A detector asked directly about a dead
record answers, or refuses in one sentence (`UserError`). NaN reaches it only as the period of a
record that has none: a `LoopRecord` holds no other. Not a benchmark: a detector that keeps the
contract may still be wrong everywhere else.
"""

from __future__ import annotations

import inspect
import json
import math
from collections.abc import Iterator
from dataclasses import replace
from types import ModuleType, SimpleNamespace
from typing import Any

import numpy as np

from simbench.detectors.contract.engine import ContractRules, Fault
from simbench.detectors.contract.watch import Guarded, call_guarded
from simbench.detectors.example_loop import CASES, example_record
from simbench.detectors.judge import judge_one
from simbench.detectors.method import Method, Threshold
from simbench.detectors.plugins.registry import methods
from simbench.detectors.prepared import Prepared, prepare, thin_record
from simbench.detectors.record import PROCESSES, LoopRecord
from simbench.detectors.signal.oscillation import Oscillation
from simbench.detectors.verdict import NO_DECISION, STICTION, Verdict, wrong_types

_ROLES = ("stiction", "nonlinearity", "quantification")
_BUDGETS = ("fast", "full")
# PV in another unit, and OP with its span in another
_UNITS = ((0.02, -7.0), (-30.0, 2000.0))
_OP_UNITS = ((0.16, 4.0), (40.0, -300.0))
_FAINT = 1e-6  # of a signal's range: no verdict of any record may hang on this
_LEVELS = (0.0, 7.0)  # of the set point, for records that are asked about in another order
THINNED = (2, 4, 8)  # samples of a dense record to one
_DEAD = ("constant", "short", "no period")


def _description(name: str, module: ModuleType) -> Iterator[str]:
    method = module.METHOD
    if not isinstance(method, Method):
        yield f"METHOD is a {type(method).__name__}, a simbench.detectors.method.Method is needed"
        return
    if not (module.__doc__ or "").strip():
        yield "the file does not begin with a sentence on what the detector looks for"
    for word in ("title", "source"):
        if not str(getattr(method, word)).strip():
            yield f"METHOD.{word} is empty"
    for words, allowed, of in (
        (method.process, PROCESSES, "process"),
        ((method.role,), _ROLES, "role"),
        ((method.budget,), _BUDGETS, "budget"),
        (method.exempt, CASES, "exempt"),
    ):
        if (
            isinstance(words, str)
            or any(w not in allowed for w in words)
            or (of == "process" and not words)
        ):
            yield f"METHOD.{of} = {words!r}, allowed: {', '.join(allowed)}"
    for case, reason in method.exempt.items():
        if len(reason) <= 20:
            yield f"METHOD.exempt: {case!r} is left out without a reason"
    parameters = list(inspect.signature(module.detect).parameters.values())
    keywords = [p.name for p in parameters if p.kind is p.KEYWORD_ONLY]
    if len(parameters) - len(keywords) != 1 or sorted(keywords) != sorted(method.thresholds):
        yield (
            f"detect{inspect.signature(module.detect)} must take the prepared record and, by"
            f" keyword, the thresholds of METHOD: {', '.join(sorted(method.thresholds)) or 'none'}"
        )


def _thresholds(name: str, module: ModuleType) -> Iterator[str]:
    for key, rule in module.METHOD.thresholds.items():
        if not isinstance(rule, Threshold):
            yield (
                f"threshold {key} is a {type(rule).__name__}, a"
                " simbench.detectors.method.Threshold is needed"
            )
            continue
        if not rule.low <= rule.default <= rule.high:
            yield (
                f"threshold {key}: its default {rule.default} lies outside its range {rule.low} to"
                f" {rule.high}"
            )
        for word in ("unit", "source", "says"):
            if not str(getattr(rule, word)).strip():
                yield f"threshold {key}: {word} is empty"


def _cases(name: str, module: ModuleType, process: str) -> Iterator[str | Fault]:
    """Judge the six plain records, and the first of them once more at the end."""
    first = _judge_noting(name, module, example_record("stiction", process))
    for case in CASES:
        on = _on(case, process)
        judged = (
            first
            if case == "stiction"
            else _judge_noting(name, module, example_record(case, process))
        )
        yield from (Fault(fault, f"on {on}") for fault in judged.faults)
        exempt = case not in _DEAD or case in module.METHOD.exempt
        if not (judged.faults or exempt or judged.value.verdict == NO_DECISION):
            yield f"says {judged.value.verdict!r} on {on}, of which nothing can be said"
    again = _judge_noting(name, module, example_record("stiction", process))
    if _as_text(first) != _as_text(again):
        yield (
            f"is not deterministic: asked twice about one record ({process}), it gives two"
            f" answers{_difference(first, again)}"
        )


def _on(case: str, process: str) -> str:
    return f"the record {case!r} ({CASES[case]}; {process})"


def _quality(name: str, module: ModuleType) -> Iterator[str]:
    """Remark where a detector is wrong on plain records: a poor one keeps the contract, too."""
    for process in module.METHOD.process:
        best = math.inf
        for case in (c for c in CASES if c not in module.METHOD.exempt and c not in _DEAD):
            judged = _judge_noting(name, module, example_record(case, process))
            if judged.faults:
                continue
            on = _on(case, process)
            verdict = judged.value
            if case == "stiction":
                best = verdict.score
            wrong = (
                verdict.verdict != STICTION if case == "stiction" else (verdict.verdict == STICTION)
            )
            if wrong:
                yield f"quality: says {verdict.verdict!r} on {on}: {verdict.reason}"
            elif case != "stiction" and verdict.score >= best:
                yield (
                    f"quality: scores {verdict.score:.3g} on {on} and {best:.3g} where the valve"
                    " sticks; a larger score should mean stickier"
                )


def _order(name: str, module: ModuleType, process: str) -> Iterator[str]:
    """Ask about siblings at two set points, then in another order and twice running: a memory
    answers otherwise.
    """
    records = []
    for level in _LEVELS:
        for case in ("stiction", "healthy"):
            plain = example_record(case, process)
            records.append(replace(plain, pv=plain.pv + level, sp=np.full(plain.n, 50.0 + level)))
    first = [_as_text(_judge_noting(name, module, record)) for record in records]
    for k in (3, 3, 2, 1, 0, 0):
        if _as_text(_judge_noting(name, module, records[k])) != first[k]:
            yield (
                f"depends on what was asked before: the same record ({process}) gets another answer"
                " after another one"
            )
            return


def _faint_noise(name: str, module: ModuleType, process: str) -> Iterator[str]:
    rng = np.random.default_rng(0)
    for case in ("stiction", "healthy", "sine"):
        record = example_record(case, process)
        seen = {s: getattr(record, s) for s in ("op", "pv")}
        noisy = replace(
            record,
            **{s: x + _FAINT * np.ptp(x) * rng.standard_normal(x.size) for s, x in seen.items()},
        )
        asked, moved = (_word(_judge_noting(name, module, r)) for r in (record, noisy))
        if asked != moved:
            what = f"{asked!r} becomes {moved!r} on the record {case!r} ({process})"
            yield f"hangs on the last digits: {what} under a noise of 1e-6"


def turned(record: LoopRecord) -> LoopRecord:
    """Return the loop of a valve that closes under OP and a transmitter of the other sign: OP spans
    0..100.
    """
    flipped = {k: None if getattr(record, k) is None else sign - getattr(record, k)
               for k, sign in (("op", 100.0), ("mv", 100.0), ("pv", 0.0), ("sp", 0.0))}  # fmt: skip
    return replace(record, **flipped, pv_span=None)


def backwards(record: LoopRecord) -> LoopRecord:
    """Return the record with its last sample first."""
    return record.with_signals(lambda x: x[::-1])


def _moves(name: str, module: ModuleType, process: str) -> Iterator[str]:
    """Judge records with the sign, the time or the sampling changed; a dense one is the plain loop,
    eight times as often.
    """
    for case in ("stiction", "healthy", "sine"):
        record = replace(example_record(case, process), op_span=(0.0, 100.0))
        asked = _word(_judge_noting(name, module, record))
        others = {
            "the sign of OP and PV": turned(record),
            "the unit of time": replace(record, Ts=record.Ts / 3600.0),
        }
        if module.METHOD.reversible:
            others["the direction of time, which it claims not to"] = backwards(record)
        for what, other in others.items():
            moved = _word(_judge_noting(name, module, other))
            if moved != asked:
                yield (
                    f"follows {what}: {asked!r} becomes {moved!r} on the record {case!r}"
                    f" ({process})"
                )
    dense = example_record("dense", process)
    asked = _word(_judge_noting(name, module, dense))
    for step in THINNED:
        moved = _word(_judge_noting(name, module, thin_record(dense, step)))
        if moved != asked:
            yield (
                f"follows the sampling: {asked!r} becomes {moved!r} on a dense record ({process}),"
                f" of {step} samples one"
            )


def _units(name: str, module: ModuleType, process: str) -> Iterator[str]:
    for case in ("stiction", "healthy", "sine"):
        record = replace(example_record(case, process), op_span=(0.0, 100.0))
        if not (module.METHOD.needs_mv and process == "integrating"):
            record = replace(record, mv=None)  # MV is recorded in %, whatever the unit of OP
        asked = _word(_judge_noting(name, module, record))
        for a, b in _UNITS:
            moved = _word(_judge_noting(name, module, replace(record, pv=a * record.pv + b)))
            if moved != asked:
                yield (
                    f"follows PV's unit: {asked!r} becomes {moved!r} on the record {case!r}"
                    f" ({process}) with {a:g} PV + {b:g}"
                )
                break
        for a, b in _OP_UNITS if record.mv is None else ():
            moved = _word(
                _judge_noting(
                    name, module, replace(record, op=a * record.op + b, op_span=(b, 100.0 * a + b))
                )
            )
            if moved != asked:
                yield (
                    f"follows OP's unit: {asked!r} becomes {moved!r} on the record {case!r}"
                    f" ({process}) with {a:g} OP + {b:g}"
                )
                break


def _inputs(name: str, module: ModuleType, process: str) -> Iterator[str]:
    """Look for changes in what the detector was given, what it shares with the others included."""
    prepared = Prepared(replace(example_record("stiction", process)))
    for signal in ("op", "pv"):
        prepared.clean(signal)
        prepared.half_cycles(signal)
    held = {**{s: getattr(prepared.record, s) for s in ("op", "pv", "mv")}, **prepared.shared}
    before = {k: np.array(v, copy=True) for k, v in held.items() if isinstance(v, np.ndarray)}
    call_guarded(lambda: judge_one(name, module, prepared, True, module.METHOD.defaults()))
    for key, values in before.items():
        if not np.array_equal(held[key], values, equal_nan=True):
            yield f"writes into what it was given: {key!r} is another after detect ({process})"


def _dead(name: str, module: ModuleType, process: str) -> Iterator[Fault]:
    for case in _DEAD:
        prepared = Prepared(
            replace(example_record("noise" if case == "no period" else case, process))
        )
        if case == "no period":
            prepared.__dict__["oscillation"] = Oscillation(False, 0.0, math.nan)
        answer = call_guarded(lambda p=prepared: module.detect(p, **module.METHOD.defaults()))
        faults = answer.faults or ([] if answer.refusal else list(wrong_types(answer.value)))
        where = f"asked directly about a dead record ({case}, {process})"
        yield from (Fault(fault, where) for fault in faults)


def _judge_noting(name: str, module: ModuleType, record: LoopRecord) -> Guarded:
    """Judge a record as every run does, and note what the detector's own answer lacks."""
    answers: list[Any] = []

    def detect(prepared: Prepared, **thresholds: float) -> Any:
        answers.append(module.detect(prepared, **thresholds))
        return answers[0]

    seen = record if module.METHOD.needs_mv else record.without_mv()
    spied: Any = SimpleNamespace(METHOD=module.METHOD, detect=detect)
    judged = call_guarded(
        lambda: judge_one(name, spied, prepare(seen), False, module.METHOD.defaults())
    )
    if judged.refusal:
        judged.faults.append(f"refuses ({judged.refusal}) where an answer is due")
    if answers:
        wrong = list(wrong_types(answers[0]))
        # what `judge_one` made of the same wrong answer
        known = [f for f in judged.faults if not any(w in f for w in wrong)]
        judged.faults = wrong if not isinstance(answers[0], Verdict) else [*known, *wrong]
    return judged


def _word(judged: Guarded) -> str:
    return "an error" if judged.faults else judged.value.verdict


def _as_text(judged: Guarded) -> str:
    return repr(judged.faults) if judged.faults else json.dumps(judged.value.as_json())


def _difference(first: Guarded, second: Guarded) -> str:
    a, b = ({"answer": f.faults} if f.faults else f.value.as_json() for f in (first, second))
    key = next((k for k in a if a[k] != b.get(k)), "answer")
    return f", {key} {a.get(key)!r} and {b.get(key)!r}"


DETECTOR_RULES = ContractRules(
    "detector",
    methods,
    (_description, _thresholds),
    (_cases, _order, _faint_noise, _units, _moves, _inputs, _dead),
    cases=lambda module: module.METHOD.process,
    notes=_quality,
)
