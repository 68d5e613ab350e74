"""Resolve a grid's rules: sampling, noise and loads of a cell follow from one noise-free run of its sticky twin."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any

import numpy as np

from detectors.errors import ParameterError
from detectors.prepared import prepare
from detectors.signal.oscillation import oscillation_of
from scenarios.cell import Draft, Oscillation, Scaled, overridden
from scenarios.grid import Group
from scenarios.spec import Loop, Noise, Part, Sampling, Scenario, SetPoint
from simbench.bench.scenario.motion import motion
from simbench.bench.scenario.truth import least_swing
from simbench.loop import plant
from simbench.loop.parameters import VALVES, valve_parameters
from simbench.loop.setup import plain_setup
from simbench.loop.simulate import simulate
from simbench.theory.cycle import cycle_start
from simbench.theory.sampled import sampled_loop, ultimate_gain

_FIRST = 40  # samples per period of the run that measures the cycle
_PERIODS = 10  # its length
_PASSES = 3  # of a record's period and its sampling: a new sampling moves the period a little
_SETTLED = 0.1  # two periods as near as this (in logarithm) are one
_WANDERS = 1.0  # periods over which a load that makes a loop oscillate wanders
_TRIES = 12  # gains of a loop that oscillates by its tuning
_SHARES = (0.8, 1.01)  # of the gain at which it neither grows nor fades: where they are looked for
_LARGEST_KICK = 8.0  # OP stds of the wanted oscillation: beyond it the kick, and no tuning, makes the oscillation
# logarithm of a record's OP std in the last fifth over that in the first: below the first a tuning is taken at once, above the
# second never; sticky loops of the grids have up to 0.2 in nine of ten
_UNLIKE = 0.5  # logarithm of the variance of OP over the wanted one
_STEADY, _UNSTEADY = 0.1, 0.2
_DIGITS = 3  # ids must not hang on the last bits of a simulation


class _UnmatchedError(Exception):
    """A healthy loop that cannot oscillate as its sticky siblings do."""


@dataclass(frozen=True)
class _Cycle:
    """How the sticky twin of a cell moves."""

    period: float  # of MV (s)
    pv_std: float  # of PV over the run but its first period (PV units)
    op_std: float  # of OP there (%)
    exists: bool  # False when no start set it going; then both are guesses


def resolve(group: Group) -> list[Scenario]:
    """Settle the rules of one group; a healthy loop that cannot be matched with the sticky ones is left out."""
    return [scenario for scenario in settle(group) if scenario is not None]


def settle(group: Group) -> list[Scenario | None]:
    """Settle the rules of one group: a scenario for each draft, or None for a healthy loop that cannot be matched."""
    if group.rules.empty:
        return [Scenario(loop=d.loop, seed=group.seed, tags=d.tags) for d in group.drafts]
    twin, cycle = group.twin, measure_cycle(group.twin)
    if group.rules.w_Ti is not None:
        twin, cycle = _with_w_Ti(twin, cycle, float(group.rules.w_Ti))
    found: list[Scenario | None] = []
    for draft in group.drafts:
        try:
            loop = _own_sampling(draft, group, twin, cycle)
        except _UnmatchedError:
            found.append(None)
        else:
            found.append(Scenario(loop=loop, seed=group.seed, tags=_tags(draft, loop)))
    return found


def measure_cycle(twin: Loop) -> _Cycle:
    """Run a sticky loop without noise and measure its cycle.

    The run starts on the cycle that theory finds for the sampled loop. Where there is none, the period is that of `first_guess`
    and the amplitude that of a valve off by a quarter of its band.
    """
    at_rest = {"setpoint": SetPoint(value=twin.pv0), "noise": Noise(), "disturbance": ()}
    return _measured(twin.model_copy(update=at_rest).model_dump_json())


@lru_cache(maxsize=64)  # cells that differ in the disturbance alone share their twin
def _measured(text: str) -> _Cycle:
    twin = Loop.model_validate_json(text)
    guess = period = first_guess(twin)
    try:
        for _ in range(4):
            loop = _sampled(twin, period / _FIRST, _FIRST * _PERIODS)
            with np.errstate(all="ignore"):  # candidate cycles that grow without bound
                start = cycle_start(loop)
            run = simulate(loop, 0, start=start)
            assert run.record.mv is not None
            moved = motion(run.record.mv, least_swing(loop) / 4)
            if moved.reversals < 3:
                break
            period = moved.period * loop.sampling.Ts
            if 0.5 * _FIRST < moved.period < 2.0 * _FIRST:
                return _Cycle(period, float(np.std(run.record.pv[_FIRST:])), float(np.std(run.record.op[_FIRST:])), True)
    except ParameterError:  # no cycle to start on, or none that theory can find
        if (found := _kicked(twin, guess)) is not None:
            return found
    S, _ = band(twin)
    size = 0.25 * S * abs(twin.plant.K) if not twin.plant.integrating else 0.3 * S / twin.controller.Kc
    return _Cycle(guess, size, 0.25 * S, False)


def _kicked(twin: Loop, period: float) -> _Cycle | None:
    """Measure the cycle of a loop that theory does not know (own law, cascade) from a run that begins away from rest."""
    S, J = band(twin)
    if not plain_setup(twin, 0).not_linear:
        return None
    if twin.outer is None:
        twin = twin.with_("setpoint.steps", [[0.0, twin.pv0 + abs(twin.plant.K) * S]])
    for _ in range(3):
        loop = _sampled(twin, period / _FIRST, 3 * _FIRST * _PERIODS)
        run = simulate(loop, 0, kick=S + J if twin.outer is not None else 0.0)
        moved = motion(run.mv[_FIRST * _PERIODS :], least_swing(loop) / 4)
        if moved.reversals < 3:
            return None
        period = moved.period * loop.sampling.Ts
        if 0.5 * _FIRST < moved.period < 2.0 * _FIRST:
            late = slice(_FIRST * _PERIODS, None)
            return _Cycle(period, float(np.std(run.record.pv[late])), float(np.std(run.record.op[late])), True)
    return None


def first_guess(loop: Loop) -> float:
    """Guess the period (s) of a sticky loop's cycle."""
    S, J = band(loop)
    like = plant.first_order_like(loop.plant)
    Td, Ti = like.Td, loop.controller.Ti
    k = abs(like.K) * loop.controller.Kc / (like.T or 1.0)
    if Ti is not None and like.T is not None:
        k *= max(1.0, like.T / Ti)  # more integral action than Ti = T: faster
    if J == 0 and (like.T is not None or Ti is None):
        J = S / 3.0  # does not cycle: sampled like its neighbours that do
    if J > 0:
        speed = min(k * Td, 0.9)
        p = J / (2.0 - speed)
        return round(2.0 * S / (k * p) + 2.0 * Td + speed * Td, 9)
    assert Ti is not None
    return 4.0 * math.pi * math.sqrt(Ti / k) + 4.0 * Td


