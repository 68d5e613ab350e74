"""Valve travel test: move OP by hand in small steps until PV moves; steps in one direction measure
J, steps after a reversal measure S.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from simbench.confirm.rig import LiveLoop, Trace, draw_trace, lengthen_loop
from simbench.detectors.errors import ParameterError
from simbench.detectors.verdict import NO_DECISION, NO_STICTION, STICTION
from simbench.loop.resolve import resolve_loop
from simbench.scenarios.spec import Loop

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_BIG_STEP = 10.0  # %, to overcome the band (Gerry and Ruel 2001: 5 to 10 %)
_SMALL_STEP = 0.2  # %
_CYCLES_ABOVE = 0.2  # %, stiction that will usually cycle (Gerry and Ruel 2001)
SIGMAS = 5.0  # PV has moved when it changed by more than this many standard errors ...
_MOVE_SHARE = 0.2  # ... and by more than this share of what one small step does to it
_SETTLED = 8.0  # lags waited after a step: e^-8 of the big step is left
_LONGEST_WINDOW = 1000  # samples of PV averaged, once it has settled


Interval = tuple[float, float]


@dataclass(frozen=True, eq=False)
class TravelTest:
    """Outcome of a valve travel test."""

    # sum of the small steps (%) in the direction of the big one until PV moved: the slip jump J,
    # and the stiction of the printed procedure. None when the end of travel came first.
    same_direction: float | None
    # sum of the small steps (%) against it until PV moved: dead-band plus stick band, S
    reversed: float | None
    increment: float  # size of a small step (%); both sums may be too large by one
    wait: float  # Time (s) given to every step
    sticky: bool | None  # whether S exceeds two small steps; None when it is not known
    reason: str  # one sentence
    Ts: float  # sampling period (s)
    phase: np.ndarray  # (n,) 0 big steps, 1 small steps in the same direction, 2 reversed
    trace: Trace  # OP (%), PV and MV (%) of the test
    # from the least to the largest value (%) that the test leaves possible
    S_interval: Interval | None = None
    J_interval: Interval | None = None

    @property
    def J(self) -> float | None:
        """Slip jump (%)."""
        return self.same_direction

    @property
    def S(self) -> float | None:
        """Dead-band plus stick band (%)."""
        return self.reversed

    @property
    def verdict(self) -> str:
        """What is said of the valve: "stiction", "no_stiction" or "no_decision"."""
        if self.sticky is None:
            return NO_DECISION
        if self.sticky:
            return STICTION
        return NO_STICTION

    def as_json(self) -> dict[str, Any]:
        """Return the outcome without its signals."""

        def ends(x: Interval | None) -> list[float] | None:
            if x is None:
                return None
            return list(x)

        return {
            "verdict": self.verdict,
            "S": self.S,
            "S_interval": ends(self.S_interval),
            "J": self.J,
            "J_interval": ends(self.J_interval),
            "S_minus_J": None if self.S is None or self.J is None else self.S - self.J,
            "increment": self.increment,
            "wait": self.wait,
            "sticky": self.sticky,
            "reason": self.reason,
        }

    def as_text(self) -> str:
        """Return the outcome in three lines."""

        def size(x: float | None, of: Interval | None) -> str:
            if of is None:
                between = ""
            else:
                between = f" ({of[0]:.3g} to {of[1]:.3g})"
            if x is None:
                return "not measured"
            return f"{x:.3g} %{between}"

        return (
            f"{self.reason[:1].upper()}{self.reason[1:]}.\n"
            f"OP change until PV moves, same direction (slip-jump J):"
            f" {size(self.J, self.J_interval)}\n"
            f"OP change until PV moves, after a reversal (stick band S):"
            f" {size(self.S, self.S_interval)}"
        )

    def plot(self) -> Figure:
        """Draw OP and PV over the test, with the three phases marked."""
        starts = np.nonzero(np.diff(self.phase))[0] + 1
        return draw_trace(self.trace, self.Ts, starts, self.reason)


def travel_test(
    loop: Loop, increment: float = _SMALL_STEP, big_step: float = _BIG_STEP, seed: int = 0
) -> TravelTest:
    """Put a loop in manual and step its valve until PV moves.

    Procedure 11.4 (Gerry and Ruel 2001) takes the small steps in the direction of the big one. On a
    two-parameter valve that measures the slip jump J, since the dead-band is already crossed; small
    steps in the opposite direction measure the whole band S. PV has moved when its settled mean
    (integrating plants: its slope) changed by five standard errors, and by a fifth of what a small
    step of a moving valve does.
    """
    if not 0 < increment < big_step <= 50:
        raise ParameterError(
            f"travel test: increment {increment} % and big step {big_step} %; 0 < increment < big"
            " step <= 50 is needed"
        )
    manual = _Manual(loop, increment, big_step, seed)
    side = 1.0 if manual.op <= 50 else -1.0
    same = back = None
    if manual.steps_until_moved(side * big_step, phase=0) is not None:
        # what the big steps did to PV, per % of them, is the least that a moving valve does
        answer = abs(manual.seen - manual.rest)
        moved = abs(manual.op - manual.first_op)
        manual.least_answer = increment * answer / moved
        same = manual.steps_until_moved(side * increment, phase=1)
        back = manual.steps_until_moved(-side * increment, phase=2)
    return manual.outcome(same, back)


class _Manual:
    """A loop in manual: OP goes in steps, and PV is looked at after each wait."""

    def __init__(self, loop: Loop, increment: float, big_step: float, seed: int) -> None:
        # A loop without loads, and how long it takes to settle
        quiet = loop.model_copy(update={"disturbance": ()})
        setup = resolve_loop(quiet, seed)
        lags = []
        for p in np.roots(setup.den):
            if abs(p) > 1e-12:
                lags.append(1 / abs(p))
        self.integrating = setup.den[-1] == 0
        self.increment = increment
        self.Ts = setup.Ts
        self.op = setup.op0
        self.k = 0
        settle = int(np.ceil((setup.Td + _SETTLED * sum(lags)) / self.Ts))

        # an engineer waits until half a small step would show in the noise
        answer = abs(setup.num[-1] / setup.den[setup.den != 0][-1]) * increment / 2
        self.window = 10
        while (
            self.window < _LONGEST_WINDOW
            and SIGMAS * np.sqrt(2) * self._error_of_reading(setup.noise_std) > answer
        ):
            self.window *= 2

        # Steps enough for the whole travel
        self.wait = settle + self.window
        steps = int(200 / increment + 100 / big_step) + 4
        self.live = LiveLoop(resolve_loop(lengthen_loop(quiet, steps * self.wait), seed))
        self.phase: list[int] = []
        self.first_op, self.seen, self.least_answer = self.op, self._hold_op(0), 0.0
        self.rest = self.seen
        self.error = self._error_of_reading(float(self.live.pv[settle : self.wait].std()))

    def _error_of_reading(self, sigma: float) -> float:
        """Return the standard error of a reading, see `_hold_op`, under such white noise on PV."""
        n = self.window
        if self.integrating:
            return sigma * np.sqrt(12 / n) / (n * self.Ts)
        return sigma / np.sqrt(n)

    def _hold_op(self, phase: int) -> float:
        """Hold OP for one wait and return PV's mean (integrating: slope per s) over its end."""
        for _ in range(self.wait):
            self.live.control(self.k, by_hand=self.op)
            self.live.advance(self.k)
            self.k += 1
        self.phase += [phase] * self.wait
        late = self.live.pv[self.k - self.window : self.k]
        return float(
            np.polyfit(np.arange(late.size) * self.Ts, late, 1)[0]
            if self.integrating
            else late.mean()
        )

    def steps_until_moved(self, step: float, phase: int) -> float | None:
        """Step OP until PV has moved and return the sum of the steps (%); None when OP's limit
        comes first.
        """
        before = self.seen
        count = 0
        bar = max(SIGMAS * np.sqrt(2) * self.error, _MOVE_SHARE * self.least_answer, 1e-12)
        while 0 <= self.op + step <= 100:
            self.op += step
            count += 1
            self.seen = self._hold_op(phase)
            if abs(self.seen - before) > bar:
                return round(count * abs(step), 9)
        return None

    def outcome(self, same: float | None, back: float | None) -> TravelTest:
        """Put the findings into words."""
        # What was recorded, and whether PV answered
        k = self.k
        wait = self.wait * self.Ts
        trace = Trace(self.live.op[:k], self.live.pv[:k], self.live.mv[:k])
        if back is None:
            sticky = None
        else:
            sticky = back > 2 * self.increment + 1e-9
        if same is None and back is None:
            reason = (
                "PV did not answer before OP reached its limit: no travel, or noise that hides it"
            )
        elif same is None or back is None:
            reason = (
                "OP reached its limit before PV moved again: start further from the ends of travel"
            )
        elif not sticky:
            reason = "PV follows small steps both ways: no stiction"
        else:
            cycles = (
                ""
                if same <= _CYCLES_ABOVE + 1e-9
                else "; this is enough to make a loop cycle under PI control"
            )
            reason = (
                f"the valve sticks: stick band S = {back:.3g} %, slip-jump J = {same:.3g} %{cycles}"
            )

        # a sum of steps may be too large by one
        if back is None:
            S = None
        else:
            S = (max(0.0, back - self.increment), back)
        if same is None:
            J = None
        else:
            J = (max(0.0, same - self.increment), same)

        # The test with its sizes
        phase = np.array(self.phase)
        return TravelTest(
            same, back, self.increment, wait, sticky, reason, self.Ts, phase, trace, S, J
        )
