"""The pieces of a valve's motion against solvers that know nothing of them: matrix exponentials,
tableaux, Jacobians.
"""

import numpy as np
import pytest
from scipy.integrate import RK45
from scipy.linalg import expm

from simbench.loop.physical.motion import fall_time, free, slide, slide_in_substeps, stop_time
from simbench.loop.valves.lugre import slide_bristles
from simbench.loop.valves.stribeck import TOLERANCE_R, TOLERANCE_X, runge_kutta, slide_stribeck

W2 = 400.0  # natural frequency 20 rad/s
DAMPING = [0.0, 3.0, 19.99, 20.0, 20.01, 60.0]
STARTS = [(3.0, 0.0), (-2.0, 0.0), (-2.0, 30.0), (1.0, -50.0), (0.5, 2.0), (-0.01, 8.0)]


def exact(z, r, a, t):
    return expm(np.array([[0.0, 1.0], [-W2, -2.0 * a]]) * t) @ (z, r)


@pytest.mark.parametrize("a", DAMPING)
@pytest.mark.parametrize("start", STARTS)
def test_free_motion_is_the_matrix_exponential(start, a):
    for t in (0.001, 0.05, 0.4):
        assert free(*start, a, W2, t) == pytest.approx(exact(*start, a, t), rel=1e-7, abs=1e-9)


@pytest.mark.parametrize("a", DAMPING[1:])
@pytest.mark.parametrize("d", [1.0, -1.0])
@pytest.mark.parametrize("start", [(-2.0, 0.0), (-2.0, 30.0), (-0.5, 3.0)])
def test_the_rate_falls_to_a_level_where_it_is_found(start, d, a):
    z, r = d * start[0], d * start[1]
    T = min(stop_time(z, r, a, W2), 2.0)
    peak = max(d * exact(z, r, a, t)[1] for t in np.linspace(0, T, 100))
    for level in (0.5 * peak, 0.02 * peak):
        t = fall_time(z, r, d, level, a, W2, T)
        assert d * exact(z, r, a, t)[1] == pytest.approx(level, rel=1e-6)
        assert d * exact(z, r, a, t + 1e-3)[1] < level  # on its way down
    assert fall_time(z, r, d, 1.1 * peak, a, W2, T) == 0.0


@pytest.mark.parametrize("a", [3.0, 20.0, 60.0])
@pytest.mark.parametrize(
    ("u", "x", "r"),
    [
        (53.0, 50.0, 0.0),
        (47.0, 50.0, 0.0),
        (50.5, 50.0, 40.0),
        (99.0, 97.0, 80.0),
        (1.0, 3.0, -80.0),
    ],
)
def test_a_slide_is_the_limit_of_small_steps(u, x, r, a):
    for T in (0.03, 0.5):
        few, many = (
            slide_in_substeps(u, x, r, 1.5, 0.8, 0.0, a, W2, 1e-6, T, T / n)[0]
            for n in (3_000, 6_000)
        )
        assert slide(u, x, r, 1.5, 0.8, a, W2, 1e-6, T)[0] == pytest.approx(
            2 * many - few, abs=2e-4
        )


FRICTION = {"fs": 1.5, "fd": 0.8, "vs": 2.0, "a": 60.0, "w2": W2}


def law(u, d, fs, fd, vs, a, w2):
    return lambda t, y: np.array(
        [y[1], w2 * (u - y[0] - d * (fd + (fs - fd) * np.exp(-((y[1] / vs) ** 2)))) - 2 * a * y[1]]
    )


@pytest.mark.parametrize("d", [1.0, -1.0])
@pytest.mark.parametrize("h", [1e-4, 1e-3, 5e-3])
def test_a_runge_kutta_step_is_that_of_the_published_tableau(d, h):
    f, y = law(50.0 + 3.0 * d, d, **FRICTION), np.array([50.0, 1.3 * d])
    K = np.empty((7, 2))
    for s, (c, row) in enumerate(zip(RK45.C, RK45.A)):
        K[s] = f(c * h, y + h * (K[:s].T @ row[:s]))
    new = y + h * (K[:6].T @ RK45.B)
    K[6] = f(h, new)
    off = np.abs(h * (K.T @ RK45.E))
    x1, r1, error = runge_kutta(50.0 + 3.0 * d, *y, d, h, *FRICTION.values())
    assert (x1, r1) == pytest.approx(new, rel=1e-13)
    assert error == pytest.approx(
        max(off[0] / TOLERANCE_X, off[1] / (TOLERANCE_R * max(abs(r1), FRICTION["vs"]))), rel=1e-6
    )


