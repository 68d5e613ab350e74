"""What do nuisances cost the diagnosis? `python -m results.studies.nuisances` draws records from
the judging sites of `worlds.nuisances`, and prints how often the diagnosis is right.

With `--pairs N` it draws N loops with each nuisance by itself, and the same seeds without it, and
prints how many are answered rightly with it, and alike.
"""

from __future__ import annotations

import copy
import sys
from collections.abc import Callable, Iterable, Sequence
from typing import Any, NamedTuple

import pandas as pd
from joblib import delayed

from results.studies.withheld.levels import calibration_error
from results.studies.withheld.sites import ask_drawn, diagnosed, options
from results.studies.withheld.world import Item, right_names
from results.studies.worlds import nuisances
from results.studies.worlds.refinery import drawing
from results.studies.worlds.refinery.loops import REFINERY, Habits
from simbench.bench.statistics import auc, rate
from simbench.gap.report.result import GapReport
from simbench.loop.effects import NONE, UNKNOWN
from simbench.parallel import run_parallel
from simbench.usage import exit_code

SEED, N = 20261129, 300
SURE = (0.9, 0.7, 0.5, 0.0)  # probabilities of an answer, from which it is counted apart
_PLAIN = REFINERY._replace(
    P=0.0, averaging=0.0, exceptions=0.0, known_play=0.0, late=0.0, higher_order=0.0
)


class Nuisance(NamedTuple):
    """Habits that have a nuisance, what is drawn with it, and what takes it out of a case."""

    habits: Habits
    kind: str
    effect: str = ""
    take_out: Callable[[dict], None] | None = None


def _unfiltered(case: dict) -> None:
    del case["filter"], case["filter_stated"], case["noise"]["gain"], case["baseline"]["effect"]
    case["baseline"]["noise"]["std"] = case["noise"]["std"]


def _in_time(case: dict) -> None:
    case["archive"]["late"] = False


def _clipped(case: dict) -> None:
    case["controller"] |= {"form": "velocity", "rule": "backward", "windup": "conditional"}


def _without_derivative(case: dict) -> None:
    for controller in (case["controller"], case["baseline"]["controller"]):
        controller["type"] = "PI"
        for name in ("Td", "N", "b", "c"):
            controller.pop(name, None)
    case["baseline"]["controller"].pop("form", None)


_FILTERED = {"filter": 0.3, "filter_stated": 1.0}
_RED = {"noises": (0.0, 1.0, 0.0, 0.0), "share": 0.2, "phi": (0.6, 0.9)}
NUISANCES = {
    "stated filter, noise coloured in part": Nuisance(
        _PLAIN._replace(**_FILTERED, **_RED), "none", "", _unfiltered
    ),
    "missed executions": Nuisance(_PLAIN._replace(late=0.5, reset=0.5), "foreign", "missed_scans"),
    "saturation with external reset": Nuisance(
        _PLAIN._replace(reset=1.0), "single", "saturation", _clipped
    ),
    "saturation with a derivative": Nuisance(
        _PLAIN._replace(PID=1.0), "single", "saturation", _without_derivative
    ),
    "OP archived late": Nuisance(_PLAIN._replace(late=1.0), "none", "", _in_time),
    "dead-band with a derivative": Nuisance(
        _PLAIN._replace(PID=1.0), "single", "error_deadband", _without_derivative
    ),
    "zero shifts": Nuisance(_PLAIN._replace(filter=0.1), "foreign", "zero_shift"),
    "frozen transmitter": Nuisance(_PLAIN, "foreign", "plugged_line_freeze"),
}


def asked(seed: int, i: int, entry: dict) -> dict[str, Any]:
    """Return what is true of one record of the judging sites, and what the diagnosis says; nothing
    of a record of another site.
    """
    if nuisances.part(nuisances.site_at(i)) != "judge":
        return {}
    item = nuisances.draw(seed, i, entry)
    report = diagnosed(item)
    truth = {name: item.answer[name] for name in ("kind", "strength", "block")}
    if report is None:
        return truth | {"answer": "", "right": False, "block_right": False}
    return truth | _answered(report, item)


def _answered(report: GapReport, item: Item) -> dict[str, Any]:
    right = right_names(item.answer)
    probability = {r.effect: r.probability for r in report.ranking}
    return {
        "answer": report.effect,
        "right": report.effect in right,
        "block_right": report.block == item.answer["block"],
        "p": report.ranking[0].probability,
        "lacks": 1.0 - probability[NONE],
        "size": len(report.set),
        "covered": bool(right & set(report.set)),
        "near": report.gap.near,
    }


