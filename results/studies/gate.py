"""Study of the gate: 40 detectors broken on purpose, 5 changed in small ways that matter, 40 in
ways that change nothing.
"""

from __future__ import annotations

import argparse
import json
import sys
import tempfile
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path
from unittest.mock import patch

import numpy as np

from simbench.bench.check.check import check_books
from simbench.bench.check.check_result import NO_LOSS
from simbench.bench.execute.run import run_grid
from simbench.bench.scenario.oracle import ORACLE
from simbench.bench.store.reading import CODES, RunArrays, RunError, read_table
from simbench.detectors.judge import judge_one
from simbench.detectors.methods import (
    ellipse,
    he,
    horch,
    horch_histogram,
    rossi_scali,
    singhal_salsbury,
    yamashita,
)
from simbench.detectors.plugins.registry import methods as registry
from simbench.detectors.prepared import prepare
from simbench.detectors.record import LoopRecord
from simbench.detectors.report.report import table
from simbench.detectors.signal.ellipse import Ellipse
from simbench.detectors.signal.fits import hammerstein
from simbench.detectors.verdict import NO_DECISION, NO_STICTION, STICTION
from simbench.loop.simulate import simulate
from simbench.scenarios.spec import Loop
from simbench.usage import exit_code

BREAKS = HARMLESS = 40


# what a detector broken on purpose answers, from its true codes and scores
BROKEN = {
    "always stiction": lambda said, score: (np.full_like(said, CODES[STICTION]), score),
    "never stiction": lambda said, score: (np.full_like(said, CODES[NO_STICTION]), score),
    "never decides": lambda said, score: (
        np.full_like(said, CODES[NO_DECISION]),
        np.full_like(score, np.nan),
    ),
    "answers another record": lambda said, score: (np.roll(said, 7), np.roll(score, 7)),
    "score upside down": lambda said, score: (said, -score),
}
LAST_BITS = 4e-16  # another order of sums


def finer(steps: np.ndarray) -> np.ndarray:
    """Return steps of a search, or templates along axis 0, with those half-way between
    neighbours.
    """
    between = (steps[1:] + steps[:-1]) / 2
    return np.insert(steps, np.arange(1, len(steps)), between, axis=0)


def _unit(shapes: np.ndarray) -> np.ndarray:
    return shapes / np.linalg.norm(shapes, axis=-1, keepdims=True)


def exchanged(fit: Callable) -> Callable:
    """Return a fit of ellipses that takes PV for OP and OP for PV, and turns what it finds back:
    other arithmetic, one ellipse.

    >>> t = np.linspace(0, 6, 50)
    >>> x, y = 50 + 3 * np.cos(t), 10 + np.sin(t + 1)
    >>> other, plain = exchanged(ellipse.fit_ellipse)(x, y), ellipse.fit_ellipse(x, y)
    >>> round(other.apparent_stiction / plain.apparent_stiction, 9)
    1.0
    """

    def fitted(x: np.ndarray, y: np.ndarray) -> Ellipse | None:
        e = fit(y, x)
        return e and Ellipse(e.C, e.B, e.A, e.y0, e.x0)

    return fitted


# by name: what takes the place of what (module, name, change), and who is judged with it
_Changes = dict[str, tuple[tuple[tuple[object, str, Callable], ...], tuple[str, ...]]]
REWRITES: _Changes = {
    "finer": (
        (
            (he, "triangles", lambda old: lambda *a: _unit(finer(old(*a)))),
            (rossi_scali, "relays", lambda old: lambda *a: _unit(finer(old(*a)))),
            (
                horch_histogram,
                "_mean_densities",
                lambda old: lambda *a: tuple(finer(x) for x in old(*a)),
            ),
            (hammerstein, "S_FINE", finer),
        ),
        ("he", "rossi_scali", "horch_histogram", "hammerstein", "procedure"),
    ),
    "axes exchanged": (((ellipse, "fit_ellipse", exchanged),), ("ellipse",)),
}


