"""Which test on the plant to run next: a fixed order, each test sized for the loop and simulated
within limits.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from simbench.detectors.errors import Refusal
from simbench.gap.closed_loop.runs import ClosedLoops
from simbench.gap.decide.assess import Assessment
from simbench.gap.effects import recogniser
from simbench.gap.planning.menu import Limits, Trial, size_test
from simbench.gap.thresholds import NO_TEST_FROM
from simbench.loop.effects import NONE, UNKNOWN

if TYPE_CHECKING:
    import pandas as pd

# MV tells most, then steps of SP; of the others none is worth more than another by what it adds to
# the probability of the truth (results/plant_tests.txt). A raw log comes first, where the archive
# hides the law of OP. Tests chosen for each record by their expected information did no better than
# a fixed order: 59 of 66 effects named rightly after two, against 58.
ORDER = ("raw", "mv", "sp_steps", "lab", "stairs", "kc_half", "bump", "still")
_EXPLANATIONS = 5  # likeliest explanations under which a test must stay within its limits


@dataclass(frozen=True, eq=False)
class PlannedTests:
    """The tests that are left, in their order; or why none is recommended.

    Parameters
    ----------
    tests : tuple of Trial
        What to run, the first first.
    why : str
        Why no test is recommended; "" where one is.
    left_out : tuple of str
        A reason for each test that the limits forbid.
    far : str
        What is to be known first where the model is far from the record; "" where it is near.
    op_unit : str
        Unit of OP's moves: "% of travel", or "OP units".
    """

    tests: tuple[Trial, ...] = ()
    why: str = ""
    left_out: tuple[str, ...] = ()
    far: str = ""
    op_unit: str = "% of travel"

    def __repr__(self) -> str:
        """Return one line."""
        return f"PlannedTests: {self.sentence()}"

    def to_frame(self) -> pd.DataFrame:
        """Return one row per test, in the order in which they are recommended.

        Returns
        -------
        DataFrame
            test, says, minutes, and how far PV (PV units) and OP (`op_unit`) move.
        """
        import pandas as pd

        names = {"test": "id", "says": "says", "minutes": "minutes"}
        names |= {name: name for name in ("pv_excursion", "op_travel")}
        return pd.DataFrame(
            {name: [getattr(x, own) for x in self.tests] for name, own in names.items()}
        )

    @property
    def next_test(self) -> dict[str, Any] | None:
        """The test to run next, as the diagnosis reports it; None where none is recommended."""
        if not self.tests:
            return None
        trial = self.tests[0]
        return {
            "test": trial.id,
            "size": trial.size,
            "hold_s": trial.hold_s,
            "settings": trial.settings,
            "says": trial.says,
        }

    @property
    def pair(self) -> list[str]:
        """The first two tests."""
        return [x.id for x in self.tests[:2]]

    def as_json(self) -> dict[str, Any]:
        """Return the plan as the contract has it."""
        tests = [x.as_json() for x in self.tests]
        why = " ".join([*([self.far] if self.far else []), self.sentence()])
        return {"tests": tests, "pair": self.pair, "why": why}

    def sentence(self) -> str:
        """Return the plan in a sentence."""
        if not self.tests:
            return f"No further test is recommended: {self.why}."
        then = f"; if the answer stays open, {self.pair[1]} is next" if self.tests[1:] else ""
        return f"Next test, {self.pair[0]}: {self.tests[0].says}{then}."

    def as_text(self) -> str:
        """Return the plan for a terminal."""
        lines = [*([self.far] if self.far else []), self.sentence()]
        if self.tests:
            moves = f"OP moves by ({self.op_unit})"
            lines += ["", f"minutes  PV moves by  {moves}  test"]
            lines += [
                f"{x.minutes:7.0f}  {x.pv_excursion:11.3g}  {x.op_travel:{len(moves)}.3g}"
                f"  {x.id}: {x.says}"
                for x in self.tests
            ]
        return "\n".join(lines + [f"left out: {why}" for why in self.left_out])


def plan(
    assessment: Assessment,
    probability: Mapping[str, float],
    loops: ClosedLoops,
    limits: Limits | None = None,
    most: int = len(ORDER),
) -> PlannedTests:
    """Return the first `most` tests that were not run yet, or why none is recommended."""
    why = _no_need(assessment, probability)
    if why:
        return PlannedTests(why=why, op_unit=assessment.situation.record.S_unit)
    s = assessment.situation
    fitted = assessment.parameters
    explained = [e for e in probability if e == NONE or e in fitted]
    likely = sorted(explained, key=lambda e: -probability[e])[:_EXPLANATIONS]
    files = {e: loops.loop([] if e == NONE else [e]) for e in likely}
    bands = [band(fitted[e]) for e in likely if e != NONE and (band := recogniser(e).band)]
    tests: list[Trial] = []
    left_out: list[str] = []
    known = set(assessment.asked)
    if not s.unexplained_law and (s.law.known or s.archive.faithful):
        known.add("raw")
    if assessment.valve_seen:
        known.add("mv")
    for id_ in (one for one in ORDER if one not in known):
        if len(tests) == most:
            break
        trial = size_test(id_, s, files, min(bands, default=0.0), limits or Limits())
        if isinstance(trial, Refusal):
            left_out.append(trial.reason)
        else:
            tests.append(trial)
    why = "" if tests else "every test of the menu was run, or leaves its limits"
    return PlannedTests(tuple(tests), why, tuple(left_out), op_unit=s.record.S_unit)


def _no_need(assessment: Assessment, probability: Mapping[str, float]) -> str:
    """Return why no test is needed, or would help; "" where one might."""
    s = assessment.situation
    first = max(probability, key=lambda e: probability[e])
    name = "no effect" if first == NONE else first.replace("_", " ")
    named = assessment.chosen if first in assessment.chosen else [first]
    # a second effect that only the likelihood names is open, however sure the first is
    if len(named) > 1 and not assessment.shown(named[1]):
        return ""
    if first in s.proven and probability[first] > 0.5:
        return f"the record itself shows {name}"
    if first == UNKNOWN:
        unexplained = assessment.unexplained.get("controller")
        if unexplained and "raw" in assessment.asked:
            return f"{unexplained}, and no test on the menu changes that"
        return ""
    if probability[first] >= NO_TEST_FROM:
        return f"{name} has probability {probability[first]:.2f}"
    return ""
