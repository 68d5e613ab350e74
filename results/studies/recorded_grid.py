"""Write the scenarios of the grid `recorded`: `python -m results.studies.recorded_grid FOLDER...`
takes the loop that copies one record of each unit of the folders (each with its table records.csv),
replaces every column of the record that is left in it by a draw of a model, and settles the grid.

What is replaced: the residuals from which the load is drawn, the set point's moves, and which
samples the archive repeats. What stays are numbers that were identified. Printed is how far the
draws are from what they replace.
"""

from __future__ import annotations

import argparse
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from scipy.stats import kurtosis, norm, rankdata

from results.studies.grid_gaps import read
from simbench.detectors.views import columns
from simbench.files import whole_file
from simbench.gap.benchmark.from_records import NearLoop, grid_from_records, grid_of_loops
from simbench.scenarios.columns import RESIDUALS
from simbench.scenarios.settled import table_file
from simbench.scenarios.spec import Loop
from simbench.usage import exit_code

NAME = "recorded"
SEED = 20261130
QUANTILES = np.r_[0.0, 0.002, 0.01, np.linspace(0.05, 0.95, 19), 0.99, 0.998, 1.0]
ORDERS = (1, 2, 3, 5, 8, 12)
FEW_MOVES = 0.05  # of the samples: a set point that moves less often is one that people move
DIGITS = 4  # of a number that is drawn


def one_a_unit(loops: Mapping[str, NearLoop], units: Mapping[str, str]) -> dict[str, NearLoop]:
    """Return one loop of each unit, drawn by the seed."""
    order = np.random.default_rng(SEED).permutation(sorted(loops)).tolist()
    chosen = {units.get(name, name): name for name in order}
    return {name: loops[name] for name in sorted(chosen.values())}