def _scaled_index(place: int, factor: float) -> Callable:
    """Return a change of a function that gives several indices: one of them multiplied."""
    return lambda old: (
        lambda *a: tuple(factor * x if k == place else x for k, x in enumerate(old(*a)))
    )


# small changes of what a method computes that a comparison of rates does not see
SEMANTIC: _Changes = {
    "last half cycle lost": (
        ((he, "triangle_indices", lambda old: lambda humps: old(humps[:-1])),),
        ("he",),
    ),
    "R + 10 %": (
        ((singhal_salsbury, "area_ratio", lambda old: lambda *a: 1.1 * old(*a)),),
        ("singhal_salsbury",),
    ),
    "dtau + 10 %": (((horch, "correlation_indices", _scaled_index(0, 1.1)),), ("horch",)),
    "rho3 + 10 %": (((yamashita, "movement_indices", _scaled_index(2, 1.1)),), ("yamashita",)),
    "every second sample": (
        (
            (
                yamashita,
                "movement_indices",
                lambda old: lambda op, mv, step: old(op[::2], mv[::2], step),
            ),
        ),
        ("yamashita",),
    ),
}


def rewritten(
    base: RunArrays, folder: Path, changed_by: _Changes = REWRITES, last_bits: bool = True
) -> Iterator[tuple[str, str, RunArrays]]:
    """Yield a run as it comes out with one method changed, or with the last bits of its signals
    changed.

    Yields (method, change, the run now).
    """
    plan = [(m, how) for how, (_, who) in changed_by.items() for m in who if m in base.methods]
    plan += [(m, "last bits") for m in base.methods] if last_bits else []
    hows = (*changed_by, *(["last bits"] if last_bits else []))
    ways = {
        how: [(m, registry.load(m).METHOD.defaults()) for m, h in plan if h == how] for how in hows
    }
    verdicts, score = (
        np.empty((len(plan), base.ids.size), np.int8),
        np.empty((len(plan), base.ids.size), np.float32),
    )
    rng = np.random.default_rng(0)
    for k, row in enumerate(read_table(folder, "scenarios", ["loop", "seed"]).to_pylist()):
        record = simulate(Loop.from_table(json.loads(row["loop"])), row["seed"]).record
        answers = []
        for how, (changes, _) in changed_by.items():
            with ExitStack() as changed:
                for module, name, change in changes:
                    changed.enter_context(patch.object(module, name, change(getattr(module, name))))
                answers += _answers(record, ways[how])
        if last_bits:
            answers += _answers(_last_bits(record, rng), ways["last bits"])
        verdicts[:, k], score[:, k] = zip(*answers, strict=True)
    for j, (method, how) in enumerate(plan):
        yield method, how, _with(base, base.methods.index(method), verdicts[j], score[j])


def _last_bits(record: LoopRecord, rng: np.random.Generator) -> LoopRecord:
    def shaken(x: np.ndarray) -> np.ndarray:
        return x * (1.0 + LAST_BITS * rng.choice([-1.0, 0.0, 1.0], x.size))

    mv = None if record.mv is None else shaken(record.mv)
    return replace(record, op=shaken(record.op), pv=shaken(record.pv), mv=mv)


