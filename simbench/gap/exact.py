"""Show effects of controller and sensor without a likelihood, from OP or single samples of PV:
derivative action, missed executions, a frozen sensor.

A term of the controller is fitted to the first part of the record and judged by what it leaves on
the rest, compared with the best law without it.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import lru_cache
from typing import NamedTuple

import numpy as np
import scipy

from simbench.detectors.signal.filters import lfilter
from simbench.detectors.signal.holds import holds, runs_of
from simbench.detectors.signal.lattice import written_unit
from simbench.gap.controller.examine import stated_controller
from simbench.gap.controller.law import FORMS
from simbench.gap.situation import Situation
from simbench.gap.thresholds import MEAN_EXPLAINS, TERM_EXPLAINS, TERM_NATS
from simbench.loop.effects import block_of

_LEARNT = 0.65  # share of the record that a law is fitted to, where the record is diagnosed
_IDLE = 0.05  # share of samples in which OP rests though the law would move it
_ENDS = 0.02  # share of samples of PV exactly at its largest or smallest
_REPEATS = 1e-3  # chance that OP repeats itself where the law asks for many times its digits
_HELD = 0.02  # share of samples of PV that repeat the last one beyond chance

_Numbers = dict[str, float]


class Term(NamedTuple):
    """A term that explains a part of the record: its name, its numbers (units of the loop file),
    and what it brings on samples that it was not fitted to (nats).
    """

    name: str
    numbers: _Numbers
    nats: float


@lru_cache(maxsize=4)
def controller_term(s: Situation, first: int) -> Term | None:
    """Return the term between error and OP that the baseline's law does not know; None where the
    baseline's explains OP, or the examination of OP has shown what does.
    """
    law = s.law
    if law.limits is not None or law.gap > 0.0 or law.step > 0.0 or law.tuning is not None:
        return None
    if (
        law.known and not law.averaged and not s.unexplained_law
    ) or s.baseline.controller.type == "PID":
        # a PID's terms are in the baseline
        return None

    # an archive may store PV before the controller ran; where no law is exact, nothing has shown
    # that yet
    aligned = [_Controller(s, late) for late in sorted({law.late, 1})]
    plain = min((one.left({}, one.newest) for one in aligned), key=aligned[0].misfit)
    terms = [one.idle(first, plain) for one in aligned]
    for one in aligned:
        for guess in one.guesses():
            terms.append(one.derivative(guess, first, plain))
    best = max(filter(None, terms), key=lambda one: one.nats, default=None)

    # a mean of the archive's looks like a term of the controller, but explains less
    if law.averaged:
        least = -np.log(MEAN_EXPLAINS) * (s.record.n - first)
    else:
        least = -np.inf
    return best if best is not None and best.nats >= least else None


def read_off(event: np.ndarray, q: float, first: int) -> float:
    """Return what an event in single samples (n,) brings (nats), whose numbers are not fitted.

    How often it happens is learnt from one part of the record and judged on the other against a
    chance `q` of it, the better of both ways (Wasserman, Ramdas & Balakrishnan 2020, cross-fit), or
    of the longest run that chance brings.
    """
    q = float(np.clip(q, 1e-6, 0.5))

    def nats(learn: np.ndarray, judge: np.ndarray) -> float:
        p = float(np.clip((learn.sum() + 0.5) / (learn.size + 1.0), q, 1.0 - 1e-6))
        hits = int(judge.sum())
        return float(hits * np.log(p / q) + (judge.size - hits) * np.log((1.0 - p) / (1.0 - q)))

    parts = event[:first], event[first:]
    longest = max((b - a for a, b in runs_of(event)), default=0) * -np.log(q) - np.log(event.size)
    return float(max(nats(*parts), nats(*parts[::-1]), longest) - np.log(3.0))


class _Controller:
    """The controller's signals (OP in %, error in PV units), its numbers, the digits of OP, and the
    share of the newest error in its integral.
    """

    def __init__(self, s: Situation, late: int) -> None:
        pv = np.asarray(s.record.pv)
        stated = stated_controller(s.baseline, s.record.Ts)
        self.Ts = s.record.Ts
        self.moves = np.diff(s.sp)
        self.op = np.asarray(s.op)
        self.e = s.sp - (np.append(pv[0], pv[:-1]) if late else pv)
        self.Kc = stated.Kc
        self.Ki = stated.Ki
        # digits of OP and PV as far as they reach OP, or what an archive by exception hides
        digits = written_unit(s.op), abs(self.Kc) * written_unit(pv), s.law.hidden
        self.unit = max(*digits, 1e-6 * float(np.std(s.op)), 1e-9) / 3.0
        self.newest = min(FORMS, key=lambda share: float(np.median(np.abs(self.left({}, share)))))

    def left(self, numbers: _Numbers, newest: float) -> np.ndarray:
        """Return what a law leaves of OP (n - 1,), each sample from the recorded one before."""
        e = self.e
        change = np.diff(self.e)
        du = self.Kc * change + self.Ki * (newest * e[1:] + (1.0 - newest) * e[:-1])
        if Td := numbers.get("Td", 0.0):
            follow = 1.0 / (1.0 + numbers["filter"] / self.Ts)
            slope = lfilter([follow], [1.0, follow - 1.0], change - self.moves)
            du = du + self.Kc * Td / self.Ts * np.diff(np.append(0.0, slope))
        return np.diff(self.op) - du

    def misfit(self, left: np.ndarray) -> float:
        """Return the mean size of what is left; digits bound it from below."""
        return float(np.mean(np.abs(left))) + self.unit

    def derivative(self, guess: _Numbers, first: int, plain: np.ndarray) -> Term | None:
        """Return a derivative term, its numbers fitted robustly to the first part from a guess.

        How the integral counts the newest error is fitted too: under another form other numbers are
        the same law.
        """
        scale = self.misfit(plain[:first])

        def misfit(x: np.ndarray) -> np.ndarray:
            return self.left(dict(zip(guess, x)), x[-1])[:first] / scale

        box = [(0.0, np.inf) for _ in guess] + [(-0.1, 1.1)]
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
        numbers = {}
        for m, v in zip(guess, solution.x):
            numbers[m] = float(v)
        left = self.left(numbers, solution.x[-1])
        ratio = self.misfit(left[first:]) / self.misfit(plain[first:])
        if ratio >= TERM_EXPLAINS:
            return None
        return Term("derivative", numbers, -float(np.log(ratio)) * left[first:].size)

    def guesses(self) -> Iterator[_Numbers]:
        """Yield numbers of a derivative term from which its fit may start."""
        if self.Ki:
            pace = abs(self.Kc / self.Ki) * self.Ts
        else:
            pace = 10 * self.Ts
        for share in (0.05, 0.3, 1.0):
            yield {"Td": share * pace, "filter": 0.1 * share * pace}

    def idle(self, first: int, plain: np.ndarray) -> Term | None:
        """Return the term of a controller that does not run in some samples, where OP rests though
        it should move.
        """
        # Runs in which OP stands where the plain law moves it
        du = np.diff(self.op)
        still = np.append(False, du == 0.0)
        asked = np.append(0.0, np.abs(du - plain))
        runs = []
        for a, b in runs_of(still):
            if asked[a:b].max() > 5.0 * self.unit:
                runs.append(slice(a, b))
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

        # The best of these must explain OP, and the plain law must not
        left = min((du - np.where(idle[1:], 0.0, asked) for asked in tries), key=self.misfit)
        if not self.misfit(left) < TERM_EXPLAINS * self.misfit(plain):
            return None
        length = float(idle.sum()) / len(runs) * self.Ts
        return Term("idle", {"share": share, "length": length}, read_off(idle, _REPEATS, first))


@lru_cache(maxsize=4)
def frozen(s: Situation, first: int) -> Term | None:
    """Return the spells in which PV repeats itself; None where there are none, or a rounding or the
    ends of a range explain them better.
    """
    # A rounding explains repeats by itself
    if s.archive.rounding is not None:
        return None

    # How likely two equal samples are by chance
    pv = np.asarray(s.record.pv)
    unit = max(s.samples.resolution, 2.0 * s.samples.band, 1e-9 * float(np.ptp(pv)))
    chance = unit / max(float(np.std(np.diff(pv))), unit)

    # Repeats of three samples and more; those at a limit are none
    still = np.append(False, np.diff(pv) == 0.0)
    ends = []
    for end in (float(pv.min()), float(pv.max())):
        if np.mean(pv == end) > _ENDS:
            ends.append(end)
    long = still & (holds(pv)[np.cumsum(~still) - 1] >= 3)
    noisy = s.samples.band == 0.0 and s.baseline.noise.std > unit

    # Few repeats, or a sensor that is too quiet to tell
    if long.mean() <= _HELD or not (s.frozen or noisy):
        return None

    # Repeats at the limits explain as much
    nats = read_off(long, chance, first)
    if ends and read_off(np.isin(pv, ends), chance, first) >= nats:
        return None

    # The share and the mean length of the spells
    length = float(long.sum()) / len(runs_of(long)) * s.record.Ts
    return Term("held", {"share": float(long.mean()), "length": length}, nats)


def shown(s: Situation, name: str) -> dict[str, float | str] | None:
    """Return the numbers of a term ("derivative", "idle", "held") that controller or samples show
    without doubt, where nothing known does; None otherwise.
    """
    if name == "held":
        find = frozen
        block = "sensor"
    else:
        find = controller_term
        block = "controller"
    if any(block_of(effect) == block for effect in s.facts) or not s.trusted:
        return None
    term = find(s, int(_LEARNT * s.record.n))
    if term is not None and term.name == name and term.nats > TERM_NATS:
        return dict(term.numbers)
    return None
