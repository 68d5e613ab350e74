"""What the discovery of laws is worth: foreign kinds of every world, records without effect, files through the contract.

`python -m results.studies.discovery` prints the table; the seed is named here, and was before the first answer.
"""

from __future__ import annotations

import sys
import time
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any
from unittest.mock import patch

import numpy as np

from detectors.compiled import one_thread
from detectors.errors import UserError
from detectors.records.io import read_record
from scenarios.spec import Loop, load_loop
from simbench.blind.making import write_item
from simbench.blind.world import WORLDS
from simbench.contract import check_file
from simbench.gap.closed_loop.gap import held_out
from simbench.gap.discover.discovery import discover
from simbench.gap.discover.effect_file import lent_effect, write_effect
from simbench.gap.discover.search import search
from simbench.gap.intake.check import check
from simbench.gap.law import FoundLaw
from simbench.loop.effects import PLUGINS, block_of
from simbench.loop.laws import forms
from simbench.loop.simulate import simulate

SEED, WORLD_NAMES = 3207, ("own", "mill", "refinery")
_LOOP = {
    "plant": {"type": "foptd", "K": 1.2, "T": 20.0, "Td": 4.0}, "controller": {"type": "PI", "Kc": 1.0, "Ti": 20.0},
    "sampling": {"Ts": 1.0, "n": 1600}, "noise": {"std": 0.1},
    "disturbance": [{"type": "coloured", "amplitude": 0.4, "period": 30.0}],
    "setpoint": {"value": 50.0, "steps": [[100 * k, 50 + 4 * (-1) ** k] for k in range(1, 16)]},
}  # fmt: skip
_SPELLS = {
    "idle": {"share": 0.2, "length": 12.0}, "held": {"share": 0.2, "length": 12.0},
    "rough": {"std": 0.5, "share": 0.2, "length": 40.0}, "bursts": {"std": 10.0, "time": 5.0, "share": 0.2, "length": 60.0},
}  # fmt: skip
_FLAT = ("stiction", "deadzone", "saturation", "quantisation")  # known effects whose law must be named after them


def asked(world: str, index: int, entry: dict[str, Any], place: Path, seed: int = SEED) -> dict[str, Any]:
    """Return what a discovery says of one drawn record, and what a file of its law keeps."""
    drawn_by, began = WORLDS.load(world), time.process_time()
    files = write_item(drawn_by.draw(seed, index, entry), place, f"{world}_{index}")
    drawn = time.process_time()
    row: dict[str, Any] = {"world": world, "effect": entry.get("effect", "none"), "drawing_s": drawn - began}
    try:
        record, loop = read_record(files[0]), load_loop(files[1])
        if entry["kind"] == "none":
            # whether a law is named rests on the search alone, the dearest part is not needed
            with one_thread():
                situation = check(record, loop)
                law = search(situation, held_out(situation)).law
            return row | {"cpu_s": time.process_time() - drawn, "form": law.form if law else None}
        found = discover(record, loop)
    except UserError as error:
        return row | {"error": str(error)}
    row |= {"cpu_s": time.process_time() - drawn, "block": found.block, "form": None, "samples": found.situation.record.n}
    if found.law is not None and found.gap is not None:
        g = found.gap
        left = max(g.after - g.floor, 0.0) / max(g.before - g.floor, 1e-6) if g.resolvable else None
        row |= {"form": found.law.form, "left": left, "nats": found.law.nats, "nearest": found.nearest}
        file = place / f"law_{world}_{index}.py"
        write_effect(found.law, file, found.law.text, file.stem)
        row["kept"] = check_file(file).kept
        PLUGINS.forget(file.stem)
    return row


def entries(world: str, none: int, times: int = 3) -> list[dict[str, Any]]:
    """Return what is drawn of a world: each foreign kind some times, four known effects, and records without effect."""
    foreign = [
        {"kind": "foreign", "effect": kind, "strength": ("strong", "medium")[(i + j) % 2], "mv": (i + j) % 3 == 0}
        for j in range(times)
        for i, kind in enumerate(WORLDS.load(world).FOREIGN)
    ]
    known = [{"kind": "single", "effect": e, "strength": "strong", "mv": False, "plant": "foptd"} for e in _FLAT]
    return [*foreign, *known, *({"kind": "none", "mv": i % 2 == 0} for i in range(none))]


