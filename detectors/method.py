"""`Method`: the description of a detector, which each detector file contains."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from typing import Any

from simbench.detectors.errors import AnswerError
from simbench.detectors.record import PROCESSES


@dataclass(frozen=True)
class Threshold:
    """One number on which a verdict depends, with its meaning and unit.

    Parameters
    ----------
    default : float
        The published value, or a calibration of this package where none is published.
    unit : str
        Its unit; "-" for ratios.
    low, high : float
        The least and the largest value that a user may set.
    source : str
        Where the default comes from: author, year, equation, or the study that measured it.
    says : str
        What lies on its two sides, in one sentence.
    """

    default: float
    unit: str
    low: float
    high: float
    source: str
    says: str


@dataclass(frozen=True)
class Method:
    """A detector's description; the runner reads it before it runs the detector."""

    title: str  # what the method looks for, in a few words
    source: str  # author, year, equation
    process: tuple[str, ...] = (
        "self-regulating",
        "integrating",
    )  # process types the method was made for
    # whether it judges OP against the valve position (MV, or PV of a flow loop)
    needs_mv: bool = False
    # {"stiction", "nonlinearity", "quantification"}: nonlinearity tests are left out of the
    # stiction ranking
    role: str = "stiction"
    budget: str = "fast"  # {"fast", "full"}: whether it belongs to the quick set of methods
    min_samples: int = 60  # fewer samples than this: no decision
    min_periods: float = 3.0  # fewer oscillation periods than this: no decision
    front_end: bool = True  # false for a method that has an oscillation test of its kind
    cannot_cope: tuple[str, ...] = ()  # data-quality flags under which the method abstains
    # given the whole record as it came, neither the half that oscillates nor every so many-th
    # sample
    whole: bool = False
    # given MV where it was recorded, but judges without it too; in a ranking it gets none
    takes_mv: bool = False
    # keyword arguments of `detect` that a user or a calibration may set
    thresholds: dict[str, Threshold] = field(default_factory=dict)
    # grids whose loops, of other seeds, the method's constants were fitted to
    fitted_on: tuple[str, ...] = ()
    # whether its numbers are weights that a classifier or a regression learned from such loops
    learned: bool = False
    # which of S and J come as intervals that should hold the truth in nine cases of ten; any
    # other interval is what fits the record, without a level
    stated: tuple[str, ...] = ()
    # thresholds at which the method is its source and nothing else; empty when its defaults are
    # that, or when the source gives no numbers. `NAME@published` is the method with these.
    published: dict[str, float] = field(default_factory=dict)
    # the same where Jelali's chapter differs from the method's source; `NAME@chapter`
    chapter: dict[str, float] = field(default_factory=dict)

    @property
    def division(self) -> str:
        """Whose numbers it has: "published", "tuned" here to simulated loops, or "learned"."""
        if self.learned:
            return "learned"
        if self.fitted_on:
            return "tuned"
        return "published"

    def defaults(self) -> dict[str, float]:
        """Return the default of every threshold."""
        return {name: t.default for name, t in self.thresholds.items()}

    def as_published(self, chapter: bool = False) -> Method:
        """Return the method with the thresholds of its source, or of the chapter, as defaults.

        As published it is given the whole record, as anyone would give it who implements the
        source.
        """
        its = self.published | (self.chapter if chapter else {})
        at = {}
        for k, t in self.thresholds.items():
            at[k] = replace(t, default=its.get(k, t.default))
        where = "in the chapter" if chapter else "as published"
        whole = self.whole or not chapter
        title = f"{self.title}, {where}"
        return replace(
            self, title=title, whole=whole, thresholds=at, fitted_on=(), published={}, chapter={}
        )


def wrong_fields(method: Any) -> Iterator[str]:
    """Return what is wrong in a detector's description, compared with `Method`."""
    if not isinstance(method, Method):
        yield f"METHOD = {method!r:.60}; a simbench.detectors.method.Method is needed"
        return
    for key, example in vars(Method("x", "x")).items():
        value = getattr(method, key)
        kind = {float: (int, float), tuple: (tuple, list)}.get(type(example), type(example))
        if not isinstance(value, kind) or value == "":
            yield f"METHOD.{key} = {value!r:.60}; a {type(example).__name__} is needed"
    if not method.process or not set(method.process) <= set(PROCESSES):
        yield f"METHOD.process = {method.process}; known: {', '.join(PROCESSES)}"
    if not all(isinstance(rule, Threshold) for rule in method.thresholds.values()):
        yield "METHOD.thresholds holds what is no simbench.detectors.method.Threshold"


def refuse_wrong_call(function: Callable, first: str, method: Method) -> None:
    """Raise AnswerError, with the right form, if a detector cannot be called with a record and its
    thresholds by keyword.
    """
    try:
        inspect.signature(function).bind(None, **method.defaults())
    except TypeError:
        form = ", ".join([first] + ["*"] * bool(method.thresholds) + list(method.thresholds))
        signature = f"{getattr(function, '__name__', 'detect')}{inspect.signature(function)}"
        raise AnswerError(
            f"{signature} cannot be called with one record; the right form is: def detect({form})"
        ) from None
    except ValueError:  # a function of C, which does not tell
        pass
