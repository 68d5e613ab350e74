"""Effects that SP, OP and PV cannot tell apart, and when: conditions computed from the configuration alone."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from simbench.loop.effects import EFFECTS

LAGS = frozenset({"valve_lag", "extra_lag", "sensor_lag"})
SLOW = frozenset({"drift", "load_drift", "load_steps"})
RAMPS = frozenset({"drift", "load_drift"})
FRICTION = frozenset({"stiction", "deadband"})
LOCAL_GAIN = frozenset({"deadzone", "valve_characteristic", "gain_mismatch"})
GAIN_OR_TIME = frozenset({"gain_mismatch", "time_constant_mismatch"})

NOISE_SHOWS = 0.25
"""Share of the variance of PV's sample-to-sample change that the stated noise must make up for its smoothing to be seen."""


@dataclass(frozen=True)
class Facts:
    """What of the configuration decides which effects look alike.

    Parameters
    ----------
    integrating : bool
        The plant integrates.
    sp_moves : bool
        SP moves by more than the noise within the record.
    mv : bool
        The valve position is recorded.
    noise_shows : bool
        The stated noise makes up at least `NOISE_SHOWS` of the variance of PV's sample-to-sample change.
    op_jitter : float
        Median-based standard deviation of OP's sample-to-sample change (%).
    J : float or None
        Slip-jump of the valve in question (%); None = unknown, which never counts as alike.
    slow : bool
        The slow signal in question moves PV by less than the noise within one open-loop settling time scale T + Td.
    ramp : bool
        The slow signal in question is a ramp: what wanders beside it stays below the noise within T + Td. A ramp at the input
        of a self-regulating plant is a ramp on PV less a constant, which the unknown operating point takes.
    """

    integrating: bool
    sp_moves: bool
    mv: bool
    noise_shows: bool = False
    op_jitter: float = 0.0
    J: float | None = None
    slow: bool = False
    ramp: bool = False


def indistinguishable(effect: str, facts: Facts) -> frozenset[str]:
    """Return the effects that give the same SP, OP and PV (and MV where recorded) as `effect` here, itself included.

    The groups: one more series pole (MV separates a valve's lag; noise smoothed by the filter a sensor's); slow loads and
    sensor drift, and ramps of any size of either, on a self-regulating plant; stiction and dead-band when OP jitters by more
    than J and MV is not recorded;
    dead-zone, valve characteristic and gain while SP stands still and MV is not recorded; gain and time constant while SP
    stands still on a self-regulating plant (only K/T shows).

    Parameters
    ----------
    effect : str
        An effect id; anything else (`none`, `unknown`) is alone.
    facts : Facts

    Returns
    -------
    frozenset of str

    Examples
    --------
    >>> facts = Facts(integrating=False, sp_moves=False, mv=True)
    >>> sorted(indistinguishable("extra_lag", facts))
    ['extra_lag', 'sensor_lag']
    >>> sorted(indistinguishable("noise", facts))
    ['noise']
    """
    alike = {effect}
    for group in _groups(facts):
        if effect in group:
            alike |= group
    return frozenset(alike)


def _groups(facts: Facts) -> list[frozenset[str]]:
    groups = [LAGS - ({"valve_lag"} if facts.mv else set()) - ({"sensor_lag"} if facts.noise_shows else set())]
    if facts.slow and not facts.integrating:
        groups.append(SLOW)
    if facts.ramp and not facts.integrating:
        groups.append(RAMPS)
    if facts.J is not None and facts.op_jitter > facts.J and not facts.mv:
        groups.append(FRICTION)
    if not facts.sp_moves and not facts.mv:
        groups.append(LOCAL_GAIN)
    if not facts.sp_moves and not facts.integrating:
        groups.append(GAIN_OR_TIME)
    return groups


def facts_of(
    baseline: Mapping[str, Any],
    sp: np.ndarray | None,
    op: np.ndarray,
    pv: np.ndarray,
    mv: np.ndarray | None,
    effect: str = "none",
    parameters: Mapping[str, Any] | None = None,
) -> Facts:
    """Compute the facts from a baseline's tables, the recorded signals and the effect in question.

    Parameters
    ----------
    baseline : mapping
        Tables of the loop file: [plant] type, K, T, Td and [noise] std are used; what it lacks makes no group.
    sp, op, pv, mv : ndarray, shape (n,)
        Recorded signals; PV and SP in PV units, OP and MV in %. None = not recorded.
    effect : str
        Effect id whose partners are asked for.
    parameters : mapping, optional
        Its parameters (`simbench.loop.effects`), true or fitted.

    Returns
    -------
    Facts

    Examples
    --------
    >>> x = np.random.default_rng(0).standard_normal(500)
    >>> table = {"plant": {"type": "foptd", "K": 1.0, "T": 10.0, "Td": 2.0}, "noise": {"std": 1.0}}
    >>> facts_of(table, np.zeros(500), 50 + x, x, None, "stiction", {"S": 3, "J": 0.5}).noise_shows
    True
    """
    plant, p = baseline.get("plant", {}), dict(parameters or {})
    noise = float(baseline.get("noise", {}).get("std", 0.0))
    change, jitter = np.diff(pv), np.diff(op)
    J: float | None = None
    if effect == "deadband":
        J = 0.0
    elif effect == "stiction" and "J" in p:
        J = float(p["J"])
    return Facts(
        integrating=plant.get("type") == "integrating",
        sp_moves=sp is not None and bool(np.ptp(sp) > 2 * noise),
        mv=mv is not None,
        noise_shows=bool(2 * noise**2 >= NOISE_SHOWS * change.var()) and noise > 0,
        op_jitter=float(1.4826 * np.median(np.abs(jitter - np.median(jitter)))),
        J=J,
        slow=_slow(effect, p, plant, noise),
        ramp=effect in RAMPS and float(p.get("rate", 0.0)) != 0.0 and _slow(effect, {**p, "rate": 0.0}, plant, noise),
    )


def _slow(effect: str, p: dict[str, Any], plant: Mapping[str, Any], noise: float) -> bool:
    if effect not in SLOW or plant.get("type") == "integrating" or not {"K", "T"} <= set(plant):
        return False
    per_load = abs(float(plant["K"])) if EFFECTS[effect].block == "disturbance" else 1.0
    if effect == "load_steps":
        return "size" in p and per_load * abs(float(p["size"])) < noise
    pace = float(plant["T"]) + float(plant.get("Td", 0.0))
    moved = abs(float(p.get("rate", 0.0))) * pace + abs(float(p.get("walk", 0.0))) * pace**0.5
    return per_load * moved < noise
