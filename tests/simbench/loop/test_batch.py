"""Many loops abreast have the bits of the same loops one at a time: every valve, controller, load, effect, length."""

import numpy as np
import pytest

from detectors.compiled import compiled, few
from detectors.errors import ParameterError
from scenarios.spec import Loop
from simbench.loop.batch import simulate_batch
from simbench.loop.noise import draw
from simbench.loop.parameters import VALVES, Choice
from simbench.loop.simulate import simulate

# each compiles a kind of loop of its own
EFFECTS = [
    {"name": "valve_lag", "tau": 3.0}, {"name": "sensor_lag", "tau": 2.0}, {"name": "op_quantisation", "step": 0.5},
    {"name": "saturation", "lo": 45, "hi": 55}, {"name": "extra_lag", "tau": 4.0}, {"name": "compression", "band": 0.4},
    {"name": "noise", "factor": 3.0}, {"name": "load_drift", "rate": 0.01, "walk": 0.2},
]  # fmt: skip


def valve(name, rng):
    """A valve model with random bands; what else it needs is drawn too."""
    table = {"model": name}
    for key, rule in VALVES.load(name).PARAMETERS.items():
        if isinstance(rule, Choice):
            table[key] = str(rng.choice(rule.names))
        elif key == "S":
            table[key] = float(rng.uniform(0.5, 8.0))
        elif key == "J":
            table[key] = float(rng.uniform(0.1, 0.9)) * table["S"]
        elif rule.default is None:
            table[key] = float(rng.uniform(max(rule.low, 0.1), min(rule.high, 5.0)))
    if "on" in table:
        table["period"] += table["on"]
    return table


def random_loop(rng, model, control, *, load=False, effect=None):
    """A loop with nothing about it fixed but the kind it is of."""
    integrating, direct, T = rng.random() < 0.3, rng.random() < 0.3, float(rng.uniform(5.0, 20.0))
    K = float(rng.uniform(0.5, 2.0)) * (-1 if direct else 1) / (T if integrating else 1.0)
    plant = {"type": "integrating"} if integrating else {"type": "foptd", "T": T}
    Ts, n, sp = float(rng.choice([0.5, 1.0, 2.3])), int(rng.integers(3, 300)), float(rng.uniform(30, 70))
    controller = {"type": control, "Kc": float(rng.uniform(0.1, 1.0)), "direction": "direct" if direct else "reverse"}
    times = rng.uniform(0, 1.2 * n * Ts, rng.integers(0, 4))
    # two at one time: the later line overrules
    steps = [[float(t), sp + float(rng.normal(0, 3))] for t in [*times, *times[:1]]]
    sine = {"type": "sine", "amplitude": 2.0, "period": 40.0, "at": str(rng.choice(["input", "output"]))}
    return Loop.from_table({
        "plant": {**plant, "K": K, "Td": float(rng.choice([0.0, 0.4, 1.0, 3.0, 7.3]))},
        "controller": {**controller, "Ti": float(rng.uniform(5, 40))} if control == "PI" else controller,
        "valve": valve(model, rng),
        "sampling": {"Ts": Ts, "n": n},
        "noise": {"std": 0.0 if rng.random() < 0.2 else float(rng.uniform(0.01, 0.5))},
        "setpoint": {"value": sp, "steps": steps},
        "disturbance": [sine] if load else [],
        "effect": [effect] if effect else [],
    })  # fmt: skip


def random_loops(rng, each):
    """So many loops of every valve, alternately under P and PI, and so many of each further kind."""
    kinds = [(m, ("PI", "P")[i % 2], {}) for i, m in enumerate(VALVES.names())]
    kinds += [("choudhury", "P", {}), ("choudhury", "PI", {"load": True})]
    kinds += [("choudhury", "PI", {"effect": effect}) for effect in EFFECTS]
    return [random_loop(rng, model, control, **more) for model, control, more in kinds for _ in range(each)]


def different(loops, seeds):
    """The loops whose records or true valve positions differ by a bit."""
    wrong = []
    for loop, seed, run in zip(loops, seeds, simulate_batch(loops, seeds), strict=True):
        one = simulate(loop, seed)
        signals = [(getattr(run.record, s), getattr(one.record, s)) for s in ("op", "pv", "mv", "sp")]
        signals += [(run.mv, one.mv), (run.load_in, one.load_in), (run.load_out, one.load_out)]
        if run.sticky != one.sticky or not all(np.array_equal(a, b) for a, b in signals):
            wrong.append(loop.to_toml())
    return wrong


@pytest.mark.slow  # it compiles two dozen kinds of loops
def test_random_loops_of_every_valve_have_the_bits_of_one_at_a_time():
    rng = np.random.default_rng(17)
    # no multiple of the lanes: some stay empty
    loops = random_loops(rng, 5)
    seeds = [int(s) for s in rng.integers(0, 2**63, len(loops))]
    assert not different(loops, seeds)


def plain(n=50, **more):
    return Loop.from_table({
        "plant": {"type": "foptd", "K": 1, "T": 10, "Td": 2}, "controller": {"type": "PI", "Kc": 1, "Ti": 10},
        "valve": {"model": "choudhury", "S": 5, "J": 2}, "sampling": {"Ts": 1, "n": n}, "noise": {"std": 0.3}, **more,
    })  # fmt: skip


@pytest.mark.parametrize("m", [0, 1, few() - 1, few(), few() + 1])
def test_any_number_of_loops_in_any_order_of_lengths(m):
    loops = [plain(n=10 + 37 * i % 97) for i in range(m)]
    assert len(simulate_batch(loops, range(m))) == m
    assert not different(loops, list(range(m)))


@pytest.mark.parametrize("seed", [0, 2**32 - 1, 2**32, 2**64 - 1, 2**64, 2**80])
def test_seeds_of_any_size(seed):
    assert not different([plain(), plain()], [seed, 1])


def test_the_batch_shows_signals_without_making_runs_and_can_be_cut():
    batch = simulate_batch([plain(), plain(n=70)], [1, 2])
    op, pv, mv = batch.signals(1)
    record = batch[1].record
    assert all(np.array_equal(a, b) for a, b in ((op, record.op), (pv, record.pv), (mv, record.mv)))
    assert batch[1:][0].record.n == 70


def test_what_cannot_be_simulated_is_refused_as_one_at_a_time_is():
    with pytest.raises(ParameterError, match="J"):
        simulate_batch([plain(valve={"model": "choudhury", "S": 5, "J": -2})], [1])
    with pytest.raises(ParameterError, match="2 loops and 1 seeds"):
        simulate_batch([plain(), plain()], [1])


def test_noise_is_numpys_own_far_out_too():
    # a million numbers: the ziggurat's tail and its wedges included
    n, seeds = 500_000, np.array([3, 2**40], dtype=np.uint64)
    out = np.zeros((n, 2))
    compiled(draw)(seeds, np.array([1.0, 2.5]), np.array([n, n - 7]), out)
    first, second = (np.random.default_rng([int(s), 0]).standard_normal(n) for s in seeds)
    assert np.abs(first).max() > 4.0
    np.testing.assert_array_equal(out[:, 0], first)
    np.testing.assert_array_equal(out[:-7, 1], 2.5 * second[:-7])
    assert not out[-7:, 1].any()
