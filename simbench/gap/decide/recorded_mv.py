"""What a recorded valve position (MV) shows of the effects of a valve, and the plant's input that
follows from it.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from simbench.detectors.signal.lattice import written_unit
from simbench.gap.effects import Parameters, is_friction, recogniser
from simbench.gap.likelihood.model import Data
from simbench.gap.likelihood.valve_map import MapFit, MapSearch, positioner, share_of
from simbench.gap.situation import Situation, through_valve
from simbench.gap.thresholds import BY_MV, MV_LEFT, MV_LEFT_BY_FRICTION
from simbench.loop.effects import EFFECTS

_EARLY = 0.1  # of a sample, by which MV must be logged early before its time is believed
_DIGITS = 6  # decimals of MV (%) that are read
_LEFT = 0.15  # % of MV that no map need explain ...
_LEFT_OF_OP = 0.03  # ... or this share of OP's standard deviation, where that is more
_STEPS = 3.0  # of MV's digits, or of its noise, that a band spans at least
_NORMAL = 0.6745  # median of a standard normal's size


Maps = dict[str, tuple[float, Parameters]]


def valve_maps(s: Situation) -> tuple[Maps, bool]:
    """Return what MV shows of every valve effect, and whether it strays as none of them makes it;
    nothing where it was not recorded.
    """
    if s.record.mv is None:
        return {}, False

    # what the baseline's valve makes of OP; a positioner that overshoots is no fault, and needs no
    # band for what it does
    op = s.op
    mv = np.asarray(s.record.mv)
    expected = np.clip(through_valve(op, s.baseline, s.record.Ts), 0.0, 100.0)
    search = MapSearch(op, mv, s.record.Ts, expected, s.expected_band, s.data.late)
    overshoots = positioner(search)
    if overshoots is not None:
        search.healthy -= overshoots[0]

    # how far every effect explains MV better than a healthy valve
    least = least_band(mv)
    maps: Maps = {}
    for effect in EFFECTS:
        by_mv = recogniser(effect).by_mv
        if by_mv is not None:
            gain, numbers = _drop_narrow(effect, by_mv(search), least)
            maps[effect] = (0.0 + gain, numbers)

    # MV strays where even the best map leaves more than any of these allows; friction is only known
    # up to its model, the other maps are exact
    winner = max(maps, key=lambda e: maps[e][0])
    healthy = float(np.exp(search.healthy / op.size))
    left = healthy * float(np.exp(-max(maps[winner][0], 0.0) / op.size))
    allowed = (MV_LEFT_BY_FRICTION if is_friction(winner) else MV_LEFT) * healthy
    least_left = max(_LEFT, _LEFT_OF_OP * float(np.std(op)))
    return maps, bool(left > max(allowed, least_left))


def _drop_narrow(effect: str, found: MapFit, least: float) -> MapFit:
    """Return a map without its evidence where its band (%) is none: narrower than MV tells."""
    band = recogniser(effect).band
    gain, p = found
    if band is not None and band(p) < least:
        return (min(gain, 0.0), p)
    return found


def least_band(mv: np.ndarray) -> float:
    """Return the narrowest band (%) that MV (n,) tells: three steps of its digits, or three
    standard deviations of its noise.
    """
    return _STEPS * max(written_unit(mv), noise_of(mv))


def noise_of(mv: np.ndarray) -> float:
    """Return the standard deviation of MV's noise (%), by its second differences (n,)."""
    return float(np.median(np.abs(np.diff(mv, 2)))) / (_NORMAL * np.sqrt(6.0))


def by_stem(s: Situation, maps: Maps) -> Data:
    """Return a record's data with MV for OP: as the identified valve makes it, or as logged where
    that differs beyond its digits; with OP where no MV was recorded.
    """
    mv = s.record.mv
    if mv is None or not maps:
        return s.data

    # what the likeliest valve makes of OP
    winner = max(maps, key=lambda e: maps[e][0])
    sound = maps[winner][0] <= BY_MV
    if sound:
        effect = None
    else:
        effect = {"name": winner, **maps[winner][1]}
    made = through_valve(s.op, s.baseline, s.record.Ts, effect)

    # how far MV may be from it: the step of its digits
    steps = np.diff(np.unique(np.round(mv, _DIGITS)))
    if steps.size:
        digit = float(steps.min())
    else:
        digit = 0.0
    low = made - digit
    high = made + digit

    # between the last sample and this one only the time at which MV was logged differs
    last = np.append(made[0], made[:-1])
    if share_of(mv - made, last - made) > _EARLY:
        low = np.minimum(low, last - digit)
        high = np.maximum(high, last + digit)
    made = np.where((low <= mv) & (mv <= high), made, mv)
    return replace(s.data, u=np.ascontiguousarray(made))


def by_op(s: Situation) -> Situation:
    """Return a record with what the baseline's valve makes of OP as the plant's input, whatever MV
    was recorded.
    """
    u = np.ascontiguousarray(through_valve(s.op, s.baseline, s.record.Ts))
    return replace(s, data=replace(s.data, u=u))
