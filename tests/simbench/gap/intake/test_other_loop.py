"""The plant that the record shows, and when it makes the baseline another loop's."""

from contextlib import nullcontext
from types import SimpleNamespace

import pytest

from simbench.detectors.errors import RecordError
from simbench.gap.controller.pi_law import Law
from simbench.gap.intake import other_loop
from simbench.gap.intake.other_loop import refuse_other_plant


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
        other_loop, "fit_plant", lambda *a: (SimpleNamespace(base=lambda: base), plant)
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
    control = SimpleNamespace(Kc=1.0, Ti=20.0, sign=1)
    s = SimpleNamespace(
        data=SimpleNamespace(u=None, y=None, K=1.0, T=20.0, Td=4.0, n=1000, resolution=0.0),
        law=Law(0.0, 2.0, 40.0, tuning=(2.0, 2.0)),
        record=SimpleNamespace(Ts=1.0),
        baseline=SimpleNamespace(controller=control),
        where="record 'FIC1'",
    )
    message = (
        "record 'FIC1': its controller has Kc = 2 and Ti = 40 s, .* gain of 3 after 64 s, the"
        " baseline's Kc = 1, Ti = 20 s, K = 1 and 24 s; this is the baseline of another loop"
    )
    with pytest.raises(RecordError, match=message) if refused else nullcontext():
        refuse_other_plant(s)
    # only what bends the plant's answer is asked, and under loads as long as the baseline's plant
    assert tried == ["gain_mismatch", "stiction"]
    assert loads == [100.0]
