"""Make one record of the blind test: draw loops until one can have the wanted fault at the wanted
strength.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from results.studies.withheld.distance import RESOLVABLE, cloud
from results.studies.withheld.world import WORLD_EFFECTS
from results.studies.worlds.own import drawing, faults, loops, oracle, sizes
from results.studies.worlds.own.loops import Fault, Signals, TrueLoop
from simbench.detectors.errors import ParameterError
from simbench.loop.effects import NONE, UNKNOWN

_LOOPS_TO_TRY = 200
# effects that are one signal: never drawn together
_SAME = ({"valve_lag", "extra_lag", "sensor_lag"}, {"drift", "load_drift", "load_steps"})
_TWO_BAND = (2.2, 6.0)  # ratio of each of two effects alone


@dataclass(frozen=True)
class DrawnRecord:
    """One finished record with its answer."""

    case: TrueLoop
    signals: Signals
    answer: dict[str, Any]


def draw_item(seed: int, index: int, entry: dict[str, Any]) -> DrawnRecord:
    """Draw loops until one can hold what the entry asks for."""
    rng = np.random.default_rng([seed, index])
    build: Callable[..., DrawnRecord | None] = {"none": _none, "two": _two}.get(entry["kind"], _one)
    effect = entry.get("effect", "")
    moves = True if effect in faults.NEEDS_SP_STEPS else None
    for i in range(_LOOPS_TO_TRY):
        # rather the other plant than no record
        wish = entry.get("plant") if i < _LOOPS_TO_TRY // 2 else None
        case = drawing.draw(
            rng, plant=faults.NEEDS_PLANT.get(effect, wish), mv=entry["mv"], sp_moves=moves
        )
        item = build(case, int(rng.integers(2**31)), entry, rng)
        if item is not None:
            return item
    raise ParameterError(f"withheld: no loop found that holds {entry} within {_LOOPS_TO_TRY} tries")


def _answer(case: TrueLoop, seed: int, **more: Any) -> dict[str, Any]:
    about = {key: getattr(case, key) for key in ("mv", "plant", "controller", "sp_moves")}
    return (
        dict.fromkeys(("effect2", "block2", "foreign"), "")
        | about
        | {"case": case.to_dict(), "seed": seed}
        | more
    )


def _named(case: TrueLoop, names: tuple[str, ...]) -> TrueLoop:
    """Return the case as the named faults need it: no known dead-band with another valve fault,
    mismatches exact.
    """
    blocks = {
        faults.FOREIGN[name] if name in faults.FOREIGN else WORLD_EFFECTS[name].block
        for name in names
    }
    if "valve" in blocks:
        case = replace(case, play=0.0)
    exact = (case.K, case.T, case.Td - case.Ts * case.log_is_late)
    wrong = ("gain_mismatch", "time_constant_mismatch", "dead_time_mismatch")
    nominal = tuple(
        true if name in names else off
        for name, true, off in zip(wrong, exact, case.nominal, strict=True)
    )
    return replace(case, nominal=nominal)


def _none(
    case: TrueLoop, seed: int, entry: dict[str, Any], rng: np.random.Generator
) -> DrawnRecord | None:
    ratio = oracle.ratio(case, seed, (), oracle.reference(case, seed).cloud)
    if ratio is None:
        return None
    answer = _answer(
        case,
        seed,
        kind="none",
        block=NONE,
        effect=NONE,
        strength="none",
        ratio=round(ratio.expected, 3),
    )
    return DrawnRecord(case, loops.simulate(case, seed), answer)


def _one(
    case: TrueLoop, seed: int, entry: dict[str, Any], rng: np.random.Generator
) -> DrawnRecord | None:
    name, foreign = entry["effect"], entry["kind"] == "foreign"
    case = _named(case, (name,))
    strength = _sized(
        case, seed, name, oracle.STRENGTHS[entry["strength"]], oracle.reference(case, seed), rng
    )
    if strength is None:
        return None
    parameters, ratio = strength
    acts = (faults.fault(name, parameters),)
    signals = loops.simulate(case, seed, acts)
    if foreign:
        known = {"block": faults.FOREIGN[name], "effect": UNKNOWN, "foreign": name}
    else:
        known = {
            "block": WORLD_EFFECTS[name].block,
            "effect": name,
            **_shrinkage(case, seed, signals, acts),
        }
    about = {
        "kind": entry["kind"],
        "strength": entry["strength"],
        "ratio": round(ratio.expected, 3),
        "parameters": parameters,
    }
    return DrawnRecord(case, signals, _answer(case, seed, **about, **known))


def _two(
    case: TrueLoop, seed: int, entry: dict[str, Any], rng: np.random.Generator
) -> DrawnRecord | None:
    known = [e for e in faults.KNOWN if e != "time_constant_mismatch" or case.plant == "foptd"]
    names = tuple(str(x) for x in rng.choice(known, 2, replace=False))
    if WORLD_EFFECTS[names[0]].block == WORLD_EFFECTS[names[1]].block or any(
        set(names) <= group for group in _SAME
    ):
        return None
    case = _named(case, names)
    true = oracle.reference(case, seed)
    strengths = [_sized(case, seed, name, _TWO_BAND, true, rng) for name in names]
    if strengths[0] is None or strengths[1] is None:
        return None
    sizes = [strengths[0][0], strengths[1][0]]
    acts = tuple(faults.fault(name, p) for name, p in zip(names, sizes, strict=True))
    both = oracle.ratio(case, seed, acts, true.cloud)
    if both is None or not all(_adds(case, seed, acts, left_out) for left_out in range(2)):
        return None
    signals = loops.simulate(case, seed, acts)
    return DrawnRecord(
        case,
        signals,
        _answer(
            case,
            seed,
            kind="two",
            block=WORLD_EFFECTS[names[0]].block,
            effect=names[0],
            parameters=sizes[0],
            block2=WORLD_EFFECTS[names[1]].block,
            effect2=names[1],
            parameters2=sizes[1],
            strength=oracle.strength_of(both.expected),
            ratio=round(both.expected, 3),
            **_shrinkage(case, seed, signals, acts),
        ),
    )


def _sized(
    case: TrueLoop,
    seed: int,
    name: str,
    band: tuple[float, float],
    true: oracle.Reference,
    rng: np.random.Generator,
) -> tuple[faults.Parameters, oracle.Ratio] | None:
    size = sizes.scale(name, case, true.habit, rng)
    strength = oracle.find_strength(
        lambda x: oracle.ratio(case, seed, (faults.fault(name, size(x)),), true.cloud), band, rng
    )
    return None if strength is None else (size(strength[0]), strength[1])


def _adds(case: TrueLoop, seed: int, acts: tuple[Fault, ...], left_out: int) -> bool:
    """Whether a fault is still visible with the other: one that the other drowns is no second
    effect.
    """
    kept = (acts[1 - left_out],)
    alone = cloud(
        [loops.simulate(case, seed + 500 + i, kept) for i in range(oracle.CLOUD)], case.scale
    )
    ratio = oracle.ratio(case, seed, acts, alone)
    return ratio is not None and ratio.expected >= RESOLVABLE


def _shrinkage(
    case: TrueLoop, seed: int, signals: Signals, acts: tuple[Fault, ...]
) -> dict[str, Any]:
    s = oracle.shrinkage(case, seed, signals, acts)
    about = {
        "gap_before": round(s.before, 4),
        "gap_after": round(s.after, 4),
        "floor": round(s.floor, 4),
    }
    return about | {"shrinkage": "" if s.value is None else round(s.value, 4)}
