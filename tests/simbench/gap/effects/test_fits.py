"""What each effect's fit is begun from, tried on and paid for: an engine that notes what it is
asked.
"""

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
