"""Say in numbers of the plant what a record has and its simulations have not."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict, dataclass
from typing import Any, NamedTuple

import numpy as np

from simbench.gap.closed_loop.gap import BANDS, HANN, PEAK, REST, Compared, held_out
from simbench.gap.situation import Situation
from simbench.gap.thresholds import PLAINLY

_SENSOR = "sensor"
_CONTROLLER = "controller"
_PROCESS = "process"
_LOAD = "disturbance"


class _Kind(NamedTuple):
    """A feature in words, the unit of its value, how the value follows from the feature, and the
    block in which a difference of PV and of OP is looked for first.
    """

    says: str
    unit: str
    value: Callable[[float], float]
    blocks: tuple[str, str] = (_LOAD, _LOAD)


def _percent_of_log(added: float) -> Callable[[float], float]:
    """Return how a share follows from its logarithm, to which something was added."""
    return lambda x: 100.0 * max(round(float(np.exp(x)) - added, 9), 0.0)


_share = _percent_of_log(REST)
_SAMPLES = _SENSOR, _CONTROLLER
_KINDS = {
    "size": _Kind("standard deviation of {}", "size", np.exp),
    "change": _Kind("standard deviation of {} from sample to sample", "size", np.exp, _SAMPLES),
    "kurtosis": _Kind("kurtosis of {}", "", np.expm1),
    "change kurtosis": _Kind("kurtosis of the changes of {}", "", np.expm1, _SAMPLES),
    "at rest": _Kind("share of samples in which {} repeats its last value", "%", _share, _SAMPLES),
    "straight": _Kind(
        "share of samples in which {} runs on in a straight line", "%", _share, _SAMPLES
    ),
    "at limit": _Kind(
        "share of samples of {} at its largest or smallest value", "%", _share, _SAMPLES
    ),
    "band": _Kind("standard deviation of {} at periods of {}", "size", np.exp),
    "sharpness": _Kind(
        "power of {} in its three strongest frequencies", "%", _percent_of_log(PEAK)
    ),
    "wander": _Kind("wandering of the mean of {} over its standard deviation", "", float),
    "memory": _Kind("correlation of {} with itself {} before", "", float),
    "op after pv": _Kind(
        "correlation of changes of OP with those of PV {} before", "", float, (_CONTROLLER,) * 2
    ),
    "pv after op": _Kind(
        "correlation of changes of PV with those of OP {} before", "", float, (_PROCESS,) * 2
    ),
}


@dataclass(frozen=True)
class Remaining:
    """One feature in which a record differs from its simulations: in words with its unit, the block
    in which to look first, both values, and the distance (standard deviations between simulations).
    """

    feature: str
    block: str
    recorded: float
    simulated: tuple[float, float]
    distance: float

    def sentence(self) -> str:
        """Return the difference in words."""
        lo, hi = self.simulated
        return (
            f"{self.block}: {self.feature} is {self.recorded:.3g}, simulated {lo:.3g} to {hi:.3g}"
        )

    @classmethod
    def from_json(cls, one: dict[str, Any]) -> Remaining:
        """Return the difference that `as_json` gave."""
        lo, hi = one["simulated"]
        return cls(**{**one, "simulated": (lo, hi)})

    def as_json(self) -> dict[str, Any]:
        """Return the difference as the contract has it."""
        return asdict(self) | {"simulated": list(self.simulated)}


def remaining(situation: Situation, compared: dict[str, Compared]) -> tuple[Remaining, ...]:
    """Return the features that are plainly outside of what the simulations do, the farthest first.

    The first of each kind and signal alone: neighbouring bands and lags say the same.
    """
    found: dict[str, Remaining] = {}
    for name, one in sorted(compared.items(), key=lambda item: -item[1].distance):
        if one.distance > PLAINLY and not one.lo <= one.recorded <= one.hi:
            found.setdefault(name.rstrip("0123456789 "), _in_words(name, one, situation))
    return tuple(found.values())


def _in_words(name: str, one: Compared, s: Situation) -> Remaining:
    """Return a feature with its values in the units of the plant."""
    if name[-1].isdigit():
        kind, _, number = name.rpartition(" ")
    else:
        kind = name
        number = ""
    signal, _, what = kind.partition(" ")
    known = _KINDS[kind if "after" in what else what]
    samples = s.record.n - held_out(s)
    Ts = s.record.Ts
    where = ""
    if what == "band":
        edges = np.unique(np.geomspace(2, samples // 2 + 1, BANDS + 1).astype(int))
        short = samples * Ts / edges[int(number) - 0]
        long = samples * Ts / edges[int(number) - 1]
        where = f"{short:.3g} to {long:.3g} s"
    elif number:
        where = f"{int(number) * Ts:.3g} s"

    def value(x: float) -> float:
        if what == "band":
            # both halves of the spectrum, of a signal under a window
            return float(np.sqrt(2.0 * np.exp(x) / (HANN * samples)))
        return float(known.value(x))

    unit = {"size": "PV units" if signal == "pv" else s.record.S_unit}.get(known.unit, known.unit)
    words = known.says.format(*([] if "after" in what else [signal.upper()]), where)
    return Remaining(
        words + (f" ({unit})" if unit else ""),
        known.blocks[signal == "op"],
        value(one.recorded),
        (value(one.lo), value(one.hi)),
        one.distance,
    )
