"""Test an independent plant simulator against its contract: reproducible draws, known effect names,
readable baselines, loops that can be simulated again.
"""

import json
from collections.abc import Iterator
from types import ModuleType
from typing import Any

import numpy as np

from simbench.blind.world import WORLD_EFFECTS, WORLDS
from simbench.detectors.contract.detector import Contract
from simbench.detectors.contract.watch import call_guarded
from simbench.loop.effects import BLOCKS, NONE, UNKNOWN
from simbench.scenarios.spec import Loop

_SEED, _INDEX = 5, 3
_RECORD_COLUMNS = ("t", "sp", "op", "pv")
_ANSWER = (
    "kind",
    "block",
    "effect",
    "foreign",
    "mv",
    "plant",
    "controller",
    "sp_moves",
    "case",
    "seed",
)
_NOISY = {
    "effect": "noise",
    "parameters": {"factor": 30.0, "std": 0.0},
}  # an effect that acts in every loop


def check_world(name: str) -> Contract:
    """Check an independent simulator of the blind check against its contract.

    >>> check_world("own").broken
    ()
    """
    module = WORLDS.load(name)
    broken, notes = list(_description(module)), []
    entries = [] if broken else _entries(module)
    for entry in entries:
        drawn = call_guarded(lambda entry=entry: module.draw(_SEED, _INDEX, entry))
        asked = " ".join(str(entry[key]) for key in ("kind", "effect") if key in entry)
        if drawn.refusal is not None:
            notes.append(f"does not draw {asked}: {drawn.refusal}")
        faults = drawn.faults or ([] if drawn.refusal else _faults(module, entry, drawn.value))
        broken += [f"draw of {asked}: {fault}" for fault in faults]
    if entries and len(notes) == len(entries):
        broken.append("draws nothing that it is asked for")
    return Contract("world", name, tuple(broken), tuple(notes))


def _description(module: ModuleType) -> Iterator[str]:
    if not str(module.TITLE).strip():
        yield "TITLE is empty"
    if not isinstance(module.FOREIGN, dict) or not module.FOREIGN:
        yield "FOREIGN is no dict of faults that the vocabulary lacks, with the block of each"
        return
    for kind, block in module.FOREIGN.items():
        if kind in WORLD_EFFECTS:
            yield f"foreign fault {kind!r} is an effect of the vocabulary"
        if block not in BLOCKS:
            yield f"foreign fault {kind!r} is of block {block!r}, allowed: {', '.join(BLOCKS)}"


def _entries(module: ModuleType) -> list[dict[str, Any]]:
    foreign = {
        "kind": "foreign",
        "effect": next(iter(module.FOREIGN)),
        "strength": "strong",
        "mv": False,
    }
    single = {
        "kind": "single",
        "effect": "gain_mismatch",
        "strength": "strong",
        "mv": True,
        "plant": "foptd",
    }
    return [{"kind": "none", "mv": False}, single, {"kind": "two", "mv": True}, foreign]


def _faults(module: ModuleType, entry: dict[str, Any], item: Any) -> list[str]:
    """Return what is wrong with what a world drew, and with the loop that it runs again."""
    guarded = call_guarded(
        lambda: [*_signals(item, entry), *_truth(item, entry), *_again(module, entry, item)]
    )
    return (
        guarded.faults + ([str(guarded.refusal)] if guarded.refusal else []) + (guarded.value or [])
    )


def _signals(item: Any, entry: dict[str, Any]) -> Iterator[str]:
    missing = [c for c in _RECORD_COLUMNS if c not in item.columns]
    if missing:
        yield f"columns lack {', '.join(missing)}"
    if ("mv" in item.columns) != entry["mv"]:
        yield f"mv is {'' if 'mv' in item.columns else 'not '}recorded, against what was asked for"
    if len({np.shape(x) for x in item.columns.values()}) > 1:
        yield "columns are not equally long"
    if not all(np.all(np.isfinite(x)) for x in item.columns.values()):
        yield "columns hold numbers that are not finite"
    Loop.from_table(item.baseline, "baseline")


def _truth(item: Any, entry: dict[str, Any]) -> Iterator[str]:
    answer = item.answer
    missing = [key for key in _ANSWER if key not in answer]
    if missing:
        yield f"the answer lacks {', '.join(missing)}"
        return
    wanted = {"none": NONE, "foreign": UNKNOWN, "single": entry.get("effect")}.get(
        entry["kind"], answer["effect"]
    )
    if answer["kind"] != entry["kind"] or answer["effect"] != wanted:
        yield (
            f"the answer says {answer['kind']} {answer['effect']!r}, asked was {entry['kind']}"
            f" {wanted!r}"
        )
    if entry["kind"] == "foreign" and answer["foreign"] != entry["effect"]:
        yield f"the answer's foreign fault is {answer['foreign']!r}, asked was {entry['effect']!r}"
    for effect, table, block in (
        ("effect", "parameters", "block"),
        ("effect2", "parameters2", "block2"),
    ):
        known = WORLD_EFFECTS.get(answer.get(effect, ""))
        if known is None:
            continue
        if not set(answer.get(table, {})) <= set(known.parameters):
            yield (
                f"{table} of {answer[effect]} are {sorted(answer[table])}, known:"
                f" {', '.join(known.parameters)}"
            )
        if answer.get(block) != known.block:
            yield f"{block} of {answer[effect]} is {answer.get(block)!r}, it is {known.block}"


def _again(module: ModuleType, entry: dict[str, Any], item: Any) -> Iterator[str]:
    if entry["kind"] != "single":
        return
    twice = module.draw(_SEED, _INDEX, entry)
    if json.dumps(twice.answer) != json.dumps(item.answer) or not _same(
        twice.columns, item.columns
    ):
        yield "two draws of one seed and index differ"
    # as it comes back from the file of answers
    answer = json.loads(json.dumps(item.answer))
    plain = module.simulate(answer, [], 9)
    if not _same(plain, module.simulate(answer, [], 9)):
        yield "simulate: two runs of one seed differ"
    if np.array_equal(plain["pv"], module.simulate(answer, [_NOISY], 9)["pv"]):
        yield "simulate: noise thirty times as loud changes nothing"
    if module.simulate(answer, [], 9, nominal=True).keys() != item.columns.keys():
        yield "simulate: nominal=True, on the baseline's plant, returns other columns than draw"


def _same(one: dict[str, np.ndarray], other: dict[str, np.ndarray]) -> bool:
    return one.keys() == other.keys() and all(np.array_equal(x, other[c]) for c, x in one.items())
