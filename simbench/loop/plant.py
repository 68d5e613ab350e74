"""Plants: control.TransferFunction in, exact zero-order-hold sampling with whole and fractional
dead time out.
"""

from __future__ import annotations

import math
from collections import namedtuple
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np

from simbench.detectors.errors import ParameterError
from simbench.loop.elementary import complex_expm1, dot, matrix_exponential, quadratic_roots, times
from simbench.scenarios.plant import Plant
from simbench.scenarios.polynomials import checked_polynomials

# Plants of first and second order, by far the most common, keep their state in registers; all
# others in an array.
FirstOrder = namedtuple("FirstOrder", "a b_old b_new pv0")
SecondOrder = namedtuple("SecondOrder", "keep pull b_old b_new ahead_old ahead_new pv0")
General = namedtuple("General", "A B_old B_new C pv0")


@dataclass(frozen=True)
class SampledPlant:
    """x(k+1) = A x(k) + B_old w(k-delay-1) + B_new w(k-delay), PV(k) = C x(k), with w held over
    each sample.

    Two taps make a fractional dead time exact: the older input acts during the first part of the
    sample.
    """

    A: np.ndarray
    B_old: np.ndarray
    B_new: np.ndarray
    C: np.ndarray
    delay: int

    @property
    def order(self) -> int:
        """Number of states."""
        return len(self.A)


def polynomials(plant) -> tuple[np.ndarray, np.ndarray]:
    """Return numerator and denominator (highest power first) of a loop file's plant without its
    dead time.
    """
    if plant.den is not None and len(plant.den) > 2:
        return np.array(plant.num), np.array(plant.den)
    if plant.integrating:
        den = [1.0, 0.0]
    else:
        den = [float(plant.T), 1.0]
    return np.array([float(plant.K)]), np.array(den)


def table_of(system) -> dict:
    """Return the [plant] table of a python-control system, as it was written: no coefficient is
    scaled.
    """
    import control

    tf: Any = control.tf(system)

    # True: discrete, of no stated period
    if tf.dt is True or not tf.dt:
        stated = {}
    else:
        stated = {"dt": float(tf.dt)}
    if not stated:
        polynomials_of(tf)
    num, den = ([float(x) for x in side[0][0]] for side in (tf.num, tf.den))
    while len(num) > 1 and abs(num[0]) < 1e-14 * max(map(abs, num)):
        num = num[1:]  # what the way from a state space leaves of a zero
    return {"type": "tf", "num": num, "den": den, **stated}


def polynomials_of(tf) -> tuple[np.ndarray, np.ndarray]:
    """Accept a user's transfer function, or say why not."""
    # One input, one output, continuous in time
    if tf.ninputs != 1 or tf.noutputs != 1:
        raise ParameterError(
            f"plant has {tf.ninputs} inputs and {tf.noutputs} outputs; one of each is needed"
        )
    if tf.dt not in (0, None):
        raise ParameterError(
            f"plant is discrete (dt = {tf.dt}); a continuous transfer function is needed"
        )

    # Polynomials that can be simulated, den beginning with 1
    try:
        num, den = checked_polynomials(tf.num[0][0].astype(float), tf.den[0][0].astype(float))
    except ValueError as error:
        raise ParameterError(f"plant: {error}") from None
    return num / den[0], den / den[0]


def first_order_like(plant: Plant) -> Plant:
    """Return the first-order or integrating plant with a plant's gain, mean delay and, where there
    is one, spread in time.
    """
    # A plant in z, or one that is of first order already
    if plant.dt is not None:
        return _like_of_samples(plant)
    if plant.den is None or len(plant.den) == 2:
        return plant

    # Mean and variance of its lags, by the polynomials
    den = np.array(plant.den[: -1 if plant.integrating else None])
    (n1, n2) = np.append([0.0, 0.0], plant.num)[-2:-4:-1] / plant.num[-1]
    (d1, d2) = np.append([0.0, 0.0], den)[-2:-4:-1] / den[-1]
    delay = d1 - n1
    spread = d1**2 - 2.0 * d2 - (n1**2 - 2.0 * n2)

    # One lag of the same variance; the rest is dead time
    if plant.integrating:
        T = 0.0
        table = {"type": "integrating"}
    else:
        T = float(np.sqrt(max(spread, (0.1 * d1) ** 2)))
        table = {"type": "foptd", "T": T}
    return Plant.model_validate({**table, "K": plant.K, "Td": max(plant.Td + delay - T, 0.0)})


