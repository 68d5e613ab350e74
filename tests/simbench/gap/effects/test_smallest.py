"""The smallest size that would have shown: the first step that costs nine nats, in the units it is
said in.
"""

from types import SimpleNamespace

import numpy as np
import pytest

from simbench.gap.effects import recogniser
from simbench.gap.effects._smallest import Probe
from simbench.gap.likelihood.model import Spec

THETA = {"T": 20.0, "Td": 4.0, "noise_std": 0.1}
STEPS = np.geomspace(0.02, 2.0, 14)


def probe(name, unit, from_=0.0, T=20.0, Td=4.0):
    """Return a probe in a record whose likelihood falls by 90 nats for every `unit` that a number
    is off `from_`.
    """

    def evaluate(spec, theta):
        return -90.0 * abs(theta.get(name, from_) - from_) / unit

    data = SimpleNamespace(
        T=T,
        Td=Td,
        n=1000,
        noise=0.1,
        u=np.linspace(40.0, 60.0, 1000),
        y=np.linspace(-1.0, 1.0, 1000),
    )
    residual = np.resize([1.0, -1.0], 1000)
    base = SimpleNamespace(spec=Spec(), theta=THETA, residual=residual)
    samples = SimpleNamespace(resolution=0.01)
    situation = SimpleNamespace(
        record=SimpleNamespace(Ts=2.0, pv=data.y),
        samples=samples,
        sp=np.zeros(1000),
        law=SimpleNamespace(known=True),
    )
    return Probe(SimpleNamespace(evaluate=evaluate, data=data), base, situation)


def first(share):
    """Return the first step tried beyond a share."""
    return float(STEPS[STEPS > share][0])


@pytest.mark.parametrize("unit", [0.5, 2.0, 8.0])
@pytest.mark.parametrize(
    ("effect", "name", "from_", "scale", "unit_size", "words"),
    [
        # a band is tried as shares of OP's range of 20 %, a pole of five time constants, a factor
        # of the number itself
        ("valve_lag", "tau", 0.0, 100.0, 200.0, "s"),
        ("extra_lag", "tau", 0.0, 100.0, 200.0, "s"),
        ("sensor_lag", "tau", 0.0, 100.0, 200.0, "s"),
        ("dead_time_mismatch", "Td", 4.0, 5.0, 10.0, "s"),
    ],
)
def test_the_first_step_that_costs_nine_nats_is_the_size(
    effect, name, from_, scale, unit_size, words, unit
):
    size, printed = recogniser(effect).smallest(probe(name, unit, from_))
    assert printed == words
    # nine of ninety nats: a tenth of the unit
    assert size == pytest.approx(unit_size * first(0.1 * unit / scale))


def test_what_no_size_shows_is_infinite():
    assert probe("tau", 1e9).pole("extra") == (np.inf, "s")


def test_sizes_that_need_no_likelihood():
    bare = probe("S", 1.0)
    assert recogniser("outliers").smallest(bare) == (pytest.approx(0.4), "PV units")
    assert recogniser("quantisation").smallest(bare) == (pytest.approx(0.2), "PV units")
    # a fifth of the errors of -1 .. 1 lie within 0.2
    assert recogniser("error_deadband").smallest(bare) == (pytest.approx(0.4, abs=0.01), "PV units")
    assert recogniser("detuning").smallest(bare)[0] == pytest.approx(np.exp(0.13), rel=2e-3)
    bare.situation.law.known = False
    assert (
        recogniser("detuning").smallest(bare) is recogniser("error_deadband").smallest(bare) is None
    )


@pytest.mark.parametrize("unit", [0.1, 0.5])
def test_walks_and_characteristics_are_forced_on_in_their_units(unit):
    spread = float(np.std(np.linspace(-1.0, 1.0, 1000)))
    size, _ = recogniser("drift").smallest(probe("walk", unit / np.sqrt(1000.0)))
    assert size == pytest.approx(spread * first(0.1 * unit / spread))
    size, _ = recogniser("valve_characteristic").smallest(probe("R", 10.0 * unit, 1.0))
    assert size == pytest.approx(np.exp(3.0 * first(np.log(1.0 + unit) / 3.0)))
