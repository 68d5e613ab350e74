"""What each effect's fit is begun from, tried on and paid for: an engine that notes what it is
asked.
"""

from math import comb, log

import numpy as np
import pytest

from simbench.detectors.signal.filters import lfilter
from simbench.gap.effects import load_steps, recogniser
from simbench.gap.likelihood import kernels
from simbench.gap.likelihood.engine import Engine as RealEngine
from simbench.gap.likelihood.model import Data, Fit, Spec

THETA = {
    "T": 20.0,
    "Td": 4.0,
    "load_time": 30.0,
    "load_lag": 1.0,
    "load": 2.0,
    "noise_std": 0.1,
    "colour": 0.1,
}
IDLE = {"load": 9.0, "load_time": 8.0}  # what an idle valve needs
N = 1000


class Engine:
    """Notes what is fitted; the likelihood is `height` of the spec and the parameters."""

    longest_load = 60.0

    def __init__(self, height=lambda spec, theta: 0.0, **more):
        y = np.resize([3.0, -3.0], N)
        given = {
            "u": np.linspace(40.0, 60.0, N),
            "y": y,
            "K": 2.0,
            "T": 25.0,
            "Td": 5.0,
            "noise": 0.2,
        }
        self.data, self.height, self.fitted, self.gridded, self.scanned = (
            Data(**given | more),
            height,
            [],
            [],
            [],
        )

    def at(self, spec, theta):
        return Fit(spec, float(self.height(spec, theta)), dict(theta), np.ones(4), np.zeros(N))

    def fit(self, spec, theta, search=None, steps=10):
        if spec.valve == kernels.PLAY and theta.get("S", 0.0) > 25.0:
            # a band that OP never leaves
            return self.at(spec, {**theta, **IDLE})
        self.fitted.append((dict(theta), search, steps))
        return self.at(spec, theta)

    def grid(self, spec, theta, points):
        self.gridded.append((dict(theta), points))
        return sorted((self.at(spec, {**theta, **p}) for p in points), key=lambda f: -f.loglik)

    def scan(self, spec, theta, kind, points):
        self.scanned.append((kind, points))
        return -np.abs(np.log(points[:, 0] / 5.0))

    def bounds(self, spec, name):
        return (1.5, 9.0)

    def start(self):
        return {"load": 0.7, "load_time": 18.0, "noise_std": 0.3}

    def begun(self, name, **having):
        """Return the values of a parameter that fits were begun from."""
        return [t[name] for t, _, _ in self.fitted if all(t[k] == v for k, v in having.items())]


def base(**more):
    return Fit(Spec(), 0.0, THETA | more, np.ones(4), np.zeros(N))


def fit(effect, engine, start=None):
    best, price = recogniser(effect).fit(engine, start or base())
    return best, price


def near(name, value):
    """Return a likelihood that falls off in the logarithm of a parameter."""
    return lambda spec, theta: (
        -abs(np.log(max(theta[name], 1e-9) / value)) if name in theta else -99.0
    )


def test_a_released_gain_is_begun_under_two_loads():
    engine = Engine(lambda spec, theta: -abs(theta["load"] - 0.6))
    best, price = fit("gain_mismatch", engine)
    assert engine.begun("load") == pytest.approx([2.0, 0.6])
    assert (best.theta["load"], price) == (pytest.approx(0.6), 1.0)
    assert best.spec.free == {"K"}


@pytest.mark.parametrize(("effect", "name", "values", "on", "price"), [
    ("time_constant_mismatch", "T", (8.0, 14.0, 70.0), {"free": {"T"}}, 1.0),
    ("dead_time_mismatch", "Td", (1.0, 3.0, 10.0, 45.0), {"free": {"Td"}}, 1.0),
    ("valve_lag", "tau", (0.4, 5.0, 80.0), {"pole": "valve"}, 1.0),
    ("extra_lag", "tau", (0.4, 5.0, 80.0), {"pole": "extra"}, 1.0),
    ("sensor_lag", "tau", (0.4, 5.0, 80.0), {"pole": "sensor"}, 1.0),
    ("drift", "walk", (0.001, 0.05, 0.2), {"walk": True}, 3.0),
    ("valve_characteristic", "R", (0.03, 0.4, 3.0, 40.0), {"valve": kernels.CURVE}, 1.0),
])  # fmt: skip
def test_a_number_is_sought_over_all_that_a_record_could_show(effect, name, values, on, price):
    for value in values:
        best, paid = fit(effect, Engine(near(name, value)))
        # the stub refines nothing: the best of the values that are tried
        assert abs(np.log(best.theta[name] / value)) < np.log(3.2), value
        assert {key: getattr(best.spec, key) for key in on} == on
        assert paid == price


@pytest.mark.parametrize(
    ("effect", "begun"), [("sensor_lag", (0.2, 0.2)), ("valve_lag", (0.1, 0.1))]
)
def test_a_filter_is_begun_from_the_stated_noise_and_little_colour(effect, begun):
    engine = Engine(near("tau", 5.0))
    fit(effect, engine)
    ((theta, _),) = engine.gridded
    assert (theta["noise_std"], theta["colour"]) == begun


def test_a_released_noise_is_begun_from_twice_the_stated_and_less_is_dear():
    engine = Engine(lambda spec, theta: theta["noise_std"])
    best, price = fit("noise", engine)
    assert [(t["noise_std"], t["colour"], t["load"]) for t, _, _ in engine.fitted] == [
        (0.1, 0.1, 2.0), (0.4, 0.05, 2.0), (0.4, 0.1, 0.7),
    ]  # fmt: skip
    assert (best.theta["noise_std"], price, best.spec.free) == (0.4, 1.0, {"noise_std"})
    assert fit("noise", Engine(lambda spec, theta: -theta["noise_std"]))[1] == 4.0
    bare = Engine(noise=0.0)
    assert fit("noise", bare)[1] == 1.0
    assert len(bare.fitted) == 1


