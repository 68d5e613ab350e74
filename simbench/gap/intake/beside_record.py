"""Test records beside the record they were made for: what the fits need of them, and what in them contradicts it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from detectors.errors import RecordError
from detectors.signal.spikes import cleaned
from simbench.gap.controller.pi_law import Law, examine_law
from simbench.gap.intake.check import check
from simbench.gap.intake.observed import longest_run
from simbench.gap.intake.recorded_test import RecordedTest
from simbench.gap.intake.refuse import SAME_TS, refuse_mv_units
from simbench.gap.sensor.samples import inspect_samples
from simbench.gap.situation import ModelledTest, Situation, through_valve

_RETUNED = 0.13  # |ln ratio| of Kc or Ti from which a test's tuning is not the one it states
_LAW_ROWS = 60  # samples in automatic from which a controller can be compared
_MOVING = 0.8  # share of samples in automatic in which OP moves, from which standstill and motion tell the mode
_EDGE = 2  # samples at a change of mode that may be written down on either side of it


def modelled(test: RecordedTest, s: Situation) -> ModelledTest:
    """Return what the fits need of a test."""
    r, op = test.record, np.asarray(test.record.op_percent)
    if r.mv is not None:
        refuse_mv_units(np.asarray(r.mv), op, test.path)
    pace = s.record.Ts / r.Ts
    plain = not test.manual.any() and abs(pace - 1.0) <= SAME_TS
    law, proven = None, {}
    if plain:
        own = check(replace(r, tag=test.name, meta={}), test.loop, s.trusted, s.tuned)
        law, data = own.law, own.data
        proven = {e: p for e, p in own.proven.items() if e not in ("detuning", "noise")}
    else:
        samples = inspect_samples(r.pv, op, noise=s.data.noise)
        pv = cleaned(np.asarray(r.pv, dtype=float), samples.spikes)
        u = through_valve(op, s.baseline.valve, r.Ts) if r.mv is None else np.asarray(r.mv, dtype=float)
        data = replace(s.data, u=np.ascontiguousarray(u), y=np.ascontiguousarray(pv), resolution=samples.digits)
        rows = longest_run(~test.manual)
        if abs(pace - 1.0) <= SAME_TS and rows.stop - rows.start >= _LAW_ROWS:
            law = _law(test, rows, s)
    return ModelledTest(
        test.name, r.Ts, 1.0 if plain else pace, data, op, None if r.mv is None else np.asarray(r.mv, dtype=float),
        test.lab, float(test.settings.get("test", {}).get("lab_std", 0.0)), law, proven,
    )  # fmt: skip


def _law(test: RecordedTest, rows: slice, s: Situation) -> Law | None:
    r, control = test.record, test.loop.controller
    sp = None if r.sp is None else np.asarray(r.sp)[rows]
    op, pv = np.asarray(r.op_percent)[rows], np.asarray(r.pv)[rows]
    if np.ptp(op) == 0.0:
        return None
    return examine_law(op, pv, sp, r.Ts, control.sign * control.Kc, control.Ti, s.tuned, s.data.noise)


def contradiction(test: RecordedTest, found: ModelledTest, s: Situation) -> str:
    """Return why a test cannot be of the record's loop as it was declared; "" where nothing speaks against it."""
    said = _shifted(test, found.law.late if found.law is not None else s.law.late)
    law = found.law
    if said or law is None or not (s.tuned and s.law.known and law.known):
        return said
    control, stated = s.baseline.controller, test.loop.controller
    Kc = s.law.Kc * stated.Kc / control.Kc
    Ti = s.law.Ti * (stated.Ti / control.Ti if stated.Ti and control.Ti else 1.0)
    off = [np.log(abs(law.Kc / Kc))]
    off += [np.log(law.Ti / Ti)] if np.isfinite(law.Ti) and np.isfinite(Ti) else []
    if law.Kc * Kc > 0 and max(map(abs, off)) < _RETUNED:
        return ""
    return (
        f"its controller has Kc = {law.Kc:.3g} and Ti = {law.Ti:.3g} s, the record's under the stated settings "
        f"Kc = {Kc:.3g} and Ti = {Ti:.3g} s; the tuning is not the one stated, or the loop behind {test.name} is another"
    )


def _shifted(test: RecordedTest, late: int) -> str:
    """Return whether OP moves like a controller's where `mode` says MAN, or rests like an operator's where it says AUTO."""
    manual, op = test.manual, np.asarray(test.record.op)
    if not manual.any() or manual.all():
        return ""
    moves = np.append(False, np.abs(np.diff(op)) > 1e-9 * float(np.abs(op).max()))
    auto = ~manual
    edge = _EDGE + late
    starts, ends = (np.flatnonzero(np.diff(manual.astype(int)) == way) + 1 for way in (1, -1))
    said = f"the mode column of {test.name} does not fit its OP, which"
    # more than half of what is called automatic may be the operator's
    if np.mean(moves[longest_run(auto)]) > 0.5 * _MOVING:
        for k in starts:
            if _length(moves[k:][manual[k:].cumprod().astype(bool)]) > edge:
                return f"{said} still moves like a controller's in the first samples that are called MAN"
        for k in ends:
            if _length(moves[:k][::-1][manual[:k][::-1].cumprod().astype(bool)]) > edge:
                return f"{said} moves like a controller's in the last samples that are called MAN"
    for k in starts:
        rest = ~moves[:k][::-1][auto[:k][::-1].cumprod().astype(bool)]
        if _length(rest) > edge and np.mean(~rest[_length(rest) :]) > _MOVING:
            return f"{said} stands still in the last samples that are called AUTO"
    for k in ends:
        rest = ~moves[k:][auto[k:].cumprod().astype(bool)]
        if _length(rest) > edge and np.mean(~rest[_length(rest) :]) > _MOVING:
            return f"{said} stands still in the first samples that are called AUTO"
    return ""


def _length(x: np.ndarray) -> int:
    """Return how many samples are true before the first that is not."""
    return int(x.cumprod().sum())


def refuse_twice(tests: list[RecordedTest]) -> None:
    """Refuse one file given twice: its evidence would count twice."""
    paths = [t.path for t in tests]
    twice = next((p for p in paths if paths.count(p) > 1), None)
    if twice is not None:
        raise RecordError(f"{twice}: given as a test twice; each counts once")
