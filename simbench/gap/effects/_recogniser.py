"""`Recogniser`: the description of how one effect is fitted, which each effect file contains."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from simbench.gap.effects._smallest import Probe
from simbench.gap.likelihood.engine import Engine
from simbench.gap.likelihood.model import Fit
from simbench.gap.likelihood.valve_map import MapSearch
from simbench.gap.situation import Situation

Parameters = dict[str, float | str]


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
    possible : callable
        Whether `fit` makes sense for this baseline.
    proven : callable
        What the controller's law or single samples show without doubt.
    ordinary : callable, optional
        Of what loads and archives do by themselves as well: whether the fit shows no more than that
        over the base. It is then no evidence.
    travel : callable, optional
        Of what loads do by themselves as well: how far (% of travel) one of these numbers moves in
        so many seconds.
    explains : str
        The fact of single samples or of the law (`Situation.facts`) that is this effect's; what
        nobody claims is unexplained.
    by_mv : callable, optional
        Of a valve: MV given OP.
    by_mv_leaves : float
        Share of an ideal valve's misfit to MV that the map may leave before MV counts as
        unexplained (-).
    by_lab : callable, optional
        Log-likelihood of a measurement's errors, as lab samples at some times (s) show them, under
        the effect of that size; only of effects that falsify the measurement.
    is_load_on_pv : bool
        Whether a slow load on PV, as the baseline may state one, does the same.
    needs : {"", "plant", "tuning"}
        What of the baseline must be its author's for the effect to have a meaning.
    band : callable, optional
        Range of OP (%) within which the valve rests; only of friction. After it any plant looks as
        if it integrated.
    bends_plant : bool
        PV answers OP as another plant would: asked before a record is called another loop's.
    replaces : str
        The plant's number (K, T or Td) that the effect states in place of the fit.
    initial_op_offset : callable
        Offset of OP (%) that starts a cycle: a sticky loop left at rest may stay there.
    mean_op_shift : callable
        How far (%) OP's mean over the record lies from where the record began; `half` of the
        record in s, K of the plant.
    smallest : callable
        The size that would have shown in this record.
    """

    fit: Callable[[Engine, Fit], tuple[Fit, float]] | None = None
    numbers: Callable[[Fit, Situation], Parameters] = lambda fit, s: {}
    possible: Callable[[Situation], bool] = lambda s: True
    proven: Callable[[Situation], Parameters | None] = lambda s: None
    ordinary: Callable[[Fit, Fit, Situation], bool] | None = None
    travel: Callable[[Mapping[str, float | str], float], float] | None = None
    explains: str = ""
    by_mv: Callable[[MapSearch], tuple[float, Parameters]] | None = None
    by_mv_leaves: float = 0.3
    by_lab: Callable[[Mapping[str, float | str], np.ndarray, np.ndarray, float], float] | None = (
        None
    )
    is_load_on_pv: bool = False
    needs: str = ""
    band: Callable[[Mapping[str, float | str]], float] | None = None
    bends_plant: bool = False
    replaces: str = ""
    initial_op_offset: Callable[[Mapping[str, float | str]], float] = lambda p: 0.0
    mean_op_shift: Callable[[Mapping[str, float | str], float, float], float] = lambda p, half, K: (
        0.0
    )
    smallest: Callable[[Probe], tuple[float, str] | None] = lambda probe: None


def clip(x: float, low: float, high: float) -> float:
    """Return x within low..high."""
    return float(min(max(x, low), high))
