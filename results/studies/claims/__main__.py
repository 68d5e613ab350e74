"""Judge claims of the literature: `python -m results.studies.claims ../shared/data/isdb
../shared/data/real` prints every claim; `--claim five_cycles` one of them.

Without folders of recorded loops the claims are judged on echoes alone.
"""

from __future__ import annotations

import argparse
import re
import textwrap
from collections.abc import Sequence
from importlib import import_module
from pathlib import Path

import numpy as np

from results.studies.claims.judged import (
    HEAD,
    SAID,
    Answers,
    Claim,
    Loops,
    counted,
    echoed,
    recorded,
)  # fmt: skip
from simbench.detectors.compiled import one_thread
from simbench.detectors.judge import judge
from simbench.detectors.views import columns
from simbench.usage import exit_code

# every other file of this folder is a claim
NAMES = sorted(
    file.stem
    for file in Path(__file__).parent.glob("*.py")
    if not file.stem.startswith("_") and file.stem != "judged"
)
SEED = 20261201  # draws the echoes; of no other study
COMPARED = ("arx_stiction", "procedure", "he")
_WIDTH = 100


def as_lines(name: str, claim: Claim, data: list[Loops]) -> list[str]:
    """Return a claim with its table."""
    told = {
        "claimed": claim.claimed,
        "protocol": claim.protocol,
        "chosen here": claim.stand_in,
    }
    lines = [name.replace("_", " ")]
    for what, text in told.items():
        lines += textwrap.wrap(f"{what}: {text}", _WIDTH, subsequent_indent="  ")
    rows = claim.rows(data)
    return [*lines, *textwrap.wrap(outcome(rows), _WIDTH), *columns([HEAD, *rows])]


def outcome(rows: Sequence[tuple[str, ...]]) -> str:
    """Say of how many variants it is shown that they tell sticky loops from others: the interval of
    their AUC lies above .5.
    """
    told = {}
    for row in rows:
        area = re.fullmatch(r"\S+ \((\S+) to \S+\)", row[-1])
        told.setdefault(row[1], []).append(area is not None and float(area[1]) > 0.5)
    counts = ", ".join(f"on {name} {sum(tells)} of {len(tells)}" for name, tells in told.items())
    return (
        "comes out: variants shown to tell sticky loops from others (95 % interval of AUC above"
        f" .5): {counts}"
    )


def compared(loops: Loops) -> list[tuple[str, ...]]:
    """Return a line for some methods of the package on the same loops."""
    rows = []
    for name, *verdicts in zip(COMPARED, *(judge(record, COMPARED) for record in loops.records)):
        scores = np.array([v.score for v in verdicts], dtype=float)
        said = np.array([SAID[v.verdict] for v in verdicts])
        rows.append(counted(name, loops, Answers(scores, said)))
    return rows


def main(arguments: list[str] | None = None) -> int:
    """Print the chosen claims."""
    parser = argparse.ArgumentParser(
        prog="python -m results.studies.claims", description=(__doc__ or "").partition("\n\n")[0]
    )
    parser.add_argument("folder", type=Path, nargs="*", help="folders of recorded loops")
    parser.add_argument("--claim", nargs="+", choices=NAMES, default=NAMES)
    parser.add_argument("-n", type=int, default=150, help="pairs of a sticky loop and an echo")
    parser.add_argument("--seed", type=int, default=SEED, help="draws the pairs")
    parser.add_argument("--pictures", type=Path, metavar="DIR", help="also draw what has a picture")
    given = parser.parse_args(arguments)
    data = [recorded(given.folder)] if given.folder else []
    data.append(echoed(given.n, given.seed))
    print("recorded: one record of each loop, whose label its contributor states or calls likely")
    print(f"echoes: pairs of a sticky loop of grid chapter and its echo, seed {given.seed}")
    print("cannot tell counts as half a right answer in the balanced accuracy: .5 is worth nothing")
    print("\nfor comparison, methods of the package")
    print("\n".join(columns([HEAD, *(row for loops in data for row in compared(loops))])))
    for name in given.claim:
        claim = import_module(f"results.studies.claims.{name}").CLAIM
        with one_thread():  # small matrices: more threads would wait for each other
            lines = as_lines(name, claim, data)
        print("\n" + "\n".join(lines), flush=True)
        if given.pictures and claim.draw:
            claim.draw(given.pictures / f"claim-{name.replace('_', '-')}.svg")
    return 0


if __name__ == "__main__":
    raise SystemExit(exit_code(main))
