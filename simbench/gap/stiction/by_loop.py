"""Combine the conclusions of all records of a loop, and count how they agree with labels."""

from __future__ import annotations

from collections.abc import Mapping

from scipy.special import logit

from simbench.detectors.verdict import NO_DECISION, STICTION
from simbench.detectors.views import columns
from simbench.gap.stiction.conclusion import WORDS, Conclusion
from simbench.gap.stiction.probability import probability, verdict

_HEAD = ("loop", "label", "records", "probability of stiction", "conclusion")


def as_lines(
    conclusions: Mapping[str | None, Conclusion], labels: Mapping[str, Mapping[str, str]]
) -> list[str]:
    """Return how often loops and units agree with their labels, below a table of one line per loop
    where one has several records.

    The probability of a loop is that of the mean of its records' log-odds; a record that cannot be
    judged has none.
    """
    loops = group_conclusions(conclusions, labels, "loop")
    rows = []
    for (name, label), (n, p, answer) in loops.items():
        rows.append((name, label, str(n), "" if p is None else f"{p:.2f}", WORDS[answer]))
    several = any(n > 1 for n, _, _ in loops.values())
    return [
        *(columns([_HEAD] + rows) if several else ()),
        count_agreement("loop", loops),
        count_agreement("unit", group_conclusions(conclusions, labels, "unit_group")),
    ]


def group_conclusions(
    conclusions: Mapping[str | None, Conclusion], labels: Mapping[str, Mapping[str, str]], key: str
):
    """Return records, probability and verdict of each group of records that share a key and a
    label.
    """
    groups: dict[tuple[str, str], list[float | None]] = {}
    for name in (name for name in conclusions if name in labels):
        group = labels[name][key], labels[name]["label"]
        groups.setdefault(group, []).append(conclusions[name].probability)
    out = {}
    for group, each in groups.items():
        odds = [float(logit(p)) for p in each if p is not None]
        if odds:
            p = probability(sum(odds) / len(odds))
        else:
            p = None
        out[group] = len(each), p, NO_DECISION if p is None else verdict(p)
    return out


def count_agreement(
    what: str, groups: Mapping[tuple[str, str], tuple[int, float | None, str]]
) -> str:
    """Return in one sentence how often the conclusions agree with the labels."""
    labelled = []
    for (_, label), (_, _, answer) in groups.items():
        if label not in ("", "unknown"):
            labelled.append((label == STICTION, answer))
    sticky = [answer for sticks, answer in labelled if sticks]
    others = [answer for sticks, answer in labelled if not sticks]
    open_ = (sticky + others).count(NO_DECISION)
    return (
        f"Conclusion by {what}: stiction in {sticky.count(STICTION)} of {len(sticky)} with stiction"
        f" and in {others.count(STICTION)} of {len(others)} without; {open_} of {len(labelled)}"
        " cannot tell."
    )
