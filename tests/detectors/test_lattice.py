"""Lattices: found wherever they begin, in the root too, through a file's digits; digits themselves are none."""

import numpy as np
import pytest

from detectors.signal.lattice import lattice, resolution, root_lattice, written_unit


@pytest.mark.parametrize("offset", [0.0, 0.1234, -31.4])
@pytest.mark.parametrize("step", [0.0321, 0.5, 3.3])
def test_a_lattice_is_found_wherever_it_begins(offset, step):
    x = offset + step * np.round(np.random.default_rng(0).standard_normal(500) * 20)
    assert lattice(x) == pytest.approx(step, rel=1e-6)


@pytest.mark.parametrize("levels", [2, 3])
def test_two_or_three_levels_are_a_lattice_only_if_it_holds_zero(levels):
    x = 0.7 * np.random.default_rng(0).integers(60, 60 + levels, 400)
    assert np.unique(x).size == levels
    assert lattice(x) == pytest.approx(0.7, rel=1e-6)
    assert lattice(x + 0.2) == 0.0


@pytest.mark.parametrize(
    ("levels", "off", "found"), [(4, 0.0, False), (5, 0.005, True), (5, 0.03, False), (8, 0.03, True), (8, 0.2, False)]
)
def test_few_levels_must_lie_the_nearer(levels, off, found):
    x = 42.2 + 0.7 * np.arange(levels)
    x[1] += 0.7 * off
    assert lattice(x) == (pytest.approx(0.7, rel=0.01) if found else 0.0)


def test_four_to_ten_levels_that_lie_anywhere_are_hardly_ever_a_lattice():
    rng = np.random.default_rng(0)
    hits = sum(lattice(rng.uniform(10.0, 11.0, rng.integers(4, 11))) > 0.0 for _ in range(4000))
    assert hits < 8


def test_a_value_off_the_lattice_takes_a_small_one_away_and_not_a_large_one():
    few, many = (0.5 * np.round(np.random.default_rng(0).standard_normal(500) * k) for k in (1, 30))
    few[7], many[7] = 0.2, 0.2
    assert lattice(few) == 0.0
    assert lattice(many) == pytest.approx(0.5, rel=1e-3)


@pytest.mark.parametrize("seed", range(20))
def test_values_that_lie_anywhere_stand_on_none(seed):
    rng = np.random.default_rng(seed)
    for x in (rng.standard_normal(400), rng.uniform(0.0, 1.0, 12), np.cumsum(rng.standard_normal(400)), 1e6 + rng.random(50)):
        assert lattice(x) == root_lattice(x) == 0.0


@pytest.mark.parametrize("offset", [0.0, 0.017])
def test_a_lattice_survives_the_file_s_own_rounding(offset):
    x = np.round(offset + 1 / 32 * np.round(np.random.default_rng(0).standard_normal(800) * 40), 3)
    assert lattice(x, written_unit(x)) == pytest.approx(1 / 32, rel=1e-3)


def test_a_lattice_in_differential_pressure_is_found_in_its_root_alone():
    flow = np.sqrt(0.004 * np.round(np.random.default_rng(0).normal(2000.0, 200.0, 800)))
    assert lattice(flow) == 0.0
    assert root_lattice(flow) == pytest.approx(0.004 / (2 * np.sqrt(8.0)), rel=0.02)
    assert root_lattice(0.5 + flow) == 0.0


@pytest.mark.parametrize("digits", [2, 3, 4, 9])
def test_decimals_of_a_file_are_no_lattice(digits):
    x = 99.0 + np.random.default_rng(0).standard_normal(600)
    rounded = np.round(x, digits)
    assert resolution(rounded) == pytest.approx(10.0**-digits)
    kept = np.array([float(f"{v:.6g}") for v in x])  # more decimals below 100 than above
    for y in (rounded, kept):
        assert lattice(y, written_unit(y)) == root_lattice(y) == 0.0


def test_a_unit_far_coarser_than_the_other_column_s_digits_is_the_signal_s_own_step():
    rng = np.random.default_rng(0)
    op, pv = rng.normal(50.0, 5.0, 300), np.round(rng.normal(40.0, 5.0, 300))
    assert written_unit(pv, np.round(op, 1)) == 1.0
    unit = written_unit(pv, np.round(op, 6))
    assert unit == pytest.approx(1e-6)
    assert lattice(pv, unit) == pytest.approx(1.0)


def test_no_unit_of_the_signal_changes_the_answer():
    x = 0.31 + 0.25 * np.round(np.random.default_rng(0).standard_normal(400) * 12)
    for scale in (1e-4, 7.0, -3e5):
        assert lattice(scale * x) == pytest.approx(abs(scale) * 0.25, rel=1e-6)
