"""Learn how sure a trust may be: `python -m results.studies.trust_learn FOLDER` looks at simulated loops of grid `plant`."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from tqdm import tqdm

from detectors.errors import UserError
from detectors.report.report import choose_methods
from detectors.verdict import NO_DECISION, STICTION
from scenarios.errors import SpecError
from scenarios.grid import load_grid
from scenarios.spec import Scenario
from simbench.bench.scenario.resolve import resolve
from simbench.files import FileError, answered, folder
from simbench.gap.stiction.friction import FRICTION, friction
from simbench.loop.simulate import simulate
from simbench.plant.indices import judged
from simbench.plant.trust.calibration import ASKED, EvidenceWeights, evidence
from simbench.usage import exit_code

GRID = "plant"
FAMILIES = 5  # into which kinds of valve are put; one after the other is left out
LEARNING, TESTING = 11, 12  # seeds of the order in which loops are drawn; groups of one are never groups of the other


def loops(count: int, seed: int, grid: str = GRID) -> Iterator[Scenario]:
    """Yield loops of a grid in random order: one of each group, then the others of these groups.

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
    groups = rng.permutation(np.arange((seed + 1) % 2, source.group_count, 2))
    others: list[Scenario] = []
    for index in groups[:count]:
        try:
            members = list(resolve(source.group(int(index))))
        except (UserError, SpecError):
            continue
        yield members.pop(int(rng.integers(len(members))))
        others += members
    yield from others[: max(count - groups.size, 0)]


def looked_at(scenario: Scenario) -> dict[str, Any]:
    """Return what is weighed of one loop's record, without MV, and the truth.

    Parameters
    ----------
    scenario : Scenario

    Returns
    -------
    dict
        sticky; valve; gain (nats); said, a dict of method to (verdict, score or None).
    """
    run = simulate(scenario.loop, scenario.seed)
    record = run.record.blind()
    said = judged(record, choose_methods(["all"]))
    return {
        "sticky": run.sticky, "valve": scenario.tags["valve"], "gain": friction(record).log_likelihood_gains[FRICTION],
        "said": {v.method: (v.verdict, float(v.score) if np.isfinite(v.score) else None) for v in said},
    }  # fmt: skip


def kept(out: Path, count: int, seed: int, ask: Callable[[Scenario], dict[str, Any]]) -> list[dict[str, Any]]:
    """Return what is found of loops of the grid; those looked at before are read from the folder.

    Parameters
    ----------
    out : Path
    count, seed : int
        As `loops` takes them.
    ask : function of a Scenario
        Returns what JSON can hold.

    Returns
    -------
    list of dict
        Without loops of which nothing can be said.
    """
    folder(out)
    rows = []
    for scenario in tqdm(loops(count, seed), total=count, file=sys.stderr):
        try:
            rows.append(answered(out / f"{scenario.id}.json", partial(ask, scenario)))
        except FileError:
            raise
        except UserError as error:
            print(f"left out {scenario.id}: {error}", file=sys.stderr)
    return rows


def fit(rows: list[dict[str, Any]]) -> EvidenceWeights:
    """Return the calibration that fits the loops, weighed so that sticky and healthy ones count the same.

    Parameters
    ----------
    rows : list of dict
        As `looked_at` gives them.

    Returns
    -------
    EvidenceWeights
        With its log-loss on kinds of valve left out.
    """
    x, sticky = _evidence(rows), np.array([r["sticky"] for r in rows])
    model = _model().fit(x, sticky)
    loss, _ = left_out(x, rows)
    return EvidenceWeights(float(model.intercept_.item()), *(float(w) for w in model.coef_[0]), len(rows), loss)


