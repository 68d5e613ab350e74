"""Tell S and J of a valve with their intervals, as far as one record tells."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import product

import numpy as np

from simbench.gap.decide.assess import Assessment
from simbench.gap.likelihood import kernels
from simbench.gap.likelihood.engine import Engine
from simbench.gap.likelihood.valve_map import MapSearch
from simbench.gap.situation import load_memory
from simbench.gap.stiction.friction import passes
from simbench.gap.thresholds import AS_GOOD, REFITTED

_OFF = np.geomspace(0.002, 1.0, 25)  # logarithms of the factors of S that are tried
_FACTORS = np.exp(np.concatenate([-_OFF, [0.0], _OFF]))
_SHARES = np.linspace(0.02, 1.0, 13)  # of S at which J is tried
_ANYTHING = 0.8  # of S, that an interval of J spans which tells nothing
_STARTS = (-0.5, 0.0, 0.5)  # of S by which MV may stand off OP when the record begins

Levels = Callable[[np.ndarray], np.ndarray]


@dataclass(frozen=True)
class Size:
    """A number with its interval, which is open (`hi` infinite) where only a bound is seen."""

    value: float
    lo: float
    hi: float

    def scaled(self, by: float) -> Size:
        """Return the size in another unit."""
        return Size(self.value * by, self.lo * by, self.hi * by)

    def sentence(self, name: str) -> str:
        """Return number and interval in words, under a name."""
        if np.isinf(self.hi):
            return f"{name} is at least {self.lo:.3g}"
        return f"{name} = {self.value:.3g} ({self.lo:.3g} to {self.hi:.3g})"


def describe_sizes(S: Size, J: Size, unit: str) -> str:
    """Return sizes and their intervals in words; a J that may be nearly anything is none."""
    if S.hi > 0.0:
        said = [S.sentence("S")]
    else:
        said = []
    if J.hi - J.lo > _ANYTHING * S.value > 0.0:
        said.append(f"J is not identifiable ({J.lo:.2g} to {J.hi:.2g})")
    elif J.hi > 0.0:
        said.append(J.sentence("J"))
    return f"{', '.join(said)} {unit}"


def sizes_of(assessment: Assessment, effect: str) -> tuple[Size, Size] | None:
    """Return S and J (%) of an effect with friction, each with its interval; None where it was not
    fitted.
    """
    # The fitted sizes
    numbers = assessment.parameters.get(effect)
    if numbers is None:
        return None
    S = float(numbers["S"])
    J = float(numbers.get("J", 0.0))

    # Likelihoods of sizes near them, by MV or by PV
    s = assessment.situation
    if s.record.mv is not None:
        search = MapSearch(s.op, np.asarray(s.record.mv), s.record.Ts, s.op, late=s.data.late)
        levels = _by_mv(search)
    elif effect in assessment.candidates:
        levels = _by_pv(assessment, effect)
    else:
        return None

    # Their spread; a band that OP never crossed has no upper end
    size, jump = _spread_of_sizes(levels, S, J)
    return (size if passes(S, s.op) else replace(size, hi=np.inf)), jump


def _by_pv(assessment: Assessment, effect: str) -> Levels:
    """Return what gives valves (p, 3) their log-likelihood, with plant, load and noise held."""
    fit = assessment.candidates[effect].fit
    data = assessment.situation.data
    engine = Engine(data, load_memory(assessment.situation))
    bare = replace(fit.spec, valve=kernels.IDEAL, start=0.0)
    if fit.spec.valve == kernels.PLAY:
        kind = kernels.STICK
    else:
        kind = fit.spec.valve
    return lambda points: engine.scan(bare, fit.theta, kind, points)


def _by_mv(search: MapSearch) -> Levels:
    """Return what gives valves (p, 3) their log-likelihood given MV."""

    def levels(points: np.ndarray) -> np.ndarray:
        moved = (search.moved(kernels.STICK, S, J) for S, J, _ in points)
        return -np.array([search.level(mv) for mv in moved])

    return levels


def _spread_of_sizes(levels: Levels, S: float, J: float) -> tuple[Size, Size]:
    """Return S and J with the range of the valves that explain nearly as much as the best."""
    if J > 0.0:
        shares = [J / S, *_SHARES]
    else:
        shares = [0.0]
    grid = product(_FACTORS, shares, _STARTS)
    points = np.array([(S * f, S * f * j, S * f * b) for f, j, b in grid])
    value = levels(points)
    [none] = levels(np.array([(1e-6 * S, 0.0, 0.0)]))
    best = float(value.max())
    near = points[value >= best - max(AS_GOOD * (best - none), REFITTED)]

    # up to the next size that was tried: the peak may lie between them
    step = float(np.exp(_OFF[0]))

    # friction that is next to none explains as much
    if none >= best - REFITTED:
        least = 0.0
    else:
        least = float(near[:, 0].min()) / step
    return (
        Size(S, min(S, least), max(S, step * float(near[:, 0].max()))),
        Size(J, min(J, float(near[:, 1].min()) / step), max(J, step * float(near[:, 1].max()))),
    )