def band(loop: Loop) -> tuple[float, float]:
    """Return (S, J) in % of a loop's valve; (1, 1) for a valve without friction, which gives sampling a scale."""
    module = VALVES.load(loop.valve.name)
    if not hasattr(module, "mapped_SJ"):
        return 1.0, 1.0
    S, J = module.mapped_SJ(valve_parameters(module, loop.valve.parameters, loop.sampling.Ts))
    return (S, J) if S > 0 else (1.0, 1.0)


def sampled_ultimate_gain(loop: Loop) -> float:
    """Return the gain Kc at which the loop, sampled as it is, stops being stable."""
    Ts = loop.sampling.Ts
    setup = plain_setup(loop, 0)
    if setup.not_linear or len(setup.den) != 2 or loop.controller.type == "PID":
        return loop.controller.Kc * (ultimate_gain(sampled_loop(loop)) or 1.0)
    g = plant.sample(setup.num, setup.den, loop.plant.Td, Ts)
    w = np.geomspace(1e-4, math.pi, 4000)
    z = np.exp(1j * w)
    G = (g.B_old[0] / z + g.B_new[0]) / (z - g.A[0, 0]) * g.C[0] * z ** -float(g.delay)
    Ti = loop.controller.Ti
    L = loop.controller.sign * G * (1.0 if Ti is None else 1.0 + Ts / Ti * z / (z - 1.0))
    phase = np.unwrap(np.angle(L))
    # an integrating plant under PI starts at -180 degrees from above or below: look for the last way down through it
    beyond = np.flatnonzero((phase[:-1] > -math.pi) & (phase[1:] <= -math.pi))
    at = beyond[0] + 1 if beyond.size else w.size - 1
    return float(1.0 / np.abs(L[at]))


def significant(x: float) -> float:
    """Return a number rounded to 3 significant digits, so that ids do not hang on a simulation's last bits."""
    return float(f"{x:.{_DIGITS}g}")


def _sampled(loop: Loop, Ts: float, n: int) -> Loop:
    return loop.model_copy(update={"sampling": Sampling(Ts=Ts, n=n)})


