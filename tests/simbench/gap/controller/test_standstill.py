"""Just inside and just outside: when standing still is a limit, a dead-band, or neither."""

import numpy as np
import pytest

from simbench.gap.controller.law import spread
from simbench.gap.controller.standstill import error_gap, limits_of, skips_scans


@pytest.mark.parametrize(
    ("rests", "elsewhere", "limited"), [(7, 0, True), (6, 0, False), (20, 3, False), (40, 3, True)]
)
def test_a_fine_op_that_rests_at_one_extreme_only_is_limited(rests, elsewhere, limited):
    first, then, last = np.split(50.0 + 4.0 * np.sin(np.arange(370) * 0.37), [300, 350])
    op = np.concatenate([first, [55.0] * rests, then, [50.123] * (elsewhere + 1), last])
    assert limits_of(op, np.zeros(op.size), 1.0, 0.0, 0.0, 0.0) == ({"hi": 55.0} if limited else {})


def rest(pairs, n, wrong=0):
    """Return an error within 0.1 for so many pairs of samples and beyond 2 elsewhere, and OP that
    rests in the band.
    """
    rng = np.random.default_rng(1)
    e = rng.uniform(2.0, 3.0, n) * rng.choice([-1, 1], n)
    e[100 : 101 + pairs] = rng.uniform(0.05, 0.1, pairs + 1)
    moves = np.maximum(np.abs(e[1:]), np.abs(e[:-1])) > 1.0
    moves[-(wrong + 50) : -50] = False
    return 50.0 + np.append(0.0, np.cumsum(moves * rng.uniform(0.1, 0.2, n - 1))), e


@pytest.mark.parametrize(("wrong", "limited"), [(0, True), (40, True), (200, False)])
def test_a_dead_band_is_where_op_rests_and_nowhere_else(wrong, limited):
    op, e = rest(100, 1000, wrong)
    assert (error_gap(np.diff(op) == 0.0, e, np.ones(999, dtype=bool)) > 0.0) == limited


def test_an_error_of_exactly_nothing_has_no_dead_band():
    op, e = rest(100, 1000)
    assert (
        error_gap(np.diff(op) == 0.0, np.where(np.abs(e) < 1.0, 0.0, e), np.ones(999, dtype=bool))
        == 0.0
    )


def scans(missed, n=1000, noise=0.0, Kc=0.8, Ki=0.05):
    """Return OP of a PI controller that misses scans, each move counted from the last one; its
    error, and its moves' size.
    """
    rng = np.random.default_rng(2)
    e, op, last = np.cumsum(rng.standard_normal(n)) * 0.1, np.full(n, 50.0), 0
    skip = np.isin(np.arange(n), rng.choice(np.arange(1, n), missed, replace=False))
    for k in range(1, n):
        op[k] = op[k - 1]
        if not skip[k]:
            op[k] += (Kc * (e[k] - e[last]) + Ki * e[k]) * (1.0 + noise * rng.standard_normal())
            last = k
    return op, e, spread(np.diff(op)) or float(np.std(np.diff(op)))


@pytest.mark.parametrize(
    ("missed", "skips"), [(0, False), (4, False), (6, True), (300, True), (450, True)]
)
def test_a_controller_that_misses_a_few_scans_obeys_its_law_from_move_to_move(missed, skips):
    op, e, size = scans(missed)
    inside = np.ones(op.size, dtype=bool)
    assert skips_scans(op, e, e.take, inside[1:] & inside[:-1], size, 0.0) == skips
    # standstills at a limit are none
    still = np.append(False, np.diff(op) == 0.0)
    assert not skips_scans(op, e, e.take, ~still[1:], size, 0.0)


@pytest.mark.parametrize(("n", "skips"), [(38, False), (44, True)])
def test_a_law_from_move_to_move_wants_thirty_moves(n, skips):
    op, e, size = scans(10, n=n)
    assert skips_scans(op, e, e.take, np.ones(n - 1, dtype=bool), size, 0.0) == skips
