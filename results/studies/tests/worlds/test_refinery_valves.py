"""The refinery's valve: maps worked out by hand, and the S and J that each friction law shows on a
slow stroke.
"""

from __future__ import annotations

import numpy as np
import pytest

from results.studies.worlds.refinery import valves
from results.studies.worlds.refinery.valves import Valve

H, SUB = 1 / 24, 24


def stroke(valve, op):
    """MV (fine grid) of a valve under a scanned OP."""
    state, out = valves.rest(op[0]), []
    for u in op:
        drive = valves.scan(u, state, valve)
        out += [valves.stroke(drive, H, 0.0, state, valve) for _ in range(SUB)]
    return np.array(out)


def test_trim_by_hand_and_back():
    assert valves.trim(50.0, 1.0) == 50.0
    assert valves.trim(50.0, 49.0) == pytest.approx(100 * (7 - 1) / 48)
    for R in (0.05, 1.0, 30.0):
        assert valves.trim(valves.untrim(37.0, R), R) == pytest.approx(37.0)
        assert valves.trim(100.0, R) == pytest.approx(100.0)


def test_laws_by_hand():
    play = [valves.play(u, 50.0, 2.0) for u in (50.5, 52.0, 54.0, 48.0)]
    assert play == [50.0, 51.0, 53.0, 49.0]
    zone = [valves.dead_zone(u, 4.0, 50.0) for u in (47.0, 48.5, 51.9, 53.0)]
    assert zone == [49.0, 50.0, 50.0, 51.0]
    # S = 4, J = 2: break-away 3, offset while moving 1; He's stem sticks after every move
    for friction, op, stem in (
        (
            valves.CHOUDHURY,
            (52.0, 53.5, 55.0, 54.0, 51.5, 50.5),
            (50.0, 52.5, 54.0, 54.0, 54.0, 51.5),
        ),
        (valves.HE, (53.5, 54.5, 55.6), (52.5, 52.5, 54.6)),
    ):
        state = valves.rest(50.0)
        v = Valve(friction=friction, fs=3.0, fd=1.0)
        assert [valves.scan(u, state, v) for u in op] == pytest.approx(stem)


def test_stroking_speed_and_stops():
    v = Valve(speed=2.0, stop_hi=60.0)
    mv = stroke(v, np.array([50.0, 50.0, *[80.0] * 10]))
    assert mv[3 * SUB - 1] == pytest.approx(52.0)
    assert np.max(np.diff(mv)) <= 2.0 * H + 1e-12
    assert mv[-1] == 60.0
