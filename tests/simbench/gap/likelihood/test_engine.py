"""The engine: exact derivatives, no step backwards, the true plant, load and noise found again, and
no unit anywhere.
"""

import numpy as np
import pytest

from simbench.gap.likelihood import kernels
from simbench.gap.likelihood.engine import STEP, Engine
from simbench.gap.likelihood.model import Data, Spec
from simbench.loop.simulate import simulate
from simbench.scenarios.spec import Loop

K, T, TD, NOISE, LOAD, MEMORY = 1.5, 14.0, 4.3, 0.35, 0.9, 18.0


def recorded(n=1500, seed=4, integrating=False, disturbance=None):
    """Return OP and PV of a loop without effect, SP moving; the load's steady effect on PV has std
    LOAD.
    """
    plant = (
        {"type": "integrating", "K": K / T, "Td": TD}
        if integrating
        else {"type": "foptd", "K": K, "T": T, "Td": TD}
    )
    load = [{"type": "coloured", "amplitude": LOAD / K, "period": MEMORY}]
    record = simulate(
        Loop.from_table(
            {
                "plant": plant,
                "controller": {"type": "PI", "Kc": 0.8, "Ti": 4 * T if integrating else T},
                "sampling": {"Ts": 1.0, "n": n},
                "noise": {"std": NOISE},
                "setpoint": {
                    "value": 50.0,
                    "steps": [
                        [float(t), 50.0 + 3.0 * (i % 2)] for i, t in enumerate(range(40, n, 90))
                    ],
                },
                "disturbance": load if disturbance is None else disturbance,
            }
        ),
        seed=seed,
    ).record
    return record.op, record.pv


OP, PV = recorded()


def engine(gain=1.0, integrating=False, trusted=True, op=OP, pv=PV, scale=1.0):
    if integrating:
        op, pv = recorded(n=900, integrating=True)
    return Engine(
        Data(
            op,
            scale * pv,
            scale * gain * (K / T if integrating else K),
            0.0 if integrating else 0.95 * T,
            1.05 * TD,
            scale * NOISE,
            trusted=trusted,
        ),
        60.0,
    )


THETA = {
    "T": 13.1,
    "Td": 4.45,
    "load_time": 11.0,
    "load_lag": 3.0,
    "load": 1.3,
    "noise_std": 0.33,
    "colour": 0.15,
}
RAMP = np.linspace(0.0, 1.0, PV.size)
PINK = {k: v for k, v in THETA.items() if k != "load_lag"}


@pytest.mark.parametrize(
    ("e", "spec", "theta"),
    [
        (engine(), Spec(), THETA),
        # outside its priors
        (
            engine(),
            Spec(),
            {**THETA, "T": 18.0, "Td": 6.8, "noise_std": 0.6, "load_time": 1.5, "load_lag": 0.3},
        ),
        (engine(gain=0.6), Spec(), THETA),  # the gain held by its prior
        (engine(trusted=False), Spec(pink=True), PINK),
        (engine(), Spec(pole="sensor"), {**THETA, "tau": 2.0}),
        (engine(), Spec(pole="extra", walk=True), {**THETA, "tau": 3.0, "walk": 0.02}),
        (engine(), Spec(load_walk=True, channels=(RAMP,)), {**THETA, "load_walk": 0.05}),
        (engine(), Spec(valve=kernels.CURVE, free=frozenset({"K"})), {**THETA, "R": 2.0}),
        (engine(integrating=True), Spec(pole="valve"), {**THETA, "tau": 3.0, "load": 0.05}),
    ],
)
def test_derivatives_are_those_of_the_profile_likelihood(e, spec, theta):
    names = tuple(m for m in spec.names if m in theta and (m != "T" or e.data.T > 0))
    x = np.log([theta[m] for m in names])

    def unpack(x):
        return {**theta, **dict(zip(names, np.exp(x)))}

    def moved(i, h):
        y = x.copy()
        y[i] += h
        return e._likelihood_terms(spec, unpack(y))

    now = e._likelihood_terms(spec, theta)
    J, slope = e._differentiate_terms(spec, names, x, np.column_stack([x - 9, x + 9]), unpack, now)
    gradient, J = J @ now[0] + slope, e._without_linear(now, J)
    # the linear coefficients are fitted anew on either side
    h = 1e-3
    for i, name in enumerate(names):
        up, down, middle = (0.5 * t[0] @ t[0] + t[1] for t in (moved(i, h), moved(i, -h), now))
        bend = abs(up - 2 * middle + down) / h**2
        assert gradient[i] == pytest.approx(
            (up - down) / (2 * h), abs=STEP * bend + 1e-3 * np.abs(gradient).max()
        ), name
        central = e._without_linear(now, ((moved(i, h)[0] - moved(i, -h)[0]) / (2 * h))[None, :])[0]
        # the filter's gain freezes a sample sooner or later on either side, which shows where it
        # settles slowly
        assert np.linalg.norm(J[i] - central) < 0.03 * np.linalg.norm(central) + 1e-3, name