def table(rows: pd.DataFrame) -> list[str]:
    """Return the figures of the judging sites, a line each with its 95 % interval."""
    one = rows[(rows.kind == "single") & rows.strength.isin(["medium", "strong"])]
    none, foreign = rows[rows.kind == "none"], rows[rows.kind == "foreign"]
    seen = foreign[foreign.strength != "weak"]
    answered = rows[rows.answer != ""]
    sure = answered[answered.kind != "two"]
    shares = {
        "first effect, medium and strong": one.right,
        "block of these": one.block_right,
        "first of two": rows[rows.kind == "two"].right,
        "none: an effect named": ~none.answer.isin([NONE, UNKNOWN]),
        "none: unknown": none.answer == UNKNOWN,
        "foreign, medium and strong: unknown, or its name": seen.right,
        "block of these foreign": seen.block_right,
        f"set holds the truth, {answered['size'].mean():.1f} answers in the mean": answered.covered,
        "near, with the answer": answered.near,
        "near, of right answers": answered[answered.right].near,
    }
    out = [f"{name:60} {_share(hits)}" for name, hits in shares.items()]
    for kind in ("single", "foreign"):
        both = answered[answered.kind.isin([kind, NONE])]
        area = auc(both.lacks.to_numpy(), (both.kind == kind).to_numpy())
        name = f"AUC of 'is anything lacking?', {kind}"
        out.append(f"{name:60} {area.value:.3f} ({area.lo:.3f} to {area.hi:.3f})")
    for low, high in zip(SURE, (1.01, *SURE)):
        here = sure[(sure.p >= low) & (sure.p < high)]
        out.append(f"{f'right where p is {low:g} to {min(high, 1.0):g}':60} {_share(here.right)}")
    for near, what in ((True, "near"), (False, "not near")):
        named = sure[~sure.answer.isin([NONE, UNKNOWN]) & (sure.near == near)]
        out.append(f"{f'right where an effect is named and {what}':60} {_share(named.right)}")
    error = calibration_error(sure.p.to_numpy(float), sure.right.to_numpy(float))
    return [*out, f"{'expected calibration error':60} {error:.3f}"]


def _share(hits: Iterable[bool]) -> str:
    hits = [bool(x) for x in hits]
    return str(rate(sum(hits), len(hits))) if hits else "-"


def pair(name: str, seed: int, i: int) -> tuple[str, bool, str]:
    """Return the answer with a nuisance, whether it is right, and the answer without it."""
    n = NUISANCES[name]
    entry = {"kind": n.kind, "effect": n.effect, "strength": ("medium", "strong")[i % 2]}
    item = drawing.draw(seed, i, entry | {"mv": False}, n.habits)
    answer = _effect(item)
    right = answer in right_names(item.answer)
    if n.take_out is None:
        return answer, right, answer
    truth = copy.deepcopy(item.answer)
    n.take_out(truth["case"])
    hidden = [{"effect": n.effect, "parameters": truth["parameters"]}] if n.effect else []
    columns = drawing.simulate(truth, hidden, truth["seed"])
    return answer, right, _effect(Item(columns, truth["case"]["baseline"], truth))


def _effect(item: Item) -> str:
    report = diagnosed(item)
    return "refused" if report is None else report.effect


def _pairs(seed: int, n: int, jobs: int) -> list[str]:
    calls = [delayed(pair)(name, seed, i) for name in NUISANCES for i in range(n)]
    answers = run_parallel(calls, jobs, "records")
    out = []
    for k, name in enumerate(NUISANCES):
        mine = answers[k * n : (k + 1) * n]
        alike = sum(a == b for a, _, b in mine)
        said = f", as without it {alike}" if NUISANCES[name].take_out else ""
        out.append(f"{name:40} right {sum(r for _, r, _ in mine)} of {n}{said}")
    return out


def run(argv: Sequence[str] | None = None) -> int:
    """Draw, ask and print."""
    parser = options(__doc__, SEED, N)
    parser.add_argument("--pairs", type=int, default=0, help="loops with each nuisance by itself")
    given = parser.parse_args(argv)
    if given.pairs:
        print(f"seed {given.seed}, {given.pairs} loops with each nuisance")
        print("\n".join(_pairs(given.seed, given.pairs, given.j)))
        return 0
    answers = ask_drawn(asked, given, nuisances)
    rows = pd.DataFrame([row for row in answers if row])
    print(f"seed {given.seed}, {len(rows)} records of the judging sites")
    print("\n".join(table(rows)))
    return 0


if __name__ == "__main__":
    sys.exit(exit_code(run))
