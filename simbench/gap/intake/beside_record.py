"""Combine the records of additional tests with the record that they belong to, and refuse
contradictions.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from simbench.detectors.errors import RecordError
from simbench.detectors.signal.holds import runs_of
from simbench.detectors.signal.spikes import cleaned
from simbench.gap.controller.pi_law import find_retuning
from simbench.gap.intake.check import check
from simbench.gap.intake.observed import before_sensor, law_in_automatic, moving
from simbench.gap.intake.recorded_test import SAME_TS, RecordedTest
from simbench.gap.intake.refuse import refuse_mv_units
from simbench.gap.sensor.samples import inspect_samples
from simbench.gap.situation import ModelledTest, Situation, through_valve
from simbench.loop.effects import block_of

_BRISK = 20  # samples at an end of a manual run ...
_OFTEN = 5  # ... and moves of OP among them, from which no operator made them
_ELSEWHERE = 10.0  # ranges of the record's PV, beyond which PV is another signal
_EDGE = 1  # samples at a change of mode that may be written down on either side of it


def model_test(test: RecordedTest, s: Situation) -> ModelledTest:
    """Return the settings and signals of a test that the fits need."""
    r = test.record
    op = test.record.op_percent
    if r.mv is not None:
        refuse_mv_units(r.mv, op, test.path)
    pace = s.record.Ts / r.Ts
    plain = not test.manual.any() and abs(pace - 1.0) <= SAME_TS
    law = None
    proven = {}
    unexplained = ""
    if plain:
        situation = check(replace(r, tag=test.name, meta={}), test.loop, s.trusted, s.tuned)
        law = situation.law
        data = situation.data
        unexplained = situation.unexplained_law
        # a short test may not show that the archive repeats PV by exception, as the record has, and
        # three wild readings of it are chance where single samples of the record show nothing
        other = {"detuning", "noise", *(["frozen_sensor"] if s.samples.band > 0.0 else [])}
        other |= {e for e in situation.proven if s.archive.faithful and block_of(e) == "sensor"}
        proven = {e: p for e, p in situation.proven.items() if e not in other}
    else:
        samples = inspect_samples(r.pv, op, noise=s.noise)
        pv = cleaned(r.pv, samples.spikes)
        u = through_valve(op, s.baseline, r.Ts) if r.mv is None else r.mv
        y, resolution = before_sensor(s.baseline, r.Ts, pv, samples.hidden)
        data = replace(s.data, u=np.ascontiguousarray(u), y=y, resolution=resolution)
        if abs(pace - 1.0) <= SAME_TS or test.id == "raw":
            law = law_in_automatic(r, op, ~test.manual, test.loop, s.tuned, s.noise)
    return ModelledTest(
        test.name,
        r.Ts,
        1.0 if plain else pace,
        data,
        op,
        r.mv,
        test.lab,
        float(test.settings.get("test", {}).get("lab_std", 0.0)),
        law,
        proven,
        any(x is not None and x.size and np.ptp(x) > 0.0 for x in (r.sp, op[test.manual])),
        law is not None and law.known and not unexplained,
    )


def contradiction(test: RecordedTest, fitted: ModelledTest, s: Situation) -> str:
    """Return why a test cannot belong to the record's loop as it was declared; "" if nothing
    contradicts it.
    """
    law = fitted.law
    contrary = _misfit_of_mode(test, s.op, (law or s.law).late) or _misfit_of_pv(test, s)
    if contrary or law is None or not (s.tuned and s.law.known):
        return contrary
    if not law.known:
        # what lies between error and OP in a foreign controller need not show in every record
        why = (
            f"in automatic OP does not follow the record's controller ({law.reason}); the loop"
            f" behind {test.name} is another"
        )
        bare = (
            s.archive.faithful and s.law.step == 0.0 and s.law.gap == 0.0 and s.law.limits is None
        )
        return why if bare and not law.foreign else ""
    control = s.baseline.controller
    stated = test.loop.controller
    Kc = s.law.Kc * stated.Kc / control.Kc
    Ti = s.law.Ti * (stated.Ti / control.Ti if stated.Ti and control.Ti else 1.0)
    if find_retuning(law.Kc, law.Ti, Kc, Ti) is None:
        return ""
    return (
        f"its controller has Kc = {law.Kc:.3g} and Ti = {law.Ti:.3g} s, the record's under the"
        f" stated settings Kc = {Kc:.3g} and Ti = {Ti:.3g} s; the tuning is not the one stated, or"
        f" the loop behind {test.name} is another"
    )


def _misfit_of_pv(test: RecordedTest, s: Situation) -> str:
    """Return why PV, far from the record's, must be another signal; "" where it need not be."""
    pv = test.record.pv
    recorded = s.record.pv
    far = _ELSEWHERE * float(np.ptp(recorded))
    if pv.max() > recorded.min() - far and pv.min() < recorded.max() + far:
        return ""
    return (
        f"PV runs from {pv.min():.4g} to {pv.max():.4g}, the record's from {recorded.min():.4g} to"
        f" {recorded.max():.4g}; the loop behind {test.name} is another"
    )


def _misfit_of_mode(test: RecordedTest, usual: np.ndarray, late: int) -> str:
    """Return where OP moves like a controller's although `mode` is MAN, or rests although it is
    AUTO; "" where it does neither.

    `usual` is OP of the record, in automatic: how often it moves there, and how long it rests at
    most.
    """
    manual = test.manual
    if not manual.any():
        return ""
    moves = moving(test.record.op)
    edge = _EDGE + late
    rests = max([edge, *(1.5 * (b - a) for a, b in runs_of(~moving(usual)[1:]))])
    misfit = f"the mode column of {test.name} does not fit its OP, which"
    for a, b in runs_of(manual):
        # where an operator took over OP may jump to his first level
        for place, side in (("first", moves[a + 1 : b]), ("last", moves[a:b][::-1])):
            if side.cumprod().sum() > edge or side[:_BRISK].sum() >= _OFTEN + late:
                return (
                    f"{misfit} still moves like a controller's in the {place} samples that are"
                    " called MAN"
                )
    for a, b in runs_of(~manual):
        first = ~moves[a + 1 : b]
        last = ~moves[a:b][::-1]
        for place, side, changed in (("first", first, a > 0), ("last", last, b < manual.size)):
            if changed and side.cumprod().sum() > rests:
                return f"{misfit} stands still in the {place} samples that are called AUTO"
    return ""


def refuse_twice(tests: list[RecordedTest]) -> None:
    """Refuse a file that is given twice, because its evidence would count twice."""
    paths = [t.path for t in tests]
    for path in paths:
        if paths.count(path) > 1:
            raise RecordError(f"{path}: given as a test twice; each counts once")
