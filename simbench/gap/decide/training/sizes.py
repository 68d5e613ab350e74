"""How large things are in a loop of the training set, and which friction makes a stiction."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from detectors.record import LoopRecord
from simbench.gap.decide.training.bench import Bench
from simbench.gap.effects._draw import Yardstick

MODELS = {"choudhury": 0.3, "kano": 0.2, "he": 0.2, "karnopp": 0.15, "stribeck": 0.15}  # frictions, and how often


@dataclass(frozen=True, eq=False)
class Scales(Yardstick):
    """A loop's bench beside one record of it without effect."""

    bench: Bench


def scales(bench: Bench, record: LoopRecord) -> Scales:
    """Return how large things are in a loop.

    Parameters
    ----------
    bench : Bench
    record : LoopRecord
        Without effect.

    Returns
    -------
    Scales
    """
    plant = bench.loop.plant
    return Scales(
        record=record,
        noise=bench.loop.noise.std,
        lag=bench.scale + plant.Td,
        pace=bench.pace,
        gain=bench.gain,
        Td=plant.Td - bench.late * record.Ts,
        integral=bench.loop.controller.type == "PI",
        bench=bench,
    )


def friction(rng: np.random.Generator) -> str:
    """Draw the model that makes a stiction: the effect is the (S, J) map, a real valve sticks by laws of its own."""
    return str(rng.choice(list(MODELS), p=list(MODELS.values())))
