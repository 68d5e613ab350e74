"""Numerator and denominator of a plant, highest power of s first: which ones are simulated."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

_MOST_ORDER = 20


def checked_polynomials(num: Any, den: Any) -> tuple[np.ndarray, np.ndarray]:
    """Return both as arrays without leading zeros, or raise ValueError that says why they are no
    plant.
    """
    num, den = (_numbers(name, values) for name, values in (("num", num), ("den", den)))
    if num.size == 0 or num[-1] == 0.0:
        raise ValueError(
            "num has no constant term: the valve has no lasting effect on PV; a last number besides"
            " 0 is needed"
        )
    if den.size < 2 or den.size > _MOST_ORDER + 1:
        raise ValueError(
            f"den has {den.size} numbers; 2 to {_MOST_ORDER + 1} are needed, the first not 0"
        )
    if not math.isfinite(float(max(np.abs(num).max(), np.abs(den).max())) / abs(float(den[0]))):
        raise ValueError(
            f"den begins with {den[0]:g}, which is too small: num and den divided by it must be"
            " finite numbers"
        )
    if num.size >= den.size:
        raise ValueError(
            "it acts without any lag (not strictly proper); add the valve's or the sensor's time"
            " constant"
        )
    poles = np.roots(den)
    at_zero = np.abs(poles) < 1e-9 * max(1.0, float(np.abs(poles).max()))
    unstable = poles[~at_zero & (poles.real >= 0)]
    if unstable.size or at_zero.sum() > 1:
        worst = unstable[np.argmax(unstable.real)] if unstable.size else 0.0
        raise ValueError(
            f"unstable: pole at {worst:.4g}; only stable plants, or with one integrator, are"
            " simulated"
        )
    if at_zero.any() and den[-1] != 0.0:
        den[-1] = 0.0  # an integrator but for rounding
    return num, den


def _numbers(name: str, values: Any) -> np.ndarray:
    listed = values.tolist() if isinstance(values, np.ndarray) else values
    if (
        not isinstance(listed, Sequence)
        or isinstance(listed, str)
        or not all(type(v) in (int, float) for v in listed)
    ):
        raise ValueError(f"{name} = {listed!r}; a list of numbers in falling powers of s is needed")
    array = np.array(listed, dtype=float)
    if not np.isfinite(array).all():
        raise ValueError(f"{name} = {listed!r}; finite numbers are needed")
    return np.trim_zeros(array, "f")
