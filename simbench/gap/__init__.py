"""Why does a simulated loop not look like the plant's record: where, which effect, how far it shrinks."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from simbench.gap.diagnosis import diagnose
    from simbench.gap.report.result import GapReport

__all__ = ["GapReport", "diagnose"]


def __getattr__(name: str) -> Any:
    # the blind check's generator lives in this package and must not load the models the diagnosis uses
    if name == "diagnose":
        from simbench.gap.diagnosis import diagnose

        return diagnose
    if name == "GapReport":
        from simbench.gap.report.result import GapReport

        return GapReport
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
