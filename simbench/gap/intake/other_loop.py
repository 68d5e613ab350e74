"""Detect a baseline that belongs to another loop: neither its controller nor its plant agrees with
the record.
"""

from __future__ import annotations

import numpy as np

from simbench.detectors.errors import RecordError
from simbench.gap.candidates import fit_candidates, possible_effects
from simbench.gap.controller.law import EXACT, Law
from simbench.gap.effects import is_friction
from simbench.gap.intake.identify import fit_plant
from simbench.gap.likelihood.engine import Engine
from simbench.gap.likelihood.model import size_penalty
from simbench.gap.situation import Situation
from simbench.gap.thresholds import OTHER_LOOP, PLANT_APART
from simbench.loop.effects import block_of

_OTHER_TUNING = 10.0  # factor in Kc from which the baseline is another loop's, whatever the plant


def refuse_other_controller(law: Law, Kc: float, where: str) -> None:
    """Refuse a baseline whose controller acts the other way, or ten times as much."""
    if law.known and law.residual < EXACT and law.gap == 0.0:
        ratio = law.Kc / Kc
        if ratio < 1.0 / _OTHER_TUNING or ratio > _OTHER_TUNING:
            raise RecordError(
                f"{where}: its controller has Kc = {law.Kc:.3g}, the baseline's Kc = {Kc:.3g}"
                " (signs included); this is the baseline of another loop"
            )


def refuse_other_plant(s: Situation) -> None:
    """Refuse a baseline that neither the controller nor the plant of the record agrees with.

    Other tuning is an effect, and so is another gain, or other friction. Where the tuning is
    another one, another plant, in gain and in time, must explain PV better than every single effect
    on the baseline's plant before the loop is called another.
    """
    data = s.data
    law = s.law
    Ts = s.record.Ts
    control = s.baseline.controller
    if (
        law.tuning is None
        or not _is_another(law.tuning[0])
        or (control.Ti and not _is_another(law.tuning[1]))
    ):
        return
    free, other = fit_plant(data.u, data.y, False, data.resolution, float(np.sign(law.Kc)))
    if other.K * law.Kc <= 0.0:
        return
    gain = other.K
    lag = other.theta["T"]
    wait = other.theta["Td"]
    pace = lag + wait
    known = data.T + data.Td
    if data.T > 0 and not (_is_another(gain / data.K) and _is_another(pace / known)):
        return

    # an integrating plant has a slope and a dead time; one that settles late in the record may well
    # be one
    if data.T == 0 and not (
        lag < data.n / 30
        and (_is_another(gain / lag / data.K) or _is_another((wait + 1.0) / (data.Td + 1.0)))
    ):
        return
    to_beat = max(other.loglik, free.base().loglik) - size_penalty(data.n, 3.0) - OTHER_LOOP
    engine = Engine(data, 4.0 * (known + 1.0))
    base = engine.base()
    if base.loglik >= to_beat:
        return

    # one effect that does nearly as well is enough, and most are cheap
    for effect in (e for e in possible_effects(s) if _bends_plant(e)):
        if (
            base.loglik + fit_candidates(engine, base, [effect])[effect].log_likelihood_gain
            >= to_beat
        ):
            return
    raise RecordError(
        f"{s.where}: its controller has Kc = {law.Kc:.3g} and Ti = {law.Ti:.3g} s, and PV answers"
        f" OP with a gain of {gain:.3g} after {pace * Ts:.3g} s, the baseline's Kc ="
        f" {control.sign * control.Kc:.3g}, Ti = {control.Ti or np.inf:.3g} s, K = {data.K:.3g} and"
        f" {known * Ts:.3g} s; this is the baseline of another loop"
    )


def _bends_plant(effect: str) -> bool:
    """Return whether PV answers OP as another plant would."""
    return is_friction(effect) or block_of(effect) == "process"


def _is_another(ratio: float) -> bool:
    return not 1.0 / PLANT_APART < ratio < PLANT_APART
