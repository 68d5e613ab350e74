"""Complete a loop file that omits plant, controller or sampling: identify the missing parts from
the record.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from simbench.detectors.record import LoopRecord
from simbench.gap.candidates import meaningful
from simbench.gap.intake.identify import identify
from simbench.loop.effects import EFFECTS
from simbench.scenarios.errors import SpecError
from simbench.scenarios.plant import CONTROLLER_TYPES, PLANT_TYPES
from simbench.scenarios.spec import Loop
from simbench.scenarios.toml import read_loop

_NEEDED = ("plant", "controller", "sampling")


@dataclass(frozen=True)
class Partial:
    """A baseline that is not whole."""

    loop: Loop  # placeholders take the place of what is missing
    # sections, of plant, controller and sampling, that the record must give; never both plant and
    # controller
    missing: frozenset[str]


def read_baseline(path: str | Path) -> Loop | Partial:
    """Read a loop file in which [plant] or [controller], and [sampling], may be missing."""
    table = read_loop(path)
    missing = frozenset(_NEEDED) - set(table)
    if not missing:
        return Loop.from_table(table, str(path))
    # what is stated must be right by itself before the rest is looked for
    loop = Loop.from_table(_stand_ins(table) | table, str(path))
    if {"plant", "controller"} <= missing:
        raise SpecError(
            f"{path}: has neither [plant] nor [controller]; with --identify no loop file is needed"
        )
    return Partial(loop, missing)


def _stand_ins(table: dict) -> dict:
    """Return sections that agree with whatever the table holds."""
    # Which sign agrees with what is stated
    stated = []
    for x in (table.get("plant"), table.get("controller")):
        if isinstance(x, dict):
            stated.append(x)
    falls = any(
        x.get("direction") == "direct" or (isinstance(x.get("K"), (int, float)) and x["K"] < 0)
        for x in stated
    )
    direction = "direct" if falls else "reverse"

    # Sections of that sign
    return {
        "plant": {"type": "foptd", "K": -1.0 if falls else 1.0, "T": 1.0},
        "controller": {"type": "PI", "Kc": 1.0, "Ti": 1.0, "direction": direction},
        "sampling": {"Ts": 1.0},
    }


def complete_baseline(
    record: LoopRecord, baseline: Loop | Partial | None
) -> tuple[Loop, frozenset[str], list[str]]:
    """Return a whole baseline: what is known of it, and from the record what is not.

    >>> from simbench.detectors.example_loop import example_loop
    >>> record = example_loop(noise=0.1)
    >>> sorted(complete_baseline(record, identify(record))[1])
    ['controller', 'plant']
    >>> sorted(complete_baseline(record, None)[1])
    []
    """
    # No loop file, or a whole one
    both = frozenset({"plant", "controller"})
    if baseline is None:
        return identify(record), frozenset(), []
    if isinstance(baseline, Loop):
        kinds = ((baseline.plant.type, PLANT_TYPES), (baseline.controller.type, CONTROLLER_TYPES))
        for kind, known in kinds:
            if kind not in known:
                raise SpecError(
                    f"baseline: {kind!r} is a plug-in, of which no model is fitted; allowed:"
                    f" {', '.join(PLANT_TYPES)}"
                )
        if baseline.plant.dt or baseline.controller.dt:
            raise SpecError(
                "baseline: a part in powers of z, of which no model is fitted; one in s is needed"
            )
        # an inner loop is judged by its record, set point included
        return baseline.model_copy(update={"outer": None}), both, []

    # What is missing is identified with what is known
    known = baseline.loop
    missing = baseline.missing
    identified = identify(
        record,
        None if "plant" in missing else known.plant,
        None if "controller" in missing else known.controller,
    )
    taken = {}
    for name in missing:
        taken[name] = getattr(identified, name)
    if "plant" in missing and "noise" not in known.model_fields_set:
        taken["noise"] = identified.noise
    loop = known.model_copy(update=taken)

    # What was taken from the record, and what can no longer be judged
    notes = []
    for name in _NEEDED:
        if name in missing:
            numbers = _describe_numbers(identified, name)
            notes.append(f"baseline: no [{name}] given, identified from the record{numbers}")
    given = both - missing
    if "plant" in missing:
        by_mv = record.mv is not None
        lost = []
        for e in EFFECTS:
            if not meaningful(e, False, True, by_mv):
                lost.append(e)
        notes.append(
            f"baseline: without a plant to compare with, {', '.join(lost)} cannot be judged"
        )
    if "controller" in missing:
        notes.append("baseline: without a controller to compare with, detuning cannot be judged")
    return loop, given, notes


def _describe_numbers(loop: Loop, section: str) -> str:
    numbers = getattr(loop, section).model_dump(exclude_none=True, exclude={"n", "direction"})
    return ": " + ", ".join(
        f"{k} = {v:.3g}" if isinstance(v, float) else str(v) for k, v in numbers.items()
    )