def like(given: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Return columns, shape (n, k), drawn from a model of some: Gaussian, with their memory (vector
    autoregression of the order by Akaike's criterion), each then bent to the quantiles that it has.

    Grigoriu (1984), Crossings of non-Gaussian translation processes, J. Eng. Mechanics 110, 610.
    """
    n, k = given.shape
    scores = norm.ppf((np.column_stack([rankdata(x) for x in given.T]) - 0.5) / n)
    fits = [_autoregression(scores, p) for p in ORDERS if n > 4 * p * k]
    law, left = min(fits, key=lambda fit: _akaike(fit, n))
    total = 2 * n
    shocks = left[rng.integers(len(left), size=total)]
    drawn = np.zeros((total, k))
    p = len(law) // k
    for t in range(p, total):
        drawn[t] = drawn[t - p : t][::-1].ravel() @ law + shocks[t]
    places = np.column_stack([(rankdata(x) - 0.5) / n for x in drawn[-n:].T])
    bent = [
        np.interp(places[:, j], QUANTILES, np.quantile(given[:, j], QUANTILES)) for j in range(k)
    ]
    return np.column_stack(bent)


def _autoregression(scores: np.ndarray, p: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the coefficients of a vector autoregression of order p, latest sample first, and what
    it leaves.
    """
    n = len(scores)
    past = np.column_stack([scores[p - lag : n - lag] for lag in range(1, p + 1)])
    law = np.linalg.lstsq(past, scores[p:], rcond=None)[0]
    return law, scores[p:] - past @ law


def _akaike(fit: tuple[np.ndarray, np.ndarray], n: int) -> float:
    law, left = fit
    return n * float(np.linalg.slogdet(np.cov(left.T).reshape(left.shape[1], -1))[1]) + 2 * law.size


def held_like(mask: Sequence[int], rng: np.random.Generator) -> list[int]:
    """Return a mask of repeated samples with the share of one and its mean run: two states, each
    left with the probability with which it was.
    """
    given = np.array(mask)
    stays = {s: np.mean(given[1:][given[:-1] == s] != s) for s in (0, 1) if (given[:-1] == s).any()}
    drawn = [int(rng.random() < given.mean())]
    for _ in given[1:]:
        leaves = rng.random() < stays.get(drawn[-1], 1.0)
        drawn.append(1 - drawn[-1] if leaves else drawn[-1])
    return drawn


def moves_like(
    setpoint: Mapping[str, Any], n: int, Ts: float, rng: np.random.Generator
) -> dict[str, Any]:
    """Return a set point that moves as often and as far as one: people's moves at random times, a
    master controller's by the model of `like`.
    """
    steps = np.array(setpoint["steps"], dtype=float).reshape(-1, 2)
    if not len(steps):
        return dict(setpoint)
    first = float(setpoint["value"])
    held = np.r_[first, steps[:, 1]]
    levels = held[np.searchsorted(steps[:, 0], np.arange(n) * Ts, side="right")]
    if len(steps) < FEW_MOVES * n:
        times = np.sort(rng.choice(np.arange(1, n), len(steps), replace=False)) * Ts
        drawn = _moved(first, np.abs(np.diff(held)), levels, rng)
    else:
        times, drawn = np.arange(1, n) * Ts, like(levels[:, None], rng)[1:, 0]
    moves = [[float(t), short(x)] for t, x in zip(times, drawn, strict=True)]
    return {"value": short(first), "steps": moves}


def _moved(
    first: float, sizes: np.ndarray, levels: np.ndarray, rng: np.random.Generator
) -> list[float]:
    """Return the levels of moves whose sizes have the mean of some, each towards a level that was
    held.
    """
    drawn = [first]
    for goal in np.quantile(levels, rng.random(sizes.size)):
        move = np.sign(goal - drawn[-1]) * sizes.mean() * rng.exponential()
        drawn.append(float(np.clip(drawn[-1] + move, levels.min(), levels.max())))
    return drawn[1:]


def short(x: float) -> float:
    """Return a number with the digits that a drawn one has."""
    return float(f"{x:.{DIGITS}g}")


def without_columns(near: NearLoop, rng: np.random.Generator) -> tuple[NearLoop, list[np.ndarray]]:
    """Return the loop with its columns replaced by draws, and pairs of columns, as they were and as
    drawn, shape (2, n).
    """
    table, pairs = near.loop.to_table(), []
    n, Ts = int(table["sampling"]["n"]), float(table["sampling"]["Ts"])
    for load in table["disturbance"]:
        names = [name for name in RESIDUALS if name in load]
        if names:
            given = np.column_stack([load[name] for name in names])
            drawn = like(given, rng)
            pairs += [np.stack(pair) for pair in zip(given.T, drawn.T, strict=True)]
            load |= {name: [*map(short, x)] for name, x in zip(names, drawn.T, strict=True)}
    archive = table.get("archive", {})
    masks = {key: mask for key, mask in archive.items() if key.endswith("_held")}
    # of both signals at once where they repeat at once: an archive repeats a row
    chain = {str(mask): held_like(mask, rng) for mask in masks.values()}
    archive |= {key: chain[str(mask)] for key, mask in masks.items()}
    table["setpoint"] = moves_like(table["setpoint"], n, Ts, rng)
    return replace(near, loop=Loop.from_table(table, NAME)), pairs


def distances(pairs: Sequence[np.ndarray]) -> list[str]:
    """Return a table: how far drawn columns are from those that they replace."""
    measures = {
        "standard deviation, ratio": lambda x: x.std(),
        "excess kurtosis": kurtosis,
        "correlation of neighbours": lambda x: np.corrcoef(x[1:], x[:-1])[0, 1],
        "the same of magnitudes": lambda x: np.corrcoef(abs(x[1:]), abs(x[:-1]))[0, 1],
    }
    rows = [("", "recorded", "drawn", "median distance", "in 9 of 10 below")]
    for name, of in measures.items():
        was, now = np.array([[of(x) for x in pair] for pair in pairs]).T
        far = np.abs(now / was - 1.0 if "ratio" in name else now - was)
        if "ratio" in name:
            was, now = was / was, now / was
        ends = (np.median(was), np.median(now), np.median(far), np.quantile(far, 0.9))
        rows.append((name, *(f"{x:.2f}" for x in ends)))
    return columns(rows)


def main(words: Sequence[str] | None = None) -> int:
    """Write the table of the grid and print the distances."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n\n")[0])
    parser.add_argument("folders", nargs="+")
    parser.add_argument("-j", "--jobs", type=int, default=1)
    parser.add_argument("--kept", type=Path, help="Folder in which identified loops are kept.")
    parser.add_argument("-o", type=Path, default=Path(str(table_file(NAME))), dest="out")
    asked = parser.parse_args(words)
    records, units = read(asked.folders)
    near = grid_from_records(records, NAME, jobs=asked.jobs, kept=asked.kept).loops
    rng, pairs, loops = np.random.default_rng(SEED), [], {}
    for name, loop in one_a_unit(near, units).items():
        loops[name], own = without_columns(loop, rng)
        pairs += own
    grid = grid_of_loops(loops, NAME, NAME, seed=SEED, jobs=asked.jobs)
    with whole_file(asked.out, "wb") as f:
        f.write(grid.table)
    print(f"{len(records)} records, {len(near)} with a loop near them, of {len(loops)} units;")
    print(f"one loop of each unit, {len(grid)} scenarios, seed {SEED}")
    print(f"{len(pairs)} columns of residuals, and what was drawn in their place")
    print()
    print("\n".join(distances(pairs)))
    return 0


if __name__ == "__main__":
    raise SystemExit(exit_code(main))
