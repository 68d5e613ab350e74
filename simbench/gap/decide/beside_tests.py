"""Use the records of additional tests: one model of all records, the valve from every MV, the
sensor from laboratory samples.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from simbench.detectors.signal.lattice import written_unit
from simbench.gap.candidates import Fitted
from simbench.gap.decide.evidence import LAB, Evidence
from simbench.gap.effects import Parameters, is_friction, recogniser
from simbench.gap.likelihood.engine import Engine
from simbench.gap.likelihood.joint import JointEngine, JointPart
from simbench.gap.likelihood.model import Data, Fit, Spec
from simbench.gap.likelihood.search import fit_likeliest
from simbench.gap.likelihood.second_order import positioner
from simbench.gap.likelihood.valve_map import MapFit, MapSearch, share_of
from simbench.gap.situation import ModelledTest, Situation, load_memory, through_valve
from simbench.gap.thresholds import ANOTHER_PLANT, BY_MV, MV_LEFT, MV_LEFT_BY_FRICTION, PLANT_APART
from simbench.loop.effects import EFFECTS

_EARLY = 0.1  # of a sample, by which MV must be logged early before its time is believed
_DIGITS = 6  # decimals of MV (%) that are read
_MOVES = 1e-6  # % that OP must move before MV shows anything
_STEPS = 3.0  # of MV's digits, or of its noise, that a band spans at least
_NORMAL = 0.6745  # median of a standard normal's size
_SIZES = (0.25, 0.5, 1.0, 2.0, 4.0)  # multiples of a fitted drift, at which lab samples are asked

Maps = dict[str, tuple[float, Parameters]]


def valve_maps(s: Situation, tests: Sequence[ModelledTest]) -> tuple[Maps, bool]:
    """Return what MV, wherever recorded, shows of every valve effect, and whether it strays as none
    of them makes it.
    """
    seen = [] if s.record.mv is None else [(s.op, np.asarray(s.record.mv), s.record.Ts)]
    seen += [(t.op, t.mv, t.Ts) for t in tests if t.mv is not None and np.ptp(t.op) > _MOVES]
    total: Maps = {}
    powers = np.zeros(3)
    for op, mv, Ts in seen:
        expected = np.clip(through_valve(op, s.baseline, Ts), 0.0, 100.0)
        search = MapSearch(op, mv, Ts, expected, s.expected_band, s.data.late)
        overshoots = positioner(search)
        least = least_band(mv)
        if overshoots is not None:
            # a sound valve, too, and no band is needed for what it does
            search.healthy -= overshoots[0]
        maps = {
            e: _drop_narrow(e, by_mv(search), least)
            for e in EFFECTS
            if (by_mv := recogniser(e).by_mv) is not None
        }
        winner = max(maps, key=lambda e: maps[e][0])
        healthy = float(np.exp(search.healthy / op.size))
        left = healthy * float(np.exp(-max(maps[winner][0], 0.0) / op.size))
        # friction is only known up to its model; the other maps are exact
        allowed = (MV_LEFT_BY_FRICTION if is_friction(winner) else MV_LEFT) * healthy
        powers += op.size * np.square([left, allowed, max(0.15, 0.03 * float(np.std(op)))])
        for e, (gain, p) in maps.items():
            before, kept = total.get(e, (0.0, p))
            total[e] = (before + gain, p if gain >= before else kept)
    # of all records together: one in which a limit hardly acts shows another map
    return total, bool(powers[0] > powers[1:].max())


def _drop_narrow(effect: str, found: MapFit, least: float) -> MapFit:
    """Return a map without its evidence where its band (%) is none: narrower than MV tells."""
    band = recogniser(effect).band
    gain, p = found
    return (min(gain, 0.0), p) if band is not None and band(p) < least else found


def least_band(mv: np.ndarray) -> float:
    """Return the narrowest band (%) that MV (n,) tells: three steps of its digits, or three
    standard deviations of its noise.
    """
    return _STEPS * max(written_unit(mv), noise_of(mv))


def noise_of(mv: np.ndarray) -> float:
    """Return the standard deviation of MV's noise (%), by its second differences (n,)."""
    return float(np.median(np.abs(np.diff(mv, 2)))) / (_NORMAL * np.sqrt(6.0))


def joint_engine(s: Situation, tests: Sequence[ModelledTest], maps: Maps) -> JointEngine:
    """Return the engine over the record and its tests; where MV was recorded once, the valve is
    known in all.
    """
    parts = [JointPart(by_stem(s, s.data, s.op, s.record.Ts, s.record.mv, maps))]
    parts += [JointPart(by_stem(s, t.data, t.op, t.Ts, t.mv, maps), t.pace) for t in tests]
    return JointEngine(parts, load_memory(s))


