"""Tables 11.2 and 11.3 as data, the existence conditions that refine Table 11.3, and the truth
columns they give.
"""

from __future__ import annotations

from types import MappingProxyType
from typing import Any

from simbench.detectors.errors import ParameterError
from simbench.loop.resolve import undisturbed
from simbench.loop.setup import Setup
from simbench.scenarios.spec import Loop
from simbench.theory.basin import kick_min, kicks_text
from simbench.theory.cycle import ExactCycle, exact_cycle
from simbench.theory.describing import deadzone, intersections, measured, stiction
from simbench.theory.sampled import SampledLoop, mapped_valve, reduced

# Forsman (2000); Srinivasan et al. (2005a): the chapter's Table 11.2
TABLE_11_2 = MappingProxyType(
    {
        # (process, what dominates) -> (OP, PV)
        ("fast (flow)", "I"): ("triangular (sharp)", "square"),
        ("fast (flow)", "P"): ("rectangular", "rectangular"),
        ("slow (pressure, temperature)", ""): ("triangular (smooth)", "sinusoidal"),
        ("integrating (level)", "P"): ("triangular (sharp)", "triangular (sharp)"),
        # the printed order of this cell is lost; by physics PV, the integral of a square MV, is the
        # triangle
        ("integrating (level)", "PI"): ("parabolic", "triangular (sharp)"),
    }
)
"""Typical shapes (OP, PV) of a loop with a sticky valve."""

# Choudhury, Shah and Thornhill (2008), Diagnosis of Process Nonlinearities and Valve Stiction:
# Table 11.3
DEAD_BAND = "dead-band"
STICK_SLIP = "stick-slip"
TABLE_11_3 = MappingProxyType(
    {
        # (process, controller, nonlinearity) -> does a limit cycle occur?
        ("self-regulating", "P", DEAD_BAND): False,
        ("self-regulating", "P", STICK_SLIP): False,
        ("self-regulating", "PI", DEAD_BAND): False,
        ("self-regulating", "PI", STICK_SLIP): True,
        ("integrating", "P", DEAD_BAND): False,
        ("integrating", "P", STICK_SLIP): True,
        ("integrating", "PI", DEAD_BAND): True,
        ("integrating", "PI", STICK_SLIP): True,
    }
)
"""Occurrence of limit cycles."""

CONDITIONS = MappingProxyType(
    {
        ("self-regulating", "P", STICK_SLIP): "a cycle exists if and only if K Kc J > S",
        (
            "self-regulating",
            "PI",
            DEAD_BAND,
        ): "tight tuning (Ti below T, Kc near its limit) keeps a dead-band cycling",
    }
)
"""Where the table is too coarse, and what decides instead."""


_NO_CELL = "Table 11.3 has no cell for PID: describing function and exact cycle answer"
_MISFIT = 0.05  # rms difference, in jumps, between a valve and its (S, J) map that is worth a word


def cell(loop: SampledLoop) -> tuple[str, str, str] | None:
    """Return the loop's (process, controller, nonlinearity) in Table 11.3; None for a valve without
    friction.
    """
    if loop.fs == 0:
        return None
    process = "integrating" if loop.integrating else "self-regulating"
    return process, "PI" if loop.integral else "P", STICK_SLIP if loop.J > 0 else DEAD_BAND


def table_11_3(loop: SampledLoop) -> bool:
    """Return what Table 11.3 says of a loop; a valve without friction has no limit cycle."""
    place = cell(loop)
    return place is not None and TABLE_11_3[place]


def refined(loop: SampledLoop, cycle: ExactCycle | None) -> bool:
    """Return Table 11.3's answer with the existence conditions of its two coarse cells.

    Self-regulating P with stick-slip: OP settles at r0 - K Kc v for a valve at v, and leaves both
    of two positions v and v + J if and only if (r0 + fs)/(1 + g) - J < v < (r0 - fs)/(1 + g), fs =
    (S + J)/2, g = K Kc: there is room when g J > S. Self-regulating PI with dead-band: the cycle
    itself decides.
    """
    place = cell(loop)
    if place == ("self-regulating", "P", STICK_SLIP):
        return loop.static_gain * loop.J > loop.S
    if place == ("self-regulating", "PI", DEAD_BAND):
        return cycle is not None
    return table_11_3(loop)


