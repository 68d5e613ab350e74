"""Study of the gate, quick: detectors broken on purpose, and rewritten in ways that change nothing that matters."""

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

from detectors.methods import ellipse, he, horch_histogram, rossi_scali
from detectors.plugins.registry import methods as registry
from detectors.record import LoopRecord
from detectors.report.report import table
from detectors.signal import hammerstein
from detectors.signal.ellipse import Ellipse
from results.studies.check_study import BROKEN, _answers, _broken, _with
from scenarios.spec import Loop
from simbench.bench.execute.run import run_grid
from simbench.bench.score.check import compare_books
from simbench.bench.store.reading import Book, read_table
from simbench.loop.simulate import simulate
from simbench.usage import exit_code

BREAKS = 20
LAST_BITS = 4e-16  # another order of sums


def finer(steps: np.ndarray) -> np.ndarray:
    """Return steps of a search, or templates along axis 0, with those half-way between neighbours.

    Examples
    --------
    >>> finer(np.array([1.0, 2.0, 4.0]))
    array([1. , 1.5, 2. , 3. , 4. ])
    """
    between = (steps[1:] + steps[:-1]) / 2
    return np.insert(steps, np.arange(1, len(steps)), between, axis=0)


def _unit(shapes: np.ndarray) -> np.ndarray:
    return shapes / np.linalg.norm(shapes, axis=-1, keepdims=True)


def exchanged(fit: Callable) -> Callable:
    """Return a fit of ellipses that takes PV for OP and OP for PV, and turns what it finds back: other arithmetic, one ellipse.

    Examples
    --------
    >>> t = np.linspace(0, 6, 50)
    >>> x, y = 50 + 3 * np.cos(t), 10 + np.sin(t + 1)
    >>> round(exchanged(ellipse.fit_ellipse)(x, y).apparent_stiction / ellipse.fit_ellipse(x, y).apparent_stiction, 9)
    1.0
    """

    def fitted(x: np.ndarray, y: np.ndarray) -> Ellipse | None:
        found = fit(y, x)
        return found and Ellipse(found.C, found.B, found.A, found.y0, found.x0)

    return fitted


# by name: what takes the place of what (module, name, change), and who is judged with it
REWRITES: dict[str, tuple[tuple[tuple[object, str, Callable], ...], tuple[str, ...]]] = {
    "finer": (
        (
            (he, "triangles", lambda old: lambda *a: _unit(finer(old(*a)))),
            (rossi_scali, "relays", lambda old: lambda *a: _unit(finer(old(*a)))),
            (horch_histogram, "_densities", lambda old: lambda: tuple(finer(x) for x in old())),
            (hammerstein, "S_FINE", finer),
        ),
        ("he", "rossi_scali", "horch_histogram", "hammerstein", "procedure"),
    ),
    "axes exchanged": (((ellipse, "fit_ellipse", exchanged),), ("ellipse",)),
}


def rewritten(base: Book, folder: Path) -> Iterator[tuple[str, str, Book]]:
    """Yield a run as it comes out with one method rewritten, or with the last bits of its signals changed.

    Parameters
    ----------
    base : Book
        The run.
    folder : Path
        Its folder: every record is simulated again.

    Yields
    ------
    method, rewrite : str
    now : Book
    """
    plan = [(m, how) for how, (_, who) in REWRITES.items() for m in who if m in base.methods]
    plan += [(m, "last bits") for m in base.methods]
    ways = {how: [(m, registry.load(m).METHOD.defaults()) for m, h in plan if h == how] for how in (*REWRITES, "last bits")}
    said, score = np.empty((len(plan), base.ids.size), np.int8), np.empty((len(plan), base.ids.size), np.float32)
    rng = np.random.default_rng(0)
    for k, row in enumerate(read_table(folder, "scenarios", ["loop", "seed"]).to_pylist()):
        record = simulate(Loop.from_table(json.loads(row["loop"])), row["seed"]).record
        answers = []
        for how, (changes, _) in REWRITES.items():
            with ExitStack() as changed:
                for module, name, change in changes:
                    changed.enter_context(patch.object(module, name, change(getattr(module, name))))
                answers += _answers(record, ways[how])
        said[:, k], score[:, k] = zip(*answers, *_answers(_last_bits(record, rng), ways["last bits"]))
    for j, (method, how) in enumerate(plan):
        yield method, how, _with(base, base.methods.index(method), said[j], score[j])


def _last_bits(record: LoopRecord, rng: np.random.Generator) -> LoopRecord:
    def shaken(x: np.ndarray) -> np.ndarray:
        return x * (1.0 + LAST_BITS * rng.choice([-1.0, 0.0, 1.0], x.size))

    mv = None if record.mv is None else shaken(record.mv)
    return replace(record, op=shaken(record.op), pv=shaken(record.pv), mv=mv)


def study(grid: str, axes: dict[str, list], methods: tuple[str, ...] = ("fast",)) -> list[dict[str, object]]:
    """Return what the gate says of every broken and every rewritten detector.

    Parameters
    ----------
    grid : str
        Name or path.
    axes : dict of str to list
        Fewer values of its axes.
    methods : tuple of str
        Ids or sets.

    Returns
    -------
    list of dict
        method, what, flips, failed, as_wanted.
    """
    with tempfile.TemporaryDirectory() as home:
        folder = run_grid(grid, Path(home) / "base", methods, axes=axes)
        base = Book.read(folder)
        ways = [(m, how) for how in BROKEN for m in base.methods]
        step = max(len(ways) // BREAKS, 1)
        cases = [(m, how, _broken(base, m, how), True) for m, how in ways[::step][:BREAKS]]
        cases += [(m, how, now, False) for m, how, now in rewritten(base, folder)]
        rows = []
        for method, what, now, wanted in cases:
            found = compare_books(now, base)
            kind = {"method": method, "what": what, "flips": len(found.flips), "failed": found.failed}
            rows.append({**kind, "as_wanted": found.failed == wanted})
    return rows


def main(arguments: list[str] | None = None) -> int:
    """Print every case and how many came out as wanted: `python -m results.studies.gate`; 1 unless all did.

    Parameters
    ----------
    arguments : list of str, optional
        In place of sys.argv.

    Returns
    -------
    int
    """
    parser = argparse.ArgumentParser(prog="python -m results.studies.gate", description=__doc__)
    parser.add_argument("grid", nargs="?", default="ci", help="name or file")
    parser.add_argument("--disturbance", nargs="+", default=["none"], help="only loops with these")
    chosen = parser.parse_args(arguments)
    rows = study(chosen.grid, {"disturbance": chosen.disturbance})
    print("\n".join(table(rows)))
    right = sum(bool(row["as_wanted"]) for row in rows)
    print(f"{right} of {len(rows)} as wanted")
    return int(right < len(rows))


if __name__ == "__main__":
    sys.exit(exit_code(main))