def _like_of_samples(plant: Plant) -> Plant:
    """Return `first_order_like` of a plant in powers of z: mean and variance of its impulse
    response, less those of the hold.
    """
    num = np.array(plant.num)
    den = np.array(plant.den)
    if plant.integrating:
        den = np.cumsum(den)[:-1]  # without the pole at z = 1

    # of lags in samples: num holds lag 1 and later, den lag 0 and later
    (delay, spread) = _lag_moments(num, 1)
    (after, less) = _lag_moments(den, 0)
    late = delay - after
    dt = float(plant.dt or 1.0)
    if plant.integrating:
        # the input of a sample shows whole in the next one
        Td = max(plant.Td + (late - 1.0) * dt, 0.0)
        return Plant.model_validate({"type": "integrating", "K": plant.K, "Td": Td})
    T = dt * float(np.sqrt(max(spread - less, (0.1 * max(late, 0.1)) ** 2)))
    Td = max(plant.Td + (late - 0.5) * dt - T, 0.0)
    return Plant.model_validate({"type": "foptd", "K": plant.K, "T": T, "Td": Td})


def _lag_moments(side: np.ndarray, first: int) -> tuple[float, float]:
    """Return mean and variance of the lags of a polynomial's numbers, the first one's given."""
    lags = first + np.arange(side.size)
    whole = float(side.sum()) or 1e-300
    mean = float((lags * side).sum()) / whole
    return mean, float((lags**2 * side).sum()) / whole - mean**2


def beyond_first_order(plant: Plant, Ts: float) -> tuple[np.ndarray, np.ndarray] | None:
    """Return numerator and denominator in z of what a sampled plant is behind `first_order_like`;
    None where that is all.
    """
    like = first_order_like(plant)
    if like is plant:
        return None
    whole = sample(*polynomials(plant), 0.0, Ts)
    alone = sample(*polynomials(like), 0.0, Ts)
    a = np.poly(whole.A)
    b = np.poly(whole.A - np.outer(whole.B_new, whole.C)) - a
    pole = alone.A[0, 0]
    push = dot(alone.C, alone.B_new)
    return np.polymul(b[1:], [1.0, -pole]) / push, a


def stretched(plant: Plant, K: float, T: float, Td: float) -> Plant:
    """Return a "tf" plant with its gain times `K`, its time constants times `T`, and
    dead time `Td` (s).
    """
    assert plant.num is not None
    assert plant.den is not None
    num, den = (
        [c * T**i for i, c in enumerate(reversed(side))][::-1] for side in (plant.num, plant.den)
    )
    per = T if plant.integrating else 1.0  # K of an integrating plant stands per second
    return plant.replace(num=[K * per * c for c in num], den=den, Td=Td)


def sample(num: np.ndarray, den: np.ndarray, Td: float, Ts: float) -> SampledPlant:
    """Sample a plant exactly for an input that is constant over each sampling period.

    Astrom and Wittenmark (1997), Computer-Controlled Systems, section 2.3: sampling a system with a
    fractional delay.
    """
    if not (np.isfinite(Td) and Td >= 0):
        raise ParameterError(f"plant: Td = {Td} s; a number >= 0 is needed")
    if not (np.isfinite(Ts) and Ts > 0):
        raise ParameterError(f"sampling: Ts = {Ts} s; a number above 0 is needed")
    return _sample_polynomials(tuple(num.tolist()), tuple(den.tolist()), float(Td), float(Ts))


@lru_cache(maxsize=64)  # a loop is run with several seeds, and with and without its loads
def _sample_polynomials(
    num: tuple[float, ...], den: tuple[float, ...], Td: float, Ts: float
) -> SampledPlant:
    # The state space, and where in a sample the dead time ends
    A, B, C = _state_space(np.array(num), np.array(den))
    delay, old = _split_dead_time(Td, Ts)

    # One state by its exponential
    if len(A) == 1:
        a = float(A[0, 0])
        b = float(B[0])
        B_old = math.exp(a * (Ts - old)) * _step_answer(a, b, old)
        B_new = _step_answer(a, b, Ts - old)
        whole = np.array([[math.exp(a * Ts)]])
        return SampledPlant(whole, np.array([B_old]), np.array([B_new]), C, delay)

    # Several by the matrix exponential
    whole, _ = _hold_input(A, B, Ts)
    late, B_new = _hold_input(A, B, Ts - old)
    _, early = _hold_input(A, B, old)
    return SampledPlant(whole, times(late, early), B_new, C, delay)


