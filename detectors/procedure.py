"""The diagnosis procedure of the chapter, applied to one record: a sequence of questions, each
answered with its evidence and reason.

FLOW is the procedure: which question comes first and where every answer leads. `diagnose` walks it,
Figure 11.27 draws it, so that picture and program cannot differ.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from simbench.detectors.evidence import BIAS, EVIDENCE, VOTERS, WITNESSES
from simbench.detectors.judge import FEWEST, UNFIT, judge_one
from simbench.detectors.plugins.registry import methods as registry
from simbench.detectors.prepared import Prepared, prepare
from simbench.detectors.record import LoopRecord
from simbench.detectors.signal.bicoherence import error_bicoherence
from simbench.detectors.signal.valve_follow import Follow, valve_follow
from simbench.detectors.verdict import NO_DECISION, NO_STICTION, STICTION, Level, Verdict, _as_plain
from simbench.detectors.views import page_part

if TYPE_CHECKING:
    import pandas as pd

# log-odds on the grids that the weights were fitted to; between them the evidence is not enough. Of
# the loops that the weights were fitted to, 1 in 20 healthy ones exceed .69 (self-regulating) and
# .93 (integrating)
ODDS_LOW = -0.4
ODDS_HIGH = 0.7
# set here: 1 % of simulated healthy flow loops under steps, ramps and random pressure exceed it
FOLLOW_MIN = 0.2
# log-odds of a loop that does not oscillate and whose valve is not seen to stand still
_QUIET = -3.0
_PER_FOLLOW = 8.0  # log-odds per unit of the score of `valve_follow` above its bound
_S_SMALL = 0.5  # % of travel, chapter section 11.1

# question -> (text, {answer: next question or conclusion})
FLOW: dict[str, tuple[str, dict[str, str]]] = {
    "quality": ("Is the record fit to be judged?", {"yes": "oscillation", "no": "unfit"}),
    "oscillation": ("Is there a sustained oscillation?", {"yes": "saturation", "no": "valve"}),
    "valve": (
        "Does the valve, seen through MV or a flow, stand still while OP moves?",
        {"yes": "level", "no": "quiet", "cannot tell": "quiet"},
    ),
    "saturation": ("Does OP run into a limit?", {"no": "nonlinearity", "yes": "saturated"}),
    "nonlinearity": (
        "Is there a nonlinearity in the loop?",
        {"yes": "stiction", "not seen": "stiction", "no": "linear"},
    ),
    "stiction": (
        "What do the stiction detectors say together?",
        {"stiction": "level", "no stiction": "linear", "undecided": "open"},
    ),
    "level": (
        f"Is S above {_S_SMALL} % of travel?",
        {"yes": "sticky", "no": "slight", "cannot tell": "sticky"},
    ),
}

# conclusion -> (verdict, what to do next)
CONCLUSIONS: dict[str, tuple[str, str]] = {
    "unfit": (
        NO_DECISION,
        (
            "record the loop again: in automatic mode, without compression or in the smallest steps"
            " that the transmitter reports, 20 to 60 samples per oscillation"
        ),
    ),
    "quiet": (NO_STICTION, "none"),
    "saturated": (
        NO_DECISION,
        "free OP from its limit (operating point, valve size, controller gain), then record again",
    ),
    "linear": (
        NO_STICTION,
        (
            "controller-gain change: an oscillation that keeps its period comes from outside; one"
            " that dies out was tuning"
        ),
    ),
    "open": (
        NO_DECISION,
        (
            "controller-gain change of 30 to 50 %: the period moves by more than 10 % if the valve"
            " sticks"
        ),
    ),
    "sticky": (
        STICTION,
        (
            "controller-gain change of 30 to 50 % (the period should move by more than 10 %), then"
            " valve travel test in small steps both ways, then maintenance"
        ),
    ),
    "slight": (STICTION, "none now; watch whether S grows"),
}


@dataclass(frozen=True)
class _Step:
    """One question of the procedure, answered."""

    # step, question, answer: which question, in words, and the answer taken
    step: str
    question: str
    answer: str
    evidence: str  # the numbers that led to the answer
    reason: str  # what follows from it


@dataclass(frozen=True)
class Diagnosis:
    """The conclusion of the procedure and the path to it."""

    verdict: str  # {"stiction", "no_stiction", "no_decision"}: the answer
    score: float  # log-odds of stiction; NaN where the record is unfit
    conclusion: str  # key of CONCLUSIONS
    next_test: str  # what to do now
    # S, J: level in `S_unit`
    S: Level
    J: Level
    S_unit: str  # "% of travel" or "OP units"
    steps: tuple[_Step, ...]  # the path taken
    verdicts: tuple[Verdict, ...]  # of the detectors that were asked
    # numbers of the procedure itself: log_odds, follow, ngi, nli
    indices: dict[str, float] = field(default_factory=dict)

    @property
    def reason(self) -> str:
        """The last answers in one sentence."""
        decisive = []
        for s in self.steps:
            if s.step in ("quality", "oscillation", "valve", "saturation", "stiction"):
                decisive.append(s)
        if decisive[-1].step != "valve":
            return decisive[-1].evidence
        return f"{decisive[-2].evidence}; {decisive[-1].evidence}"

    def __repr__(self) -> str:
        """Return one line."""
        return f"Diagnosis: {self.verdict.replace('_', ' ')} ({self.conclusion})"

    def as_json(self) -> dict[str, Any]:
        """Return everything as JSON types; NaN becomes null."""
        return _as_plain(
            {
                "verdict": self.verdict,
                "score": self.score,
                "conclusion": self.conclusion,
                "S": self.S,
                "J": self.J,
                "S_unit": self.S_unit,
                "reason": self.reason,
                "next_test": self.next_test,
                "steps": [vars(s) for s in self.steps],
                "verdicts": [v.as_json() for v in self.verdicts],
                "indices": self.indices,
            }
        )

    def as_text(self) -> str:
        """Return the path as numbered lines, and the verdict."""
        lines = []
        for i, s in enumerate(self.steps, 1):
            lines += [f"{i}. {s.question} {s.answer.capitalize()}.", f"   {s.evidence}. {s.reason}"]
        return "\n".join(lines + [f"Verdict of the procedure: {self.verdict.replace('_', ' ')}."])

    def to_frame(self) -> pd.DataFrame:
        """Return the path taken."""
        import pandas as pd

        return pd.DataFrame([vars(s) for s in self.steps])

    def _repr_html_(self) -> str:
        return page_part(
            f"{self.verdict.replace('_', ' ')}; next: {self.next_test}",
            self.to_frame().drop(columns="step"),
        )


def diagnose(record: LoopRecord) -> Diagnosis:
    """Take a record through the whole procedure.

    Source: Jelali (2013), section 11.9. Where the chapter takes a majority vote, indices are
    weighted by what they were worth on simulated loops, and a method that abstains adds nothing. A
    nonlinearity that is not seen rules nothing out: symmetric cycles hide theirs from the
    bicoherence. A loop that does not oscillate is judged where its valve can be seen, through MV or
    a flow.

    >>> t = np.arange(3000) / 10
    >>> diagnose(LoopRecord(np.sin(t), -np.sin(t), 1.0, process="self-regulating")).verdict
    'no_stiction'
    """
    return walk(prepare(record), ProcedureRules())


@dataclass(frozen=True)
class ProcedureRules:
    """The bounds of the procedure, as `diagnose` has them."""

    odds_low: float = ODDS_LOW
    odds_high: float = ODDS_HIGH
    follow_min: float = FOLLOW_MIN
    weighted: bool = True
    veto: bool = False


def walk(prepared: Prepared, rules: ProcedureRules) -> Diagnosis:
    """Take a prepared record through the procedure; result as `diagnose`."""
    # From question to question until a conclusion stands
    course = _Course(prepared, rules)
    steps = []
    now = "quality"
    while now in FLOW:
        question, answers = FLOW[now]
        answer, evidence, reason = getattr(course, now)()
        steps.append(_Step(now, question, answer, evidence, reason))
        now = answers[answer]

    # The conclusion, with sizes only where stiction is found
    verdict, following = CONCLUSIONS[now]
    sticky = verdict == STICTION

    # Everything that was asked on the way
    return Diagnosis(
        verdict,
        course.score,
        now,
        following,
        course.S if sticky else None,
        course.J if sticky else None,
        prepared.record.S_unit,
        tuple(steps),
        tuple(course.verdicts.values()),
        course.indices,
    )


class _Course:
    """The answers to the questions of FLOW, one method each: (answer, evidence, reason)."""

    def __init__(self, prepared: Prepared, rules: ProcedureRules) -> None:
        self.prepared = prepared
        self.rules = rules
        self.verdicts: dict[str, Verdict] = {}
        self.indices: dict[str, float] = {}
        self.score = float("nan")
        self.S: Level = None
        self.J: Level = None

    def quality(self) -> tuple[str, str, str]:
        # Flags that no method can cope with
        flags = self.prepared.flags
        bad = [f.evidence for name, f in flags.items() if name in UNFIT and name != "saturated"]
        if self.prepared.record.n < FEWEST:
            bad += [f"{self.prepared.record.n} samples; at least {FEWEST} are needed"]
        if bad:
            return "no", "; ".join(bad), "Such a record says nothing about its valve."

        # Flags that are told
        other = [f.evidence for name, f in flags.items() if name not in UNFIT]
        return (
            "yes",
            "; ".join(other) or "no flag raised",
            "Continue; methods that cannot handle this data-quality warning give no decision."
            if other
            else "Continue.",
        )

    def oscillation(self) -> tuple[str, str, str]:
        # Without an oscillation the loop is judged by its valve
        o = self.prepared.oscillation
        self.indices |= {"regularity": o.regularity, "period_s": o.period_s}
        if not o.sustained:
            self.score = _QUIET
            return (
                "no",
                f"no sustained oscillation ({o.evidence})",
                "Look at the valve itself, where it is seen.",
            )

        # Where only a part of the record oscillates, it is named
        part = self.prepared.part
        if part:
            where = f", in samples {part[0]} to {part[1] - 1}"
        else:
            where = ""
        return (
            "yes",
            f"period {o.period_s:.4g} s, regularity r = {o.regularity:.1f}{where}",
            "The next steps ask whether the valve makes it.",
        )

    def valve(self) -> tuple[str, str, str]:
        # Without sight of the valve nothing can be said
        position, fits, note = self.prepared.valve_position()
        if position is None or not fits:
            return (
                "cannot tell",
                note,
                "Without an oscillation and without sight of the valve there is nothing to find.",
            )

        # How much better a dead band follows OP than a straight valve does
        op, limits = _travel_of(self.prepared.record)
        follow: Follow = valve_follow(op, position, limits)
        self.indices["follow"] = follow.score
        self.score = max(_PER_FOLLOW * (follow.score - self.rules.follow_min), _QUIET)
        numbers = (
            f"{note}: dead band explains {1 - follow.error:.0%}, straight valve"
            f" {1 - follow.error_linear:.0%}"
        )
        numbers += f", {follow.reversals} reversals"

        # No dead band is seen
        if follow.score < self.rules.follow_min:
            says = "No dead band is seen: the valve has none, or OP gave it too little to do."
            return "no", numbers, says
        self.S = follow.S
        self.J = (0.0, follow.S)
        return (
            "yes",
            numbers,
            "A valve that does this makes the loop cycle as soon as it is left alone.",
        )

    def saturation(self) -> tuple[str, str, str]:
        flag = self.prepared.flags.get("saturated")
        if flag is not None:
            return "yes", flag.evidence, "Saturation alone makes a loop oscillate."
        return "no", "OP keeps off its limits", "Saturation is not the cause."

    def nonlinearity(self) -> tuple[str, str, str]:
        # The bicoherence of the control error
        record = self.prepared.record
        period = self.prepared.oscillation.period_s / record.Ts
        test = self.prepared.share("bicoherence", lambda: error_bicoherence(record.e, period))
        if test is None:
            return (
                "not seen",
                "too short for the bicoherence",
                "Go on: the detectors look at the waves themselves.",
            )

        # A significant peak is a nonlinearity
        self.indices |= {"ngi": test.ngi, "nli": test.nli}
        numbers = (
            f"non-Gaussianity index {test.ngi:.3f}, nonlinearity index {test.nli:.3f} (peak"
            f" {test.height:.2f} times its bound)"
        )
        if test.nonlinear():
            return "yes", numbers, "The oscillation is born or bent inside a nonlinear element."

        # None is a veto where the rules say so, else only no evidence
        if self.rules.veto:
            self.score = _QUIET
            return "no", numbers, "A linear loop oscillates by its tuning or from outside."
        return (
            "not seen",
            numbers,
            "Stiction remains possible: the bicoherence misses symmetric cycles.",
        )

    def stiction(self) -> tuple[str, str, str]:
        if self.rules.weighted:
            return self._weigh_evidence()
        return self._count_votes()

    def _count_votes(self) -> tuple[str, str, str]:
        for method in VOTERS[self.prepared.integrating]:
            self._ask_method(f"{method}@published")
        votes = [v.verdict for v in self.verdicts.values()]
        yes = votes.count(STICTION)
        no = votes.count(NO_STICTION)
        self.score = float(yes - no)
        numbers = f"{yes} for stiction, {no} against, {votes.count(NO_DECISION)} no decision"
        if yes == no:
            return "undecided", numbers, "No majority."
        return ("stiction" if yes > no else "no stiction"), numbers, "The majority decides."

    def _weigh_evidence(self) -> tuple[str, str, str]:
        # The prior odds, then every method that counts as evidence or witness
        case = self.prepared.integrating
        odds = BIAS[case]
        terms = []
        used = 0
        for method in tuple(dict.fromkeys(e.method for e in EVIDENCE[case])) + tuple(
            WITNESSES[case]
        ):
            self._ask_method(method)

        # Each index adds its log-odds
        for e in EVIDENCE[case]:
            counted = e.weight * e.count(self.verdicts[e.method])
            if counted != 0.0:
                odds += counted
                used += 1
                terms.append(f"index {e.index} of {e.method} {counted:+.1f}")
        self.score = self.indices["log_odds"] = float(odds)

        # The votes are told beside the odds
        votes = [v.verdict for v in self.verdicts.values()]
        count = (
            f"{votes.count(STICTION)} stiction, {votes.count(NO_STICTION)} no stiction,"
            f" {votes.count(NO_DECISION)} no decision"
        )
        numbers = (
            f"log-odds of stiction {odds:+.1f}, from {', '.join(terms) or 'no index'} (methods:"
            f" {count})"
        )

        # Nothing to weigh
        if used == 0:
            return "undecided", numbers, "No detector could cope with this record."

        # Sizes are those of the Hammerstein fit
        level = self.verdicts["hammerstein"]
        self.S = level.S
        self.J = level.J
        if odds >= self.rules.odds_high:
            return "stiction", numbers, "The waves are those of a sticky valve."
        if odds <= self.rules.odds_low:
            return (
                "no stiction",
                numbers,
                "The waves are those of tuning or of a disturbance from outside.",
            )
        return "undecided", numbers, "The evidence is too even."

    def level(self) -> tuple[str, str, str]:
        # A size in other units than % of travel says nothing about harm
        if self.S is None or self.prepared.record.op_percent is None:
            return (
                "cannot tell",
                "S is not known in % of travel",
                "Confirm before any work on the valve.",
            )

        # The range of S as text
        if isinstance(self.S, tuple):
            lo, hi = self.S
        else:
            lo = self.S
            hi = self.S
        if lo == hi:
            size = f"S = {lo:.2g} %"
        else:
            size = f"S = {lo:.2g} to {hi:.2g} %"

        # All of the range on one side of what does little harm, or across it
        if hi < _S_SMALL:
            return "no", size, "Stiction of this size does little harm."
        if lo < _S_SMALL:
            return "cannot tell", size, "Confirm before any work on the valve."
        return "yes", size, "Confirm by cheap tests first, before the cost of downtime."

    def _ask_method(self, name: str) -> None:
        module = registry.load(name)
        self.verdicts[name] = judge_one(name, module, self.prepared, True, module.METHOD.defaults())


def _travel_of(record: LoopRecord) -> tuple[np.ndarray, tuple[float, float]]:
    """OP in % with its limits, or in its unit without."""
    if record.op_percent is None:
        return record.op, (-np.inf, np.inf)
    return record.op_percent, (0.0, 100.0)
