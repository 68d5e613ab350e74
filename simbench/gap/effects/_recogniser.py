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
NOT_TRIED = -10.0  # nats of an effect for which nothing could speak


@dataclass(frozen=True)
class Recogniser:
    """How one effect is recognised; what does not apply to an effect stays at its default."""

    # the likeliest fit with the effect on top of a base, and how many numbers it pays for; the base
    # itself where nothing was switched on. Absent for what the likelihood of PV given OP does not
    # see.
    fit: Callable[[Engine, Fit], tuple[Fit, float]] | None = None
    # the effect's numbers in the units of the loop file; needed with `fit`
    numbers: Callable[[Fit, Situation], Parameters] = lambda fit, s: {}
    # whether `fit` makes sense for this baseline
    possible: Callable[[Situation], bool] = lambda s: True
    # what the controller's law or single samples show without doubt
    proven: Callable[[Situation], Parameters | None] = lambda s: None
    # of what loads do by themselves as well: whether the fit shows no more than that. It is then
    # allowed to every candidate, and only named where nothing else explains the record.
    ordinary: Callable[[Fit, Fit], bool] | None = None
    # the fact of single samples or of the law (`Situation.facts`) that is this effect's; what
    # nobody claims is unexplained
    explains: str = ""
    by_mv: Callable[[MapSearch], tuple[float, Parameters]] | None = None  # of a valve: MV given OP
    # share of an ideal valve's misfit to MV that the map may leave before MV counts as unexplained
    by_mv_leaves: float = 0.3
    # log-likelihood of a measurement's errors, as lab samples at some times (s) show them, under
    # the effect of that size; only of effects that falsify the measurement
    by_lab: Callable[[Mapping[str, float | str], np.ndarray, np.ndarray, float], float] | None = (
        None
    )
    # evidence in the innovations of the fit without effect, where the samples themselves were not
    # conclusive
    by_innovations: Callable[[Fit, Situation], tuple[float, Parameters] | None] = lambda base, s: (
        None
    )
    # whether something proven makes all the evidence of this effect
    masked_by_archive: Callable[[Situation], bool] = lambda s: False
    # what the record shows of it besides the answer; "" for nothing
    remark: Callable[[Situation], str] = lambda s: ""
    # {"", "plant", "tuning"}: what of the baseline must be its author's for the effect to have a
    # meaning
    needs: str = ""
    # range of OP (%) within which the valve rests; only of friction. After it any plant looks as
    # if it integrated.
    band: Callable[[Mapping[str, float | str]], float] | None = None
    # PV answers OP as another plant would: asked before a record is called another loop's
    bends_plant: bool = False
    # even the right fit leaves jumps, spells and heavy tails in the innovations
    leaves_traces: bool = False
    replaces: str = ""  # the plant's number (K, T or Td) that the effect states in place of the fit
    # offset of OP (%) that starts a cycle: a sticky loop left at rest may stay there
    initial_op_offset: Callable[[Mapping[str, float | str]], float] = lambda p: 0.0
    # how far (%) OP's mean over the record lies from where the record began; `half` of the record
    # in s, K of the plant
    mean_op_shift: Callable[[Mapping[str, float | str], float, float], float] = lambda p, half, K: (
        0.0
    )
    # the size that would have shown in this record
    smallest: Callable[[Probe], tuple[float, str] | None] = lambda probe: None


def clip(x: float, low: float, high: float) -> float:
    """Return x within low..high."""
    return float(min(max(x, low), high))