def by_stem(
    s: Situation, data: Data, op: np.ndarray, Ts: float, mv: np.ndarray | None, maps: Maps
) -> Data:
    """Return a record's data with MV for OP: as the identified valve makes it, or as logged where
    that differs beyond its digits.
    """
    winner = max(maps, key=lambda e: maps[e][0], default="")
    if not winner:
        return data
    sound = maps[winner][0] <= BY_MV
    effect = None if sound else {"name": winner, **maps[winner][1]}
    made = through_valve(op, s.baseline, Ts, effect)
    if mv is not None:
        steps = np.diff(np.unique(np.round(mv, _DIGITS)))
        digit = float(steps.min()) if steps.size else 0.0
        low = made - digit
        high = made + digit
        last = np.append(made[0], made[:-1])
        if share_of(mv - made, last - made) > _EARLY:
            # between the last sample and this one only the time at which MV was logged differs
            low = np.minimum(low, last - digit)
            high = np.maximum(high, last + digit)
        made = np.where((low <= mv) & (mv <= high), made, mv)
    return replace(data, u=np.ascontiguousarray(made))


def by_op(s: Situation, tests: Sequence[ModelledTest]) -> tuple[Situation, list[ModelledTest]]:
    """Return a record and its tests with what the baseline's valve makes of OP as the plant's
    input, whatever MV was recorded.
    """

    def input_of(one: Situation | ModelledTest, Ts: float) -> Data:
        return replace(one.data, u=np.ascontiguousarray(through_valve(one.op, s.baseline, Ts)))

    return (
        replace(s, data=input_of(s, s.record.Ts)),
        [replace(t, data=input_of(t, t.Ts)) for t in tests],
    )


def lab_rows(tests: Sequence[ModelledTest], base: Fit, rows: Sequence[Evidence]) -> list[Evidence]:
    """Return what lab samples of the true PV show of the effects that falsify the measurement, as
    PV shows them in `rows`.

    A smaller effect than the fitted one loses of the nats that PV speaks for it.
    """
    found = []
    for row in rows:
        by_lab = recogniser(row.effect).by_lab
        for t in tests:
            if by_lab is None or t.lab is None:
                continue
            at = np.flatnonzero(np.isfinite(t.lab))
            errors = t.data.y[at] - t.lab[at]
            times = at * t.Ts
            noise = (
                float(np.hypot(base.theta["noise_std"], t.lab_std)) or float(np.std(errors)) or 1.0
            )
            levels = [
                by_lab(scaled(row.numbers, share), errors, times, noise) for share in (0.0, *_SIZES)
            ]
            lost = [max(row.nats, 0.0) * max(1.0 - share, 0.0) ** 2 for share in _SIZES]
            nats = max(x - y for x, y in zip(levels[1:], lost)) - levels[0]
            found.append(Evidence(row.effect, LAB, nats))
    return found


def scaled(p: Parameters, share: float) -> Parameters:
    """Return an effect's numbers by a share."""
    return {name: share * x if isinstance(x, (int, float)) else x for name, x in p.items()}


def other_plants(fitted: Fitted, s: Situation, tests: Sequence[ModelledTest]) -> list[str]:
    """Return of each test in words its plant, where it is another than under the
    fit_likeliest fits of the record.
    """
    engine = joint_engine(s, tests, valve_maps(s, tests)[0])
    likely = sorted(
        (c for c in fitted.candidates.values() if c.used), key=lambda c: -c.log_likelihood_gain
    )[:3]
    fits = [fitted.base, *(c.fit for c in likely if c.log_likelihood_gain > 0.0)]
    # signals and jumps of an effect are of one record
    plain = replace(fitted.base, spec=Spec(pink=fitted.base.spec.pink))
    bare = [f for f in fits if not f.spec.channels and not f.spec.jumps] or [plain]
    # a controller that answers nothing but the load shows load and plant in one, and any plant with
    # its load
    return [
        _other_plant(engine.engines[i], engine, i, bare) if t.moved else ""
        for i, t in enumerate(tests, start=1)
    ]


def _other_plant(alone: Engine, engine: JointEngine, i: int, fits: Sequence[Fit]) -> str:
    data = alone.data
    tries = []
    for fit in fits:
        spec, theta = engine.one_of(i, fit.spec, fit.theta)
        # the record's plant, in the test's samples, held as a baseline is
        plant = {"K": fit.K / (engine.parts[i].pace if data.T == 0.0 else 1.0), "Td": theta["Td"]}
        held = Engine(
            replace(data, **plant, T=theta["T"] if data.T > 0.0 else 0.0), alone.longest_load
        )
        tries.append(held.fit(spec, theta))
    same = max(tries, key=lambda f: f.loglik)
    spec = same.spec.join(Spec(free=frozenset({"K", "T", "Td"})))
    T = same.theta.get("T", 0.0)
    Td = same.theta["Td"]
    starts = [
        {**same.theta, "T": T * f, "Td": Td * g} for f, g in ((1.0, 1.0), (0.4, 0.5), (2.5, 2.0))
    ]
    other = fit_likeliest(alone, spec, starts)
    if other.loglik - same.loglik < ANOTHER_PLANT or same.K == 0.0:
        return ""
    gain = other.K / same.K
    time = (other.theta.get("T", 0.0) + other.theta["Td"] + 1.0) / (T + Td + 1.0)
    if all(1.0 / PLANT_APART < x < PLANT_APART for x in (gain, time)):
        return ""
    return (
        f"PV answers OP with {gain:.2g} times the gain and {time:.2g} times as slowly as in the"
        " record"
    )
