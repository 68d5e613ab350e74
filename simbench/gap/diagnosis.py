"""diagnose(): one record beside one loop file, from the check to the report."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from detectors.record import LoopRecord
from scenarios.spec import Loop
from simbench.gap import groups
from simbench.gap.assess import Assessment, assess
from simbench.gap.check import Situation, check
from simbench.gap.fixed import fixed_loop
from simbench.gap.names import BLOCKS, EFFECTS, NONE, UNKNOWN, block_of
from simbench.gap.result import Gap, GapReport, Ranked
from simbench.gap.shrink import Arm, Shrinkage, measure, simulate_arm
from simbench.gap.weigh import Weights, weigh


def diagnose(
    record: LoopRecord | Sequence[LoopRecord],
    baseline: Loop | None,
    *,
    bootstrap: bool = True,
    jobs: int = 1,
    seed: int = 0,
) -> GapReport:
    """Say where a simulation differs from a record, which effect it lacks, and how far adding it closes the gap.

    Parameters
    ----------
    record : LoopRecord or sequence of them
        SP, OP, PV and, where recorded, MV. Several records of one loop are judged together.
    baseline : Loop or None
        The simulation; None identifies plant and tuning from the record.
    bootstrap : bool
        Calibrate "no effect" and "unknown" on records simulated for this very loop.
    jobs : int
        Processes for the bootstrap; -1 uses all cores.
    seed : int
        Root of every random stream.

    Returns
    -------
    GapReport

    Raises
    ------
    detectors.errors.UserError
        In one sentence, when record and baseline cannot be compared.

    Examples
    --------
    >>> from simbench.gap.study import random_case
    >>> case = random_case(3, ("detuning",))
    >>> diagnose(case.record, case.baseline, bootstrap=False).effect
    'detuning'
    """
    situation = check(record, baseline)
    found = assess(situation)
    weights = weigh(found)
    return report(found, weights, seed)


def report(found: Assessment, weights: Weights, seed: int) -> GapReport:
    """Turn scores and probabilities into the answer."""
    situation = found.situation
    ranking = sorted(weights.probability.items(), key=lambda kv: -kv[1])
    first = ranking[0][0]
    named = [first] if first in (NONE, UNKNOWN) else [first, *[e for e in found.chosen if e != first]][:2]
    if first not in (NONE, UNKNOWN) and first not in found.chosen:
        named = [first]
    arms = Arms(found, seed)
    shown = {e: arms.shrink([e]) for e, _ in ranking[:3] if e in EFFECTS}
    effects = [e for e in named if e in EFFECTS]
    main = arms.shrink(effects) if effects else arms.shrink([])
    lines = [
        Ranked(
            e, _block(e, weights), float(p), main.before if e in shown or e == first else None,
            shown[e].after if e in shown else None, found.parameters.get(e, {}),
        )
        for e, p in ranking
    ]  # fmt: skip
    gap = Gap(main.before, main.recalibrated, main.after, main.floor, main.resolvable)
    shrinkage = None
    if main.value is not None and effects:
        shrinkage = {"value": main.value, "lo": min(main.lo, main.value), "hi": max(main.hi, main.value)}
    answers = tuple(
        {"block": _block(e, weights), "effect": e, "parameters": found.parameters.get(e, {}), "probability": float(weights.named[e])}
        for e in named
    )
    group = partners(first, found)
    return GapReport(
        block=_block(first, weights), effect=first, effects=answers, group=group, ranking=tuple(lines), gap=gap, shrinkage=shrinkage,
        blocks=weights.blocks, next_test="", notes=tuple(situation.notes),
        details={"found": found, "arms": arms, "main": main},
    )  # fmt: skip


def partners(effect: str, found: Assessment) -> tuple[str, ...]:
    """Return the group of effects that these signals cannot tell from one."""
    if effect not in EFFECTS:
        return (effect,)
    s = found.situation
    facts = groups.facts_of(
        s.baseline.to_table(), s.record.sp, s.op, np.asarray(s.record.pv), s.record.mv, effect, found.parameters.get(effect)
    )
    return tuple(sorted(groups.indistinguishable(effect, facts)))


def _block(effect: str, weights: Weights) -> str:
    return weights.unknown_block if effect == UNKNOWN else block_of(effect)


class Arms:
    """Simulated loops of one diagnosis, each run once."""

    def __init__(self, found: Assessment, seed: int) -> None:
        self.found, self.seed = found, seed
        self.done: dict[tuple[str, ...], Shrinkage] = {}
        self.kept: dict[tuple[str, ...], tuple[Arm, Arm, Arm]] = {}

    def loop(self, effects: Sequence[str], plant: str = "fitted") -> Loop:
        """Return the baseline with some effects in it."""
        f = self.found
        fit = self._fit(effects)
        return fixed_loop(f.situation, fit, {e: f.parameters[e] for e in effects if e in f.parameters}, plant=plant, load=fit)

    def _fit(self, effects: Sequence[str]):
        f = self.found
        if list(effects) == f.chosen:
            return f.final
        engine = [e for e in effects if e in f.candidates]
        return f.candidates[engine[0]].fit if engine else f.base

    def shrink(self, effects: Sequence[str]) -> Shrinkage:
        """Return gap before, recalibrated, after and floor for some effects."""
        key = tuple(effects)
        if key not in self.done:
            f, s = self.found, self.found.situation
            fit = self._fit(effects)
            kick = float(f.parameters.get("stiction", {}).get("S", 0.0)) if "stiction" in key else 0.0
            bare = fixed_loop(s, f.base, {}, plant="baseline", load=fit)
            tuned = fixed_loop(s, f.base, {}, plant="fitted", load=fit)
            before = simulate_arm(s, bare, self.seed)
            again = simulate_arm(s, tuned, self.seed) or before
            after = simulate_arm(s, self.loop(effects), self.seed, kick) if key else again
            assert before is not None
            self.kept[key] = (before, again or before, after or before)
            self.done[key] = measure(s, *self.kept[key], seed=self.seed)
        return self.done[key]


__all__ = ["BLOCKS", "Situation", "diagnose"]
