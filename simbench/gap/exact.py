"""Laws that need no likelihood: of the controller from error to OP, and of the sensor from single samples of PV.

A law is fitted to the first part of the record and judged by what it leaves on the rest, beside the best law without it.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from scipy.optimize import least_squares
from scipy.signal import lfilter

from detectors.signal.holds import holds, runs_of
from detectors.signal.lattice import written_unit
from simbench.gap.controller.regression import FORMS
from simbench.gap.law import FoundLaw
from simbench.gap.situation import Situation
from simbench.loop.laws import LAW_FORMS
from simbench.loop.laws.forms import running_mean

_EXPLAINS = 0.6  # share of what the law without the new term leaves, below which the term is the law
_MEAN_EXPLAINS = 0.3  # the same where a mean of the archive's would explain OP as well
_LEARNT = 0.65  # share of the record that a law is fitted to, where the record is diagnosed
_PROOF = 60.0  # nats from which a law needs no statistics
_TOLD = 0.5  # nats a sample of what the law's own examination shows
_IDLE = 0.05  # share of samples in which OP stands though the law would move it
_ENDS = 0.02  # share of samples of PV exactly at its largest or smallest
_HELD = 0.02  # share of samples of PV that repeat the last one beyond chance
_ORDINARY_MEAN = 3.0  # samples up to which a mean is any archive's
_PRICE = 1.5  # nats of a change between running and idle

_Numbers = dict[str, float]


@lru_cache(maxsize=4)
def controller_law(s: Situation, first: int) -> FoundLaw | None:
    """Return the law between error and OP that the baseline's does not know; None where the baseline's explains OP."""
    if s.law.known and not s.law.averaged and not any(fact in s.facts for fact in ("limits", "gap", "step", "tuning")):
        return None
    if (told := _told(s, first)) is not None:
        return told
    if s.baseline.controller.type == "PID":
        return None  # its terms are the baseline's own
    law = _Controller.of(s)
    plain, found = law.left({}), []
    for form, guesses, names in _TERMS:
        found += [law.fitted(form, names, guess, first, plain) for guess in guesses(law)]
    found.append(law.idle(first, plain))
    good = [one for one in found if one is not None]
    best = max(good, key=lambda one: one.nats, default=None)
    # a mean of the archive's looks like a term of the controller, but explains less
    if best is not None and s.law.averaged and best.nats < -np.log(_MEAN_EXPLAINS) * (s.record.n - first):
        return None
    return best


def _told(s: Situation, first: int) -> FoundLaw | None:
    """Return what the examination of the law has measured already: exact, so that every sample speaks for it."""
    law, nats = s.law, _TOLD * (s.record.n - first)
    if law.limits is not None:
        return FoundLaw("limits", {"low": law.limits[0], "high": law.limits[1]}, nats)
    if law.gap > 0.0 or law.step > 0.0:
        return FoundLaw("rest", {m: v for m, v in (("width", law.gap), ("step", law.step)) if v > 0.0}, nats)
    return None if law.tuning is None else FoundLaw("tuning", dict(zip(("gain", "integral"), law.tuning)), nats)


class _Controller(NamedTuple):
    """The controller's signals (OP in %, error in PV units), its own numbers, and the digits of OP."""

    op: np.ndarray
    e: np.ndarray
    Kc: float
    Ki: float
    Ts: float
    unit: float
    moves: np.ndarray
    newest: float = 1.0

    @classmethod
    def of(cls, s: Situation) -> _Controller:
        pv = np.asarray(s.record.pv)
        # an archive that stores PV before the controller ran
        e = s.sp - (np.append(pv[0], pv[:-1]) if s.law.late else pv)
        control, Ts = s.baseline.controller, s.record.Ts
        Kc = control.sign * control.Kc
        # digits of OP and PV, as far as they reach OP
        unit = max(written_unit(s.op), abs(Kc) * written_unit(pv), 1e-6 * float(np.std(s.op)), 1e-9) / 3.0
        law = cls(np.asarray(s.op), e, Kc, Kc * Ts / control.Ti if control.Ti else 0.0, Ts, unit, np.diff(s.sp))
        # the form in which its integral counts the newest error
        forms = [law._replace(newest=share) for share in FORMS]
        return min(forms, key=lambda one: float(np.median(np.abs(one.left({})))))

    def left(self, numbers: _Numbers) -> np.ndarray:
        """Return what a law leaves of OP (n - 1,), each sample from the recorded one before."""
        e, get = self.e, numbers.get
        counts = e * (get("gain", 1.0) + get("square", 0.0) * np.abs(e)) + get("side", 0.0) * np.abs(e)
        change = np.diff(counts)
        adds = self.newest * counts[1:] + (1.0 - self.newest) * counts[:-1]
        du = self.Kc * (change - (1.0 - get("weight", 1.0)) * self.moves) + self.Ki * adds
        du = du * np.maximum(1.0 + get("schedule", 0.0) * (self.op[:-1] - self.op.mean()), 0.05)
        if get("Td", 0.0):
            follow = 1.0 / (1.0 + max(get("filter", 0.0), 0.0) / self.Ts)
            slope = lfilter([follow], [1.0, follow - 1.0], change - self.moves)
            du = du + self.Kc * get("Td", 0.0) / self.Ts * np.diff(np.append(0.0, slope))
        down, up = (self.Ts / x if x > 0.0 else np.inf for x in (get("down", 0.0), get("up", 0.0)))
        return np.diff(self.op) - np.clip(du, -down, up)

    def misfit(self, left: np.ndarray) -> float:
        """Return the mean size of what is left; digits bound it from below."""
        return float(np.mean(np.abs(left))) + self.unit

    def law(
        self, form: str, numbers: _Numbers, first: int, plain: np.ndarray, left: np.ndarray, **more: Any
    ) -> FoundLaw | None:
        """Return the law where it leaves plainly less than the plain one of the samples it was not fitted to."""
        ratio = self.misfit(left[first:]) / self.misfit(plain[first:])
        if not ratio < _EXPLAINS:
            return None
        nats = -(left[first:].size) * np.log(ratio) - more.pop("price", 0.0)
        evidence = np.append(0.0, np.log((np.abs(plain) + self.unit) / (np.abs(left) + self.unit)))
        return FoundLaw(form, numbers, float(nats), evidence=evidence, **more) if nats > 0.0 else None

    def fitted(self, form: str, names: tuple[str, ...], guess: _Numbers, first: int, plain: np.ndarray) -> FoundLaw | None:
        """Return a law with some of its numbers fitted robustly to the first part, from a guess."""
        scale = max(self.misfit(plain[:first]), self.unit)

        def misfit(x: np.ndarray) -> np.ndarray:
            return self.left(dict(zip(names, x)))[:first] / scale

        with np.errstate(all="ignore"):
            found = least_squares(
                misfit, [guess[m] for m in names], loss="soft_l1", f_scale=0.1, x_scale=[guess[m + "_by"] for m in names],
                max_nfev=60,
            )  # fmt: skip
        numbers = {m: float(v) for m, v in zip(names, found.x)}
        if not all(np.isfinite(v) for v in numbers.values()) or any(numbers.get(m, 1.0) < 0.0 for m in _POSITIVE):
            return None
        left = self.left(numbers)
        spread = np.sqrt(np.maximum(np.diag(np.linalg.pinv(found.jac.T @ found.jac)), 0.0)) * float(np.std(misfit(found.x)))
        intervals = {m: (v - 2 * float(d), v + 2 * float(d)) for (m, v), d in zip(numbers.items(), spread)}
        return self.law(form, numbers, first, plain, left, intervals=intervals)

    def idle(self, first: int, plain: np.ndarray) -> FoundLaw | None:
        """Return the law of a controller that does not run in some samples, where OP stands though it should move."""
        still = np.append(False, np.diff(self.op) == 0.0)
        asked = np.append(0.0, np.abs(np.diff(self.op) - plain))
        runs = np.array(
            [(a, b) for a, b in runs_of(still) if asked[a:b].max() > (5 if b - a > 2 else 20) * self.unit], dtype=int
        ).reshape(-1, 2)
        idle = np.zeros(still.size, dtype=bool)
        for a, b in runs:
            idle[a:b] = True
        share = float(idle.mean())
        if not _IDLE < share < 0.95:
            return None
        # what the error was when the controller last ran, and (bumpless return) just before; each form of the integral
        last = np.maximum.accumulate(np.where(idle, 0, np.arange(idle.size)))[:-1]
        tries = []
        for before in (self.e[last], self.e[:-1]):
            for newest in FORMS:
                counts = newest * self.e[1:] + (1.0 - newest) * before
                tries.append(np.diff(self.op) - np.where(idle[1:], 0.0, self.Kc * (self.e[1:] - before) + self.Ki * counts))
        left = min(tries, key=self.misfit)
        length = float(np.mean(runs[:, 1] - runs[:, 0])) * self.Ts
        numbers = {"share": share, "length": length}
        # nothing but how often and how long is fitted: the spells may all lie in the first part
        return self.law("idle", numbers, 0, plain, left, on=idle, price=2 * len(runs) * _PRICE)


