"""The tests that can be made on a loop, sized for it and kept within limits, each simulated as a
person would carry it out.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Annotated, Any

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, field_validator

from simbench.detectors.errors import Refusal, UserError
from simbench.detectors.record import LoopRecord
from simbench.gap.closed_loop.level import RUNAWAY, RUNS
from simbench.gap.controller.pi_law import CARD
from simbench.gap.intake.recorded_test import FEWEST
from simbench.gap.situation import Situation
from simbench.loop.resolve import resolve_loop
from simbench.loop.run import run_setup
from simbench.scenarios.parts import Sampling, SetPoint
from simbench.scenarios.spec import Loop
from simbench.scenarios.toml_table import Real

LEAD = 120  # samples in automatic before an operator takes over
_MOST = 1500  # samples of a test; longer ones tell little more, only later
_SMALLER = 6  # times a test that would leave its limits is made smaller
_AS_OPERATED = ("raw", "mv", "lab")  # tests under which PV does what it does anyway
_TINY = 1e-9  # gain of a controller that follows the operator alone
# standard deviations between draws of load and noise, by which an excursion is taken to be larger
# than their mean: 20 fresh draws of each of four tests stay within
_SPREADS = 4.0
# of a limit on PV that the simulated excursion may use: the plant is not quite the model
_MARGIN = 0.8
_SENTENCES = {
    "raw": (
        "log the loop for {minutes:.0f} min without the archive: the recorded PV is not the PV that"
        " the controller saw"
    ),
    "mv": (
        "record the valve position MV with SP, OP and PV for {minutes:.0f} min, in normal operation"
    ),
    "sp_steps": "step SP by {size:.3g} PV units: up, down, back, down, up, {hold:.0f} s each",
    "kc_half": "halve Kc and record for {minutes:.0f} min",
    "bump": "in manual, move OP by {size:.3g} %: base, up, down, base, {hold:.0f} s each",
    "stairs": "in manual, move OP in small stairs of {size:.3g} %: up, down, up, {hold:.0f} s each",
    "still": "in manual, leave OP where it is for {minutes:.0f} min",
    "lab": (
        "take 40 grab samples of the true process value within {minutes:.0f} min, in a column lab"
    ),
}
# of a test that moves OP or SP: how long a level is held, in T + Td, and in samples at least (a
# settled step takes about 4 T, one of SP waits for the controller as well); its levels on a
# self-regulating plant, and on an integrating one, where a level that is held would let PV run away
_MOVES = {
    "sp_steps": (12.0, 20, (1, -1, 0, -1, 1), (1, -1, 0, -1, 1)),
    "bump": (6.0, 15, (0, 1, -1, 0), (0, 1, 0, 0, -1, 0, 0)),
    "stairs": (
        4.0,
        10,
        (1, 2, 3, 4, 3, 2, 1, 0, -1, -2, -1, 0),
        tuple(step * way for step in (1, 2, 3, 4) for way in (1, 0, -1, 0)),
    ),
}


class Limits(BaseModel):
    """What a test may do to the plant: ranges of PV and OP, how far PV and OP may move, how
    long it lasts.
    """

    model_config = ConfigDict(extra="forbid", frozen=True)
    pv: tuple[Real, Real] = (-np.inf, np.inf)
    op: tuple[Real, Real] = (0.0, 100.0)
    pv_excursion: Annotated[Real, Field(gt=0)] = np.inf
    op_travel: Annotated[Real, Field(gt=0)] = np.inf
    minutes: Annotated[Real, Field(gt=0)] = np.inf

    @field_validator("pv", "op", mode="before")
    @classmethod
    def _range(cls, given: Any) -> Any:
        match given:
            case [int() | float() as lo, int() | float() as hi] if lo < hi:
                return given
        raise ValueError(f"{given!r} is no range; [lo, hi] with lo below hi is needed")


@dataclass(frozen=True, eq=False)
class Trial:
    """A test on one loop: its size, the deviations (n,) of SP, or of OP in manual, and how far PV
    (PV units) and OP move on the loops of the explanations.
    """

    id: str
    size: float
    hold_s: float
    Ts: float
    moves: np.ndarray
    manual: bool
    pv_excursion: float = 0.0
    op_travel: float = 0.0

    @property
    def n(self) -> int:
        """Number of samples."""
        return self.moves.size

    @property
    def minutes(self) -> float:
        """How long it lasts."""
        return self.n * self.Ts / 60.0

    @property
    def settings(self) -> dict[str, Any]:
        """What the tables that go with its record would hold."""
        test: dict[str, Any] = {"id": self.id}
        if self.size:
            test |= {"size": self.size, "hold_s": self.hold_s}
        out: dict[str, Any] = {"test": test}
        if self.id == "kc_half":
            out["controller"] = {"Kc_ratio": 0.5}
        return out

    def as_json(self) -> dict[str, Any]:
        """Return the test in JSON types.

        The order is fixed: no test is said to bring information or a probability.
        """
        return {
            "id": self.id,
            "settings": self.settings,
            "information": None,
            "p_right": None,
            "minutes": self.minutes,
            "pv_excursion": self.pv_excursion,
        }

    @property
    def says(self) -> str:
        """The test in a sentence."""
        return _SENTENCES[self.id].format(size=self.size, hold=self.hold_s, minutes=self.minutes)

    def run(self, loop: Loop, seed: int) -> LoopRecord | None:
        """Simulate the test on a loop file; None where the loop cannot be simulated."""
        control = loop.controller
        if self.id == "kc_half":
            control = control.replace(Kc=0.5 * control.Kc)
        try:
            tried = loop.replace(
                controller=control,
                sampling=Sampling(Ts=self.Ts, n=self.n),
                setpoint=SetPoint(value=loop.setpoint.value),
            )
            setup = resolve_loop(tried, seed)
            if self.manual:
                # a controller of no gain hands an enormous set point on: OP is the operator's
                setup.Kc = _TINY
                setup.Ti = None
                setup.sp = setup.pv0 + self.moves / (_TINY * setup.sign)
            else:
                setup.sp = setup.sp + self.moves
            record = run_setup(setup).record
        except UserError:
            return None
        return record if float(np.abs(record.pv).max()) < RUNAWAY else None


def size_test(
    id_: str, s: Situation, loops: Mapping[str, Loop], band: float, limits: Limits
) -> Trial | Refusal:
    """Return a test within limits on the loops of the explanations, or why there is none.

    `band`: width (%) of the friction that may be there, 0 without; stairs must be finer, so that it
    can stick.
    """
    d = s.data
    rest = float(np.mean(s.op))
    pace = d.Td + (1.0 / max(abs(d.K * s.baseline.controller.Kc), 1e-9) if s.integrating else d.T)
    size = float(np.clip(0.5 * np.ptp(s.op), 1.0, 10.0))
    if id_ == "stairs":
        size = 0.4 * band if band > 0.0 else 0.25 * size
    if id_ in ("bump", "stairs"):
        room = min(rest - limits.op[0], limits.op[1] - rest, limits.op_travel)
        most = room / max(_MOVES[id_][2])
        if most <= CARD:
            return Refusal(f"{id_}: OP has no room within its limits")
        size = min(size, most)
    if id_ == "sp_steps":
        size *= abs(d.K) * (pace if s.integrating else 1.0)
    moves = id_ in _MOVES
    excursion = 0.0
    travel = 0.0
    for _ in range(_SMALLER if moves else 1):
        trial = _trial(id_, size, pace, s)
        if trial.minutes > limits.minutes:
            n = int(60.0 * limits.minutes / trial.Ts)
            if moves or n < FEWEST:
                lasts = f"{id_}: {trial.minutes:.0f} min"
                return Refusal(f"{lasts}, more than the {limits.minutes:.0f} allowed")
            trial = replace(trial, moves=trial.moves[:n])
        excursion, travel, inside = _excursion(trial, s, loops, limits)
        if inside:
            return replace(trial, pv_excursion=excursion, op_travel=travel)
        size *= 0.6
    return Refusal(f"{id_}: PV or OP would leave its limits (PV by {excursion:.3g})")


def _trial(id_: str, size: float, pace: float, s: Situation) -> Trial:
    Ts = s.record.Ts
    n = min(s.record.n, _MOST)
    if id_ in _MOVES:
        paces, least, *levels = _MOVES[id_]
        moves = size * np.array(levels[s.integrating], dtype=float)
        hold = int(np.clip(paces * pace, least, _MOST // moves.size))
        if s.integrating and id_ != "sp_steps":
            hold = max(int(pace), 5)
        moves = np.append(np.zeros(LEAD), np.repeat(moves, hold))
        return Trial(id_, size, hold * Ts, Ts, moves, id_ != "sp_steps")
    return Trial(id_, 0.0, 0.0, Ts, np.zeros(n), id_ == "still")


def _excursion(
    trial: Trial, s: Situation, loops: Mapping[str, Loop], limits: Limits
) -> tuple[float, float, bool]:
    """Return how far PV goes from SP's start, and OP from its mean on record, under any
    explanation, and whether both stay within limits.
    """
    rest = float(np.mean(s.op))
    if trial.id in _AS_OPERATED:
        moved = np.abs(s.record.pv - s.sp).max(), np.abs(s.op - rest).max()
        return float(moved[0]), float(moved[1]), True
    own = float(np.abs(trial.moves).max()) if trial.manual else 0.0
    worst = 0.0
    travel = own
    inside = True
    for loop in loops.values():
        start = loop.setpoint.value
        runs = [trial.run(loop, seed) for seed in range(RUNS if limits != Limits() else 1)]
        ends = [
            (r.pv.min() - start, r.pv.max() - start, r.op.min(), r.op.max())
            for r in runs
            if r is not None
        ]
        if not ends:
            continue
        # in manual nothing holds PV against its load, and the next one will be another
        far = _SPREADS * np.std(ends, axis=0)
        low, high, op_low, op_high = np.mean(ends, axis=0) + far * np.array([-1.0, 1.0, -1.0, 1.0])
        worst = max(worst, float(-low), float(high))
        if not trial.manual:
            travel = max(travel, float(op_high) - rest, rest - float(op_low))
        pv_low, pv_high = _MARGIN * (np.array(limits.pv) - start)
        inside &= bool(
            pv_low <= low
            and high <= pv_high
            and limits.op[0] - 1e-6 <= op_low
            and op_high <= limits.op[1] + 1e-6
            and op_high - op_low <= 2.0 * limits.op_travel
            and worst <= _MARGIN * limits.pv_excursion
        )
    return worst, travel, inside