def worsened(
    base: RunArrays, method: str, rng: np.random.Generator
) -> Iterator[tuple[str, RunArrays]]:
    """Yield a run in which one method has become a little worse on the loops that it covers, in
    each way separately.
    """
    i = base.methods.index(method)
    verdicts, score, truth, covered = (
        base.verdict[i],
        base.score[i],
        base.truth["cycled"],
        base.applicable[i] != 0,
    )

    def moved(at: np.ndarray, share: float, to: str) -> RunArrays:
        chosen = rng.choice(
            np.flatnonzero(at),
            round(share * (at | (covered & (truth == truth[at][0]))).sum()),
            replace=False,
        )
        other = verdicts.copy()
        other[chosen] = CODES[to]
        return _with(base, i, other, score)

    yield "finds 2 points less", moved(covered & (truth == 1) & (verdicts == 1), 0.02, NO_STICTION)
    yield (
        "2.2 points more false alarms",
        moved(covered & (truth == 0) & (verdicts == 0), 0.022, STICTION),
    )
    right = covered & (verdicts == truth) & (truth >= 0)
    lost = rng.choice(
        np.flatnonzero(right), round(0.02 * (covered & (truth >= 0)).sum()), replace=False
    )
    other = verdicts.copy()
    other[lost] = 1 - other[lost]
    yield "right on 2 points less", _with(base, i, other, score)
    mixed, shuffled = score.copy(), np.flatnonzero(covered & (rng.random(score.size) < 0.2))
    mixed[shuffled] = score[rng.permutation(shuffled)]
    yield "AUC 5 points less", _with(base, i, verdicts, mixed)


def few(base: RunArrays, method: str) -> RunArrays:
    """Return two loops of the grid, a method wrong on both."""
    i = base.methods.index(method)
    covered = base.applicable[i] != 0
    at = [int(np.flatnonzero((base.truth["cycled"] == k) & covered)[0]) for k in (0, 1)]
    two = _loops(base, np.array(at))
    return _with(two, i, 1 - two.truth["cycled"], two.score[i])


def caught(now: RunArrays, base: RunArrays, exact: bool = False) -> bool:
    """Whether the gate does not let a run pass, with or without `--exact`."""
    try:
        return check_books(now, base, exact=exact).result != NO_LOSS
    except RunError:
        return True


def _without(base: RunArrays, i: int) -> RunArrays:
    wide = ("verdict", "score", "applicable", "failed", "runtime")
    kept = tuple(m for k, m in enumerate(base.methods) if k != i)
    return replace(
        base,
        methods=kept,
        sizes=np.delete(base.sizes, i, axis=1),
        **{name: np.delete(getattr(base, name), i, axis=0) for name in wide},
    )


def _reordered(base: RunArrays, seed: int) -> RunArrays:
    return _loops(base, np.random.default_rng(seed).permutation(base.ids.size))


def _loops(base: RunArrays, at: np.ndarray) -> RunArrays:
    """Return a run of some of the loops, in the order given."""
    wide = ("verdict", "score", "applicable", "failed", "runtime")
    long = ("ids", "digests", "hashes", "oscillating", "groups", "design", "friction")
    tables = {
        name: {k: v[at] for k, v in getattr(base, name).items()} for name in ("axes", "truth")
    }
    arrays = {name: getattr(base, name)[:, at] for name in wide} | {
        name: getattr(base, name)[at] for name in long
    }
    return replace(base, sizes=base.sizes[:, :, at], **arrays, **tables)


def small_changes(folder: Path) -> list[dict[str, object]]:
    """Return what the gate reports of the changes in `SEMANTIC`, on the stored loops of a run or a
    baseline.

    Keys as in `study`.
    """
    base = RunArrays.read(folder)
    cases = [
        (m, how, now, True) for m, how, now in rewritten(base, folder, SEMANTIC, last_bits=False)
    ]
    return [_row(case, base) for case in cases]


def _row(case: tuple[str, str, RunArrays, bool], base: RunArrays) -> dict[str, object]:
    """Return one line of the study: what matters must be caught by `--exact`, what does not matter
    must pass without it.
    """
    method, what, now, wanted = case
    failed, exact = caught(now, base), caught(now, base, exact=True)
    flips = (
        int((now.verdict != base.verdict).sum())
        if now.verdict.shape == base.verdict.shape
        else None
    )
    good = exact and (failed or what in SEMANTIC) if wanted else not failed
    return {
        "method": method,
        "what": what,
        "flips": flips,
        "failed": failed,
        "exact": exact,
        "as_wanted": good,
    }


