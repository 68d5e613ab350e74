"""What single samples prove of an archive, and which PV the plant gave: each rule just inside and
just outside.
"""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from simbench.detectors.errors import RecordError
from simbench.detectors.record import LoopRecord
from simbench.gap.controller.law import Law
from simbench.gap.intake.archive import _find_spikes, find_archive
from simbench.gap.intake.observed import op_in_percent
from simbench.gap.sensor.samples import Samples
from simbench.gap.situation import Archive

N = 1000
RNG = np.random.default_rng(0)
PV = 50.0 + np.cumsum(RNG.standard_normal(N)) * 0.1
OP = 50.0 + RNG.standard_normal(N)
NONE = np.empty(0, dtype=int)
PLAIN = Samples(0.0, 0.0, 0.0, NONE, np.empty(0), 0, 0.0)
LAW = Law(0.0, 1.0, 20.0)
HIDDEN = replace(LAW, reason="no law", recovered_pv=PV + 1.0)


def seen_in(law, samples, pv=PV, noise=0.1, op=OP):
    """Return a record with what its law and samples show."""
    return SimpleNamespace(
        record=SimpleNamespace(op=op, pv=pv, n=N, Ts=1.0),
        law=law,
        samples=samples,
        noise=noise,
        baseline=controlled(),
    )


def controlled(Td=None):
    return SimpleNamespace(controller=SimpleNamespace(Td=Td, N=None))


def lattice(step):
    return replace(PLAIN, step=step, resolution=0.001)


@pytest.mark.parametrize(
    ("samples", "law", "archive"),
    [
        (PLAIN, LAW, Archive()),
        # PV moves by 0.1 a sample: rounding by 0.02 hides nothing, by 0.03 it does
        (lattice(0.02), LAW, Archive()),
        (lattice(0.03), LAW, Archive((0.03, "loop"))),
        (lattice(0.03), HIDDEN, Archive((0.03, "record"))),
        (replace(PLAIN, resolution=0.02), LAW, Archive()),
        # a decimal is how PV is written until it hides something of the noise, 0.1 too, that a
        # filter may have taken off PV
        (replace(PLAIN, resolution=0.03), LAW, Archive()),
        (replace(PLAIN, resolution=0.04), LAW, Archive((0.04, "loop"))),
        (replace(PLAIN, straight=0.16), LAW, Archive()),
    ],
)
def test_a_lattice_counts_where_it_hides_something_and_is_the_archives_where_op_saw_none(
    samples, law, archive
):
    result, plant_pv, mismatch = find_archive(seen_in(law, samples))
    assert (result, mismatch) == (archive, "")
    # before an archive that hides something, the plant's PV is the one that the controller saw
    assert np.array_equal(plant_pv, PV + 1.0 if law is HIDDEN else PV)


@pytest.mark.parametrize(
    ("law", "apart"),
    [
        (LAW, False),
        (HIDDEN, True),
        (replace(HIDDEN, reason=""), False),
        (replace(HIDDEN, recovered_pv=None), False),
    ],
)
def test_an_archive_is_apart_where_op_shows_another_pv_and_the_recorded_one_explains_nothing(
    law, apart
):
    assert law.apart == apart


def test_op_in_other_units_is_refused_only_where_a_law_or_a_plant_is_compared():
    raw = LoopRecord(op=np.linspace(200.0, 900.0, 200), pv=PV[:200], Ts=1.0)
    with pytest.raises(RecordError, match="record: OP runs from 200 to 900"):
        op_in_percent(raw, True, "record")
    assert np.array_equal(op_in_percent(raw, False, "record"), raw.op)
    spanned = replace(raw, op_span=(0.0, 1000.0))
    assert op_in_percent(spanned, True, "record")[[0, -1]] == pytest.approx([20.0, 90.0])


PLACES, HEIGHTS = np.array([100, 300, 500, 700]), np.array([3.0, -3.0, 4.0, 3.0])


def hit(pv=PV, places=PLACES, heights=HEIGHTS):
    out = pv.copy()
    out[places] += heights
    return out


def test_samples_that_were_lost_and_bridged_are_no_spikes_of_op_or_pv():
    pv, k = PV.copy(), np.array([30, 75, 120])
    pv[k] = 0.5 * (pv[k - 1] + pv[k + 1])
    # the controller saw another PV there, or in the sample beside, where OP was lost as well
    saw = PV.copy()
    saw[k - np.array([0, 1, 1])] += 2.0
    assert _find_spikes(seen_in(replace(LAW, recovered_pv=saw), PLAIN, pv), pv, False)[::2] == (
        None,
        "",
    )


@pytest.mark.parametrize(
    ("height", "reason"), [(2.0, "OP moves as no PV on record makes it move"), (0.1, "")]
)
def test_op_that_sees_spikes_which_pv_does_not_show_is_a_mismatch_unless_they_are_specks(
    height, reason
):
    seen = hit(heights=height * np.sign(HEIGHTS))
    spikes, plant_pv, mismatch = _find_spikes(
        seen_in(replace(LAW, recovered_pv=seen), PLAIN), PV, False
    )
    assert (spikes, mismatch) == (None, reason)
    assert np.array_equal(plant_pv, PV if reason else seen)
