"""Fit models that need no likelihood: controller laws from error to OP, and sensor models of single
samples of PV.

A law is fitted to the first part of the record and judged by what it leaves on the rest, compared
with the best law without it.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from functools import lru_cache

import numpy as np
import scipy

from simbench.detectors.signal.filters import lfilter
from simbench.detectors.signal.holds import holds, runs_of
from simbench.detectors.signal.lattice import written_unit
from simbench.gap.controller.examine import stated_controller
from simbench.gap.controller.regression import FORMS
from simbench.gap.law import FoundLaw
from simbench.gap.situation import Situation
from simbench.loop.laws import LAW_FORMS

# share of what the law without the new term leaves, below which the term is the law
_EXPLAINS = 0.6
_MEAN_EXPLAINS = 0.3  # the same where a mean of the archive's would explain OP as well
_LEARNT = 0.65  # share of the record that a law is fitted to, where the record is diagnosed
_PROOF = 60.0  # nats from which a law needs no statistics
_IDLE = 0.05  # share of samples in which OP rests though the law would move it
_ENDS = 0.02  # share of samples of PV exactly at its largest or smallest
_REPEATS = 1e-3  # chance that OP repeats itself where the law asks for many times its digits
_HELD = 0.02  # share of samples of PV that repeat the last one beyond chance

_Numbers = dict[str, float]


@lru_cache(maxsize=4)
def controller_law(s: Situation, first: int) -> FoundLaw | None:
    """Return the law between error and OP that the baseline's does not know; None where the
    baseline's explains OP.
    """
    from_op = _read_from_op(s, first)
    if (
        from_op
        or (s.law.known and not s.law.averaged and not s.unexplained_law)
        or s.baseline.controller.type == "PID"
    ):
        # a PID's terms are in the baseline
        return max(from_op, key=lambda one: one.nats, default=None)
    # an archive may store PV before the controller ran; where no law is exact, nothing has shown
    # that yet
    aligned = [_Controller(s, late) for late in sorted({s.law.late, 1})]
    plain = min((one.left({}, one.newest) for one in aligned), key=aligned[0].misfit)
    laws = [one.idle(first, plain) for one in aligned]
    laws += [one.fitted(*term, first, plain) for one in aligned for term in one.terms()]
    best = max(filter(None, laws), key=lambda one: one.nats, default=None)
    # a mean of the archive's looks like a term of the controller, but explains less
    least = -np.log(_MEAN_EXPLAINS) * (s.record.n - first) if s.law.averaged else -np.inf
    return best if best is not None and best.nats >= least else None


def _read_from_op(s: Situation, first: int) -> list[FoundLaw]:
    """Return the laws whose form the examination of OP has shown already, each where it pays."""
    law, op = s.law, s.op
    unit = max(written_unit(op, np.asarray(s.record.pv)), 1e-6 * float(np.std(op)), 1e-9)
    if law.limits is not None:
        numbers = dict(zip(("low", "high"), law.limits))
        return [
            _read_off("limits", numbers, np.isin(op, law.limits), unit / float(np.ptp(op)), first)
        ]
    out = []
    if law.gap > 0.0:
        still, moves = np.append(False, np.diff(op) == 0.0), float(np.std(np.diff(op)))
        out.append(_read_off("rest", {"width": law.gap}, still, unit / moves, first))
    if law.step > 0.0:
        on = _on_lattice(op, law.step, unit)
        out.append(_read_off("rest", {"step": law.step}, on, unit / law.step, first))
    if law.tuning is not None:
        c, guess = _Controller(s, law.late), dict(zip(("gain", "integral"), law.tuning))
        one = c.fitted("tuning", guess, first, c.left({}, c.newest))
        out += [one] if one is not None else []
    return out


def _on_lattice(x: np.ndarray, step: float, unit: float) -> np.ndarray:
    return np.abs(x - x[0] - step * np.round((x - x[0]) / step)) < 0.75 * unit


def _read_off(
    form: str,
    numbers: _Numbers,
    event: np.ndarray,
    q: float,
    first: int,
    on: np.ndarray | None = None,
) -> FoundLaw:
    """Return a law that shows in single samples, whose numbers are read off, not fitted.

    How often its `event` (n,) happens is learnt from one part of the record and judged on the other
    against a chance `q` of it, the better of both ways (Wasserman, Ramdas & Balakrishnan 2020,
    cross-fit), or of the longest run that chance brings.
    """
    q = float(np.clip(q, 1e-6, 0.5))

    def nats(learn: np.ndarray, judge: np.ndarray) -> float:
        p = float(np.clip((learn.sum() + 0.5) / (learn.size + 1.0), q, 1.0 - 1e-6))
        hits = int(judge.sum())
        return float(hits * np.log(p / q) + (judge.size - hits) * np.log((1.0 - p) / (1.0 - q)))

    parts = event[:first], event[first:]
    longest = max((b - a for a, b in runs_of(event)), default=0) * -np.log(q) - np.log(event.size)
    best = max(nats(*parts), nats(*parts[::-1]), longest) - np.log(3.0)
    return FoundLaw(form, numbers, float(best), on=on)


class _Controller:
    """The controller's signals (OP in %, error in PV units), its numbers, the digits of OP, and the
    share of the newest error in its integral.
    """

    def __init__(self, s: Situation, late: int) -> None:
        pv, stated = np.asarray(s.record.pv), stated_controller(s.baseline, s.record.Ts)
        self.late, self.Ts, self.moves = late, s.record.Ts, np.diff(s.sp)
        self.op, self.e = np.asarray(s.op), s.sp - (np.append(pv[0], pv[:-1]) if late else pv)
        self.Kc, self.Ki = stated.Kc, stated.Ki
        # digits of OP and PV as far as they reach OP, or what an archive by exception hides
        digits = written_unit(s.op), abs(self.Kc) * written_unit(pv), s.law.hidden
        self.unit = max(*digits, 1e-6 * float(np.std(s.op)), 1e-9) / 3.0
        self.newest = min(FORMS, key=lambda share: float(np.median(np.abs(self.left({}, share)))))

    def left(self, numbers: _Numbers, newest: float) -> np.ndarray:
        """Return what a law leaves of OP (n - 1,), each sample from the recorded one before."""
        e, get = self.e, numbers.get
        counts = e * (get("gain", 1.0) + get("square", 0.0) * np.abs(e)) + get(
            "side", 0.0
        ) * np.abs(e)
        change = np.diff(counts)
        adds = newest * counts[1:] + (1.0 - newest) * counts[:-1]
        du = (
            self.Kc * (change - (1.0 - get("weight", 1.0)) * self.moves)
            + self.Ki / get("integral", 1.0) * adds
        )
        du = du * np.maximum(1.0 + get("schedule", 0.0) * (self.op[:-1] - self.op.mean()), 0.05)
        if get("Td", 0.0):
            follow = 1.0 / (1.0 + get("filter", 0.0) / self.Ts)
            slope = lfilter([follow], [1.0, follow - 1.0], change - self.moves)
            du = du + self.Kc * get("Td", 0.0) / self.Ts * np.diff(np.append(0.0, slope))
        down, up = (self.Ts / x if x > 0.0 else np.inf for x in (get("down", 0.0), get("up", 0.0)))
        return np.diff(self.op) - np.clip(du, -down, up)

    def misfit(self, left: np.ndarray) -> float:
        """Return the mean size of what is left; digits bound it from below."""
        return float(np.mean(np.abs(left))) + self.unit

    def fitted(self, form: str, guess: _Numbers, first: int, plain: np.ndarray) -> FoundLaw | None:
        """Return a law with its numbers fitted robustly to the first part, from a guess.

        How the integral counts the newest error is fitted too: under another form other numbers are
        the same law.
        """
        scale = self.misfit(plain[:first])

        def misfit(x: np.ndarray) -> np.ndarray:
            return self.left(dict(zip(guess, x)), x[-1])[:first] / scale

        box = [*((0.0 if m in _POSITIVE else -np.inf, np.inf) for m in guess), (-0.1, 1.1)]
        with np.errstate(all="ignore"):
            solution = scipy.optimize.least_squares(
                misfit,
                [*guess.values(), self.newest],
                bounds=tuple(zip(*box)),
                loss="soft_l1",
                f_scale=0.1,
                x_scale="jac",
                max_nfev=60,
            )
        numbers = {m: float(v) for m, v in zip(guess, solution.x)}
        left = self.left(numbers, solution.x[-1])
        ratio = self.misfit(left[first:]) / self.misfit(plain[first:])
        if ratio >= _EXPLAINS:
            return None
        variance = np.maximum(np.diag(np.linalg.pinv(solution.jac.T @ solution.jac)), 0.0)
        spread = 2.0 * np.sqrt(variance) * float(np.std(left[:first] / scale))
        intervals = {m: (v - float(d), v + float(d)) for (m, v), d in zip(numbers.items(), spread)}
        evidence = np.append(0.0, np.log((np.abs(plain) + self.unit) / (np.abs(left) + self.unit)))
        nats = -float(np.log(ratio)) * left[first:].size
        return FoundLaw(form, numbers, nats, evidence, intervals=intervals, late=self.late)

    def terms(self) -> Iterator[tuple[str, _Numbers]]:
        """Yield form and first guess of each term that may be missing."""
        for name in ("square", "side", "schedule"):
            yield "regime", {"gain": 1.0, name: 0.0}
        pace = abs(self.Kc / self.Ki) * self.Ts if self.Ki else 10 * self.Ts
        for share in (0.05, 0.3, 1.0):
            yield "derivative", {"Td": share * pace, "filter": 0.1 * share * pace}
        yield "weight", {"weight": 0.5}
        fall, rise = (
            self.Ts / max(float(np.quantile(side * np.diff(self.op), 0.95)), self.unit)
            for side in (-1.0, 1.0)
        )
        for guess in ({"down": fall}, {"up": rise}, {"down": fall, "up": rise}):
            yield "ramps", guess

    def idle(self, first: int, plain: np.ndarray) -> FoundLaw | None:
        """Return the law of a controller that does not run in some samples, where OP rests though
        it should move.
        """
        du = np.diff(self.op)
        still, asked = np.append(False, du == 0.0), np.append(0.0, np.abs(du - plain))
        runs = [slice(a, b) for a, b in runs_of(still) if asked[a:b].max() > 5.0 * self.unit]
        idle = np.zeros(still.size, dtype=bool)
        for run in runs:
            idle[run] = True
        share = float(idle.mean())
        if not _IDLE < share < 0.95:
            return None
        # what the error was when the controller last ran, and (bumpless return) just before; each
        # form of the integral
        last = np.maximum.accumulate(np.where(idle, 0, np.arange(idle.size)))[:-1]
        now = self.e[1:]
        tries = (
            self.Kc * (now - before) + self.Ki * (newest * now + (1.0 - newest) * before)
            for before in (self.e[last], self.e[:-1])
            for newest in FORMS
        )
        left = min((du - np.where(idle[1:], 0.0, asked) for asked in tries), key=self.misfit)
        if not self.misfit(left) < _EXPLAINS * self.misfit(plain):
            return None
        length = float(idle.sum()) / len(runs) * self.Ts
        law = _read_off("idle", {"share": share, "length": length}, idle, _REPEATS, first, idle)
        return replace(law, late=self.late)


_POSITIVE = ("gain", "integral", "Td", "filter", "down", "up")


@lru_cache(maxsize=4)
def sensor_law(s: Situation, first: int) -> FoundLaw | None:
    """Return what single samples of PV show: stairs, ends of a range, spells without change."""
    pv = np.asarray(s.record.pv)
    unit = max(s.samples.resolution, 2.0 * s.samples.band, 1e-9 * float(np.ptp(pv)))
    if s.archive.rounding is not None:
        step = s.archive.rounding[0]
        return _read_off("stairs", {"step": step}, _on_lattice(pv, step, unit), unit / step, first)
    chance = unit / max(float(np.std(np.diff(pv))), unit)
    still = np.append(False, np.diff(pv) == 0.0)
    laws = []
    ends = {"low": float(pv.min()), "high": float(pv.max())}
    ends = {name: end for name, end in ends.items() if np.mean(pv == end) > _ENDS}
    at_end = np.isin(pv, [*ends.values()])
    if ends:
        laws.append(_read_off("clipped", ends, at_end, chance, first, at_end))
    long = still & (holds(pv)[np.cumsum(~still) - 1] >= 3)
    noisy = s.samples.band == 0.0 and s.baseline.noise.std > unit
    if long.mean() > _HELD and (s.frozen or noisy):
        length = float(long.sum()) / len(runs_of(long)) * s.record.Ts
        numbers = {"share": float(long.mean()), "length": length}
        laws.append(_read_off("held", numbers, long, chance, first, long))
    return max(laws, key=lambda law: law.nats, default=None)


def shown(s: Situation, form: str) -> dict[str, float | str] | None:
    """Return the numbers of a form that controller or samples show without doubt, where nothing
    known does; None otherwise.
    """
    if any(block == LAW_FORMS[form].block for block, _ in s.facts.values()) or not s.trusted:
        return None
    find = controller_law if LAW_FORMS[form].block == "controller" else sensor_law
    law = find(s, int(_LEARNT * s.record.n))
    return dict(law.numbers) if law is not None and law.form == form and law.nats > _PROOF else None