@pytest.mark.parametrize("d", [1.0, -1.0])
@pytest.mark.parametrize(
    ("ahead", "r", "T"),
    [(3.0, 0.0, 0.3), (1.6, 0.0, 0.1), (2.5, 30.0, 0.02), (1.0, 15.0, 0.5), (0.2, 1.0, 0.5)],
)
def test_a_slide_with_stribeck_friction_is_the_limit_of_small_steps(d, ahead, r, T):
    x, rate, h = slide_stribeck(50.0 + d * ahead, 50.0, d * r, 1e-6, *FRICTION.values(), 1e-6, T)
    few, many = (
        slide_in_substeps(50.0 + d * ahead, 50.0, d * r, *FRICTION.values(), 1e-6, T, T / n)[0]
        for n in (3_000, 6_000)
    )
    assert x == pytest.approx(2 * many - few, abs=3e-4)
    assert h > 0.0
    assert d * rate >= 0.0


BRISTLES = {
    "fs": 1.5,
    "fd": 0.8,
    "vs": 2.0,
    "a": 60.0,
    "w2": W2,
    "g0": 4e6,
    "g1": 4e3,
    "soft": 1e-4,
}


def of_bristles(u, ramp, t, y):
    x, r, z = y
    p = BRISTLES
    g = p["soft"] * (p["fd"] + (p["fs"] - p["fd"]) * np.exp(-((r / p["vs"]) ** 2)))
    slip = r - abs(r) * z / g
    return np.array(
        [r, p["w2"] * (u + ramp * t - x) - p["g0"] * z - p["g1"] * slip - 2 * p["a"] * r, slip]
    )


def jacobian(u, y):
    out = np.empty((3, 3))
    for j, step in enumerate((1e-4, 1e-6, 1e-9)):
        e = np.eye(3)[j] * step
        out[:, j] = (of_bristles(u, 0.0, 0.0, y + e) - of_bristles(u, 0.0, 0.0, y - e)) / (2 * step)
    return out


STATES = [(50.0, 0.8, 5e-5), (50.0, -1.7, -9e-5), (50.1, 3.0, 2e-5), (49.0, -0.2, 6e-5)]


@pytest.mark.parametrize("ramp", [0.0, 40.0])
@pytest.mark.parametrize("y", STATES)
def test_a_step_of_the_bristles_is_that_of_the_published_method(y, ramp):
    """Shampine and Reichelt (1997), ode23s, with a Jacobian by differences."""
    h, u, y = 1e-7, 52.0, np.array(y)
    d, e32 = 1 / (2 + np.sqrt(2)), 6 + np.sqrt(2)
    W = np.eye(3) - h * d * jacobian(u, y)
    T = np.array([0.0, BRISTLES["w2"] * ramp, 0.0])
    F0 = of_bristles(u, ramp, 0.0, y)
    k1 = np.linalg.solve(W, F0 + h * d * T)
    F1 = of_bristles(u, ramp, h / 2, y + h / 2 * k1)
    k2 = np.linalg.solve(W, F1 - k1) + k1
    new = y + h * k2
    F2 = of_bristles(u, ramp, h, new)
    k3 = np.linalg.solve(W, F2 - e32 * (k2 - F1) - 2 * (k1 - F0) + h * d * T)
    error = np.abs(h / 6 * (k1 - 2 * k2 + k3))
    wrong = max(error[0], error[2] / (BRISTLES["fs"] * BRISTLES["soft"])) / 1e-7
    x, r, z, tried = slide_bristles(u, ramp, *y, h, *BRISTLES.values(), h)
    assert wrong < 1.0
    assert (x, r, z) == pytest.approx(new, rel=1e-9)
    assert tried / h == pytest.approx(min(5.0, 0.8 * max(wrong, 1e-6) ** (-1 / 3)), rel=0.02)


def test_bristles_at_rest_under_what_they_carry_stay():
    # z holds (u - x) exactly: w2 (u - x) = g0 z
    z = W2 * 1.0 / BRISTLES["g0"]
    assert slide_bristles(51.0, 0.0, 50.0, 0.0, z, 1e-6, *BRISTLES.values(), 5.0)[:3] == (
        50.0,
        0.0,
        z,
    )
    pushed = slide_bristles(52.0, 0.0, 50.0, 0.0, z, 1e-6, *BRISTLES.values(), 0.5)
    assert pushed[0] > 50.3
