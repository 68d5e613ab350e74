"""Lower the gain of an identified plant where its loop would be unstable: the loop on record is
not.
"""

from __future__ import annotations

from simbench.detectors.errors import ParameterError
from simbench.scenarios.parts import Part
from simbench.scenarios.spec import Loop
from simbench.theory.sampled import sampled_loop, ultimate_gain


def stable(loop: Loop) -> Loop:
    """Return the loop with K at the margin of stability where it is beyond, its loads on PV kept.

    The loops of eight of 79 real records are identified beyond it, as a sticky valve or a load that
    swings tells little about the gain.
    """
    try:
        margin = ultimate_gain(sampled_loop(loop.model_copy(update={"effect": ()})))
    except ParameterError:
        # of a valve or controller without a linear model nobody knows the margin
        return loop
    if margin is None or margin >= 1.0:
        return loop
    loads = tuple(_weaken_load(load, margin) for load in loop.disturbance)
    return loop.replace(plant=loop.plant.with_gain(margin), disturbance=loads)


def _weaken_load(load: Part, margin: float) -> Part:
    """Return a load that moves PV as much behind a gain of `margin` times what it was."""
    p = load.parameters
    size = p.get("amplitude")
    if p.get("at", "input") != "input" or not isinstance(size, (int, float)):
        return load
    return Part(name=load.name, parameters={**p, "amplitude": size / margin})
