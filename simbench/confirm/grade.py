"""Grade a loop by Table 11.1: process gain, noise band, hysteresis and stiction, each against its
acceptable range.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from simbench.confirm.travel import TravelTest, travel_test
from simbench.detectors.views import columns
from simbench.loop.resolve import resolve_loop
from simbench.loop.response import valve_response
from simbench.scenarios.spec import Loop

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_SIGMAS = 4.0  # standard deviations in a noise band
_REST = 0.01  # % of travel: less is no motion
_TRAVERSE = 0.1  # % per sample


@dataclass(frozen=True)
class _Limit:
    """A line of the table."""

    parameter: str  # name and unit
    # ideal, practical: as printed
    ideal: str
    practical: str
    # low, high: between them, ends included, the value is acceptable
    low: float
    high: float


GAIN_LIMIT = _Limit(
    "process gain (%/%)", "1", "< 0.5: too small; 0.5 to 3: acceptable; > 3: too high", 0.5, 3.0
)
NOISE = _Limit("noise band (%)", "0", "< 0.5: acceptable", 0.0, 0.5)
HYSTERESIS = _Limit("hysteresis (%)", "0", "< 3: acceptable; > 3: to be checked", 0.0, 3.0)
STICTION_LIMIT = _Limit("stiction (%)", "0", "1: desirable; > 1: to be checked", 0.0, 1.0)


@dataclass(frozen=True)
class _Grade:
    """One parameter of a loop, graded."""

    parameter: str  # name and unit
    value: float | None  # measured; None when the loop does not tell
    # ideal, practical: the table's words
    ideal: str
    practical: str
    acceptable: bool | None  # None = cannot tell
    reason: str  # how it was measured, or why it cannot be


def grade(loop: Loop, test: TravelTest | None = None) -> list[_Grade]:
    """Measure a loop in manual, as an engineer would, and grade it by Table 11.1.

    Source: Jelali (2013), Table 11.1, after Ruel (2000); the limits of the gain, 0.5 and 3, as far
    as the text keeps them.
    Process gain: PV over OP across the big steps of the travel test. Noise band: four standard
    deviations of PV while OP rests.
    Hysteresis: largest separation of the valve's positions over full strokes up and down, less the
    dead-band. Stiction: small steps in the direction of the last big one until PV moves, up to one
    step too large.
    """
    # One travel test in manual gives all four measures
    test = test or travel_test(loop)
    rest = round(test.wait / test.Ts)
    last = int(np.flatnonzero(test.phase == 0)[-1])
    return [
        _grade_gain(loop, test, rest, last),
        _grade_against(
            NOISE,
            float(_SIGMAS * test.trace.pv[rest // 2 : rest].std()),
            f"{_SIGMAS:g} standard deviations of PV while OP rests",
        ),
        _grade_against(
            HYSTERESIS,
            _measure_hysteresis(loop),
            "separation of full strokes up and down, less the dead-band",
        ),
        _grade_against(
            STICTION_LIMIT,
            test.J,
            f"small steps of {test.increment:g} % until PV moves" if test.J else test.reason,
        ),
    ]


def graded_test(loop: Loop) -> _GradedTest:
    """Run the travel test on a loop and grade the loop by what it measured."""
    test = travel_test(loop)
    return _GradedTest(test, tuple(grade(loop, test)))


@dataclass(frozen=True, eq=False)
class _GradedTest:
    """A travel test and its grades by Table 11.1."""

    test: TravelTest
    grades: tuple[_Grade, ...]

    def as_json(self) -> dict[str, Any]:
        """Return the test's outcome and, as `table_11_1`, the grades."""
        return {**self.test.as_json(), "table_11_1": [asdict(g) for g in self.grades]}

    def as_text(self) -> str:
        """Return the test's outcome and one line per grade."""
        # The test, then a row for every grade
        words = {True: "acceptable", False: "to be checked", None: "cannot tell"}
        lines = [
            self.test.as_text(),
            "",
            "Grades by Table 11.1 of the chapter (PV in % of its span):",
        ]
        rows = [("quantity", "value", "grade", "how it was measured")]
        for g in self.grades:
            if g.value is None:
                value = "-"
            else:
                value = f"{g.value:.2g}"
            rows.append((g.parameter, value, words[g.acceptable], g.reason))
        return "\n".join(lines + columns(rows, right=["value"]))

    def plot(self) -> Figure:
        """Draw the travel test."""
        return self.test.plot()


def _grade_against(limit: _Limit, value: float | None, reason: str) -> _Grade:
    if value is None:
        acceptable = None
    else:
        acceptable = limit.low <= value <= limit.high
    return _Grade(limit.parameter, value, limit.ideal, limit.practical, acceptable, reason)


def _grade_gain(loop: Loop, test: TravelTest, rest: int, last: int) -> _Grade:
    if loop.plant.integrating:
        return _grade_against(GAIN_LIMIT, None, "an integrating process has no gain at rest")
    if test.same_direction is None and test.reversed is None:
        return _grade_against(GAIN_LIMIT, None, test.reason)
    # the last two levels of the big steps: the valve moved between them, or it moved from rest
    op = test.trace.op
    pv = test.trace.pv
    few = min(6, rest)
    moved = pv[last - few + 1 : last + 1].mean() - pv[rest - few : rest].mean()
    return _grade_against(
        GAIN_LIMIT, float(abs(moved / (op[last] - op[0]))), "PV over OP across the big steps"
    )


def _measure_hysteresis(loop: Loop) -> float:
    # A full traverse up, down and up
    up = np.arange(0.0, 100.0 + _TRAVERSE / 2, _TRAVERSE)
    n = up.size
    Ts = resolve_loop(loop, 0).Ts
    mv = valve_response(
        loop.valve.name, np.concatenate([up, up[::-1], up]), loop.valve.parameters, Ts
    )

    # The separation of both ways, less the dead band
    back = mv[n : 2 * n]
    again = mv[2 * n :]
    moving = np.abs(back - back[0]) > _REST
    if moving.any():
        dead = _TRAVERSE * float(np.argmax(moving))
    else:
        dead = 100.0
    return max(float((back[::-1] - again).max()) - dead, 0.0)
