"""Lattices: found wherever they begin, in the root too, through a file's digits; digits themselves
are none.
"""

import numpy as np
import pytest

from simbench.detectors.signal.lattice import (
    lattice,
    root_lattice,
    written_unit,
)


def test_four_to_ten_levels_that_lie_anywhere_are_hardly_ever_a_lattice():
    rng = np.random.default_rng(0)
    hits = sum(lattice(rng.uniform(10.0, 11.0, rng.integers(4, 11))) > 0.0 for _ in range(4000))
    assert hits < 8


@pytest.mark.parametrize("offset", [0.0, 0.017])
def test_a_lattice_survives_the_file_s_rounding(offset):
    x = np.round(offset + 1 / 32 * np.round(np.random.default_rng(0).standard_normal(800) * 40), 3)
    assert lattice(x, written_unit(x)) == pytest.approx(1 / 32, rel=1e-3)


def test_a_lattice_in_differential_pressure_is_identified_in_its_root_alone():
    flow = np.sqrt(0.004 * np.round(np.random.default_rng(0).normal(2000.0, 200.0, 800)))
    assert lattice(flow) == 0.0
    assert root_lattice(flow) == pytest.approx(0.004 / (2 * np.sqrt(8.0)), rel=0.02)
    assert root_lattice(0.5 + flow) == 0.0


def test_no_unit_of_the_signal_changes_the_answer():
    x = 0.31 + 0.25 * np.round(np.random.default_rng(0).standard_normal(400) * 12)
    for scale in (1e-4, 7.0, -3e5):
        assert lattice(scale * x) == pytest.approx(abs(scale) * 0.25, rel=1e-6)


@pytest.mark.parametrize("start", [0.0, 0.11, 7.003])
@pytest.mark.parametrize("archive", [0.0, 0.006])
def test_a_lattice_is_identified_wherever_it_begins_and_on_whatever_finer_one_it_was_written(
    start, archive
):
    x = start + 0.17 * np.round(np.random.default_rng(3).normal(300, 20, 1500))
    if archive:
        x = archive * np.round(x / archive)
    assert lattice(x, 1e-6) == pytest.approx(0.17, rel=1e-3)


@pytest.mark.parametrize(
    ("levels", "samples", "expected"), [(2, 40, True), (2, 39, False), (3, 60, True), (4, 20, True)]
)
def test_few_levels_are_a_lattice_when_they_repeat_themselves_or_lie_too_evenly_for_chance(
    levels, samples, expected
):
    x = 42.2 + 0.7 * (np.arange(samples) % levels)
    assert lattice(x) == (pytest.approx(0.7) if expected else 0.0)
