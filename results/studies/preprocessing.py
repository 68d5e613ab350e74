"""How much of a rank does preprocessing decide? `python -m results.studies.preprocessing` asks each
fast method, with the decision thresholds of its source, about the same records prepared in three
ways.

none: the whole record as it came, its signals less their means. authors': the whole record, with
what the method's source does to the signals (`NAME@published`). ours: the half that oscillates,
at most 250 samples a period, drift and noise taken off, whatever its source says.

In all three ways a record must oscillate by the same test, so that every way answers the same
loops. Only self-regulating loops are asked about: all these methods were made for them.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np
from joblib import Parallel, delayed

from results.studies.claims.judged import Loops, recorded
from results.studies.learned import loops as simulated
from simbench.detectors.judge import answer_of, check_thresholds, judge
from simbench.detectors.plugins.registry import methods as registry
from simbench.detectors.prepared import Prepared, prepare
from simbench.detectors.record import LoopRecord
from simbench.detectors.verdict import NO_DECISION, STICTION, Verdict
from simbench.detectors.views import columns
from simbench.usage import exit_code

SEED = 100400  # draws the loops of grid chapter; of no other study
WAYS = ("none", "authors'", "ours")
# thresholds of methods that say what is done to a signal, not where a bound lies
SIGNAL = frozenset({"cleaned", "harmonics", "left_out"})
_DRAWS, _SHUFFLES, _DRAW_SEED = 1000, 1000, 4  # of the bootstrap over loops, and of chance


class AsItCame(Prepared):
    """A record of whose signals nothing is taken off but the mean."""

    def clean(self, name: str) -> np.ndarray:
        """Return a signal less its mean."""
        x = self.signal(name)
        return x - x.mean()

    def band(self, name: str, shortest: float) -> np.ndarray:
        """Return a signal less its mean, whatever is asked for."""
        return self.clean(name)

    def half_cycles(self, name: str, cleaned: bool = True) -> np.ndarray:
        """Return the half cycles of a signal less its mean."""
        return super().half_cycles(name, cleaned=False)


def asked_methods() -> list[str]:
    """Return the fast methods on OP and PV whose constants were fitted to no grid."""
    known = ((name, registry.load(name).METHOD) for name in registry.names())
    return [
        name
        for name, m in known
        if m.budget == "fast" and m.role == "stiction" and not m.needs_mv and not m.fitted_on
    ]


def as_it_came(record: LoopRecord, name: str) -> Verdict:
    """Judge a record by the published thresholds, with its signals as they came."""
    method = registry.load(f"{name}@published").METHOD
    view = AsItCame(record)
    # the one test of oscillation for all ways: a record may oscillate only in a half
    view.__dict__["oscillation"] = prepare(record).oscillation
    return answer_of(name, view, check_thresholds(name, method, {}))[0]


def as_published(record: LoopRecord, name: str) -> Verdict:
    """Judge a record as the method's source does."""
    return judge(record, [f"{name}@published"])[0]


def as_prepared_here(record: LoopRecord, name: str) -> Verdict:
    """Judge a record by the decision thresholds of the source, with this package's signals."""
    published = registry.load(name).METHOD.published
    bounds = {key: value for key, value in published.items() if key not in SIGNAL}
    return judge(record, [name], thresholds={name: bounds})[0]


ANSWERS: Mapping[str, Callable[[LoopRecord, str], Verdict]] = dict(
    zip(WAYS, (as_it_came, as_published, as_prepared_here))
)


def losses(record: LoopRecord, sticky: bool, names: list[str]) -> np.ndarray:
    """Return what each method's answer costs in each way, shape (methods, ways): 1 for a wrong one,
    .5 for none.
    """
    lost = np.empty((len(names), len(WAYS)))
    for (i, j), _ in np.ndenumerate(lost):
        said = ANSWERS[WAYS[j]](record, names[i]).verdict
        lost[i, j] = 0.5 if said == NO_DECISION else float((said == STICTION) != sticky)
    return lost


def asked_about(loops: Loops) -> tuple[np.ndarray, np.ndarray]:
    """Return the self-regulating loops that oscillate, by number, and their losses, shape (loops,
    methods, ways).
    """
    names = asked_methods()
    kept = [
        k
        for k, record in enumerate(loops.records)
        if record.process != "integrating" and prepare(record).oscillation.sustained
    ]
    rows = Parallel(n_jobs=2)(
        delayed(losses)(loops.records[k], bool(loops.sticky[k]), names) for k in kept
    )
    return np.array(kept), np.array(rows)


def balanced(lost: np.ndarray, sticky: np.ndarray) -> np.ndarray:
    """Return the mean cost with sticky loops and others of the same weight, shape (methods,
    ways).
    """
    return 0.5 * (lost[sticky].mean(axis=0) + lost[~sticky].mean(axis=0))


def ranks(cost: np.ndarray) -> np.ndarray:
    """Return the rank of each method in each way, each way apart, shape (methods, ways)."""
    return (cost[:, None] < cost[None] - 1e-12).sum(axis=0) + 1


