"""A recorded MV is the plant's input within its digits, and strays where no valve makes it."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np

from simbench import Loop
from simbench.gap.decide.recorded_mv import by_stem, valve_maps
from simbench.gap.intake.check import check
from simbench.gap.likelihood.model import Data
from simbench.scenarios.parts import Part

MORE = {
    "controller": {"type": "PI", "Kc": 1, "Ti": 20},
    "sampling": {"Ts": 1, "n": 800},
    "noise": {"std": 0.1},
    "setpoint": {"steps": [[100, 55], [350, 48], [600, 53]]},
}


def test_mv_is_what_the_valve_makes_of_op_within_the_digits_it_was_logged_in():
    rng = np.random.default_rng(2)
    op = 50.0 + np.cumsum(rng.standard_normal(200))
    mv = np.round(op, 1)
    mv[100:] += 0.5
    data = Data(op, op - 50.0, 1.0, 10.0, 2.0, 0.1)
    baseline = SimpleNamespace(
        valve=Part(name="ideal"), controller=SimpleNamespace(Kc=1.0), effect=()
    )
    record = SimpleNamespace(Ts=1.0, mv=mv)
    s = SimpleNamespace(data=data, op=op, baseline=baseline, record=record)
    seen = by_stem(s, {"stiction": (0.0, {})}).u
    np.testing.assert_array_equal(seen[:100], op[:100])
    np.testing.assert_array_equal(seen[100:], mv[100:])
    # MV that was logged before OP had moved is the valve's a moment later
    record.mv = np.round(op - 0.8 * np.diff(op, prepend=op[0]), 3)
    np.testing.assert_array_equal(by_stem(s, {"stiction": (0.0, {})}).u, op)


def test_mv_strays_only_where_no_map_explains_it():
    loop = Loop(plant={"type": "foptd", "K": 1, "T": 20, "Td": 6}, **MORE)
    lags = loop.with_("effect", [{"name": "valve_lag", "tau": 2.0}])
    record = lags.simulate(3).record
    maps, strays = valve_maps(check(record, loop))
    assert max(maps, key=lambda e: maps[e][0]) == "valve_lag"
    assert not strays
    wild = np.asarray(record.mv) + 3.0 * np.random.default_rng(4).standard_normal(record.n)
    assert valve_maps(check(replace(record, mv=wild), loop))[1]
    assert valve_maps(check(record.without_mv(), loop)) == ({}, False)
