"""Resolve a grid's rules: sampling, noise and loads of a cell follow from one noise-free run of its
sticky twin.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np

from simbench.bench.scenario.truth import (
    YES,
    least_swing,
    prepare_once,
    run_once,
    simulate_with_truth,
)
from simbench.detectors.errors import ParameterError
from simbench.detectors.signal.oscillation import oscillation_of
from simbench.loop import echo, plant
from simbench.loop.motion import motion
from simbench.loop.parameters import VALVES, valve_parameters
from simbench.loop.setup import plain_setup
from simbench.loop.simulate import simulate
from simbench.scenarios.cell import Draft, Echo, Scaled, overridden
from simbench.scenarios.expansion import Group
from simbench.scenarios.parts import Noise, Part, Sampling, SetPoint
from simbench.scenarios.spec import Loop, Scenario
from simbench.theory.cycle import cycle_start
from simbench.theory.sampled import phase_crossings, sampled_loop, ultimate_gain

_FIRST = 40  # samples per period of the run that measures the cycle
_PERIODS = 10  # its length
_PASSES = 3  # of a record's period and its sampling: a new sampling moves the period a little
_LONGEST_WARM_UP = 4.0  # over what is asked for in periods of the record
_SETTLED = 0.1  # two periods as near as this (in logarithm) are one
_SEEDS = 4  # with which a sibling's cycle is looked for: under noise it comes and goes
_DIGITS = 3  # of what a simulation gave; more of them would say nothing


@dataclass(frozen=True)
class Cycle:
    """How the sticky twin of a cell moves."""

    period: float  # of MV (s)
    pv_std: float  # of PV over the run but its first period (PV units)
    exists: bool  # False when no start set it going; then the other numbers are guesses


def significant(x: float, digits: int = _DIGITS) -> float:
    """Return a number that a simulation gave, rounded to a few digits."""
    return float(f"{x:.{digits}g}")


def resolve(group: Group) -> list[Scenario]:
    """Settle the rules of one group; an echo whose sibling does not cycle is left out."""
    return [scenario for scenario in settle(group) if scenario is not None]


def settle(group: Group) -> list[Scenario | None]:
    """Settle the rules of one group: a scenario for each draft, or None for an echo whose sibling
    does not cycle with the echo's seed.
    """
    # A group without rules is settled already
    if group.rules.empty:
        return [Scenario(loop=d.loop, seed=d.seed, tags=d.tags, asked=d.id) for d in group.drafts]

    # The sticky twin's cycle is what everything is measured in
    twin = group.twin
    cycle = measure_cycle(group.twin)
    if group.rules.w_Ti is not None:
        twin, cycle = _with_w_Ti(twin, cycle, float(group.rules.w_Ti))

    # One loop per draft, which its echoes share
    loops: dict[int, Loop] = {}
    found: list[Scenario | None] = []
    for draft in group.drafts:
        if draft.echo is None:
            own = draft
        else:
            own = draft.echo.of
        if id(own) not in loops:
            loops[id(own)] = _own_sampling(own, twin, cycle)
        loop = loops[id(own)]
        found.append(
            Scenario(loop=loop, seed=draft.seed, tags=_tags_of(draft, loop), asked=draft.id)
            if draft.echo is None
            else _make_echo(draft, draft.echo, loop, _measure_units(twin, cycle))
        )
    return found


def _measure_units(twin: Loop, cycle: Cycle) -> dict[str, float]:
    """Return what the parameters of a cell are measured in."""
    S, J = band(twin)
    return {"S": S, "J": J, "period": cycle.period, "pv": cycle.pv_std}


def _make_echo(
    draft: Draft, wanted: Echo, sibling: Loop, unit: Mapping[str, float]
) -> Scenario | None:
    """Return the healthy loop that moves as its sibling does; None where the sibling does not
    cycle, or with no seed but its own.
    """
    # A sibling that does not cycle has no echo
    if simulate_with_truth(sibling, wanted.of.seed)[1].answer != YES:
        return None

    # A load that repeats what the sibling's valve does
    if wanted.cut is None:
        cut = {}
    else:
        cut = {"cut": wanted.cut}
    own = {echo.VALVE: sibling.valve.name, **sibling.valve.parameters, "kind": wanted.kind, **cut}
    load = Part(name=echo.NAME, parameters=own)

    # The same loop with a sound valve
    table = _valve_of(draft, unit)
    loop = sibling.model_copy(
        update={
            "disturbance": sibling.disturbance + (load,),
            "valve": Part(name=table.pop("model"), parameters=table),
        }
    )

    # A seed with which the echo cycles as well
    seed = seed_of_echo(loop, draft.seed)
    if seed is None:
        return None
    return Scenario(loop=loop, seed=seed, tags=_tags_of(draft, loop), asked=draft.id)


def seed_of_echo(loop: Loop, first: int) -> int | None:
    """Return the first of a few seeds with which the sibling that a loop echoes cycles; None where
    it does with none.
    """
    for seed in range(first, first + _SEEDS):
        try:
            run_once(loop, seed)
        except echo.NoCycleError:
            continue
        return seed
    return None


def _valve_of(draft: Draft, unit: Mapping[str, float]) -> dict[str, Any]:
    """Return the table of a draft's valve: one of a whole loop stands as its grid says."""
    table = draft.loop.to_table()["valve"]
    if "ideal" in (draft.loop.valve.name, draft.valve.name):
        return table
    more = _scale_parameters(draft.valve, unit)
    return valve_table(draft.loop.valve.name, table, unit["period"], more)


