"""Which law is believed: spells of loud innovations are, loud samples at any time are not."""

from types import SimpleNamespace

import numpy as np
import pytest

from simbench.gap.discover import search

N, FIRST = 1500, 1000


def nats_of_spells(monkeypatch, residual):
    """Return the nats of a law of loud spells, 0 where none is believed."""
    monkeypatch.setattr(search, "of_load", lambda *innovations: False)
    theta = {"load": 0.0, "load_time": 1.0, "noise_std": 1.0}
    residual = residual / residual.std()
    found = search._loud(
        SimpleNamespace(record=SimpleNamespace(Ts=1.0)),
        SimpleNamespace(residual=residual[:FIRST], theta=theta),
        SimpleNamespace(residual=residual[FIRST:]),
        FIRST,
    )
    return 0.0 if found is None else found[0].nats


@pytest.mark.parametrize("seed", range(6))
def test_shots_at_any_time_are_no_spells(monkeypatch, seed):
    # weighed against innovations of one size alone, seed 3 would bring 42 nats
    rng = np.random.default_rng(seed)
    shots = (rng.random(N) < 0.05) * rng.standard_normal(N) * 4.0
    assert nats_of_spells(monkeypatch, rng.standard_normal(N) + shots) == 0.0


@pytest.mark.parametrize("seed", [1, 2, 4])
def test_loud_spells_are_recognised(monkeypatch, seed):
    rng = np.random.default_rng(seed)
    on = np.repeat(rng.random(N // 50) < 0.2, 50)
    assert nats_of_spells(monkeypatch, rng.standard_normal(N) * (1.0 + 2.0 * on)) > 20.0
