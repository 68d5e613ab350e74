"""Convert a PID of known settings to an equivalent PI: compute the error, with set-point weights,
derivative and gain schedule, for which a PI moves OP as the PID does.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from simbench.detectors.signal.filters import lfilter
from simbench.gap.controller.law import FORMS, about_zero, solve_by_majority
from simbench.loop.controller import PID, pid_numbers
from simbench.scenarios.plant import Controller

_OTHER_TI = 1e-3  # |ln ratio| of Ti from which another one explains more than the digits do
_LAST_BITS = 1e-9  # % of OP
_EXPLAINS = 0.5  # share of OP's moves, left by another Ti, from which it is not examined


@dataclass(frozen=True)
class Stated:
    """A controller as its loop file states it: `Kc` (% per PV unit, with sign), `Ti` (s, None
    without integral), `Ts` (s), and of a PID its `settings`, the PV at its operating point, and the
    share of the `newest` error in its integral.
    """

    Kc: float
    Ti: float | None
    Ts: float
    settings: Controller | None = None
    pv0: float = 0.0
    newest: float = FORMS[0]

    @property
    def Ki(self) -> float:
        """Gain of the integral (% per PV unit and sample)."""
        if self.Ti:
            return self.Kc * self.Ts / self.Ti
        return 0.0

    @property
    def per_pv(self) -> float:
        """How far OP (%) moves at once with PV (PV units)."""
        return abs(self.Kc) * (1.0 + (self._terms_per_gain.kd if self._terms_per_gain else 0.0))

    @cached_property
    def _terms_per_gain(self) -> PID | None:
        """A PID's numbers per unit of Kc."""
        if self.settings is None:
            return None
        endless = -np.inf, np.inf
        return pid_numbers(self.settings, 1.0, self.Ti or np.inf, self.Ts, self.pv0, *endless)

    def error(
        self,
        op: np.ndarray,
        pv: np.ndarray,
        sp: np.ndarray,
        slope_of: np.ndarray | None = None,
    ) -> np.ndarray:
        """Return the error (PV units) of which a PI of the same Kc and Ti moves OP as this
        controller does between its limits; its own, of a PI. The derivative is that of another PV
        where `slope_of` is given.
        """
        e = sp - pv
        p = self._terms_per_gain
        if p is None:
            return e
        gain = self._scheduled_gain(op, pv, sp)
        slope = self._derivative_term(gain, pv if slope_of is None else slope_of, sp)
        other = np.diff(gain * (e - (1.0 - p.b) * (sp - p.pv0)) + slope - e)
        other += p.Ki * (self._integral_steps(gain * e) - e[1:])
        forget = 1.0 / (1.0 + p.Ki)
        return e + lfilter([forget], [1.0, -forget], np.append(0.0, other))

    def _scheduled_gain(self, op: np.ndarray, pv: np.ndarray, sp: np.ndarray) -> np.ndarray:
        """Return a PID's scheduled gain (n,), over Kc."""
        p = self._terms_per_gain
        assert p is not None
        return np.interp((pv, np.append(op[0], op[:-1]), sp)[int(p.on)], p.at, p.factor)

    def _derivative_term(self, gain: np.ndarray, pv: np.ndarray, sp: np.ndarray) -> np.ndarray:
        """Return a PID's derivative term (n,), in PV units."""
        p = self._terms_per_gain
        assert p is not None
        rate = np.append(0.0, np.diff(sp - pv - (1.0 - p.c) * (sp - p.pv0)))
        return lfilter([1.0], [1.0, -p.fade], gain * p.kd * rate)

    def rests(
        self, op: np.ndarray, pv: np.ndarray, sp: np.ndarray, digits: tuple[float, float]
    ) -> np.ndarray:
        """Return in which changes (n - 1,) OP of a PID rests but for its derivative, up to what the
        digits of OP and PV hide.
        """
        p = self._terms_per_gain
        assert p is not None
        by_slope = self.Kc * np.diff(
            self._derivative_term(self._scheduled_gain(op, pv, sp), pv, sp)
        )
        # a change of the slope is made of three readings, the middle one twice
        hidden = digits[0] + 2.0 * abs(self.Kc) * p.kd * digits[1] + _LAST_BITS
        return np.abs(np.diff(op) - by_slope) <= hidden

    def unshaped(self, change: np.ndarray) -> np.ndarray | None:
        """Return the change of PV (n,) that takes `change` (n,) from the error of the PI; None
        where a schedule keeps it from being told.
        """
        p = self._terms_per_gain
        if p is None:
            return change
        if p.at.size > 1:
            return None
        pi = [1.0 + p.Ki, -1.0]
        fade = [1.0, -p.fade]
        second = np.array([1.0, -2.0, 1.0])
        same = [1.0 + p.Ki * self.newest, p.Ki * (1.0 - self.newest) - 1.0]
        return lfilter(np.polymul(pi, fade), np.polymul(same, fade) + p.kd * second, change)

    def _integral_steps(self, e: np.ndarray) -> np.ndarray:
        """Return what the integral adds up of an error (n - 1,)."""
        return self.newest * e[1:] + (1.0 - self.newest) * e[:-1]

    @property
    def forms(self) -> list[Stated]:
        """The controller under each form of its integral; a regression finds a PI's by itself."""
        if self.settings is None or not self.Ti:
            return [self]
        return [replace(self, newest=share) for share in FORMS]

    def retimed(self, op: np.ndarray, pv: np.ndarray, sp: np.ndarray) -> Stated | None:
        """Return a PID with the Ti that explains most changes of OP; None where the loop file's
        does, or none does.
        """
        # A law with a schedule, or without integral action, has none
        if self._terms_per_gain is None or self._terms_per_gain.at.size > 1 or not self.Ti:
            return None

        # Kc and Ki by the majority of OP's changes
        du = np.diff(op)
        moves = np.diff(replace(self, Ti=None).error(op, pv, sp))
        free = du != 0.0
        X = np.column_stack([moves, self._integral_steps(sp - pv)])[free]
        y = du[free]
        if y.size > 2:
            Kc, Ki = solve_by_majority(X, y)
        else:
            Kc = 0.0
            Ki = 0.0

        # They must explain nearly all, and be far from the stated Ti
        if Kc * Ki <= 0.0 or about_zero(y - X @ [Kc, Ki]) > _EXPLAINS * about_zero(y):
            return None
        Ti = float(self.Ts * Kc / Ki)
        if abs(np.log(Ti / self.Ti)) > _OTHER_TI:
            return replace(self, Ti=Ti)
        return None