def measure_cycle(twin: Loop) -> Cycle:
    """Run a sticky loop without noise and measure its cycle.

    The run starts on the cycle that theory finds for the sampled loop. Where there is none, the
    period is that of `first_guess` and the amplitude that of a valve off by a quarter of its band.
    """
    at_rest = {"setpoint": SetPoint(value=twin.pv0), "noise": Noise(), "disturbance": ()}
    return _measure_twin(twin.model_copy(update=at_rest).model_dump_json())


@lru_cache(maxsize=64)  # cells that differ in the disturbance alone share their twin
def _measure_twin(text: str) -> Cycle:
    # Simulate from theory's cycle until sampling and period agree
    twin = Loop.model_validate_json(text)
    guess = period = first_guess(twin)
    try:
        for _ in range(4):
            loop = _with_sampling(twin, period / _FIRST, _FIRST * _PERIODS)
            with np.errstate(all="ignore"):  # candidate cycles that grow without bound
                start = cycle_start(loop)
            run = simulate(loop, 0, start=start)
            assert run.record.mv is not None
            moved = motion(run.record.mv, least_swing(loop) / 4)
            if moved.reversals < 3:
                break
            period = moved.period * loop.sampling.Ts
            if 0.5 * _FIRST < moved.period < 2.0 * _FIRST:
                return Cycle(period, float(np.std(run.record.pv[_FIRST:])), True)

    # A loop that theory does not know is started by a kick
    except ParameterError:  # no cycle to start on, or none that theory can find
        if (found := _measure_from_kick(twin, guess)) is not None:
            return found

    # No cycle: PV's size follows from the band
    S, _ = band(twin)
    if not twin.plant.integrating:
        size = 0.25 * S * abs(twin.plant.K)
    else:
        size = 0.3 * S / twin.controller.Kc
    return Cycle(guess, size, False)


def _measure_from_kick(twin: Loop, period: float) -> Cycle | None:
    """Measure the cycle of a loop that theory does not know (own law, cascade) from a run that
    begins away from rest.
    """
    # A loop that is linear but for its valve is none of these
    S, J = band(twin)
    if not plain_setup(twin, 0).not_linear:
        return None
    if twin.outer is None:
        twin = twin.with_("setpoint.steps", [[0.0, twin.pv0 + abs(twin.plant.K) * S]])

    # Run it until sampling and period agree
    for _ in range(3):
        loop = _with_sampling(twin, period / _FIRST, 3 * _FIRST * _PERIODS)
        run = simulate(loop, 0, kick=S + J if twin.outer is not None else 0.0)
        moved = motion(run.mv[_FIRST * _PERIODS :], least_swing(loop) / 4)
        if moved.reversals < 3:
            return None
        period = moved.period * loop.sampling.Ts
        if 0.5 * _FIRST < moved.period < 2.0 * _FIRST:
            return Cycle(period, float(np.std(run.record.pv[_FIRST * _PERIODS :])), True)
    return None