def _with_w_Ti(twin: Loop, cycle: _Cycle, wanted: float) -> tuple[Loop, _Cycle]:
    # Ti moves the period, the period asks for another Ti: a damped fixed point in logarithms. Below its tuned value Ti takes
    # Kc down with it, so that the loop stays stable.
    Kc, tuned = twin.controller.Kc, twin.controller.Ti or 1.0
    Ti = tuned
    for _ in range(15):
        ratio = wanted * cycle.period / (2.0 * math.pi) / Ti
        if abs(math.log(ratio)) < 0.01:
            break
        Ti *= ratio**0.7
        twin = twin.with_("controller.Ti", Ti).with_("controller.Kc", Kc * min(1.0, Ti / tuned))
        cycle = measure_cycle(twin)
    return twin, cycle


def _own_sampling(draft: Draft, group: Group, twin: Loop, cycle: _Cycle) -> Loop:
    """Settle a draft by the period of its own oscillation; by its sticky twin's where it does not oscillate."""
    swing, per = draft.oscillation, group.rules.samples_per_period
    if swing is not None:
        sizes = {"pv_std": cycle.pv_std * swing.size, "op_std": cycle.op_std * swing.size}
        cycle = replace(cycle, period=cycle.period * swing.period, **sizes)
    own, loop = cycle.period, draft.loop
    if swing is not None and swing.load is None:
        loop = loop.model_copy(update={"valve": Part(name="ideal")})
        # the sampling period moves the limit of stability a little, and this the period
        for _ in range(_PASSES):
            loop = loop.with_("sampling.Ts", own / float(per or _FIRST))
            own = _oscillating(loop, cycle)[1].period
        return _settled(draft, group, twin, cycle, own)
    loop = _settled(draft, group, twin, cycle, own)
    # what stands still but for the twin's own valve has the twin's period, but for what the noise does to it
    undriven = cycle.exists and draft.loop.valve == twin.valve and not draft.loads and not draft.moves and not group.matched
    for _ in range(0 if undriven or per is None else _PASSES):
        record = simulate(loop, group.seed).record
        # a ringing loop may oscillate in a half of its record only; elsewhere OP as a whole is enough, and costs a third
        found = oscillation_of(record.op, record.Ts) if draft.ultimate is None else prepare(record.without_mv()).oscillation
        if not found.sustained or abs(math.log(found.period_s / own)) < _SETTLED:
            break
        own = found.period_s
        loop = _settled(draft, group, twin, cycle, own)
    return loop


def _settled(draft: Draft, group: Group, twin: Loop, cycle: _Cycle, own: float) -> Loop:
    table, rules, swing = draft.loop.to_table(), group.rules, draft.oscillation
    tuned = swing is not None and swing.load is None
    if rules.w_Ti is not None:
        table["controller"].update(Ti=significant(twin.controller.Ti or 1.0), Kc=significant(twin.controller.Kc))
    if rules.samples_per_period is not None:
        per = float(rules.samples_per_period)
        table["sampling"] = {"Ts": significant(own / per), "n": round(per * float(rules.periods or _FIRST))}
        if rules.warm_up:
            table["sampling"]["warm_up"] = round(per * rules.warm_up * max(1.0, cycle.period / own))
    if tuned:
        found, cycle = _oscillating(Loop.from_table({**table, "valve": {"model": "ideal"}}, "cell"), cycle)
        table["controller"] = found.to_table()["controller"]
    S, J = (x * (1.0 if swing is None else swing.size) for x in band(twin))
    unit = {"S": S, "J": J, "period": cycle.period, "pv": cycle.pv_std}
    if "ideal" not in (draft.loop.valve.name, draft.valve.name):  # a whole loop's valve stands as its grid says
        more = _scaled(draft.valve, unit)
        table["valve"] = valve_table(draft.loop.valve.name, table["valve"], cycle.period, more)
    if swing is not None and not tuned:
        _load_swing(table, swing, cycle)
    if rules.noise_ratio is not None:
        table["noise"] = {"std": significant(rules.noise_ratio * cycle.pv_std)}
    table.setdefault("effect", []).extend({"name": e.name, **_scaled(e, unit)} for e in draft.effects)
    if draft.mv_noise > 0:
        table["noise"]["mv_std"] = significant(draft.mv_noise * S)
    if draft.moves:
        _move_setpoint(table["setpoint"], draft.moves, {**unit, "period": own}, own * (rules.warm_up or 0.0))
    for load in draft.loads:
        size = cycle.pv_std if load["at"] == "output" else S
        table.setdefault("disturbance", []).append(_absolute(load, size, cycle.period))
    if tuned:
        _tuned_swing(table, cycle, group.seed)
    loop = Loop.from_table(table, "cell")
    if draft.ultimate is not None:
        loop = loop.with_("controller.Kc", significant(draft.ultimate * sampled_ultimate_gain(loop)))
    return overridden(loop, draft.overrides or {})


