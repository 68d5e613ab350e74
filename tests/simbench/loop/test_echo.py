"""Echoes: with nothing taken off the record is the sticky loop's; only corners are taken off."""

import numpy as np
import pytest

from simbench.bench.scenario.truth import NO, simulate_with_truth
from simbench.loop.simulate import simulate
from simbench.scenarios.spec import Loop

PLANTS = {
    "self-regulating": (
        {"type": "foptd", "K": 1.5, "T": 20.0, "Td": 5.0},
        {"type": "PI", "Kc": 1.0, "Ti": 20.0},
    ),
    "integrating": (
        {"type": "integrating", "K": 0.05, "Td": 2.0},
        {"type": "PI", "Kc": 2.0, "Ti": 60.0},
    ),
}
VALVES = {
    "choudhury": {"S": 5.0, "J": 2.0},
    "kano": {"S": 5.0, "J": 2.0},
    "he": {"fs": 4.0, "fd": 1.0},
    "deadband": {"S": 5.0},
}
ALL = 1e9  # a cut that takes nothing off


def loop(process="self-regulating", more=(), valve=None, **changes):
    plant, controller = PLANTS[process]
    table = {
        "plant": plant,
        "controller": controller,
        "sampling": {"Ts": 1.0, "n": 1500, "warm_up": 300},
        "noise": {"std": 0.05},
        "setpoint": {"value": 50.0, "steps": [[0.0, 53.0]]},
        "disturbance": [{"type": "sine", "amplitude": 0.5, "period": 300.0}, *more],
    }
    return Loop.from_table({**table, **({"valve": valve} if valve else {}), **changes})


def sticky(process="self-regulating", model="choudhury", **changes):
    return loop(process, valve={"model": model, **VALVES[model]}, **changes)


def echo(process="self-regulating", model="choudhury", own=None, changes=None, **numbers):
    load = {"type": "echo", "valve": model, **VALVES[model], **numbers}
    return loop(process, [load], own, **(changes or {}))


def load_of(seed=3, **numbers):
    """Return what an echo adds at the plant's input, the sine taken off."""
    run, without = simulate(echo(**numbers), seed), simulate(loop(), seed)
    return run.load_in, run.load_in - without.load_in + 0.0


def share_above(x, period, times):
    power = np.abs(np.fft.rfft((x - x.mean()) * np.hanning(x.size))) ** 2
    return power[np.fft.rfftfreq(x.size) > times / period].sum() / power.sum()


@pytest.mark.parametrize("own", [None, {"model": "gain_ratio", "R": 2.0}])
@pytest.mark.parametrize(("process", "model"), [
    ("self-regulating", "choudhury"), ("self-regulating", "kano"), ("self-regulating", "he"),
    ("integrating", "choudhury"), ("integrating", "deadband"),
])  # fmt: skip
def test_with_nothing_taken_off_the_healthy_record_is_the_sticky_one(process, model, own):
    donor = simulate(sticky(process, model), 3).record
    healthy = simulate(echo(process, model, own, cut=ALL), 3)
    assert not healthy.sticky
    if own is None:  # another characteristic rests at another OP
        assert np.abs(healthy.record.op - donor.op).max() < 1e-9
        assert np.abs(healthy.record.pv - donor.pv).max() < 1e-9
    else:
        assert np.std(healthy.record.pv) == pytest.approx(np.std(donor.pv), rel=0.1)


@pytest.mark.parametrize("kind", ["smooth", "harmonics", "propagated"])
def test_a_healthy_loop_moves_like_its_sticky_sibling_and_never_counts_as_sticky(kind):
    donor = simulate(sticky(), 3).record
    run, cycled = simulate_with_truth(echo(kind=kind), 3)
    assert np.std(run.record.op) == pytest.approx(np.std(donor.op), rel=0.1)
    assert cycled.answer == NO
    assert run.friction == (0.0, 0.0)


def test_what_is_taken_off_is_above_the_cut():
    period = 140.0  # of this loop's cycle, 20 reversals of MV in 1500 samples
    whole, smooth = load_of(cut=ALL)[1], load_of(cut=1.7)[1]
    assert share_above(whole, period, 2.5) > 0.01
    assert share_above(smooth, period, 2.5) < 1e-3
    shares = [share_above(load_of(cut=c)[1], period, 1.7) for c in (1.7, 2.5, 4.0, 6.0, ALL)]
    assert shares == sorted(shares)


def test_the_load_does_not_hang_on_where_the_record_begins():
    whole = simulate(echo(changes={"sampling": {"Ts": 1.0, "n": 1800}}), 3).record
    assert np.array_equal(whole.pv[300:], simulate(echo(), 3).record.pv)
