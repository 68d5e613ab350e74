"""Just inside and just outside: what units, lengths and tunings are refused."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from simbench.detectors.errors import RecordError
from simbench.detectors.record import LoopRecord
from simbench.gap.controller.law import Law
from simbench.gap.intake import other_loop
from simbench.gap.intake.archive import stands_out
from simbench.gap.intake.check import (
    refuse_op_units,
    refuse_other_pace,
    refuse_unfit,
)

SINE = np.sin(np.arange(600) / 20.0)
OP = 50.0 + 5.0 * SINE
LAW = Law(0.0, 1.0, 20.0)


def refusal(call, *args):
    """Return the refusal, "" where there is none."""
    try:
        call(*args)
    except RecordError as error:
        return str(error)
    return ""


@pytest.mark.parametrize(
    ("low", "high", "Kc", "Ti", "refused"),
    [
        (6.0, 18.0, 0.16, 20.0, True),
        (3.9, 20.4, 0.16, 20.0, True),
        (3.7, 18.0, 0.16, 20.0, False),
        (6.0, 20.6, 0.16, 20.0, False),
        (6.0, 18.0, 0.16 * 1.02, 20.0, True),
        (6.0, 18.0, 0.16 * 1.04, 20.0, False),
        (6.0, 18.0, 0.16, 20.8, True),
        (6.0, 18.0, 0.16, 21.2, False),
        (0.1, 0.9, 0.01, 20.0, True),
        (0.1, 1.1, 0.01, 20.0, False),
    ],
)
def test_op_in_another_unit_has_its_factor_and_its_range(low, high, Kc, Ti, refused):
    law = replace(LAW, Kc=Kc, Ti=Ti)
    assert (
        bool(refusal(refuse_op_units, np.linspace(low, high, 200), law, 1.0, 20.0, "record"))
        == refused
    )


@pytest.mark.parametrize(
    ("n", "refused"), [(99, True), (100, False), (50_000, False), (50_001, True)]
)
def test_records_have_a_least_and_a_largest_length(n, refused):
    x = np.random.default_rng(0).normal(50.0, 1.0, n)
    assert bool(refusal(refuse_unfit, LoopRecord(op=x, pv=x, Ts=1.0), "record")) == refused


@pytest.mark.parametrize(("ratio", "refused"), [
    (1.0, False), (9.5, False), (10.5, True), (1 / 9.5, False), (1 / 10.5, True), (-1.0, True),
])  # fmt: skip
def test_a_controller_ten_times_as_strong_is_another_loops(ratio, refused):
    law = replace(LAW, Kc=2.0 * ratio)
    assert bool(refusal(other_loop.refuse_other_controller, law, 2.0, "record")) == refused
    # nothing is told from a law that is not exact
    for more in ({"residual": 0.04}, {"gap": 0.1}, {"reason": "no law"}):
        vague = replace(law, **more)
        assert not refusal(other_loop.refuse_other_controller, vague, 2.0, "record")


def plant_refusal(monkeypatch, *, K=1.0, T=20.0, Td=4.0, plant, tuning=(2.0, 2.0), nats=1000.0):
    """Return the refusal where the record's plant is `plant` (gain, T, Td) and beats the
    baseline's by `nats`.
    """
    gain, lag, wait = plant
    fit = SimpleNamespace(K=gain, theta={"T": lag, "Td": wait}, loglik=nats)
    zero = SimpleNamespace(base=lambda: SimpleNamespace(loglik=0.0))
    monkeypatch.setattr(
        other_loop, "fit_plant", lambda *a: (SimpleNamespace(base=lambda: fit), fit)
    )
    monkeypatch.setattr(other_loop, "Engine", lambda *a: zero)
    monkeypatch.setattr(other_loop, "possible_effects", lambda s: [])
    data = SimpleNamespace(u=OP, y=OP, K=K, T=T, Td=Td, n=1000, resolution=0.0)
    control = SimpleNamespace(Kc=1.0, Ti=20.0, sign=1)
    s = SimpleNamespace(
        data=data, law=replace(LAW, tuning=tuning), record=SimpleNamespace(Ts=1.0),
        baseline=SimpleNamespace(controller=control), where="record",
    )  # fmt: skip
    return refusal(other_loop.refuse_other_plant, s)


@pytest.mark.parametrize(
    ("plant", "refused"),
    [
        ((1.6, 36.0, 4.0), True),
        ((1.4, 36.0, 4.0), False),
        ((1.6, 30.0, 4.0), False),
        ((0.6, 10.0, 4.0), True),
        ((-1.6, 36.0, 4.0), False),
    ],
)
def test_another_plant_differs_in_gain_and_in_time(monkeypatch, plant, refused):
    assert bool(plant_refusal(monkeypatch, plant=plant)) == refused


@pytest.mark.parametrize(("plant", "Td", "refused"), [
    ((0.4, 20.0, 2.0), 2.0, False), ((0.4, 20.0, 0.0), 0.0, False), ((0.4, 20.0, 2.9), 2.0, False),
    ((0.4, 20.0, 3.8), 2.0, True), ((0.64, 20.0, 2.0), 2.0, True), ((0.54, 20.0, 2.0), 2.0, False),
    ((0.6, 32.0, 9.0), 2.0, True), ((0.6, 34.0, 9.0), 2.0, False),
])  # fmt: skip
def test_another_vessel_differs_in_slope_or_in_dead_time(monkeypatch, plant, Td, refused):
    assert bool(plant_refusal(monkeypatch, K=0.02, T=0.0, Td=Td, plant=plant)) == refused


@pytest.mark.parametrize(
    ("tuning", "nats", "refused"),
    [
        ((2.0, 2.0), 43.0, True),
        ((2.0, 2.0), 38.0, False),
        ((1.4, 2.0), 1000.0, False),
        ((1.6, 1.4), 1000.0, False),
        ((1.6, 1.6), 1000.0, True),
        ((0.6, 0.6), 1000.0, True),
        (None, 1000.0, False),
    ],
)
def test_another_plant_is_asked_for_by_the_tuning_and_must_be_proven(
    monkeypatch, tuning, nats, refused
):
    # three numbers of a thousand samples cost 10.4 nats
    assert (
        bool(plant_refusal(monkeypatch, plant=(3.0, 60.0, 4.0), tuning=tuning, nats=nats))
        == refused
    )


@pytest.mark.parametrize(
    ("Ts", "refused"),
    [
        *((1.0, False), (1.008, False), (0.992, False), (1.012, True), (0.988, True)),
        *((2.01, False), (10.0, False), (0.5, True), (1.5, True), (11.0, True)),
    ],
)
def test_the_sampling_periods_agree_within_a_hundredth_or_one_is_a_few_times_the_other(Ts, refused):
    assert bool(refusal(refuse_other_pace, Ts, 1.0, "record")) == refused


@pytest.mark.parametrize(
    ("share", "high"),
    [(0.0, False), (0.45, False), (0.55, True), (1.0, True), (1.45, True), (1.55, False)],
)
def test_a_spike_exceeds_its_neighbours_by_about_its_height(share, high):
    pv, places = np.zeros(200), np.array([30, 90, 150])
    heights = np.array([2.0, -3.0, 4.0])
    pv[places] = share * heights
    assert stands_out(pv, places, heights) == high
    assert not stands_out(pv, places[:1], heights[:1])
