"""Simulate what would help a loop: valve repaired, controller retuned, dead-band compensated, valve
resized, or nothing changed.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import scipy

from simbench.detectors.errors import UserError
from simbench.detectors.record import LoopRecord
from simbench.gap.stiction.candidate_loops import CandidateLoops, with_friction
from simbench.gap.stiction.margins import margins
from simbench.gap.stiction.probability import CLAIMED_FROM, DENIED_BELOW
from simbench.loop.resolve import resolve_loop, undisturbed
from simbench.loop.response import stages_response
from simbench.loop.run import run_setup, signals_of
from simbench.loop.setup import plain_setup
from simbench.scenarios.spec import Loop, Part

LEAVE, REPAIR, RETUNE, P_ONLY, COMPENSATE, RESIZE = (
    "leave",
    "repair",
    "retune",
    "P-only",
    "dead-band compensation",
    "resize",
)
# of every action, each of another seed and loop: a further one lies between the least and the
# largest in .9
_RUNS = 20
_WARM_UP = 0.3  # of a run, before it counts
# standard deviations of the logarithms drawn, of two development draws of 70 sticky loops
_UNSURE = {"K": 0.12, "T": 0.25, "Td": 0.25, "S": 0.05, "load": 0.2}
_JUMP = 0.06  # standard deviation of J over S
# where OP spans less than so many S the valve has two positions: J lies anywhere in the band, K
# and load follow from the swing, and the load holds what friction of another jump does not
# explain
_TWO_POSITIONS, _BEYOND, _TOO_LARGE = 2.0, 0.15, 0.45
_LEFT = 0.2  # of the band that is no jump, that compensation leaves
_KICK = 1.0  # % of OP beyond S: a sticky loop started at rest may stay there
_STABLE, _TRIES = (
    1.15,
    5,
)  # gain margin that a draw keeps, and draws before the loop is taken as it was identified
_ALIKE = 3.0  # factor of their median variance within which the draws move as one loop
_SAME = 1e-9


@dataclass(frozen=True)
class Action:
    """One thing to do, and what PV's variance about its set point would be, as a share of today's,
    with its 90 % interval.
    """

    name: str
    what: str
    variance: float
    lo: float
    hi: float

    def sentence(self) -> str:
        """Return the action and what it would do."""
        return f"{self.what}: {self.effect()}"

    def effect(self) -> str:
        """Return the variance of PV after the action."""
        return (
            f"simulated PV variance then {self.variance:.0%} of today's ({self.lo:.0%} to"
            f" {self.hi:.0%})"
        )


def what_if(candidates: CandidateLoops, seed: int = 0) -> tuple[Action, ...]:
    """Return what the actions would do to the variance of PV, best first.

    Empty where the loop cannot be simulated, or where friction is neither claimed nor ruled out: an
    action on a loop whose valve nobody knows is no advice.
    """
    claimed = candidates.sticky is not None and candidates.probability > CLAIMED_FROM
    if not claimed and candidates.probability >= DENIED_BELOW:
        return ()
    base = candidates.sticky if claimed and candidates.sticky is not None else candidates.healthy[0]
    S, J = candidates.fitted if claimed and candidates.fitted is not None else (0.0, 0.0)
    lo, hi = np.quantile(candidates.record.op, (0.01, 0.99))
    hidden = not candidates.trusted and bool(hi - lo < _TWO_POSITIONS * S)
    load = _recorded_load(with_friction(base, S, min(J, S)), candidates.record) if S > 0 else None
    return compare(
        base, S, J, spread=0.3 if candidates.trusted else 1.0, hidden=hidden, seed=seed, load=load
    )


def compare(
    base: Loop, S: float, J: float, *, spread: float = 1.0, hidden: bool = False, seed: int = 0,
    settings: Mapping[str, float] | None = None, load: np.ndarray | None = None,
) -> tuple[Action, ...]:  # fmt: skip
    """Return the actions on one loop with a friction of S and J, best first.

    `spread` scales the uncertainty of the loop. `hidden`: J cannot be separated from the plant's
    gain. `settings` are those to retune to. `load` (PV units, at the output) replaces the loop's
    loads and noise; every run starts it at another sample.
    """
    rng = np.random.default_rng(seed)
    drawn = []
    for i in range(_RUNS):
        factors, jump = _factors(base, J / S if S > 0 else 0.0, spread * (i > 0), hidden, rng)
        drawn.append(
            (
                _varied(base, factors),
                S * factors["S"],
                jump * S * factors["S"],
                int(rng.integers(2**31)),
            )
        )
    settings = settings or retuned(base)
    variances: dict[str, list[float]] = {}
    for name in _offered(base, S, J):
        kicked = 0.0 if name == REPAIR else 1.0
        variances[name] = [
            _variance(_changed(name, loop, s, j, settings), kicked * s, i, load)
            for loop, s, j, i in drawn
        ]
    today = np.array(variances[LEAVE])
    # a draw that does not move as the others do is another loop's
    sound = np.abs(np.log(today / np.nanmedian(today))) < np.log(_ALIKE)
    if sound.sum() < 0.4 * _RUNS:
        return ()
    out = []
    for name, values in variances.items():
        ratio = np.array(values)[sound] / today[sound]
        ratio = np.where(np.isfinite(ratio), ratio, 99.0)
        lo, hi = ratio.min(), ratio.max()
        out.append(
            Action(
                name,
                _description(name, base, settings),
                float(np.median(ratio)),
                float(lo),
                float(hi),
            )
        )
    return tuple(sorted(out, key=lambda a: (round(a.variance, 2), a.name != LEAVE)))


def retuned(loop: Loop) -> dict[str, float]:
    """Return gain and integral time (s) of SIMC (Skogestad 2003), its closed-loop time constant
    twice the dead time.
    """
    plant, Ts = loop.plant, loop.sampling.Ts
    dead = plant.Td + 0.5 * Ts
    wanted = max(2.0 * dead, 2.0 * Ts)
    if plant.type == "integrating":
        return {"Kc": 1.0 / (abs(plant.K) * (wanted + dead)), "Ti": 4.0 * (wanted + dead)}
    T = float(plant.T or 0.0)
    return {"Kc": T / (abs(plant.K) * (wanted + dead)), "Ti": min(T, 4.0 * (wanted + dead))}


def _factors(
    base: Loop, jump: float, spread: float, hidden: bool, rng: np.random.Generator
) -> tuple[dict[str, float], float]:
    """Draw how far plant, load and friction may be from what was identified, and J over S; no loop
    that swings by itself.
    """
    for _ in range(_TRIES if spread else 0):
        tried = {
            name: float(np.exp(spread * std * rng.standard_normal()))
            for name, std in _UNSURE.items()
        }
        other = float(np.clip(jump + _JUMP * spread * rng.standard_normal(), 0.0, 1.0))
        if hidden:
            other = float(rng.random())
            gain = (jump + _BEYOND) / (other + _BEYOND)
            tried["K"] *= gain
            tried["load"] *= float(np.exp(-_TOO_LARGE * (1.0 + rng.standard_normal()))) / gain
        known = margins(_varied(base, tried))
        if known is None or known.gain > _STABLE:
            return tried, other
    return dict.fromkeys(_UNSURE, 1.0), min(jump, 1.0)


def _offered(base: Loop, S: float, J: float) -> list[str]:
    names = (
        [LEAVE, RETUNE]
        if base.controller.type in ("P", "PI") and base.plant.type in ("foptd", "integrating")
        else [LEAVE]
    )
    if S > 0:
        names += [REPAIR, P_ONLY, RESIZE] if len(names) > 1 else [REPAIR]
        names += [COMPENSATE] if J < 0.9 * S else []
    return names


def _changed(
    name: str, loop: Loop, S: float, J: float, settings: Mapping[str, float]
) -> Loop | None:
    """Return a loop after an action; None where the loop would be no loop."""
    table: dict[str, Any] = loop.to_table()
    if name == RETUNE:
        table["controller"] |= {"type": "PI", **settings}
    if name == P_ONLY:
        table["controller"] = {k: v for k, v in table["controller"].items() if k != "Ti"} | {
            "type": "P"
        }
    # the same flow of a valve half as large: half the gain of plant, twice that of controller
    if name == RESIZE:
        table["plant"] |= {"K": 0.5 * loop.plant.K}
        table["controller"] |= {"Kc": 2.0 * loop.controller.Kc}
    if name == REPAIR:
        S = J = 0.0
    if name == COMPENSATE:
        S = J + _LEFT * (S - J)
    try:
        return with_friction(Loop.from_table(table, "what if"), S, min(J, S))
    except UserError:
        return None


def _varied(loop: Loop, factors: dict[str, float]) -> Loop:
    """Return a loop whose plant and load are as different as the identified one may be."""
    table = loop.to_table()
    table["plant"] |= {
        k: table["plant"][k] * factors[k] for k in ("K", "T", "Td") if table["plant"].get(k)
    }
    table["disturbance"] = [
        part | {"amplitude": part["amplitude"] * factors["load"]} for part in table["disturbance"]
    ]
    return Loop.from_table(table, "what if")


def _recorded_load(loop: Loop, record: LoopRecord) -> np.ndarray | None:
    """Return PV without what OP did through valve and plant; None but for a first-order plant under
    P or PI.
    """
    if (
        loop.plant.type != "foptd"
        or loop.controller.type not in ("P", "PI")
        or loop.outer
        or record.n != loop.sampling.n
    ):
        return None
    mv = stages_response(tuple(undisturbed(loop).valves), record.op, float(record.op[0]))
    plant = plain_setup(loop.model_copy(update={"valve": Part(name="ideal"), "effect": ()}), 0)
    driven = signals_of(replace(plant, Kc=0.0, Ti=None, load_in=mv - mv.mean()))[1]
    # where the valve stood before the record nobody knows
    late = (record.pv - driven)[int(_WARM_UP * record.n) :]
    return np.resize(scipy.signal.detrend(late), record.n)


def _variance(loop: Loop | None, S: float, seed: int, load: np.ndarray | None) -> float:
    if loop is None:
        return float("nan")
    try:
        if load is None:
            setup = resolve_loop(loop, seed)
        else:
            none = np.zeros(load.size)
            setup = replace(
                undisturbed(loop), load_in=none, load_out=np.roll(load, seed), pv_add=none
            )
        record = run_setup(setup, kick=S + _KICK if S > 0 else 0.0).record
    except UserError:
        return float("nan")
    late = slice(int(_WARM_UP * record.n), None)
    sp = record.pv[late].mean() if record.sp is None else record.sp[late]
    return float(np.mean((record.pv[late] - sp) ** 2)) + _SAME


def _description(name: str, base: Loop, settings: Mapping[str, float]) -> str:
    return {
        LEAVE: "leave it",
        REPAIR: "repair the valve (packing, positioner, actuator)",
        RETUNE: f"retune to Kc = {settings['Kc']:.3g}, Ti = {settings['Ti']:.3g} s",
        P_ONLY: f"P-only with Kc = {base.controller.Kc:.3g}, where an offset is allowed",
        COMPENSATE: "compensate the dead band in the controller",
        RESIZE: "fit a valve of half the size, where OP has the range",
    }[name]
