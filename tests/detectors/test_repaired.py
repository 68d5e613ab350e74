"""Tests of what is taken out of a record before anything is concluded from it."""

from dataclasses import replace

import numpy as np
import pytest

from simbench.detectors.record import LoopRecord
from simbench.detectors.repaired import repair_record

N = 600


def record(change=lambda op, pv: None):
    """Return a noisy oscillation in which something was changed."""
    rng, t = np.random.default_rng(0), np.arange(N)
    op = 50.0 + np.sin(t / 9) + 0.05 * rng.standard_normal(N)
    pv = 20.0 - np.sin(t / 9 - 1.0) + 0.05 * rng.standard_normal(N)
    change(op, pv)
    return LoopRecord(op=op, pv=pv, Ts=1.0)


def test_an_ordinary_record_is_returned_as_it_is():
    sound = record()
    assert repair_record(sound) is sound


@pytest.mark.parametrize("value", [0.0, -9999.0, 1e30])
@pytest.mark.parametrize("signal", ["op", "pv"])
@pytest.mark.parametrize("places", [[200], [0], [N - 1], [300, 301, 302, 303, 304], [7, 90, 400]])
def test_wild_samples_count_as_missing(value, signal, places):
    def change(op, pv):
        (op if signal == "op" else pv)[places] = value

    mended = repair_record(record(change))
    assert np.abs(getattr(mended, signal) - getattr(record(), signal)).max() < 2.1
    assert mended.n == N
    assert mended.notes[0].startswith(f"outliers: {len(places)} sample")
    assert repair_record(mended) is mended


def test_wild_samples_leave_no_word_about_their_unit():
    def change(op, pv):
        op[200] = 1e30

    doubted = "unit: OP runs from 48.8 to 1e+30, which is no %: S and J are in OP units"
    given = replace(record(change), notes=(doubted, "gaps: none"))
    assert [note.split(":")[0] for note in repair_record(given).notes] == ["gaps", "outliers"]


@pytest.mark.parametrize("share", [0.06, 0.25, 0.4])
def test_a_frozen_tail_is_left_out(share):
    begin = round(N * (1 - share))

    def change(op, pv):
        op[begin:], pv[begin:] = op[begin - 1], pv[begin - 1]

    mended = repair_record(record(change))
    assert mended.n == begin - 1
    assert np.array_equal(mended.pv, record().pv[: begin - 1])
    assert mended.notes == (
        f"frozen: PV and OP stand still from sample {begin - 1} to {N - 1} of {N};"
        f" judged samples 0 to {begin - 2}",
    )


def test_op_at_a_limit_is_not_frozen():
    def change(op, pv):
        np.clip(op, None, 50.2, out=op)
        op[400:500] = 50.2

    limited = record(change)
    assert repair_record(limited) is limited


@pytest.mark.parametrize("factor", [1e-12, 1e-6, 1e9, 1e12])
@pytest.mark.parametrize("offset", [0.0, 1e6])
def test_pv_of_any_unit_and_offset_is_judged_as_in_an_ordinary_one(factor, offset):
    plain = record()
    sp = np.full(N, 20.0)
    given = replace(plain, pv=factor * (plain.pv + offset), sp=factor * (sp + offset))
    mended = repair_record(
        replace(given, pv_span=(factor * (offset + 0.0), factor * (offset + 40.0)))
    )
    low, high = mended.pv_span
    # both mean the same share of the span
    assert (mended.pv - low) / (high - low) == pytest.approx(plain.pv / 40.0, abs=1e-8)
    assert (mended.sp - low) / (high - low) == pytest.approx(sp / 40.0, abs=1e-8)
    assert 1e-3 <= np.ptp(mended.pv) <= 1e6
    assert np.abs(mended.pv).max() < 1e5 * np.ptp(mended.pv)
    assert mended.notes[0].startswith("unit: PV spans")
    assert repair_record(mended) is mended