@pytest.mark.parametrize("seed", range(4))
def test_a_fit_never_ends_below_its_start(seed):
    rng = np.random.default_rng(seed)
    e = engine(gain=float(rng.uniform(0.7, 1.3)), trusted=seed % 4 != 3)
    pole = ("", "extra", "sensor", "valve")[seed % 4]
    spec = Spec(pole=pole, pink=seed % 2 == 1, free=frozenset({"T"}) if seed < 2 else frozenset())
    start = {}
    for name in spec.names:
        low, high = e.bounds(spec, name)
        start[name] = float(
            rng.uniform(low, high) if low <= 0 else np.exp(rng.uniform(*np.log([low, high])))
        )
    fit = e.fit(spec, start, steps=6)
    assert fit.loglik >= e.at(spec, start).loglik
    assert fit.loglik == e.evaluate(spec, fit.theta)
    for name in spec.names:
        low, high = e.bounds(spec, name)
        assert low * (1 - 1e-9) - 1e-9 <= fit.theta[name] <= high * (1 + 1e-9)


def test_plant_load_and_noise_are_identified():
    op, pv = recorded(n=6000)
    e = Engine(Data(op, pv, 0.6 * K, 0.5 * T, 2.5 * TD, 0.0, trusted=False), 60.0)
    fit = e.base()
    assert fit.K == pytest.approx(K, rel=0.05)
    assert fit.theta["T"] == pytest.approx(T, rel=0.08)
    assert fit.theta["Td"] == pytest.approx(TD, abs=0.4)
    assert fit.theta["noise_std"] == pytest.approx(NOISE, rel=0.05)
    assert fit.theta["load"] == pytest.approx(LOAD, rel=0.25)
    assert fit.theta["load_time"] == pytest.approx(MEMORY, rel=0.35)
    assert np.var(fit.residual[kernels.SKIP :]) == pytest.approx(1.0, abs=0.04)


@pytest.mark.parametrize(
    ("kind", "names", "points"),
    [
        (kernels.ZONE, ("D", "c"), [(d, c) for d in (0.3, 1.0, 4.0) for c in (49.0, 51.5)]),
        (kernels.STICK, ("S", "J"), [(s, s * j) for s in (0.5, 1.5, 4.0) for j in (0.1, 0.6, 1.0)]),
        (kernels.CREEP, ("S", "J"), [(s, s * j) for s in (0.5, 1.5, 4.0) for j in (0.1, 0.6, 1.0)]),
        (kernels.CURVE, ("R", "-"), [(r, 0.0) for r in (0.05, 0.5, 2.0, 20.0)]),
    ],
)
@pytest.mark.parametrize("theta", [THETA, PINK])
def test_a_scan_ranks_maps_as_full_evaluations_do(kind, names, points, theta):
    e, pink = engine(trusted=False), "load_lag" not in theta
    # the scan begins every valve where OP does, a full fit anywhere in its band
    holds = kind in (kernels.STICK, kernels.CREEP)
    scanned = e.scan(Spec(pink=pink), theta, kind, np.array([(*p, 0.0) for p in points]))
    full = np.array([
        e.evaluate(Spec(valve=kind, pink=pink), theta | dict(zip(names, p))) for p in points
    ])  # fmt: skip
    if holds:
        assert np.corrcoef(scanned, full)[0, 1] > 0.99
    else:
        # all that is left is the prior of the noise's colour
        prior = 0.5 * (theta["colour"] / 0.5) ** 2
        assert np.allclose(scanned - full, prior, atol=1e-3)


@pytest.mark.parametrize("spec", [Spec(), Spec(pink=True), Spec(free=frozenset({"K", "T", "Td"}))])
def test_a_fit_has_no_unit_of_pv(spec):
    # a load that is plainly of second order: along a parameter without effect, rounding alone would
    # lead the way
    op, pv = recorded(
        disturbance=[{"type": "coloured", "amplitude": 2 * LOAD / K, "period": MEMORY, "lag": 8.0}]
    )
    one, other = engine(op=op, pv=pv), engine(op=op, pv=pv, scale=64.0)
    start = {**one.start(), "load_lag": 4.0}
    a, b = (
        one.fit(spec, start),
        other.fit(
            spec, {m: v * (64.0 if m in ("load", "noise_std") else 1.0) for m, v in start.items()}
        ),
    )
    assert b.loglik == pytest.approx(a.loglik - (PV.size - kernels.SKIP) * np.log(64.0), abs=1e-4)
    assert pytest.approx(64.0 * a.K, rel=1e-4) == b.K
    for name, value in a.theta.items():
        assert b.theta[name] == pytest.approx(
            value * (64.0 if name in ("load", "noise_std") else 1.0), rel=1e-3, abs=1e-6
        ), name
