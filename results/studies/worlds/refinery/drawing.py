"""Draws one labelled record, or runs a drawn loop again."""

from __future__ import annotations

import json

import numpy as np

from results.studies.withheld.world import WORLD_EFFECTS, Item, TestPlan
from results.studies.worlds.refinery import foreign, loops, oracle, search
from results.studies.worlds.refinery.search import Misfit, healthy, prepared
from results.studies.worlds.refinery.simulation import run
from simbench.detectors.errors import ParameterError, UnknownName
from simbench.loop.effects import NONE, UNKNOWN

LOOPS = 200  # loops drawn before an entry is given up
_KEPT = 12  # loops drawn in the same classes before the classes themselves are drawn anew

# effects that no record of SP, OP and PV can tell apart; two of one set are never drawn together
SAME = (
    {"valve_lag", "extra_lag", "sensor_lag"},
    {"drift", "load_drift", "load_steps"},
    {"deadzone", "valve_characteristic", "gain_mismatch"},
    {"dead_time_mismatch", "valve_lag", "extra_lag", "sensor_lag"},
    {"time_constant_mismatch", "valve_lag", "sensor_lag"},
)
_VALVE = frozenset(name for name, e in WORLD_EFFECTS.items() if e.block == "valve")
_EXACT = {"gain_mismatch": "K", "time_constant_mismatch": "T", "dead_time_mismatch": "Td"}
NEEDS_FOPTD = {"time_constant_mismatch", "asymmetric_response", "heat_recycle"}


def _pair(rng: np.random.Generator) -> tuple[str, str]:
    """Two effects of different blocks, each block as likely as the other, that can be distinguished
    apart.
    """
    blocks = sorted({e.block for e in WORLD_EFFECTS.values()})
    while True:
        chosen = rng.choice(len(blocks), 2, replace=False)
        a, b = (
            loops.pick(
                rng, tuple(n for n in sorted(WORLD_EFFECTS) if WORLD_EFFECTS[n].block == blocks[i])
            )
            for i in chosen
        )
        if not any(a in s and b in s for s in SAME):
            return a, b


def _names(entry: dict, rng: np.random.Generator) -> tuple[str, ...]:
    kind = entry.get("kind")
    if kind == "none":
        return ()
    if kind == "two":
        return _pair(rng)
    known = {"single": WORLD_EFFECTS, "foreign": foreign.EVERY}.get(str(kind))
    if known is None:
        raise ParameterError(
            f"entry: kind = {kind!r} is unknown; allowed: none, single, two, foreign"
        )
    if entry.get("effect") not in known:
        raise UnknownName(f"{kind} effect", str(entry.get("effect")), known)
    if entry.get("strength") not in oracle.BANDS:
        raise ParameterError(
            f"entry: strength = {entry.get('strength')!r}; allowed: {', '.join(oracle.BANDS)}"
        )
    return (entry["effect"],)


def _answer(entry: dict, case: dict, effects: list[dict], ratio: float, seed: int) -> dict:
    ids = [item["effect"] for item in effects]
    kind = entry["kind"]
    block = [WORLD_EFFECTS[i].block if i in WORLD_EFFECTS else foreign.EVERY[i] for i in ids]
    strength = (
        next((s for s, (low, high) in oracle.BANDS.items() if low <= ratio <= high), "")
        if effects
        else ""
    )
    answer = {
        "kind": kind,
        "block": block[0] if effects else NONE,
        "effect": NONE if not effects else (UNKNOWN if kind == "foreign" else ids[0]),
        "effect2": ids[1] if len(ids) > 1 else "",
        "block2": block[1] if len(ids) > 1 else "",
        "strength": entry.get("strength", strength),
        "ratio": float(ratio),
        "parameters": effects[0]["parameters"] if effects else {},
        "parameters2": effects[1]["parameters"] if len(ids) > 1 else {},
        "foreign": ids[0] if kind == "foreign" else "",
        "mv": case["mv"],
        "plant": case["plant"]["type"],
        "controller": case["controller"]["type"],
        "sp_moves": case["setpoint"]["kind"] != "constant",
        "case": case,
        "seed": seed,
    }
    # one trip through JSON: what a file gives back is what was drawn
    return json.loads(json.dumps(answer))