def alone(cost: np.ndarray) -> np.ndarray:
    """Return the rank of each method in each way while all others stay as their authors have
    them, shape (methods, ways).
    """
    at_home = cost[:, WAYS.index("authors'")]
    others = ~np.eye(len(cost), dtype=bool)
    return np.array(
        [
            [1 + int((at_home[others[i]] < c - 1e-12).sum()) for c in cost[i]]
            for i in range(len(cost))
        ]
    )


def shares(cost: np.ndarray) -> tuple[float, float, float]:
    """Return which shares of the variance of costs are the methods', the ways', and of both
    together (what one way does to one method).
    """
    from_mean = cost - cost.mean()
    of_method = from_mean.mean(axis=1, keepdims=True)
    of_way = from_mean.mean(axis=0, keepdims=True)
    left = from_mean - of_method - of_way
    total = float((from_mean**2).sum()) or 1.0
    parts = (np.broadcast_to(of, cost.shape) for of in (of_method, of_way, left))
    method, way, both = (float((part**2).sum()) / total for part in parts)
    return method, way, both


def as_lines(loops: Loops) -> list[str]:
    """Return the table of one kind of loops."""
    names, (kept, lost) = asked_methods(), asked_about(loops)
    sticky = loops.sticky[kept]
    cost = balanced(lost, sticky)
    together, apart = ranks(cost), alone(cost)
    drawn = resampled(lost, sticky)
    rows = [
        (
            "method",
            *(f"cost, {way}" for way in WAYS),
            "rank, each way",
            "rank, alone",
            "ours less none",
        )
    ]
    for i in np.argsort(cost[:, 1], kind="stable"):
        difference = drawn[:, i, 2] - drawn[:, i, 0]
        low, high = np.quantile(difference, (0.025, 0.975))
        rows.append(
            (
                names[i],
                *(f"{c:.2f}" for c in cost[i]),
                " ".join(str(r) for r in together[i]),
                f"{apart[i].min()} to {apart[i].max()}",
                f"{cost[i, 2] - cost[i, 0]:+.2f} ({low:+.2f} to {high:+.2f})",
            )
        )
    method, way, both = shares(cost)
    several = np.array([shares(c) for c in drawn])
    low, high = np.quantile(1.0 - several[:, 0], (0.025, 0.975))
    chance = by_chance(lost, sticky)
    p = (1 + int((chance >= way + both).sum())) / (1 + chance.size)
    moved = (apart.max(axis=1) - apart.min(axis=1)).mean()
    return [
        f"{loops.name}: {sticky.sum()} loops stick, {(~sticky).sum()} do not",
        *columns(rows),
        f"of the variance of cost {method:.0%} is between methods, {way:.0%} between ways,"
        f" {both:.0%} what one way does to one method; preprocessing decides {way + both:.0%}"
        f" ({low:.0%} to {high:.0%}); were the ways all the same, it would seem"
        f" {np.median(chance):.0%} by chance (p = {p:.2g})",
        f"a method's rank moves by {moved:.1f} of {len(names) - 1} places in the mean when its way"
        " alone changes",
    ]


def by_chance(lost: np.ndarray, sticky: np.ndarray) -> np.ndarray:
    """Return the share that preprocessing seems to decide when the three answers about a loop are
    shuffled, method by method: what is left then is chance, shape (shuffles,).
    """
    rng = np.random.default_rng(_DRAW_SEED)
    shuffled = (rng.permuted(lost, axis=2) for _ in range(_SHUFFLES))
    return np.array([1.0 - shares(balanced(some, sticky))[0] for some in shuffled])


def resampled(lost: np.ndarray, sticky: np.ndarray) -> np.ndarray:
    """Return the costs of samples of loops drawn with replacement, shape (draws, methods, ways)."""
    rng = np.random.default_rng(_DRAW_SEED)
    kinds = [np.flatnonzero(sticky == s) for s in (True, False)]
    return np.array(
        [
            0.5 * sum(lost[rng.choice(kind, kind.size)].mean(axis=0) for kind in kinds)
            for _ in range(_DRAWS)
        ]
    )


def main(arguments: list[str] | None = None) -> int:
    """Print the table of simulated loops, and of recorded ones where folders are given."""
    parser = argparse.ArgumentParser(
        prog="python -m results.studies.preprocessing",
        description=(__doc__ or "").partition("\n\n")[0],
    )
    parser.add_argument("folder", type=Path, nargs="*", help="folders of recorded loops")
    parser.add_argument("-n", type=int, default=900, help="loops of grid chapter that are drawn")
    parser.add_argument("--seed", type=int, default=SEED, help="draws them")
    given = parser.parse_args(arguments)
    drawn = simulated("chapter", given.seed, given.n)
    chapter = Loops("chapter", drawn.records, drawn.cycling, np.arange(len(drawn.records)))
    for loops in (chapter, *([recorded(given.folder)] if given.folder else [])):
        print("\n".join([*as_lines(loops), ""]), flush=True)
    return 0


if __name__ == "__main__":
    raise SystemExit(exit_code(main))
