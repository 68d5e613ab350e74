"""Rates of cells and of the whole grid lie in their intervals as often as these say, where the
truth is known.
"""

import itertools

import numpy as np
import pytest

from simbench.bench.map.surrogate import (
    IF_OSCILLATING,
    NOT_COUNTED,
    OUTCOME_COST,
    OUTCOMES,
    RATES,
    Surrogate,
    rate_of_cells,
    rate_of_grid,
)

SHAPE = (6, 5, 4, 3)
CELLS = np.array(list(itertools.product(*map(range, SHAPE))))


def population(seed, slope=4.0):
    """Every scenario of a grid with a sticky and a healthy loop in each cell; chances that the
    answer is yes, and outcomes.
    """
    z = (CELLS + 0.5) / np.array(SHAPE)
    level = slope * (z[:, 0] - 0.5) + 3.0 * (z[:, 1] - 0.4) * (z[:, 2] > 0.5)
    chance = 1.0 / (1.0 + np.exp(-np.column_stack([level + 1.0, level - 2.5])))
    yes = np.random.default_rng(seed).random(chance.shape) < chance
    return chance, 6 + 3 * np.array([1, 0]) + yes


def drawn(outcomes, n, seed):
    place = np.sort(np.random.default_rng(100 + seed).choice(outcomes.size, n, replace=False))
    cell, member = np.divmod(place, 2)
    return Surrogate.fit(np.column_stack([CELLS[cell], member]), outcomes[cell, member], cell)


def halves_of_all(surrogate):
    both = [
        surrogate.halves(np.column_stack([CELLS, np.full(len(CELLS), member)])) for member in (0, 1)
    ]
    return both[0] + both[1]


def test_a_rate_of_a_cell_lies_in_its_interval_where_neighbours_are_alike():
    inside = {name: [] for name in ("accuracy", "sensitivity", "false_positives")}
    for seed in range(4):
        (sticky, healthy), outcomes = population(seed)[0].T, population(seed)[1]
        truth = {
            "accuracy": (sticky + 1.0 - healthy) / 2.0,
            "sensitivity": sticky,
            "false_positives": healthy,
        }
        halves = halves_of_all(drawn(outcomes, 250, seed))
        for name, known in truth.items():
            value, lo, hi = rate_of_cells(halves, name)
            assert np.all((0.0 <= lo) & (lo <= value + 1e-9) & (value <= hi + 1e-9) & (hi <= 1.0))
            assert (hi - lo).mean() < 0.65, "an interval of everything is worth nothing"
            inside[name].append(np.mean((lo <= known) & (known <= hi)))
    assert all(np.mean(shares) > 0.9 for shares in inside.values()), inside


@pytest.mark.parametrize("slope", [4.0, 0.0])
def test_the_cost_of_a_run_of_the_whole_grid_lies_in_its_interval(slope):
    inside, errors, naive = 0, [], []
    for seed in range(10):
        outcomes = population(seed, slope)[1]
        surrogate = drawn(outcomes, 120, seed)
        mean = halves_of_all(surrogate).mean(axis=(0, 1)) / 2.0
        cost, known = rate_of_grid(surrogate, mean, outcomes.size), OUTCOME_COST[outcomes].mean()
        inside += cost.lo <= known <= cost.hi
        errors.append(cost.value - known)
        naive.append(OUTCOME_COST[surrogate.outcome].mean() - known)
    assert inside >= 8  # of 10; binomial with .95: fewer in 1.2 % of cases
    assert np.sqrt(np.mean(np.square(errors))) < 1.1 * np.sqrt(np.mean(np.square(naive)))


def test_a_sample_of_everything_has_the_cost_of_the_run_and_no_interval():
    outcomes = population(0)[1]
    outcomes[::7] = NOT_COUNTED
    outcomes[1::7, 0] -= 6  # do not oscillate
    surrogate = drawn(outcomes, outcomes.size, 0)
    for only, counted in (
        (None, outcomes != NOT_COUNTED),
        (IF_OSCILLATING, IF_OSCILLATING[outcomes] > 0),
    ):
        cost = rate_of_grid(surrogate, np.full(OUTCOMES, 1.0 / OUTCOMES), outcomes.size, only)
        assert cost.value == pytest.approx(OUTCOME_COST[outcomes[counted]].mean())
        assert cost.hi - cost.lo < 1e-12


def test_what_has_no_label_anywhere_has_no_rate():
    outcomes = np.full((len(CELLS), 2), NOT_COUNTED)
    surrogate = drawn(outcomes, 60, 0)
    halves = halves_of_all(surrogate)
    assert all(np.isnan(rate_of_cells(halves, name)[0]).all() for name in RATES)
    assert np.isnan(rate_of_grid(surrogate, halves.mean(axis=(0, 1)), outcomes.size).value)


def test_a_scenario_is_predicted_by_forests_that_do_not_have_its_cell():
    # nothing to learn: by heart it would be known
    outcomes = np.random.default_rng(0).choice([6, 7], (len(CELLS), 2))
    surrogate = drawn(outcomes, 300, 0)
    assert surrogate.brier() > 0.24
    assert not (
        surrogate.outside
        & ~np.isin(surrogate.cells, surrogate.cells[surrogate.outside.any(axis=0)])
    ).any()
