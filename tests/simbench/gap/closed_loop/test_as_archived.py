"""What an archive did to a record is done to the simulated loop beside it, and costs no gap."""

from dataclasses import replace

import numpy as np
import pytest
from recorded import FLOW, LOADED, recorded

from simbench.gap.closed_loop.as_archived import as_archived
from simbench.gap.diagnosis import diagnose
from simbench.gap.intake.check import check
from simbench.scenarios.spec import Loop

SHORT = LOADED | {"sampling": {"Ts": 1.0, "n": 600}}
LOOP = Loop.from_table(FLOW)


@pytest.fixture(scope="module")
def record():
    return replace(recorded(SHORT), mv=None)


def digits(r):
    return replace(r, op=np.round(r.op, 2), pv=np.round(r.pv, 2), sp=np.round(r.sp, 2))


def late(r):
    return replace(r, op=np.append(r.op[0], r.op[:-1]))


def means(r):
    return replace(r, pv=0.5 * (r.pv + np.append(r.pv[0], r.pv[:-1])))


@pytest.mark.parametrize("archive", [digits, late, means])
def test_a_simulated_record_is_kept_as_the_real_one_was(record, archive):
    other = recorded(SHORT, seed=9)
    wanted = archive(other)
    op, pv = as_archived(check(archive(record), LOOP), other.op, other.pv)
    assert np.abs(op - wanted.op).max() < 1e-3 * np.std(other.op)
    assert np.sqrt(np.mean((pv - wanted.pv)[2:-2] ** 2)) < 0.02 * np.std(np.diff(other.pv))


def test_the_corrected_loop_has_the_dead_time_that_a_late_op_hides(record):
    # between the archived OP and PV one sample less of it is seen
    loops = diagnose(late(record), LOOP).behind.loops
    assert loops.corrected(()).plant.Td == pytest.approx(LOOP.plant.Td, abs=0.3)


def test_a_faithful_archive_changes_nothing(record):
    op, pv = as_archived(check(record, LOOP), record.op, record.pv)
    assert np.array_equal(op, record.op)
    assert np.array_equal(pv, record.pv)


def repeated(r, every=4):
    """The record as an archive keeps it that writes OP and PV in one sample of `every` only."""
    last = np.arange(r.n) // every * every
    return replace(r, op=r.op[last], pv=r.pv[last])


def test_a_simulated_record_repeats_its_samples_where_the_real_one_does(record):
    other = recorded(SHORT, seed=9)
    op, pv = as_archived(check(repeated(record), LOOP, trusted=False), other.op, other.pv)
    wanted = repeated(other)
    assert np.diff(op)[np.diff(wanted.op) == 0.0] == pytest.approx(0.0, abs=0.0)
    assert np.abs(op - wanted.op).max() < 1e-3 * np.std(other.op)
    assert np.abs(pv - wanted.pv).max() < 1e-3 * np.std(other.pv)
