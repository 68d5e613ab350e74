"""The training set of the probabilities: `python -m simbench.gap.decide.training.make DIR -n 3000 -j 2`; can be resumed."""

from __future__ import annotations

import argparse
import json
import sys
from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np
from joblib import Parallel, delayed
from threadpoolctl import threadpool_limits
from tqdm import tqdm

from detectors.errors import ParameterError, UserError
from simbench.files import whole_file
from simbench.gap.decide.assess import assess
from simbench.gap.decide.evidence import evidence
from simbench.gap.decide.training.draw import draw_case
from simbench.gap.decide.training.foreign import FOREIGN
from simbench.gap.intake.check import check
from simbench.loop.effects import EFFECTS, block_of
from simbench.usage import exit_code

PIECE = 20  # cases per file
MIX = ("single",) * 11 + ("none",) * 4 + ("two",) * 2 + ("foreign",) * 3  # what each 20 cases in turn hold


def plan(index: int) -> tuple[tuple[str, ...], str]:
    """Return the effects and the foreign kind of case number `index`.

    Parameters
    ----------
    index : int

    Returns
    -------
    effects : tuple of str
    foreign : str

    Examples
    --------
    >>> plan(0), plan(11)
    ((('stiction',), ''), ((), ''))
    """
    kind = MIX[index % len(MIX)]
    turn = index // len(MIX) * MIX.count(kind) + index % len(MIX) - MIX.index(kind)
    if kind == "single":
        return (list(EFFECTS)[turn % len(EFFECTS)],), ""
    if kind == "two":
        pairs = [p for p in combinations(EFFECTS, 2) if block_of(p[0]) != block_of(p[1])]
        return pairs[int(np.random.default_rng([turn, 5]).integers(len(pairs)))], ""
    return (), (list(FOREIGN)[turn % len(FOREIGN)] if kind == "foreign" else "")


def example(index: int, seed: int = 0) -> dict[str, Any] | None:
    """Draw, assess and describe one case.

    Parameters
    ----------
    index : int
        Number in the plan.
    seed : int
        Root of the set.

    Returns
    -------
    dict or None
        index, effects, foreign, block, strength, ratio and `evidence`; None where the record was refused.
    """
    effects, foreign = plan(index)
    with threadpool_limits(limits=1):
        try:
            case = draw_case(seed + index, effects, foreign)
            rows = evidence(assess(check(case.record, case.baseline)))
        except UserError:
            return None
    return {
        "index": index,
        "effects": list(effects),
        "foreign": foreign,
        "block": case.block,
        "strength": case.strength,
        "ratio": case.ratio,
        "evidence": rows,
    }


def make(folder: str | Path, n: int, jobs: int = 1, seed: int = 0) -> int:
    """Write n examples to pieces of JSON lines; pieces that exist are kept.

    Parameters
    ----------
    folder : path
    n : int
    jobs : int
    seed : int

    Returns
    -------
    int
        Pieces written now.

    Raises
    ------
    ParameterError
        For less than one case.
    """
    if n < 1:
        raise ParameterError(f"training: n = {n}; at least 1 case is needed")
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    missing = [k for k in range(-(-n // PIECE)) if not _piece(folder, k).exists()]
    with Parallel(n_jobs=jobs, return_as="generator_unordered") as parallel:
        todo = (delayed(_write)(folder, k, n, seed) for k in missing)
        for _ in tqdm(parallel(todo), total=len(missing), desc="pieces", file=sys.stderr, delay=1.0):
            pass
    return len(missing)


def load(folder: str | Path) -> list[dict[str, Any]]:
    """Return all examples of a folder, in the order of the plan; ParameterError where there are none."""
    found = [json.loads(line) for piece in sorted(Path(folder).glob("*.jsonl")) for line in piece.read_text().splitlines()]
    if not found:
        raise ParameterError(f"training: no examples (*.jsonl) in {folder}; `python -m {load.__module__}` writes them")
    return found


def _piece(folder: Path, k: int) -> Path:
    return folder / f"{k:05d}.jsonl"


def _write(folder: Path, k: int, n: int, seed: int) -> None:
    found = [example(i, seed) for i in range(k * PIECE, min((k + 1) * PIECE, n))]
    with whole_file(_piece(folder, k)) as piece:
        piece.writelines(json.dumps(e) + "\n" for e in found if e is not None)


def main(arguments: list[str] | None = None) -> int:
    """Make the set."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("-n", type=int, default=3000)
    parser.add_argument("-j", "--jobs", type=int, default=1)
    parser.add_argument("--seed", type=int, default=0)
    given = parser.parse_args(arguments)
    make(given.folder, given.n, given.jobs, given.seed)
    return 0


if __name__ == "__main__":
    raise SystemExit(exit_code(main))
