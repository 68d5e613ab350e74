"""Calibrate thresholds: chosen for each method on one seed of a grid, measured on another, compared
with the published ones.
"""

from __future__ import annotations

import json
import math
import tempfile
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from simbench.bench.execute.run import choose_with_oracle, run_grid
from simbench.bench.statistics import auc, wilson
from simbench.bench.store.reading import RunArrays
from simbench.detectors.errors import ParameterError
from simbench.files import folder, whole_file, write_table
from simbench.scenarios.grid import load_grid

if TYPE_CHECKING:
    import pandas as pd

OTHER_SEEDS = 104_729  # added to the grid's seed for the set that thresholds are taken from
_ROC_POINTS = 200


@dataclass(frozen=True, eq=False)
class _Calibration:
    """Cuts from seeds A and what they do on seeds B."""

    # wanted share of healthy loops called sticky; also the wanted share of wrong answers among the
    # decided
    false_alarm: float
    # per method, against `cycled`, with the front end, on seeds B: published_false_alarm,
    # published_detection; cut (score above = stiction), false_alarm, detection, auc, each with
    # interval; informative (AUC's interval leaves out 0.5); no_stiction_below and stiction_above of
    # the calibrated abstention, its coverage and wrong_decided, all three without the front end
    table: pd.DataFrame
    roc: pd.DataFrame  # columns method, threshold, false_alarm, detection; seeds B
    about: dict[str, Any]  # grid, its hash, seeds A and B

    @property
    def thresholds(self) -> dict[str, dict[str, float]]:
        """What `judge` and `run_grid` take as thresholds: the cuts for the wanted false alarms."""
        return {
            r.method: {"stiction_above": float(r.cut)}
            for r in self.table.itertuples()
            if math.isfinite(r.cut)
        }

    @property
    def abstaining(self) -> dict[str, dict[str, float]]:
        """The same with a band in which a method abstains; for runs without the front end (raw)."""
        return {
            r.method: {
                "stiction_above": float(r.stiction_above),
                "no_stiction_below": float(r.no_stiction_below),
            }
            for r in self.table.itertuples()
            if math.isfinite(r.stiction_above) and math.isfinite(r.no_stiction_below)
        }

    def as_text(self) -> str:
        """Return one line per method, and what the columns mean."""
        a, band, none = self.about, self.abstaining, f" {'-':>8} {'-':>5}"
        lines = [
            (
                f"Thresholds for a false-positive rate of {self.false_alarm:g}, chosen on seed"
                f" {a['seed_a']} of grid {a['grid']}, measured on seed {a['seed_b']}"
                f" ({a['positives']} loops that cycle, {a['negatives']} that do not)."
            ),
            "",
            (
                f"{'':<17} {'with the calibrated threshold:':<49} {'as published:':>15}"
                f" {'two thresholds:':>14}"
            ),
            (
                f"{'method':<17} {'threshold':>9} {'false positives':>15} {'sens.':>5}"
                f" {'AUC':>4} {'':<12} {'FP':>8} {'sens.':>6} {'decided':>8} {'wrong':>5}"
            ),
        ]
        for r in self.table.itertuples():
            lines.append(
                f"{r.method:<17} {r.cut:>9.3g} {r.false_alarm:>5.2f}"
                f" {_range(r.false_alarm_lo, r.false_alarm_hi):>9} {r.detection:>5.2f}"
                f" {r.auc:>4.2f} {_range(r.auc_lo, r.auc_hi):<12}"
                f" {r.published_false_alarm:>8.2f} {r.published_detection:>6.2f}"
                + (f" {r.coverage:>8.2f} {r.wrong_decided:>5.2f}" if r.method in band else none)
            )
        lines += [
            "",
            (
                "Ranges are 95 % intervals. False positives (FP): share of the loops that their"
                " valve does not make cycle called stiction. Sens.: sensitivity, the same share"
                " of the loops that it makes cycle. AUC: area under the ROC curve. Two thresholds:"
                " between them the method gives no decision; decided: share of loops decided;"
                " wrong: share of wrong answers among these; -: no two thresholds keep that share"
                " as small."
            ),
        ]
        vague = [r.method for r in self.table.itertuples() if not r.informative]
        if vague:
            lines.append(
                f"Not informative here (the interval of AUC contains 0.5): {', '.join(vague)}."
            )
        return "\n".join(lines)

    def as_json(self) -> dict[str, Any]:
        """Return cuts and measurements as JSON types; NaN and infinity become null."""
        return {
            **self.about,
            "false_alarm": self.false_alarm,
            "thresholds": self.thresholds,
            "abstaining": self.abstaining,
            "methods": json.loads(self.table.to_json(orient="records", double_precision=6)),
        }

    def write(self, path: str | Path) -> None:
        """Write thresholds.json, calibration.csv and roc.csv to a folder."""
        where = folder(path)
        with whole_file(where / "thresholds.json") as f:
            json.dump(self.as_json(), f, indent=1)
        for name, frame in (("calibration", self.table), ("roc", self.roc)):
            write_table(frame, where / f"{name}.csv", float_format="%.6g")


def calibrate(
    grid: str | Path,
    false_alarm: float = 0.05,
    methods: Iterable[str] = ("fast",),
    jobs: int = 1,
    out: str | Path | None = None,
    **settings: Any,
) -> _Calibration:
    """Find each method's cut for a wanted false-alarm rate on seeds A, and measure it on seeds
    B.
    """
    if not 0.0 < false_alarm < 1.0:
        raise ParameterError(f"false_alarm = {false_alarm}; a share between 0 and 1 is needed")
    chosen = choose_with_oracle(methods, ())  # a wrong name is refused before a folder is made
    sets = dict(settings.pop("sets", None) or {})
    seed_b = load_grid(grid, sets).content.seed
    seed_a = seed_b + OTHER_SEEDS
    with tempfile.TemporaryDirectory() as temporary:
        where = Path(temporary) if out is None else folder(out)
        books = [
            RunArrays.read(
                run_grid(
                    grid,
                    where / name,
                    chosen,
                    jobs,
                    resume=True,
                    sets={**sets, "seed": seed},
                    **settings,
                )
            )
            for name, seed in (("seeds-a", seed_a), ("seeds-b", seed_b))
        ]
    calibration = calibrate_books(*books, false_alarm)
    if out is not None:
        calibration.write(out)
    return calibration


