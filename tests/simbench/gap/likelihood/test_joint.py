"""Several records as one model: what one record says stays, what two say adds up, and no record's
bias is another's.
"""

import numpy as np
import pytest

from simbench.gap.likelihood import kernels
from simbench.gap.likelihood.engine import Engine
from simbench.gap.likelihood.joint import JointEngine, JointPart
from simbench.gap.likelihood.model import Data, Spec

THETA = {
    "T": 10.0,
    "Td": 2.0,
    "load_time": 8.0,
    "load_lag": 0.2,
    "load": 0.4,
    "noise_std": 0.1,
    "colour": 0.05,
}


def data(seed, n=300, base=50.0, T=10.0, pace=1, K=1.5):
    rng = np.random.default_rng(seed)
    u = base + np.repeat(rng.uniform(-5, 5, n // (30 * pace) + 1), 30 * pace)[:n]
    y = 20.0 + base + K * kernels.plant(u, T * pace, 2.0 * pace, 0.0) + 0.1 * rng.standard_normal(n)
    return Data(u, y, 1.5, T, 2.0, 0.1)


RAMP = Spec(channels=(np.linspace(0, 1, 300),))


@pytest.mark.parametrize("spec", [Spec(), Spec(valve=kernels.PLAY), Spec(pole="extra"), RAMP])
def test_one_record_alone_is_judged_as_ever(spec):
    theta = THETA | {"S": 1.0, "tau": 3.0}
    one, joint = Engine(data(1), 40.0), JointEngine([JointPart(data(1))], 40.0)
    assert joint.evaluate(spec, theta) == pytest.approx(one.evaluate(spec, theta), abs=1e-6)
    points = np.array([(1.0, 0.0, 0.0), (3.0, 0.5, 0.0)])
    np.testing.assert_allclose(
        joint.scan(spec, theta, kernels.PLAY, points), one.scan(spec, theta, kernels.PLAY, points)
    )


def test_evidence_of_two_records_of_one_loop_adds_and_of_another_plant_does_not():
    same, other = [data(1), data(2, base=30.0)], [data(1), data(2, base=30.0, K=3.0)]
    apart = sum(Engine(d, 40.0).evaluate(Spec(), THETA) for d in same)
    assert JointEngine([JointPart(d) for d in same], 40.0).evaluate(Spec(), THETA) == pytest.approx(
        apart, abs=5.0
    )
    loss = sum(Engine(d, 40.0).evaluate(Spec(free=frozenset({"K"})), THETA) for d in other)
    assert (
        JointEngine([JointPart(d) for d in other], 40.0).evaluate(
            Spec(free=frozenset({"K"})), THETA
        )
        < loss - 100.0
    )


def test_a_faster_log_is_the_same_plant_in_more_samples():
    fast = data(3, n=1200, pace=4)
    level = {
        k: JointEngine([JointPart(data(1)), JointPart(fast, k)], 40.0).evaluate(Spec(), THETA)
        for k in (1.0, 4.0)
    }
    assert level[4.0] > level[1.0] + 100.0


def test_a_fit_is_handed_back_as_the_first_record_has_it():
    joint = JointEngine([JointPart(data(1)), JointPart(data(2))], 40.0)
    ramp = Spec(channels=(np.linspace(0, 1, 600),))
    fit = joint.fit(ramp, THETA, steps=3)
    main = joint.main(fit)
    assert main.residual.size == 300
    assert main.K == fit.K
    # the signals of an effect come last, the first record's at the end
    assert main.beta.size == 4
    assert fit.beta.size == 1 + 2 + 2 + 2
    assert joint.more_numbers(ramp, Spec()) == 1.0
