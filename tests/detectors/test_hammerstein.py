"""Hammerstein identification: the kernels against their plain twins, S on loops whose S is known, J
where it can be known.
"""

from dataclasses import replace

import numpy as np
import pytest
from plain_loops import DELAYED, LEVEL

from simbench.detectors import compiled as compiling
from simbench.detectors.compiled import compiled, quick
from simbench.detectors.judge import judge
from simbench.detectors.methods import hammerstein
from simbench.detectors.signal.fits import hammerstein_kernels as kernels
from simbench.detectors.signal.fits.hammerstein import (
    fit_hammerstein,
    moving_mean,
)
from simbench.detectors.signal.oscillation import find_oscillation
from simbench.detectors.signal.stiction_map import valve_position

POLES = np.array([0.3, 0.9, 1.0])


def case(q=1, n=400, stops=False):
    rng = np.random.default_rng(0)
    op = (
        50
        + 3 * np.abs((np.arange(n * q) % (40 * q)) / (10 * q) - 2)
        + 0.1 * rng.standard_normal(n * q)
    )
    y = np.cumsum(rng.standard_normal(n)) * 0.01 + np.sin(np.arange(n) * 2 * np.pi / 40 + 1.0)
    return (op, y - moving_mean(y, 20), q, 20, 60, n - 20, 1.0, 0.0, 100.0, stops)


def he_position(op, S, J, state):
    """He's valve, which stops within every sample, from its flow chart; it starts as Choudhury's
    does.
    """
    v, out = state[0], [state[0]]
    if state[2] != 0.0:  # moving: on the line behind the first OP, wherever that leads
        out = [op[0] - state[1] * (S - J) / 2]
        v = out[0]
    for u in op[1:]:
        if abs(u - v) > (S + J) / 2:
            v = u - np.sign(u - v) * (S - J) / 2
        out.append(v)
    return np.array(out)


def naive(given, S, J, start, poles, delays):
    """The same error from its definition, by least squares over stacked columns."""
    op, y, q, half, first, last, sign, _, _, stops = given
    u = op[0]
    state = {
        2.0: (u - (S - J) / 2, 1.0, 1.0, u - 1e-9),
        -2.0: (u + (S - J) / 2, -1.0, 1.0, u + 1e-9),
    }
    state = state.get(start, (u - start * (S + J) / 2, 0.0, 0.0, u))
    v = (he_position if stops else valve_position)(op, S, J, state).reshape(-1, q).mean(axis=1)
    h = v - np.array([v[max(k - half, 0) : k + half + 1].mean() for k in range(v.size)])
    target = y[first:last] - y[first:last].mean()
    best = (1.0, 0, 0)
    for p, a in enumerate(poles):
        x = np.zeros(v.size)
        for k in range(1, v.size):
            x[k] = a * x[k - 1] + (1.0 if a == 1.0 else 1.0 - a) * h[k]
        for i, d in enumerate(delays):
            columns = [x[first - d - e : last - d - e] for e in (0, 1)]
            columns = [sign * (c - c.mean()) for c in columns]
            for used in (columns, columns[:1]):
                gains = np.linalg.lstsq(np.column_stack(used), target, rcond=None)[0]
                if np.all(gains >= 0):
                    left = target - np.column_stack(used) @ gains
                    best = min(best, (float(left @ left / (target @ target)), p, i))
                    break
    return best


def errors(given, S, J, start, poles, delays, stride=1):
    """The kernel over valves given as lists, all with the same window of delays."""
    n = len(S)
    out = np.empty((n, 2))
    low, count = np.full(n, delays[0]), np.full(n, len(delays))
    valves = (np.array(x, dtype=float) for x in (S, J, start, poles))
    *record, stops = given
    valves = kernels.Valves(np.full(n, float(stops)), *valves, low, count)
    compiled(kernels.errors)(kernels.Stretch(*record), valves, stride, out)
    return out


@pytest.mark.parametrize("stops", [False, True])
@pytest.mark.parametrize("q", [1, 3])
@pytest.mark.parametrize("stride", [1, 3])
@pytest.mark.parametrize(
    ("S", "J", "start"), [(4.0, 1.5, 2.0), (3.0, 3.0, 0.5), (0.0, 0.0, 0.0), (5.0, 0.0, -2.0)]
)
def test_error_equals_least_squares_by_definition(stops, q, stride, S, J, start):
    delays = 1 + stride * np.arange(3)
    fast = errors(case(q, stops=stops), [S] * 3, [J] * 3, [start] * 3, POLES, delays, stride)
    for (error, delay), pole in zip(fast, POLES):
        slow = naive(case(q, stops=stops), S, J, start, [pole], delays)
        assert error == pytest.approx(slow[0], abs=1e-9)
        assert delay == slow[2]


