"""PV regressed on its past and on a valve: equal to plain least squares, and friction is found
where a valve sticks and nowhere else.
"""

import numpy as np
import pytest

from simbench.detectors.signal.filters import lfilter
from simbench.detectors.signal.fits import regression as module
from simbench.detectors.signal.fits.regression import regression
from simbench.detectors.signal.stiction_map import valve_position


@pytest.fixture
def swinging():
    """Return OP that swings with a period of 40 samples and wanders, and a plant's answer with a
    load of its own, without friction and with S = 4, J = 1.5.
    """
    rng, k = np.random.default_rng(0), np.arange(1600)
    op = 50.0 + 4.0 * np.sin(2 * np.pi * k / 40.0) + np.cumsum(0.15 * rng.standard_normal(k.size))
    load = lfilter([0.1], [1.0, -1.6, 0.9], 0.2 * rng.standard_normal(k.size))
    stuck = valve_position(op, 4.0, 1.5)
    pvs = [lfilter([0.0, 0.0, 0.2], [1.0, -0.8], v - 50.0) + load for v in (op, stuck)]
    return op, *pvs


def by_columns(pv, q, valve):
    """Return the least squared error over dead times by stacked columns, PV scaled as there."""
    n = valve.size // q
    u, y = (x[: n * q].reshape(n, q).mean(axis=1) for x in (valve, pv))
    y = (y - y.mean()) / y.std()
    first = module._PAST + 1
    best = np.inf
    for d in range(1, module._LATE):
        columns = [np.ones(n - first)]
        columns += [y[first - i : n - i] for i in range(1, module._PAST + 1)]
        columns += [u[first - i : n - i] for i in (d, d + 1)]
        A = np.column_stack(columns)
        left = y[first:] - A @ np.linalg.lstsq(A, y[first:], rcond=None)[0]
        best = min(best, float(left @ left))
    return best


@pytest.mark.parametrize("q", [1, 3])
def test_errors_are_those_of_plain_least_squares(swinging, q):
    op, _, pv = swinging
    data = module._prepare_averages(op, pv, q, beside=False)
    valves = np.array([[4.0, 1.5, 0.0], [2.0, 2.0, 0.0], [0.0, 0.0, 0.0]])
    for valve, error, left in zip(valves, data.errors(valves), data.left(valves)):
        moved = valve_position(op, valve[0], valve[1])
        assert error == pytest.approx(by_columns(pv, q, moved), rel=1e-6)
        assert float(left @ left) == pytest.approx(error, rel=1e-6)


def positions(op, valves, q=1):
    """Return the positions (n, valves) in standard deviations."""
    v, _ = module._average_positions(op, np.array(valves, float), q, 1)
    return np.concatenate(v, axis=1)[:, : len(valves)]


@pytest.mark.parametrize("q", [1, 3])
def test_valves_side_by_side_move_as_each_alone_and_compiled_as_plain(swinging, q, monkeypatch):
    op = swinging[0][: 200 * q]
    rng = np.random.default_rng(3)
    S = np.append(0.0, rng.uniform(0.1, 12.0, module.LANES))
    valves = np.column_stack([S, S * rng.uniform(0.0, 1.0, S.size), np.zeros(S.size)])
    moved = positions(op, valves, q)
    for mine, (size, jump, _) in zip(moved.T, valves):
        v = valve_position(op, size, jump).reshape(-1, q).mean(axis=1)
        moves = v.std() > module._FLAT * np.ptp(op)
        assert mine == pytest.approx((v - v.mean()) / v.std() if moves else 0.0 * v, abs=1e-9)
    monkeypatch.setattr(module, "compiled", lambda kernel: kernel)
    assert np.array_equal(positions(op, valves, q), moved)


def test_an_error_is_the_same_to_the_bit_wherever_the_valve_stands_among_others(
    swinging, monkeypatch
):
    op, _, pv = swinging
    data = module._prepare_averages(op, pv, 1, beside=False)
    S = np.linspace(0.5, 8.0, 3 * module.LANES + 5)
    valves = np.column_stack([S, 0.4 * S, np.zeros(S.size)])
    whole = data.errors(valves)
    assert whole.shape == S.shape
    assert np.array_equal(data.errors(valves[::-1])[::-1], whole)
    monkeypatch.setattr(module, "_ROOM", 1)
    assert np.array_equal(data.errors(valves), whole)


@pytest.mark.parametrize("beside", [False, True])
def test_friction_is_found_where_a_valve_sticks_and_only_there(swinging, beside):
    op, sound, sticky = swinging
    assert regression(op, sound, 40.0, beside).gain < 3.0
    found = regression(op, sticky, 40.0, beside)
    assert found.gain > 20.0
    S, J, _ = found.valves[0]
    assert pytest.approx(4.0, rel=0.05) == S
    assert pytest.approx(1.5, abs=0.5) == J


def test_scale_and_offset_change_nothing(swinging):
    op, _, pv = swinging
    one, other = regression(op, pv, 40.0), regression(op, 1e6 - 1e3 * pv, 40.0)
    assert one.gain == pytest.approx(other.gain, abs=1e-3)


def test_a_short_record_gains_nothing():
    assert regression(np.arange(30.0), np.arange(30.0) ** 2, 10.0).gain == 0.0