def _try(
    entry: dict,
    names: tuple[str, ...],
    classes: dict,
    rng: np.random.Generator,
    habits: loops.Habits,
) -> Item:
    case = loops.draw_case(
        rng,
        classes,
        frozenset(_EXACT[n] for n in names if n in _EXACT),
        any(n in _VALVE for n in names),
        # nobody states a filter whose lag is what is wrong
        habits._replace(filter_stated=0.0) if "sensor_lag" in names else habits,
    )
    if case is None:
        raise Misfit
    case["mv"] = bool(entry.get("mv", False))
    seeds = rng.integers(2**31, size=search.CLOUD + search.SHOWN)
    drawn, ratio = [], 1.0
    if len(names) == 1:
        drawn, ratio = search.one(names[0], oracle.BANDS[entry["strength"]], case, seeds, rng)
    elif names:
        drawn, ratio = search.two((names[0], names[1]), case, seeds, rng)
    else:
        # the same sieve as for a loop with an effect: a dozen runs that all behave
        search.Bench(case, [], seeds)
    answer = _answer(entry, case, drawn, ratio, int(seeds[search.CLOUD]))
    record = run(prepared(answer["case"], drawn), answer["case"], answer["seed"])
    if not healthy(record, case, drawn):
        raise Misfit
    return Item(_recorded(record, case), answer["case"]["baseline"], answer)


def _recorded(record: dict[str, np.ndarray], case: dict) -> dict[str, np.ndarray]:
    return {name: x for name, x in record.items() if name != "mv" or case["mv"]}


def draw(seed: int, index: int, entry: dict, habits: loops.Habits = loops.REFINERY) -> Item:
    """Draw one labelled record of a loop as a site's habits have it."""
    names = _names(entry, np.random.default_rng([seed, index, 1]))
    wish = "foptd" if NEEDS_FOPTD & set(names) else entry.get("plant")
    # the classes come from seed and index alone: the same whatever the entry asks for
    lottery = np.random.default_rng([seed, index, 2])
    for attempt in range(LOOPS):
        if attempt % _KEPT == 0:
            classes = loops.draw_classes(lottery, wish, habits)
        try:
            rng = np.random.default_rng([seed, index, 3, attempt])
            return _try(entry, names, classes, rng, habits)
        except Misfit:
            continue
    raise ParameterError(f"entry {entry!r}: none of {LOOPS} drawn loops can hold it")


def simulate(
    answer: dict, effects: list[dict], seed: int, nominal: bool = False
) -> dict[str, np.ndarray]:
    """Run the loop of a drawn record again: other load and noise, the same statistics and set
    point.

    >>> item = draw(1, 0, {"kind": "none"})
    >>> again = simulate(item.answer, [], item.answer["seed"])
    >>> all((again[name] == item.columns[name]).all() for name in again)
    True
    """
    case = answer["case"]
    return _recorded(run(prepared(case, effects, nominal), case, seed), case)


def test(answer: dict, effects: list[dict], seed: int, plan: TestPlan) -> dict[str, np.ndarray]:
    """Run a test of the menu on the loop of a drawn record: columns as recorded, mode and lab where
    the plan has them.
    """
    case, r = dict(answer["case"]), plan.faster
    steady = {"kind": "constant", "value": case["setpoint"]["value"]}
    case |= {"n": plan.n, "Ts": case["Ts"] / r, "warm": case["warm"] * r, "setpoint": steady}
    case["archive"] = case["archive"] | {"lost": 0.0}
    setup = prepared(case, effects)
    scan = setup.controller
    # the law keeps its scan
    setup.controller = scan._replace(Kc=scan.Kc * plan.Kc_ratio, Ti=scan.Ti / r)
    columns = run(setup, case, seed, plan)
    return {name: x for name, x in columns.items() if name != "mv" or case["mv"] or plan.mv}
