"""`GapReport`: the answer of a diagnosis, as text and as JSON."""

from __future__ import annotations

import itertools
from dataclasses import asdict, dataclass, field
from typing import TYPE_CHECKING, Any

from simbench.detectors.verdict import PROBABILITY
from simbench.detectors.views import page_part
from simbench.gap.closed_loop.copies import Copy
from simbench.gap.closed_loop.described import shown_words
from simbench.gap.closed_loop.remaining import Remaining
from simbench.gap.closed_loop.runs import ClosedLoops
from simbench.gap.decide.assess import Assessment
from simbench.gap.report.ranked import LEAST_SHOWN, PERCENT, Gap, Ranked, numbers, words
from simbench.gap.stiction.conclusion import Conclusion
from simbench.gap.thresholds import COVERED, LIKELIER
from simbench.loop.effects import NONE, UNKNOWN

if TYPE_CHECKING:
    import pandas as pd

    from simbench.theory.public_loop import Loop

CONFIDENCE = 0.9  # share of sets that hold the truth


@dataclass(frozen=True, eq=False)
class DiagnosisDetails:
    """What an answer rests on, for text, page and loop file."""

    found: Assessment
    loops: ClosedLoops
    # with the controller, the load or the plant that the record shows, where no known effect is
    # what is missing
    shown: Copy | None = None


_MOST_LINES = 3  # differences that are put into words
_MOST_ANSWERS = 6  # that a terminal lists


