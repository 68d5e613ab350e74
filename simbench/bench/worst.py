"""Search for the healthy loop on which a method is most confidently wrong, by random search and
refinement (`simbench worst`).
"""

from __future__ import annotations

import math
import time
from dataclasses import dataclass
from typing import Any

import numpy as np

from simbench.bench.scenario.resolve import sampled_ultimate_gain, significant
from simbench.detectors.errors import UserError
from simbench.detectors.judge import judge
from simbench.detectors.plugins.registry import methods as registry
from simbench.detectors.verdict import STICTION, Verdict
from simbench.loop.simulate import simulate
from simbench.progress import Progress
from simbench.scenarios.spec import Loop

_EXPLORED = 0.6  # share of the budget spent far and wide, the rest around the best
_ELITE = 6
_TIME = 540.0  # s; a slow method on a slow machine stops here
_DISTURBANCES = ("none", "sine", "propagated", "coloured", "steps", "random_walk")
OSCILLATING = ("sine", "propagated")
# every entry: lowest and highest value, drawn evenly in logarithm; periods in dead times + lags,
# sizes in the load's
RANGES = {
    "Td_over_T": (0.03, 3.0),  # integrating: over Ti
    "Ti": (0.3, 4.0),  # over T
    "gain": (0.05, 1.5),  # over the ultimate gain
    "period": (0.5, 20.0),
    "amplitude": (0.3, 10.0),  # PV units, or % at the input
    "samples_per_period": (20.0, 60.0),
    "periods": (15.0, 40.0),
    "J_over_S": (0.25, 1.0),
    "lag": (0.005, 0.3),  # over the period
    "other_noise": (0.003, 0.1),
    "noise": (0.003, 0.3),
    "quantum": (0.01, 1.0),
    "limit": (0.3, 30.0),  # %, from rest to the end of OP's range
    "rangeability": (1.5, 50.0),
    "step": (0.1, 10.0),  # of the set point, PV units
}
# switches: share of loops that have it
OPTION_SHARES = {
    "P": 0.15,
    "input": 0.3,
    "noisy": 0.7,
    "coarse": 0.25,
    "limited": 0.2,
    "curved": 0.2,
    "stepped": 0.3,
}
KEYS = ("process", "disturbance", *RANGES, *OPTION_SHARES)


@dataclass(frozen=True)
class WorstCase:
    """A healthy loop and the answer of a method."""

    method: str  # method id
    loop: Loop  # its valve has no friction
    seed: int  # of its run
    verdict: Verdict  # the method's answer
    # tried, fooled: loops simulated, and how many of those drawn far and wide
    # were called sticky, of `drawn`
    tried: int
    drawn: int  # loops drawn far and wide
    fooled: int

    @property
    def score(self) -> float:
        """The method's score, larger = stickier."""
        return self.verdict.score

    def as_text(self) -> str:
        """Return the finding in a few lines, then the loop."""
        wrong = (
            "is most confidently wrong"
            if self.verdict.verdict == STICTION
            else "comes nearest to being wrong"
        )
        return (
            f"{self.method} {wrong} on this healthy loop: {self.verdict.verdict}, score"
            f" {self.score:.4g}\nreason: {self.verdict.reason}\n{self.tried} healthy loops tried;"
            f" of {self.drawn} drawn at random it called {self.fooled} sticky\n\n{self.to_toml()}"
        )

    def as_json(self) -> dict[str, Any]:
        """Return the finding as JSON types."""
        names = ("method", "seed", "tried", "drawn", "fooled")
        numbers = {name: getattr(self, name) for name in names}
        return {**numbers, "verdict": self.verdict.as_json(), "loop": self.loop.to_table()}

    def to_toml(self) -> str:
        """Return the loop file, with seed and answer in comments."""
        head = [
            (
                "# A healthy loop that this method calls sticky."
                if self.verdict.verdict == STICTION
                else "# A healthy loop."
            ),
            f'# method = "{self.method}"',
            f"# seed = {self.seed}",
            f'# verdict = "{self.verdict.verdict}"',
            f"# score = {self.score:.6g}",
        ]
        return "\n".join(head) + "\n\n" + self.loop.to_toml()


