"""What the discovery of laws is worth: foreign kinds of every world, records without effect, files through the contract.

`python -m results.studies.discovery` prints the table; the seed is named here, and was before the first answer.
"""

from __future__ import annotations

import sys
import time
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from detectors.errors import UserError
from detectors.records.io import read_record
from scenarios.spec import load_loop
from simbench.blind.making import write_item
from simbench.blind.world import WORLDS
from simbench.contract import check_file
from simbench.gap.discover.discovery import discover
from simbench.gap.discover.effect_file import write_effect
from simbench.loop.effects import PLUGINS

SEED, WORLD_NAMES = 3299, ("own", "mill", "refinery")
_FLAT = ("stiction", "deadzone", "saturation", "quantisation")  # known effects whose law must be named after them


def asked(world: str, index: int, entry: dict[str, Any], place: Path, seed: int = SEED) -> dict[str, Any]:
    """Return what a discovery says of one drawn record, and what a file of its law keeps."""
    drawn_by, began = WORLDS.load(world), time.process_time()
    files = write_item(drawn_by.draw(seed, index, entry), place, f"{world}_{index}")
    drawn = time.process_time()
    row: dict[str, Any] = {"world": world, "effect": entry.get("effect", "none"), "drawing_s": drawn - began}
    try:
        found = discover(read_record(files[0]), load_loop(files[1]))
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


def entries(world: str, none: int) -> list[dict[str, Any]]:
    """Return what is drawn of a world: each foreign kind once, four known effects, and records without effect."""
    foreign = [
        {"kind": "foreign", "effect": kind, "strength": ("strong", "medium")[i % 2], "mv": i % 3 == 0}
        for i, kind in enumerate(WORLDS.load(world).FOREIGN)
    ]
    known = [{"kind": "single", "effect": e, "strength": "strong", "mv": False, "plant": "foptd"} for e in _FLAT]
    return [*foreign, *known, *({"kind": "none", "mv": i % 2 == 0} for i in range(none))]


def summary(rows: list[dict[str, Any]]) -> list[str]:
    """Return the table: shares with their n, foreign kinds, known effects and records without effect apart."""
    good = [row for row in rows if "error" not in row]
    out = [f"{len(rows)} records, {len(rows) - len(good)} refused, seed {SEED}"]
    for world in WORLD_NAMES:
        blocks = WORLDS.load(world).FOREIGN
        part = [row for row in good if row["world"] == world]
        foreign = [row for row in part if row["effect"] in blocks]
        laws = [row for row in foreign if row["form"] is not None]
        right = [row for row in foreign if row["block"] == blocks[row["effect"]]]
        left = [row["left"] for row in laws if row["left"] is not None]
        none = [row for row in part if row["effect"] == "none"]
        out.append(
            f"{world}: foreign {len(foreign)}, block right {len(right)}, law found {len(laws)}, with the right block "
            f"{sum(row in right for row in laws)}, gap left {np.median(left) if left else np.nan:.2f} (median of {len(left)}); "
            f"none {len(none)}, law found {sum(row['form'] is not None for row in none)}"
        )
    known = [row for row in good if row["effect"] in _FLAT]
    out.append(f"known: nearest right {sum(row.get('nearest') == row['effect'] for row in known)} of {len(known)}")
    kept = [row["kept"] for row in good if "kept" in row]
    out.append(f"effect files: {sum(kept)} of {len(kept)} keep the contract")
    cost = [row["cpu_s"] for row in good]
    out.append(f"CPU seconds a discovery: median {np.median(cost):.1f}, most {max(cost):.1f}")
    return out


def main(none: int = 20, limit: float = 1e9) -> None:
    """Print one line a record as it comes, then the table; stop drawing after so many seconds."""
    rows, end = [], time.time() + limit
    with TemporaryDirectory() as place:
        for world in WORLD_NAMES:
            for i, entry in enumerate(entries(world, none)):
                if time.time() < end:
                    rows.append(asked(world, i, entry, Path(place)))
                    said = {k: (round(v, 2) if isinstance(v, float) else v) for k, v in rows[-1].items()}
                    print(said, file=sys.stderr, flush=True)
    print("\n".join(summary(rows)))


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
