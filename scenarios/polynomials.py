"""Numerator and denominator of a plant or controller, highest power of s or z first: which ones are
simulated.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

_MOST_ORDER = 20
# of a pole at z = 1, of which the coefficients are rounded; and of den at z = 1 beside its numbers
_AT_ONE = 1e-6
_NIL = 1e-12


def checked_polynomials(num: Any, den: Any) -> tuple[np.ndarray, np.ndarray]:
    """Return both as arrays without leading zeros, or raise ValueError that says why they are no
    plant.
    """
    # Both as arrays; the valve acts on PV in the end
    num = _check_numbers("num", num, "s")
    den = _check_numbers("den", den, "s")
    if num.size == 0 or num[-1] == 0.0:
        raise ValueError(
            "num has no constant term: the valve has no lasting effect on PV; a last number besides"
            " 0 is needed"
        )

    # An order that can be simulated, a leading number that can be divided by
    _refuse_order(den)
    if not math.isfinite(float(max(np.abs(num).max(), np.abs(den).max())) / abs(float(den[0]))):
        raise ValueError(
            f"den begins with {den[0]:g}, which is too small: num and den divided by it must be"
            " finite numbers"
        )

    # PV never answers at once
    if num.size >= den.size:
        raise ValueError(
            "it acts without any lag (not strictly proper); add the valve's or the sensor's time"
            " constant"
        )

    # Stable poles, at most one integrator
    poles = np.roots(den)
    at_zero = np.abs(poles) < 1e-9 * max(1.0, float(np.abs(poles).max()))
    unstable = poles[~at_zero & (poles.real >= 0)]
    if unstable.size or at_zero.sum() > 1:
        if unstable.size:
            worst = unstable[np.argmax(unstable.real)]
        else:
            worst = 0.0
        raise ValueError(
            f"unstable: pole at {worst:.4g}; only stable plants, or with one integrator, are"
            " simulated"
        )
    if at_zero.any() and den[-1] != 0.0:
        den[-1] = 0.0  # an integrator but for rounding
    return num, den


def checked_sampled(num: Any, den: Any, lags: int) -> tuple[np.ndarray, np.ndarray]:
    """Return both in powers of z as arrays, den beginning with 1 and num as long as den less `lags`
    (1 of a plant, 0 of a controller), or raise ValueError that says why they are none.
    """
    # Both as arrays; the answer comes as late as it must
    num = _check_numbers("num", num, "z")
    den = _check_numbers("den", den, "z")
    _refuse_order(den)
    if num.size == 0:
        raise ValueError("num holds only 0; a number besides 0 is needed")
    if num.size > den.size - lags:
        raise ValueError(
            f"num has {num.size} numbers, den {den.size}; at most {den.size - lags} are needed:"
            f" {'PV answers after a sample' if lags else 'no OP answers to an error to come'}"
        )

    # No pole outside the unit circle
    poles = np.roots(den)
    worst = poles[np.argmax(np.abs(poles))]
    if abs(worst) > 1.0 + _AT_ONE:
        raise ValueError(
            f"unstable: pole at z = {worst:.4g}; poles inside the unit circle, or one at z = 1, are"
            " needed"
        )
    return np.append(np.zeros(den.size - lags - num.size), num / den[0]), den / den[0]


def integrates(den: Sequence[float]) -> bool:
    """Return whether a denominator in powers of z has a root at z = 1.

    >>> integrates([1.0, -1.5, 0.5]), integrates([1.0, -0.999])
    (True, False)
    """
    return abs(sum(den)) < _NIL * sum(map(abs, den))


def _refuse_order(den: np.ndarray) -> None:
    if den.size < 2 or den.size > _MOST_ORDER + 1:
        raise ValueError(
            f"den has {den.size} numbers; 2 to {_MOST_ORDER + 1} are needed, the first not 0"
        )


def _check_numbers(name: str, values: Any, power: str) -> np.ndarray:
    # A plain list of numbers
    if isinstance(values, np.ndarray):
        listed = values.tolist()
    else:
        listed = values
    if (
        not isinstance(listed, Sequence)
        or isinstance(listed, str)
        or not all(type(v) in (int, float) for v in listed)
    ):
        raise ValueError(
            f"{name} = {listed!r}; a list of numbers in falling powers of {power} is needed"
        )

    # Finite, without leading zeros
    array = np.array(listed, dtype=float)
    if not np.isfinite(array).all():
        raise ValueError(f"{name} = {listed!r}; finite numbers are needed")
    return np.trim_zeros(array, "f")
