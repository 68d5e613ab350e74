"""What an [[effect]] does to a loop or to the record of it: one effect per file, and the vocabulary
that all files make.

The vocabulary (ids, blocks, parameters with unit and bounds) is data: reading it loads no time
step, no simulator and no diagnosis, so that a simulator written by somebody else can share the
words and nothing more.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property, partial
from types import ModuleType

from simbench.detectors.plugins.registry import PluginFolder
from simbench.loop.parameters import FOLLOWS, Choice, Number, refuse_wrong_part

__all__ = [
    "BLOCKS",
    "EFFECTS",
    "FOLLOWS",
    "NONE",
    "PLUGINS",
    "UNKNOWN",
    "Choice",
    "Effect",
    "Number",
    "Vocabulary",
    "block_of",
]

BLOCKS = ("controller", "valve", "process", "sensor", "disturbance")
NONE = "none"
UNKNOWN = "unknown"
PLUGINS = PluginFolder(
    "effect",
    "simbench.loop.effects",
    "simbench.effects",
    ("SOURCE", "BLOCK", "PARAMETERS", "ACTS", "apply"),
    (NONE, UNKNOWN),
)
PLUGINS.refuse = partial(refuse_wrong_part, {"BLOCK": BLOCKS, "ACTS": ("loop", "record")})
# the order in which answers are listed; effects of other distributions follow
ORDER = (
    "stiction",
    "deadband",
    "deadzone",
    "valve_lag",
    "valve_characteristic",
    "gain_mismatch",
    "time_constant_mismatch",
    "dead_time_mismatch",
    "extra_lag",
    "noise",
    "quantisation",
    "sensor_lag",
    "compression",
    "outliers",
    "drift",
    "oscillation",
    "load_steps",
    "load_drift",
    "saturation",
    "detuning",
    "error_deadband",
    "op_quantisation",
    "derivative_action",
    "frozen_sensor",
    "missed_executions",
    "slew_limit",
)


@dataclass(frozen=True)
class Effect:
    """An effect's block, its parameters, its meaning in one line, and the groups (`_alike`) it may
    be mistaken within.

    Parameters
    ----------
    block : str
        Block of the loop in which it acts.
    parameters : mapping of str to Number or Choice
        What may be stated of it, with units and bounds.
    says : str
        Its meaning in one line.
    alike : tuple of str
        Groups of effects that records cannot tell apart from it.
    """

    block: str
    parameters: Mapping[str, Number | Choice]
    says: str
    alike: tuple[str, ...] = ()

    @property
    def identity(self) -> dict[str, float | str]:
        """Parameter values under which the effect changes nothing."""
        return {
            name: p.names[0] if isinstance(p, Choice) else p.identity
            for name, p in self.parameters.items()
        }


class Vocabulary(Mapping[str, Effect]):
    """Effects by their id, read from their files when first asked for: all there are, or `only`
    those named.

    Parameters
    ----------
    only : tuple of str
        Ids of the effects; all there are where it is empty.
    """

    def __init__(self, only: tuple[str, ...] = ()) -> None:
        self._only = only

    def __getitem__(self, name: str) -> Effect:
        return self._describe_all[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._describe_all)

    def __len__(self) -> int:
        return len(self._describe_all)

    def forget_all(self) -> None:
        """Read the files again when next asked: one was added, or taken out."""
        self.__dict__.pop("_describe_all", None)

    @cached_property
    def _describe_all(self) -> dict[str, Effect]:
        names = self._only or (
            list(ORDER) + [name for name in PLUGINS.names() if name not in ORDER]
        )
        return {name: _describe_effect(PLUGINS.load(name)) for name in names}


EFFECTS = Vocabulary()


def _describe_effect(module: ModuleType) -> Effect:
    first = (module.__doc__ or "").strip().partition("\n\n")[0]
    # "Dead-band: backlash between OP and MV." says what the effect is behind its name
    says = " ".join(first.partition(": ")[2].split()).rstrip(".")
    return Effect(module.BLOCK, module.PARAMETERS, says, tuple(getattr(module, "ALIKE", ())))


def block_of(effect: str) -> str:
    """Return the block of an effect id; `none` and `unknown` stand for themselves.

    Parameters
    ----------
    effect : str
        Id of an effect.

    Returns
    -------
    str
        Block of the loop.
    """
    if effect in (NONE, UNKNOWN):
        return effect
    return EFFECTS[effect].block
