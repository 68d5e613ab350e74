"""Which labels would a reader doubt? `python -m results.studies.plant.label_audit RECORDS -o KEPT`
asks of every one.

The log-odds of stiction of all records of a loop, calibrated on the loops of other units, against
its label; then three labels at random are turned, again and again, to see whether those would be
detected.
"""

from __future__ import annotations

import argparse
import sys
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from tqdm import tqdm

from results.studies.plant.answers import answered
from results.studies.plant.recorded_loops import records, weighed
from simbench.detectors.errors import UserError
from simbench.detectors.record import LoopRecord
from simbench.files import folder
from simbench.gap.stiction.friction import friction
from simbench.gap.stiction.probability import pooled, probability
from simbench.usage import exit_code

WRONG = 0.1  # of labels, before looking
SUSPECTED = 0.5  # probability of a wrong label, from which it is suspected
PULL = 4.0  # loops that an uncalibrated reader is worth in addition to those labelled
WINDOWS = 3  # of half the record, overlapping by half
TURNED, FIRST, DRAWS = 3, 6, 100


def measured(record: LoopRecord) -> dict[str, Any]:
    """Return the log-odds of one record and what was measured, None where it cannot be judged."""
    try:
        rows = friction(record)
    except UserError as why:
        return {"odds": None, "why": str(why)}
    e = rows.evidence
    return {"odds": rows.log_odds, "gain": e.gain, "outside": e.outside, "share": e.share}


def windows(record: LoopRecord) -> list[LoopRecord]:
    """Return halves of a record: the first, the middle, the last."""
    half = record.n // 2
    return [record.window(k, k + half) for k in (0, half // 2, record.n - half)]


def doubts(loops: pd.DataFrame, labels: np.ndarray) -> np.ndarray:
    """Return the probability that each loop's label is wrong.

    Slope and offset of the log-odds are fitted to the labels of the loops of other units, and
    pulled towards 1 and 0: what is calibrated on simulated loops is off on a plant, and a plant has
    few loops.
    """
    odds, out = loops.odds.to_numpy(float), np.empty(len(loops))
    for unit in loops.unit.unique():
        here = (loops.unit == unit).to_numpy()
        slope, offset = _calibrated(odds[~here], labels[~here])
        p = 1.0 / (1.0 + np.exp(-(offset + slope * odds[here])))
        other = np.where(labels[here], 1.0 - p, p)
        out[here] = WRONG * other / (WRONG * other + (1.0 - WRONG) * (1.0 - other))
    return out


def _calibrated(odds: np.ndarray, sticky: np.ndarray) -> tuple[float, float]:
    """Return slope and offset of the likeliest logistic curve, sticky and sound loops counting the
    same, pulled to (1, 0).
    """
    from scipy.optimize import minimize

    w = np.where(sticky, 0.5 / max(sticky.sum(), 1), 0.5 / max((~sticky).sum(), 1)) * sticky.size
    sign = np.where(sticky, -1.0, 1.0)

    def misfit(x: np.ndarray) -> float:
        return float(
            w @ np.logaddexp(0.0, sign * (x[1] + x[0] * odds))
            + 0.5 * PULL * ((x[0] - 1.0) ** 2 + x[1] ** 2)
        )

    slope, offset = minimize(misfit, [1.0, 0.0]).x
    return max(float(slope), 0.0), float(offset)


def turned(loops: pd.DataFrame) -> tuple[float, float]:
    """Return the share of turned labels among the first suspected, and the share of true ones that
    are suspected.
    """
    rng, truth = np.random.default_rng(0), loops.sticky.to_numpy(bool)
    detected, false = [], []
    for _ in range(DRAWS):
        which = rng.choice(truth.size, TURNED, replace=False)
        labels = truth.copy()
        labels[which] = ~labels[which]
        p = doubts(loops, labels)
        detected.append(np.isin(which, np.argsort(-p)[:FIRST]).mean())
        false.append((np.delete(p, which) > SUSPECTED).mean())
    return float(np.mean(detected)), float(np.mean(false))


def main(arguments: list[str] | None = None) -> int:
    """Print every loop by how doubtful its label is, with what speaks and where, and how many
    turned labels are detected.
    """
    parser = argparse.ArgumentParser(
        prog="python -m results.studies.plant.label_audit", description=__doc__
    )
    parser.add_argument("folder", type=Path)
    parser.add_argument(
        "-o",
        "--output",
        type=Path,
        required=True,
        help="Folder of `recorded_loops`, where answers are kept.",
    )
    given = parser.parse_args(arguments)
    folder(given.output)
    rows = []
    for m, r in tqdm(records(given.folder, doubted=True), file=sys.stderr):
        whole = answered(given.output / f"{m.id}.json", partial(weighed, r))
        parts = [
            answered(given.output / f"{m.id}-w{i}.json", partial(measured, w))
            for i, w in enumerate(windows(r))
        ]
        rows.append(
            {
                "id": m.id,
                "loop": m.loop,
                "unit": m.unit_group,
                "sticky": m.label == "stiction",
                **whole,
                "parts": parts,
            }
        )
    table = pd.DataFrame([r for r in rows if r["odds"] is not None])
    loops = table.groupby("loop").agg(
        unit=("unit", "first"), sticky=("sticky", "first"), odds=("odds", lambda x: pooled(list(x)))
    )
    loops["doubt"] = doubts(loops, loops.sticky.to_numpy(bool))
    for loop, line in loops.sort_values("doubt", ascending=False).iterrows():
        label = "stiction" if line.sticky else "no stiction"
        print(
            f"{line.doubt:.2f}  {loop:<28} labelled {label:<12} probability of stiction"
            f" {probability(line.odds):.2f}"
        )
        for r in table[table.loop == loop].itertuples():
            print(f"      {r.id}: {_speaks(r.parts, line.sticky)}")
    share, false = turned(loops)
    print(
        f"\n{DRAWS} draws, {TURNED} of {len(loops)} labels turned: {share:.2f} of them among the"
        f" first {FIRST} suspected;"
    )
    print(f"true labels suspected of being wrong: {false:.2f}")
    return 0


def _speaks(parts: list[dict[str, Any]], sticky: bool) -> str:
    """Return the window that speaks most against a label, and what speaks."""
    judged = [(p["odds"], i, p) for i, p in enumerate(parts) if p["odds"] is not None]
    if not judged:
        return "no half can be judged alone"
    odds, i, p = (min if sticky else max)(judged, key=lambda x: x[0])
    where = ("first", "middle", "last")[i]
    halves = (
        f"friction {p['gain']:+.0f} nats, from outside {p['outside']:+.0f}, band {p['share']:.0%}"
        " of OP's range"
    )
    return f"{where} half {probability(odds):.2f} ({halves})"


if __name__ == "__main__":
    raise SystemExit(exit_code(main))
