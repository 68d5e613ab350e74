"""From a fitted load back to a loop file: what the simulator makes of it is the load that was
fitted.
"""

from types import SimpleNamespace

import numpy as np
import pytest

from simbench.gap.closed_loop.loop_from_fit import fixed_loop, load_parts
from simbench.gap.likelihood.model import Data, Fit, Spec
from simbench.loop.disturbance import disturbance_signal
from simbench.scenarios.parts import Part
from simbench.scenarios.spec import Loop


def simulated(parts, n, seed):
    """Return the load, in PV units, that a loop file with these parts makes."""
    kind = [{"amplitude": std, "period": period, "lag": lag} for std, period, lag in parts]
    return sum(
        disturbance_signal(Part(name="coloured", parameters=p), n, 1.0, (seed, i))[1]
        for i, p in enumerate(kind)
    )


def fitted(theta, n, rng):
    """Return the load whose model `kernels.whiten` holds: a first-order stage of std `load`, then a
    second lag.
    """
    phi = np.exp(-1 / theta["load_time"])
    b = np.exp(-1 / theta["load_lag"])
    first, second, out = 0.0, 0.0, np.empty(n)
    for k, w in enumerate(rng.standard_normal(n) * theta["load"] * np.sqrt(1 - phi**2)):
        out[k] = second
        first, second = phi * first + w, b * second + (1 - b) * first
    return out


@pytest.mark.parametrize("times", [(30.0, 4.0), (3.0, 20.0)])
def test_a_smooth_load_keeps_its_size_and_memory(times):
    theta = {"load": 2.0, "load_time": times[0], "load_lag": times[1]}
    n, rng = 200_000, np.random.default_rng(1)
    want, got = fitted(theta, n, rng), simulated(load_parts(theta), n, 2)
    ((std, period, lag),) = load_parts(theta)
    assert (period, lag) == times
    assert np.std(want) == pytest.approx(std, rel=0.05)
    assert np.std(got) == pytest.approx(std, rel=0.05)
    for step in (1, 5, 20):
        change = np.std(want[step:] - want[:-step])
        assert np.std(got[step:] - got[:-step]) == pytest.approx(change, rel=0.03)


N = 1000
FOPTD = {"type": "foptd", "K": 2.0, "T": 40.0, "Td": 8.0}
VESSEL = {"type": "integrating", "K": 0.02, "Td": 8.0}
THETA = {
    "T": 30.0,
    "Td": 5.0,
    "load_time": 30.0,
    "load_lag": 0.05,
    "load": 3.0,
    "noise_std": 0.2,
    "colour": 0.0,
}


def fitted_as(K=1.5, spec=None, **theta):
    return Fit(spec or Spec(), 0.0, THETA | theta, np.array([K, 0.0, 0.0]), np.zeros(N))


def built(
    fit=None,
    effects=None,
    *,
    stated=FOPTD,
    sp=60.0,
    pv=60.0,
    trusted=True,
    had=(),
    on_pv=(),
    **more,
):
    """Return the loop file of a record of 2 s a sample beside a baseline; OP swings about 50 %."""
    vessel = stated["type"] == "integrating"
    table = {
        "plant": stated,
        "controller": {"type": "PI", "Kc": 0.5, "Ti": 20.0},
        "sampling": {"Ts": 2.02},
        "noise": {"std": 0.1},
        "effect": list(had),
        "disturbance": more.pop("loads", []),
    }
    op, y = 50.0 + np.resize([1.0, -1.0], N), np.broadcast_to(np.asarray(pv, dtype=float), N)
    data = Data(op, y, stated["K"] * (2.0 if vessel else 1.0), 0.0 if vessel else 20.0, 4.0, 0.1)
    situation = SimpleNamespace(
        record=SimpleNamespace(Ts=2.0, n=N),
        data=data,
        baseline=Loop.from_table(table),
        integrating=vessel,
        sp=np.broadcast_to(np.asarray(sp, dtype=float), N),
        op=op,
        trusted=trusted,
        stated=frozenset(),
        pace=1,
        loads_on_pv=list(on_pv),
    )
    return fixed_loop(situation, fit or fitted_as(), effects or {}, **more)


def plant_of(loop):
    return tuple(x for x in (loop.plant.K, loop.plant.T, loop.plant.Td) if x is not None)


def test_the_fitted_plant_is_written_in_seconds():
    assert plant_of(built()) == (1.5, 60.0, 10.0)
    assert plant_of(built(plant="baseline")) == (2.0, 40.0, 8.0)
    # a vessel's gain per sample of 2 s; a gain of the other sign is nobody's plant
    assert plant_of(built(fitted_as(0.03), stated=VESSEL)) == (0.015, 10.0)
    assert plant_of(built(fitted_as(-1.5))) == plant_of(built(fitted_as(0.0))) == (2.0, 60.0, 10.0)


def test_the_noise_is_the_fitted_one_and_the_stated_one_in_the_baseline_itself():
    assert (built().noise.std, built(plant="baseline").noise.std) == (0.2, 0.1)
    assert built(trusted=False, plant="baseline").noise.std == 0.2


def test_loads_and_noise_that_a_fit_did_not_find_are_left_out():
    loop = built(fitted_as(load=0.0, noise_std=1e-9, colour=0.5))
    assert (loop.disturbance, loop.noise.std) == ((), 0.0)


def test_a_loop_file_that_states_its_loads_is_simulated_with_them():
    load = {"type": "sine", "amplitude": 1.0, "period": 60.0}
    given, fitted = (built(loads=[load], plant=plant) for plant in ("baseline", "fitted"))
    assert [d.name for d in given.disturbance] == ["sine"]
    assert [d.name for d in fitted.disturbance] == ["coloured"]
    assert given.noise.std == 0.1
