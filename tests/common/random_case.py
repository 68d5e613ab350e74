"""Generated loops on which the diagnosis is developed and calibrated: random plants, loads and
effects, the answer known.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from effect_draws import DRAWS, Yardstick

from simbench.detectors.errors import ParameterError
from simbench.detectors.record import LoopRecord
from simbench.gap.effects import recogniser
from simbench.loop.simulate import simulate
from simbench.scenarios.spec import Loop

PLAIN = (0.45, 0.75)  # of the way from barely there to gross


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
    closed = (
        T * float(rng.uniform(0.35, 1.0))
        if not integrating
        else Td + T * float(rng.uniform(0.1, 0.6))
    )
    gain = float(np.exp(rng.uniform(np.log(0.3), np.log(3.0)))) * float(rng.choice([1, -1]))
    if integrating:
        plant = {"type": "integrating", "K": gain / T, "Td": Td}
        Kc, Ti = T / (abs(gain) * (closed + Td)), 4 * (closed + Td)
    else:
        plant = {"type": "foptd", "K": gain, "T": T, "Td": Td}
        # four times the closed loop's pace is always more than T
        Kc, Ti = T / (abs(gain) * (closed + Td)), T
    n = int(rng.integers(1200, 3000))
    noise = abs(gain) * float(np.exp(rng.uniform(np.log(0.03), np.log(0.4))))
    load = float(np.exp(rng.uniform(np.log(0.1), np.log(1.2))))
    value = float(rng.uniform(30, 70))
    steps = []
    if rng.random() < 0.65:
        times = np.sort(rng.uniform(0, n * Ts, int(rng.integers(2, 9))))
        steps = [[float(t), value + abs(gain) * float(rng.uniform(-6, 6))] for t in times]
    return Loop.from_table(
        {
            "plant": plant,
            "controller": {
                "type": "PI",
                "Kc": Kc,
                "Ti": Ti,
                "direction": "reverse" if gain > 0 else "direct",
            },
            "operating_point": {"op0": float(rng.uniform(35, 65)), "pv0": value},
            "sampling": {"Ts": Ts, "n": n},
            "noise": {"std": noise},
            "setpoint": {"value": value, "steps": steps},
            "disturbance": [
                {"type": "coloured", "amplitude": load, "period": T * float(rng.uniform(0.2, 3.0))}
            ],
        }
    )


def random_effect(name: str, loop: Loop, rng: np.random.Generator) -> dict[str, float | str]:
    """Return parameters of an effect, plain to see but not gross, in proportion to the loop.

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

    Raises
    ------
    ParameterError
        When nobody said how to draw this effect at random.
    """
    if name not in DRAWS:
        raise ParameterError(f"effect {name!r}: nobody said how to draw it at random")
    plant, control = loop.plant, loop.controller
    T = plant.T or (control.Ti or 100.0) / 4
    yard = Yardstick(
        record=simulate(loop, seed=1).record,
        noise=loop.noise.std,
        lag=T + plant.Td,
        pace=T + plant.Td,
        gain=abs(plant.K) * (1.0 if plant.T else T),
        Td=plant.Td,
        integral=control.Ti is not None,
    )
    return DRAWS[name](yard, rng)(float(rng.uniform(*PLAIN)))


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
    """
    rng = np.random.default_rng([7, seed])
    while True:
        loop = random_loop(rng)
        if not (
            loop.plant.type == "integrating"
            and any("time constant" in recogniser(e).needs for e in names)
        ):
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
