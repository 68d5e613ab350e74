"""The gap in words: the same sentences on the terminal and on the pages."""

from __future__ import annotations

from collections.abc import Mapping


def apart(gap: float, plant_floor: float) -> str:
    """Return how far simulations are from a record, and how far its parts are from each other."""
    return f"{gap:.2f} from the record, whose parts are {plant_floor:.2f} apart"


def gap_sentences(
    before: float,
    recalibrated: float,
    after: float | None,
    floor: float,
    added: str = "the effect",
    shrinkage: Mapping[str, float] | None = None,
) -> list[str]:
    """Return what the gap is, its sizes, its repeatability floor and the share that is removed.

    `after` is None where nothing was added; `shrinkage` holds the share of the gap above the floor
    that is removed (`value`, `lo`, `hi`), None where none is claimed.
    """
    nearer = f"{recalibrated:.2f}" if round(recalibrated, 2) < round(before, 2) else "no less"
    sizes = [f"{before:.2f} with the model as given", f"{nearer} with K, T, Td refitted"]
    if after is not None:
        sizes.append(f"{after:.2f} with {added} added")
    lines = [
        "Gap: distance between record and simulations, in standard deviations between simulations.",
        "It is " + ", ".join(sizes) + ".",
        f"Repeatability floor: two simulations that differ only in their seeds are {floor:.2f}"
        " apart.",
    ]
    if shrinkage is not None:
        value, lo, hi = (100 * shrinkage[k] for k in ("value", "lo", "hi"))
        lines.append(
            f"Of the gap above this floor, {added} removes {value:.0f} % (90 % interval {lo:.0f} to"
            f" {hi:.0f} %)."
        )
    return lines
