"""Score one answer of the blind test against the truth."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import pandas as pd

from results.studies.withheld.distance import RESOLVABLE
from results.studies.withheld.world import KNOWN_AS
from simbench.loop.effects import EFFECTS, NONE, UNKNOWN, Number
from simbench.loop.effects._alike import Circumstances, circumstances, indistinguishable


def judge_record(
    truth: Mapping[str, Any], answer: Mapping[str, Any] | None, here: Circumstances
) -> dict[str, Any]:
    """Compare one answer with the truth."""
    effect, second = _text(truth.get("effect")) or NONE, _text(truth.get("effect2"))
    foreign = effect not in EFFECTS and effect != NONE
    kind = "none" if effect == NONE else "foreign" if foreign else "two" if second else "single"
    answered = answer is not None and "effect" in answer
    answer = (
        answer if answer is not None and answered else {"effect": "", "block": "", "ranking": []}
    )
    named, order = str(answer["effect"]), first_three(answer)
    block = _text(truth.get("block")) or (EFFECTS[effect].block if effect in EFFECTS else effect)
    strange = (_text(truth.get("foreign")) or effect) if foreign else ""
    # a foreign kind may have joined the library since its world was written: its name is as
    # right as `unknown`
    if foreign:
        # where the diagnosis is asked without an effect, one that looks the same is as right
        known = KNOWN_AS.get(strange, strange)
        alike = indistinguishable(known, here) if known in EFFECTS else frozenset({known})
        group = alike | {UNKNOWN}
    else:
        group = indistinguishable(effect, here)
    right = group if foreign else {effect}
    probability = {str(r["effect"]): r.get("probability") or 0.0 for r in answer.get("ranking", [])}
    ratio = _number(truth.get("ratio"))
    in_group = named in group
    accepted = {effect, second} if kind == "two" else group
    return {
        "id": truth.get("id"),
        "kind": kind,
        "effect": UNKNOWN if foreign else effect,
        "block": block,
        "effect2": second,
        "foreign": strange,
        "strength": _text(truth.get("strength")),
        "ratio": ratio,
        "mv": here.mv,
        "answered": answered,
        "named": named,
        "named_block": str(answer.get("block", "")),
        "probability": probability.get(named, 0.0),
        "probability_of_group": sum(
            p for e, p in probability.items() if e in indistinguishable(named, here)
        ),
        "first": named in right,
        "in_group": in_group,
        "top3": bool(right & set(order)),
        "top3_group": bool(group & set(order)),
        "block_right": in_group or str(answer.get("block", "")) == block,
        "one_of_two": named in accepted,
        "both_top3": kind == "two" and {effect, second} <= set(order),
        "both_named": kind == "two"
        and {effect, second} == {str(x["effect"]) for x in answer.get("effects") or []},
        "called_unknown": named == UNKNOWN,
        "called_none": named == NONE,
        "resolvable": ratio is None or ratio >= RESOLVABLE,
        **{f"near_{when}": _near(answer, when) for when in ("before", "after")},
        "shrinkage_true": _number(truth.get("shrinkage")),
        "shrinkage_claimed": _number((answer.get("shrinkage") or {}).get("value")),
        **_claims(answer, group, kind),
        "parameter_error": _parameter_error(effect, truth.get("parameters"), answer)
        if named == effect and kind == "single"
        else None,
    }


def first_three(answer: Mapping[str, Any]) -> list[str]:
    """Return an answer's first three candidates: those it names, then its ranking, `none` and
    `unknown` included.
    """
    ranked = sorted(answer.get("ranking") or [], key=lambda r: -(r.get("probability") or 0.0))
    named = [str(x["effect"]) for x in answer.get("effects") or []] or [str(answer["effect"])]
    return list(dict.fromkeys(named + [str(r["effect"]) for r in ranked]))[:3]


def claimed_shrinkage(candidate: Mapping[str, Any], answer: Mapping[str, Any]) -> float | None:
    """Return the share of the gap that a ranked candidate closes by its answer, None where that
    has no resolvable gap.
    """
    gap = answer.get("gap") or {}
    before, after, floor = (
        _number(x)
        for x in (candidate.get("gap_before"), candidate.get("gap_after"), gap.get("floor"))
    )
    if (
        before is None
        or after is None
        or floor is None
        or not gap.get("resolvable")
        or before <= floor
    ):
        return None
    return 1.0 - max(after - floor, 0.0) / (before - floor)


def _near(answer: Mapping[str, Any], when: str) -> bool | None:
    """Whether simulations come within so many floors of the plant; None where none is stated."""
    gap = answer.get("gap") or {}
    size, floor = _number(gap.get(when)), _number(gap.get("plant_floor"))
    return None if size is None or floor is None else size <= RESOLVABLE * floor


def _claims(answer: Mapping[str, Any], group: frozenset[str], kind: str) -> dict[str, float | None]:
    shares = {str(r["effect"]): claimed_shrinkage(r, answer) for r in answer.get("ranking") or []}
    closed: dict[bool, list[float]] = {True: [], False: []}
    for effect, share in shares.items():
        if kind == "single" and effect in EFFECTS and share is not None:
            closed[effect in group].append(share)
    names = {"claim_right": True, "claim_wrong": False}
    return {name: max(closed[right], default=None) for name, right in names.items()}


def _parameter_error(effect: str, truth: Any, answer: Mapping[str, Any]) -> float | None:
    """Largest relative error over the effect's numbers that are not at their identity; J excepted,
    R by its logarithm.
    """
    mine = next(
        (
            x.get("parameters") or {}
            for x in answer.get("effects") or []
            if x.get("effect") == effect
        ),
        None,
    )
    if not isinstance(truth, Mapping) or mine is None:
        return None
    errors = []
    for name, quantity in EFFECTS[effect].parameters.items():
        true, got = _number(truth.get(name)), _number(mine.get(name))
        if not isinstance(quantity, Number) or name in ("J", "c"):
            continue
        if true is None or true == quantity.identity:
            continue
        got = quantity.identity if got is None else got
        if name == "R":
            true, got = math.log(true), math.log(max(got, 1e-9))
        errors.append(abs(got - true) / abs(true))
    return max(errors, default=None)


def true_circumstances(
    truth: Mapping[str, Any], baseline: Mapping[str, Any], record: pd.DataFrame
) -> Circumstances:
    """Return what decides the true effect's group, from baseline, record and the row of
    answers.csv.
    """
    signal = {
        c: record[c].to_numpy(float) if c in record else None for c in ("sp", "op", "pv", "mv")
    }
    p, noise = truth.get("parameters"), float(baseline.get("noise", {}).get("std", 0.0))
    effect, p = _text(truth.get("effect")), p if isinstance(p, Mapping) else None
    return circumstances(baseline.get("plant", {}), noise, **signal, effect=effect, parameters=p)


def _text(value: Any) -> str:
    return "" if pd.isna(value) else str(value).strip()


def _number(value: Any) -> float | None:
    try:
        x = float(value)
    except (TypeError, ValueError):
        return None
    return x if math.isfinite(x) else None
