"""The search for hard negatives: healthy by construction, repeatable."""

import numpy as np
import pytest

from simbench.bench.scenario.resolve import sampled_ultimate_gain
from simbench.bench.worst import (
    KEYS,
    OPTION_SHARES,
    OSCILLATING,
    RANGES,
    healthy_loop,
    worst,
)
from simbench.detectors.errors import UserError
from simbench.loop.parameters import VALVES
from simbench.loop.simulate import simulate


def test_every_point_of_the_search_is_a_loop_with_a_frictionless_valve():
    rng = np.random.default_rng(0)
    seen = set()
    for _ in range(60):
        loop = healthy_loop(
            dict(zip(KEYS, rng.random(len(KEYS)))), ("self-regulating", "integrating")
        )
        assert not VALVES.load(loop.valve.name).FRICTION
        seen |= {
            loop.plant.type,
            loop.valve.name,
            *(d.name for d in loop.disturbance),
            *(e.name for e in loop.effect),
        }
    assert {
        "integrating",
        "foptd",
        "gain_ratio",
        "propagated",
        "sine",
        "quantisation",
        "saturation",
    } <= seen


def test_the_corners_of_the_search_are_loops_too():
    for corner in (0.0, 1 - 1e-9):
        simulate(healthy_loop(dict.fromkeys(KEYS, corner), ("integrating",)))


@pytest.mark.parametrize("seed", range(25))
def test_a_point_is_the_loop_its_numbers_say(seed):
    at = dict(zip(KEYS, np.random.default_rng(seed).random(len(KEYS))))
    loop = healthy_loop(at, ("self-regulating", "integrating"))
    x = {key: lo * (hi / lo) ** at[key] for key, (lo, hi) in RANGES.items()}
    on = {key: at[key] < share for key, share in OPTION_SHARES.items()}
    assert (loop.plant.type == "integrating") == (at["process"] >= 0.5)
    T = 10.0
    assert loop.plant.Td == pytest.approx(x["Td_over_T"] * T, rel=1e-2)
    assert (loop.controller.type == "P") == on["P"]
    if not on["P"]:
        assert loop.controller.Ti == pytest.approx(x["Ti"] * T, rel=1e-2)
    assert loop.controller.Kc == pytest.approx(x["gain"] * sampled_ultimate_gain(loop), rel=1e-2)
    load = loop.disturbance[0] if loop.disturbance else None
    period = loop.sampling.Ts * x["samples_per_period"]
    outside = load is not None and load.name in OSCILLATING
    assert period == pytest.approx(
        x["period"] * (T + 2 * loop.plant.Td) if outside else 4 * loop.plant.Td + T, rel=1e-2
    )
    assert loop.sampling.n == pytest.approx(x["samples_per_period"] * x["periods"], rel=1e-2)
    assert loop.noise.std == pytest.approx(
        x["noise"] * x["amplitude"] if on["noisy"] else 0.0, rel=1e-2
    )
    effects = {e.name: e.parameters for e in loop.effect}
    assert ("quantisation" in effects, "saturation" in effects) == (on["coarse"], on["limited"])
    if on["coarse"]:
        assert effects["quantisation"]["step"] == pytest.approx(
            x["quantum"] * x["amplitude"], rel=1e-2
        )
    if on["limited"]:
        ends = effects["saturation"]["lo"], effects["saturation"]["hi"]
        assert ends == pytest.approx((50 - x["limit"], 50 + x["limit"]), rel=1e-2)
    assert (loop.valve.name == "gain_ratio") == on["curved"]
    stepped = bool(loop.setpoint.steps)
    assert stepped == (on["stepped"] or load is None)
    if stepped:
        assert loop.setpoint.steps[0][1] - loop.setpoint.value == pytest.approx(x["step"], rel=1e-2)
    if load is not None:
        assert load.parameters["amplitude"] == pytest.approx(x["amplitude"], rel=1e-2)
        assert load.parameters["at"] == ("input" if on["input"] else "output")
        if load.name == "propagated":
            assert load.parameters["J"] == pytest.approx(5 * x["J_over_S"], rel=1e-2)
            assert load.parameters["lag"] == pytest.approx(x["lag"] * period, rel=1e-2)


def test_the_search_is_repeatable():
    assert (
        worst("horch", budget=25, seed=1).to_toml() == worst("horch", budget=25, seed=1).to_toml()
    )


def test_a_method_that_cries_stiction_is_caught(monkeypatch):
    from simbench.bench import worst as module

    def eager(record, names):
        from simbench.detectors.verdict import Verdict

        return [Verdict(names[0], "stiction", score=float(np.std(record.pv)), reason="always")]

    monkeypatch.setattr(module, "judge", eager)
    case = worst("horch", budget=30)
    assert case.fooled == case.drawn == 18
    assert case.score == float(np.std(simulate(case.loop, case.seed).record.pv))


def test_wrong_requests_are_refused():
    with pytest.raises(UserError, match="horch"):
        worst("hroch", budget=1)
    with pytest.raises(UserError, match="budget"):
        worst("horch", budget=0)
