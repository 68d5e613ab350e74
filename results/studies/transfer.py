"""Does the ranking transfer? `python -m results.studies.transfer FOLDER`: the methods' order on
grids, worlds and real units.

Every method that does without MV judges as many loops of each home, half of them sticky; its cost
is that of the score table (an error 1, no decision .5), sticky and sound loops counting the same.
Spearman's rank correlation of the costs between two homes measures how far an order of one holds
on the other. Learned yardsticks are compared with the methods: gradient boosting on features of
OP and PV, and a ridge on convolutions of both as recorded, each trained on one home and judged on
all. Slow methods judge the first loops only and are left out of the correlations. An order cannot
agree with another home's better than with itself: the last table has how far two halves of a home
agree, the whole home by Spearman and Brown, and how many loops an agreement of .9 would take.
Answers are kept in the folder; it goes on where it stopped.
"""

from __future__ import annotations

import argparse
import tempfile
from collections.abc import Callable, Iterator
from functools import partial
from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np
from scipy import stats

from results.studies.plant.answers import answered
from results.studies.plant.recorded_loops import records
from results.studies.plant.stiction_probability import entry
from results.studies.withheld.files import write_item
from results.studies.worlds import load_world
from simbench.bench.scenario.resolve import resolve
from simbench.bench.scenario.truth import simulate_with_truth
from simbench.detectors.judge import judge
from simbench.detectors.plugins.registry import methods as registry
from simbench.detectors.record import LoopRecord
from simbench.detectors.records.io import read_record
from simbench.detectors.signal.oscillation import detrend, find_oscillation
from simbench.detectors.verdict import NO_DECISION, STICTION
from simbench.detectors.views import columns
from simbench.files import folder, write_table
from simbench.progress import Progress
from simbench.scenarios.grid import load_grid
from simbench.usage import exit_code

GRIDS, BLIND, REAL = ("chapter", "plant"), ("own", "refinery"), "real"
SEED = 90210  # of no grid and no blind check
LENGTH, CYCLES = 256, 8  # samples and cycles of a record that the convolutions see
DILATIONS = (1, 2, 4, 8, 16)
BIASES = (-1.0, 0.3, 1.0)
FOLDS, DRAWS = 5, 1000
BLOCKS = 20  # of groups, of which the jackknife leaves out one at a time
MOST = 0.999  # a correlation of one has no transformed value
WANTED = 0.9  # agreement of a home with itself


def methods() -> list[str]:
    """Return the methods that are ranked: those that see OP and PV alone, without nonlinearity
    tests.
    """
    about = {name: registry.load(name).METHOD for name in registry.every_name()}
    return [name for name, m in about.items() if not m.needs_mv and m.role != "nonlinearity"]


def slow(names: list[str]) -> list[str]:
    """Return the methods that are too dear for every loop."""
    about = {name: registry.load(name).METHOD for name in names}
    return [name for name in names if about[name].budget == "full" or name in registry.alone]


def asked(home: str, number: int, names: list[str]) -> dict[str, Any]:
    """Judge one simulated loop, odd numbers sticky, by some methods.

    Keys: sticky, group, said (method to 1, 0, or -1 for no decision), features, trace.
    """
    sticky = number % 2 == 1
    if home in GRIDS:
        return _judged(_of_grid(home, number, sticky), sticky, number, names)
    item = load_world(home).draw(SEED, number, entry(number))
    with tempfile.TemporaryDirectory() as place:
        return _judged(read_record(write_item(item, Path(place), "loop")[0]), sticky, number, names)


def _of_grid(grid: str, number: int, cycling: bool) -> LoopRecord:
    source, rng = (
        load_grid(grid, {"seed": SEED}),
        np.random.default_rng([SEED, GRIDS.index(grid), number]),
    )
    while True:
        members = list(resolve(source.group(int(rng.integers(source.group_count)))))
        for i in rng.permutation(len(members)):
            run, cycled = simulate_with_truth(members[i].loop, members[i].seed)
            if cycled.answer == ("yes" if cycling else "no"):
                return run.record.without_mv()


def _judged(record: LoopRecord, sticky: bool, group: Any, names: list[str]) -> dict[str, Any]:
    verdicts = {
        v.method: -1 if v.verdict == NO_DECISION else int(v.verdict == STICTION)
        for v in judge(record, names)
    }
    return {
        "sticky": sticky,
        "group": group,
        "said": verdicts,
        "features": features(record),
        "trace": trace(record),
    }