def test_plain_kernel_equals_the_compiled_one_bit_for_bit():
    given = case(n=120)
    rng = np.random.default_rng(1)
    n = 35  # more than one block
    S, J, start, poles = (
        rng.uniform(1, 5, n),
        rng.uniform(0, 5, n),
        rng.choice([2.0, 0.4, -2.0], n),
        rng.uniform(0.5, 1, n),
    )
    poles[3] = 1.0
    low, count = np.repeat(rng.integers(1, 4, 5), 8)[:n], np.repeat(rng.integers(1, 4, 5), 8)[:n]
    plain, fast = np.empty((n, 2)), np.empty((n, 2))
    valves = kernels.Valves(rng.choice([0.0, 1.0], n), S, J, start, poles, low, count)  # either map
    stretch = kernels.Stretch(*given[:-1])
    with np.errstate(all="ignore"):
        kernels.errors(stretch, valves, 1, plain)
    compiled(kernels.errors)(stretch, valves, 1, fast)
    assert np.array_equal(plain, fast)


def one_after_another(given, point, start, delays, steps, least):
    """Hooke and Jeeves's pattern search, trial after trial."""

    def error(p):
        if p[0] <= 0 or p[1] < 0 or p[1] > 1.5 * p[0]:
            return 2.0
        return errors(given, [p[0]], [p[1]], [start], [np.exp(-np.exp(p[2]))], delays)[0, 0]

    base, width, lowest = point, 1.0, error(point)
    while width > least:
        best, top, moved = base, lowest, True
        while moved:
            for i in range(8):
                if i >= 6 and steps[2] == 0.0:
                    continue
                way = width if i % 2 == 0 else -width
                trial = best + way * steps * np.array([i < 2 or 4 <= i < 6, 2 <= i < 6, i >= 6])
                if error(trial) < top - kernels.TIE:
                    top, best = error(trial), trial
            moved = top < lowest
            if moved:
                trial = np.where(steps > 0, 2 * best - base, best)
                base, lowest = best, top
                if error(trial) < top - kernels.TIE:
                    top, best = error(trial), trial
        width *= 0.5
    return lowest, base


@pytest.mark.parametrize("seconds", [0.0, 60.0], ids=["compiled", "plain"])
def test_many_points_go_down_together_as_each_does_alone(seconds, monkeypatch):
    monkeypatch.setattr(compiling, "_PLAIN_SECONDS", seconds)
    monkeypatch.setattr(compiling, "_on_disk", lambda function: seconds == 0.0)
    descend = quick(kernels.descend, kernels.errors)
    given = case()
    points = np.array(
        [
            [4.0, 1.0, -2.0],
            [2.0, 2.0, -1.0],
            [5.5, 0.5, -3.0],
            [3.0, 1.0, -np.inf],
            [1.0, 0.2, -2.0],
        ]
    )
    steps = np.array([[0.2, 0.2, 0.1]] * 3 + [[0.2, 0.2, 0.0], [0.3, 0.0, 0.2]])
    starts, low, count = (
        np.array([2.0, 0.5, -2.0, 2.0, 2.0]),
        np.array([1, 2, 1, 3, 1]),
        np.array([4, 2, 3, 1, 4]),
    )
    least, error, went = np.full(5, 0.2), np.empty(5), points.copy()
    begin = kernels.Valves(np.zeros(5), *points.T[:2].copy(), starts, np.ones(5), low, count)
    descend(kernels.Stretch(*given[:-1]), begin, went, steps, least, error)
    for k in range(5):
        delays = low[k] + np.arange(count[k])
        lowest, end = one_after_another(given, points[k], starts[k], delays, steps[k], least[k])
        assert error[k] == lowest
        assert np.array_equal(went[k], end)


def best_apart(errors, size, share, count):
    """Candidates from the best on, each that no kept one is next to, one after the other."""
    kept = []
    for k in sorted(range(errors.size), key=lambda k: errors[k]):
        alone = all(abs(size[k] - size[j]) > 0.1 or abs(share[k] - share[j]) > 0.4 for j in kept)
        if alone and len(kept) < count:
            kept.append(k)
    return kept


@pytest.mark.parametrize("seed", range(20))
def test_kept_candidates_are_the_best_that_are_not_next_to_a_better_one(seed):
    rng = np.random.default_rng(seed)
    n = int(rng.integers(40, 90))
    # on a grid, so that some differ by just the bound, as neighbours in the search do
    size, share = 0.05 * rng.integers(0, 40, (2, n)), 0.2 * rng.integers(0, 7, (2, n))
    errors = rng.permutation(2 * n).reshape(2, n) / (2.0 * n)
    for kernel in (kernels.keep_apart, compiled(kernels.keep_apart)):
        kept = np.empty((2, 4), dtype=np.int64)
        kernel(errors.copy(), size, share, kept)
        for row in range(2):
            assert kept[row].tolist() == best_apart(errors[row], size[row], share[row], 4)