@dataclass(frozen=True, eq=False)
class GapReport:
    """Where the gap lies, which effect causes it, how far it shrinks.

    Parameters
    ----------
    block : str
        Block of the first effect; "none", or for "unknown" the block whose residual test fails, or
        in which simulations and record differ most.
    effect : str
        Effect id, "none" or "unknown".
    effects : tuple of dict
        One or two: block, effect, parameters, probability.
    group : tuple of str
        Effects that cannot be distinguished from the first one with these signals.
    ranking : tuple of Ranked
        All candidates, `none` and `unknown`, most probable first; probabilities sum to 1.
    gap : Gap
        Distance of record and simulation before and after each correction (-).
    shrinkage : dict or None
        value, lo, hi; None without a resolvable gap.
    remaining : tuple of Remaining
        What the record has and the simulations with the answer in them have not, the farthest
        first: feature with its unit, block in which to look first, recorded value, range of the
        simulations, distance (standard deviations between simulations).
    blocks : dict
        Summed probability of the effects of each block, and of "unknown"; sums to 1, or all 0 when
        nothing is lacking.
    next_test : str or None
        What would tell apart the effects between which this record does not decide, in a sentence;
        None where it decides.
    notes : tuple of str
        What else a reader must know, a sentence each.
    conclusion : Conclusion
        Stiction, no stiction or cannot tell, the same in every verb; its probability is pooled over
        the records.
    behind : DiagnosisDetails
        Records, fits and loops from which the answer follows.
    op_unit : str
        Unit of S, J and other sizes on OP: "% of travel", or "OP units".
    """

    block: str
    effect: str
    effects: tuple[dict[str, Any], ...]
    group: tuple[str, ...]
    ranking: tuple[Ranked, ...]
    gap: Gap
    shrinkage: dict[str, float] | None
    remaining: tuple[Remaining, ...]
    blocks: dict[str, float]
    next_test: str | None
    notes: tuple[str, ...]
    conclusion: Conclusion
    behind: DiagnosisDetails = field(repr=False)
    op_unit: str = PERCENT

    def as_json(self) -> dict[str, Any]:
        """Return the report as nested dicts and lists of JSON types.

        Returns
        -------
        dict
            Keys as the contract has them.
        """
        return {
            "block": self.block,
            "effect": self.effect,
            "effects": list(self.effects),
            "group": list(self.group),
            "ranking": [r.as_json() for r in self.ranking],
            "set": list(self.set),
            "gap": {**asdict(self.gap), "near": self.gap.near},
            "shrinkage": self.shrinkage,
            "remaining": [one.as_json() for one in self.remaining],
            "blocks": self.blocks,
            "next_test": self.next_test,
            "notes": list(self.notes),
            PROBABILITY: self.probability_of_stiction,
            "conclusion": self.conclusion.as_json(),
        }

    def to_frame(self) -> pd.DataFrame:
        """Return the ranking.

        Returns
        -------
        DataFrame
            effect, block, probability, gap_before, gap_after, and the parameters as text; most
            probable first.
        """
        import pandas as pd

        lines = pd.DataFrame(
            [
                {**asdict(r), "parameters": self._format_sizes(r.effect, r.parameters)}
                for r in self.ranking
            ]
        )
        return lines.drop(columns="group")

    def plot(self, most: int = 6) -> Any:
        """Draw the most probable effects.

        Parameters
        ----------
        most : int
            How many.

        Returns
        -------
        matplotlib.axes.Axes
            Bars of probability, the most probable effect on top.
        """
        rows = self.to_frame().head(most).set_index("effect")[::-1]
        return rows[["probability"]].plot.barh(
            xlim=(0, 1), xlabel="probability", ylabel="", color="0.7", legend=False
        )

    def __repr__(self) -> str:
        """Return one line."""
        return f"GapReport: {self.sentence()}"

    def _repr_html_(self) -> str:
        return page_part(self.sentence(), self.to_frame().head(8))

    @property
    def probability_of_stiction(self) -> float | None:
        """Probability of stiction; None where the record cannot be judged."""
        return self.conclusion.probability

    @property
    def set(self) -> tuple[str, ...]:
        """The answers that cannot be excluded at 90 %: nine such sets in ten hold the truth."""
        before = itertools.accumulate((r.probability for r in self.ranking), initial=0.0)
        return tuple(r.effect for r, p in zip(self.ranking, before) if p < COVERED)

    @property
    def named(self) -> list[str]:
        """Effects that the answer adds to the baseline: none, one or two."""
        return [e["effect"] for e in self.effects if e["effect"] not in (NONE, UNKNOWN)]

    def fixed_loop(self) -> Loop:
        """Return the baseline with the named effects, the identified load and the record's set
        point in it.

        Where no known effect is named, the loop is recalibrated and nothing is added.

        Returns
        -------
        Loop
            A loop to simulate in place of the baseline.
        """
        from simbench.theory.public_loop import Loop

        shown = self.behind.shown
        if shown is None:
            fixed = self.behind.loops.corrected(self.named)
        else:
            fixed = shown.loop
        return Loop.from_table(fixed.to_table())

    def sentence(self) -> str:
        """Return the answer and how near the simulation then is to the record.

        Returns
        -------
        str
            Effect, probability, parameters with units; then the gap, and whether it is near.
        """
        return f"{self.answer()} {self.nearness()}"

    def answer(self) -> str:
        """Return the answer in one sentence.

        Returns
        -------
        str
            The first row of the ranking with its probability, and parameters with units.
        """
        # nothing is lacking, or nothing known
        p = self.ranking[0].probability
        if self.effect == NONE:
            late = any(note.startswith("clock:") for note in self.notes)
            once = ", once PV, which is stamped late, is moved back" if late else ""
            return f"{_hedge_sentence('no unmodelled effect is needed', p)} ({p:.2f}){once}."
        if self.effect == UNKNOWN:
            said = _hedge_sentence("no known effect explains what is missing", p)
            said += f" ({p:.2f}; block: {self.block})"
            shown = self.behind.shown
            return said + ("." if shown is None else f": {shown_words(shown, self.block)}.")

        # one effect or two
        first, *second = (
            words(e["effect"]) + "{}" + self._format_sizes(e["effect"], e["parameters"], ": ")
            for e in self.effects
        )
        likely = "The simulation lacks " if p > LIKELIER else "Nothing is likely; the likeliest is "
        with_it = "".join(f"; with it, {one.format('')}" for one in second)
        far = "" if self.nearer else "; adding it does not bring the simulation nearer"
        return f"{likely}{first.format(f' ({p:.2f})')}{with_it}{far}."

    @property
    def nearer(self) -> bool:
        """Whether the named effects bring the simulation nearer to the record, or are part of what
        was identified.
        """
        return (
            not self.named
            or self.gap.after < self.gap.before
            or not self.behind.loops.adds(self.named)
        )

    def identified(self) -> list[str]:
        """Return what was identified where no baseline was given, in the numbers that people know.

        Returns
        -------
        list of str
            Plant, controller, gain margin, load and archive, a sentence each; empty beside a
            baseline.
        """
        return self.behind.loops.described(self.named)

    def nearness(self) -> str:
        """Return how far the simulation is from the record, with the answer in it.

        Returns
        -------
        str
            The gap, what it was, how far parts of the record are apart, and whether it is near.
        """
        g = self.gap
        near = "yes" if self.gap.near else "no"
        before = ""
        it = "It is"
        if self.named or self.behind.shown:
            before = f"{g.before:.2f} before; "
            it = "It is then"
        return (
            f"{it} {g.after:.2f} from the record ({before}parts of the record are"
            f" {g.plant_floor:.2f} apart). Near the record: {near}."
        )

    def as_text(self) -> str:
        """Return the report for a terminal.

        Returns
        -------
        str
            The answer, what remains, the valve, the ranking and what to do next, a line each.
        """
        # the answer, and what remains with it
        lines = [self.answer(), self.nearness()] + joined(self.identified())
        if self.remaining:
            lines += ["What remains between record and simulations:"]
            lines += [f"  {line}" for line in self.remaining_lines()]
        lines += ["", "The valve:"] + self.conclusion.as_lines() + [""] + joined(self.which_lines())

        # what is not next to impossible, and how the gap is measured
        shown = [r for r in self.ranking[:_MOST_ANSWERS] if r.probability >= LEAST_SHOWN]
        lines += ["", "probability  effect"]
        for r in shown:
            sizes = self._format_sizes(r.effect, r.parameters)
            lines.append(f"{r.probability:11.3f}  {r.effect:24s}{sizes}".rstrip())
        lines += [""] + joined(self.gap_lines()) + self.next_line()
        lines += [f"note: {n}" for n in self.notes]
        return "\n".join(lines)

    def which_lines(self) -> list[str]:
        """Return what cannot be told apart, and the probability of each block, in sentences.

        Returns
        -------
        list of str
            Effects of the same signals, those that cannot be excluded, and blocks.
        """
        # answers of the same signals, and those that cannot be excluded
        lines = []
        if len(self.group) > 1:
            names = ", ".join(words(e) for e in self.group)
            p = sum(r.probability for r in self.ranking if r.effect in self.group)
            lines.append(f"Not told apart by this record: {names} ({p:.2f} together).")
        if len(self.set) > 1:
            names = ", ".join(words(e) for e in self.set)
            lines.append(f"Not excluded at {100 * CONFIDENCE:.0f} %: {names}.")

        # the share of each block, and of what no known effect explains
        said = {UNKNOWN: "no known effect"}
        shares = [f"{said.get(b, b)} {p:.2f}" for b, p in self.blocks.items() if p >= LEAST_SHOWN]
        if shares:
            lines.append(f"Of what is missing, by block: {', '.join(shares)}.")
        return lines

    def _format_sizes(
        self, effect: str, parameters: dict[str, float | str], begin: str = ""
    ) -> str:
        """Return an effect's parameters with their units; those of OP are the record's."""
        return numbers(effect, parameters, begin, self.op_unit)

    def gap_lines(self) -> list[str]:
        """Return how the gap is measured and how far it shrinks, in sentences.

        Returns
        -------
        list of str
            Sentences on its unit, its floor and its shrinkage.
        """
        # what is measured, and its floor
        g = self.gap
        s = self.shrinkage
        lines = [
            "The distance of record and simulations is the mean over features, in standard"
            " deviations between simulations.",
            f"It is {g.recalibrated:.2f} with K, T and Td fitted again and nothing added;"
            f" simulations that differ only in their seeds are {g.floor:.2f} apart (the floor).",
        ]

        # how far the gap shrinks
        if s is not None:
            value = 100 * s["value"]
            lo = 100 * s["lo"]
            hi = 100 * s["hi"]
            if value > 0:
                removes = f"removes {value:.0f} %"
            else:
                removes = "does not remove any"
            what = "what the record shows" if self.behind.shown else "the effect"
            lines.append(
                f"Of the gap above the floor, {what} {removes} (90 % interval {lo:.0f} to"
                f" {hi:.0f} %)."
            )
        elif not g.resolvable:
            lines.append("The gap does not stand out of the floor, so no reduction is claimed.")
        return lines

    def remaining_lines(self) -> list[str]:
        """Return the largest differences that remain, in numbers of the plant.

        Returns
        -------
        list of str
            At most three differences, a line each; none where nothing is plain.
        """
        return [one.sentence() for one in self.remaining[:_MOST_LINES]]

    def next_line(self) -> list[str]:
        """Return what would tell apart the effects that are left, in a list.

        Returns
        -------
        list of str
            One sentence, or none where there is nothing to say.
        """
        # what the conclusion about the valve says to do next is not said again
        if self.next_test is None or self.conclusion.next == self.next_test:
            return []
        return [f"Next: {self.next_test}."]


def joined(sentences: list[str]) -> list[str]:
    """Return sentences as one paragraph, none of none."""
    if sentences:
        return [" ".join(sentences)]
    return []


def _hedge_sentence(said: str, p: float) -> str:
    """Return a sentence without its stop as one that is likely, or as the likeliest of many."""
    if p > LIKELIER:
        return said[0].upper() + said[1:]
    return f"Nothing is likely; the likeliest is that {said}"
