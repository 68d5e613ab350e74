"""A loop file resolved to a setup: plug-ins looked up and checked, loads drawn, effects applied,
noise drawn.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from simbench.loop import echo, resampled
from simbench.loop.disturbance import disturbance_signal
from simbench.loop.effects import PLUGINS
from simbench.loop.parameters import resolve
from simbench.loop.setup import Setup, bands_of, plain_setup, stages_of
from simbench.scenarios.spec import Loop

# Independent random streams of one run: changing one part's numbers leaves the others' alone; the
# noise has stream 0.
_DISTURBANCE, _EFFECT = 100, 200


def resolve_loop(
    loop: Loop, seed: int, tail: int = 0, tf: Any = None, quiet: int | None = None
) -> Setup:
    """Turn a loop into a setup: plug-ins looked up and checked, signals drawn, effects applied."""
    setup = plain_setup(loop, seed, tail, tf)
    for i, part in enumerate(loop.disturbance):
        stream = seed, _DISTURBANCE + i
        if part.name == echo.NAME:
            donor = resolve_loop(echo.donor_of(loop, part), seed, 0, tf)
            setup.add_load("input", echo.echo_load(part, donor, setup, stream))
        elif part.name == resampled.RESAMPLED:
            for place, signal in resampled.drawn(part, setup.end, setup.Ts, stream):
                # of OP the residuals are its moves themselves
                setup.add_load(place, np.cumsum(signal) if place == "op" else signal)
        else:
            setup.add_load(*disturbance_signal(part, setup.end, setup.Ts, stream))
    _apply_effects(setup)
    # last, because effects may change the strength of the noise
    setup.draw_noise(quiet)
    return setup


def friction(loop: Loop) -> list[tuple[float, float]]:
    """Return (S, J) in % of travel of every stage of the valve that has friction, effects
    included.
    """
    bands = (
        undisturbed(loop).bands
        if loop.effect
        else bands_of(stages_of(loop.valve, loop.sampling.Ts))
    )
    return [(S, J) for S, J in bands if S > 0.0]


def undisturbed(loop: Loop) -> Setup:
    """Return the setup of a loop with its effects, without disturbances and noise."""
    setup = plain_setup(loop, 0)
    _apply_effects(setup)
    return setup


def _apply_effects(setup: Setup) -> None:
    for i, part in enumerate(setup.loop.effect):
        effect = PLUGINS.load(part.name)
        p = resolve(effect.PARAMETERS, part.parameters, f"effect {part.name!r}")
        effect.apply(setup, p, np.random.default_rng([setup.seed, _EFFECT + i]))
