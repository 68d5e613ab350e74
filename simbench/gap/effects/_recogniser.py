"""`Recogniser`: the description of how one effect is fitted, which each effect file contains."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

from simbench.gap.likelihood.engine import Engine
from simbench.gap.likelihood.model import Fit
from simbench.gap.likelihood.valve_map import MapSearch
from simbench.gap.situation import Situation

Parameters = dict[str, float | str]
NOT_IN_PLANT = "plant without it"


@dataclass(frozen=True)
class Recogniser:
    """How one effect is recognised; what does not apply to an effect stays at its default.

    Parameters
    ----------
    fit : callable, optional
        The likeliest fit with the effect on top of a base, and how many numbers it pays for; the
        base itself where nothing was switched on. Absent for what the likelihood of PV given OP
        does not see.
    numbers : callable
        The effect's numbers in the units of the loop file; needed with `fit`.
    needs : frozenset of str
        What the effect has no meaning without: "plant" or "tuning" of the baseline's author, a
        "time constant", a "valve without friction", a "plant without it" where a plant that was
        identified from OP to PV has it in its lags.
    proven : callable
        What the controller's law or single samples show without doubt.
    ordinary : callable, optional
        Whether a fit shows no more than loads and archives do by themselves, as the baseline or
        healthy records state, or an identified loop has it: it is in every model, and no evidence.
    by_mv : callable, optional
        Of a valve: MV given OP.
    band : callable, optional
        Range of OP (%) within which the valve rests; only of friction. After it any plant looks as
        if it integrated.
    """

    fit: Callable[[Engine, Fit], tuple[Fit, float]] | None = None
    numbers: Callable[[Fit, Situation], Parameters] = lambda fit, s: {}
    needs: frozenset[str] = frozenset()
    proven: Callable[[Situation], Parameters | None] = lambda s: None
    ordinary: Callable[[Fit, Situation], bool] = lambda fit, s: False
    by_mv: Callable[[MapSearch], tuple[float, Parameters]] | None = None
    band: Callable[[Mapping[str, float | str]], float] | None = None


def clip(x: float, low: float, high: float) -> float:
    """Return x within low..high."""
    return float(min(max(x, low), high))
