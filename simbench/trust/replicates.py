"""Simulate replicates of a recorded loop, with a healthy valve and with friction of known size."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from joblib import delayed

from simbench.confirm.expected import DRIVEN
from simbench.detectors.errors import UserError
from simbench.detectors.judge import judge
from simbench.detectors.record import LoopRecord
from simbench.detectors.signal.oscillation import find_oscillation
from simbench.detectors.verdict import Verdict
from simbench.gap.stiction.altered import with_friction
from simbench.gap.stiction.candidate_loops import CandidateLoops
from simbench.gap.stiction.measured import op_range
from simbench.loop.plant import stretched
from simbench.loop.simulate import simulate
from simbench.parallel import run_parallel
from simbench.scenarios.errors import SpecError
from simbench.scenarios.spec import Loop, Plant, SetPoint

_LEVELS = 5  # values of S
_SLIPS = (0.25, 1.0)  # J over S: a little slip-jump, and as much as there is band
_WARM_UP = 0.3  # of the record's length, simulated ahead of it and cut off
_TRIES = 6  # draws before a loop that runs away is given up
_LARGER, _SMALLER = 2.0, 0.4  # times the record's size that a loop without friction may move
_QUIETER = 0.4  # times the fitted loads in addition to such a swing, which they were fitted to
_GOLDEN = 0.5 * (5.0**0.5 - 1.0)  # its multiples fall evenly into every share

# standard deviations of the logarithms drawn: identified plants are known worse than stated ones
_UNCERTAIN = {"slow": 0.30, "K": 0.10, "Td": 0.25, "load": 0.20, "load_time": 0.30, "noise": 0.10}
_STATED = {"slow": 0.05, "K": 0.05, "Td": 0.05, "load": 0.20, "load_time": 0.30, "noise": 0.10}


@dataclass(frozen=True, eq=False)
class Replicate:
    """One simulated replicate of a loop, with its S and J (%)."""

    S: float
    J: float
    record: LoopRecord


@dataclass(frozen=True)
class Change:
    """What might have been recorded otherwise.

    Times the length, times as many samples in the same time, set-point steps of a height (PV units;
    0: none) every sixth of the record, the valve's position, and what changes the loop, as an
    archive does.
    """

    longer: float = 1.0
    faster: int = 1
    step: float = 0.0
    mv: bool = False
    loop: Callable[[Loop], Loop] | None = None


def levels(around: CandidateLoops) -> list[tuple[float, float]]:
    """Return the cells (S, J) in % that are tried around a record: five times S, each with little
    and with full slip-jump.
    """
    span = op_range(around.record.op)
    S = np.geomspace(np.clip(0.1 * span, 0.1, 1.0), np.clip(2.0 * span, 5.0, 15.0), _LEVELS)
    return [(float(s), float(r * s)) for r in _SLIPS for s in S]


def draw_replicates(
    around: CandidateLoops,
    healthy: int,
    each: int,
    *,
    cells: Sequence[tuple[float, float]] | None = None,
    change: Change | None = None,
    seed: int = 0,
) -> list[Replicate]:
    """Simulate replicates of a loop with a healthy valve and with stiction of several sizes."""
    plan = [(0.0, 0.0)] * healthy + [
        cell for cell in (cells if cells is not None else levels(around)) for _ in range(each)
    ]
    change = change or Change()
    bases = [*around.healthy, *([] if around.sticky is None else [around.sticky])]
    bases = [_base(loop, around.record, change) for loop in bases]
    drawn = (_replicate(around, bases, S, J, change, [seed, i]) for i, (S, J) in enumerate(plan))
    return [t for t in drawn if t is not None]


def judged(
    replicates: Sequence[Replicate], methods: Sequence[str], jobs: int
) -> list[list[Verdict]]:
    """Return what every method says of every replicate, in order, asked in so many processes."""
    asked = [delayed(judge)(t.record, methods) for t in replicates]
    return run_parallel(asked, jobs, "replicates judged")


@dataclass(frozen=True, eq=False)
class _Base:
    """A loop that replicates vary: its table, and its set point with `ahead` samples before the
    record, which is checked once and not for every replicate.
    """

    table: dict[str, Any]
    setpoint: SetPoint
    ahead: int

    def loop(self, table: dict[str, Any]) -> Loop:
        """Return the loop of a varied table."""
        return Loop.from_table(table, "twin").model_copy(update={"setpoint": self.setpoint})

    def recorded(self, loop: Loop, seed: int, **kick: float) -> LoopRecord:
        """Simulate a loop, and return what is recorded: the set point's way to where it stood is
        over, which is all that some loops ever move.
        """
        run = simulate(loop, seed, **kick).record
        return run.window(self.ahead, run.n)


def _base(loop: Loop, record: LoopRecord, change: Change) -> _Base:
    """Return a loop as it is varied, with a change of what might have been recorded."""
    loop = loop if change.loop is None else change.loop(loop)
    still = loop.model_copy(update={"setpoint": SetPoint(value=loop.setpoint.value)})
    sampling, setpoint, ahead = _timed(loop.setpoint, record, change)
    return _Base(still.to_table() | {"sampling": sampling}, setpoint, ahead)


def _replicate(
    a: CandidateLoops,
    bases: Sequence[_Base],
    S: float,
    J: float,
    change: Change,
    stream: list[int],
) -> Replicate | None:
    rng, number = np.random.default_rng(stream), stream[-1]
    stuck = S > 0 and _of_sticky(a, number)
    base = bases[-1] if stuck else bases[number % len(a.healthy)]
    # friction that explains the record leaves nothing to be swung from outside
    outside = a.period is not None and not stuck
    for attempt in range(_TRIES):
        try:
            table = _perturbed(base.table, _STATED if a.trusted else _UNCERTAIN, rng)
            seed = int(rng.integers(2**31))
            if outside and (attempt >= _TRIES // 2 or number % 2):
                table = _driven(table, a, DRIVEN[number // 2 % 2], seed, base, rng)
            loop = base.loop(table)
            run = base.recorded(with_friction(loop, 0.0, 0.0), seed)
            if not _alike(run, a.record, change, healthy=S <= 0):
                continue
            # a record that swings is compared with healthy loops that swing too
            if (
                S <= 0
                and a.period is not None
                and not find_oscillation(run.op, run.pv, run.Ts).sustained
            ):
                continue
            if S > 0:
                # at rest a sticky loop may stay there for ever; the plant's has been moving for
                # years
                kick = float(rng.choice((-1.0, 1.0))) * (S + 1.0)
                run = base.recorded(with_friction(loop, S, J), seed, kick=kick)
        except (UserError, SpecError):
            continue
        return Replicate(S, J, _as_recorded(run, a.record, change.mv))
    return None


def _of_sticky(a: CandidateLoops, number: int) -> bool:
    """Return whether friction is put into the loop that was fitted with some: under friction part
    of the motion is the valve's, how much nobody knows.
    """
    return a.sticky is not None and number * _GOLDEN % 1.0 < a.probability


def _driven(
    table: dict[str, Any],
    a: CandidateLoops,
    kind: str,
    seed: int,
    base: _Base,
    rng: np.random.Generator,
) -> dict[str, Any]:
    """Return a sound loop that another one swings as much as the record swings, at about its
    period.
    """
    assert a.period is not None
    loads = [part | {"amplitude": _QUIETER * part["amplitude"]} for part in table["disturbance"]]
    calm = table | {
        "disturbance": loads,
        "effect": [e for e in table.get("effect", []) if e["name"] != "oscillation"],
    }
    drive: dict[str, Any] = {
        "type": kind,
        "amplitude": 1.0,
        "period": a.period * float(np.exp(0.05 * rng.standard_normal())),
    }
    if kind == "propagated":
        drive |= {
            "S": 5.0,
            "J": float(rng.uniform(2.0, 5.0)),
            "noise": 0.05,
            "lag": a.period * float(rng.uniform(0.02, 0.2)),
        }
    swung = calm | {"disturbance": [*loads, drive]}
    without, with_ = (base.recorded(base.loop(t), seed).pv for t in (calm, swung))
    missing = np.sqrt(max(np.var(a.record.pv) - np.var(without), 0.1 * np.var(a.record.pv)))
    drive["amplitude"] = float(missing / max(np.std(with_ - without), 1e-12))
    return swung


def _alike(run: LoopRecord, record: LoopRecord, change: Change, healthy: bool) -> bool:
    """Return whether a loop without friction moves no more than the record does, and a `healthy`
    replicate no less.
    """
    for name in ("op", "pv"):
        size, real = float(np.std(getattr(run, name))), float(np.std(getattr(record, name)))
        # a set-point step moves both, and that is what it is for
        room = np.inf if change.step else _LARGER * real
        if not size <= room or (healthy and size < _SMALLER * real) or not np.isfinite(size):
            return False
    return True


def _perturbed(
    table: dict[str, Any], by: dict[str, float], rng: np.random.Generator
) -> dict[str, Any]:
    """Return a loop's table with plant, loads and noise drawn around its values.

    In closed loop K and T of a self-regulating plant are known little better than their ratio: they
    move together.
    """
    z = {name: float(np.exp(std * rng.standard_normal())) for name, std in by.items()}
    plant = dict(table["plant"])
    if plant["type"] == "tf":
        transfer = Plant.model_validate(plant)
        slow = 1.0 if transfer.integrating else z["slow"]
        return _loads_perturbed(table, z) | {
            "plant": stretched(transfer, z["K"] * slow, slow, transfer.Td * z["Td"])
        }
    plant["K"] *= z["K"]
    if plant["type"] == "foptd":
        plant["K"] *= z["slow"]
        plant["T"] *= z["slow"]
    plant["Td"] = plant.get("Td", 0.0) * z["Td"]
    return _loads_perturbed(table, z) | {"plant": plant}


def _loads_perturbed(table: dict[str, Any], z: dict[str, float]) -> dict[str, Any]:
    loads = []
    for part in table.get("disturbance", []):
        part = dict(part)
        part["amplitude"] *= z["load"]
        if "period" in part:
            part["period"] *= z["load_time"]
        loads.append(part)
    noise = dict(table.get("noise", {}))
    noise["std"] = noise.get("std", 0.0) * z["noise"]
    return table | {"disturbance": loads, "noise": noise}


def _timed(
    point: SetPoint, record: LoopRecord, change: Change
) -> tuple[dict[str, Any], SetPoint, int]:
    """Return sampling and set point, and how many samples come before the record."""
    Ts = record.Ts / change.faster
    n = int(record.n * change.longer * change.faster)
    ahead = int(_WARM_UP * record.n * change.faster)
    steps = [(t + ahead * Ts, v) for t, v in point.steps]
    last = steps[-1][1] if steps else point.value
    if change.longer > 1:
        # the same moves again, as often as they fit
        period, recorded = record.n * record.Ts, list(steps)
        for again in range(1, int(np.ceil(change.longer))):
            steps += [
                (t + again * period, v)
                for t, v in recorded
                if t + again * period < (n + ahead) * Ts
            ]
    if change.step:
        at = (ahead + np.arange(1, 6) * n // 6) * Ts
        steps = [(float(t), float(last + change.step * (i % 2 == 0))) for i, t in enumerate(at)]
    setpoint = SetPoint(value=point.value, steps=tuple(steps))
    return {"Ts": Ts, "n": n + ahead}, setpoint, ahead


def _as_recorded(run: LoopRecord, record: LoopRecord, mv: bool) -> LoopRecord:
    """Return a simulated record with no more in it than the plant's has."""
    return LoopRecord(
        run.op,
        run.pv,
        run.Ts,
        sp=None if record.sp is None else run.sp,
        mv=run.mv if mv or record.mv is not None else None,
        process=record.process,
        kind=record.kind,
        op_span=(0.0, 100.0),
        tag=record.tag,
    )