def _split_dead_time(Td: float, Ts: float) -> tuple[int, float]:
    """Whole samples of dead time, and the length of the older input's part of a sample (s)."""
    delay = math.floor(Td / Ts + 1e-9)
    old = max(Td - delay * Ts, 0.0)
    return delay, 0.0 if old < 1e-9 * Ts else old


def whole_delay(Td: float, Ts: float) -> int:
    """Return the whole samples of a dead time."""
    return _split_dead_time(Td, Ts)[0]


def _step_answer(a: float, b: float, h: float) -> float:
    """State of x' = a x + b w after an input of 1 held for h s."""
    return b * (math.expm1(a * h) / a if a else h)


def _state_space(num: np.ndarray, den: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    # Controllable canonical form; a first-order plant is scaled so that its state is PV itself.
    den, num = den / den[0], np.concatenate([np.zeros(den.size - 1 - num.size), num / den[0]])
    order = den.size - 1
    if order == 1:
        return np.array([[-den[1]]]), num.copy(), np.array([1.0])
    A = np.eye(order, k=-1)
    A[0] = -den[1:]
    return A, np.eye(order)[0], num


def _hold_input(A: np.ndarray, B: np.ndarray, h: float) -> tuple[np.ndarray, np.ndarray]:
    order = len(A)
    joint = np.zeros((order + 1, order + 1))
    joint[:order, :order] = A
    joint[:order, order] = B
    out = matrix_exponential(joint * h)
    return out[:order, :order], out[:order, order]


def second_order(g: SampledPlant, den: np.ndarray, Ts: float, pv0: float) -> SecondOrder:
    """Return the numbers of `second_order_step`: with D = A - 1, PV moves by C D x, and that by
    tr(D) and det(D).

    Middleton and Goodwin (1990), Digital Control and Estimation: the delta operator, whose numbers
    do not crowd at 1 where Ts is short beside the time constants.
    """
    one, other = (complex_expm1(root * Ts) for root in quadratic_roots(*map(float, den)))
    row = times((g.A - np.eye(2)).T, g.C)
    numbers = (
        1.0 + (one + other).real,
        (one * other).real,
        dot(g.C, g.B_old),
        dot(g.C, g.B_new),
        dot(row, g.B_old),
        dot(row, g.B_new),
    )
    return SecondOrder(*numbers, pv0)


def first_order_step(w_old, w_new, x, p):
    """One sample of a first-order plant; its state (deviation of PV, ) is a tuple."""
    # inputs first: only one product and one sum then wait for the previous sample
    return (p.a * x[0] + (p.b_old * w_old + p.b_new * w_new),)


def first_order_output(x, p):
    """PV of a plant whose first state it is, before load and noise."""
    return p.pv0 + x[0]


def second_order_step(w_old, w_new, x, p):
    """One sample of a second-order plant; its state is (deviation of PV, its change without input),
    tuples both.
    """
    ahead = (p.ahead_old * w_old + p.ahead_new * w_new) - p.pull * x[0]
    return (p.b_old * w_old + p.b_new * w_new) + (x[0] + x[1]), ahead + p.keep * x[1]


def general_step(w_old, w_new, x, p):
    """One sample of a plant of any order; its state array is changed in place."""
    order = x.shape[0] // 2
    for i in range(order):
        x[order + i] = p.B_old[i] * w_old + p.B_new[i] * w_new
        for j in range(order):
            x[order + i] += p.A[i, j] * x[j]
    for i in range(order):
        x[i] = x[order + i]
    return x


def general_output(x, p):
    """PV of a plant of any order before load and noise."""
    y = p.pv0
    for i in range(x.shape[0] // 2):
        y += p.C[i] * x[i]
    return y
