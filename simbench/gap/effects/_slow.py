"""What sensor drift and slow loads share: too slow for one loop to say where they enter."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from simbench.gap.situation import Circumstances

LINEAR = 3  # linear coefficients before the effect's own: gain, bias or ramp, onset


def slow(c: Circumstances) -> bool:
    """Return whether a slow signal at the plant's input looks like one on PV."""
    return c.slow and not c.integrating


def ramp(c: Circumstances) -> bool:
    """Return whether a ramp at the plant's input looks like one on PV."""
    return c.ramp and not c.integrating


def traits(p: Mapping[str, Any], plant: Mapping[str, Any], noise: float, at_input: bool) -> dict[str, bool]:
    """Return whether ramp and walk move PV by less than the noise within T + Td, and whether the ramp is all there is.

    Parameters
    ----------
    p : mapping
        rate, walk.
    plant : mapping
        Of the loop file.
    noise : float
        Standard deviation (PV units).
    at_input : bool
        The signal acts through the plant's gain.

    Returns
    -------
    dict
    """
    if plant.get("T") is None:
        return {}
    gain = abs(float(plant["K"])) if at_input else 1.0
    pace, rate = float(plant["T"]) + float(plant.get("Td", 0.0)), abs(float(p.get("rate", 0.0)))
    walked = abs(float(p.get("walk", 0.0))) * pace**0.5
    return {"slow": gain * (rate * pace + walked) < noise, "ramp": rate != 0.0 and gain * walked < noise}
