"""simbench: a closed-loop simulation testbench for valve-stiction detectors."""

from __future__ import annotations

from typing import Any

__all__ = ["simulate", "sweep"]


def __getattr__(name: str) -> Any:
    # loaded when asked for: a detector's command line needs neither
    if name == "sweep":
        from simbench.bench.sweep import sweep

        return sweep
    if name == "simulate":
        from simbench.loop.simulate import simulate

        return simulate
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