def _regimes(c: _Controller) -> list[_Numbers]:
    e, op = float(np.std(c.e)) or 1.0, float(np.std(c.op)) or 1.0
    by = {"gain_by": 0.3, "square_by": 0.3 / e, "side_by": 0.2, "schedule_by": 0.2 / op}
    plain = {"square": 0.0, "side": 0.0, "schedule": 0.0, "gain": 1.0}
    return [by | plain, by | plain | {"square": 0.3 / e, "gain": 0.3, "side": 0.2, "schedule": 0.05 / op}]


def _derivatives(c: _Controller) -> list[_Numbers]:
    pace = abs(c.Kc / c.Ki) * c.Ts if c.Ki else 10 * c.Ts
    return [
        {"Td": share * pace, "Td_by": 0.1 * pace, "filter": 0.1 * share * pace, "filter_by": 0.05 * pace}
        for share in (0.05, 0.3, 1.0)
    ]


def _speeds(c: _Controller) -> list[_Numbers]:
    du = np.diff(c.op)
    out = []
    for down, up in ((0.05, None), (None, 0.95), (0.05, 0.95)):
        slow_down = c.Ts / max(-float(np.quantile(du, down)), c.unit) if down else 0.0
        slow_up = c.Ts / max(float(np.quantile(du, up)), c.unit) if up else 0.0
        by = max(slow_down, slow_up, 1e-9)
        out.append({"down": slow_down, "up": slow_up, "down_by": by, "up_by": by})
    return out


