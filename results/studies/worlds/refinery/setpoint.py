"""Set-point patterns: constant, operator's steps, slow ramps, cascade (a master controller's slowly
wandering output).
"""

from __future__ import annotations

import numpy as np

from results.studies.worlds.refinery.loads import ornstein_uhlenbeck

PATTERNS = ("constant", "steps", "ramps", "cascade")


def pattern(spec: dict, warm: int, n: int, Ts: float) -> np.ndarray:
    """Return SP (PV units) for `warm` samples of earlier life and `n` recorded ones."""
    k = np.arange(-warm, n)
    if spec["kind"] == "constant":
        return np.full(warm + n, spec["value"])
    if spec["kind"] == "cascade":
        rng = np.random.default_rng(spec["seed"])
        # twice filtered: a master controller's output has no corners
        x = ornstein_uhlenbeck(rng, warm + n, Ts, spec["time"])
        a = np.exp(-Ts / (0.3 * spec["time"]))
        for i in range(1, x.size):
            x[i] = a * x[i - 1] + (1.0 - a) * x[i]
        return spec["value"] + spec["size"] * x
    at = np.array([q[0] for q in spec["knots"]], dtype=float)
    levels = np.array([q[1] for q in spec["knots"]], dtype=float)
    if spec["kind"] == "ramps":
        return np.interp(k, at, levels, left=spec["value"])
    return np.concatenate([[spec["value"]], levels])[np.searchsorted(at, k, side="right")]
