"""Learn how sure a trust may be: `python -m simbench.plant.learn FOLDER` asks it about simulated loops of grid `plant`."""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from tqdm import tqdm

from detectors.errors import UserError
from scenarios.errors import SpecError
from scenarios.grid import load_grid
from scenarios.spec import Scenario
from simbench.bench.resolve import resolve
from simbench.files import folder, whole_file
from simbench.loop.simulate import simulate
from simbench.plant.calibration import EvidenceWeights, evidence
from simbench.plant.result import Trust
from simbench.plant.trust import trust

GRID = "plant"
LEARNING, TESTING = 11, 12  # seeds of the order in which loops are drawn; groups of one are never groups of the other


def loops(count: int, seed: int, grid: str = GRID) -> Iterator[Scenario]:
    """Yield loops of a grid in random order, one of each group.

    Parameters
    ----------
    count : int
    seed : int
        `LEARNING` draws from even groups, `TESTING` (and every other even seed) from odd ones.
    grid : str

    Yields
    ------
    Scenario
        A loop that cannot be resolved is passed over.
    """
    source, rng = load_grid(grid), np.random.default_rng(seed)
    groups = np.arange((seed + 1) % 2, source.group_count, 2)
    for index in rng.permutation(groups)[:count]:
        try:
            members = list(resolve(source.group(int(index))))
        except (UserError, SpecError):
            continue
        yield members[int(rng.integers(len(members)))]


def asked(scenario: Scenario) -> tuple[bool, Trust]:
    """Return whether a loop is sticky, and what its trust says of the record without MV."""
    run = simulate(scenario.loop, scenario.seed)
    return run.sticky, trust(run.record.blind(), help_wanted=False)


def fit(rows: list[dict[str, Any]]) -> EvidenceWeights:
    """Return the calibration that fits the answers, weighed so that sticky and healthy loops count the same.

    Parameters
    ----------
    rows : list of dict
        sticky, of_twins, gain.

    Returns
    -------
    EvidenceWeights
        With its log-loss on loops left out, tenth by tenth.
    """
    from sklearn.linear_model import LogisticRegression
    from sklearn.metrics import log_loss
    from sklearn.model_selection import StratifiedKFold, cross_val_predict

    x = np.array([evidence(r["of_twins"], r["gain"]) for r in rows])
    sticky = np.array([r["sticky"] for r in rows])
    model = LogisticRegression(C=10.0, class_weight="balanced")
    out: Any = cross_val_predict(model, x, sticky, cv=StratifiedKFold(10), method="predict_proba")
    model.fit(x, sticky)
    weights = (float(w) for w in model.coef_[0])
    return EvidenceWeights(float(model.intercept_.item()), *weights, len(rows), float(log_loss(sticky, out[:, 1])))


def main(arguments: list[str] | None = None) -> int:
    """Ask trust about simulated loops, keep the answers, and write the calibration; goes on where it stopped."""
    parser = argparse.ArgumentParser(prog="python -m simbench.plant.learn", description=__doc__)
    parser.add_argument("out", metavar="FOLDER", help="Where the answers are kept.")
    parser.add_argument("-n", type=int, default=120, help="Loops to ask about [120].")
    chosen = parser.parse_args(arguments)
    rows = answers(Path(chosen.out), chosen.n, LEARNING)
    found = fit(rows)
    found.write()
    print(found)
    return 0


def answers(out: Path, count: int, seed: int) -> list[dict[str, Any]]:
    """Return what trust says of loops of the grid; those asked before are read from the folder."""
    folder(out)
    rows = []
    for scenario in tqdm(loops(count, seed), total=count, file=sys.stderr):
        file = out / f"{scenario.id}.json"
        if not file.exists():
            try:
                sticky, found = asked(scenario)
            except UserError as error:
                print(f"left out {scenario.id}: {error}", file=sys.stderr)
                continue
            row = {
                "scenario": scenario.id, "sticky": sticky, "of_twins": found.of_twins,
                "gain": found.behind.gain if found.behind else None, "answer": found.as_json(),
            }  # fmt: skip
            with whole_file(file) as f:
                json.dump(row, f)
        rows.append(json.loads(file.read_text(encoding="utf-8")))
    return [r for r in rows if r["of_twins"] is not None]


if __name__ == "__main__":
    sys.exit(main())