def features(record: LoopRecord) -> list[float]:
    """Return what papers compute of OP and PV: shapes, spectra, their correlation, and how
    regularly they swing.
    """
    swing = find_oscillation(record.op, record.pv, record.Ts)
    period = swing.period_s / record.Ts if np.isfinite(swing.period_s) else record.n / CYCLES
    op, pv = (_scaled(detrend(np.asarray(x, dtype=float))) for x in (record.op, record.pv))
    columns = [float(swing.sustained), swing.regularity, record.n / period, period]
    for x in (op, pv):
        moves = np.diff(x)
        power = np.abs(np.fft.rfft(x * np.hanning(x.size))) ** 2
        at, total = np.fft.rfftfreq(x.size) * period, power.sum() or 1.0
        lines = [power[np.abs(at - k) < 0.25].sum() / total for k in (1, 2, 3, 5)]
        columns += [
            stats.skew(x),
            stats.kurtosis(x),
            stats.skew(moves),
            stats.kurtosis(moves),
            *lines,
        ]
        columns += [
            np.mean(np.abs(moves) < 0.1 * (moves.std() or 1.0)),
            power[at > 10].sum() / total,
        ]
    lags = [round(k * period / 8) for k in range(-4, 5)]
    columns += [
        float(np.mean(op[max(k, 0) : op.size + min(k, 0)] * pv[max(-k, 0) : pv.size + min(-k, 0)]))
        for k in lags
    ]
    columns.append(float(np.mean(op[:-1] * pv[1:] - op[1:] * pv[:-1])) * period)
    return [float(np.clip(x, -1e6, 1e6)) if np.isfinite(x) else 0.0 for x in columns]


def trace(record: LoopRecord) -> list[list[float]]:
    """Return the middle cycles of OP and PV, each scaled and on as many samples."""
    swing = find_oscillation(record.op, record.pv, record.Ts)
    wanted = CYCLES * swing.period_s / record.Ts if swing.sustained else record.n
    half = 0.5 * min(wanted, record.n - 1)
    at = np.linspace(0.5 * (record.n - 1) - half, 0.5 * (record.n - 1) + half, LENGTH)
    return [
        np.round(_scaled(np.interp(at, np.arange(record.n), x)), 4).tolist()
        for x in (record.op, record.pv)
    ]


def _scaled(x: np.ndarray) -> np.ndarray:
    return (x - x.mean()) / (x.std() or 1.0)


def convolved(traces: np.ndarray) -> np.ndarray:
    """Return shares of time in which convolutions of OP, PV and their sum exceed a bias:
    MiniRocket's features.

    Dempster, Schmidt and Webb (2021), KDD, 248: kernels of nine weights, three of them 2, the
    others -1, dilated; biases are `BIASES` times the convolution's standard deviation, as symmetric
    waves spend half of their time above 0.
    """
    signals = [traces[:, 0], traces[:, 1], traces.sum(axis=1)]
    columns = []
    for x in signals:
        for step in DILATIONS:
            size = x.shape[1] - 8 * step
            shifted = [x[:, k * step : k * step + size] for k in range(9)]
            whole = np.sum(shifted, axis=0)
            for three in combinations(range(9), 3):
                out = 3.0 * sum(shifted[k] for k in three) - whole
                spread = out.std(axis=1, keepdims=True)
                columns += [(out > bias * spread).mean(axis=1) for bias in BIASES]
    return np.column_stack(columns)


def _boosting() -> Any:
    from sklearn.ensemble import HistGradientBoostingClassifier

    return HistGradientBoostingClassifier(random_state=0, max_iter=60)


def _ridge() -> Any:
    from sklearn.linear_model import RidgeClassifierCV
    from sklearn.pipeline import make_pipeline
    from sklearn.preprocessing import StandardScaler

    return make_pipeline(StandardScaler(), RidgeClassifierCV(np.logspace(0, 5, 8)))


LEARNED: dict[str, tuple[str, Callable[[], Any]]] = {
    "boosting": ("features", _boosting),
    "convolutions": ("kernels", _ridge),
}


