"""`Verdict`: the answer of a detector about one record."""

from __future__ import annotations

import math
import numbers
from collections.abc import Iterator
from dataclasses import asdict, dataclass, field
from typing import Any

STICTION = "stiction"
NO_STICTION = "no_stiction"
NO_DECISION = "no_decision"
# begins the reason of a verdict that the common oscillation test gives in place of a method
NOT_OSCILLATING = "no sustained oscillation"
PROBABILITY = "probability_of_stiction"  # its key in every answer
VERDICTS = (STICTION, NO_STICTION, NO_DECISION)


def in_data(word: Any) -> Any:
    """Return a verdict as data have it, of one as a screen has it ("no stiction").

    >>> in_data("no stiction"), in_data("perhaps")
    ('no_stiction', 'perhaps')
    """
    if isinstance(word, str):
        other = word.strip().replace(" ", "_")
    else:
        other = word
    return other if other in VERDICTS else word


Level = float | tuple[float, float] | None


@dataclass(frozen=True)
class Verdict:
    """The answer of one method about one record.

    Parameters
    ----------
    method : str
        Method id.
    verdict : {"stiction", "no_stiction", "no_decision"}
        The answer; "no_decision" is one too.
    score : float
        Larger means stickier, for every method. A detector gives a finite number, or NaN with
        "no_decision" when nothing could be computed; -inf is the score of a record that does not
        oscillate, about which no detector is asked.
    indices : dict of str to float
        The numbers that led to the answer, by the names of the literature; NaN where a number does
        not exist for this record.
    S, J : float, (lo, hi) or None
        Stick band and slip jump in `S_unit`; an interval where the record does not fix the number.
    S_unit : str
        "% of travel" or "OP units".
    applicable : bool or None
        Whether the method's assumptions hold for this record; None = the record does not tell.
    reason : str
        One sentence; always given.

    Raises
    ------
    ValueError
        When the verdict is no known word or the reason is missing.

    Examples
    --------
    >>> Verdict("horch", "no_decision", reason="20 samples; at least 60 are needed").verdict
    'no_decision'
    """

    method: str
    verdict: str
    score: float = math.nan
    indices: dict[str, float] = field(default_factory=dict)
    S: Level = None
    J: Level = None
    S_unit: str = "% of travel"
    applicable: bool | None = True
    reason: str = ""

    def __post_init__(self) -> None:
        """Refuse a verdict that is no known word, or one without a reason."""
        # the words of the screen mean the same
        object.__setattr__(self, "verdict", in_data(self.verdict))
        if self.verdict not in VERDICTS:
            raise ValueError(
                f"{self.method}: verdict {self.verdict!r}; allowed: {', '.join(VERDICTS)}"
            )
        if not self.reason:
            raise ValueError(f"{self.method}: a verdict without a reason")

    def but(self, **changes: Any) -> Verdict:
        """Return the same with some fields changed, unchecked: as fast as the judging of thousands
        of records needs.

        Parameters
        ----------
        **changes
            Fields with their new values.

        Returns
        -------
        Verdict
            A new verdict; this one stays as it is.
        """
        other = object.__new__(Verdict)
        other.__dict__.update(self.__dict__, **changes)
        return other

    def as_json(self) -> dict[str, Any]:
        """Return the verdict as JSON types.

        Returns
        -------
        dict
            Every field, and the probability of stiction where the method gives one; NaN and
            infinities become null.
        """
        probability = {}
        for k in (PROBABILITY,):
            if k in self.indices:
                probability[k] = self.indices[k]
        return _as_plain(asdict(self) | probability)


def _as_plain(value: Any) -> Any:
    if isinstance(value, dict):
        return {str(k): _as_plain(v) for k, v in value.items()}
    if isinstance(value, (list, tuple)):
        return [_as_plain(v) for v in value]
    if isinstance(value, bool) or value is None or isinstance(value, str):
        return value
    number = float(value)
    return number if math.isfinite(number) else None


def wrong_types(v: Any) -> Iterator[str]:
    """Say what of an answer is not as `Verdict` describes it."""
    # The type, the word, the reason
    if not isinstance(v, Verdict):
        yield f"answers {v!r}, a simbench.detectors.verdict.Verdict is needed"
        return
    if v.verdict not in VERDICTS:
        yield f"answers {v.verdict!r}, allowed: {', '.join(VERDICTS)}"
    if not isinstance(v.reason, str) or not v.reason.strip():
        yield f"gives no reason for {v.verdict!r}"

    # The score, NaN only without a decision
    if not _is_real_number(v.score):
        yield f"gives the score {v.score!r}, a finite number is needed"
    elif not math.isfinite(v.score) and not (v.verdict == NO_DECISION and math.isnan(v.score)):
        yield (
            f"gives the score {float(v.score)!r} with {v.verdict!r}, a finite number is needed (NaN"
            f" with {NO_DECISION!r} alone)"
        )

    # The indices
    if not isinstance(v.indices, dict) or not all(
        isinstance(k, str) and _is_real_number(x) for k, x in v.indices.items()
    ):
        yield f"gives the indices {v.indices!r}, names with numbers are needed"
    else:
        for name in (k for k, x in v.indices.items() if math.isinf(x)):
            yield f"gives the index {name} = {float(v.indices[name])!r}, a finite number is needed"

    # The sizes and whether the method applies
    for key, level in (("S", v.S), ("J", v.J)):
        if isinstance(level, tuple):
            ends = level
        else:
            ends = (level,)
        if level is not None and (
            len(ends) > 2 or not all(_is_real_number(x) and math.isfinite(x) for x in ends)
        ):
            yield f"gives {key} = {level!r}, a finite number, (lo, hi) or None is needed"
    if v.applicable not in (True, False, None):
        yield f"gives applicable = {v.applicable!r}; true, false or None is needed"


def _is_real_number(x: Any) -> bool:
    # nearly all are floats; asking an abstract class takes twenty times as long
    return type(x) is float or (isinstance(x, numbers.Real) and not isinstance(x, bool))
