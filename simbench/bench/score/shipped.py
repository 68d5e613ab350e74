"""Join the verdicts that are shipped with the package to a run of the same benchmark version, whose
methods then need not be asked again.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from simbench.bench.score.compare import pair
from simbench.bench.store.benchmark import refuse_other_benchmark
from simbench.bench.store.reading import CODES, RunArrays, read_table
from simbench.detectors.errors import ParameterError, nearest
from simbench.detectors.verdict import NO_DECISION

if TYPE_CHECKING:
    import pandas as pd

REFERENCE = "reference"  # key of a manifest: whether the run is scored with the shipped verdicts
UNLIKE = "unlike_reference"  # and how many of its records have other bits than the shipped ones
# one folder for each grid; `python -m results.studies.shipped` prints them
FOLDER = Path(__file__).parents[2] / "shipped"
_COLUMNS = ["scenario_id", "method", "verdict", "score", "applicable", "S_lo", "S_hi"]


def results(name: str) -> pd.DataFrame:
    """Return the verdicts of the package's methods on a grid, as they are shipped with the package.

    Parameters
    ----------
    name : str
        Name of a grid: chapter, ci, families, plant, recorded or table-11-3.

    Returns
    -------
    DataFrame
        One row per scenario and method: scenario_id, method, verdict, score, applicable, the ends
        of S (% of travel; J_lo and J_hi of J), and of the scenario record_hash, cycled, sticky and
        S_over_2J. Scores and sizes have 24 bits.

    Raises
    ------
    ParameterError
        For a grid without shipped verdicts.

    Notes
    -----
    All methods of the package, the likelihood too. They are of the version of the benchmark that
    `simbench.run` of the same installation states. Not for records of another grid or seed, which
    have other scenario ids.

    Examples
    --------
    >>> table = results("ci")
    >>> bool((table.method == "horch").any())
    True
    """
    there = shipped(name)
    verdicts = read_table(there, "verdicts", _COLUMNS + ["J_lo", "J_hi"]).to_pandas()
    about = ["scenario_id", "record_hash", "cycled", "sticky", "S_over_2J"]
    return verdicts.merge(read_table(there, "scenarios", about).to_pandas(), on="scenario_id")


def shipped(name: str) -> Path:
    """Return the folder of a grid's shipped verdicts; ParameterError where there are none."""
    names = sorted(path.name for path in FOLDER.iterdir() if path.is_dir())
    if name not in names:
        raise ParameterError(
            f"no verdicts on grid {name!r} are shipped with the package: {nearest(name, names)}"
        )
    return FOLDER / name


def read_joined(folder: str | Path) -> RunArrays:
    """Read a run with all verdicts that it is scored with: its own, and those of `with_shipped`."""
    return with_shipped(RunArrays.read(folder))


def with_shipped(book: RunArrays) -> RunArrays:
    """Return a run that was made with `--with-reference` with the shipped methods beside its own,
    any other, and one that has them already, as it is.

    Loops are joined by id, whatever the last bits of their records; on one that is not among the
    shipped ones a shipped method does not apply.
    """
    if not book.manifest.get(REFERENCE) or UNLIKE in book.manifest:
        return book
    there = RunArrays.read(shipped(str(book.manifest["grid"])))
    pairs = pair(book, there)
    at = pairs.now
    was_at = pairs.before
    refuse_other_benchmark(book.manifest, there.manifest, at.size)
    added = [i for i, name in enumerate(there.methods) if name not in book.methods]
    names = [there.methods[i] for i in added]

    def beside(name: str, absent: float) -> np.ndarray:
        own = getattr(book, name)
        other = getattr(there, name)
        more = np.full((*own.shape[:-2], len(added), book.ids.size), absent, dtype=own.dtype)
        more[..., at] = other[..., added, :][..., was_at]
        return np.concatenate([own, more], axis=-2)

    absent = {
        "verdict": CODES[NO_DECISION],
        "score": np.nan,
        "applicable": 0,
        "failed": 0,
        "runtime": np.nan,
        "sizes": np.nan,
    }
    about = {}
    for name in names:
        about[name] = there.manifest["methods"][name]
    return replace(
        book,
        manifest={
            **book.manifest,
            "methods": {**book.manifest["methods"], **about},
            UNLIKE: int((~pairs.same).sum()),
        },
        methods=book.methods + tuple(names),
        **{name: beside(name, value) for name, value in absent.items()},
    )
