"""The distance from the centre of the (OP, PV) plane, or its first principal component, and a small
network that learns it on one simulated loop.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Sequence

import numpy as np
from sklearn.exceptions import ConvergenceWarning
from sklearn.neural_network import MLPClassifier

from results.studies.claims.judged import (
    CANNOT_TELL,
    YES,
    Claim,
    Loops,
    area,
    balanced_accuracy,
    decided,
)  # fmt: skip
from simbench.detectors.record import LoopRecord
from simbench.loop.simulate import simulate
from simbench.scenarios.spec import Loop
from simbench.theory.sampled import sampled_loop, ultimate_gain

POINTS = 500  # samples that the network sees
AT_MOST, AT_LEAST = 0.45, 0.55  # of its output: none, stiction
EACH, ASKED = 200, 100  # simulated loops of each kind that are learned, and asked at home
STARTS = 25  # random first weights of each network
SEED = 20261128
LAYERS = ((10, 10), (20, 20))
TS, LASTS = 1.0, 1000  # s; samples, of which the last are seen
_PLANT = {"type": "foptd", "K": 0.615, "T": 20.0, "Td": 10.0}
_KC, _KI = 1.69, 0.254


def distance(op: np.ndarray, pv: np.ndarray) -> np.ndarray:
    """Return the distance of every sample from the centre."""
    return np.hypot(op, pv)


def first_component(op: np.ndarray, pv: np.ndarray) -> np.ndarray:
    """Return the first principal component of both signals; OP counts upwards."""
    _, turn = np.linalg.eigh(np.cov(op, pv))
    direction = turn[:, -1] * np.sign(turn[0, -1] or 1.0)
    return direction @ np.array([op, pv])


def seen(record: LoopRecord, feature: Callable) -> np.ndarray:
    """Return what the network sees of a record: its last 500 samples, both signals standardised; a
    shorter record is stretched.
    """
    both = []
    for x in (record.op, record.pv):
        x = x[-POINTS:]
        x = np.interp(np.linspace(0.0, x.size - 1.0, POINTS), np.arange(x.size), x)
        both.append((x - x.mean()) / (x.std() or 1.0))
    return feature(*both)


def home(each: int, rng: np.random.Generator) -> tuple[list[LoopRecord], np.ndarray]:
    """Return loops of the one plant: sticky valves, and as many others, of which half oscillate by
    their tuning and half by a sine load.
    """
    records, sticky = [], np.arange(2 * each) < each
    for k in range(2 * each):
        table = _sticky(rng) if k < each else _retuned(rng) if k % 2 else _driven(rng)
        records.append(simulate(Loop.from_table(table), int(rng.integers(2**31))).record)
    return records, sticky


def _loop(kc: float, **more: object) -> dict:
    return {
        "plant": _PLANT,
        "controller": {"type": "PI", "Kc": kc, "Ti": _KC / _KI},
        "sampling": {"Ts": TS, "n": LASTS},
        "setpoint": {"steps": [[5.0, 51.0]]},
        "noise": {"std": 0.01},
        **more,
    }


def _sticky(rng: np.random.Generator) -> dict:
    S = float(rng.uniform(1.0, 10.0))
    J = float(rng.uniform(0.0, 1.0)) * S
    return _loop(_KC, valve={"model": "choudhury", "S": S, "J": J})


def _retuned(rng: np.random.Generator) -> dict:
    most = ultimate_gain(sampled_loop(Loop.from_table(_loop(_KC))))
    assert most is not None, "the loop is stable at a small gain"
    return _loop(_KC * most * float(rng.uniform(0.97, 1.0)))


def _driven(rng: np.random.Generator) -> dict:
    sine = {"type": "sine", "amplitude": float(rng.uniform(1.0, 10.0))}
    return _loop(_KC, disturbance=[{**sine, "period": float(rng.uniform(30.0, 120.0))}])


def rows(data: Sequence[Loops]) -> list[tuple[str, ...]]:
    """Return a line for each feature and network, at home and on the loops: over all starts."""
    rng = np.random.default_rng(SEED)
    learned, asked = home(EACH, rng), home(ASKED, rng)
    at_home = Loops("its home", asked[0], asked[1], np.zeros(asked[1].size))
    table = []
    for name, feature in (("distance", distance), ("first component", first_component)):
        x = np.array([seen(record, feature) for record in learned[0]])
        views = [
            (loops, np.array([seen(r, feature) for r in loops.records]))
            for loops in (at_home, *data)
        ]
        for layers in LAYERS:
            networks = [_network(layers, start).fit(x, learned[1]) for start in range(STARTS)]
            variant = f"{name}, {layers[0]}-{layers[1]}"
            table += [_row(variant, loops, view, networks) for loops, view in views]
    return table


def _network(layers: tuple[int, int], start: int) -> MLPClassifier:
    warnings.simplefilter("ignore", ConvergenceWarning)
    return MLPClassifier(
        layers, activation="tanh", solver="lbfgs", alpha=1e-3, max_iter=200, random_state=start
    )


def _row(
    variant: str, loops: Loops, view: np.ndarray, networks: Sequence[MLPClassifier]
) -> tuple[str, ...]:
    outputs = [network.predict_proba(view)[:, 1] for network in networks]
    answers = [decided(output, AT_MOST, AT_LEAST) for output in outputs]
    values = np.array([balanced_accuracy(a, loops.sticky) for a in answers])
    found, called = (
        np.median([(a.said[loops.sticky == s] == YES).mean() for a in answers])
        for s in (True, False)
    )
    return (
        variant,
        loops.name,
        str(loops.sticky.size),
        f"{found:.2f} (median of {len(networks)})",
        f"{called:.2f}",
        f"{np.median([(a.said == CANNOT_TELL).sum() for a in answers]):.0f}",
        f"{np.median(values):.2f} ({values.min():.2f} to {values.max():.2f})",
        area(np.mean(outputs, axis=0), loops.sticky),
    )


CLAIM = Claim(
    claimed=(
        "a network of two small tanh layers that learned the distance (D-value) or the first"
        " principal component of OP and PV on one simulated loop detects stiction in loops of the"
        " International Stiction Data Base; B.R. Navada, V. Sravani, S.K. Venkata (2024), Appl."
        " Syst. Innov. 7, 104"
    ),
    protocol=(
        f"last {POINTS} samples; learned on {2 * EACH} simulations of K = .615, T = 20 s, Td = 10"
        " s under PI 1.69 + .254/s with S and J drawn, against retuned loops and sine loads; at"
        f" least {AT_LEAST} stiction, at most {AT_MOST} none; {STARTS} starts"
    ),
    stand_in=(
        "ranges of S, J, gains and sines, noise, number of simulations, sampling (1 s),"
        " standardised signals, and the training (L-BFGS)"
    ),
    rows=rows,
)
