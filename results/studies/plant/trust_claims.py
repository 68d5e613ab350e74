"""Do trust's claims hold? `python -m results.studies.plant.trust_claims FOLDER` asks it about loops
whose truth is known.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from tqdm import tqdm

from results.studies.plant.answers import answered
from simbench.bench.scenario.resolve import resolve
from simbench.bench.statistics import mcnemar, wilson
from simbench.detectors.errors import UserError
from simbench.detectors.judge import judge
from simbench.detectors.record import LoopRecord
from simbench.detectors.report.report import choose_methods
from simbench.detectors.verdict import NO_STICTION, STICTION
from simbench.files import FileError, folder
from simbench.gap.stiction.friction import probability_of_stiction
from simbench.gap.stiction.probability import CLAIMED_FROM
from simbench.loop.setup import plain_setup
from simbench.loop.simulate import simulate
from simbench.plant.trust.trust import trust
from simbench.scenarios.errors import SpecError
from simbench.scenarios.grid import load_grid
from simbench.scenarios.spec import Loop, Part, Scenario
from simbench.usage import exit_code

GRID = "plant"
TESTING = 12  # seed of the order in which loops are drawn
PROCEDURE = "procedure"  # with which trust is compared
RUNS = 10  # of the true loop, sticky and healthy each
FITTED = 3  # of the sticky ones, in which friction's likelihood is asked for as well
CLOSE = 0.1  # by which a claim may differ from what was measured
BOOTSTRAPS = 1000
PLAIN, BURIED = (
    0.8,
    0.3,
)  # sensitivity minus false alarms of the best method: plainly visible above, buried below
BINS = 4  # of probability, for its calibration


def loops(count: int, seed: int, grid: str = GRID) -> Iterator[Scenario]:
    """Yield loops of a grid in random order: one of each group, then the others; even seeds draw
    from odd groups.
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
    """Return whether one loop sticks, the probability of stiction without MV, and whether the
    procedure calls it.
    """
    run = simulate(scenario.loop, scenario.seed)
    record = run.record.without_mv()
    called = judge(record, [PROCEDURE])[0].verdict == STICTION
    return {"sticky": run.sticky, "probability": probability_of_stiction(record), PROCEDURE: called}


