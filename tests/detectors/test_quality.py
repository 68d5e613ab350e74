"""Data-quality flags: each fires on its fault, and none on a sound record."""

import numpy as np
import pytest

from simbench.detectors.quality import inspect, saturation
from simbench.detectors.record import LoopRecord

T = np.arange(2000.0)


def noisy(seed=0, **changes):
    rng = np.random.default_rng(seed)
    signals = {
        "op": 50 + 5 * np.sin(T / 8) + 0.3 * rng.standard_normal(2000),
        "pv": 20 + np.cos(T / 8) + 0.1 * rng.standard_normal(2000),
    }
    return LoopRecord(**{**signals, "Ts": 1.0, **changes})


def swinging_door(x, width):
    """Keep a sample when no straight line from the last kept one runs within the width of all
    since; lines between.
    """
    kept, low, high = [0], -np.inf, np.inf
    for k in range(1, x.size):
        start = kept[-1]
        low = max(low, (x[k] - width - x[start]) / (k - start))
        high = min(high, (x[k] + width - x[start]) / (k - start))
        if low > high:
            kept.append(k - 1)
            low, high = x[k] - width - x[k - 1], x[k] + width - x[k - 1]
    kept.append(x.size - 1)
    return np.interp(np.arange(x.size), kept, x[kept])


def faults():
    record = noisy()
    op, pv = record.op, record.pv
    frozen = pv.copy()
    frozen[700:900] = frozen[700]
    spiky = pv.copy()
    spiky[100::200] += 8.0
    return {
        "dead_op": noisy(op=np.full(2000, 37.0)),
        "dead_pv": noisy(pv=np.full(2000, 37.0)),
        "manual": noisy(op=np.where(T < 900, 40.0, 45.0)),
        "saturated": noisy(op=np.clip(op, 46.5, 60.0)),
        "quantised_op": noisy(op=np.round(op)),
        "quantised_pv": noisy(pv=np.round(pv * 4) / 4),
        "compressed": noisy(pv=swinging_door(pv, 0.15)),
        "held": noisy(op=np.repeat(op[::5], 5), pv=np.repeat(pv[::5], 5)),
        "frozen": noisy(pv=frozen),
        "undersampled": noisy(op=np.sin(T * 2.0), pv=np.cos(T * 2.0)),
        "moving_sp": noisy(sp=np.where(T < 900, 20.0, 22.0)),
        "off_setpoint": noisy(sp=np.full(2000, 40.0)),
        "spikes": noisy(pv=spiky),
        "gaps": noisy(notes=("gaps: 3 of 2000 samples missing, bridged by straight lines",)),
    }


@pytest.mark.parametrize("name", sorted(faults()))
def test_each_fault_raises_its_flag_with_its_number(name):
    flags = inspect(faults()[name])
    assert name in flags, sorted(flags)
    assert len(flags[name].evidence) > 10


def test_sound_record_raises_no_flag():
    assert inspect(noisy()) == {}
    assert inspect(noisy(sp=np.full(2000, 20.0))) == {}


def test_saturation_at_the_ends_of_the_span_is_seen_through_noise():
    rng = np.random.default_rng(0)
    op = np.clip(80 + 40 * np.sin(T / 8) + rng.standard_normal(2000), 0, 100)
    share, limit = saturation(op, np.cos(T / 8), op)
    assert share == pytest.approx((op == 100).mean())
    assert limit == 100.0