def first_guess(loop: Loop) -> float:
    """Guess the period (s) of a sticky loop's cycle."""
    # The loop as a first-order plant, and its loop gain per second
    S, J = band(loop)
    like = plant.first_order_like(loop.plant)
    Td = like.Td
    Ti = loop.controller.Ti
    k = abs(like.K) * loop.controller.Kc / (like.T or 1.0)
    if Ti is not None and like.T is not None:
        k *= max(1.0, like.T / Ti)  # more integral action than Ti = T: faster

    # A valve without slip jump is sampled like its neighbours
    if J == 0 and (like.T is not None or Ti is None):
        J = S / 3.0  # does not cycle: sampled like its neighbours that do

    # A stick-slip cycle of a first-order loop, or the double integrator's
    if J > 0:
        speed = min(k * Td, 0.9)
        p = J / (2.0 - speed)
        return round(2.0 * S / (k * p) + 2.0 * Td + speed * Td, 9)
    assert Ti is not None
    return 4.0 * math.pi * math.sqrt(Ti / k) + 4.0 * Td


def band(loop: Loop) -> tuple[float, float]:
    """Return (S, J) in % of a loop's valve; (1, 1) for a valve without friction, which gives
    sampling a scale.
    """
    module = VALVES.load(loop.valve.name)
    if not hasattr(module, "mapped_SJ"):
        return 1.0, 1.0
    S, J = module.mapped_SJ(valve_parameters(module, loop.valve.parameters, loop.sampling.Ts))
    if S > 0:
        return (S, J)
    return (1.0, 1.0)


def sampled_ultimate_gain(loop: Loop) -> float:
    """Return the gain Kc at which the loop, sampled as it is, stops being stable."""
    # A loop with more than one lag is asked of theory
    Ts = loop.sampling.Ts
    setup = plain_setup(loop, 0)
    if setup.not_linear or len(setup.den) != 2 or loop.controller.type == "PID":
        return loop.controller.Kc * (ultimate_gain(sampled_loop(loop)) or 1.0)

    # The open loop's frequency response, controller and hold included
    g = plant.sample(setup.num, setup.den, loop.plant.Td, Ts)
    w = np.geomspace(1e-4, math.pi, 4000)
    z = np.exp(1j * w)
    G = (g.B_old[0] / z + g.B_new[0]) / (z - g.A[0, 0]) * g.C[0] * z ** -float(g.delay)
    Ti = loop.controller.Ti
    L = loop.controller.sign * G * (1.0 if Ti is None else 1.0 + Ts / Ti * z / (z - 1.0))

    # The gain is that at the first crossing of -180 degrees
    crossings = phase_crossings(L)
    if crossings.size:
        at = crossings[0] + 1
    else:
        at = w.size - 1
    return float(1.0 / np.abs(L[at]))


def _with_sampling(loop: Loop, Ts: float, n: int) -> Loop:
    return loop.model_copy(update={"sampling": Sampling(Ts=Ts, n=n)})


def _with_w_Ti(twin: Loop, cycle: Cycle, wanted: float) -> tuple[Loop, Cycle]:
    # Ti moves the period, the period asks for another Ti: a damped fixed point in logarithms. Below
    # its tuned value Ti takes Kc down with it, so that the loop stays stable.
    Kc = twin.controller.Kc
    tuned = twin.controller.Ti or 1.0
    Ti = tuned
    for _ in range(15):
        ratio = wanted * cycle.period / (2.0 * math.pi) / Ti
        if abs(math.log(ratio)) < 0.01:
            break
        Ti *= ratio**0.7
        twin = twin.with_("controller.Ti", Ti).with_("controller.Kc", Kc * min(1.0, Ti / tuned))
        cycle = measure_cycle(twin)
    return twin, cycle


def _own_sampling(draft: Draft, twin: Loop, cycle: Cycle) -> Loop:
    """Settle a draft by the period of its own oscillation, by its sticky twin's where it has
    none.
    """
    own = cycle.period
    per = draft.rules.samples_per_period
    loop = _apply_rules(draft, twin, cycle, own)

    # what stands still but for the twin's own valve has the twin's period, but for what the noise
    # does to it
    same = draft.loop.valve.name == twin.valve.name
    undriven = cycle.exists and same and not draft.loads and not draft.moves
    for _ in range(0 if undriven or per is None else _PASSES):
        record = run_once(loop, draft.seed).record
        # a loop may oscillate in a half of its record only; elsewhere OP as a whole is enough, and
        # costs a third
        if draft.ultimate is None:
            found = oscillation_of(record.op, record.Ts)
        else:
            found = prepare_once(record).oscillation
        if not found.sustained or abs(math.log(found.period_s / own)) < _SETTLED:
            break
        own = found.period_s
        loop = _apply_rules(draft, twin, cycle, own)
    return loop


