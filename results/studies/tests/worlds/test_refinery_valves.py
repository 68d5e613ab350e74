"""The refinery's valve: maps worked out by hand, and the S and J that each friction law shows on a
slow stroke.
"""

from __future__ import annotations

import numpy as np
import pytest

from results.studies.worlds.refinery import valves
from results.studies.worlds.refinery.valves import Valve

MODELS = [valves.CHOUDHURY, valves.HE, valves.KARNOPP, valves.STRIBECK, valves.LUGRE]
NAMES = [valves.FRICTION[m] for m in MODELS]
H, SUB = 1 / 24, 24


def rubbing(model, S, J):
    time, share = 0.05, 0.005 if model == valves.LUGRE else 0.05
    return Valve(
        friction=model,
        fs=(S + J) / 2,
        fd=(S - J) / 2,
        travel_time=time,
        stribeck_speed=share * J / time,
        slip_end=0.01 * S,
        bristle=0.002 * S,
    )


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


@pytest.mark.parametrize("model", MODELS, ids=NAMES)
@pytest.mark.parametrize(("S", "J"), [(6.0, 2.0), (4.0, 3.0)])
def test_slow_stroke_shows_the_mapped_band_and_jump(model, S, J):
    up = np.arange(40.0, 60.0, 0.02)
    op = np.concatenate([up, up[::-1]])
    mv = stroke(rubbing(model, S, J), op)[SUB - 1 :: SUB]
    top = up.size
    fall = top + int(np.argmax(mv[top:] < mv[top] - 0.3 * J))
    # from the end of the upward stroke the stem lags by at least (S-J)/2, at most (S+J)/2; it gives
    # way at (S+J)/2 below
    assert op[fall] - mv[fall - 1] == pytest.approx(-(S + J) / 2, rel=0.12)
    jump = mv[fall - 2] - mv[min(fall + 3, mv.size - 1)]
    assert jump == pytest.approx(J, rel=0.25)
    assert mv[top - 1] <= op[top - 1] - (S - J) / 2 + 0.05 * S


def test_stroking_speed_and_stops():
    v = Valve(speed=2.0, stop_hi=60.0)
    mv = stroke(v, np.array([50.0, 50.0, *[80.0] * 10]))
    assert mv[3 * SUB - 1] == pytest.approx(52.0)
    assert np.max(np.diff(mv)) <= 2.0 * H + 1e-12
    assert mv[-1] == 60.0
