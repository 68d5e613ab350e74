"""Judge a recorded MV: does it stand while OP moves, does it repeat OP, in which scale is it
written, and does it explain PV, as the position of a valve does?
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import product

import numpy as np
import scipy
from scipy.special import expit, logit

from simbench.detectors.signal.fits.regression import friction_nats
from simbench.detectors.signal.lattice import written_unit
from simbench.gap.decide.assess import Assessment
from simbench.gap.decide.recorded_mv import least_band, noise_of
from simbench.gap.likelihood import kernels
from simbench.gap.likelihood.engine import Engine
from simbench.gap.likelihood.kernels import SKIP
from simbench.gap.likelihood.model import Fit, size_penalty
from simbench.gap.likelihood.valve_map import MapSearch
from simbench.gap.situation import load_memory
from simbench.gap.thresholds import (
    LEAST_NATS,
    MV_FOLLOWED,
    MV_PER_NAT,
    MV_STANDS,
    MV_STANDS_FOR,
    MV_TRUE,
)

_LIMIT = 0.5  # % of travel from 0 and 100, within which a valve stands at its end
_CONSTANT = 0.05  # % of travel, that an MV without digits tells
_LATE = 3  # samples by which an echo may be late
_BANDS = np.geomspace(0.02, 1.5, 25)  # of OP's range, of the valves by which MV is scaled
_SHARES = (0.02, 0.3, 0.7, 1.0)  # J over S of these
_STARTS = (-0.5, 0.0, 0.5)  # of S, by which they stand off OP when the record begins
_NEARER = (-0.25, -0.1, 0.1, 0.25)
_KEPT = 4  # valves that are followed
_PART = 400  # samples in which valves are looked for first
# of MV's noise, and of its standard deviation, up to which what OP leaves of it is noise
_AS_OP = 1.5
_LITTLE = 0.2
_UNIT = 0.7, 1.4  # gains between which MV may be in % of travel behind a characteristic
_ONE = 0.03  # from a gain of 1 and, times OP's range, from an offset of 0: MV is in OP's scale
_NUMBERS = 5.0  # of a scaled valve: S, J, where it begins, gain and offset


@dataclass(frozen=True)
class Scale:
    """MV = offset + gain times the position in the unit of OP."""

    gain: float = 1.0
    offset: float = 0.0

    @property
    def is_unit(self) -> bool:
        """Whether this is plainly another unit or direction: less may be a valve's characteristic,
        which a loop file is asked for.
        """
        return not _UNIT[0] < self.gain < _UNIT[1]

    def undone(self, mv: np.ndarray) -> np.ndarray:
        """Return MV (n,) in the unit of OP."""
        return (mv - self.offset) / self.gain

    def sentence(self) -> str:
        """Return the scale in words; "" where MV is in that of OP."""
        if self == Scale():
            return ""
        way = ", in the other direction" if self.gain < 0 else ""
        return (
            f"MV is not written in the unit of OP{way}: it reads {self.gain:.3g} x OP"
            f" {self.offset:+.3g}; sizes are in the unit of OP"
        )


def standing(op: np.ndarray, mv: np.ndarray) -> slice | None:
    """Return the samples at the end of a record in which MV (n,) stands, by its noise, between the
    ends of travel while OP (n,) moves by many times as much; None where there are too few, or where
    MV moved before and OP then stays on one side of it, as behind a limit of travel.
    """
    least = int(MV_STANDS_FOR * mv.size)
    rest = float(np.median(mv[-max(least, 1) :]))

    # a constant has neither digits nor noise
    if np.ptp(mv) > 0.0:
        near = least_band(mv)
    else:
        near = _CONSTANT
    moved = np.flatnonzero(np.abs(mv - rest) > 2.0 * near)
    if moved.size:
        first = int(moved[-1]) + 1
    else:
        first = 0
    if mv.size - first < least or not _LIMIT < rest < 100.0 - _LIMIT:
        return None
    lo = float(op[first:].min())
    hi = float(op[first:].max())
    between = lo < rest < hi or not first
    if between and hi - lo > MV_STANDS * near:
        return slice(first, mv.size)
    return None


def repeats(op: np.ndarray, mv: np.ndarray) -> bool:
    """Return whether MV (n,) is OP (n,), a few samples late at most, to the digits of both."""
    digit = max(written_unit(op), written_unit(mv), 1e-6 * float(np.ptp(op)))
    return any(
        float(np.abs(mv[late:] - op[: op.size - late]).max()) <= 0.5001 * digit
        for late in range(_LATE + 1)
    )


def scale_of(search: MapSearch, fitted: tuple[float, float] | None) -> tuple[Scale, float]:
    """Return the scale of MV against OP, by least squares on the valve that explains it best, and
    its nats over a sound valve in the scale of OP. `fitted` are S and J that PV shows.

    Of a long record the peaks are narrow: they are looked for in a short part first.
    """
    op = search.op
    mv = search.mv
    if _says_op(op, mv) and abs(np.polyfit(op, mv, 1)[0] - 1.0) < _ONE:
        return Scale(), 0.0
    parts = [slice(k, k + _PART) for k in range(0, max(op.size - _PART, 0) + 1, _PART // 2)]
    part = max(parts, key=lambda here: float(np.abs(np.diff(mv[here])).sum()))
    grid = [(S, S * j, S * b) for S, j, b in product(_BANDS * float(np.ptp(op)), _SHARES, _STARTS)]
    near = _refine_lowest(op[part], mv[part], np.array(grid), 2 * _KEPT)
    valves = [(0.0, 0.0)] + list(() if fitted is None else (fitted,)) + list(near[:, :2])

    # where MV stands when the record begins is another number than in its part
    begun = np.array([(S, J, S * b) for S, J in valves for b in _STARTS + _NEARER])
    left, gain, offset = min(_scale_to_mv(op, mv, x) for x in _refine_lowest(op, mv, begun, _KEPT))
    level = 0.5 * op.size * np.log(left + search.fine)
    nats = search.healthy - level - size_penalty(op.size, _NUMBERS)
    middle = offset + (gain - 1.0) * float(op.mean())
    same = abs(gain - 1.0) < _ONE and abs(middle) < _ONE * float(np.ptp(op))
    if same or not gain:
        return (Scale(), 0.0)
    return (Scale(gain, offset), float(nats))


def _refine_lowest(op: np.ndarray, mv: np.ndarray, starts: np.ndarray, kept: int) -> np.ndarray:
    """Return the valves (kept, 3) that leave least of MV near the best of some (p, 3)."""
    levels = np.array([_scale_to_mv(op, mv, x)[0] for x in starts])
    followed = [
        scipy.optimize.minimize(lambda x: _scale_to_mv(op, mv, x)[0], start, method="Nelder-Mead")
        for start in starts[np.argsort(levels)[:kept]]
    ]
    return np.array([one.x for one in followed])


def _scale_to_mv(op: np.ndarray, mv: np.ndarray, valve: np.ndarray) -> tuple[float, float, float]:
    """Return the mean square that gain and offset of a valve (S, J, start) leave of MV, and both;
    MV may be logged between two samples.
    """
    S = abs(float(valve[0]))
    v = kernels.valve(op, kernels.STICK, S, float(np.clip(valve[1], 0.0, S)), float(valve[2]))
    X = np.column_stack([np.ones(v.size), v, np.append(v[0], v[:-1])])
    weights = np.linalg.lstsq(X, mv, rcond=None)[0]
    left = mv - X @ weights
    return float(np.mean(left * left)), float(weights[1] + weights[2]), float(weights[0])


def worth(
    views: Sequence[Assessment], sound: np.ndarray, sticky: np.ndarray, mv: np.ndarray
) -> tuple[float, float]:
    """Return the nats by which PV follows from MV (n,) rather than from OP through a sound valve,
    and through a sticking one, given the log-likelihoods of each sample with these; `views` are the
    assessments of the record without MV.
    """
    by_mv = max((_log_likelihood(view, mv) for view in views), key=np.sum)
    if _says_op(views[0].situation.op, mv):
        # noise and digits of MV are no reason to doubt it
        by_mv = max(by_mv, sound, key=np.sum)
    return friction_nats(by_mv, sound), friction_nats(by_mv, sticky)


def _says_op(op: np.ndarray, mv: np.ndarray) -> bool:
    """Return whether MV (n,) says no more than OP but for its noise."""
    left = mv - np.polyval(np.polyfit(op, mv, 1), op)
    return float(np.std(left)) <= max(_AS_OP * noise_of(mv), _LITTLE * float(np.std(mv)))


def _log_likelihood(view: Assessment, mv: np.ndarray) -> np.ndarray:
    """Return the log-likelihood of each sample of PV given MV, plant, load and noise fitted."""
    s = view.situation
    data = replace(s.data, u=np.ascontiguousarray(mv, dtype=float))
    return nats_of(Engine(data, load_memory(s)).base(), price_of(view))


def price_of(view: Assessment) -> float:
    """Return what the numbers of a view's plant cost (nats): a time constant is one more."""
    s = view.situation
    if s.integrating:
        return 0.0
    return size_penalty(s.data.n, 1.0)


