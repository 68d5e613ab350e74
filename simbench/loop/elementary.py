"""Elementary functions that give the same last bits on every x86 processor of the last decade.

numpy chooses its vectorised exp, sin, cos, log and power by the processor, and BLAS its products;
both differ in the last place from one to the next, and a loop whose valve sticks makes another
record of that. Python's `math` calls the C library, which makes one choice alone: with or without
fused multiply-add (FMA), which x86 processors have since 2013. Sums and products here are taken one
after the other. `numpy.sqrt`, `+`, `-`, `*` and `/` are exact to the last bit anywhere (IEEE 754).
Another C library may round otherwise.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np

_TERMS = 18  # of the Taylor series of a matrix exponential: below 1e-22 for a norm of 1/2


def elementwise(function: Callable[..., float], *arrays: np.ndarray) -> np.ndarray:
    """Return a function of `math` of every element of an array, or of several of one shape."""
    flat = [np.asarray(x, dtype=float).ravel().tolist() for x in arrays]
    shape = np.shape(arrays[0])
    return np.fromiter(map(function, *flat), float, len(flat[0])).reshape(shape)


def without_last_bits(x: np.ndarray, bits: int = 28) -> np.ndarray:
    """Return numbers rounded to so many binary digits: with 28, to 4e-9 of themselves.

    Where a number comes from BLAS or from an iteration, its last bits are the processor's. Rounded,
    it is the same on nearly every processor, and what is chaotic may begin with it.
    """
    part, exponent = np.frexp(x)
    return np.ldexp(np.round(part * 2.0**bits), exponent - bits)


def dot(one: Any, other: Any) -> float:
    """Return the scalar product of two short vectors, summed from the first element on."""
    total = 0.0
    for x, y in zip(one, other, strict=True):
        total += float(x) * float(y)
    return total


def times(matrix: np.ndarray, other: np.ndarray) -> np.ndarray:
    """Return the product of a matrix and a matrix or a vector, summed from the first column on."""
    total = np.zeros((len(matrix),) + other.shape[1:])
    for k in range(matrix.shape[1]):
        total += np.multiply.outer(matrix[:, k], other[k])
    return total


def matrix_exponential(A: np.ndarray) -> np.ndarray:
    """Return e^A of a small square matrix by scaling, Taylor series and squaring.

    Moler and Van Loan (2003), Nineteen dubious ways to compute the exponential of a matrix, SIAM
    Review 45, method 3.
    """
    norm = float(np.abs(A).sum(axis=0).max())
    halvings = max(math.frexp(norm)[1] + 1, 0)
    part = A * 0.5**halvings
    out = term = np.eye(len(A))
    for i in range(1, _TERMS + 1):
        term = times(term, part) / i
        out = out + term
    for _ in range(halvings):
        out = times(out, out)
    return out


def complex_expm1(z: complex) -> complex:
    """Return e^z - 1, exact also where z is small."""
    real = math.expm1(z.real) * math.cos(z.imag) - 2.0 * math.sin(0.5 * z.imag) ** 2
    return complex(real, math.exp(z.real) * math.sin(z.imag))


def quadratic_roots(a: float, b: float, c: float) -> tuple[complex, complex]:
    """Return the roots of a x^2 + b x + c without the loss of digits where they lie far apart."""
    inside = b * b - 4.0 * a * c
    if inside < 0.0:
        root = complex(-0.5 * b / a, 0.5 * math.sqrt(-inside) / abs(a))
        return root, root.conjugate()
    q = -0.5 * (b + math.copysign(math.sqrt(inside), b))
    return complex(q / a), complex(c / q if q else 0.0)
