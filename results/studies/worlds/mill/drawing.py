"""One record with its truth: a healthy loop, the effect asked for, and its size searched until it
is as visible as asked.
"""

from __future__ import annotations

import zlib
from copy import deepcopy
from typing import Any, NamedTuple

import numpy as np

from results.studies.worlds.mill.foreign import KINDS
from results.studies.worlds.mill.loops import baseline, draw_loop, logu
from results.studies.worlds.mill.oracle import (
    BANDS,
    CLOUD,
    TRIALS,
    Cloud,
    cloud,
    ratio,
    strength_of,
)
from results.studies.worlds.mill.rig import Case
from results.studies.worlds.mill.scales import Scales
from results.studies.worlds.mill.sizes import family
from results.studies.worlds.mill.statistics import Record
from simbench.blind.world import WORLD_EFFECTS, Item
from simbench.detectors.errors import ParameterError, UnknownName
from simbench.loop.effects import NONE, UNKNOWN

LOOPS, _VARIANTS = 200, 2  # loops drawn for one entry; directions, periods and seeds tried on each
# effects that these signals cannot tell apart, or nearly: no record holds two of one row
ALIKE = (
    ("valve_lag", "extra_lag", "sensor_lag", "dead_time_mismatch", "time_constant_mismatch"),
    ("drift", "load_drift", "load_steps"),
    ("gain_mismatch", "time_constant_mismatch", "valve_characteristic", "deadzone", "detuning"),
    ("stiction", "deadband", "deadzone", "error_deadband"),
)
_STILL_VISIBLE = 1.3  # least ratio of each of two effects when the other is in the loop already


class _SizedEffect(NamedTuple):
    """An effect of a size that suits."""

    effect: dict[str, Any]
    ratio: float
    records: list[Record]


def draw(seed: int, index: int, entry: dict[str, Any]) -> Item:
    """Draw one record."""
    _check(entry)
    what = f"{entry['kind']} {entry.get('effect', '')} {entry.get('strength', '')}"
    wish = "foptd" if entry.get("effect") == "time_constant_mismatch" else entry.get("plant")
    for attempt in range(LOOPS):
        case = draw_loop(np.random.default_rng([seed, index, attempt]), wish)
        names = _names(entry, seed, index, attempt)
        for variant in range(_VARIANTS):
            rng = np.random.default_rng([seed, index, attempt, variant, zlib.crc32(what.encode())])
            item = _try(deepcopy(case), entry, names, rng)
            if item is not None:
                return item
    raise ParameterError(
        f"{LOOPS} drawn loops cannot hold the entry {what.strip()!r} (seed {seed}, index {index})"
    )


def sound(case: Case, record: Record, limits: tuple[float, float] = (0.0, 100.0)) -> bool:
    """Say whether a record is one that a plant would show: OP seldom at its limits, PV in reach of
    SP, both moving.
    """
    op, pv = record["op"], record["pv"]
    if not (np.all(np.isfinite(pv)) and np.all(np.isfinite(op))):
        return False
    full = ((op <= 1e-6) & (limits[0] <= 0.0)) | ((op >= 100.0 - 1e-6) & (limits[1] >= 100.0))
    moves = np.count_nonzero(np.diff(op)), np.count_nonzero(np.diff(pv))
    near = np.quantile(np.abs(record["sp"] - pv), 0.995) < 0.4 * case["span"]
    return bool(np.mean(full) <= 0.01 and min(moves) >= 20 and near and np.ptp(op) > 0.1)


def _check(entry: dict[str, Any]) -> None:
    kind = entry.get("kind")
    if kind not in ("none", "single", "two", "foreign"):
        raise UnknownName("kind", str(kind), ["none", "single", "two", "foreign"], "entry")
    if kind in ("single", "foreign"):
        known = WORLD_EFFECTS if kind == "single" else KINDS
        if entry.get("effect") not in known:
            raise UnknownName("effect", str(entry.get("effect")), known, f"entry of kind {kind!r}")
        if entry.get("strength") not in BANDS:
            raise UnknownName("strength", str(entry.get("strength")), BANDS, "entry")
    if entry.get("plant") not in (None, "foptd", "integrating"):
        raise UnknownName("plant", str(entry["plant"]), ["foptd", "integrating"], "entry")
    if entry.get("effect") == "time_constant_mismatch" and entry.get("plant") == "integrating":
        raise ParameterError(
            "effect 'time_constant_mismatch' on an integrating plant; it needs a foptd plant"
        )


