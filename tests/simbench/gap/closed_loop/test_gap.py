"""The gap's ruler: what is resolvable, and the share that closes."""

from types import SimpleNamespace

import pytest

from simbench.gap.closed_loop import gap
from simbench.gap.closed_loop.gap import closed_share


@pytest.mark.parametrize(
    ("before", "after", "share"),
    [
        (3.0, 0.2, 1.0),
        (3.0, 4.0, -0.5),
        (3.0, 99.0, -1.0),
        (5.0, 2.0, 0.75),
    ],
)
def test_the_share_that_closes_is_of_what_lies_above_the_floor(before, after, share):
    assert closed_share(before, after, 1.0) == pytest.approx(share)


@pytest.mark.parametrize(("n", "count"), [(1000, 64), (8000, 32), (10**6, 8)])
def test_the_shorter_a_record_the_more_often_its_loop_is_simulated(n, count, monkeypatch):
    asked = []
    monkeypatch.setattr(gap, "run_with_seeds", lambda loop, seed, count, kick: asked.append(count))
    assert gap.simulate_runs(SimpleNamespace(record=SimpleNamespace(n=n)), None, 0) is None
    assert asked == [count]
