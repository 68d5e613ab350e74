"""Lower the gain of an identified plant where its loop would be unstable: the loop on record is
not.
"""

from __future__ import annotations

from simbench.detectors.errors import ParameterError
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
    table = loop.to_table()
    table["plant"]["K"] *= margin
    for load in table.get("disturbance", []):
        if load.get("at", "input") == "input":
            load["amplitude"] /= margin
    return Loop.from_table(table, "fixed loop")
