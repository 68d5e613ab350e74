"""Effects that SP, OP and PV cannot tell apart, and when: conditions from record and baseline
alone.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from simbench.loop.effects import EFFECTS, Effect

# of the variance of PV's changes that the stated noise must make up for its smoothing to be seen
NOISE_SHOWS = 0.25


@dataclass(frozen=True)
class Circumstances:
    """What of record, baseline and effect decides which effects look alike."""

    # `sp_moves` by more than the noise; `op_jitter` is the median-based standard deviation of OP's
    # changes (%), `J` the slip-jump of the valve in question (%), None where unknown. The slow
    # signal in question is `slow` where it moves PV by less than the noise within T + Td, and a
    # `ramp` where what wanders beside the ramp does: at the input of a self-regulating plant that
    # is a ramp on PV less a constant, which the unknown operating point takes.
    integrating: bool = False
    sp_moves: bool = False
    mv: bool = False
    noise_shows: bool = False
    op_jitter: float = 0.0
    J: float | None = None
    slow: bool = False
    ramp: bool = False


# an effect's file says which groups it is of (ALIKE); a group that is not here holds always
_HOLDS: dict[str, Callable[[str, Circumstances], bool]] = {
    # MV separates a valve's lag, noise smoothed by the filter a sensor's
    "series pole": lambda block, c: (
        not (block == "valve" and c.mv) and not (block == "sensor" and c.noise_shows)
    ),
    "slow": lambda block, c: c.slow and not c.integrating,
    "ramp": lambda block, c: c.ramp and not c.integrating,
    "friction": lambda block, c: c.J is not None and c.op_jitter > c.J and not c.mv,
    "local gain": lambda block, c: not c.sp_moves and not c.mv,
    # only K/T shows
    "gain over time constant": lambda block, c: not c.sp_moves and not c.integrating,
}


def indistinguishable(effect: str, here: Circumstances) -> frozenset[str]:
    """Return the effects that give the same SP, OP and PV (and MV where recorded) as one here,
    itself included.
    """
    if effect in EFFECTS:
        own = _groups_here(EFFECTS[effect], here)
    else:
        own = set()
    return frozenset(
        {effect} | {e for e, other in EFFECTS.items() if own & _groups_here(other, here)}
    )


def _groups_here(effect: Effect, here: Circumstances) -> set[str]:
    groups = set()
    for group in effect.alike:
        if group not in _HOLDS or _HOLDS[group](effect.block, here):
            groups.add(group)
    return groups


def circumstances(
    plant: Mapping[str, Any],
    noise: float,
    sp: np.ndarray | None,
    op: np.ndarray,
    pv: np.ndarray,
    mv: np.ndarray | None,
    effect: str = "none",
    parameters: Mapping[str, Any] | None = None,
) -> Circumstances:
    """Return the circumstances of an effect: `plant` and the std of `noise` as the loop file states
    them, recorded signals.
    """
    # Changes of both signals
    change = np.diff(pv)
    jitter = np.diff(op)

    # The slip jump, where the effect has one
    p = parameters or {}
    known = EFFECTS.get(effect, Effect("", {}, ""))
    if "J" in known.parameters:
        jump = p.get("J")
    else:
        jump = 0.0

    # What decides whether two effects look alike
    return Circumstances(
        integrating=plant.get("type") == "integrating",
        sp_moves=sp is not None and bool(np.ptp(sp) > 2 * noise),
        mv=mv is not None,
        noise_shows=bool(2 * noise**2 >= NOISE_SHOWS * change.var()) and noise > 0,
        op_jitter=float(1.4826 * np.median(np.abs(jitter - np.median(jitter)))),
        J=float(jump) if "friction" in known.alike and jump is not None else None,
        **_pace_of_load(known, p, plant, noise),
    )


def _pace_of_load(
    effect: Effect, p: Mapping[str, Any], plant: Mapping[str, Any], noise: float
) -> dict[str, bool]:
    # Only loads that may be slow have a pace
    if not {"slow", "ramp"} & set(effect.alike) or plant.get("K") is None or plant.get("T") is None:
        return {}
    if effect.block == "disturbance":
        gain = abs(float(plant["K"]))
    else:
        gain = 1.0

    # A step is slow where it is smaller than the noise
    if "size" in effect.parameters:
        return {"slow": "size" in p and gain * abs(float(p["size"])) < noise}

    # A ramp or a walk by how far it goes while the plant answers
    pace = float(plant["T"]) + float(plant.get("Td", 0.0))
    rate = abs(float(p.get("rate", 0.0)))
    walked = abs(float(p.get("walk", 0.0))) * pace**0.5
    return {
        "slow": gain * (rate * pace + walked) < noise,
        "ramp": rate != 0.0 and gain * walked < noise,
    }