def calibrate_books(a: RunArrays, b: RunArrays, false_alarm: float) -> _Calibration:
    """Take cuts from run `a` and measure them on run `b`; see `calibrate`."""
    import pandas as pd

    rows, curves = [], []
    positive = _labels(b)
    for i, method in enumerate(b.methods):
        score_a, score_b = _scores(a.score, a, i), _scores(b.score, b, i)
        cut = cut_for(score_a[~_labels(a)], false_alarm)
        # without the front end: it answers "no" to more cycling loops than a small share of wrong
        # answers allows
        low, high = abstention(_scores(a.score_raw, a, i), _labels(a), false_alarm)
        raw_b = _scores(b.score_raw, b, i)
        verdicts = b.verdict[i, b.truth["cycled"] >= 0]
        above, decided = score_b > cut, (raw_b > high) | (raw_b <= low)
        wrong = ((raw_b > high) & ~positive) | ((raw_b <= low) & positive)
        known = ~np.isnan(score_b)
        area = auc(score_b[known], positive[known])
        rows.append(
            {
                "method": method,
                "cut": cut,
                **_rate("false_alarm", above[~positive]),
                **_rate("detection", above[positive]),
                "auc": area.value,
                "auc_lo": area.lo,
                "auc_hi": area.hi,
                "informative": not area.lo <= 0.5 <= area.hi,
                "published_false_alarm": float((verdicts[~positive] == 1).mean()),
                "published_detection": float((verdicts[positive] == 1).mean()),
                "no_stiction_below": low,
                "stiction_above": high,
                "coverage": float(decided.mean()),
                "wrong_decided": float(wrong.sum() / max(decided.sum(), 1)),
            }
        )
        curves.append(roc(score_b, positive).assign(method=method))
    about = {
        "grid": b.manifest["grid"],
        "grid_hash": b.manifest["grid_hash"],
        "seed_a": a.manifest["seed"],
        "seed_b": b.manifest["seed"],
        "positives": int(positive.sum()),
        "negatives": int((~positive).sum()),
    }
    return _Calibration(
        false_alarm, pd.DataFrame(rows), pd.concat(curves, ignore_index=True), about
    )


def cut_for(healthy: np.ndarray, false_alarm: float) -> float:
    """Return the lowest cut that no more than the wanted share of healthy loops' scores exceed."""
    ranked = np.sort(np.where(np.isnan(healthy), -np.inf, healthy))
    return (
        float(ranked[max(math.ceil((1.0 - false_alarm) * ranked.size) - 1, 0)])
        if ranked.size
        else math.nan
    )


def abstention(score: np.ndarray, positive: np.ndarray, wrong: float) -> tuple[float, float]:
    """Return the band of scores in which to abstain so that few of the decided are wrong and most
    are decided.
    """
    known = ~np.isnan(score)
    score, positive = score[known], positive[known]
    if score.size == 0:
        return -math.inf, math.inf
    cuts = _cuts(score)
    below = np.array([[(score <= c).sum(), (positive & (score <= c)).sum()] for c in cuts])
    above = np.array([[(score > c).sum(), (~positive & (score > c)).sum()] for c in cuts])
    decided = below[:, None, 0] + above[None, :, 0]
    mistakes = below[:, None, 1] + above[None, :, 1]
    allowed = (cuts[:, None] <= cuts[None, :]) & (mistakes + 1 <= wrong * (decided + 1))
    if not allowed.any():
        return -math.inf, math.inf
    low, high = np.unravel_index(int(np.argmax(np.where(allowed, decided, -1))), decided.shape)
    return float(cuts[low]), float(cuts[high])


def roc(score: np.ndarray, positive: np.ndarray) -> pd.DataFrame:
    """Return points of the ROC curve: threshold, false_alarm, detection."""
    import pandas as pd

    finite = np.where(np.isnan(score), -np.inf, score)
    cuts = _cuts(finite)
    rates = [[c, (finite[~positive] > c).mean(), (finite[positive] > c).mean()] for c in cuts]
    return pd.DataFrame(rates, columns=["threshold", "false_alarm", "detection"])


def _cuts(score: np.ndarray) -> np.ndarray:
    """Return quantiles of scores, and one cut that the smallest score exceeds."""
    quantiles = np.quantile(score, np.linspace(0, 1, _ROC_POINTS + 1), method="inverted_cdf")
    return np.unique([-np.inf, *quantiles])


def _labels(book: RunArrays) -> np.ndarray:
    cycled = book.truth["cycled"]
    return cycled[cycled >= 0] == 1


def _scores(scores: np.ndarray, book: RunArrays, method: int) -> np.ndarray:
    return scores[method, book.truth["cycled"] >= 0].astype(float)


def _rate(name: str, hits: np.ndarray) -> dict[str, float]:
    lo, hi = wilson(int(hits.sum()), hits.size)
    return {
        name: float(hits.mean()) if hits.size else math.nan,
        f"{name}_lo": float(lo),
        f"{name}_hi": float(hi),
    }


def _range(lo: float, hi: float) -> str:
    return f"{lo:.2f}-{hi:.2f}"
