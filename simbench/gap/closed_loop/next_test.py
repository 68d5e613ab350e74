"""Which measurement or test would settle it: remaining candidates simulated under each, the largest separation wins."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from detectors.errors import UserError
from detectors.record import LoopRecord
from scenarios.spec import Loop
from simbench.gap.closed_loop.summary_features import Features, features
from simbench.loop.resolve import resolve_loop
from simbench.loop.run import run_setup

_SEEDS = 3
_SAMPLES = 1500  # length of a simulated test; longer ones separate no better, only slower
_SEPARATED = 1.0  # mean distance, in seed-to-seed standard deviations, from which a test is worth naming


@dataclass(frozen=True)
class PlantTest:
    """A test as a person would do it, and how to simulate it: (loop, size of OP's and SP's movement, seed) -> features."""

    name: str
    says: str
    run: Callable[[Loop, float, float, int], Features]


def _plain(loop: Loop, du: float, dsp: float, seed: int) -> LoopRecord:
    return run_setup(resolve_loop(_short(loop), seed)).record


def _with_mv(loop: Loop, du: float, dsp: float, seed: int) -> Features:
    record = _plain(loop, du, dsp, seed)
    assert record.mv is not None
    off = record.mv - record.op
    seen = {f"mv {k}": v for k, v in features(record.op, record.mv, record.op).items() if k.startswith("pv")}
    return {**seen, "mv off": np.log(float(np.std(off)) + 1e-3), "mv mean": float(np.mean(off))}


def _sp_step(loop: Loop, du: float, dsp: float, seed: int) -> Features:
    span = loop.sampling.Ts * _SAMPLES
    start = loop.setpoint.value
    steps = [[0.2 * span, start + dsp], [0.5 * span, start - dsp], [0.8 * span, start]]
    table = _short(loop).to_table()
    table["setpoint"] = {"value": start, "steps": steps}
    record = run_setup(resolve_loop(Loop.from_table(table), seed)).record
    assert record.sp is not None
    return features(record.op, record.pv, record.sp)


def _gain_change(loop: Loop, du: float, dsp: float, seed: int) -> Features:
    short = _short(loop)
    r = run_setup(resolve_loop(short.with_("controller.Kc", 0.5 * loop.controller.Kc), seed)).record
    assert r.sp is not None
    return features(r.op, r.pv, r.sp)


def _bump(loop: Loop, du: float, dsp: float, seed: int) -> Features:
    setup = resolve_loop(_short(loop, _SAMPLES // 3), seed)
    # in manual: a controller without gain keeps the bump
    setup.Kc = 1e-12
    record = run_setup(setup, kick=du).record
    moved = record.pv - record.pv[0]
    shape = {f"bump {i}": float(part.mean()) / (abs(du) or 1.0) for i, part in enumerate(np.array_split(moved, 12))}
    return {**shape, "bump noise": np.log(float(np.std(np.diff(moved))) + 1e-9)}


def _faster(loop: Loop, du: float, dsp: float, seed: int) -> Features:
    record = _plain(loop.with_("sampling.Ts", loop.sampling.Ts / 4), du, dsp, seed)
    assert record.sp is not None
    return features(record.op, record.pv, record.sp)


TESTS = (
    PlantTest("record MV", "record the valve position (MV) beside SP, OP and PV", _with_mv),
    PlantTest("set-point step", "step the set point up and down by {dsp:.3g} PV units", _sp_step),
    PlantTest("gain-change", "halve Kc for a while and compare period and amplitude (gain-change test)", _gain_change),
    PlantTest("bump test", "in manual, bump OP by {du:.3g} % and watch PV settle", _bump),
    PlantTest("faster sampling", "sample four times faster", _faster),
)


def choose(
    loops: dict[str, Loop], weights: dict[str, float], *, mv: bool, law_known: bool, du: float, dsp: float, seed: int = 0
) -> tuple[str, dict[str, float]]:
    """Return the test that separates some candidate loops best, and the separation under each test."""
    names = list(loops)
    found: dict[str, float] = {}
    for test in TESTS:
        if test.name == "record MV" and mv:
            continue
        try:
            runs = {e: [test.run(loops[e], du, dsp, seed + i) for i in range(_SEEDS)] for e in names}
        except UserError:
            continue
        X = {e: np.array([list(f.values()) for f in r]) for e, r in runs.items()}
        if not all(np.all(np.isfinite(x)) for x in X.values()):
            continue
        spread = np.sqrt(np.mean([x.var(axis=0, ddof=1) for x in X.values()], axis=0)) + 0.05
        total = norm = 0.0
        for i, a in enumerate(names):
            for b in names[i + 1 :]:
                w = weights[a] * weights[b]
                total += w * float(np.minimum(np.abs(X[a].mean(axis=0) - X[b].mean(axis=0)) / spread, 8.0).mean())
                norm += w
        found[test.name] = total / norm if norm > 0 else 0.0
    if not law_known:
        return "raw instead of archived data: the recorded PV is not the PV the controller saw", found
    best = max(found, key=lambda t: found[t], default=None)
    if best is None or found[best] < _SEPARATED:
        return "a longer record: no single test separates the remaining candidates here", found
    test = next(t for t in TESTS if t.name == best)
    said = test.says.format(du=du, dsp=dsp)
    return f"{test.name}: {said} (separates {' and '.join(names[:3])} by {found[best]:.1f} standard deviations)", found


def _short(loop: Loop, n: int = _SAMPLES) -> Loop:
    table = loop.to_table()
    table["sampling"]["n"] = n
    return Loop.from_table(table)
