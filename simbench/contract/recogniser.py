"""Test a recogniser (the fit of one effect) against its contract: it never fits worse than without
the effect, and its parameters stay in their ranges.
"""

from collections.abc import Iterator
from functools import cache, partial
from typing import Any

from simbench.detectors.contract.detector import Contract
from simbench.detectors.contract.watch import call_guarded
from simbench.detectors.errors import UserError
from simbench.gap.effects import PLUGINS, Recogniser
from simbench.gap.intake.check import check
from simbench.gap.likelihood.engine import Engine
from simbench.gap.likelihood.model import Fit
from simbench.gap.situation import Situation, load_memory
from simbench.loop.effects import PLUGINS as EFFECTS
from simbench.loop.parameters import resolve
from simbench.loop.simulate import simulate
from simbench.scenarios.spec import Loop

_RECOGNISER_LOOP: dict[str, Any] = {
    "plant": {"type": "foptd", "K": 1.2, "T": 20.0, "Td": 4.0},
    "controller": {"type": "PI", "Kc": 1.0, "Ti": 20.0},
    "sampling": {"Ts": 1.0, "n": 300},
    "noise": {"std": 0.1},
    "setpoint": {"value": 50.0, "steps": [[60, 53], [150, 48]]},
}
_WORSE = 0.1  # nats by which a search may miss the fit it began from


def check_recogniser(name: str) -> Contract:
    """Check how an effect is recognised against its contract, on a short record without any
    effect.
    """
    r = PLUGINS.load(name).RECOGNISER
    if not isinstance(r, Recogniser):
        return Contract(
            "recogniser",
            name,
            (f"RECOGNISER is a {type(r).__name__}, a simbench.gap.effects.Recogniser is needed",),
        )
    notes = (
        ()
        if name in EFFECTS.names()
        else (f"no effect {name!r} is known, so its numbers were held against no range",)
    )
    return Contract("recogniser", name, tuple(_faults(name, r)), notes)


@cache
def _compared() -> tuple[Situation, Engine, Fit]:
    """Return a short record with its baseline, and its fit without effect."""
    loop = Loop.from_table(_RECOGNISER_LOOP)
    situation = check(simulate(loop, seed=5).record.without_mv(), loop)
    engine = Engine(situation.data, load_memory(situation))
    return situation, engine, engine.base()


def _faults(name: str, r: Recogniser) -> Iterator[str]:
    situation, engine, base = _compared()
    if r.needs not in ("", "plant", "tuning"):
        yield f"needs = {r.needs!r}, allowed: '', 'plant', 'tuning'"
    if r.replaces not in ("", "K", "T", "Td"):
        yield f"replaces = {r.replaces!r}, allowed: '', 'K', 'T', 'Td'"
    proven = call_guarded(lambda: r.proven(situation))
    yield from proven.at("in proven")
    if not proven.faults and proven.value is not None:
        yield f"proves the effect ({proven.value}) in a record that has none"
    if r.fit is None:
        return
    fit, twice = (call_guarded(partial(r.fit, engine, base)) for _ in range(2))
    if fit.faults:
        yield from fit.at("in fit")
        return
    if not isinstance(fit.value, tuple) or len(fit.value) != 2 or not isinstance(fit.value[0], Fit):
        yield f"gives {fit.value!r} for a fit; (Fit, count of numbers it pays for) is needed"
        return
    best, count = fit.value
    if not count >= 0:
        yield f"pays for {count!r} numbers; 0 or more are needed"
    if best.loglik < base.loglik - _WORSE:
        yield (
            f"fits {base.loglik - best.loglik:.3g} nats worse than no effect at all; give the base"
            " itself back instead"
        )
    if twice.faults or twice.value[0].loglik != best.loglik:
        yield "is not deterministic: the same record is fitted in two ways"
    if best is not base:
        yield from _number_faults(name, r, best, situation)


def _number_faults(name: str, r: Recogniser, best: Fit, situation: Situation) -> Iterator[str]:
    numbers = call_guarded(lambda: r.numbers(best, situation))
    yield from numbers.at("in numbers")
    if numbers.faults:
        return
    if not isinstance(numbers.value, dict) or not numbers.value:
        yield (
            f"has a fit, but its numbers are {numbers.value!r}; the effect's parameters in the loop"
            " file's units are needed"
        )
    elif name in EFFECTS.names():
        try:
            resolve(EFFECTS.load(name).PARAMETERS, numbers.value, f"effect {name!r}")
        except UserError as error:
            yield f"gives numbers that the effect refuses: {error}"