class Home:
    """The loops of one grid, world or set of records, and the verdicts on them."""

    def __init__(self, rows: list[dict[str, Any]]) -> None:
        self.sticky = np.array([r["sticky"] for r in rows])
        self.groups = np.unique([str(r["group"]) for r in rows], return_inverse=True)[1]
        self._members = [np.flatnonzero(self.groups == g) for g in range(self.groups.max() + 1)]
        self.x = {"features": np.array([r["features"] for r in rows])}
        self.x["kernels"] = convolved(np.array([r["trace"] for r in rows]))
        # NaN where a slow method was not asked
        verdicts = {m: np.array([r["said"].get(m, np.nan) for r in rows]) for m in rows[0]["said"]}
        self.costs = {
            m: np.where(np.isnan(x), np.nan, _cost(x, self.sticky)) for m, x in verdicts.items()
        }

    def learn(self, name: str, homes: dict[str, Home], source: str) -> None:
        """Train a yardstick here and judge every home; this one by folds."""
        kind, make = LEARNED[name]
        model = make().fit(self.x[kind], self.sticky)
        for where, home in homes.items():
            predicted = model.predict(home.x[kind])
            if where == source:
                for k in range(FOLDS):
                    here = home.groups % FOLDS == k
                    if not here.any():
                        continue
                    predicted[here] = (
                        make()
                        .fit(self.x[kind][~here], self.sticky[~here])
                        .predict(self.x[kind][here])
                    )
            home.costs[f"{name}, {source}"] = _cost(predicted.astype(int), home.sticky)

    def mean(self, names: list[str], at: np.ndarray | None = None) -> np.ndarray:
        """Return balanced costs of some methods, of all loops or of some, where they were asked."""
        cost = np.array([self.costs[m] for m in names])
        cost, sticky = (cost, self.sticky) if at is None else (cost[:, at], self.sticky[at])
        return 0.5 * (np.nanmean(cost[:, sticky], axis=1) + np.nanmean(cost[:, ~sticky], axis=1))

    def half(self, rng: np.random.Generator, which: int) -> np.ndarray:
        """Return the loops of one half of the groups.

        `rng`: source of chance; the same state gives both halves.
        """
        while True:
            chosen = rng.permutation(len(self._members))[which::2]
            at = np.concatenate([self._members[g] for g in chosen])
            if 0 < self.sticky[at].sum() < at.size:
                return at

    def without_blocks(self, rng: np.random.Generator) -> Iterator[np.ndarray]:
        """Yield the loops without one block of groups after the other."""
        for block in np.array_split(rng.permutation(len(self._members)), BLOCKS):
            left = np.setdiff1d(np.arange(len(self._members)), block)
            yield np.concatenate([self._members[g] for g in left])


def _cost(verdicts: np.ndarray, sticky: np.ndarray) -> np.ndarray:
    return np.where(verdicts < 0, 0.5, verdicts != sticky)


def _rank(one: np.ndarray, other: np.ndarray) -> float:
    return float(stats.spearmanr(one, other).statistic)


def _interval(
    value: float, one: Home, other: Home, names: list[str], rng: np.random.Generator
) -> tuple[float, float]:
    """Return a 95 % interval of a correlation: by the jackknife over blocks of groups, of the
    transformed value (Fisher 1921), of which neither end lies beyond one.

    Not by drawing loops again, which lowers the correlation itself: its interval misses the value.
    """
    centre = _stretched(value)
    variance = 0.0
    for home, fixed in ((one, other.mean(names)), (other, one.mean(names))):
        left = [_stretched(_rank(home.mean(names, at), fixed)) for at in home.without_blocks(rng)]
        variance += (len(left) - 1) * float(np.nanvar(left))
    half = 1.96 * np.sqrt(variance)
    return min(float(np.tanh(centre - half)), value), max(float(np.tanh(centre + half)), value)


def _stretched(correlation: float) -> float:
    return float(np.arctanh(np.clip(correlation, -MOST, MOST)))


