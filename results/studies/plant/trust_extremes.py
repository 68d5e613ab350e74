"""Is "cannot be seen" answered where it is true? `python -m results.studies.plant.trust_extremes
FOLDER` buries it, or shows it.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

import numpy as np

from results.studies.plant.trust_claims import BURIED, PLAIN, TESTING, fitted, kept, out_of, shares
from simbench.detectors.report.report import choose_methods
from simbench.detectors.verdict import NO_STICTION
from simbench.gap.stiction.candidate_loops import with_friction
from simbench.loop.simulate import simulate
from simbench.plant.study.strengths import Size
from simbench.plant.trust.trust import trust
from simbench.scenarios.spec import Loop, Part, Scenario
from simbench.usage import exit_code

# seed of the order of the loops: none that weights were learned on or answers looked at
DRAWN = TESTING + 4
# S over the range that OP moves through with a sound valve; J over S is drawn between a little and
# as much as there is band
SIZES = {"buried": (0.01, 0.1), "plainly visible": (1.5, 4.0)}
SLIP = (0.3, 1.0)
SMALLEST, LARGEST = 0.02, 25.0  # S in % of travel


def asked(scenario: Scenario) -> dict[str, Any]:
    """Return the answers of trust on one loop with little and with much friction, and the truth.

    Parameters
    ----------
    scenario : Scenario
        Its valve is taken out.

    Returns
    -------
    dict
        Per kind of `SIZES`: S, J (%), seen (power less false alarms of the best detector on runs of
        the loop itself), fitted (share of runs in which trust calls stiction probable; None where
        detectors see it), said, smallest_visible (S or None).
    """
    sound = scenario.loop.model_copy(update={"valve": Part(name="ideal")})
    rng, seed, methods = (
        np.random.default_rng(scenario.seed),
        scenario.seed,
        choose_methods(["all"]),
    )
    span = Size.of(simulate(sound, seed).record.without_mv()).op
    alarms = shares(sound, seed, methods)
    out = {}
    for kind, ends in SIZES.items():
        S = float(np.clip(span * np.exp(rng.uniform(*np.log(ends))), SMALLEST, LARGEST))
        J = S * float(rng.uniform(*SLIP))
        out[kind] = {"S": S, "J": J} | _one(with_friction(sound, S, J), seed, methods, alarms)
    return out


def _one(loop: Loop, seed: int, methods: list[str], alarms: dict[str, float]) -> dict[str, Any]:
    trusted = shares(loop, seed, methods)
    seen = max(trusted[m] - alarms[m] for m in methods)
    answer = trust(simulate(loop, seed).record.without_mv(), help_wanted=False)
    smallest = answer.smallest_visible
    return {
        # what detectors see needs no likelihood
        "seen": seen,
        "fitted": fitted(loop, seed) if seen <= BURIED else None,
        "said": answer.conclusion.verdict,
        "probability": answer.probability,
        "smallest_visible": None if smallest is None else smallest[0],
    }


def summary_lines(rows: list[dict[str, Any]]) -> list[str]:
    """Return how often friction was denied or called invisible, where it is buried and where it is
    plain.

    Parameters
    ----------
    rows : list of dict
        As `asked` gives them.

    Returns
    -------
    list of str
    """
    lines = [
        f"{len(rows)} loops of grid plant, each with little and with much friction (S over OP's"
        f" range {SIZES})"
    ]
    for kind in SIZES:
        here = [r[kind] for r in rows if _is(kind, r[kind])]
        denied = [r["said"] == NO_STICTION and _below(r) for r in here]
        counts = ", ".join(
            f"{a} {sum(r['said'] == a for r in here)}" for a in sorted({r["said"] for r in here})
        )
        lines.append(
            f"{kind}, as runs of the loop itself confirm: unseen {out_of(sum(denied), len(here))};"
            f" said: {counts}"
        )
    return lines


def _is(kind: str, row: dict[str, Any]) -> bool:
    """Return whether friction is as visible as it was meant to be: detectors see it, or neither
    they nor the likelihood do.
    """
    if kind == "buried":
        return row["seen"] <= BURIED and row["fitted"] <= BURIED
    return row["seen"] >= PLAIN


def _below(row: dict[str, Any]) -> bool:
    return row["smallest_visible"] is None or row["S"] < row["smallest_visible"]


def main(arguments: list[str] | None = None) -> int:
    """Ask trust about loops at both extremes, and print its answers; goes on where it stopped."""
    parser = argparse.ArgumentParser(
        prog="python -m results.studies.plant.trust_extremes", description=__doc__
    )
    parser.add_argument(
        "out",
        type=Path,
        metavar="FOLDER",
        help="Where the answers are kept; goes on where it stopped.",
    )
    parser.add_argument("-n", type=int, default=60, help="Loops, each asked about twice [60].")
    given = parser.parse_args(arguments)
    print("\n".join(summary_lines(kept(given.out, given.n, DRAWN, asked))))
    return 0


if __name__ == "__main__":
    raise SystemExit(exit_code(main))
