"""A loop resolved once (plug-ins looked up, numbers checked), and its runs by seed: loads drawn,
effects applied, noise drawn.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from types import ModuleType
from typing import Any

import numpy as np

from simbench.loop import echo, resampled
from simbench.loop.disturbance import disturbance_signal
from simbench.loop.effects import PLUGINS
from simbench.loop.parameters import resolve
from simbench.loop.setup import LoopParts, Setup, bands_of, look_up_parts, plain_setup
from simbench.scenarios.parts import Part
from simbench.scenarios.spec import Loop

# Independent random streams of one run: changing one part's numbers leaves the others' alone; the
# noise has stream 0.
_DISTURBANCE = 100
_EFFECT = 200
_MOST = 64  # loops that are kept resolved: those of a group of scenarios, and their healthy twins


@dataclass(frozen=True, eq=False)
class ResolvedLoop:
    """A loop whose plug-ins are looked up and whose numbers are checked; every seed runs through
    it.
    """

    loop: Loop
    plant: Any  # the python-control system in place of the loop's own plant; None of most loops
    parts: LoopParts
    effects: tuple[tuple[ModuleType, Any], ...]  # each with its resolved parameters
    donor: ResolvedLoop | None  # the loop whose valve's motion a load echoes

    def draw_setup(self, seed: int, tail: int = 0, quiet: int | None = None) -> Setup:
        """Return the setup of one run: its loads and noise drawn, its effects applied."""
        setup = plain_setup(self.loop, seed, tail, parts=self.parts)
        for i, part in enumerate(self.loop.disturbance):
            stream = seed, _DISTURBANCE + i
            if part.name == echo.NAME:
                assert self.donor is not None
                donor = self.donor.draw_setup(seed)
                setup.add_load("input", echo.echo_load(part, donor, setup, stream))
            elif part.name == resampled.RESAMPLED:
                for place, signal in resampled.drawn(part, setup.end, setup.Ts, stream):
                    # of OP the residuals are its moves themselves
                    setup.add_load(place, np.cumsum(signal) if place == "op" else signal)
            else:
                setup.add_load(*disturbance_signal(part, setup.end, setup.Ts, stream))
        self._apply_effects(setup)

        # last, because effects may change the strength of the noise
        setup.draw_noise(quiet)
        return setup

    def undisturbed(self) -> Setup:
        """Return the setup of the loop with its effects, without disturbances and noise."""
        setup = plain_setup(self.loop, 0, parts=self.parts)
        self._apply_effects(setup)
        return setup

    def _apply_effects(self, setup: Setup) -> None:
        for i, (effect, p) in enumerate(self.effects):
            effect.apply(setup, p, np.random.default_rng([setup.seed, _EFFECT + i]))


_resolved: deque[ResolvedLoop] = deque(maxlen=_MOST)


def resolve_once(loop: Loop, plant: Any = None) -> ResolvedLoop:
    """Return a loop resolved; one that was just asked for is kept."""
    for known in _resolved:
        if known.loop is loop and known.plant is plant:
            return known
    found = _resolve_parts(loop, plant)
    _resolved.append(found)
    return found


def _resolve_parts(loop: Loop, plant: Any) -> ResolvedLoop:
    parts = look_up_parts(loop, plant)
    echoes = [part for part in loop.disturbance if part.name == echo.NAME]
    return ResolvedLoop(
        loop=loop,
        plant=plant,
        parts=parts,
        effects=tuple(_look_up_effect(part) for part in loop.effect),
        donor=_resolve_parts(echo.donor_of(loop, echoes[0]), plant) if echoes else None,
    )


def _look_up_effect(part: Part) -> tuple[ModuleType, Any]:
    effect = PLUGINS.load(part.name)
    return effect, resolve(effect.PARAMETERS, part.parameters, f"effect {part.name!r}")


def resolve_loop(
    loop: Loop, seed: int, tail: int = 0, tf: Any = None, quiet: int | None = None
) -> Setup:
    """Return the setup of one run of a loop; its plug-ins are looked up once for all its seeds."""
    return resolve_once(loop, tf).draw_setup(seed, tail, quiet)


def friction(loop: Loop) -> list[tuple[float, float]]:
    """Return (S, J) in % of travel of every stage of the valve that has friction, effects
    included.
    """
    found = resolve_once(loop)
    if found.effects:
        bands = found.undisturbed().bands
    else:
        bands = bands_of(found.parts.valves)
    return [(S, J) for S, J in bands if S > 0.0]


def undisturbed(loop: Loop) -> Setup:
    """Return the setup of a loop with its effects, without disturbances and noise."""
    return resolve_once(loop).undisturbed()