def _load_swing(table: dict[str, Any], swing: Oscillation, cycle: _Cycle) -> None:
    """Add the load that makes a healthy loop oscillate with the period and the OP std of a cycle."""
    load = _absolute({**swing.load, "amplitude": 1.0, "period": 1.0}, cycle.pv_std, cycle.period)
    table["disturbance"] = [*table.get("disturbance", []), load]
    for _ in range(2):  # once where the loop is linear
        loop = Loop.from_table(table, "cell")
        load["amplitude"] = significant(load["amplitude"] * cycle.op_std / float(np.std(simulate(loop).record.op)))
    size, lasting = swing.wander * cycle.op_std, _WANDERS * cycle.period
    wander = {"type": "coloured", "at": "input", "amplitude": significant(size), "period": significant(lasting)}
    table["disturbance"].append(wander)


def _tuned_swing(table: dict[str, Any], cycle: _Cycle, seed: int) -> None:
    """Let a healthy loop near its limit of stability oscillate with the OP std of a cycle, neither growing nor fading.

    Its response to the excitation and that to the noise add up. A bisection finds the gain at which their sum is as wide at the
    record's end as at its beginning; for each gain the size of the excitation follows from the wanted std.
    """
    loop = Loop.from_table(table, "cell")
    Kc, wanted = loop.controller.Kc, cycle.op_std**2 + (loop.controller.Kc * loop.noise.std) ** 2
    (lo, hi), share, nearest, found = _SHARES, 1.0, math.inf, loop
    for _ in range(_TRIES):
        tuned = loop.with_("controller.Kc", significant(share * Kc))
        noise = simulate(_kicked_by(tuned, 0.0), seed).record.op
        kicked = simulate(_alone(tuned), seed).record.op
        size, lacking = float(np.var(kicked)), wanted - float(np.var(noise))
        grows = lacking < 0.0
        if lacking > 0.0 and size > 0.0:
            half = float(np.mean((noise - noise.mean()) * (kicked - kicked.mean())))
            factor = (math.sqrt(half**2 + lacking * size) - half) / size
            if factor * _kick(tuned) < _LARGEST_KICK * cycle.op_std:
                op = noise + factor * (kicked - kicked.mean())
                fifth = op.size // 5
                growth = math.log(max(float(np.std(op[-fifth:])), 1e-9) / max(float(np.std(op[:fifth])), 1e-9))
                grows = growth > 0.0
                off = abs(growth)
                if off < nearest:
                    nearest, found = off, _kicked_by(tuned, significant(factor))
                if nearest < _STEADY and _is_as(found, wanted, seed):
                    break
        lo, hi = (lo, share) if grows else (share, hi)
        share = 0.5 * (lo + hi)
    if nearest > _UNSTEADY or not _is_as(found, wanted, seed):
        raise _UnmatchedError
    table.update(found.to_table())


def _is_as(loop: Loop, wanted: float, seed: int) -> bool:
    """Whether the variance of a loop's OP is as wanted: not where its valve is far from linear."""
    return abs(math.log(max(float(np.var(simulate(loop, seed).record.op)), 1e-12) / wanted)) < _UNLIKE


def _kick(loop: Loop) -> float:
    """Return about how far (%) the excitation at its start moves a loop's OP."""
    moved = abs(loop.setpoint.steps[0][1] - loop.setpoint.value) * loop.controller.Kc if loop.setpoint.steps else 0.0
    return max([moved, *(float(d.parameters["amplitude"]) for d in loop.disturbance if d.name == "ramp")])


def _alone(loop: Loop) -> Loop:
    """Return the loop with nothing but the excitation at its start."""
    ramps = tuple(d for d in loop.disturbance if d.name == "ramp")
    first = tuple(step for step in loop.setpoint.steps if step[0] == 0.0)
    setpoint = loop.setpoint.model_copy(update={"steps": first})
    return loop.model_copy(update={"noise": Noise(), "disturbance": ramps, "setpoint": setpoint, "effect": ()})


