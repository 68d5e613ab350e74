"""Convert what a Python user passes to `detect`: arrays, tables and runs to a record, functions and
objects to a detector.
"""

from __future__ import annotations

import copy
import inspect
import math
import numbers
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING, Any, Literal, Protocol, TypedDict

import numpy as np
from numpy.typing import ArrayLike

from simbench.detectors.errors import AnswerError, ParameterError, RecordError
from simbench.detectors.method import Method, refuse_wrong_call
from simbench.detectors.prepared import Prepared
from simbench.detectors.record import RECORDED_SIGNALS, LoopRecord
from simbench.detectors.records.io import read_columns, read_record
from simbench.detectors.verdict import (
    NO_DECISION,
    NO_STICTION,
    STICTION,
    VERDICTS,
    Verdict,
    in_data,
)

_HINT = "for example detect(op=op, pv=pv, Ts=1.0), or a DataFrame or dict with columns op, pv and t"
_WORDS = {True: STICTION, False: NO_STICTION, None: NO_DECISION}


class Recorded(Protocol):
    """Anything that carries a record, such as a simulated run."""

    @property
    def record(self) -> LoopRecord:
        """The record."""
        ...


if TYPE_CHECKING:
    import pandas as pd

    Source = LoopRecord | Recorded | str | Path | Mapping[str, Any] | pd.DataFrame

Answer = Verdict | str | bool | None | tuple[str | bool | None, float]
"""A verdict, its word, true (stiction), false, None (no decision), or one of these with a score."""


class Judging(Protocol):
    """A detector as an object: parameters in its constructor, no state; it is copied before every
    record.
    """

    def detect(self, record: LoopRecord, /) -> Answer:
        """Judge one record."""
        ...


Detector = str | Callable[[LoopRecord], Answer] | Judging
Methods = Detector | Iterable[Detector]


class About(TypedDict, total=False):
    """What is known of a record in addition to its signals; `columns` is for tables and files."""

    process: Literal["self-regulating", "integrating"] | None
    kind: Literal["flow", "level", "pressure", "temperature", "analyser"] | None
    op_span: tuple[float, float] | None
    pv_span: tuple[float, float] | None
    columns: Mapping[str, str] | None
    tag: str


class AboutFile(About, total=False):
    """What else is known of a file or folder: which of its loops, and labels to score by."""

    loop: str | None
    labels: str | Path | None
    resample: Literal["held", "linear"] | None


class RecordSignals(About, total=False):
    """The signals of a record in place of a source, and what is known of it; Ts (s) is also a
    source's, in place of the recorded one.
    """

    op: ArrayLike
    pv: ArrayLike
    sp: ArrayLike | None
    mv: ArrayLike | None
    Ts: float | None


def as_record(
    source: Any = None,
    *,
    op: ArrayLike | None = None,
    pv: ArrayLike | None = None,
    sp: ArrayLike | None = None,
    mv: ArrayLike | None = None,
    Ts: float | None = None,
    **about: Any,
) -> LoopRecord:
    """Return the record that arrays, a table, a run, a record or a file hold."""
    # The arrays that were given by name
    signals = {}
    for name, s in zip(RECORDED_SIGNALS, (op, pv, sp, mv)):
        if s is not None:
            signals[name] = s

    # Arrays alone need OP, PV and the sampling period
    if source is None:
        missing = [name for name in ("op", "pv") if name not in signals] + ["Ts"] * (Ts is None)
        if missing or Ts is None:
            raise RecordError(f"no {' and no '.join(missing)} given; a record is needed, {_HINT}")
        return read_columns(signals, Ts=Ts, **about)

    # Arrays and a source at once contradict each other
    if signals:
        raise RecordError(
            f"{', '.join(signals)} given beside a {type(source).__name__}; one of both is needed,"
            f" {_HINT}"
        )

    # A file, or a table of columns
    if isinstance(source, (str, Path)):
        return read_record(source, **about, **({} if Ts is None else {"Ts": Ts}))
    if isinstance(source, Mapping) or (hasattr(source, "columns") and hasattr(source, "index")):
        return read_columns(source, Ts=Ts, **about)

    # A record, or a run that has one
    if isinstance(source, LoopRecord):
        record = source
    else:
        record = getattr(source, "record", None)
    if not isinstance(record, LoopRecord):
        raise RecordError(
            f"{type(source).__name__} is no record; a LoopRecord, a simulated run or a file is"
            f" needed, {_HINT}"
        )

    # What was stated besides changes the record
    if Ts is None:
        changes = about
    else:
        changes = {**about, "Ts": Ts}
    if changes:
        return replace(record, **changes)
    return record