def kept(
    out: Path, count: int, seed: int, ask: Callable[[Scenario], dict[str, Any]]
) -> list[dict[str, Any]]:
    """Return the answers on loops of the grid; earlier ones are read from the
    folder.
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


def main(arguments: list[str] | None = None) -> int:
    """Ask trust about simulated loops, run the same loops again and again, and print claims with
    what was measured.
    """
    parser = argparse.ArgumentParser(
        prog="python -m results.studies.plant.trust_claims", description=__doc__
    )
    parser.add_argument(
        "out", metavar="FOLDER", help="Where the answers are kept; goes on where it stopped."
    )
    parser.add_argument("-n", type=int, default=40, help="Loops to ask about [40].")
    parser.add_argument(
        "--weighed",
        type=int,
        default=200,
        help="Loops whose probability is checked, which needs no twins [200].",
    )
    chosen = parser.parse_args(arguments)
    weighed = kept(Path(chosen.out) / "weighed", chosen.weighed, TESTING, looked_at)
    rows = kept(Path(chosen.out) / "twins", chosen.n, TESTING, checked)
    claims_of_loops = [
        *_probability(weighed),
        "",
        *_claims([r for r in rows if r["best"]]),
        *_visible(rows),
        *who_is_right(rows),
    ]
    print("\n".join(claims_of_loops))
    return 0


def checked(scenario: Scenario) -> dict[str, Any]:
    """Return the answer of trust on one loop's record without MV, and the truth.

    Parameters
    ----------
    scenario : Scenario

    Returns
    -------
    dict
        sticky; said, probability, smallest_visible, methods (rows of the contract); best, the
        method to trust with its reading of the record, None without twins; and what `measured`
        returns.
    """
    run = simulate(scenario.loop, scenario.seed)
    return {
        "sticky": run.sticky,
        **claimed(run.record.without_mv()),
        **measured(scenario, choose_methods(["all"])),
    }


def claimed(record: LoopRecord) -> dict[str, Any]:
    """Return the answer of trust on a record: what `checked` returns without the truth."""
    trusted = trust(record, help_wanted=False)
    answer = trusted.as_json()
    best = (
        None
        if trusted.best is None
        else {"method": trusted.best.verdict.method, "says": trusted.best.verdict_here}
    )
    shown = {k: answer[k] for k in ("probability", "methods", "smallest_visible")}
    return {"said": trusted.conclusion.verdict, "best": best, **shown}


def measured(scenario: Scenario, methods: list[str]) -> dict[str, Any]:
    """Return how often every method calls the true loop stiction, with its valve and, if that
    sticks, with a sound one.

    Parameters
    ----------
    scenario : Scenario
    methods : list of str

    Returns
    -------
    dict
        healthy, with_friction: dict of method to share, the latter None for a sound loop; fitted:
        share of runs with friction in which trust calls stiction probable; S, J (%).
    """
    S, J = max(plain_setup(scenario.loop, 0).bands)
    sound = (
        scenario.loop if S <= 0 else scenario.loop.model_copy(update={"valve": Part(name="ideal")})
    )
    return {
        "S": S, "J": J, "healthy": shares(sound, scenario.seed, methods),
        "with_friction": shares(scenario.loop, scenario.seed, methods) if S > 0 else None,
        "fitted": fitted(scenario.loop, scenario.seed) if S > 0 else None,
    }  # fmt: skip


def fitted(loop: Loop, seed: int) -> float:
    """Return the share of runs of a loop in which trust calls stiction probable."""
    diagnosis = [
        probability_of_stiction(simulate(loop, seed + 1000 + i).record.without_mv())
        for i in range(FITTED)
    ]
    verdict = [p > CLAIMED_FROM for p in diagnosis if p is not None]
    return float(np.mean(verdict)) if verdict else 0.0


def shares(loop: Loop, seed: int, methods: list[str]) -> dict[str, float]:
    """Return the share of runs of a loop that every method calls stiction."""
    called = [
        [
            v.verdict == STICTION
            for v in judge(simulate(loop, seed + 1000 + i).record.without_mv(), methods)
        ]
        for i in range(RUNS)
    ]
    return dict(zip(methods, np.mean(called, axis=0).tolist()))


def _claims(rows: list[dict[str, Any]]) -> list[str]:
    lines = [
        (
            f"{len(rows)} loops, {RUNS} runs each with and without friction; claimed on twins, then"
            " measured on the loop itself"
        ),
        f"{'method':<18} {'false alarms':>14} {'off by':>7}   {'power':>14} {'off by':>7}",
    ]
    methods = list(rows[0]["healthy"])
    for m in methods:
        text = f"{m:<18}"
        for both in (_alarms(rows, m), _power(rows, m)):
            a, b = both.mean(axis=0)
            text += f" {a:>6.2f} {b:>7.2f} {np.abs(both[:, 0] - both[:, 1]).mean():>7.2f}  "
        lines.append(text.rstrip())
    sound = [r for r in rows if r["with_friction"] is None]
    near = [
        _near([of(some, m) for m in methods])
        for of, some in ((_alarms, rows), (_alarms, sound), (_power, rows))
    ]
    return [
        *lines,
        (
            f"false alarms claimed within .1 of those measured, mean over the loops: {near[0]}"
            f" methods; power: {near[2]}"
        ),
        f"the same over the {len(sound)} loops whose own valve is sound: {near[1]} methods",
    ]


def _alarms(rows: list[dict[str, Any]], method: str) -> np.ndarray:
    """Return false alarms claimed and measured, shape (loops, 2)."""
    return np.array([(_of(r, method)["false_alarms"], r["healthy"][method]) for r in rows]).reshape(
        -1, 2
    )


def _power(rows: list[dict[str, Any]], method: str) -> np.ndarray:
    """Return power claimed and measured at S and J of the loop, shape (sticky loops, 2)."""
    sticky = [r for r in rows if r["with_friction"] is not None]
    pairs = [
        (_at(_of(r, method)["power"], r["S"], r["J"]), r["with_friction"][method]) for r in sticky
    ]
    return np.array(pairs).reshape(-1, 2)


def _near(pairs: list[np.ndarray]) -> str:
    close = [bool(both.size) and abs(np.subtract(*both.mean(axis=0))) <= CLOSE for both in pairs]
    return f"{sum(close)} of {len(close)}"


def _at(cells: list[dict[str, float]], S: float, J: float) -> float:
    """Return the sensitivity in the cell nearest to (S, J) in logarithms."""
    ratio = max(J, 0.05 * S) / S
    return min(cells, key=lambda c: abs(np.log(c["S"] / S)) + abs(np.log(c["J"] / c["S"] / ratio)))[
        "found"
    ]


def _probability(rows: list[dict[str, Any]]) -> list[str]:
    rows = [r for r in rows if r["probability"] is not None]
    p = np.array([r["probability"] for r in rows])
    sticky = np.array([r["sticky"] for r in rows])
    # trust assumes even odds before looking: sticky and healthy loops count the same
    w = np.where(sticky, 0.5 / max(sticky.sum(), 1), 0.5 / max((~sticky).sum(), 1))
    lines = [
        f"probability of stiction, {len(rows)} loops, {sticky.sum()} sticky: claimed, share sticky,"
        " loops"
    ]
    for here in _bins(p):
        if here.any():
            share = np.average(sticky[here], weights=w[here])
            lines.append(f"{np.average(p[here], weights=w[here]):.2f}  {share:.2f}  {here.sum()}")
    rng = np.random.default_rng(0)
    picks = [rng.integers(len(rows), size=len(rows)) for _ in range(BOOTSTRAPS)]
    lo, hi = np.quantile([_error(p[k], sticky[k], w[k]) for k in picks], [0.025, 0.975])
    lines.append(
        f"expected calibration error {_error(p, sticky, w):.3f} (95 % of bootstraps {lo:.3f} to"
        f" {hi:.3f}: upwards biased)"
    )
    right = {"trust": p > 0.5, PROCEDURE: np.array([r[PROCEDURE] for r in rows])}
    share = {
        name: 0.5 * (called[sticky].mean() + (~called[~sticky]).mean())
        for name, called in right.items()
    }
    lines.append(
        "right, sticky and healthy loops counting the same:"
        f" {', '.join(f'{n} {s:.2f}' for n, s in share.items())}"
    )
    sure = p > CLAIMED_FROM
    lines.append(
        f"stiction claimed: {out_of(int(sure[sticky].sum()), int(sticky.sum()))} of the sticky, "
        f"{out_of(int(sure[~sticky].sum()), int((~sticky).sum()))} of the healthy"
    )
    return [
        *lines,
        f"Brier score {np.average((p - sticky) ** 2, weights=w):.3f} (even odds: 0.250)",
    ]


def _bins(p: np.ndarray) -> list[np.ndarray]:
    return [(p >= i / BINS) & ((p < (i + 1) / BINS) | (i == BINS - 1)) for i in range(BINS)]


def _error(p: np.ndarray, sticky: np.ndarray, w: np.ndarray) -> float:
    return float(
        sum(abs(np.sum(w[here] * (p[here] - sticky[here]))) for here in _bins(p)) / w.sum()
    )


def _visible(rows: list[dict[str, Any]]) -> list[str]:
    """Return how often friction's size was called invisible: by the detectors' claim, and by the
    answer as a whole.
    """
    lines = []
    for whose in ("detectors", "detectors and likelihood"):
        counts = {"buried": [0, 0, 0], "plainly visible": [0, 0, 0]}
        for r in rows:
            if r["with_friction"] is None or r["best"] is None:
                continue
            best = max(r["with_friction"][m] - r["healthy"][m] for m in r["healthy"])
            best = best if whose == "detectors" else max(best, r["fitted"])
            kind = "plainly visible" if best >= PLAIN else "buried" if best <= BURIED else None
            if kind is not None:
                small = r["smallest_visible"] is None or r["S"] < r["smallest_visible"]["S"]
                now = (small, small and r["said"] == NO_STICTION, True)
                counts[kind] = [k + bool(x) for k, x in zip(counts[kind], now)]
        lines += ["", f"friction as {whose} see it on runs of the loop itself:"]
        for kind, (claim, answer, n) in counts.items():
            below = f"below the smallest that detectors show {out_of(claim, n)}"
            lines.append(
                f"{kind}: {below}; the answer denies it or says that it cannot be seen"
                f" {out_of(answer, n)}"
            )
    return lines


def out_of(k: int, n: int) -> str:
    """Return k of n with the 95 % interval of their ratio."""
    lo, hi = wilson(k, n) if n else (0.0, 1.0)
    return f"{k} of {n} ({lo:.2f} to {hi:.2f})"


def who_is_right(rows: list[dict[str, Any]]) -> list[str]:
    """Return who is right how often: the detector picked per loop, trust itself, and the best
    detector in hindsight.

    Parameters
    ----------
    rows : list of dict
        sticky, probability, methods and best, as `checked` gives them.

    Returns
    -------
    list of str
    """
    twins = [r for r in rows if r["best"] is not None]
    right = {
        c["method"]: [_right(_of(r, c["method"])["verdict"], r["sticky"]) for r in twins]
        for c in twins[0]["methods"]
    }
    best = max(right, key=lambda m: sum(right[m]))
    asked = {
        "detector picked per loop, read as advised": [
            _right(r["best"]["says"], r["sticky"]) for r in twins
        ],
        "probability above one half": [(r["probability"] > 0.5) == r["sticky"] for r in twins],
    }
    lines = [
        "",
        (
            f"right on {len(twins)} loops: best detector in hindsight ({best})"
            f" {np.mean(right[best]):.2f}"
        ),
    ]
    for name, ok in asked.items():
        won = sum(b and not a for a, b in zip(right[best], ok))
        lost = sum(a and not b for a, b in zip(right[best], ok))
        lines.append(
            f"{name} {np.mean(ok):.2f} ({won} won, {lost} lost, p = {mcnemar(lost, won):.3f})"
        )
    return lines


def _of(row: dict[str, Any], method: str) -> dict[str, Any]:
    return next(c for c in row["methods"] if c["method"] == method)


def _right(verdict: str, sticky: bool) -> bool:
    return verdict == (STICTION if sticky else NO_STICTION)


if __name__ == "__main__":
    raise SystemExit(exit_code(main))