def worst(method: str, budget: int = 2000, seed: int = 0) -> WorstCase:
    """Search the healthy loop on which a method is most confidently wrong.

    First-order and integrating plants under loads, aggressive tuning, limits of OP, quantised PV
    and a valve characteristic: drawn evenly, then the best ones are changed a little (an evolution
    strategy with shrinking steps).
    """

    process = registry.load(method).METHOD.process
    if budget < 1:
        raise UserError(f"worst: budget = {budget}; at least 1 loop must be tried")
    rng = np.random.default_rng(seed)
    begun = time.monotonic()
    elite: list[tuple[tuple[bool, float], np.ndarray, WorstCase]] = []
    drawn = fooled = tried = 0
    explore = math.ceil(_EXPLORED * budget)
    for number in Progress(range(budget), desc=f"worst {method}", unit="loop"):
        if time.monotonic() - begun > _TIME:
            break
        if number < explore or not elite:
            point, run_seed = rng.random(len(KEYS)), int(rng.integers(2**31))
            drawn += 1
        else:
            parent = elite[int(rng.integers(len(elite)))]
            spread = 0.25 * 0.02 ** ((number - explore) / max(budget - explore, 1))
            changed = rng.random(len(KEYS)) < 0.4
            point, run_seed = (
                np.abs(parent[1] + changed * spread * rng.standard_normal(len(KEYS))),
                parent[2].seed,
            )
            point = np.minimum(1 - np.abs(1 - point), 1 - 1e-9)
        tried += 1
        loop = healthy_loop(dict(zip(KEYS, point)), process)
        verdict = judge(simulate(loop, run_seed).record, [method])[0]
        wrong = verdict.verdict == STICTION
        fooled += wrong and number < explore
        rank = (wrong, verdict.score if math.isfinite(verdict.score) else -math.inf)
        elite.append((rank, point, WorstCase(method, loop, run_seed, verdict, 0, 0, 0)))
        elite = sorted(elite, key=lambda e: e[0], reverse=True)[:_ELITE]
    best = elite[0][2]
    return WorstCase(method, best.loop, best.seed, best.verdict, tried, drawn, fooled)


def healthy_loop(at: dict[str, float], process: tuple[str, ...]) -> Loop:
    """Turn a point of the unit cube into a loop whose valve has no friction."""
    x = {
        k: significant(math.exp(math.log(lo) + at[k] * (math.log(hi) - math.log(lo))))
        for k, (lo, hi) in RANGES.items()
    }
    on = {k: at[k] < share for k, share in OPTION_SHARES.items()}
    integrating = process[int(at["process"] * len(process))] == "integrating"
    kind = _DISTURBANCES[int(at["disturbance"] * len(_DISTURBANCES))]
    T = 10.0
    Td = significant(x["Td_over_T"] * T)
    plant = (
        {"type": "integrating", "K": 1 / T, "Td": Td}
        if integrating
        else {"type": "foptd", "K": 1.0, "T": T, "Td": Td}
    )
    # without an oscillation from outside, the loop's sets the pace: about four dead times and
    # lags
    period = x["period"] * (T + 2 * Td) if kind in OSCILLATING else 4 * Td + T
    table: dict[str, Any] = {
        "plant": plant,
        "controller": (
            {"type": "P", "Kc": 1.0}
            if on["P"]
            else {"type": "PI", "Kc": 1.0, "Ti": significant(x["Ti"] * T)}
        ),
        "sampling": {
            "Ts": significant(period / x["samples_per_period"]),
            "n": round(x["samples_per_period"] * x["periods"]),
        },
        "noise": {"std": significant(x["noise"] * x["amplitude"]) if on["noisy"] else 0.0},
        "valve": (
            {"model": "gain_ratio", "R": x["rangeability"]} if on["curved"] else {"model": "ideal"}
        ),
        "effect": [],
    }
    if on["stepped"] or kind == "none":
        table["setpoint"] = {"value": 50.0, "steps": [[0.0, 50.0 + x["step"]]]}
    if kind != "none":
        load = {"type": kind, "amplitude": x["amplitude"], "period": significant(period)}
        load["at"] = "input" if on["input"] else "output"
        if kind == "propagated":
            load.update(
                S=5.0,
                J=significant(5.0 * x["J_over_S"]),
                lag=significant(x["lag"] * period),
                noise=x["other_noise"],
            )
        table["disturbance"] = [load]
    if on["coarse"]:
        table["effect"].append(
            {"name": "quantisation", "step": significant(x["quantum"] * x["amplitude"])}
        )
    if on["limited"]:
        table["effect"].append(
            {"name": "saturation", "lo": 50.0 - x["limit"], "hi": 50.0 + x["limit"]}
        )
    loop = Loop.from_table(table)
    return loop.with_("controller.Kc", significant(x["gain"] * sampled_ultimate_gain(loop)))
