"""Send one record to the worker process of a plug-in detector, and check its answer."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

from simbench.detectors.plugins.host import Host, PluginError, cleaned
from simbench.detectors.prepared import Prepared
from simbench.detectors.record import RECORDED_SIGNALS
from simbench.detectors.verdict import NO_STICTION, Verdict, wrong_types

_Judge = Callable[[str, Prepared, dict, bool], Verdict]


def ask_worker(
    host: Host,
    judge: _Judge,
    name: str,
    prepared: Prepared,
    thresholds: dict[str, float],
    raw: bool,
) -> Verdict:
    """Return a plug-in's verdict from its worker process."""
    bare = replace(prepared, shared={})
    bare.__dict__.update(
        {
            key: prepared.__dict__[key]
            for key in ("oscillation", "flags")
            if key in prepared.__dict__
        }
    )
    answer = host.call(_judge_there, judge, name, bare, thresholds, raw)
    if not isinstance(answer, Verdict):
        raise PluginError("answered with something that is no verdict")
    return _check_answer(name, answer)


def _judge_there(
    judge: _Judge, name: str, prepared: Prepared, thresholds: dict, raw: bool
) -> Verdict:
    """Judge a record in the worker process, and check that the plug-in did not change it."""
    for signal in RECORDED_SIGNALS:
        if (values := getattr(prepared.record, signal)) is not None:
            values.flags.writeable = False
    return judge(name, prepared, thresholds, raw)


def _check_answer(name: str, verdict: Verdict) -> Verdict:
    """Return a worker's verdict with plain numbers and one-line texts; raise PluginError if it is
    no verdict.
    """
    for wrong in wrong_types(verdict.but(score=0.0) if _not_asked(verdict) else verdict):
        raise PluginError(wrong)
    ends = {key: getattr(verdict, key) for key in "SJ"}
    return verdict.but(
        method=name,
        score=float(verdict.score),
        indices={cleaned(key): float(value) for key, value in verdict.indices.items()},
        S_unit=cleaned(str(verdict.S_unit)),
        reason=cleaned(verdict.reason),
        **{
            key: tuple(map(float, x)) if isinstance(x, tuple) else None if x is None else float(x)
            for key, x in ends.items()
        },
    )


def _not_asked(verdict: Any) -> bool:
    """Return whether a verdict is that on a record which does not oscillate: the package gives it
    the score -inf and asks no detector.
    """
    return (
        isinstance(verdict, Verdict)
        and verdict.verdict == NO_STICTION
        and isinstance(verdict.score, float)
        and verdict.score == -math.inf
    )
