"""Which test to do next: the one that separates the candidates, if any does."""

from types import SimpleNamespace

import numpy as np
import pytest

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
