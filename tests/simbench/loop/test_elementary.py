"""Elementary functions: exact against `math`, scipy and polynomials; and nothing in a loop asks
numpy or BLAS for what these are for.
"""

import ast
import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.linalg import expm

import simbench.loop
from simbench.loop.elementary import (
    complex_expm1,
    dot,
    elementwise,
    matrix_exponential,
    quadratic_roots,
    times,
    without_last_bits,
)

# numpy picks these by the processor, or hands them to BLAS
CHOSEN_BY_PROCESSOR = {
    *("exp", "expm1", "log", "log10", "log1p", "log2", "power", "sin", "cos", "tan", "tanh"),
    *("arcsin", "arccos", "arctan", "arctan2", "angle", "hypot", "geomspace", "logspace"),
    *("dot", "matmul", "inner", "einsum", "linalg", "vdot", "tensordot"),
}


def test_elementwise_is_math_of_every_element():
    x = np.linspace(-3.0, 3.0, 12).reshape(3, 4)
    assert elementwise(math.sin, x).tolist() == [[math.sin(v) for v in row] for row in x.tolist()]
    assert elementwise(math.atan2, x, x + 1.0).shape == (3, 4)
    assert elementwise(math.exp, np.empty(0)).size == 0


def test_products_are_those_of_numpy():
    rng = np.random.default_rng(3)
    A, B, c = rng.normal(size=(4, 3)), rng.normal(size=(3, 5)), rng.normal(size=3)
    assert times(A, B) == pytest.approx(A @ B, rel=1e-14)
    assert times(A, c) == pytest.approx(A @ c, rel=1e-14)
    assert dot(c, B[:, 0]) == pytest.approx(float(c @ B[:, 0]), rel=1e-14)


def test_the_last_bits_go_and_the_scale_stays():
    x = np.array([0.0, -1.0, 1.0 / 3.0, 1e-9 * math.pi])
    kept = without_last_bits(x)
    assert kept == pytest.approx(x, rel=4e-9)
    assert kept.tolist() == without_last_bits(x * (1.0 + 1e-15)).tolist()
    assert (4.0 * kept).tolist() == without_last_bits(4.0 * x).tolist()
    assert kept[2] != x[2]


@pytest.mark.parametrize("order", [1, 2, 3, 5, 8])
def test_matrix_exponential_is_that_of_scipy(order):
    rng = np.random.default_rng(order)
    for size in (1e-6, 0.3, 5.0, 60.0):
        A = rng.normal(size=(order, order))
        A *= size / np.abs(A).sum(axis=0).max()
        assert matrix_exponential(A) == pytest.approx(expm(A), rel=1e-11, abs=1e-13)


def test_complex_expm1_keeps_small_numbers():
    z = complex(1e-12, 2e-12)
    assert complex_expm1(z) == pytest.approx(z + z * z / 2.0, rel=1e-15)


@given(*[st.floats(-100, 100).filter(lambda x: abs(x) > 1e-3)] * 3)
def test_quadratic_roots(a, b, c):
    one, other = quadratic_roots(a, b, c)
    assert one * other == pytest.approx(c / a, rel=1e-12)
    assert one + other == pytest.approx(-b / a, rel=1e-9, abs=1e-9 * abs(one))


@pytest.mark.parametrize(
    "file", sorted(Path(simbench.loop.__path__[0]).rglob("*.py")), ids=lambda file: file.stem
)
def test_a_loop_asks_numpy_for_nothing_that_differs_between_processors(file):
    tree = ast.parse(file.read_text(encoding="utf-8"))
    asked = {
        node.attr
        for node in ast.walk(tree)
        if isinstance(node, ast.Attribute)
        and isinstance(node.value, ast.Name)
        and node.value.id == "np"
    }
    products = [
        node.lineno
        for node in ast.walk(tree)
        if isinstance(node, ast.BinOp) and isinstance(node.op, ast.MatMult)
    ]
    assert not asked & CHOSEN_BY_PROCESSOR
    assert not products
