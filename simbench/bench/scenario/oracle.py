"""Oracle: a likelihood-ratio test that knows plant, load and noise, and so shows where nobody could
know.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import scipy

from simbench.detectors.signal.stiction_map import valve_position
from simbench.detectors.verdict import NO_STICTION, STICTION, Verdict
from simbench.loop import plant
from simbench.loop.resolve import resolve_loop
from simbench.loop.run import Run
from simbench.loop.setup import Setup
from simbench.loop.simulate import simulate
from simbench.scenarios.spec import Sampling, Scenario
from simbench.valve.maps import at_rest

ORACLE = "oracle"
SOURCE = (
    "generalised likelihood ratio, Kay (1998), Detection Theory, section 6.4.2; penalty of Schwarz"
    " (1978)"
)
_BANDS = np.geomspace(0.1, 40.0, 31)  # S, % of travel
_JUMPS = np.linspace(0.0, 1.0, 9)  # J/S
_ZOOMS, _AROUND = 3, 5  # rounds of refinement, candidates a side in each
_FLOOR = 1e-9  # of PV's range: what rounding leaves of a residual without noise
_UNSURE = 3.0  # nats: below this one answer is at most twenty times likelier than the other


def judge_oracle(scenario: Scenario, run: Run) -> Verdict:
    """Ask whether PV fits OP better through a sticky valve than through an ideal one, knowing
    everything else.

    OP, sent through a valve and the known plant, predicts PV; what is left is the white noise of
    the sensor, so the ratio of likelihoods is (RSS ideal - RSS sticky)/(2 noise variance). S and J
    are not known to the oracle: the maximum over all of them is taken (Kay 1998, section 6.4.2).
    """
    loop, sampling = scenario.loop, scenario.loop.sampling
    # the plant's state is known where the run starts, not where the record does, and OP and PV as
    # they were, not as they were archived
    if sampling.warm_up or loop.archive is not None:
        whole = Sampling(Ts=sampling.Ts, n=(sampling.warm_up or 0) + sampling.n)
        loop = loop.model_copy(update={"sampling": whole, "archive": None})
        run = simulate(loop, scenario.seed)
    setup = resolve_loop(loop, scenario.seed)
    n, op, pv = setup.end, run.record.op, run.record.pv
    known = setup.pv0 + run.load_out[:n]
    predict = _predictor(setup, run.load_in[:n])
    variance = (
        setup.noise_std**2
        + (_FLOOR * max(float(np.ptp(pv)), 1e-3 * float(np.abs(pv).max()), 1e-9)) ** 2
    )

    def misfit(mv: np.ndarray) -> float:
        residual = pv - known - predict(mv)
        return float(residual @ residual) / (2.0 * variance)

    ideal = misfit(np.clip(op, 0.0, 100.0))
    S, J, best = _best_valve(lambda s, j: misfit(valve_position(op, s, j, at_rest(setup.op0))))
    ratio = ideal - best
    score = ratio - float(np.log(n))
    likelier = "sticky" if score > 0 else "ideal"
    return Verdict(
        ORACLE,
        STICTION if score > 0 else NO_STICTION,
        score=score,
        indices={"log_likelihood_ratio": ratio},
        S=S,
        J=J,
        applicable=None if abs(score) < _UNSURE else True,
        reason=(
            f"knowing plant, load and noise, the {likelier} valve is likelier by {abs(score):.3g}"
            " nats"
        ),
    )


def _best_valve(misfit: Callable[[float, float], float]) -> tuple[float, float, float]:
    # a coarse lattice over all valves, then finer ones around the best so far
    candidates = [(s, s * ratio) for s in _BANDS for ratio in _JUMPS]
    factor, width, offsets = (
        np.log(_BANDS[1] / _BANDS[0]),
        _JUMPS[1],
        np.linspace(-1.0, 1.0, _AROUND),
    )
    best, S, J = np.inf, np.nan, np.nan
    for _ in range(1 + _ZOOMS):
        for s, j in candidates:
            found = misfit(float(s), float(j))
            if found < best:
                best, S, J = found, float(s), float(j)
        sizes, ratios = S * np.exp(factor * offsets), np.clip(J / S + width * offsets, 0.0, None)
        candidates = [(s, s * ratio) for s in sizes for ratio in ratios]
        factor, width = factor / 2, width / 2
    return S, J, best


def _predictor(setup: Setup, load_in: np.ndarray):
    if setup.loop.plant.dt is not None:
        # stated in z: its numbers as they stand, behind whole samples
        b, den = np.append(0.0, setup.loop.plant.num or ()), np.array(setup.loop.plant.den)
        delay = round(setup.Td / setup.Ts)
    else:
        sampled = plant.sample(setup.num, setup.den, setup.Td, setup.Ts)
        column = [np.reshape(B, (-1, 1)) for B in (sampled.B_new, sampled.B_old)]
        (new, den), (old, _) = (
            scipy.signal.ss2tf(sampled.A, B, np.reshape(sampled.C, (1, -1)), [[0.0]])
            for B in column
        )
        b = np.concatenate([new[0], [0.0]]) + np.concatenate([[0.0], old[0]])
        delay = sampled.delay

    def predict(mv: np.ndarray) -> np.ndarray:
        """PV (n,) as deviation from its rest, without output load and noise."""
        w = mv - setup.op0 + load_in
        y = np.zeros(w.size)
        if delay < w.size:
            y[delay:] = scipy.signal.lfilter(b, den, w[: w.size - delay])
        return y

    return predict
