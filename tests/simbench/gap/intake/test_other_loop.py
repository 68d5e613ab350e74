"""The plant that the record shows, and when it makes the baseline another loop's."""

from types import SimpleNamespace

import numpy as np
import pytest

from detectors.errors import RecordError
from simbench.gap.controller.pi_law import Law
from simbench.gap.intake import other_loop
from simbench.gap.intake.other_loop import _plant_of_record, refuse_other_plant
from simbench.gap.likelihood import kernels
from simbench.gap.likelihood.engine import Engine
from simbench.gap.likelihood.model import Data


def answered(K, T, Td, n=1500):
    """Return OP, and PV as a plant answers it, with a little noise and load."""
    rng = np.random.default_rng(3)
    u = 50.0 + np.repeat(rng.choice([-3.0, 3.0], n // 25), 25)
    return u, K * kernels.plant(u, T, Td, 0.0) + 0.05 * rng.standard_normal(n)


@pytest.mark.parametrize(
    ("T", "Td", "Ti", "stated"),
    [(30.0, 6.0, 60.0, 10.0), (6.0, 2.0, np.inf, 90.0), (20.0, 4.0, 5.0, 20.0)],
)
def test_the_plant_of_the_record_is_fitted_whatever_the_baseline_states(T, Td, Ti, stated):
    u, y = answered(-1.7, T, Td)
    # stated: a gain of a fifth, another time constant, noise and trust that do not count
    data = Data(u, y, -0.34, stated, 0.0, 5.0)
    engine, fit = _plant_of_record(data, Law(0.0, 0.0, 1.0, Ti), 2.0)
    assert fit.K == pytest.approx(-1.7, rel=0.03)
    assert fit.theta["T"] == pytest.approx(T, rel=0.05)
    assert fit.theta["Td"] == pytest.approx(Td, abs=0.2)
    assert not engine.data.trusted
    assert engine.data.noise == 0.0


def begun(monkeypatch, law, n=1600, T=12.0):
    """Return the plants, and the longest loads, from which a record's plant is sought."""
    seen = []

    class Noted(Engine):
        def __init__(self, data, longest_load):
            super().__init__(data, longest_load)
            seen.append((data.T, data.Td, longest_load))

        def fit(self, spec, start, search=None, steps=10):
            return self.at(spec, start)

    monkeypatch.setattr(other_loop, "Engine", Noted)
    u, y = answered(1.0, 12.0, 3.0, n)
    _plant_of_record(Data(u, y, 1.0, T, 3.0, 0.1), law, 2.0)
    return seen


@pytest.mark.parametrize(
    ("Ti", "T", "lags"),
    [
        (60.0, 12.0, (30.0, 12.0, 8.0)),
        (np.inf, 2.0, (20.0, 5.0, 8.0)),
        (1e6, 1e6, (100.0, 100.0, 8.0)),
        (2.0, 12.0, (2.0, 12.0, 8.0)),
    ],
)
def test_it_is_looked_for_from_the_integral_time_the_stated_lag_and_a_quick_one(
    monkeypatch, Ti, T, lags
):
    seen = begun(monkeypatch, Law(0.0, 0.0, 1.0, Ti), T=T)
    assert [lag for lag, _, _ in seen] == pytest.approx(lags)
    wanted = (1.0 if Ti == 2.0 else Ti / 2.0) if np.isfinite(Ti) else 20.0
    assert [wait for _, wait, _ in seen] == pytest.approx([0.2 * wanted, 0.2 * max(T, 5.0), 1.6])
    assert [load for _, _, load in seen] == pytest.approx(
        [4.0 * (lag + wait) for lag, wait, _ in seen]
    )


def situation(data):
    control = SimpleNamespace(Kc=1.0, Ti=20.0, sign=1)
    return SimpleNamespace(
        data=data, law=Law(0.0, 0.0, 2.0, 40.0, tuning=(2.0, 2.0)), record=SimpleNamespace(Ts=1.0),
        baseline=SimpleNamespace(controller=control), where="record 'FIC1'",
    )  # fmt: skip


@pytest.mark.parametrize(("gain", "refused"), [(955.0, True), (965.0, False)])
def test_one_effect_that_does_nearly_as_well_on_the_baselines_plant_is_enough(
    monkeypatch, gain, refused
):
    plant = SimpleNamespace(K=3.0, theta={"T": 60.0, "Td": 4.0}, loglik=1000.0)
    base = SimpleNamespace(loglik=0.0)
    tried, loads = [], []

    def fit_candidates(engine, start, effects):
        tried.extend(effects)
        # thirty nats, and three numbers of a thousand samples: 40.4
        return {
            e: SimpleNamespace(log_likelihood_gain=gain if e == "stiction" else 0.0)
            for e in effects
        }

    monkeypatch.setattr(
        other_loop, "_plant_of_record", lambda *a: (SimpleNamespace(base=lambda: base), plant)
    )
    monkeypatch.setattr(
        other_loop,
        "Engine",
        lambda data, load: loads.append(load) or SimpleNamespace(base=lambda: base),
    )
    monkeypatch.setattr(
        other_loop, "possible_effects", lambda s: ["noise", "gain_mismatch", "stiction", "drift"]
    )
    monkeypatch.setattr(other_loop, "fit_candidates", fit_candidates)
    s = situation(SimpleNamespace(K=1.0, T=20.0, Td=4.0, n=1000))
    if refused:
        with pytest.raises(RecordError) as caught:
            refuse_other_plant(s)
        ending = (
            "gain of 3 after 64 s, the baseline's Kc = 1, Ti = 20 s, K = 1 and 24 s; this is the"
            " baseline of another loop"
        )
        assert str(caught.value).endswith(ending)
        assert str(caught.value).startswith(
            "record 'FIC1': its controller has Kc = 2 and Ti = 40 s"
        )
    else:
        refuse_other_plant(s)
    # only what bends the plant's answer is asked, and under loads as long as the baseline's plant
    assert tried == ["gain_mismatch", "stiction"]
    assert loads == [100.0]


def test_the_plant_of_the_baseline_with_a_load_may_do_as_well(monkeypatch):
    plant = SimpleNamespace(K=3.0, theta={"T": 60.0, "Td": 4.0}, loglik=1000.0)
    monkeypatch.setattr(
        other_loop,
        "_plant_of_record",
        lambda *a: (SimpleNamespace(base=lambda: SimpleNamespace(loglik=0.0)), plant),
    )
    monkeypatch.setattr(
        other_loop, "Engine", lambda *a: SimpleNamespace(base=lambda: SimpleNamespace(loglik=960.0))
    )
    refuse_other_plant(situation(SimpleNamespace(K=1.0, T=20.0, Td=4.0, n=1000)))