_POSITIVE = ("gain", "Td", "down", "up")
_TERMS: tuple[tuple[str, Callable[[_Controller], list[_Numbers]], tuple[str, ...]], ...] = (
    ("regime", _regimes, ("gain", "square")),
    ("regime", _regimes, ("gain", "side")),
    ("regime", _regimes, ("gain", "schedule")),
    ("derivative", _derivatives, ("Td", "filter")),
    ("weight", lambda c: [{"weight": 0.5, "weight_by": 0.5}], ("weight",)),
    ("ramps", _speeds, ("down", "up")),
)


@lru_cache(maxsize=4)
def sensor_law(s: Situation, first: int) -> FoundLaw | None:
    """Return what single samples of PV show: stairs, ends of a range, spells in which it stands, a mean over a window."""
    pv, Ts, n = np.asarray(s.record.pv), s.record.Ts, s.record.n
    unit = max(s.samples.resolution, 1e-9 * float(np.ptp(pv)))
    if s.archive.rounding is not None:
        step = s.archive.rounding[0]
        return FoundLaw("stairs", {"step": step}, float((n - first) * np.log(max(step / unit, 2.0))))
    averaged = _mean_law(s, first)
    if averaged is not None:
        return averaged
    chance = float(np.log(max(float(np.std(np.diff(pv))) / unit, 2.0)))
    stands = np.append(False, np.diff(pv) == 0.0)
    ends = {"low": pv == pv.min(), "high": pv == pv.max()}
    clipped = {name: at for name, at in ends.items() if at.mean() > _ENDS}
    if clipped and stands[np.any(list(clipped.values()), axis=0)].mean() > 0.3:
        hits = sum(int(at.sum()) for at in clipped.values())
        numbers = {name: float(pv.min() if name == "low" else pv.max()) for name in clipped}
        return FoundLaw("clipped", numbers, hits * chance, on=np.any(list(clipped.values()), axis=0))
    long = stands & (holds(pv)[np.cumsum(~stands) - 1] >= 3)
    if long.mean() > _HELD and (s.frozen or s.baseline.noise.std > unit):
        runs = runs_of(long)
        numbers = {"share": float(long.mean()), "length": float(np.mean(runs[:, 1] - runs[:, 0])) * Ts}
        return FoundLaw("held", numbers, int(long.sum()) * chance, on=long)
    return None


def _mean_law(s: Situation, first: int) -> FoundLaw | None:
    """Return the window over which the archive averages, where the controller saw another PV than the one on record."""
    if s.law.recovered_pv is None or s.archive.band > 0.0 or s.archive.spikes is not None:
        return None
    pv, seen = np.asarray(s.record.pv), np.asarray(s.law.recovered_pv)

    def misfit(width: float, where: slice) -> float:
        return float(np.std((pv - running_mean(seen, width))[where])) + 1e-6 * float(np.std(pv))

    width = min(np.arange(1.0, 40.0, 0.1), key=lambda w: misfit(w, slice(40, first)))
    ratio = misfit(width, slice(first, None)) / misfit(1.0, slice(first, None))
    if width < _ORDINARY_MEAN or not ratio < _EXPLAINS:
        return None
    return FoundLaw("averaged", {"window": float(width) * s.record.Ts}, float(-(s.record.n - first) * np.log(ratio)))


def shown(s: Situation, form: str) -> dict[str, float | str] | None:
    """Return the numbers of a form that controller or samples show without doubt, where nothing known does; None otherwise."""
    if any(block == LAW_FORMS[form].block for block, _ in s.facts.values()) or not s.trusted:
        return None
    find = controller_law if LAW_FORMS[form].block == "controller" else sensor_law
    law = find(s, int(_LEARNT * s.record.n))
    return dict(law.numbers) if law is not None and law.form == form and law.nats > _PROOF else None
