"""Features of records: they have no unit, and each block's tell what it is named after."""

import numpy as np
import pytest
from recorded import FLOW, recorded

from simbench.detectors.record import LoopRecord
from simbench.gap.benchmark.features import BLOCKS, describe, samples_per_period


@pytest.fixture(scope="module")
def record():
    return recorded(FLOW, valve={"model": "choudhury", "S": 4.0, "J": 2.0})


def _changed(record: LoopRecord, **signals) -> LoopRecord:
    same = {name: getattr(record, name) for name in ("op", "pv", "sp", "Ts")}
    return LoopRecord(**(same | signals))


def _apart(one: LoopRecord, other: LoopRecord) -> dict[str, float]:
    """Return the largest difference of a feature in each block."""
    found, there = describe(one), describe(other)
    return {
        block: max(abs(found[key] - there[key]) for key in found if key[0] == block)
        for block in BLOCKS
    }


def test_every_block_has_features(record):
    assert {block for block, _ in describe(record)} == set(BLOCKS)
    assert all(np.isfinite(x) for x in describe(record).values())


def test_units_and_direction_change_nothing(record):
    other = _changed(
        record,
        op=100.0 - record.op,
        pv=7.0 * record.pv - 3.0,
        sp=7.0 * record.sp - 3.0,
        Ts=60.0 * record.Ts,
    )
    assert max(_apart(record, other).values()) < 1e-6


def test_rounding_pv_moves_the_lattice_most_but_for_the_law_that_saw_more(record):
    step = 0.5 * float(np.std(record.pv))
    moved = _apart(record, _changed(record, pv=step * np.round(record.pv / step)))
    assert moved.pop("controller") > moved["lattice"] == max(moved.values())
    assert moved["length"] == 0.0


def test_a_set_point_that_moves_is_seen_in_its_block_alone(record):
    sp = record.sp + 0.1 * (np.arange(record.n) > record.n // 2)
    moved = _apart(record, _changed(record, sp=sp, pv=record.pv + sp - record.sp))
    assert moved["set point"] == max(moved.values())
    assert moved["length"] == moved["samples per period"] == 0.0


def test_a_pi_law_leaves_nothing_of_op():
    rng = np.random.default_rng(3)
    error = np.cumsum(rng.standard_normal(800))
    op = 2.0 * (error + np.cumsum(error) / 30.0)
    found = describe(LoopRecord(op, -error, 1.0, sp=np.zeros(800)))
    assert found["controller", "left by a PI law"] == pytest.approx(np.log(1e-6), abs=0.1)
    derived = op + 3.0 * np.diff(error, prepend=error[0])
    other = describe(LoopRecord(derived, -error, 1.0, sp=np.zeros(800)))
    assert other["controller", "left by a PI law"] > np.log(0.1)
    assert other["controller", "told by a derivative"] > np.log(0.9)


def test_samples_per_period_of_a_sine():
    wave = np.sin(2.0 * np.pi * np.arange(1000) / 25.0)
    assert samples_per_period(LoopRecord(wave, wave, 2.0)) == pytest.approx(25.0, rel=0.05)
