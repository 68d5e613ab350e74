"""Run again what a manifest states: the same scenarios, methods and plug-ins, on this machine."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple, Unpack

from simbench.bench.execute.run import run_scored
from simbench.bench.execute.run_options import RunOptions, find_deciding
from simbench.bench.score.result import Scores
from simbench.bench.score.shipped import REFERENCE
from simbench.bench.store.benchmark import OF_RUN, SETTLED, grid_of_run
from simbench.bench.store.folder import RunError, refuse_unfinished
from simbench.bench.store.manifest import FROM_FILE, MANIFEST, own_methods, read_manifest

# parts of a manifest that may differ between two runs, and with them last bits and verdicts
_TOLD = {
    "methods": "thresholds or sources of methods",
    "code": "the code",
    "versions": "versions of libraries",
    "processor": "processors",
}


class Repeated(NamedTuple):
    """A run that repeats another.

    Attributes
    ----------
    folder : Path
        Folder of the new run.
    scores : Scores or None
        Its scores; None where it was whole already.
    told : str
        Whether its records have the bits of the first run, and what differs.
    """

    folder: Path
    scores: Scores | None
    told: str


def run_again(
    manifest: str | Path,
    out: str | Path | None = None,
    jobs: int = 1,
    **options: Unpack[RunOptions],
) -> Repeated:
    """Run again what a manifest states.

    Parameters
    ----------
    manifest : str or Path
        Manifest of a finished run, or the folder that holds it. Of a run that took its loops from
        another, the folder with its tables is needed.
    out : str or Path, optional
        Folder of the new run; runs/GRID by default.
    jobs : int
        Worker processes; -1 uses all cores.
    **options
        Keys of `RunOptions`, but for those that decide the loops.

    Returns
    -------
    Repeated
        The new run, and how it compares with the first.

    Raises
    ------
    RunError
        When the file is no manifest of a finished run, and when the grid, a method or a plug-in is
        not the one it states.

    Examples
    --------
    >>> import tempfile
    >>> from simbench.bench.execute.run import run_grid
    >>> place = Path(tempfile.mkdtemp())
    >>> first = run_grid("smoke", place / "first", ["he"], n=4)
    >>> run_again(first / "manifest.json", place / "second").told
    'all 4 records have the bits that the manifest states'
    """
    given = find_deciding(options)
    if given:
        raise RunError(
            f"--again takes grid, methods and settings from the manifest; leave out"
            f" {', '.join(given)}"
        )
    file = Path(manifest)
    where, name = (file, MANIFEST) if file.is_dir() else (file.parent, file.name)
    stated = read_manifest(where, name)
    refuse_unfinished(where, stated)
    if "times" not in stated:
        raise RunError(
            f"{manifest} is a baseline, no run: `simbench run {where}` simulates its loops"
        )
    if stated.get(SETTLED) == OF_RUN and not (where / "scenarios.parquet").exists():
        raise RunError(
            f"{manifest} states a run of loops from another run, which stand in its tables: the"
            " folder with them is needed"
        )
    # answers of a file cannot be asked for again
    asked = {k: v for k, v in stated["methods"].items() if v.get("answered") != FROM_FILE}
    folder, scores = run_scored(
        grid_of_run(where, stated),
        out,
        [name for name in asked if name not in own_methods(stated)],
        jobs,
        like={**stated, "methods": asked},
        **{**options, "with_reference": bool(stated.get(REFERENCE))},
    )
    return Repeated(folder, scores, compared(stated, read_manifest(folder)))


def compared(stated: Mapping[str, Any], now: Mapping[str, Any]) -> str:
    """Say whether a run has the records of another, and what of the two differs."""
    n = now["counts"]["scenarios"]
    if stated["records_hash"] == now["records_hash"]:
        said = f"all {n} records have the bits that the manifest states"
    else:
        said = f"of {n} records some have other bits than the manifest states"
    differ = [what for key, what in _TOLD.items() if stated.get(key) != now.get(key)]
    said = f"{said}; not the same: {', '.join(differ)}" if differ else said
    files = [k for k, v in stated["methods"].items() if v.get("answered") == FROM_FILE]
    return f"{said}; answered from a file, not asked again: {', '.join(files)}" if files else said