def answers(view: Assessment, mv: np.ndarray) -> bool:
    """Return whether PV follows OP although MV (n,) stands: by what OP moved, the plant moves PV as
    far as a good part of its own range, and OP explains PV better than MV.
    """
    s = view.situation
    moved = abs(view.base.K) * float(np.std(s.data.u))
    of_pv = float(np.std(s.data.y))
    return not s.integrating and moved > MV_FOLLOWED * of_pv and may_answer(view, mv)


def may_answer(view: Assessment, mv: np.ndarray) -> bool:
    """Return whether OP explains PV better than an MV (n,) that stands, by the plant of a view."""
    gain = friction_nats(nats_of(view.base, 0.0), _log_likelihood(view, mv))
    return gain > LEAST_NATS


def chance_of_position(over_sound: float, over_sticky: float, friction: float) -> float:
    """Return the probability that MV is the valve's position, where PV follows from it by so many
    nats rather than from OP through a sound and a sticking valve, and OP and PV alone have these
    log-odds of `friction`.
    """
    before = float(logit(MV_TRUE))
    hidden = min(max(friction, 0.0), MV_PER_NAT * max(-over_sticky, 0.0))
    return float(expit(before - hidden - MV_PER_NAT * max(-over_sound, 0.0)))


# --- Compute the log-likelihood of what a model leaves of a record, under a load and a noise of
# any spectrum.

_LAGS = 24  # of the autoregression that gives load and noise the spectrum they have
_PER_LAG = 6  # samples for each of them, at least


def any_spectrum(left: np.ndarray) -> np.ndarray:
    """Return the log-likelihood of standardised innovations, but for a constant, once their past
    has explained what a model's load leaves in them.
    """
    count = min(_LAGS, left.size // _PER_LAG)
    past = np.lib.stride_tricks.sliding_window_view(left[:-1], count)
    now = left[count:]
    error = now - past @ np.linalg.lstsq(past, now, rcond=None)[0]
    power = float(np.mean(error * error)) or 1.0
    nats = -0.5 * (error * error / power + np.log(power))
    return np.concatenate([-0.5 * left[:count] ** 2, nats])


def nats_of(fit: Fit, price: float) -> np.ndarray:
    """Return the log-likelihood of each sample with a fit, under a load of any spectrum, less its
    share of the price of the numbers fitted.
    """
    left = np.asarray(fit.residual[SKIP:])
    return (fit.loglik + 0.5 * float(left @ left) - price) / left.size + any_spectrum(left)