def _apply_rules(draft: Draft, twin: Loop, cycle: Cycle, own: float) -> Loop:
    """Return a draft's loop for the period of its record."""
    # The controller, where its integral action is a rule
    table = draft.loop.to_table()
    rules = draft.rules
    if rules.w_Ti is not None:
        table["controller"].update(
            Ti=significant(twin.controller.Ti or 1.0), Kc=significant(twin.controller.Kc)
        )

    # How fine and how long, in periods of its own
    if rules.samples_per_period is not None:
        per = float(rules.samples_per_period)
        table["sampling"] = {
            "Ts": significant(own / per),
            "n": round(per * float(rules.periods or _FIRST)),
        }
        if rules.warm_up:
            # of its own periods, or of the sticky sibling's where these are longer
            longer = min(max(cycle.period / own, 1.0), _LONGEST_WARM_UP)
            table["sampling"]["warm_up"] = round(per * rules.warm_up * longer)

    # Valve, noise, effects and loads in units of the cycle
    unit = _measure_units(twin, cycle)
    table["valve"] = _valve_of(draft, unit)
    if rules.noise_ratio is not None:
        table["noise"] = {"std": significant(rules.noise_ratio * cycle.pv_std)}
    table.setdefault("effect", []).extend(
        {"name": e.name, **_scale_parameters(e, unit)} for e in draft.effects
    )
    if draft.mv_noise > 0:
        table["noise"]["mv_std"] = significant(draft.mv_noise * unit["S"])
    if draft.moves:
        _move_setpoint(
            table["setpoint"], draft.moves, {**unit, "period": own}, own * (rules.warm_up or 0.0)
        )
    for load in draft.loads:
        size = unit["pv" if load["at"] == "output" else "S"]
        table.setdefault("disturbance", []).append(absolute_load(load, size, cycle.period))

    # The loop, with the gain of its tuning
    loop = Loop.from_table(table, "cell")
    if draft.ultimate is not None:
        loop = loop.with_(
            "controller.Kc", significant(draft.ultimate * sampled_ultimate_gain(loop))
        )
    return overridden(loop, draft.overrides or {})


def absolute_load(load: Mapping[str, Any], size: float, period: float) -> dict[str, Any]:
    """Return the table of a load whose amplitude is given in units of `size` and whose times in
    units of `period`.
    """
    scale = {"amplitude": size, "period": period, "lag": period, "start": period}
    return {k: significant(v * scale[k]) if k in scale else v for k, v in load.items()}


def valve_table(
    name: str, cell: Mapping[str, Any], period: float, more: Mapping[str, Any]
) -> dict[str, Any]:
    """Return the table of any valve file that has the (S, J) a cell asks for."""
    # The valve's own words for S and J
    module = VALVES.load(name)
    S = float(cell["S"])
    J = float(cell.get("J", 0.0))
    own: dict[str, Any] = {}
    if hasattr(module, "for_SJ"):
        own = module.for_SJ(S, J, significant(period))
    elif module.FRICTION:
        own = {}
        for key, value in (("S", S), ("J", J)):
            if key in module.PARAMETERS:
                own[key] = value

    # A valve that cannot have both is refused with the nearest one
    table = {**own, **more}
    if module.FRICTION and hasattr(module, "mapped_SJ"):
        found = module.mapped_SJ(valve_parameters(module, own, 1.0))
        if not np.allclose(found, (S, J), rtol=1e-6, atol=1e-9):
            can = f"nearest is S = {found[0]:g} %, J = {found[1]:g} %"
            raise ParameterError(f"valve {name!r} cannot have S = {S:g} %, J = {J:g} %: {can}")
    return {"model": name, **table}


def _scale_parameters(part: Scaled, unit: Mapping[str, float]) -> dict[str, Any]:
    scale = part.scale
    scaled = {}
    for k, v in part.parameters.items():
        if k in scale:
            v = significant(v * unit[scale[k]])  # type: ignore[operator]
        scaled[k] = v
    return scaled


def _move_setpoint(
    table: dict[str, Any],
    moves: Sequence[tuple[float, float]],
    unit: Mapping[str, float],
    begin: float = 0.0,
) -> None:
    steps = list(table.get("steps", []))
    if steps:
        rest = steps[-1][1]
    else:
        rest = table["value"]
    for t, level in moves:
        time = significant(begin + t * unit["period"])
        steps.append([time, rest + significant(level * unit["pv"])])
    table["steps"] = steps


def _tags_of(draft: Draft, loop: Loop) -> dict[str, Any]:
    # a valve without friction has no place on the axis of stick bands
    if VALVES.load(loop.valve.name).FRICTION:
        return draft.tags
    return {**draft.tags, "S_over_2J": 0.0, "S": 0.0}
