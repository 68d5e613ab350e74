"""Draw random but plausible loops, and the baseline that is handed out with each."""

from __future__ import annotations

import itertools
import math
from dataclasses import replace

import numpy as np

from results.studies.worlds.own import simulator as sim
from results.studies.worlds.own.loops import TrueLoop


def draw(
    rng: np.random.Generator,
    *,
    plant: str | None = None,
    sp_moves: bool | None = None,
    mv: bool | None = None,
) -> TrueLoop:
    """Draw a loop a plant could have."""
    plant = plant or ("foptd" if rng.random() < 0.65 else "integrating")
    moves = bool(rng.random() < 0.55) if sp_moves is None else sp_moves
    Ts = float(rng.choice([0.5, 1.0, 1.0, 2.0, 5.0, 10.0]))
    T = Ts * _log(rng, 5, 60)
    Td = max(T * _log(rng, 0.08, 1.2), Ts)
    unit = _log(rng, 0.05, 20)
    sign = 1.0 if rng.random() < 0.8 else -1.0
    K = sign * (unit if plant == "foptd" else unit / T)
    # desired closed-loop time constant
    wish = max(T * rng.uniform(0.5, 1.5), Td * rng.uniform(0.9, 2.0))
    speed = wish + Td
    controller = "P" if rng.random() < 0.15 else "PI"
    if plant == "foptd":
        Kc, Ti = T / (unit * speed), min(T, 4 * speed) * rng.uniform(0.8, 1.3)
    else:
        Kc = (2 * wish + Td) / (abs(K) * speed**2) if controller == "PI" else 1 / (abs(K) * speed)
        Ti = (2 * wish + Td) * rng.uniform(1.0, 1.5)
    n = int(rng.integers(1000, 4001))
    pv0 = float(np.round(rng.uniform(-50, 150) * unit, 3))
    load = "none" if rng.random() < 0.1 else str(rng.choice(["ou", "ar2", "pink"]))
    load_std = _log(rng, 0.3, 3.0)
    late = bool(rng.random() < 0.25 and Td >= 2 * Ts)
    K, T, Td, Kc, Ti = (_round(x) for x in (K, T, Td, Kc, Ti))
    case = TrueLoop(
        plant=plant,
        K=K,
        T=T,
        Td=Td,
        controller=controller,
        Kc=Kc,
        Ti=Ti if controller == "PI" else 0.0,
        sign=sign,
        op0=float(np.round(rng.uniform(35, 65), 1)),
        pv0=pv0,
        Ts=Ts,
        n=n,
        steps=(),
        noise_std=_round(unit * load_std * _log(rng, 0.03, 0.5)),
        noise_colour=str(
            rng.choice(["white", "flicker", "bluish", "heavy"], p=[0.7, 0.1, 0.1, 0.1])
        ),
        load_std=load_std,
        load_colour=load,
        load_tau=speed * rng.uniform(0.5, 4.0),
        unit=unit,
        speed=speed,
        play=float(np.round(rng.uniform(0.2, 1.0), 2)) if rng.random() < 0.12 else 0.0,
        form=int(rng.integers(2)),
        integral=int(rng.choice([sim.BACKWARD, sim.BACKWARD, sim.FORWARD, sim.TRAPEZOID])),
        log_is_late=late,
        friction=int(rng.choice([sim.KARNOPP, sim.STRIBECK, sim.HE], p=[0.45, 0.35, 0.2])),
        smooth_gap=bool(rng.random() < 0.25),
        mv=bool(rng.random() < 0.5) if mv is None else mv,
        mv_noise=float(rng.choice([0.0, 0.02, 0.05])),
        nominal=(0.0, 0.0, 0.0),
    )
    off = rng.uniform(0.9, 1.1, 3)
    case = replace(
        case, nominal=tuple(_round(x * f) for x, f in zip((K, T, Td - Ts * late), off, strict=True))
    )
    return replace(case, steps=_steps(rng, case) if moves else ())


def _steps(rng: np.random.Generator, case: TrueLoop) -> tuple[tuple[float, float], ...]:
    """Set-point steps: 3 to 10 of them, at least three closed-loop time scales apart, OP kept well
    inside its range.
    """
    largest = min(10.0 * case.unit, 15.0 / case.Kc)
    count = int(min(rng.integers(3, 11), max(2, case.duration / (4 * case.speed))))
    bounds = np.linspace(0.03, 0.97, count + 1) * case.duration
    level, steps = 0.0, []
    for a, b in itertools.pairwise(bounds):
        t = a + (b - a) * rng.uniform(0.0, 0.4)
        way = -np.sign(level) if abs(level) > largest else rng.choice([-1.0, 1.0])
        level += way * largest * rng.uniform(0.3, 1.0)
        steps.append((float(round(t / case.Ts) * case.Ts), float(case.pv0 + _round(level))))
    return tuple(steps)


def baseline_table(case: TrueLoop) -> dict:
    """Return the loop file handed out with the record: the nominal plant, and no word about faults,
    loads or log.
    """
    K, T, Td = case.nominal
    plant = {"type": case.plant, "K": K, **({"T": T} if case.plant == "foptd" else {}), "Td": Td}
    controller = {
        "type": case.controller,
        "Kc": case.Kc,
        **({"Ti": case.Ti} if case.controller == "PI" else {}),
        "direction": "reverse" if case.sign > 0 else "direct",
    }
    valve = {"model": "deadband", "S": case.play} if case.play > 0 else {"model": "ideal"}
    return {
        "plant": plant,
        "controller": controller,
        "valve": valve,
        "sampling": {"Ts": case.Ts, "n": case.n},
        "noise": {"std": case.noise_std},
        "setpoint": {"value": case.pv0, "steps": [list(s) for s in case.steps]},
    }


def _log(rng: np.random.Generator, lo: float, hi: float) -> float:
    return float(math.exp(rng.uniform(math.log(lo), math.log(hi))))


def _round(x: float) -> float:
    return float(f"{x:.4g}")
