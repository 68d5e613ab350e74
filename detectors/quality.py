"""Data quality: check whether a record can be judged, and flag with evidence what would mislead a
method.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from simbench.detectors.record import MOST_OUTSIDE, LoopRecord
from simbench.detectors.signal.holds import frozen, holds, still, straight
from simbench.detectors.signal.lattice import lattice, written_unit
from simbench.detectors.signal.oscillation import Oscillation, find_oscillation
from simbench.detectors.signal.spikes import find_spikes, heavy_tails, off_line

_SATURATED = 0.05  # share of samples at a limit
_OPERATOR = 0.01  # changes of OP per sample, below which a person and not a controller moves it
_STEPS = 0.1  # steps of the values over the std of the signal
_FEWEST = 4  # levels of a signal that is called quantised
_COLLINEAR = 0.1  # share of moving samples that lie on the straight line through their neighbours
_UNDERSAMPLED = 8.0  # samples per period
_SPIKES = 0.002  # share of isolated outliers
_HELD = 0.15  # share of samples in which OP and PV both repeat themselves


@dataclass(frozen=True)
class Flag:
    """One finding about the data; `evidence` is a sentence with its number."""

    name: str
    evidence: str


def inspect(record: LoopRecord, oscillation: Oscillation | None = None) -> dict[str, Flag]:
    """Return the flags that a record raises, by name.

    Own rules; their limits stand at the head of the file. What a flag is worth depends on the
    method: `simbench.detectors.judge.UNFIT` names those under which all methods abstain.
    """
    if oscillation is None:
        oscillation = find_oscillation(record.op, record.pv, record.Ts)
    return {flag.name: flag for flag in _yield_flags(record, oscillation)}


def _yield_flags(record: LoopRecord, oscillation: Oscillation) -> Iterator[Flag]:
    # Signals that never change, or lie outside their span
    n = record.n
    alive = {}
    for name, x in (("op", record.op), ("pv", record.pv)):
        alive[name] = not still(x)
    for name in alive:
        if not alive[name]:
            yield Flag(f"dead_{name}", f"{name.upper()} never changes")
    for name in ("op", "pv"):
        if (share := record.outside(name)) > MOST_OUTSIDE:
            yield Flag(
                "outside_span",
                f"{name.upper()} lies outside {name}_span in {share:.0%} of the samples",
            )

    # What the reader noted of gaps and modes
    for note in record.notes:
        if note.startswith("gaps"):
            if oscillation.sustained:
                periods = record.duration / oscillation.period_s
            else:
                periods = 0.0
            yield Flag(
                "gaps", f"{note}; {periods:.0f} periods of the loop are left" if periods else note
            )
        if note.startswith("mode") and "never in automatic" in note:
            yield Flag("manual", note)

    # OP: moved by an operator, at a limit, or in steps
    if alive["op"]:
        changes = int(np.count_nonzero(np.diff(record.op)))
        if changes < max(3.0, _OPERATOR * n):
            yield Flag("manual", f"OP changes {changes} times in {n} samples")
        share, limit = saturation(record.op, record.pv, record.op_percent)
        if share > _SATURATED:
            yield Flag("saturated", f"OP stands at {limit:g} in {share:.0%} of the samples")
        yield from _flag_steps("op", record.op, steps(record.op, record.pv))

    # PV, and both signals together
    if alive["pv"]:
        yield from _pv_findings(record, oscillation)
        step = np.abs(np.diff(record.pv))
        same = (step == 0.0) & (np.diff(record.op) == 0.0)
        often = np.count_nonzero(same[1:] & ~same[:-1]) > n / 50.0
        # a loop that comes to rest creeps by its last digit; a historian that stores changes only
        # moves by visible ones
        if same.mean() > _HELD and often and np.median(step[step > 0.0]) > 0.01 * record.pv.std():
            yield Flag(
                "held", f"OP and PV repeat themselves together in {same.mean():.0%} of the samples"
            )

    # A period with too few samples
    if oscillation.sustained and oscillation.period_s < _UNDERSAMPLED * record.Ts:
        yield Flag(
            "undersampled",
            f"{oscillation.period_s / record.Ts:.1f} samples per period of the oscillation",
        )


def _pv_findings(record: LoopRecord, oscillation: Oscillation) -> Iterator[Flag]:
    pv = record.pv
    n = record.n
    std = float(record.pv.std())
    step = steps(pv, record.op)
    yield from _flag_steps("pv", pv, step)
    share, lines = straight(pv, step)
    if oscillation.sustained:
        periods = record.duration / oscillation.period_s
    else:
        periods = 0.0

    # an integrating process draws two straight lines per cycle by itself
    compressed = share > _COLLINEAR and lines > max(4.0 * periods, n / 50.0)
    if compressed:
        yield Flag(
            "compressed", f"{share:.0%} of PV's moving samples lie on straight lines between others"
        )
    still_for = frozen(pv)

    # at rest OP rests as well
    if (
        still_for is not None
        and record.op[still_for.begin : still_for.end].std() > 0.1 * record.op.std()
    ):
        yield Flag(
            "frozen",
            f"PV stands still for {still_for.end - still_for.begin} samples while OP moves, else"
            f" for {still_for.usual:.0f} at most",
        )
    if record.sp is not None:
        changed = int(np.count_nonzero(np.diff(record.sp)))
        if np.ptp(record.sp) > 0.1 * std:
            yield Flag(
                "moving_sp",
                f"SP moves in {changed} of {n} samples, by {np.ptp(record.sp) / std:.1f} std of PV",
            )
        off = abs(float(record.e.mean()))
        spread = float(record.e.std())
        if off > 3.0 * spread:
            yield Flag(
                "off_setpoint", f"PV stays {off:.3g} away from SP and moves by {spread:.3g} only"
            )

    # the samples that an archive kept stand off the lines it drew
    if compressed:
        outliers = 0
    else:
        outliers = find_spikes(pv, step)[0].size
    if outliers > _SPIKES * n and not heavy_tails(off_line(pv)[0]):
        yield Flag("spikes", f"{outliers} isolated outliers in PV")


def _flag_steps(name: str, x: np.ndarray, step: float) -> Iterator[Flag]:
    # fewer levels may be the positions of a valve that knows no others
    if step > _STEPS * x.std() and np.unique(x).size >= _FEWEST:
        yield Flag(
            f"quantised_{name}",
            f"{name.upper()} moves in steps of {step:.3g}, {step / x.std():.0%} of its std",
        )


def steps(x: np.ndarray, other: np.ndarray) -> float:
    """Return the steps that a signal is written in: of its lattice, else of its decimals."""
    unit = written_unit(x, other)
    return lattice(x, unit) or unit


def resolution(record: LoopRecord, flags: Mapping[str, Flag]) -> tuple[float, float]:
    """Return what an archive hides of OP (its unit), and of PV as a share of its range: deviation
    of exceptions, or steps.

    >>> op = np.repeat([50.0, 52.0, 50.0, 52.0], 50)
    >>> note = "archive: OP holds its last stored value in 90% of 200 samples"
    >>> resolution(LoopRecord(op, op, 1.0, notes=(note,)), {})
    (2.0, 0.0)
    """
    hidden = {"op": 0.0, "pv": 0.0}
    for name in hidden:
        x = getattr(record, name)
        if any(note.startswith(f"archive: {name.upper()} holds") for note in record.notes):
            changes = np.abs(np.diff(x))
            # what is stored has moved by more than the deviation: the smallest changes come nearest
            # to it
            if np.any(changes > 0.0):
                hidden[name] = float(np.quantile(changes[changes > 0.0], 0.1))
            else:
                hidden[name] = 0.0
        if f"quantised_{name}" in flags:
            hidden[name] = max(hidden[name], steps(x, record.pv if name == "op" else record.op))
    return hidden["op"], hidden["pv"] / (float(np.ptp(record.pv)) or 1.0)


def saturation(
    op: np.ndarray, pv: np.ndarray, percent: np.ndarray | None = None
) -> tuple[float, float]:
    """Return how much of the time OP is at a limit, and at which.

    Without a span an extreme value counts as a limit when OP stays there for 3 samples or more at
    a time, over three times as long as anywhere else (the crest of a coarsely quantised triangle is
    no limit), twice or for a quarter of the record, while PV moves on (at rest there is no limit
    either).
    """
    # Runs of equal values, and the value of each
    best = (0.0, float("nan"))
    length = holds(op)
    value = op[np.cumsum(length) - 1]

    # At each extreme of OP: how long it stays there, and elsewhere
    for extreme, certain in (
        (op.min(), percent is not None and percent.min() <= 1e-6),
        (op.max(), percent is not None and percent.max() >= 100.0 - 1e-6),
    ):
        at = value == extreme
        if (~at).any():
            elsewhere = length[~at].mean()
        else:
            elsewhere = 1.0
        if certain:
            stays = length[at]
        else:
            stays = length[at][length[at] >= 3]

        # Share of the time; a limit that is not known must hold PV off, and return
        share = stays.sum() / op.size
        if share <= best[0]:
            continue
        again = stays.size > 1 or share > 0.25
        if certain or (
            again and stays.mean() > 3.0 * elsewhere and pv[op == extreme].std() > 0.1 * pv.std()
        ):
            best = (float(share), float(extreme))
    return best