def _kicked_by(loop: Loop, factor: float) -> Loop:
    """Return the loop with the excitation at its start multiplied by a factor."""
    rest, table = loop.setpoint.value, loop.to_table()
    table["setpoint"]["steps"] = [[t, rest + (v - rest) * factor if t == 0.0 else v] for t, v in loop.setpoint.steps]
    for load in table["disturbance"]:
        if load["type"] == "ramp":
            load["amplitude"] *= factor
    return Loop.from_table(table, "cell")


def _oscillating(loop: Loop, cycle: _Cycle) -> tuple[Loop, _Cycle]:
    """Return the loop tuned so that it neither grows nor fades at a cycle's period, or a shorter one, and its own swing."""
    Ts, setup, Ti = loop.sampling.Ts, plain_setup(loop, 0), loop.controller.Ti
    g = plant.sample(setup.num, setup.den, setup.Td, Ts)

    def answer(period: float) -> complex:
        z = np.exp(2j * np.pi * Ts / period)
        return -loop.controller.sign * z ** float(g.delay) * (z - g.A[0, 0]) / ((g.B_old[0] / z + g.B_new[0]) * g.C[0])

    # the controller must answer with -1/G: a P controller at one period, a PI controller with no more of its answer from the
    # integral than in the loop as it was tuned, so that as much of the noise reaches OP
    least = 1.0 if Ti is None else 0.9 / math.hypot(1.0, cycle.period / (2.0 * math.pi * Ti))
    period = cycle.period if Ti is not None else max(cycle.period, 8.0 * loop.plant.Td)
    while period > 4.0 * Ts:
        needed = answer(period)
        # -1/G = Kc + Ki z/(z - 1): two real equations; z/(z - 1) = 1/2 - i cot(pi Ts/period)/2
        Ki = 0.0 if Ti is None else -2.0 * needed.imag * math.tan(math.pi * Ts / period)
        Kc = needed.real - 0.5 * Ki
        if needed.imag >= 0.0 if Ti is None else Ki > 0.0 and Kc > least * abs(needed):
            break
        period *= 0.98
    else:
        raise _UnmatchedError
    tuned = {"controller.Kc": significant(Kc)} | ({} if Ti is None else {"controller.Ti": significant(Kc * Ts / Ki)})
    return loop.with_all(tuned), replace(cycle, period=period, pv_std=cycle.op_std / abs(needed))


def valve_table(name: str, cell: Mapping[str, Any], period: float, more: Mapping[str, Any]) -> dict[str, Any]:
    """Return the table of any valve file that has the (S, J) a cell asks for."""
    module = VALVES.load(name)
    S, J = float(cell["S"]), float(cell.get("J", 0.0))
    own: dict[str, Any] = {}
    if hasattr(module, "for_SJ"):
        own = module.for_SJ(S, J, significant(period))
    elif module.FRICTION:
        own = {key: value for key, value in (("S", S), ("J", J)) if key in module.PARAMETERS}
    table = {**own, **more}
    if module.FRICTION and hasattr(module, "mapped_SJ"):
        found = module.mapped_SJ(valve_parameters(module, own, 1.0))
        if not np.allclose(found, (S, J), rtol=1e-6, atol=1e-9):
            can = f"nearest is S = {found[0]:g} %, J = {found[1]:g} %"
            raise ParameterError(f"valve {name!r} cannot have S = {S:g} %, J = {J:g} %: {can}")
    return {"model": name, **table}


def _scaled(part: Scaled, unit: Mapping[str, float]) -> dict[str, Any]:
    scale = part.scale
    return {k: significant(v * unit[scale[k]]) if k in scale else v for k, v in part.parameters.items()}  # type: ignore[operator]


def _move_setpoint(
    table: dict[str, Any], moves: Sequence[tuple[float, float]], unit: Mapping[str, float], begin: float
) -> None:
    steps = list(table.get("steps", []))
    rest = steps[-1][1] if steps else table["value"]
    steps += [[significant(begin + t * unit["period"]), rest + significant(level * unit["pv"])] for t, level in moves]
    table["steps"] = steps


def _tags(draft: Draft, loop: Loop) -> dict[str, Any]:
    # a valve without friction has no place on the axis of stick bands
    return draft.tags if VALVES.load(loop.valve.name).FRICTION else {**draft.tags, "S_over_2J": 0.0, "S": 0.0}


def _absolute(load: dict[str, Any], size: float, period: float) -> dict[str, Any]:
    scale = {"amplitude": size, "period": period, "lag": period, "start": period}
    return {k: significant(v * scale[k]) if k in scale else v for k, v in load.items()}