def agreement(form: str, numbers: dict[str, float], seed: int) -> float | None:
    """Return F1 of the samples in which a law that comes and goes is said to act, None where no law is named."""
    true: list[np.ndarray] = []

    def kept(*args: Any) -> np.ndarray:
        true.append(drawn(*args))
        return true[-1]

    drawn = forms.spells
    with patch.object(forms, "spells", kept), lent_effect(FoundLaw(form, numbers, 0.0)) as name:
        loop = _LOOP | {"effect": [{"name": name, **numbers}]}
        record = simulate(Loop.from_table(loop), seed).record
    found = discover(record, Loop.from_table({k: v for k, v in _LOOP.items() if k != "disturbance"}))
    if found.law is None:
        return None
    on = true[0][: record.n] > 0.0
    return float(2.0 * np.sum(on & found.on) / (np.sum(on) + np.sum(found.on)))


def summary(rows: list[dict[str, Any]]) -> list[str]:
    """Return the table: shares with their n, foreign kinds, known effects and records without effect apart."""
    good = [row for row in rows if "error" not in row]
    out = [f"{len(rows)} records, {len(rows) - len(good)} refused, seed {SEED}"]
    every = []
    for world in WORLD_NAMES:
        blocks = WORLDS.load(world).FOREIGN
        part = [row for row in good if row["world"] == world]
        foreign = [row | {"right": row["block"] == blocks[row["effect"]]} for row in part if row["effect"] in blocks]
        every += foreign
        none = [row for row in part if row["effect"] == "none"]
        out.append(f"{world}: {_foreign(foreign)}; none {len(none)}, law found {sum(row['form'] is not None for row in none)}")
    out.append(f"all: {_foreign(every)}")
    known = [row for row in good if row["effect"] in _FLAT]
    laws = [row for row in known if row["form"] is not None]
    out.append(
        f"known: {len(known)}, law found {len(laws)}, nearest right {sum(row['nearest'] == row['effect'] for row in laws)}, "
        f"block right {sum(row['block'] == block_of(row['effect']) for row in known)}"
    )
    kept = [row["kept"] for row in good if "kept" in row]
    out.append(f"effect files: {sum(kept)} of {len(kept)} keep the contract")
    cost = [row["cpu_s"] for row in good]
    out.append(f"CPU seconds a discovery: median {np.median(cost):.1f}, most {max(cost):.1f}")
    return out


def _foreign(rows: list[dict[str, Any]]) -> str:
    laws = [row for row in rows if row["form"] is not None]
    left = [row["left"] for row in laws if row["left"] is not None]
    return (
        f"foreign {len(rows)}, block right {sum(row['right'] for row in rows)}, wrong "
        f"{sum(bool(row['block']) and not row['right'] for row in rows)}, cannot tell {sum(not row['block'] for row in rows)}; "
        f"law found {len(laws)}, with the right block {sum(row['right'] for row in laws)}, "
        f"gap left {np.median(left) if left else np.nan:.2f} (median of {len(left)})"
    )


def main(none: int = 67, times: int = 1) -> None:
    """Print one line a record as it comes, then the table."""
    rows = []
    with TemporaryDirectory() as place:
        for world in WORLD_NAMES:
            for i, entry in enumerate(entries(world, none, times)):
                rows.append(asked(world, i, entry, Path(place)))
                said = {k: (round(v, 2) if isinstance(v, float) else v) for k, v in rows[-1].items()}
                print(said, file=sys.stderr, flush=True)
    print("\n".join(summary(rows)))
    for form, numbers in _SPELLS.items():
        found = [agreement(form, numbers, SEED + i) for i in range(3)]
        said = [f for f in found if f is not None]
        print(
            f"windows of {form}: {len(said)} of {len(found)} laws found, F1 {np.median(said) if said else np.nan:.2f} (median)"
        )


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
