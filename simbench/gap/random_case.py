"""Loops of our own on which the diagnosis is developed and calibrated: random plants, loads and effects, the answer known."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from detectors.record import LoopRecord
from scenarios.spec import Loop
from simbench.loop.simulate import simulate


@dataclass(frozen=True, eq=False)
class Case:
    """A record, the baseline the diagnosis is given, and what was done to the loop."""

    record: LoopRecord
    baseline: Loop
    truth: Loop
    effects: tuple[str, ...]


def random_loop(rng: np.random.Generator) -> Loop:
    """Return a loop of random size, tuning, noise, load and set point, without an effect.

    Parameters
    ----------
    rng : numpy.random.Generator

    Returns
    -------
    Loop
    """
    integrating = rng.random() < 0.4
    Ts = float(rng.choice([0.5, 1.0, 2.0, 5.0, 10.0]))
    T = Ts * float(np.exp(rng.uniform(np.log(6), np.log(50))))
    Td = T * float(rng.uniform(0.05, 0.6))
    closed = T * float(rng.uniform(0.35, 1.0)) if not integrating else Td + T * float(rng.uniform(0.1, 0.6))
    gain = float(np.exp(rng.uniform(np.log(0.3), np.log(3.0)))) * float(rng.choice([1, -1]))
    if integrating:
        plant = {"type": "integrating", "K": gain / T, "Td": Td}
        Kc, Ti = T / (abs(gain) * (closed + Td)), 4 * (closed + Td)
    else:
        plant = {"type": "foptd", "K": gain, "T": T, "Td": Td}
        Kc, Ti = T / (abs(gain) * (closed + Td)), min(T, 4 * (closed + Td))
    n = int(rng.integers(1200, 3000))
    noise = abs(gain) * float(np.exp(rng.uniform(np.log(0.03), np.log(0.4))))
    load = float(np.exp(rng.uniform(np.log(0.1), np.log(1.2))))
    value = float(rng.uniform(30, 70))
    steps = []
    if rng.random() < 0.65:
        times = np.sort(rng.uniform(0, n * Ts, int(rng.integers(2, 9))))
        steps = [[float(t), value + abs(gain) * float(rng.uniform(-6, 6))] for t in times]
    return Loop.from_table({
        "plant": plant,
        "controller": {"type": "PI", "Kc": Kc, "Ti": Ti, "direction": "reverse" if gain > 0 else "direct"},
        "operating_point": {"op0": float(rng.uniform(35, 65)), "pv0": value},
        "sampling": {"Ts": Ts, "n": n},
        "noise": {"std": noise},
        "setpoint": {"value": value, "steps": steps},
        "disturbance": [{"type": "coloured", "amplitude": load, "period": T * float(rng.uniform(0.2, 3.0))}],
    })  # fmt: skip


def random_effect(name: str, loop: Loop, rng: np.random.Generator) -> dict[str, float | str]:
    """Return parameters of an effect, from barely visible to plain, in proportion to the loop.

    Parameters
    ----------
    name : str
        Effect id.
    loop : Loop
        The loop it will act on.
    rng : numpy.random.Generator

    Returns
    -------
    dict
    """

    def log(low: float, high: float) -> float:
        return float(np.exp(rng.uniform(np.log(low), np.log(high))))

    Ts, n = loop.sampling.Ts, loop.sampling.n
    K, T, Td = abs(loop.plant.K), loop.plant.T, loop.plant.Td
    if T is None:
        T = (loop.controller.Ti or 100.0) / 4
        K = K * T
    quick = float(rng.choice([-1, 1]))
    plain = simulate(loop, seed=1).record
    spread = 1.48 * float(np.median(np.abs(plain.pv - plain.sp)))
    op_low, op_high = (float(q) for q in np.quantile(plain.op, [0.0, 1.0]))
    op_mid, op_half = (op_low + op_high) / 2, (op_high - op_low) / 2 + 0.05
    S, reach = log(1.0, 8.0), op_half * float(rng.uniform(0.1, 0.6))
    later = Td < 2 * Ts or quick > 0
    extra = max(Td * float(rng.uniform(0.4, 1.5)), Ts) if later else -Td * float(rng.uniform(0.4, 1.0))
    table: dict[str, dict[str, float | str]] = {
        "stiction": {"S": S, "J": S * float(rng.uniform(0.2, 1.0))},
        "deadband": {"S": S},
        "deadzone": {"D": op_half * float(rng.uniform(0.3, 1.2)), "c": op_mid + op_half * float(rng.uniform(-0.3, 0.3))},
        "valve_lag": {"tau": T * float(rng.uniform(0.25, 1.0))},
        "valve_characteristic": {"R": log(3.0, 40.0) ** quick},
        "gain_mismatch": {"factor": log(1.3, 2.0) ** quick},
        "time_constant_mismatch": {"factor": log(1.35, 2.5) ** quick},
        "dead_time_mismatch": {"extra": extra},
        "extra_lag": {"tau": T * float(rng.uniform(0.2, 0.8))},
        "noise": {"factor": log(1.4, 4.0)},
        "quantisation": {"step": spread * log(0.5, 4.0), "at": str(rng.choice(["loop", "record"]))},
        "sensor_lag": {"tau": T * float(rng.uniform(0.15, 0.8))},
        "compression": {"band": spread * log(0.5, 2.0)},
        "outliers": {"rate": log(0.005, 0.04), "size": spread * log(4.0, 12.0), "at": str(rng.choice(["loop", "record"]))},
        "drift": {"rate": K * quick * log(2.0, 15.0) / (n * Ts), "walk": K * log(0.5, 6.0) / np.sqrt(n * Ts)},
        "oscillation": {"amplitude": log(0.5, 5.0), "period": (T + Td) * log(1.0, 10.0)},
        "load_steps": {"rate": float(rng.uniform(4, 15)) / (n * Ts), "size": log(1.5, 8.0)},
        "load_drift": {"rate": quick * log(2.0, 15.0) / (n * Ts), "walk": log(1.0, 10.0) / np.sqrt(n * Ts)},
        "saturation": {"lo": 0.0, "hi": op_mid + reach} if quick > 0 else {"lo": op_mid - reach, "hi": 100.0},
        "detuning": {"Kc_factor": log(1.3, 2.5) ** quick, "Ti_factor": log(1.0, 2.0) ** float(rng.choice([-1, 1]))},
        "error_deadband": {"width": spread * float(rng.uniform(1.0, 4.0))},
        "op_quantisation": {"step": float(np.std(plain.op)) * log(0.3, 2.0)},
    }  # fmt: skip
    return table[name]


def random_case(seed: int, names: tuple[str, ...] = (), mv: bool = False) -> Case:
    """Return a case with the given effects (none when empty).

    Parameters
    ----------
    seed : int
        Root of everything random.
    names : tuple of str
        Effect ids; a time constant is only missed by a foptd plant.
    mv : bool
        Whether MV was recorded.

    Returns
    -------
    Case

    Examples
    --------
    >>> case = random_case(5, ("deadband",))
    >>> case.effects, case.truth.effect[0].name
    (('deadband',), 'deadband')
    """
    rng = np.random.default_rng([7, seed])
    while True:
        loop = random_loop(rng)
        if not (loop.plant.type == "integrating" and "time_constant_mismatch" in names):
            break
    effects = [{"name": name, **random_effect(name, loop, rng)} for name in names]
    truth = Loop.from_table({**loop.to_table(), "effect": effects})
    record = simulate(truth, seed=seed).record
    record = replace(record, mv=record.mv if mv else None)
    off = rng.uniform(0.9, 1.1, 3)
    table = loop.to_table()
    table["disturbance"] = []
    table["plant"]["K"] *= off[0]
    table["plant"]["Td"] *= off[1]
    if loop.plant.T is not None:
        table["plant"]["T"] *= off[2]
    return Case(record, Loop.from_table(table), truth, names)
