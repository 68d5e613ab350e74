"""A classifier that learns the waveform: random convolution kernels and a ridge, on its home grid
and away from it.

A method that is fitted to one grid should not be compared with one that is not. Two rows of each
grid show what home ground is worth: the same classifier learned on other seeds of the grid that
judges it, and on another grid.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from simbench.bench.scenario.resolve import resolve
from simbench.bench.scenario.truth import NO, YES, simulate_with_truth
from simbench.bench.statistics import auc
from simbench.detectors.judge import judge
from simbench.detectors.plugins.registry import methods as registry
from simbench.detectors.prepared import prepare
from simbench.detectors.record import LoopRecord
from simbench.detectors.report.report import table
from simbench.detectors.signal.conditioning import means
from simbench.detectors.verdict import NO_DECISION, STICTION
from simbench.scenarios.grid import load_grid
from simbench.usage import exit_code

if TYPE_CHECKING:
    from sklearn.pipeline import Pipeline

LEARN, JUDGE = 640917, 640918  # seeds of no other study, and of no grid
PERIODS, POINTS = (
    8,
    24,
)  # of a window, points of a period: as many as the coarsest loops of the grids have
KERNELS = 1000
KERNEL_SEED = 1


@dataclass(frozen=True)
class Loops:
    """Loops of a grid that oscillate and last for `PERIODS` periods."""

    # OP and PV, each about 0 with standard deviation 1, shape (m, 2, PERIODS * POINTS)
    window: np.ndarray
    plain: np.ndarray  # what no waveform is needed for, shape (m, 8)
    cycling: np.ndarray  # the truth `cycled`, shape (m,)
    records: list[LoopRecord]


def window_of(op: np.ndarray, pv: np.ndarray, period: float) -> np.ndarray | None:
    """Return the last periods of a loop without its amplitude, offset and period (samples); None
    where it is too short.

    Both signals are standardised and have the same number of points in a period, so that the
    classifier sees neither how far they swing, nor about what, nor how fast. The noise relative
    to the swing is left, and with it a trace of the sampling: a loop of more samples a period has
    less of it after the means.
    """
    last = int(np.ceil(PERIODS * period)) + 1
    if last > op.size or period < POINTS / 2:
        return None
    at = np.arange(PERIODS * POINTS) * (period / POINTS)
    both = []
    for x in (op[-last:], pv[-last:]):
        x = means(x, max(1.0, period / POINTS))
        x = np.interp(at, np.linspace(0.0, last - 1.0, x.size), x)
        both.append((x - x.mean()) / (x.std() or 1.0))
    return np.array(both)


def loops(grid: str, seed: int, count: int) -> Loops:
    """Simulate a grid, its groups in random order, until there are so many loops."""
    content = load_grid(grid, {"seed": seed})
    windows, plain, cycling, records = [], [], [], []
    for index in np.random.default_rng(seed).permutation(content.group_count):
        for scenario in resolve(content.group(int(index))):
            run, cycled = simulate_with_truth(scenario.loop, scenario.seed)
            record = run.record.without_mv()
            oscillation = prepare(record).oscillation
            if cycled.answer not in (YES, NO) or not oscillation.sustained:
                continue
            window = window_of(record.op, record.pv, oscillation.period_s / record.Ts)
            if window is not None:
                op, pv = record.op, record.pv
                plain.append(
                    [
                        op.std(),
                        pv.std(),
                        op.mean(),
                        op.min(),
                        op.max(),
                        record.n,
                        record.Ts,
                        oscillation.period_s,
                    ]
                )
                windows.append(window)
                cycling.append(cycled.answer == YES)
                records.append(record)
        if len(records) >= count:
            break
    return Loops(np.array(windows, dtype=np.float32), np.array(plain), np.array(cycling), records)


def features(window: np.ndarray) -> np.ndarray:
    """Return two features a kernel, shape (m, 2 * KERNELS): share of the window where its answer is
    positive, and the maximum.

    Source: ROCKET, A. Dempster, F. Petitjean, G.I. Webb (2020), Data Mining and Knowledge Discovery
    34, 1454-1495: random lengths, weights, biases and dilations; here each kernel sees OP and PV
    together, and no padding.
    """
    rng, columns = np.random.default_rng(KERNEL_SEED), []
    for _ in range(KERNELS):
        length = int(rng.choice([7, 9, 11]))
        weights = rng.standard_normal((2, length)).astype(np.float32)
        weights -= weights.mean(axis=1, keepdims=True)
        step = int(2 ** rng.uniform(0.0, np.log2((window.shape[2] - 1) / (length - 1))))
        size = window.shape[2] - step * (length - 1)
        answer = np.full((len(window), size), rng.uniform(-1.0, 1.0), dtype=np.float32)
        for tap in range(length):
            part = window[:, :, step * tap : step * tap + size]
            answer += weights[0, tap] * part[:, 0] + weights[1, tap] * part[:, 1]
        columns += [(answer > 0.0).mean(axis=1), answer.max(axis=1)]
    return np.column_stack(columns)


def ridge() -> Pipeline:
    """Return a linear classifier of standardised features, which chooses how much it shrinks."""
    from sklearn.linear_model import RidgeClassifierCV
    from sklearn.pipeline import make_pipeline
    from sklearn.preprocessing import StandardScaler

    return make_pipeline(StandardScaler(), RidgeClassifierCV(np.logspace(-1, 5, 13)))


def rows(
    grids: Sequence[str], learn: int, ask: int, methods: Sequence[str]
) -> list[dict[str, str]]:
    """Return a row for every classifier on every grid, and for every method on the same loops."""
    from sklearn.ensemble import HistGradientBoostingClassifier

    known = {grid: loops(grid, LEARN, learn) for grid in grids}
    learned = {grid: ridge().fit(features(of.window), of.cycling) for grid, of in known.items()}
    table = []
    for grid in grids:
        asked = loops(grid, JUDGE, ask)
        seen, truth = features(asked.window), asked.cycling
        for home, model in learned.items():
            score = model.decision_function(seen)
            table.append(
                _row(
                    grid,
                    "random kernels",
                    f"{home}, other seeds" if home == grid else home,
                    score,
                    score > 0,
                    truth,
                )
            )
        trees = HistGradientBoostingClassifier(random_state=0).fit(
            known[grid].plain, known[grid].cycling
        )
        score = trees.predict_proba(asked.plain)[:, 1]
        table.append(_row(grid, "no waveform", f"{grid}, other seeds", score, score > 0.5, truth))
        for method in methods:
            verdicts = [judge(record, [method])[0] for record in asked.records]
            score = np.array([v.score if np.isfinite(v.score) else 0.0 for v in verdicts])
            decided = np.array([v.verdict != NO_DECISION for v in verdicts])
            answer = np.array([v.verdict == STICTION for v in verdicts])
            home = ", ".join(registry.load(method).METHOD.fitted_on) or "nothing"
            table.append(_row(grid, method, home, score, answer, truth, decided))
    return table


def _row(grid, method, home, score, answer, truth, decided=True) -> dict[str, str]:
    """An error costs 1, no decision .5; accuracy counts no decision as wrong."""
    wrong = np.where(decided, answer != truth, 0.5)
    return {
        "grid": grid,
        "method": method,
        "learned on": home,
        "n": str(truth.size),
        "cost": f"{wrong.mean():.2f}",
        "accuracy": f"{(wrong == 0.0).mean():.2f}",
        "AUC": f"{auc(score, truth).value:.2f}",
    }


def main(arguments: list[str] | None = None) -> int:
    """Print the table: `python -m results.studies.learned`."""
    parser = argparse.ArgumentParser(
        prog="python -m results.studies.learned", description=(__doc__ or "").partition("\n")[0]
    )
    parser.add_argument(
        "--grid", nargs="+", default=["chapter", "plant"], help="each judges, and is learned on"
    )
    parser.add_argument(
        "--learn", type=int, default=1500, help="loops that oscillate, of each grid"
    )
    parser.add_argument(
        "--ask", type=int, default=1000, help="loops that oscillate, of each grid, of another seed"
    )
    parser.add_argument(
        "--method",
        nargs="*",
        default=["procedure"],
        help="detectors that are asked about the same loops",
    )
    chosen = parser.parse_args(arguments)
    print(
        f"loops that oscillate; {chosen.learn} learned, seed {LEARN}, {chosen.ask} judged, seed"
        f" {JUDGE}, of each grid"
    )
    print(
        "an error costs 1, no decision .5; random kernels are given standardised periods of OP and"
        " PV: neither amplitude,"
    )
    print(
        "nor offset, nor period; no waveform: standard deviations, mean and extremes, sampling and"
        " period, and nothing else"
    )
    print("\n".join(table(rows(chosen.grid, chosen.learn, chosen.ask, chosen.method))))
    return 0


if __name__ == "__main__":
    sys.exit(exit_code(main))
