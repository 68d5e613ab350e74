"""Pneumatic spring-and-diaphragm actuator: published parameters, what is refused, and its equation
in % of travel.

m x'' = F - k x - friction(x') with F = OP/100 k stroke. Divided by k stroke/100, position and OP in
% of travel:
    x'' = w2 (OP - x - friction) - 2 a x',   w2 = k/m,  a = Fv/(2 m),  friction in % = 100/(k
    stroke) of that in N,
so the moving valve heads for OP - fd and the one at rest breaks away at |OP - x| > fs, fs and fd =
(S +- J)/2.
"""

from __future__ import annotations

import math

from simbench.detectors.errors import ParameterError
from simbench.loop.parameters import FOLLOWS, Number

SOURCE = (
    "Choudhury, Thornhill and Shah (2005), Control Engineering Practice 13, 641-658, Table 1, "
    "after Kayihan and Doyle (2000), Control Engineering Practice 8, 799-812"
)

# Published as 3 lb, 300 lbf/in, 320 and 384 lbf, 3.5 lbf s/in, 4 in; the stroke matches 3..15 psi
# on 100 in2. The published friction is then S = 58.6 %, J = 5.3 %, a very sticky valve: scale it
# down for common ones.
ACTUATOR = {
    "S": Number(
        "% of travel", low=0.0, high=100.0, default=FOLLOWS, says="band, 100 (Fs + Fc)/(k stroke)"
    ),
    "J": Number(
        "% of travel",
        low=0.0,
        high=100.0,
        default=FOLLOWS,
        says="slip jump, 100 (Fs - Fc)/(k stroke)",
    ),
    "Fs": Number(
        "N",
        low=0.0,
        default=FOLLOWS,
        says="break-away friction; 1707 when neither it nor S is given",
    ),
    "Fc": Number(
        "N", low=0.0, default=FOLLOWS, says="Coulomb friction; 1423 when neither it nor S is given"
    ),
    "Fv": Number("N s/m", low=0.0, default=612.0, says="viscous friction"),
    "m": Number("kg", low=0.0, positive=True, default=1.36, says="moving mass"),
    "k": Number("N/m", low=0.0, positive=True, default=52538.0, says="spring stiffness"),
    "stroke": Number("m", low=0.0, positive=True, default=0.1016, says="travel"),
}
PUBLISHED_FRICTION = (1707.0, 1423.0)

SUBSTEP = Number(
    "s",
    low=0.0,
    default=0.0,
    says="fixed integration step, 1e-4 is good; 0: exact, from event to event",
)


def complete_actuator(values: dict[str, float], where: str) -> dict[str, float]:
    """Fill S and J from Fs and Fc or the other way round, and refuse a sub-step that is too
    large.
    """
    refuse_large_substep(values, where)
    percent = 100.0 / (values["k"] * values["stroke"])
    return complete_band(values, where, ("Fs", "Fc"), percent, PUBLISHED_FRICTION)


def refuse_large_substep(values: dict[str, float], where: str) -> None:
    """Raise `ParameterError` when a fixed sub-step is longer than the fastest motion of the
    actuator.
    """
    limit = fastest(values["Fv"], values["m"], values["k"])
    if values["substep"] > limit:
        raise ParameterError(
            f"{where}: substep = {values['substep']:g} s is too large; above {limit:.3g} s, the"
            " fastest time constant of mass, spring and viscous friction, the valve stops and"
            " jumps where it should slide"
        )


def fastest(Fv: float, m: float, k: float) -> float:
    """Return the shortest time constant (s) of m x'' + Fv x' + k x = 0."""
    a = Fv / (2.0 * m)
    w2 = k / m
    if a * a > w2:
        return 1.0 / (a + math.sqrt(a * a - w2))
    return 1.0 / math.sqrt(w2)


def overshoot(p) -> float:
    """Return by which share of a free jump the valve passes its balance: 0 when damped, 1 without
    viscous friction.
    """
    a = p.Fv / (2.0 * p.m)
    w2 = p.k / p.m
    if a * a < w2:
        return math.exp(-math.pi * a / math.sqrt(w2 - a * a))
    return 0.0


def mapped_SJ(p) -> tuple[float, float]:
    """Return the (S, J) in % of travel of the equivalent stiction map.

    Exact for an actuator that does not overshoot. One that does jumps by J (1 + overshoot) and
    comes to rest that much nearer to the opposite break-away: He's map with K = 1 + overshoot, as
    long as it moves by jumps.
    """
    more = overshoot(p) * p.J
    return p.S - more, p.J + more


# --- Friction as a band S, J (% of travel) and as two forces, break-away and sliding friction:
# one from the other.


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

    # Forces from the band
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

    # The band from the forces
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
