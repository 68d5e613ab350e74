"""simbench: a closed-loop simulation testbench for valve-stiction detectors."""

from __future__ import annotations

from typing import Any

__all__ = ["simulate", "simulate_batch", "sweep"]


def __getattr__(name: str) -> Any:
    # loaded when asked for: a detector's command line needs neither
    if name == "sweep":
        from simbench.bench.sweep import sweep

        return sweep
    if name == "simulate":
        from simbench.loop.simulate import simulate

        return simulate
    if name == "simulate_batch":
        from simbench.loop.batch import simulate_batch

        return simulate_batch
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