def truth_columns(
    loop: Loop, *, kick: bool = False, waves: bool = True
) -> tuple[bool | None, bool | None, dict[str, Any]]:
    """Return the theory's truth columns of one scenario."""
    theory: dict[str, Any] = dict.fromkeys(
        ("exists", "by", "period", "amplitude", "multiplier", "irregularity", "kick_min")
    )
    theory.update(describing_function=[], reason="")

    # the loop as a sampled loop with an (S, J) valve, where it is one
    setup = undisturbed(loop)
    try:
        S, J = mapped_valve(setup)
    except ParameterError as error:
        theory["reason"] = str(error)
        _without_mapping(setup, theory)
        return None, None, theory
    try:
        sampled = reduced(setup, S, J)
    except ParameterError as error:
        theory["reason"] = str(error)
        return None, None, theory

    # without friction there is no cycle; else what the describing function says
    if sampled.fs == 0:
        theory.update(exists=False, by="exact", reason="the valve has no friction")
        return False, False, theory
    if waves and S > 0:
        theory["describing_function"] = intersections(sampled, stiction(S, J))
    else:
        theory["describing_function"] = []

    # the exact cycle, and which offsets of OP start it
    cycle = exact_cycle(sampled)
    theory.update(exists=cycle is not None, by="exact", reason=_reason(sampled, cycle))
    if cycle is not None:
        theory.update(
            {k: getattr(cycle, k) for k in ("period", "amplitude", "multiplier", "irregularity")}
        )
        if kick:
            least = theory["kick_min"] = kick_min(sampled, cycle)
            if least is None:
                says = []
            else:
                says = [kicks_text(sampled, cycle, least)]
            theory["reason"] = "; ".join(filter(None, [theory["reason"]] + says))

    # Table 11.3 knows P and PI alone
    if sampled.kd > 0.0:
        theory["reason"] = "; ".join(filter(None, [_NO_CELL, theory["reason"]]))
        return None, None, theory
    return table_11_3(sampled), refined(sampled, cycle), theory


def _without_mapping(setup: Setup, theory: dict[str, Any]) -> None:
    # a single valve that no (S, J) describes still has a describing function
    if len(setup.valves) != 1:
        return
    part = setup.loop.valve
    try:
        if part.name == "deadzone":
            valve = deadzone(setup.valves[0][1].D)
        else:
            valve = measured(part.name, part.parameters, centre=setup.op0)
        found = intersections(reduced(setup, 0.0, 0.0), valve)
    except (
        ParameterError
    ) as error:  # what the exact cycle does not describe, the describing function does not either
        theory["reason"] += "; " + str(error).removeprefix("theory: ")
        return
    theory["describing_function"] = found
    theory.update(exists=any(f.stable for f in found), by="describing function")
    for best in [f for f in found if f.stable][:1]:
        theory.update(period=best.period, amplitude=best.amplitude)


def _reason(loop: SampledLoop, cycle: ExactCycle | None) -> str:
    # Why there is none, or what is special about it
    place = cell(loop)
    assert place is not None
    said = []
    if cycle is None:
        said.append(
            "no cycle keeps itself going"
            + (f": {CONDITIONS[place]}" if place in CONDITIONS else "")
        )
    else:
        if place in CONDITIONS and not TABLE_11_3[place]:
            said.append(f"the table is too coarse here: {CONDITIONS[place]}")
        if max(abs(cycle.state[1][0]), cycle.amplitude) >= 0.98 * min(loop.hi, -loop.lo):
            said.append("OP reaches its limits in the cycle")
        if loop.misfit > _MISFIT:
            said.append(
                "the valve moves otherwise than its (S, J): period and amplitude are those of the"
                " nearest (S, J) map"
            )
        if cycle.irregularity > 0.01:
            said.append(
                f"half periods vary by {100 * cycle.irregularity:.0f} % (switching between samples)"
            )
    return "; ".join(said)