def test_a_drift_ramps_but_a_vessels_balance_is_a_ramp_already():
    best, _ = fit("drift", Engine())
    bend, ramp = (channel[[0, 333, -1]] for channel in best.spec.channels)
    assert ramp == pytest.approx([0.0, 1 / 3, 1.0])
    assert bend == pytest.approx([0.0, 8 / 9, 0.0])
    best, price = fit("drift", Engine(T=0.0))
    assert (best.spec.channels, price) == ((), 1.0)


@pytest.mark.parametrize(("effect", "kind", "count", "ratios", "price"), [
    # how many sizes are tried, and the second number over the first: where in its band MV began,
    # or the jump; of a dead zone the least and the largest centre
    ("deadband", kernels.PLAY, 42, [-0.5, 0.0, 0.5], 1.0),
    ("stiction", kernels.CREEP, 100, [0.06, 0.15, 0.27, 0.42, 0.6, 0.78, 0.95], 2.5),
    ("deadzone", kernels.ZONE, 22, None, 2.0),
])  # fmt: skip
def test_valve_maps_are_scanned_from_next_to_none_to_beyond_ops_range(
    effect, kind, count, ratios, price
):
    engine = Engine(lambda spec, theta: 50.0 + (spec.valve == kernels.CREEP))
    best, paid = fit(effect, engine)
    assert (best.spec.valve, paid) == (kind, price)
    points = next(p for k, p in engine.scanned if k == kind)
    sizes = np.unique(points[:, 0])
    # OP's inner range is 19.8 %
    assert (len(sizes), *sizes[[0, -1]]) == pytest.approx((count, 0.0198, 23.76))
    if ratios:
        assert np.unique(np.round(points[:, 1] / points[:, 0], 9)) == pytest.approx(ratios)
    else:
        assert np.unique(np.round(points[:, 1], 9)) == pytest.approx(np.linspace(40.2, 59.8, 13))


class Jumpy(Engine):
    """An engine whose load jumps: so many jumps bring so many nats each, and further ones
    nothing.
    """

    spread = 10.0
    noise_model = RealEngine.noise_model

    def __init__(self, real, worth):
        super().__init__()
        self.real, self.worth = real, worth

    def evaluate(self, spec, theta):
        return self.worth * min(len(spec.jumps), self.real)

    def fit(self, spec, theta, search=None, steps=10):
        self.fitted.append((dict(theta), search, steps))
        return Fit(spec, self.evaluate(spec, theta), dict(theta), np.ones(3), RESIDUAL)


RESIDUAL = np.random.default_rng(0).standard_normal(N)


def test_jumps_that_are_worth_nothing_with_the_others_are_taken_out_again():
    n, start = 1000, Fit(Spec(), 0.0, THETA, np.ones(3), RESIDUAL)
    real = set(load_steps._jumps(Jumpy(0, 0.0), start)[0][2:12:4])

    class Placed(Jumpy):
        def evaluate(self, spec, theta):
            return 50.0 * len(real & set(spec.jumps))

    best, price = fit("load_steps", Placed(0, 0.0), start)
    assert set(best.spec.jumps) == real
    assert price == pytest.approx(log(comb(n, 3)) / (0.5 * log(n)) + 1.0)


@pytest.mark.parametrize(("real", "worth", "count"), [
    # sixteen places of a thousand can be picked in e^79.7 ways, 4.98 nats a jump; half as many are
    # tried each time
    (0, 0.0, 0), (16, 3.0, 0), (16, 5.1, 16), (1, 100.0, 16), (1, 50.0, 8),
])  # fmt: skip
def test_jumps_are_added_while_they_pay_for_themselves(real, worth, count):
    engine = Jumpy(real, worth)
    best, price = fit("load_steps", engine, Fit(Spec(), 0.0, THETA, np.ones(3), RESIDUAL))
    # the same innovations show the same sixteen places again
    assert len(best.spec.jumps) == count
    # and their one std is a number of its own
    assert price == pytest.approx(log(comb(N, count)) / (0.5 * np.log(N)) + 1.0)
    # a load that only had to make the jumps gives way
    assert engine.fitted[0][0]["load"] == pytest.approx(0.7 * 2.0)


@pytest.mark.parametrize("fade", [True, False])
def test_kicks_of_the_load_are_told_from_steps(fade):
    n, T, rng = 2000, 8.0, np.random.default_rng(11)
    keep, places = np.exp(-1.0 / 25.0), np.arange(150, n, 210)
    heights = np.zeros(n)
    heights[places] = 6.0 * rng.choice([-1.0, 1.0], places.size)
    if fade:
        load = lfilter([1.0], [1.0, -keep], heights + 0.1 * rng.standard_normal(n))
    else:
        load = 0.5 * np.cumsum(heights) + lfilter([0.1], [1.0, -keep], rng.standard_normal(n))
    u, a = 50.0 + np.cumsum(0.1 * rng.standard_normal(n)), np.exp(-1.0 / T)
    y = lfilter([0.0, 1.0 - a], [1.0, -a], u - 50.0 + load) + 0.1 * rng.standard_normal(n)
    engine = RealEngine(Data(u, y, K=1.0, T=T, Td=0.0, noise=0.1), 40.0)
    found = load_steps.fit(engine, engine.base())[0]
    assert found.spec.jumps
    assert found.spec.fade == fade