def order(homes: dict[str, Home], names: list[str]) -> Iterator[dict[str, Any]]:
    """Yield Spearman's correlation of the methods' costs between any two homes, and between the
    halves of one.

    Keys: first, second, spearman, lo, hi (95 % by the jackknife; of halves: the spread over
    splits); of halves also whole (the agreement of the whole home by Spearman and Brown) and loops
    (how many would give `WANTED`).
    """
    rng = np.random.default_rng(SEED)
    for a, b in combinations(homes, 2):
        value = _rank(homes[a].mean(names), homes[b].mean(names))
        lo, hi = _interval(value, homes[a], homes[b], names, rng)
        yield {"first": a, "second": b, "spearman": value, "lo": lo, "hi": hi}
    for name, home in homes.items():
        many = []
        for k in range(DRAWS // 5):
            halves = [home.half(np.random.default_rng([SEED, k]), which) for which in (0, 1)]
            many.append(_rank(*(home.mean(names, at) for at in halves)))
        ends = np.nanquantile(many, [0.025, 0.5, 0.975])
        half = {
            "first": name,
            "second": name,
            "spearman": float(ends[1]),
            "lo": float(ends[0]),
            "hi": float(ends[2]),
        }
        whole, loops = reliability(half["spearman"], home.sticky.size)
        yield {**half, "whole": whole, "loops": loops}


def reliability(half: float, loops: int) -> tuple[float, float]:
    """Return how far as many other loops would agree with these, from the agreement of halves, and
    how many give `WANTED`.

    Spearman (1910) and Brown (1910), Br. J. Psychol. 3, 271 and 296: k times as many loops agree by
    k r / (1 + (k - 1) r). Both are NaN where halves do not agree at all.

    >>> whole, loops = reliability(0.5, 100)
    >>> round(whole, 3), round(loops)
    (0.667, 450)
    """
    if not half > 0.0:
        return float("nan"), float("nan")
    whole = 2.0 * half / (1.0 + half)
    return whole, (
        loops * WANTED * (1.0 - whole) / (whole * (1.0 - WANTED)) if whole < 1.0 else float(loops)
    )


def kept(out: Path, count: int, slow_count: int, real: Path) -> dict[str, Home]:
    """Return every home with so many loops, of which slow methods judge the first; answers in the
    folder are read.

    `real`: folder of real records; left out where it does not exist.
    """
    folder(out)
    names, dear = methods(), slow(methods())
    fast = [m for m in names if m not in dear]
    jobs = [(h, i) for i in range(count) for h in (*GRIDS, *BLIND)]
    rows: dict[str, list[dict[str, Any]]] = {h: [] for h in (*GRIDS, *BLIND)}
    for h, i in Progress(jobs):
        row = answered(out / f"{h}-{i}.json", partial(asked, h, i, fast))
        if i < slow_count:
            row["said"] |= answered(out / f"{h}-{i}-slow.json", partial(asked, h, i, dear))["said"]
        rows[h].append(row)
    if real.exists():
        ask = [
            (m, partial(_judged, r.without_mv(), m.label == "stiction", m.unit_group, names))
            for m, r in records(real)
        ]
        rows[REAL] = [answered(out / f"{REAL}-{m.id}.json", one) for m, one in Progress(ask)]
    return {h: Home(homes) for h, homes in rows.items()}


def table(homes: dict[str, Home], names: list[str]) -> list[str]:
    """Return costs of methods and learned yardsticks in every home, best first on all but their
    own; * learned or fitted there.
    """
    fitted = {m: set(registry.load(m).METHOD.fitted_on) for m in names}
    fitted |= {
        m: {m.partition(", ")[2]} for m in next(iter(homes.values())).costs if m not in names
    }
    rows = {m: {h: float(home.mean([m])[0]) for h, home in homes.items()} for m in fitted}
    abroad = {
        m: float(np.mean([c for h, c in row.items() if h not in fitted[m]]))
        for m, row in rows.items()
    }
    lines = [("method", "abroad", *homes)]
    for m in sorted(rows, key=abroad.__getitem__):
        lines.append(
            (
                m,
                f"{abroad[m]:.3f}",
                *(f"{c:.3f}{'*' * (h in fitted[m])}" for h, c in rows[m].items()),
            )
        )
    return columns(lines)


def agreement(correlations: list[dict[str, Any]]) -> list[str]:
    """Return the correlations of homes with each other, and the agreement of each with itself."""
    cells = {k: tuple(f"{f[k]:.2f}" for f in correlations) for k in ("spearman", "lo", "hi")}
    rows = [
        (f["first"], f["second"], *(cells[k][i] for k in cells)) for i, f in enumerate(correlations)
    ]
    between = [row for row, f in zip(rows, correlations, strict=True) if "whole" not in f]
    reliable = [(*row[:1], *row[2:], f"{f['whole']:.2f}", f"{f['loops']:.0f}")
           for row, f in zip(rows, correlations, strict=True) if "whole" in f]  # fmt: skip
    text = (
        "agreement of each home with itself: halves (median, spread), the whole by Spearman and"
        " Brown, and loops for .9"
    )
    head = ("home", "halves", "lo", "hi", "whole", "loops for .9")
    return [
        *columns([("first", "second", "spearman", "lo", "hi"), *between]),
        "",
        text,
        "",
        *columns([head, *reliable]),
    ]


def draw(rows: list[dict[str, Any]], homes: dict[str, Home], names: list[str], file: Path) -> None:
    """Write a picture of the correlations and of every method's cost from home to home, and its
    numbers beside it.
    """
    import pandas as pd

    from simbench.page.style import BLUE, label, panels, styled, write_picture

    @styled
    def picture() -> Any:
        figure, ((left, right),) = panels(1, 2, 10.0, 3.8)
        where = list(homes)
        for row in rows:
            i, j = where.index(row["first"]), where.index(row["second"])
            for x, y in {(i, j), (j, i)}:
                left.fill(
                    [x - 0.5, x + 0.5, x + 0.5, x - 0.5],
                    [y - 0.5, y - 0.5, y + 0.5, y + 0.5],
                    color=BLUE,
                    alpha=float(np.clip(row["spearman"], 0.0, 1.0)) * 0.6,
                    linewidth=0,
                )
                title = f"{row['spearman']:.2f}\n{row['lo']:.2f} to {row['hi']:.2f}"
                left.text(x, y, title, ha="center", va="center", fontsize=6)
        label(left, "", "", "Spearman of the methods' costs; diagonal: halves")
        for axis in (left.xaxis, left.yaxis):
            axis.set_ticks(range(len(where)), where)
        for k, m in enumerate(names):
            costs = [float(h.mean([m])[0]) for h in homes.values()]
            right.plot(
                range(len(where)), costs, "-" if k < 7 else "--", marker="o", markersize=3, label=m
            )
        label(right, "", "cost", "methods from home to home")
        right.set_xticks(range(len(where)), where)
        right.legend(fontsize=6, loc="center left", bbox_to_anchor=(1.0, 0.5))
        return figure

    write_picture(picture(), file)
    write_table(pd.DataFrame(rows), file.with_suffix(".csv"), float_format="%.4f")


def main(arguments: list[str] | None = None) -> int:
    """Print costs, how far the order of the methods holds, and draw both."""
    parser = argparse.ArgumentParser(prog="python -m results.studies.transfer", description=__doc__)
    parser.add_argument(
        "out", type=Path, metavar="FOLDER", help="Where answers are kept; goes on where it stopped."
    )
    parser.add_argument("-n", type=int, default=1000, help="Loops of each grid and world [1000].")
    parser.add_argument(
        "--slow", type=int, default=60, metavar="N", help="Of these, loops for slow methods [60]."
    )
    parser.add_argument(
        "--records",
        type=Path,
        default=Path("../shared/data/real"),
        help="real records with a records.csv",
    )
    parser.add_argument("--picture", type=Path, help="SVG to write")
    given = parser.parse_args(arguments)
    homes = kept(given.out, given.n, given.slow, given.records)
    names = [m for m in methods() if all(m in home.costs for home in homes.values())]
    dear = slow(names)
    fast = [m for m in names if m not in dear]
    for name in LEARNED:
        for source in (*GRIDS, *BLIND):
            homes[source].learn(name, homes, source)
    rows = list(order(homes, fast))
    sizes = (f"{h} {x.sticky.size} loops ({x.sticky.sum()} sticky)" for h, x in homes.items())
    print(f"{', '.join(sizes)}; seed {SEED}")
    print(
        "cost: an error 1, no decision .5, sticky and sound loops counting the same; abroad: mean"
        " over homes without *, where"
    )
    print(
        "a method's constants were fitted, or a yardstick was trained (NAME, HOME: there, judged by"
        " folds)\n"
    )
    print("\n".join(table(homes, names)))
    few = min(given.slow, given.n)
    print(
        f"{', '.join(dear) or 'no slow method'}: on the first {few} loops of each grid and world,"
        " and on all real ones"
    )
    print(
        f"\nSpearman's correlation of the costs of {len(fast)} fast methods, 95 % by drawing loops"
        " again\n"
    )
    print("\n".join(agreement(rows)))
    if given.picture is not None:
        draw(rows, homes, fast, given.picture)
    return 0


if __name__ == "__main__":
    raise SystemExit(exit_code(main))
