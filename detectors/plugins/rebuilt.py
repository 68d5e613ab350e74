"""What a detector of others says of itself and of records, rebuilt from plain values, each checked."""

from __future__ import annotations

import numbers
from typing import Any

from detectors.method import Method, Threshold
from detectors.plugins.host import PluginError
from detectors.record import PROCESSES
from detectors.verdict import Verdict, wrong_types

_VERDICT = vars(Verdict("x", "no_decision", reason="x"))
METHOD_FIELDS = {key: value for key, value in vars(Method("x", "x")).items() if key not in ("exempt", "published")}
_THRESHOLD = vars(Threshold(0.0, "x", 0.0, 0.0, "x", "x"))


def number_of(value: Any, what: str) -> float:
    """Return a number as a float, or raise PluginError."""
    try:
        if isinstance(value, numbers.Real) and not isinstance(value, bool):
            return float(value)
    except OverflowError:  # a whole number of hundreds of digits
        pass
    raise PluginError(f"gives {what} = {value!r:.60}, which is no number")


def verdict_of(name: str, said: Any) -> Verdict:
    """Rebuild a verdict under the name it was asked by, or raise PluginError."""
    said = said if isinstance(said, dict) else {}
    fields = {key: tuple(v) if isinstance(v := said.get(key), list) else v for key in _VERDICT}
    verdict = Verdict(name, "no_decision", reason="x").but(**{**fields, "method": name})
    for wrong in wrong_types(verdict):
        raise PluginError(f"{wrong:.300}")
    numbers_of = {key: number_of(value, key) for key, value in verdict.indices.items()}
    levels = {key: fields[key] if fields[key] is None or isinstance(fields[key], tuple) else float(fields[key]) for key in "SJ"}
    return verdict.but(score=float(verdict.score), indices=numbers_of, S_unit=str(verdict.S_unit), **levels)


def method_of(said: Any) -> Method:
    """Rebuild a detector's description of itself, or raise PluginError."""
    if not isinstance(said, dict):
        raise PluginError("METHOD is no detectors.method.Method")
    fields = {key: _like(example, said.get(key), f"METHOD.{key}") for key, example in METHOD_FIELDS.items()}
    if not fields["process"] or not set(fields["process"]) <= set(PROCESSES):
        raise PluginError(f"METHOD.process = {fields['process']}; known: {', '.join(PROCESSES)}")
    rules = {
        key: Threshold(**{k: _like(example, rule.get(k), f"{key}.{k}") for k, example in _THRESHOLD.items()})
        for key, rule in fields["thresholds"].items()
    }
    return Method(**{**fields, "thresholds": rules})


def _like(example: Any, value: Any, what: str) -> Any:
    """Return a value of the kind of an example's: words, yes or no, a number, names, or a table of tables."""
    if isinstance(example, tuple) and isinstance(value, list) and all(isinstance(v, str) for v in value):
        return tuple(value)
    if isinstance(example, dict) and isinstance(value, dict) and all(isinstance(v, dict) for v in value.values()):
        return value
    if isinstance(example, (str, bool)) and type(value) is type(example) and value != "":
        return value
    if isinstance(example, (str, bool, tuple, dict)):
        raise PluginError(f"{what} = {value!r:.60}; {'words are' if isinstance(example, str) else 'another kind is'} needed")
    return type(example)(number_of(value, what))