def named_methods(methods: Methods) -> tuple[list[str], dict[str, Any]]:
    """Return the ids of methods, and by their ids those that are functions or objects of the
    caller.
    """
    # One method or several
    single = isinstance(methods, str) or callable(methods) or hasattr(methods, "detect")
    names: list[str] = []
    custom: dict[str, Any] = {}

    # A name is looked up later; a function or an object is called by its name
    for method in [methods] if single else methods:  # type: ignore[union-attr]
        if isinstance(method, str):
            names.append(method)
            continue
        name = _name_of(method)
        if name in custom:
            raise ParameterError(
                f"two detectors are called {name!r}; a name of its own is needed for each"
                " (attribute `name`)"
            )
        custom[name] = method
        names.append(name)
    return names, custom


def split_names(texts: Iterable[str]) -> list[str]:
    """Return the names in texts, each of which holds one, or several with commas."""
    names = []
    for text in texts:
        for name in text.split(","):
            names.append(name.strip())
    return names


def _name_of(detector: Any) -> str:
    # An instance or a function, not a class
    if isinstance(detector, type) or not (
        callable(detector) or callable(getattr(detector, "detect", None))
    ):
        form = "a method id, a function of a record, or an object with detect(record) is needed"
        raise ParameterError(
            f"{detector!r:.60} is no detector; {form}, for example detect(record, ['horch',"
            " my_function])"
        )

    # A name that can stand in a table and a file
    name = str(
        getattr(detector, "name", None) or getattr(detector, "__name__", type(detector).__name__)
    ).lower()
    if not (name.isidentifier() and name.isascii()):
        raise ParameterError(
            f"a detector is called {name!a}; a name of letters of a to z, digits and _ is"
            " needed: a function, no lambda"
        )
    return name


def as_plugin(name: str, detector: Any) -> ModuleType:
    """Return the detector module of a function or an object of the caller."""
    title = (inspect.getdoc(detector) or name).strip().splitlines()[0]
    given = getattr(detector, "METHOD", None)
    if isinstance(given, Method):
        method = given
    else:
        method = Method(title=title, source="the caller's own")

    def detect(prepared: Prepared, **thresholds: float) -> Verdict:
        return _verdict_of(name, _fresh_copy(detector)(prepared.record, **thresholds))

    refuse_wrong_call(getattr(detector, "detect", detector), "record", method)
    module = ModuleType(name, title)
    module.__dict__.update(METHOD=method, detect=detect, __file__=None)
    return module


def _fresh_copy(detector: Any) -> Callable[..., Any]:
    """Return the function, or the `detect` of a copy of the object: nothing it learns of one record
    is known at the next.
    """
    if not hasattr(detector, "detect"):
        return detector
    if hasattr(detector, "get_params"):  # as scikit-learn's clone
        return type(detector)(**detector.get_params(deep=False)).detect
    return copy.deepcopy(detector).detect


def _verdict_of(name: str, answer: Any) -> Verdict:
    # A verdict as it is, or a word with or without a score
    if isinstance(answer, Verdict):
        return answer.but(method=name)
    if isinstance(answer, Sequence) and not isinstance(answer, str) and len(answer) == 2:
        word, score = answer
    else:
        word = answer
        score = None

    # Truth values stand for the words
    if isinstance(word, np.bool_):
        word = bool(word)
    if word is None or isinstance(word, bool):
        verdict = _WORDS.get(word)
    else:
        verdict = in_data(word)

    # Anything else is refused with an example
    if verdict not in VERDICTS or not (score is None or isinstance(score, numbers.Real)):
        form = (
            f"a Verdict, one of {', '.join(VERDICTS)}, true, false or None, or one of them with a"
            " score, is needed"
        )
        raise AnswerError(
            f"answers {answer!r:.60}; {form}, for example: return record.pv.std() > 0.5"
        )

    # A word without a score is certain
    certain = {STICTION: 1.0, NO_STICTION: 0.0}.get(str(verdict), math.nan)
    return Verdict(
        name,
        str(verdict),
        float(certain if score is None else score),
        reason=f"{name} says {verdict}",
    )
