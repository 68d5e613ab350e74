"""Judge a long record window by window: when the valve stuck, and in how many cycles."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from simbench.detectors.judge import judge
from simbench.detectors.prepared import Prepared
from simbench.detectors.record import LoopRecord
from simbench.detectors.verdict import NO_DECISION, STICTION

_CYCLES = 12  # periods in a window: a detector needs several, and an episode should not drown in it
_SHIFT = 0.5  # of a window from one to the next
_SHORTEST = 120  # samples in a window
_SWINGS = 0.4  # of a strong period's amplitude, from which a period counts as one that swings
_WINDOWS = 60  # at most; a longer record is judged in longer steps


@dataclass(frozen=True)
class _Episode:
    """One window: start and end (s), and its verdict."""

    start: float
    end: float
    verdict: str


@dataclass(frozen=True)
class OverTime:
    """Verdicts of a method over overlapping windows, a single one where the record is too short to
    be cut.

    `cycles` are the periods in which the record swings, `sticky` those of them that lie only in
    windows that say stiction.
    """

    method: str
    episodes: tuple[_Episode, ...]
    cycles: int
    sticky: int

    @property
    def several(self) -> bool:
        """Whether the record was long enough to be cut."""
        return len(self.episodes) > 1

    def sentence(self) -> str:
        """Return the answer in one sentence."""
        if not self.several:
            return "the record is too short to be judged window by window"
        if self.cycles == 0:
            return "no sustained oscillation in any window"
        undecided = sum(e.verdict == NO_DECISION for e in self.episodes)
        open_ = f"; {undecided} of {len(self.episodes)} windows undecided" if undecided else ""
        return (
            f"stiction in {self.sticky} of {self.cycles} cycles by {self.method},"
            f" {len(self.episodes)} windows{open_}"
        )


def over_time(record: LoopRecord, method: str = "procedure") -> OverTime:
    """Judge a record window by window, for valves that stick at times and loops that were retuned.

    A window is twelve periods of the record's oscillation, or a sixth of the record where it does
    not oscillate as a whole.
    """
    prepared = Prepared(record.without_mv())
    period = prepared.oscillation.period_s / record.Ts
    if not np.isfinite(period) or not prepared.oscillation.sustained:
        period = record.n / (6.0 * _CYCLES)
    size = int(max(_CYCLES * period, _SHORTEST))
    if record.n < 1.5 * size:
        return OverTime(method, (_judged(record, 0, record.n, method),), 0, 0)
    step = max(int(_SHIFT * size), (record.n - size) // _WINDOWS, 1)
    starts = [*range(0, record.n - size, step), record.n - size]
    episodes = tuple(_judged(record, k, k + size, method) for k in starts)
    return OverTime(method, episodes, *_counted(record, episodes))


def _judged(record: LoopRecord, start: int, stop: int, method: str) -> _Episode:
    verdict = judge(record.window(start, stop), [method], halves=False)[0]
    return _Episode(start * record.Ts, stop * record.Ts, verdict.verdict)


def _counted(record: LoopRecord, episodes: Sequence[_Episode]) -> tuple[int, int]:
    """Return how many periods of the record swing, and how many of them lie only in windows that
    say stiction.
    """
    oscillation = Prepared(record.without_mv()).oscillation
    period = oscillation.period_s
    if not np.isfinite(period):
        return 0, 0
    count = int(record.duration / period)
    middles = (np.arange(count) + 0.5) * period
    size = np.array(
        [
            swing(record.pv[int(k * period / record.Ts) :][: int(period / record.Ts) + 1])
            for k in range(count)
        ]
    )
    swings = size > _SWINGS * np.quantile(size, 0.9) if count else np.zeros(0, dtype=bool)
    held = [[e.verdict for e in episodes if e.start <= m < e.end] for m in middles]
    sticky = [bool(v) and all(x == STICTION for x in v) for v in held]
    return int(swings.sum()), int(np.sum(swings & np.array(sticky, dtype=bool)))


def swing(x: np.ndarray) -> float:
    """Return the amplitude of the one period that some samples are, by its first harmonic."""
    turn = np.exp(-2j * np.pi * np.arange(x.size) / max(x.size, 1))
    return float(abs(turn @ (x - x.mean()))) * 2.0 / max(x.size, 1)


def marks(verdicts: OverTime) -> list[tuple[float, float, str]]:
    """Return the windows to shade in a trend, with their colours; healthy ones stay blank."""
    colour = {STICTION: "#D55E00", NO_DECISION: "#6E6E6E"}
    return [(e.start, e.end, colour[e.verdict]) for e in verdicts.episodes if e.verdict in colour]
