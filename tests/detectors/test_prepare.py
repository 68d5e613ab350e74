"""Which part of a record is judged: the whole, or the half that oscillates where the whole does
not.
"""

import numpy as np
import pytest

from simbench.detectors.prepared import prepare, thin_record
from simbench.detectors.record import LoopRecord
from simbench.detectors.signal.oscillation import Oscillation

N = 1200
K = np.arange(N)


def record(gate, **more):
    """OP and PV swing with a period of 40 where the gate is open; elsewhere they take a few big
    steps.
    """
    rng = np.random.default_rng(5)
    noise, rest = 0.02 * rng.standard_normal((2, N))
    wander = np.select(
        [K % 600 < 110, K % 600 < 150, K % 600 < 420, K % 600 < 510], [0.0, 9.0, -6.0, 4.0], -2.0
    )
    swing = np.where(gate, np.sin(2 * np.pi * K / 40), wander)
    delayed = np.where(gate, np.cos(2 * np.pi * K / 40), -wander)
    return LoopRecord(op=50 + 5 * swing + noise, pv=10 + delayed + rest, Ts=2.0, **more)


@pytest.mark.parametrize(
    ("gate", "part"),
    [
        (K >= 600, (600, 1200)),
        (
            (K >= 300) & (K < 900),
            (304, 904),
        ),  # at samples that a record eight times as sparse has too
        (K < 600, (0, 600)),
        (K >= 0, None),
        (K < 0, None),
    ],
)
def test_the_half_that_oscillates_is_judged_where_the_whole_does_not(gate, part):
    prepared = prepare(record(gate))
    assert prepared.part == part
    assert prepared.oscillation.sustained == gate.any()
    if gate.any():
        assert prepared.oscillation.period_s == pytest.approx(80.0, rel=0.02)


@pytest.mark.parametrize(("fall", "judged"), [(0.45, False), (0.7, True)])
def test_in_a_half_an_amplitude_may_fall_no_faster_than_in_a_whole(fall, judged):
    """From the first to the last third of the half, whose middles are 400 samples apart; 3 ** -0.5
    = .577 is allowed.
    """
    swing = np.where(K < 600, fall ** (K / 400) * np.sin(2 * np.pi * K / 20), 0.0)
    noise = 0.01 * np.random.default_rng(1).standard_normal(N)
    assert (
        prepare(LoopRecord(op=swing + noise, pv=swing + noise, Ts=1.0)).part == (0, 600)
    ) == judged


def test_a_half_that_would_change_the_unit_of_s_is_left_alone():
    """OP in % that happens to stay within 0..1 in the half that oscillates: there it would look
    like a share.
    """
    swing = record(K >= 600)
    op = np.where(K >= 600, 0.5 + 0.05 * (swing.op - 50.0), 30 + 10 * (swing.op - 50.0))
    assert prepare(LoopRecord(op=np.clip(op, 0.0, 100.0), pv=swing.pv, Ts=2.0)).part is None


@pytest.mark.parametrize(
    ("seen", "sustained"), [({8.0}, False), ({16.0}, True), ({8.0, 16.0}, True), ({32.0}, True)]
)
def test_whether_a_dense_record_oscillates_is_asked_at_the_density_that_is_judged(
    monkeypatch, seen, sustained
):
    """An oscillation of 2935 s, seen at some samplings only, is judged at one sample of 16 s,
    however dense the record came.
    """

    def oscillation_of(op, pv, Ts):
        return Oscillation(Ts in seen, 1.2, 2935.0, lasting=1.0)

    monkeypatch.setattr("simbench.detectors.prepared.find_oscillation", oscillation_of)
    swing = np.sin(2 * np.pi * np.arange(40_000) / 2500)
    dense = LoopRecord(op=swing, pv=-swing, Ts=1.0)
    for k in (1, 2, 4, 8):
        assert prepare(thin_record(dense, k)).oscillation.sustained == sustained, k
