"""Is the probability of stiction what it says? `python -m results.studies.plant.calibration FOLDER`
asks it of oscillating loops of four grids, half of which cycle by friction, and of recorded loops.

It prints how often sticky loops are denied and others claimed, the cost of the answers (an error 1,
no decision .5), the area under the ROC curve, the calibration error, and in ten bins of the
probability the share that sticks. The two factors of the curve are learned on three grids, each
time, and judged on the fourth: beside those of the product. Answers are kept in the folder.
"""

from __future__ import annotations

import argparse
import warnings
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from joblib import Parallel, delayed
from scipy.optimize import minimize
from scipy.special import logit

from results.studies.plant.answers import answered
from results.studies.plant.real_loops import asked as asked_of_file
from results.studies.plant.real_loops import read
from results.studies.plant.stiction_probability import (
    balanced,
    evidence_of,
    reliability,
    scores,
)
from simbench.bench.scenario.resolve import resolve
from simbench.bench.scenario.truth import simulate_with_truth
from simbench.bench.score.shipped import shipped
from simbench.bench.store.reading import RunArrays
from simbench.detectors.errors import UserError
from simbench.detectors.record import LoopRecord
from simbench.detectors.verdict import NO_DECISION, NO_STICTION, STICTION
from simbench.files import folder
from simbench.gap.stiction.deniable import deniable
from simbench.gap.stiction.friction import friction
from simbench.gap.stiction.probability import log_odds, probability, verdict
from simbench.gap.thresholds import CLAIMED_FROM, DENIED_BELOW, HARDLY_SEEN, LIKELIER, SEEN
from simbench.progress import Progress
from simbench.scenarios.settled import settled_grid
from simbench.usage import exit_code

GRIDS = ("chapter", "ci", "plant", "families")
REAL = "real"
_NO_ANSWER = 0.5  # what no decision costs, where an error costs 1
_SURE = 0.01  # probability at which a mistake stops to cost more, where factors are learned


class Drawn(NamedTuple):
    """A loop of a grid: its record without MV, and whether it cycles by friction."""

    name: str
    record: LoopRecord
    sticky: bool


