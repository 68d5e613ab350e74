"""Does the conclusion survive wild samples, frozen tails, other units and last bits? `python -m
results.studies.plant.influence FOLDER ...` changes recorded loops and counts what stays.

A folder holds records and `records.csv`. Drawn by the seed: the records, and of each trial the
signal, the value, how many samples and where. No label is looked at.
"""

from __future__ import annotations

import argparse
import tempfile
import warnings
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pandas as pd
from joblib import Parallel, delayed

from simbench.detectors.errors import UserError
from simbench.detectors.verdict import NO_DECISION
from simbench.gap import conclude
from simbench.usage import exit_code

SEED, RECORDS, TRIALS = 74, 24, 200
MOST = 5  # wild samples of a trial
TAILS = (0.05, 0.4)  # shares of a record that are frozen
NEAR = 0.05  # difference of probabilities that counts as none
UNITS = (1e-12, 1e-9, 1e-6, 1e6, 1e9, 1e12)
OFFSETS = (1e3, 1e6)  # ranges of the signal
LAST_BITS = 1e-9  # of the standard deviation

Change = Callable[[pd.DataFrame], pd.DataFrame]


class Answer(NamedTuple):
    """Verdict and probability of a record, and whether a note says what was taken out of it."""

    verdict: str
    probability: float | None
    noted: bool

    def near(self, other: Answer) -> bool:
        """Return whether both have the same probability, or neither has one."""
        a, b = self.probability, other.probability
        return a is b or (a is not None and b is not None and abs(a - b) <= NEAR)


def asked(file: Path, change: Change) -> Answer:
    """Return the conclusion about a record after a change."""
    warnings.simplefilter("ignore")
    frame = change(pd.read_csv(file).dropna(axis=1, how="all"))
    with tempfile.TemporaryDirectory() as place:
        frame.to_csv(changed := Path(place) / "record.csv", index=False)
        try:
            c = conclude(changed)
        except UserError:
            return Answer(NO_DECISION, None, True)
    noted = any(note.startswith(("outliers", "frozen")) for note in c.notes)
    return Answer(c.verdict, c.probability, noted)


def frozen(tail: float) -> Change:
    """Return the change by which PV and OP stand still in the last share of a record."""

    def change(frame: pd.DataFrame) -> pd.DataFrame:
        frame = frame.copy()
        first = len(frame) - int(tail * len(frame))
        frame.loc[first:, ["pv", "op"]] = frame.loc[first - 1, ["pv", "op"]].to_numpy()
        return frame

    return change


def wild(signal: str, value: Callable[[pd.Series], float], at: np.ndarray) -> Change:
    """Return the change by which samples of a signal at these shares of the record are `value`."""

    def change(frame: pd.DataFrame) -> pd.DataFrame:
        x = frame[signal].astype(float)
        x.iloc[(at * (len(x) - 1)).astype(int)] = value(x)
        return frame.assign(**{signal: x})

    return change


VALUES: dict[str, Callable[[pd.Series], float]] = {
    "0": lambda x: 0.0,
    "-9999": lambda x: -9999.0,
    "1e30": lambda x: 1e30,
    "15 above": lambda x: x.mean() + 15.0 * x.std(),
    "15 below": lambda x: x.mean() - 15.0 * x.std(),
    "100 above": lambda x: x.mean() + 100.0 * x.std(),
    "100 below": lambda x: x.mean() - 100.0 * x.std(),
}


def disturbed(rng: np.random.Generator) -> Change:
    """Draw a change: one to five wild samples of PV or OP anywhere, or, in every sixth, a frozen
    tail of both.
    """
    if rng.integers(6) == 0:
        return frozen(float(rng.uniform(*TAILS)))
    value = VALUES[str(rng.choice([*VALUES]))]
    return wild(str(rng.choice(["pv", "op"])), value, rng.random(rng.integers(1, MOST + 1)))


def scaled(names: Sequence[str], factor: float, ranges: float = 0.0) -> Change:
    """Return the change of signals to another unit, and by an offset of so many of the first one's
    ranges.
    """

    def change(frame: pd.DataFrame) -> pd.DataFrame:
        offset = ranges * float(np.ptp(frame[names[0]]))
        here = [name for name in names if name in frame]
        return frame.assign(**{name: (frame[name] + offset) * factor for name in here})

    return change


def shaken(frame: pd.DataFrame) -> pd.DataFrame:
    """Return a record with noise in the last bits of PV and OP."""
    rng = np.random.default_rng(SEED)
    here = frame[["pv", "op"]]
    noise = LAST_BITS * here.std().to_numpy() * rng.standard_normal(here.shape)
    return frame.assign(**(here + noise))


def units() -> list[Change]:
    """Return the changes of unit, offset and last bits."""
    pv, op = ("pv", "sp"), ("op",)
    factors = [*((pv, x) for x in UNITS), (op, UNITS[0]), (op, UNITS[-1])]
    offsets = [(names, x) for names in (pv, op) for x in OFFSETS]
    return [
        *(scaled(names, factor) for names, factor in factors),
        *(scaled(names, 1.0, ranges) for names, ranges in offsets),
        shaken,
    ]


def counted(pairs: Sequence[tuple[Answer, Answer]]) -> str:
    """Return how many answers stay, of pairs of one before and one after a change."""
    n, stays = len(pairs), [a.verdict == b.verdict for a, b in pairs]
    told = sum(s or (b.verdict == NO_DECISION and b.noted) for s, (_, b) in zip(stays, pairs))
    turned = sum(
        not s and NO_DECISION not in (a.verdict, b.verdict) for s, (a, b) in zip(stays, pairs)
    )
    near = sum(a.near(b) for a, b in pairs)
    return (
        f"{sum(stays)} of {n} conclusions stay ({sum(stays) / n:.3f}), {told} stay or become"
        f" cannot tell with a note ({told / n:.3f}), {turned} turn round; {near} probabilities stay"
        f" within {NEAR:g} ({near / n:.3f})"
    )


def main(arguments: list[str] | None = None) -> int:
    """Change recorded loops and print what stays."""
    parser = argparse.ArgumentParser(
        prog="python -m results.studies.plant.influence", description=__doc__
    )
    parser.add_argument("folder", type=Path, nargs="+", metavar="FOLDER")
    parser.add_argument("-j", type=int, default=2, metavar="JOBS", help="Records at once [2].")
    parser.add_argument("--seed", type=int, default=SEED, help=f"Seed of the trials [{SEED}].")
    given = parser.parse_args(arguments)
    listed = {i: f / f"{i}.csv" for f in given.folder for i in pd.read_csv(f / "records.csv").id}
    files = sorted({i: file for i, file in listed.items() if file.exists()}.values())
    rng = np.random.default_rng(given.seed)
    files = [files[i] for i in rng.choice(len(files), min(RECORDS, len(files)), replace=False)]
    trials = [(files[t % len(files)], disturbed(rng)) for t in range(TRIALS)]
    other = [(file, change) for file in files for change in units()]
    run = delayed(asked)
    whole, *changed = (
        Parallel(n_jobs=given.j)(run(file, change) for file, change in jobs)
        for jobs in ([(file, lambda frame: frame) for file in files], trials, other)
    )
    before = dict(zip(files, whole))
    print(f"{len(files)} records, seed {given.seed}")
    for what, jobs, answers in zip(
        ("wild samples and frozen tails", "units, offsets, last bits"), (trials, other), changed
    ):
        print(f"{what}: {counted([(before[file], b) for (file, _), b in zip(jobs, answers)])}")
    return 0


if __name__ == "__main__":
    raise SystemExit(exit_code(main))
