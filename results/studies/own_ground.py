"""Each method on loops that it was made for: a section of grid own-ground per method."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from simbench.bench.score.answers import home_of
from simbench.bench.statistics import wilson
from simbench.bench.store.reading import RunArrays
from simbench.usage import exit_code

if TYPE_CHECKING:
    import pandas as pd

# right of decided that the conditions of a paper should allow, and the most that may stay undecided
BARS = {"integrating": 0.85, "": 0.90}
MOST_UNDECIDED = 0.25


def sections(run: str | Path) -> pd.DataFrame:
    """Score every section of a run of grid own-ground by the method it belongs to.

    Columns: section, method, home (where its constants were fitted), noise_ratio (or "all"), n,
    right (of decided) with Wilson's interval, no_decision, bar, met. Sections of methods that the
    run did not use are left out; `horch` has no bar, its verdict follows w Ti by design.
    """
    import pandas as pd

    book = RunArrays.read(run)
    rows = []
    for section in dict.fromkeys(book.axes["block"]):
        method, _, kind = str(section).partition(", ")
        if method not in book.methods:
            continue
        i = book.methods.index(method)
        here = (book.axes["block"] == section) & (book.truth["cycled"] >= 0)
        noises = book.axes["noise_ratio"]
        levels = [
            ("all", here),
            *((f"{x:g}", here & (noises == x)) for x in np.unique(noises[here])),
        ]
        for noise, use in levels:
            verdicts, positive = book.verdict[i, use], book.truth["cycled"][use] == 1
            decided = int((verdicts != 2).sum())
            right, undecided = int((verdicts == positive).sum()), float((verdicts == 2).mean())
            lo, hi = wilson(right, decided)
            bar = None if method == "horch" else BARS[kind]
            met = bar is None or (right >= bar * decided > 0 and undecided <= MOST_UNDECIDED)
            rows.append(
                {
                    "section": section,
                    "method": method,
                    "home": home_of(method, book),
                    "noise_ratio": noise,
                    "n": int(use.sum()),
                    "right": right / decided if decided else np.nan,
                    "lo": float(lo),
                    "hi": float(hi),
                    "no_decision": undecided,
                    "bar": bar,
                    "met": met,
                }
            )
    return pd.DataFrame(rows)


def main(arguments: list[str] | None = None) -> int:
    """Print the sections of a run: `python -m results.studies.own_ground RUN`; 1 when a bar is
    missed.
    """
    table = sections((sys.argv[1:] if arguments is None else arguments)[0])
    print(table.to_string(index=False, float_format="{:.3f}".format))
    return int(not table[table.noise_ratio == "all"].met.all())


if __name__ == "__main__":
    sys.exit(exit_code(main))