def chosen(grid: str, count: int, seed: int) -> dict[str, bool]:
    """Return the ids of so many ranked loops of a grid that oscillate, drawn by a seed, and whether
    they cycle by friction: half of them do.
    """
    book, rng = RunArrays.read(shipped(grid)), np.random.default_rng(seed)
    out = {}
    for truth in (0, 1):
        fit = book.oscillating & ~book.apart & (book.truth["cycled"] == truth)
        some = rng.choice(np.flatnonzero(fit), min(count // 2, int(fit.sum())), replace=False)
        out |= {book.ids[i].decode(): bool(truth) for i in some}
    return out


def drawn(grid: str, ids: dict[str, bool]) -> Iterator[Drawn]:
    """Yield the loops of a grid with some ids."""
    source = settled_grid(grid)
    for index in range(source.group_count):
        for scenario in resolve(source.group(index)):
            if scenario.id in ids:
                record = simulate_with_truth(scenario.loop, scenario.seed)[0].record
                yield Drawn(f"{grid}-{scenario.id}", record.without_mv(), ids[scenario.id])


def asked(one: Drawn) -> dict[str, Any]:
    """Return what the likelihood of a record measured, which rules hold its answer, and the truth;
    no evidence where it cannot be judged.
    """
    about = {"sticky": one.sticky}
    try:
        weighed = friction(one.record)
    except UserError as why:
        return about | {"evidence": None, "why": str(why)}
    e = weighed.evidence
    return about | {
        "evidence": [e.gain, e.share, e.cycles, e.pace],
        "unclaimed": bool(weighed.unclaimed),
        "open": bool(deniable(weighed.assessment).open),
    }


def probabilities(rows: Sequence[dict[str, Any]], factors: Sequence[float]) -> np.ndarray:
    """Return the probability of each row with two factors of the curve; even odds where it cannot
    be judged.
    """
    most, least = float(logit(CLAIMED_FROM)), float(logit(DENIED_BELOW))
    out = []
    for r in rows:
        odds = log_odds(evidence_of(r), *factors) if r["evidence"] else 0.0
        odds = min(odds, most) if r.get("unclaimed") else odds
        out.append(probability(max(odds, least) if r.get("open") else odds))
    return np.array(out)


def learned(groups: Sequence[Sequence[dict[str, Any]]]) -> np.ndarray:
    """Return the factors under which the labels of some grids are likeliest, each grid, and in each
    sticky and other loops, counting the same.
    """
    labels = [np.array([r["sticky"] for r in rows]) for rows in groups]

    def loss(factors: np.ndarray) -> float:
        total = 0.0
        for rows, y in zip(groups, labels):
            p = np.clip(probabilities(rows, factors), _SURE, 1.0 - _SURE)
            total -= float(balanced(y, [""] * y.size) @ np.log(np.where(y, p, 1.0 - p))) / y.size
        return total

    return minimize(loss, [1.0, 1.0], method="Nelder-Mead", options={"xatol": 0.01}).x


def line(name: str, p: np.ndarray, y: np.ndarray) -> str:
    """Return in one line how probabilities answer loops."""
    said = np.array([verdict(x) for x in p])
    wrong = np.where(y, said == NO_STICTION, said == STICTION)
    cost = float(np.mean(wrong + _NO_ANSWER * (said == NO_DECISION)))
    _, area, error = scores(p, y)
    shares = [np.mean(said[y == t] == v) for t, v in (
        (True, NO_STICTION), (True, NO_DECISION), (False, STICTION), (False, NO_DECISION),
    )]  # fmt: skip
    return f"{name:<32} {'  '.join(f'{x:.3f}' for x in (*shares, cost, area, error))}"


def as_lines(rows: dict[str, list[dict[str, Any]]]) -> list[str]:
    """Return how the answers hold on every grid, with the product's factors and with those that the
    other grids teach, and the bins of their probabilities.
    """
    head = "sticky: denied, open; others: claimed, open; cost; AUC; calibration error"
    lines, bins = [head], []
    for name, here in rows.items():
        y = np.array([r["sticky"] for r in here])
        p = probabilities(here, (SEEN, HARDLY_SEEN))
        lines.append(line(f"{name} ({y.size})", p, y))
        others = learned([r for n, r in rows.items() if n != name])
        told = f"  learned elsewhere: {others[0]:.2f}, {others[1]:.2f}"
        lines.append(line(told, probabilities(here, others), y))
        bins += [f"{name}, by its probability:", *reliability(p, y)]
    return [*lines, *bins]


def of_real(folders: Sequence[Path], jobs: int) -> list[str]:
    """Return the same of recorded loops whose label is known, by record."""
    table = read(folders)
    table = table[table.label != "unknown"]
    files = [Path(f) / f"{i}.csv" for f, i in zip(table.folder, table.id)]
    answers: list[Any] = list(Parallel(n_jobs=jobs)(delayed(asked_of_file)(f) for f in files))
    p = np.array([LIKELIER if a.probability is None else a.probability for a in answers])
    y = (table.label == STICTION).to_numpy()
    return [line(f"{REAL} ({y.size} records)", p, y), f"{REAL}:", *reliability(p, y)]


def main(arguments: list[str] | None = None) -> int:
    """Ask of the loops of every grid, and of recorded ones, and print what was found."""
    warnings.simplefilter("ignore")
    parser = argparse.ArgumentParser(
        prog="python -m results.studies.plant.calibration", description=__doc__
    )
    parser.add_argument("out", type=Path, metavar="FOLDER", help="Where answers are kept.")
    parser.add_argument("-n", type=int, default=240, help="Loops of each grid [240].")
    parser.add_argument("--seed", type=int, required=True, help="Seed that draws the loops.")
    parser.add_argument("--real", type=Path, nargs="*", default=[], metavar="FOLDER")
    parser.add_argument("-j", type=int, default=2, metavar="JOBS", help="Loops at once [2].")
    given = parser.parse_args(arguments)
    folder(given.out)
    rows = {}
    for grid in GRIDS:
        ids = chosen(grid, given.n, given.seed)
        jobs = (delayed(_kept)(given.out, one) for one in drawn(grid, ids))
        found = Parallel(n_jobs=given.j, return_as="generator")(jobs)
        rows[grid] = list(Progress(found, total=len(ids), desc=grid))
    lines = as_lines(rows)
    if given.real:
        lines += of_real(given.real, given.j)
    print("\n".join(lines))
    return 0


def _kept(out: Path, one: Drawn) -> dict[str, Any]:
    return answered(out / f"{one.name}.json", lambda: asked(one))


if __name__ == "__main__":
    raise SystemExit(exit_code(main))
