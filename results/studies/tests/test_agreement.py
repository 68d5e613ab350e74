"""The study of whether an order of methods holds: areas, halves of units, and what is printed."""

import re
from pathlib import Path

import numpy as np
import pytest

from results.studies.agreement import COPIES, Scored, areas, halves
from simbench.bench.statistics import auc

PRINTED = Path("results/agreement.txt").read_text(encoding="utf-8")


def drawn(rng, units, methods=6, noise=1.0):
    sticky = rng.random(units.size) < 0.5
    skill = np.linspace(0.0, 2.0, methods)[:, None]
    return Scored(skill * sticky + noise * rng.normal(size=(methods, units.size)), sticky, units)


def test_an_area_is_that_of_the_package_and_a_loop_without_a_score_stands_in_the_middle():
    rng = np.random.default_rng(0)
    loops = drawn(rng, np.arange(80).astype(str))
    assert areas(loops) == pytest.approx([auc(s, loops.sticky).value for s in loops.score])
    silent = Scored(np.full((1, 80), np.nan), loops.sticky, loops.unit)
    assert areas(silent) == pytest.approx([0.5])
    assert np.isnan(areas(loops.of(loops.sticky))).all()


def test_an_order_that_holds_is_seen_and_one_that_does_not_is_not():
    rng = np.random.default_rng(1)
    units = np.repeat(np.arange(60), 4).astype(str)
    real = drawn(rng, units)
    same, turned = drawn(rng, units), drawn(rng, units)
    turned = Scored(turned.score[::-1], turned.sticky, turned.unit)
    held, lost = (np.nanmedian(np.array(halves(g, real, True))[:, 0]) for g in (same, turned))
    assert held > 0.8
    assert lost < -0.8


def test_no_unit_makes_loops_and_judges_them():
    # each unit has its own answer: only a unit that is on both sides would agree
    rng = np.random.default_rng(2)
    units = np.repeat(np.arange(30), 2).astype(str)
    sticky = np.tile([True, False], 30)
    own = np.repeat(rng.normal(size=(8, 30)), 2, axis=1) * np.where(sticky, 1.0, -1.0)
    loops = Scored(own, sticky, units)
    assert abs(np.nanmedian(np.array(halves(loops, loops, True))[:, 0])) < 0.9
    assert np.nanmedian(np.array(halves(loops, loops, False))[:, 0]) > np.nanmedian(
        np.array(halves(loops, loops, True))[:, 0]
    )


def test_the_grid_of_recorded_loops_agrees_at_least_as_well_as_that_of_the_chapter():
    found = dict(re.findall(r"^(\w+) +(?:\S+) +(\S+)", PRINTED.split("\n\n")[-1], re.MULTILINE))
    assert float(found[COPIES]) >= float(found["chapter"])
