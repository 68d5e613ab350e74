"""Which test to do next: the one that separates the candidates, if any does."""

from types import SimpleNamespace

import numpy as np
import pytest

from scenarios.spec import Loop
from simbench.gap.closed_loop import next_test
from simbench.gap.closed_loop.next_test import PlantTest, choose


def asked(monkeypatch, separations, *, weights=(0.5, 0.5), **more):
    """Return what is chosen among tests under which the second candidate's one feature lies so far from the first's."""

    def run(far):
        # seeds 0, 1, 2: a standard deviation of 0.95, and 0.05 that keeps it off 0
        return lambda loop, du, dsp, seed: {"x": far * loop.place + 0.95 * (seed - 1)}

    tests = tuple(PlantTest(name, f"do {name} of {{dsp:.3g}}", run(far)) for name, far in separations.items())
    monkeypatch.setattr(next_test, "TESTS", tests)
    loops = {name: SimpleNamespace(place=float(i)) for i, name in enumerate(("drift", "noise", "stiction")[: len(weights)])}
    return choose(loops, dict(zip(loops, weights)), **{"mv": False, "law_known": True, "du": 2.0, "dsp": 1.5} | more)


def test_the_test_that_separates_most_is_named_with_its_size(monkeypatch):
    said, found = asked(monkeypatch, {"bump test": 2.0, "set-point step": 3.0})
    assert found == pytest.approx({"bump test": 2.0, "set-point step": 3.0})
    assert said == "set-point step: do set-point step of 1.5 (separates drift and noise by 3.0 standard deviations)"


@pytest.mark.parametrize(("far", "named"), [(0.0, False), (0.95, False), (1.05, True)])
def test_a_test_is_named_from_one_standard_deviation(monkeypatch, far, named):
    said, _ = asked(monkeypatch, {"bump test": far})
    assert said.startswith("bump test" if named else "a longer record")


def test_one_absurd_feature_counts_as_eight_and_mv_is_asked_for_once(monkeypatch):
    tests = {"record MV": 100.0, "bump test": 7.9}
    assert asked(monkeypatch, tests)[1] == pytest.approx({"record MV": 8.0, "bump test": 7.9})
    assert asked(monkeypatch, tests, mv=True)[1] == pytest.approx({"bump test": 7.9})


def test_separations_are_weighed_by_probability_and_raw_data_come_first(monkeypatch):
    # pairs one apart weigh 0.5 x 0.3 and 0.3 x 0.2, the pair two apart 0.5 x 0.2
    said, found = asked(monkeypatch, {"bump test": 2.0}, weights=(0.5, 0.3, 0.2))
    assert found["bump test"] == pytest.approx((0.15 * 2 + 0.06 * 2 + 0.1 * 4) / 0.31)
    assert "drift and noise and stiction" in said
    assert asked(monkeypatch, {"bump test": 2.0}, law_known=False)[0].startswith("raw instead of archived data")


def test_a_test_that_no_loop_can_run_is_left_out(monkeypatch):
    assert asked(monkeypatch, {"bump test": np.nan, "set-point step": 2.0})[1] == pytest.approx({"set-point step": 2.0})


QUIET = Loop.from_table({
    "plant": {"type": "foptd", "K": 1.5, "T": 60.0, "Td": 0.0}, "controller": {"type": "PI", "Kc": 0.5, "Ti": 60.0},
    "sampling": {"Ts": 1.0, "n": 4000}, "setpoint": {"value": 50.0},
})  # fmt: skip


@pytest.mark.parametrize("du", [2.0, 4.0])
def test_a_bump_in_manual_shows_the_plants_step_response_over_five_hundred_samples(du):
    found = next_test._bump(QUIET, du, 1.0, 0)
    edges = np.linspace(0.0, 500.0, 13)
    part = 500.0 / 12
    expected = 1.5 * (1.0 - 60.0 / part * (np.exp(-edges[:-1] / 60.0) - np.exp(-edges[1:] / 60.0)))
    assert [found[f"bump {i}"] for i in range(12)] == pytest.approx(expected, abs=0.03)


def test_the_other_tests_change_what_they_say(monkeypatch):
    seen = []
    monkeypatch.setattr(next_test, "features", lambda op, pv, sp: seen.append((op, pv, sp)) or {"pv x": 0.0, "op x": 0.0})
    next_test._sp_step(QUIET, 2.0, 3.0, 0)
    next_test._gain_change(QUIET, 2.0, 3.0, 0)
    next_test._faster(QUIET, 2.0, 3.0, 0)
    found = next_test._with_mv(QUIET, 2.0, 3.0, 0)
    step, gain, faster, mv = seen
    assert [len(op) for op, _, _ in seen] == [1500] * 4
    assert [float(step[2][k]) for k in (299, 301, 749, 751, 1199, 1201)] == [50.0, 53.0, 53.0, 47.0, 47.0, 50.0]
    assert np.ptp(gain[2]) == np.ptp(faster[2]) == 0.0
    assert mv[1] == pytest.approx(mv[0])
    assert found["mv off"] == pytest.approx(np.log(1e-3))
    assert (found["mv mean"], set(found)) == (pytest.approx(0.0), {"mv pv x", "mv off", "mv mean"})


def test_half_the_gain_and_a_quarter_of_the_period_are_simulated(monkeypatch):
    loops = []
    resolve = next_test.resolve_loop
    monkeypatch.setattr(next_test, "resolve_loop", lambda loop, seed: loops.append(loop) or resolve(loop, seed))
    next_test._gain_change(QUIET, 2.0, 3.0, 0)
    next_test._faster(QUIET, 2.0, 3.0, 0)
    assert loops[0].controller.Kc == pytest.approx(0.25)
    assert loops[1].sampling.Ts == pytest.approx(0.25)
