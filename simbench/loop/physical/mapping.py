"""Friction as a band S, J (% of travel) and as two forces, break-away and sliding friction: one
from the other.
"""

from __future__ import annotations

import math

from simbench.detectors.errors import ParameterError


def complete_band(
    values: dict[str, float],
    where: str,
    forces: tuple[str, str],
    percent: float,
    defaults: tuple[float, float] | None = None,
    overshoot: bool = False,
) -> dict[str, float]:
    """Fill the pair that was not given from the pair that was."""
    # S = percent (Fs + Fc), J = percent (Fs - Fc): force balance at rest and in slow motion,
    # Choudhury et al. (2005).
    high, low = forces
    S = values["S"]
    J = values["J"]
    Fs = values[high]
    Fc = values[low]
    band = [not math.isnan(S), not math.isnan(J)]
    pair = [not math.isnan(Fs), not math.isnan(Fc)]
    if any(band) and any(pair):
        raise ParameterError(
            f"{where}: give S and J or {high} and {low}, not some of both; either pair sets the"
            " other"
        )
    if any(band):
        if not all(band):
            raise ParameterError(
                f"{where} needs S and J together, only {'S' if band[0] else 'J'} is given"
            )
        if J > S and not overshoot:
            raise ParameterError(
                f"{where}: J = {J:g} exceeds S = {S:g}, which needs a negative {low}: friction"
                " alone cannot overshoot, only the inertia of an underdamped valve (large m, small"
                " Fv) or the map of model 'choudhury' can"
            )
        return {**values, high: 0.5 * (S + J) / percent, low: 0.5 * (S - J) / percent}
    if defaults is not None:
        if not pair[0]:
            Fs = defaults[0]
        if not pair[1]:
            Fc = defaults[1]
    elif not all(pair):
        raise ParameterError(f"{where} needs S and J, or {high} and {low}")
    if Fs < Fc:
        raise ParameterError(
            f"{where}: {high} = {Fs:g} is below {low} = {Fc:g}; a valve at rest holds at least as"
            " hard as a moving one"
        )
    if Fs + Fc < 0.0:
        raise ParameterError(
            f"{where}: {high} + {low} = {Fs + Fc:g} is negative; the sum is the band S and"
            " cannot be"
        )
    return {**values, high: Fs, low: Fc, "S": percent * (Fs + Fc), "J": percent * (Fs - Fc)}