def left_out(x: np.ndarray, rows: list[dict[str, Any]], strength: float = 10.0) -> tuple[float, float]:
    """Return log-loss and share right (sticky and healthy loops counting the same) on kinds of valve not learned on.

    Parameters
    ----------
    x : ndarray, shape (loops, numbers)
    rows : list of dict
    strength : float
        Inverse penalty of the logistic model.

    Returns
    -------
    loss, right : float
    """
    from sklearn.metrics import balanced_accuracy_score, log_loss
    from sklearn.model_selection import StratifiedGroupKFold, cross_val_predict
    from sklearn.utils.class_weight import compute_sample_weight

    sticky = np.array([r["sticky"] for r in rows])
    folds = StratifiedGroupKFold(FAMILIES)
    out: Any = cross_val_predict(
        _model(strength), x, sticky, groups=[r["valve"] for r in rows], cv=folds, method="predict_proba"
    )  # fmt: skip
    weight = compute_sample_weight("balanced", sticky)
    return (
        float(log_loss(sticky, out[:, 1], sample_weight=weight)), float(balanced_accuracy_score(sticky, out[:, 1] > 0.5)),
    )  # fmt: skip


def compared(rows: list[dict[str, Any]]) -> list[str]:
    """Return why so little is weighed: the log-loss of more and of less, on kinds of valve left out."""
    methods = list(rows[0]["said"])
    code = {STICTION: 1.0, NO_DECISION: 0.0}
    verdicts = np.array([[code.get(r["said"][m][0], -1.0) for m in methods] for r in rows])
    scores = np.array([[np.nan if (s := r["said"][m][1]) is None else s for m in methods] for r in rows])
    spread = np.where((s := np.nanstd(scores, axis=0)) > 0, s, 1.0)
    scores = np.nan_to_num(np.clip((scores - np.nanmean(scores, axis=0)) / spread, -3.0, 3.0))
    x = _evidence(rows)
    sets = {
        f"verdict of {ASKED} alone": (x[:, 1:], 10.0),
        "verdicts of all methods": (verdicts, 0.1),
        "verdicts and scores of all methods": (np.hstack([verdicts, scores]), 0.1),
        "likelihood alone": (x[:, :1], 10.0),
        f"likelihood, verdict of {ASKED} (taken)": (x, 10.0),
        "likelihood, verdicts and scores of all methods": (np.hstack([x, verdicts, scores]), 0.1),
    }
    lines = [f"{len(rows)} loops, kinds of valve left out in {FAMILIES} turns", f"{'weighed':<50} {'log-loss':>8} {'right':>6}"]
    return lines + [f"{name:<50} {loss:>8.3f} {right:>6.2f}" for name, (loss, right) in _tried(sets, rows)]


def _tried(sets: dict[str, tuple[np.ndarray, float]], rows: list[dict[str, Any]]) -> list[tuple[str, tuple[float, float]]]:
    return [(name, left_out(x, rows, strength)) for name, (x, strength) in sets.items()]


def _evidence(rows: list[dict[str, Any]]) -> np.ndarray:
    return np.array([evidence(r["gain"], r["said"][ASKED][0] == STICTION) for r in rows])


def _model(strength: float = 10.0) -> Any:
    from sklearn.linear_model import LogisticRegression

    return LogisticRegression(C=strength, class_weight="balanced", max_iter=500)


def main(arguments: list[str] | None = None) -> int:
    """Look at simulated loops, write the calibration, and print it beside what more and less would do; can be resumed."""
    parser = argparse.ArgumentParser(prog="python -m results.studies.trust_learn", description=__doc__)
    parser.add_argument("out", metavar="FOLDER", help="Where what was found is kept; goes on where it stopped.")
    parser.add_argument("-n", type=int, default=300, help="Loops to look at [300].")
    chosen = parser.parse_args(arguments)
    rows = kept(Path(chosen.out), chosen.n, LEARNING, looked_at)
    found = fit(rows)
    found.write()
    print("\n".join([*compared(rows), "", str(found)]))
    return 0


if __name__ == "__main__":
    raise SystemExit(exit_code(main))
