"""Compare a set of records with a grid: what separates them, which effects explain it, and what
each costs each detector.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from simbench.detectors.errors import ParameterError, UserError
from simbench.detectors.judge import judge
from simbench.detectors.record import LoopRecord
from simbench.detectors.records.io import read_folder, read_labels
from simbench.detectors.report.report import choose_methods
from simbench.detectors.verdict import STICTION
from simbench.gap import diagnose
from simbench.plant.resumed import resumed
from simbench.plant.study.forward_selection import (
    Simulated,
    accuracy,
    draw,
    join,
    units,
    verdicts_on,
)
from simbench.plant.study.loop_features import by_unit, looks
from simbench.plant.study.result import Study
from simbench.plant.study.strengths import NOT_LACKING, Size, relative
from simbench.plant.study.two_sample import (
    FeatureScaler,
    classifier_test,
    feature_tests,
    mmd,
    mmd_test,
)
from simbench.scenarios.spec import Loop, load_loop

_GROUPS = 40  # of the grid that are simulated
_BOOTSTRAPS = 500


def study(
    folder: str | Path,
    grid: str | Path,
    labels: str | Path | None = None,
    *,
    methods: Sequence[str] = ("fast",),
    groups: int = _GROUPS,
    jobs: int = 1,
    keep: str | Path | None = None,
) -> Study:
    """Compare a set of records, labelled or not, with a grid."""
    real, chosen = read_fleet(folder, labels), choose_methods(methods)
    return against(real, draw(grid, groups, 0), str(grid), chosen, jobs=jobs, keep=keep)


@dataclass(frozen=True, eq=False)
class _RecordedFleet:
    """What was recorded in a plant: records by name, the unit of each, its line of the labels,
    files refused, and where.
    """

    records: Mapping[str, LoopRecord]
    unit: Mapping[str, str]
    known: Mapping[str, Mapping[str, str]]
    refused: Mapping[str, str]
    folder: Path


def read_fleet(folder: str | Path, labels: str | Path | None = None) -> _RecordedFleet:
    """Read a set of records, and refuse one of too few loops."""
    known = {} if labels is None else read_labels(labels)
    each = {name: {"kind": row["kind"], "process": row["process"]} for name, row in known.items()}
    records, refused = read_folder(folder, names=known or None, each=each)
    unit = {name: known.get(name, {}).get("unit_group", name) for name in records}
    if len(set(unit.values())) < 5:
        raise ParameterError(f"{folder}: {len(set(unit.values()))} loops; a study needs at least 5")
    return _RecordedFleet(records, unit, known, refused, Path(folder))


def against(
    real: _RecordedFleet,
    simulated: list[Simulated],
    grid: str,
    methods: list[str],
    *,
    seed: int = 0,
    jobs: int = 1,
    keep: str | Path | None = None,
) -> Study:
    """Compare what was recorded with simulated loops."""
    records, unit, known = real.records, real.unit, real.known
    rng = np.random.default_rng(seed)
    names, real_x, _ = by_unit([looks(r) for r in records.values()], list(unit.values()))
    sim_x = units(simulated)
    ruler = FeatureScaler.of(sim_x, real_x)
    strengths, failed = _effects_of(records, unit, real.folder, jobs=jobs, keep=keep)
    base = verdicts_on(simulated, methods)
    joined, moved = join(
        simulated, strengths, len(set(unit.values())), ruler, real_x, base, methods, rng
    )
    labelled = _real_accuracy(records, unit, known, methods, rng)
    few = len(set(unit.values()))
    notes = [
        f"{few} loops: a share of one half is known to within {98 / np.sqrt(few):.0f} points, a"
        " feature only where it is plain"
    ]
    notes += [f"left out {n}: {why}" for n, why in real.refused.items()] + failed
    if joined and joined[-1].distance_after > 0.5 * mmd(ruler, sim_x, real_x):
        notes.append("more than half of the distance stays unexplained by the effects")
    return Study(
        records=len(records),
        loops=few,
        distance=mmd_test(ruler, sim_x, real_x, rng),
        classifier=classifier_test(ruler.measured(sim_x), ruler.measured(real_x), rng),
        features=feature_tests(ruler, names, sim_x, real_x),
        effects=tuple(joined),
        simulated=accuracy(simulated, base, methods),
        real=labelled,
        moved=moved,
        notes=tuple(notes),
        grid=grid,
    )


def _effects_of(
    records: Mapping[str, LoopRecord],
    unit: Mapping[str, str],
    folder: Path,
    *,
    jobs: int = 1,
    keep: str | Path | None = None,
) -> tuple[dict[str, list[dict[str, Any]]], list[str]]:
    """Diagnose one record of every unit, and return the effects with their relative strengths."""
    about = []
    for name in {unit[name]: name for name in reversed(list(records))}.values():
        loop_file = folder / f"{name}.toml"
        about.append((records[name], load_loop(loop_file) if loop_file.exists() else None))
    strengths: dict[str, list[dict[str, Any]]] = {}
    failed = []
    for answer in resumed(_diagnosed, about, jobs=jobs, keep=keep, what="diagnoses"):
        if isinstance(answer, str):
            failed.append(answer)
            continue
        for effect, strength in answer.items():
            strengths.setdefault(effect, []).append(strength)
    return strengths, failed


def _diagnosed(record: LoopRecord, baseline: Loop | None) -> dict[str, dict[str, Any]] | str:
    """Return the effects named or proven with their relative strengths, or why there is no
    diagnosis.
    """
    try:
        report = diagnose(record, baseline)
    except UserError as error:
        return f"not diagnosed: {error}"
    size, parameters = Size.of(record), report.behind.found.parameters
    shown = dict.fromkeys(
        [*(e["effect"] for e in report.effects), *report.behind.found.situation.proven]
    )
    return {
        e: relative(e, parameters[e], size)
        for e in shown
        if e in parameters and e not in NOT_LACKING
    }


def _real_accuracy(
    records: Mapping[str, LoopRecord],
    unit: Mapping[str, str],
    known: Mapping[str, Mapping[str, str]],
    methods: list[str],
    rng: np.random.Generator,
) -> dict[str, dict[str, float]]:
    """Return balanced accuracy by unit with its bootstrap interval; empty unless both classes are
    labelled.
    """
    rows: dict[str, list[np.ndarray]] = {}
    truth: dict[str, bool] = {}
    for name, record in records.items():
        label = known.get(name, {}).get("label", "unknown")
        if label not in ("", "unknown"):
            sticky = label == STICTION
            right = [
                v.verdict == (STICTION if sticky else "no_stiction") for v in judge(record, methods)
            ]
            rows.setdefault(unit[name], []).append(np.array(right, dtype=float))
            truth[unit[name]] = sticky
    positive, negative = (
        [np.mean(rows[u], axis=0) for u in rows if truth[u] is kind] for kind in (True, False)
    )
    if not positive or not negative:
        return {}
    a, b = np.array(positive), np.array(negative)
    again = [
        0.5
        * (
            a[rng.integers(len(a), size=len(a))].mean(axis=0)
            + b[rng.integers(len(b), size=len(b))].mean(axis=0)
        )
        for _ in range(_BOOTSTRAPS)
    ]
    value, (lo, hi) = (
        0.5 * (a.mean(axis=0) + b.mean(axis=0)),
        np.quantile(again, [0.025, 0.975], axis=0),
    )
    return {
        m: {"value": float(value[i]), "lo": float(lo[i]), "hi": float(hi[i])}
        for i, m in enumerate(methods)
    }