def _names(entry: dict[str, Any], seed: int, index: int, attempt: int) -> list[str]:
    """The effects asked for; a pair is tried on ten loops before another is drawn, or easy pairs
    would crowd out the rest.
    """
    if entry["kind"] == "two":
        return _pair(np.random.default_rng([seed, index, attempt // 10]))
    return [entry["effect"]] if entry["kind"] != "none" else []


def _try(
    case: Case, entry: dict[str, Any], names: list[str], rng: np.random.Generator
) -> Item | None:
    """The entry in this very loop, or None where it cannot be had."""
    kind = entry["kind"]
    for effect in names:
        _believed(case, effect)
    seeds = [int(x) for x in rng.integers(2**31, size=TRIALS + CLOUD)]
    healthy = cloud(case, [], seeds[TRIALS:])
    if not all(sound(case, r) for r in healthy.records):
        return None
    if kind == "none":
        _, records = ratio(case, [], seeds[:1], healthy)
        return (
            _item(case, entry, [], 1.0, records[0], seeds[0]) if sound(case, records[0]) else None
        )
    scales = Scales.of(case, healthy.records)
    bands = [(2.0, 12.0)] * 2 if kind == "two" else [BANDS[entry["strength"]]]
    try:
        sized = []
        for effect, band in zip(names, bands):
            target = logu(rng, band[0] * 1.05, min(band[1] * 0.95, 7.0))
            sized.append(_search(case, effect, rng, scales, healthy, band, target, seeds[:TRIALS]))
            if sized[-1] is None:
                return None
    except ParameterError:
        return None
    if kind == "two":
        return _both(case, entry, sized, seeds)
    return _item(case, entry, sized, sized[0].ratio, sized[0].records[0], seeds[0])


def _believed(case: Case, effect: str) -> None:
    """Take out of a loop what would blur the meaning of an effect's number; the baseline stays, but
    for a known dead-band.
    """
    plant, nominal = case["plant"], case["nominal"]
    if effect == "gain_mismatch":
        plant["K"] = nominal["K"]
    if effect in ("time_constant_mismatch", "dead_time_mismatch", "extra_lag"):
        case["plant"] = {**nominal, "K": plant["K"], "lags": []}
    block = WORLD_EFFECTS[effect].block if effect in WORLD_EFFECTS else KINDS[effect].block
    if block == "valve":
        case["known_band"] = 0.0


def _search(
    case: Case,
    effect: str,
    rng: np.random.Generator,
    scales: Scales,
    healthy: Cloud,
    band: tuple,
    target: float,
    seeds: list[int],
) -> _SizedEffect | None:
    """Bisect the logarithm of an effect's size until its ratio is within a tenth of the target, or
    at least within the band.
    """
    sizes = family(effect, rng, scales)
    lowest, highest = np.log(sizes.low), np.log(sizes.high)
    low, high, best = lowest, highest, None
    for step in range(9):
        at = 0.5 * (low + high)
        # always too large, or always too small: is there room at all?
        if step == 3 and best is None:
            at = lowest if low == lowest else highest if high == highest else at
        sized, good = _sized(case, effect, sizes.at(float(np.exp(at))), seeds, healthy)
        if good and band[0] <= sized.ratio < band[1]:
            if best is None or abs(np.log(sized.ratio / target)) < abs(np.log(best.ratio / target)):
                best = sized
            if abs(np.log(sized.ratio / target)) < 0.1:
                break
        if not good or sized.ratio > target:
            high = at
        else:
            low = at
        if high - low < 1e-3:
            break
    return best


def _sized(
    case: Case, effect: str, parameters: dict[str, Any], seeds: list[int], healthy: Cloud
) -> tuple[_SizedEffect, bool]:
    """An effect of a size, how visible it is, and whether its records are sound."""
    given = {"effect": effect, "parameters": parameters}
    value, records = ratio(case, [given], seeds, healthy)
    return _SizedEffect(given, value, records), all(
        sound(case, r, _limits([given])) for r in records
    )


def _limits(effects: list[dict[str, Any]]) -> tuple[float, float]:
    """The limits of OP that effects set."""
    given = [e["parameters"] for e in effects if e["effect"] == "saturation"]
    return (given[0]["lo"], given[0]["hi"]) if given else (0.0, 100.0)


def _both(
    case: Case, entry: dict[str, Any], sized: list[_SizedEffect], seeds: list[int]
) -> Item | None:
    """Two effects in one loop, each still visible with the other."""
    effects = [f.effect for f in sized]
    for other in effects:
        value, records = ratio(case, effects, seeds[:TRIALS], cloud(case, [other], seeds[TRIALS:]))
        if value < _STILL_VISIBLE or not all(sound(case, r, _limits(effects)) for r in records):
            return None
    sized = sorted(sized, key=lambda f: -f.ratio)
    return _item(case, entry, sized, sized[1].ratio, records[0], seeds[0])


def _pair(rng: np.random.Generator) -> list[str]:
    """Two effects of different blocks that are not alike."""
    while True:
        one, two = (str(e) for e in rng.choice(list(WORLD_EFFECTS), 2, replace=False))
        alike = any(one in row and two in row for row in ALIKE)
        if WORLD_EFFECTS[one].block != WORLD_EFFECTS[two].block and not alike:
            return [one, two]


def _item(
    case: Case,
    entry: dict[str, Any],
    sized: list[_SizedEffect],
    value: float,
    record: Record,
    seed: int,
) -> Item:
    kind, mv = entry["kind"], bool(entry.get("mv", False))
    one, two = (*(f.effect for f in sized), None, None)[:2]
    foreign = one["effect"] if kind == "foreign" and one else ""
    answer = {
        "kind": kind,
        "block": NONE
        if one is None
        else KINDS[foreign].block
        if foreign
        else WORLD_EFFECTS[one["effect"]].block,
        "effect": NONE if one is None else UNKNOWN if foreign else one["effect"],
        "effect2": two["effect"] if two else "",
        "block2": WORLD_EFFECTS[two["effect"]].block if two else "",
        "strength": entry["strength"]
        if kind in ("single", "foreign")
        else strength_of(value)
        if sized
        else "",
        "ratio": round(value, 4),
        "parameters": one["parameters"] if one else {},
        "parameters2": two["parameters"] if two else {},
        "foreign": foreign,
        "mv": mv,
        "plant": case["plant"]["type"],
        "controller": "P" if case["controller"]["product"] == "bias_p" else "PI",
        "sp_moves": case["setpoint"]["kind"] != "constant",
        "case": case,
        "seed": seed,
    }
    columns = {k: v for k, v in record.items() if mv or k != "mv"}
    return Item(columns, baseline(case), answer)