def fitted(record):
    period = find_oscillation(record.op, record.pv, record.Ts).period_s / record.Ts
    return fit_hammerstein(
        record.op, record.pv, period, record.process == "integrating", Ts=record.Ts
    )


LOOPS = {
    "lag": {"n": 3000},
    "lag, J = S": {"J": 5.0, "kick": 6.0, "n": 2000},
    "lag, J > S": {"J": 7.0, "kick": 8.0, "n": 2000},
    "small S": {"S": 1.0, "J": 0.4, "kick": 0.7, "n": 3000},
    "delay": {**DELAYED, "n": 3000},
    "level": {**LEVEL, "n": 2000},
    "level, dead band": {
        **LEVEL,
        "J": 0.0,
        "n": 3000,
    },
}


@pytest.mark.parametrize("name", LOOPS)
def test_S_is_identified_within_half_a_percent_of_span(name, loop):
    S = LOOPS[name].get("S", 5.0)
    model = fitted(loop(**LOOPS[name]))
    # a delay-dominant loop toggles its valve between two positions: S and dead time trade off there
    assert abs(model.S - S) <= (1.5 if name == "delay" else 0.5)


def test_S_is_identified_in_nine_of_ten_noisy_loops(loop):
    rng = np.random.default_rng(0)
    right = []
    while len(right) < 30:
        S = float(rng.uniform(2, 8))
        about = {
            "S": S,
            "J": S * float(rng.choice([0.3, 0.5, 0.8, 1.0])),
            "Td": float(rng.choice([1, 2, 4])),
            "n": 1500,
        }
        about |= {"Kc": float(rng.uniform(0.7, 1.5)), "seed": int(rng.integers(1000))}
        about["kick"] = (S + about["J"]) / 2 * float(rng.uniform(1.02, 1.3))
        clean = loop(**about)
        if np.ptp(clean.mv[-300:]) < 0.5 * about["J"]:
            continue  # this kick did not start the cycle
        noise = float(rng.choice([0.02, 0.1, 0.2])) * float(clean.pv[750:].std())
        record = loop(**about, noise=noise)
        if (
            np.ptp(record.mv[-300:]) > 0.5 * about["J"]
            and find_oscillation(record.op, record.pv, 1.0).sustained
        ):
            right.append(abs(fitted(record).S - S) <= 0.5)
    assert np.mean(right) >= 0.9


def test_direct_acting_loop_gives_the_same_valve(loop):
    record = loop(n=3000)
    turned = replace(record, pv=-record.pv)
    assert fitted(turned).sign == -1.0
    assert fitted(turned).S == pytest.approx(fitted(record).S, abs=1e-9)


def test_start_of_the_record_does_not_matter(loop):
    record = loop(n=3000, noise=0.05)
    for start in (100, 137, 171):
        assert fitted(record.window(start, 2500)).S == pytest.approx(5.0, abs=0.5)


def test_a_sine_from_outside_is_no_stiction(loop):
    load = 3 * np.sin(2 * np.pi * np.arange(3000) / 60)
    verdict = judge(loop(S=0.0, J=0.0, load=load, noise=0.1, n=3000), ["hammerstein"])[0]
    assert verdict.verdict == "no_stiction"
    assert verdict.S is None


def test_op_in_unknown_units_gives_S_in_those(loop):
    record = loop(n=3000)
    verdict = judge(replace(record, op=record.op * 10, op_span=None), ["hammerstein"])[0]
    assert verdict.verdict == "stiction"
    assert verdict.indices["S_hat"] == pytest.approx(50.0, abs=5.0)
    assert verdict.S[0] < 50.0 < verdict.S[1]
    assert verdict.S_unit == "OP units"


def test_op_that_rests_in_most_cycles_is_no_decision(loop):
    record = loop(n=3000)
    op = np.where(np.arange(3000) < 300, record.op, 50.0)
    verdict = judge(replace(record, op=op), ["hammerstein"], raw=True)[0]
    assert verdict.verdict == "no_decision"


@pytest.mark.parametrize(
    ("S", "gain", "verdict"),
    [
        (0.4, 0.9, "no_stiction"),
        (6.0, 0.02, "no_stiction"),
        (0.4, 0.02, "no_stiction"),
        (6.0, 0.9, "stiction"),
    ],
)
def test_stiction_needs_both_a_band_and_a_better_fit(loop, monkeypatch, S, gain, verdict):
    fitted = {"S_hat": S, "gain": gain, "share": 1.0}
    monkeypatch.setattr(hammerstein, "_one_step", lambda *a: (fitted, "a fit"))
    as_published = {"hammerstein": {"output_error": 0.0}}
    answer = judge(loop(n=3000), ["hammerstein"], thresholds=as_published)[0]
    assert answer.verdict == verdict
    assert (answer.S is None) == (verdict == "no_stiction")