def study(
    grid: str, axes: dict[str, list], methods: tuple[str, ...] = ("fast",)
) -> list[dict[str, object]]:
    """Return what the gate reports of every broken and every harmlessly changed detector.

    `grid`: name or path, or the folder of a finished run of built-in methods.

    Keys: method, what, flips, failed (the gate did not pass it), exact (nor with `--exact`),
    as_wanted.
    """
    rng = np.random.default_rng(0)
    with tempfile.TemporaryDirectory() as home:
        there = (Path(grid) / "manifest.json").exists()
        folder = Path(grid) if there else run_grid(grid, Path(home) / "base", methods, axes=axes)
        base = RunArrays.read(folder)
        if ORACLE in base.methods:
            base = _without(base, base.methods.index(ORACLE))
        small = [base.methods[k % len(base.methods)] for k in (0, 3, 6, 9)]
        cases = [(m, how, now, True) for m in small for how, now in worsened(base, m, rng)]
        cases += [(m, "2 loops", few(base, m), True) for m in small[:2]]
        ways = [(m, how) for how in BROKEN for m in base.methods]
        left = BREAKS - len(cases)
        chosen = [
            ways[k] for k in np.linspace(0, len(ways) - 1, min(left, len(ways))).round().astype(int)
        ]
        cases += [(m, how, _broken(base, m, how), True) for m, how in chosen]
        cases += [(m, how, now, False) for m, how, now in rewritten(base, folder)]
        others = HARMLESS - sum(not wanted for *_, wanted in cases)
        cases += [
            ("all", f"other order {seed}", _reordered(base, seed), False)
            for seed in range(max(others, 0))
        ]
        rows: list[dict[str, object]] = [_row(case, base) for case in cases]
        rows += small_changes(folder)
    return rows


def _broken(base: RunArrays, method: str, how: str) -> RunArrays:
    i = base.methods.index(method)
    return _with(base, i, *BROKEN[how](base.verdict[i], base.score[i]))


def _with(base: RunArrays, i: int, verdicts: np.ndarray, score: np.ndarray) -> RunArrays:
    verdict, scores = base.verdict.copy(), base.score.copy()
    verdict[i], scores[i] = verdicts, score
    return replace(base, verdict=verdict, score=scores)


def _answers(
    record: LoopRecord, chosen: list[tuple[str, dict[str, float]]]
) -> list[tuple[int, float]]:
    blind = prepare(record.without_mv())
    sighted = blind.with_mv(record)
    answers = []
    for name, values in chosen:
        module = registry.load(name)
        verdict = judge_one(
            name, module, sighted if module.METHOD.needs_mv else blind, False, values
        )
        unheard = (
            module.METHOD.front_end
            and not blind.oscillation.sustained
            and verdict.verdict != NO_DECISION
        )
        answers.append((CODES[verdict.verdict], -np.inf if unheard else verdict.score))
    return answers


def main(arguments: list[str] | None = None) -> int:
    """Print every case and how many came out as wanted: `python -m results.studies.gate`; 1 unless
    all did.
    """
    parser = argparse.ArgumentParser(prog="python -m results.studies.gate", description=__doc__)
    parser.add_argument(
        "grid", nargs="?", default="ci", help="name or file, or the folder of a run"
    )
    parser.add_argument("--disturbance", nargs="+", help="only loops with these (default: all)")
    parser.add_argument(
        "--small",
        action="store_true",
        help="only the small changes, on the loops of a run or a baseline",
    )
    chosen = parser.parse_args(arguments)
    axes = {"disturbance": chosen.disturbance} if chosen.disturbance else {}
    rows = small_changes(Path(chosen.grid)) if chosen.small else study(chosen.grid, axes)
    print("\n".join(table(rows)))
    right = sum(bool(row["as_wanted"]) for row in rows)
    print(f"{right} of {len(rows)} as wanted")
    return int(right < len(rows))


if __name__ == "__main__":
    sys.exit(exit_code(main))
