"""Make an exam: simulate with new seeds, write the records under random names in random order, and
write the key elsewhere.
"""

from __future__ import annotations

import contextlib
import json
import random
import secrets
import shutil
import sys
from collections import Counter
from pathlib import Path

from simbench.bench.execute.compute_piece import SimulatedScenario
from simbench.bench.execute.grid_check import refuse_too_large, refuse_wrong_parts, size_of
from simbench.bench.store.benchmark import (
    benchmark_of,
    grid_settings,
    is_stored,
    stored_grid,
)
from simbench.detectors.errors import ParameterError
from simbench.detectors.record import LoopRecord
from simbench.files import folder as make_folder
from simbench.files import remove_stale_temporaries
from simbench.scenarios.grid import load_grid
from simbench.sealed.exam.folder import EXAM, EXAM_FORMAT, write_exam
from simbench.sealed.exam.loops import table_in_key
from simbench.sealed.exam.simulating import Pick, simulate_picks
from simbench.sealed.handout import (
    commitment_of,
    refuse_key_inside,
    refuse_unwritable_key,
    write_key,
)

_UNMATCHED = "the sticky sibling of an echo does not cycle"
_BITS = 62  # of a grid's seed: nobody finds it by trying


def make_exam(
    grid: str | Path,
    out: str | Path,
    key: str | Path,
    n: int | None = None,
    jobs: int = 1,
    seed: int | None = None,
) -> str:
    """Write the folder of an exam and, elsewhere, its key; return the commitment to the key.

    Parameters
    ----------
    grid : str or Path
        Name of a grid, or a TOML file, whose seed is drawn anew; or the folder of a run or
        baseline, whose loops are asked as they stand: who has that folder knows them.
    out, key : str or Path
        Folder of the exam, which must be new, and file of the key, which must lie outside.
    n : int, optional
        Number of records, drawn at random; at most one of each group of the grid as long as there
        are others, because siblings share noise and sampling. All scenarios by default: then
        every echo lies beside its sticky sibling, and who knows that can compare the two.
    jobs : int
        Worker processes; they change nothing in the files.
    seed : int, optional
        For tests: seeds, ids and order follow from it. By default all are drawn from the operating
        system's entropy.

    Returns
    -------
    str
        SHA-256 of the key, 64 hex digits.

    Raises
    ------
    ParameterError
        When a file is in the way or `n` scenarios cannot be simulated.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as place:
    ...     commitment = make_exam("smoke", f"{place}/exam", f"{place}/exam.key", n=2)
    ...     sorted(file.name for file in Path(place, "exam").iterdir())
    ['exam.json', 'loops.csv', 'records.parquet']
    """
    out, key = Path(out), Path(key)
    refuse_key_inside("exam", key, out)
    half = out.absolute().with_name(f".{out.name}.partial")  # until all of it is written
    _drop_key_of(half, key)
    for path, taken in (
        (key, key.exists()),
        (out, out.exists() and not (out.is_dir() and not any(out.iterdir()))),
    ):
        if taken:
            raise ParameterError(f"exam: {path} exists already; another name is needed")
    # ids and order are published: they must not come from a generator whose state they tell
    chance = secrets.SystemRandom() if seed is None else random.Random(seed)
    if is_stored(grid):
        plan = stored_grid(grid)
    else:
        plan = load_grid(grid, {"seed": chance.getrandbits(_BITS) if seed is None else seed})
    refuse_too_large(size_of(plan, 0, 0), plan.name)
    refuse_wrong_parts(plan)
    if n is not None and not 1 <= n <= len(plan):
        raise ParameterError(
            f"exam: --n {n}; grid {plan.name} has {len(plan)} scenarios: 1 to {len(plan)} are"
            " allowed"
        )
    refuse_unwritable_key(key)
    make_folder(out.absolute().parent)
    left = [
        (group, place) for group in range(plan.group_count) for place in range(plan.size(group))
    ]
    chance.shuffle(left)
    if n is not None:
        left = _apart(left)
    wanted, simulated, failed = len(left) if n is None else n, {}, []
    while left and len(simulated) < wanted:
        some, left = left[: wanted - len(simulated)], left[wanted - len(simulated) :]
        tried = simulate_picks(plan, some, jobs, _shown)
        simulated |= {pick: it for pick, it in tried.items() if isinstance(it[2], LoopRecord)}
        failed += [
            tried[pick][2] if pick in tried else _UNMATCHED
            for pick in some
            if pick not in simulated
        ]
    if failed:
        print(
            f"{len(failed)} scenarios could not be simulated and are left out ({failed[0]})",
            file=sys.stderr,
        )
    if len(simulated) < (n or 1):
        raise ParameterError(
            f"exam: only {len(simulated)} scenarios of grid {plan.name} can be simulated;"
            f" {n or 1} are needed"
        )
    picks = list(simulated)
    chance.shuffle(picks)
    ids = [f"{i:012x}" for i in chance.sample(range(16**12), len(picks))]
    stated = benchmark_of(plan, [(simulated[pick][0], simulated[pick][3]) for pick in picks])
    names = ("scenario", "seed", "group", "place")
    secret = {
        "format": EXAM_FORMAT,
        "salt": f"{chance.getrandbits(128):032x}",
        "benchmark": stated,
        **grid_settings(plan),
        **table_in_key(plan),
        "records": {
            i: dict(zip(names, (*simulated[pick][:2], *pick))) for i, pick in zip(ids, picks)
        },
    }
    content = json.dumps(secret, indent=1).encode()
    about = {
        "format": EXAM_FORMAT,
        "benchmark": stated,
        "version": stated["version"],
        "n": len(ids),
    }
    remove_stale_temporaries(make_folder(half))  # of a killed call: they would be handed out
    written = False
    try:
        write_exam(
            half,
            {**about, "commitment": commitment_of(content)},
            dict(zip(ids, (simulated[pick][2] for pick in picks))),
        )
        write_key(key, content)
        written = True
        half.replace(out)
    except BaseException:
        if written:
            key.unlink(missing_ok=True)
        raise
    finally:
        shutil.rmtree(half, ignore_errors=True)
    return commitment_of(content)


def _drop_key_of(half: Path, key: Path) -> None:
    """Remove the key that a killed call wrote for an exam which nobody has seen, as it was never
    moved to its name.
    """
    with contextlib.suppress(OSError, ValueError, KeyError, TypeError):
        if json.loads((half / EXAM).read_bytes())["commitment"] == commitment_of(key.read_bytes()):
            key.unlink()


def _shown(it: SimulatedScenario) -> tuple[str, int, LoopRecord | str | None, str]:
    """Return a scenario's id, seed, record (or why there is none) and loop digest."""
    shown = it.error if it.run is None else it.run.record.without_mv()
    return it.ident, it.scenario.seed, shown, it.scenario.loop_digest


def _apart(picks: list[Pick]) -> list[Pick]:
    """Return picks in an order in which no group gives another scenario before all have given as
    many.
    """
    seen: Counter[int] = Counter()
    turns = []
    for group, _ in picks:
        seen[group] += 1
        turns.append(seen[group])
    return [pick for _, pick in sorted(zip(turns, picks), key=lambda both: both[0])]
