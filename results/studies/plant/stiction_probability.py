"""Learn the probability of stiction: `python -m results.studies.plant.stiction_probability FOLDER`,
on three simulators and on echoes.

Half of the loops stick. A sound loop of the grid `ci` is an echo: it moves like its sticky sibling
but for the corners. All other records are as plants write them: whole, windows of half a cycle to
two, sampled too seldom, held, of an OP that hardly moves, with a drifting load, a set point that
moves, retuned in the middle. Rules are learned on all but one of these and scored on that. Answers
are kept in the folder; it goes on where it stopped.
"""

from __future__ import annotations

import argparse
import tempfile
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from scipy.optimize import minimize
from scipy.special import expit

from results.studies.plant.answers import answered
from results.studies.plant.real_loops import share
from results.studies.withheld.files import write_item
from results.studies.withheld.making import PLANTS, STRENGTHS
from results.studies.worlds import load_world
from simbench.bench.scenario.resolve import resolve
from simbench.confirm.rig import run_rig
from simbench.detectors.errors import UserError
from simbench.detectors.record import LoopRecord
from simbench.detectors.records.io import read_record
from simbench.detectors.signal.oscillation import find_oscillation
from simbench.files import folder
from simbench.gap.stiction.deniable import resample_record
from simbench.gap.stiction.friction import friction
from simbench.gap.stiction.probability import FrictionEvidence, log_odds, probability, regressors
from simbench.loop.resolve import resolve_loop
from simbench.loop.simulate import simulate
from simbench.progress import Progress
from simbench.scenarios.errors import SpecError
from simbench.scenarios.grid import load_grid
from simbench.scenarios.spec import Loop
from simbench.usage import exit_code

STICTION, NOTHING = "stiction", "none"
SOUND = (
    NOTHING,
    "oscillation",
    "load_steps",
    "detuning",
)  # what a loop without friction has, in turn
GRID, ECHOES = "plant", "ci"
SIMULATORS = ("own", "refinery", GRID, ECHOES)
SEED = 81  # the product's numbers were learned, and its rule was chosen, on loops of seed 79
LONGEST = 1000  # samples of a record that are looked at
FORMS = (
    "whole",
    "window",
    "whole",
    "seldom",
    "whole",
    "window",
    "held",
    "whole",
    "window",
    "small",
)
LOOP_FORMS = ("drift", "moves", "retuned")  # what only a loop that is simulated here can do
BINS = 10
_AT_CYCLES = 2  # where regressors have the number of cycles
_RIDGE = 0.005  # keeps weights finite where a rule tells all loops


def entry(number: int) -> dict[str, Any]:
    """Return what the loop of a number has, as the worlds are asked for it: every other one
    sticks.
    """
    turn = number // 2
    about = {
        "mv": False,
        "plant": PLANTS[turn % len(PLANTS)],
        "strength": STRENGTHS[turn % len(STRENGTHS)],
    }
    effect = STICTION if number % 2 else SOUND[turn % len(SOUND)]
    return (
        {"kind": "none", "mv": False}
        if effect == NOTHING
        else {"kind": "single", "effect": effect, **about}
    )


def drawn(simulator: str, number: int, seed: int) -> tuple[LoopRecord, bool, str]:
    """Return the record of a number, whether its valve sticks, and how it was recorded."""
    rng = np.random.default_rng([seed, SIMULATORS.index(simulator), number])
    if simulator == ECHOES:
        (_, run) = member(ECHOES, number, rng)
        return replace(run.record, mv=None, meta={}), run.sticky, FORMS[0]
    form = FORMS[number // 2 % len(FORMS)]
    if simulator == GRID:
        if number // 2 % 3 == 2:
            form = LOOP_FORMS[number // 6 % 3]
        record, sticky = _of_grid(number, form, rng)
    else:
        item = load_world(simulator).draw(seed, number, entry(number))
        with tempfile.TemporaryDirectory() as place:
            record, sticky = read_record(write_item(item, Path(place), "loop")[0]), number % 2 == 1
    return _recorded(replace(record, mv=None, meta={}), form, rng), sticky, form


def member(grid: str, number: int, rng: np.random.Generator) -> tuple[Any, Any]:
    """Return a scenario of a grid, whose valve sticks where the number is odd, and its run."""
    source = load_grid(grid)
    while True:
        members = list(resolve(source.group(int(rng.integers(source.group_count)))))
        runs = [(s, simulate(s.loop, s.seed)) for s in members]
        fit = [(s, r) for s, r in runs if r.sticky == bool(number % 2)]
        if fit:
            return fit[int(rng.integers(len(fit)))]


def _of_grid(number: int, form: str, rng: np.random.Generator) -> tuple[LoopRecord, bool]:
    scenario, run = member(GRID, number, rng)
    if form in LOOP_FORMS or form == "window":
        run_record = _rerun(scenario.loop, run.record, form, scenario.seed, rng)
        return run_record or run.record, run.sticky
    return run.record, run.sticky


def _rerun(
    loop: Loop, record: LoopRecord, form: str, seed: int, rng: np.random.Generator
) -> LoopRecord | None:
    """Return the loop's record under a drifting load, a set point that moves or a new tuning, or
    sampled more densely.
    """
    table, period = loop.to_table(), _period(record)
    cycles = float(rng.uniform(0.5, 2.0)) if form == "window" else float(rng.uniform(4.0, 15.0))
    n = int(rng.integers(300, LONGEST))
    Ts = cycles * period / n
    table["sampling"] = {"Ts": Ts, "n": 2 * n}
    size = float(np.ptp(record.op)) / 3.0
    loads = list(table.get("disturbance", []))
    if form in ("drift", "window"):
        kind = ("ramp", "random_walk")[int(rng.integers(2))]
        loads.append(
            {
                "type": kind,
                "amplitude": size * float(rng.uniform(0.5, 3.0)),
                "period": 2 * n * Ts,
                "at": "input",
            }
        )
    if form == "moves":
        value, height = table["setpoint"]["value"], float(np.std(record.pv))
        times = np.sort(rng.uniform(0.0, 2 * n * Ts, 6))
        table["setpoint"] = {
            "value": value,
            "steps": [[float(t), value + height * float(rng.normal())] for t in times],
        }
    try:
        new = Loop.from_table(table | {"disturbance": loads}, "rerun")
        if form != "retuned":
            out = simulate(new, seed).record
            return out.window(n, 2 * n)
        factor = np.where(np.arange(2 * n) < 1.5 * n, 1.0, float(rng.choice((0.4, 0.6, 1.5))))
        setup = resolve_loop(new, seed)
        trace = run_rig([setup], gain=[factor])[0]
        return LoopRecord(
            op=trace.op[n:], pv=trace.pv[n:], sp=setup.sp[n : 2 * n], Ts=Ts, op_span=(0.0, 100.0)
        )
    except (UserError, SpecError):
        return None


def _period(record: LoopRecord) -> float:
    """Return the period (s) of the record, or where it does not oscillate a fifth of its length."""
    oscillation = find_oscillation(record.op, record.pv, record.Ts)
    return (
        oscillation.period_s
        if np.isfinite(oscillation.period_s) and oscillation.period_s < record.duration
        else 0.2 * record.duration
    )


def _recorded(r: LoopRecord, form: str, rng: np.random.Generator) -> LoopRecord:
    """Return the record as a plant writes it."""
    period = _period(r) / r.Ts
    if form == "window" and r.n > 250:
        n = int(np.clip(rng.uniform(0.5, 2.0) * period, 200, min(r.n, LONGEST)))
        begin = int(rng.integers(r.n - n + 1))
        return r.window(begin, begin + n)
    if form == "seldom":
        k = int(np.clip(period / rng.uniform(4.0, 10.0), 1, r.n // 150 or 1))
        r = resample_record(r, lambda x: x[::k], k) if k > 1 else r
    if form == "held":
        k = int(rng.integers(2, 6))
        r = replace(r, pv=np.repeat(r.pv[::k], k)[: r.n])
    if form == "small":
        r = replace(
            r,
            op=r.op.mean()
            + (r.op - r.op.mean()) * float(rng.uniform(0.05, 1.0)) / (np.ptp(r.op) or 1.0),
        )
    begin = int(rng.integers(r.n - LONGEST + 1)) if r.n > LONGEST else 0
    return r.window(begin, min(begin + LONGEST, r.n))


def asked(simulator: str, number: int, seed: int) -> dict[str, Any]:
    """Return what one record's likelihood measured of friction, and the truth; no evidence where it
    cannot be judged.
    """
    record, sticky, form = drawn(simulator, number, seed)
    about = {
        "simulator": simulator,
        "number": number,
        "sticky": bool(sticky),
        "form": form,
        "n": record.n,
    }
    try:
        evidence = friction(record)
    except UserError as why:
        return about | {"evidence": None, "why": str(why)}
    e = evidence.evidence
    return about | {
        "evidence": [e.gain, e.share, e.cycles],
        "cycles": record.duration / _period(record),
    }


def evidence_of(row: dict[str, Any]) -> FrictionEvidence:
    """Return the evidence of a row that was kept."""
    return FrictionEvidence(*row["evidence"])


# what is tried; the first is what the product weighs
RULES: dict[str, Callable[[FrictionEvidence], Sequence[float]]] = {
    "as in the product, learned": regressors,
    "gain": lambda e: regressors(e)[:1],
    "gain, share": lambda e: regressors(e)[:2],
}


def learned(x: np.ndarray, y: np.ndarray, groups: np.ndarray) -> np.ndarray:
    """Return offset and weights of a logistic model in which every simulator counts the same, and
    in each sticky and sound loops.

    What the number of cycles counts is learned without the echoes: these have many cycles, all
    other records few, so that together it would tell simulators apart and not valves.
    """
    fixed: dict[int, float] = {}
    others = groups != ECHOES
    if x.shape[1] > _AT_CYCLES and others.any():
        fixed = {_AT_CYCLES: _logistic(x[others], y[others], groups[others], fixed)[-1]}
    return _logistic(x, y, groups, fixed)


def _logistic(
    x: np.ndarray, y: np.ndarray, groups: np.ndarray, fixed: dict[int, float]
) -> np.ndarray:
    """Return the offset and weights that are likeliest, some weights given."""
    counts = balanced(y, groups)
    free = [i for i in range(x.shape[1]) if i not in fixed]
    given = sum((weight * x[:, i] for i, weight in fixed.items()), np.zeros(len(x)))
    columns = np.column_stack([np.ones(len(x)), x[:, free]])

    def loss(w: np.ndarray) -> float:
        z = columns @ w + given
        return float(counts @ (np.logaddexp(0.0, z) - y * z) + _RIDGE * w[1:] @ w[1:])

    found = minimize(loss, np.zeros(columns.shape[1])).x
    out = np.empty(1 + x.shape[1])
    out[0], out[[1 + i for i in free]] = found[0], found[1:]
    out[[1 + i for i in fixed]] = list(fixed.values())
    return out


def balanced(y: np.ndarray, groups: Sequence[str]) -> np.ndarray:
    """Return weights by which every group counts the same, and in each both labels."""
    keys = [f"{g}{v}" for g, v in zip(groups, y)]
    return np.array([len(keys) / len(set(keys)) / keys.count(k) for k in keys])


def left_out(
    rows: list[dict[str, Any]], rule: Callable[[FrictionEvidence], Sequence[float]]
) -> np.ndarray:
    """Return the probabilities that a rule learned on the other simulators gives."""
    x, y, at = _table(rows, rule)
    p = np.empty(len(rows))
    for name in set(at):
        here = at == name
        offset, *weights = learned(x[~here], y[~here], at[~here])
        p[here] = expit(offset + x[here] @ weights)
    return np.clip(p, 0.01, 0.99)


def _table(
    rows: list[dict[str, Any]], rule: Callable[[FrictionEvidence], Sequence[float]]
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    x = np.array([rule(evidence_of(r)) for r in rows])
    return x, _labels(rows), np.array([r["simulator"] for r in rows])


def _labels(rows: list[dict[str, Any]]) -> np.ndarray:
    return np.array([r["sticky"] for r in rows])


def scores(p: np.ndarray, y: np.ndarray) -> tuple[float, float, float]:
    """Return log-loss, AUC and calibration error, sticky and sound loops counting the same."""
    from sklearn.metrics import log_loss, roc_auc_score

    w = balanced(y, [""] * y.size)
    bins = np.minimum((p * BINS).astype(int), BINS - 1)
    error = (
        sum(abs(np.sum(w[bins == b] * (p[bins == b] - y[bins == b]))) for b in range(BINS))
        / w.sum()
    )
    return float(log_loss(y, p, sample_weight=w)), float(roc_auc_score(y, p)), float(error)


def compared(rows: list[dict[str, Any]]) -> list[str]:
    """Return log-loss, AUC and calibration error of every rule on every simulator, learned on the
    others.

    A record that cannot be judged counts with even odds.
    """
    judged, silent = [r for r in rows if r["evidence"]], [r for r in rows if not r["evidence"]]
    rows = judged + silent
    at, y = np.array([r["simulator"] for r in rows]), np.array([r["sticky"] for r in rows])
    names = [s for s in SIMULATORS if s in set(at)]
    lines = [
        f"{len(rows)} records: "
        + ", ".join(f"{s} {np.sum(at == s)} ({np.sum(y[at == s])} sticky)" for s in names)
    ]
    lines[0] += f"; {len(silent)} cannot be judged and count with even odds"
    lines.append(
        f"{'log-loss / AUC / calibration error':<46}"
        + "".join(f"{s:>19}" for s in (*names, "all but plant"))
    )
    tried = {name: left_out(judged, rule) for name, rule in RULES.items()}
    tried["as it stands in the product"] = np.array(
        [probability(log_odds(evidence_of(r))) for r in judged]
    )
    for name, p in tried.items():
        p = np.append(p, np.full(len(silent), 0.5))
        each = {s: scores(p[at == s], y[at == s]) for s in names}
        each["mean"] = tuple(np.mean([v for s, v in each.items() if s != GRID], axis=0))
        lines.append(
            f"{name:<46}" + "".join(f"   {a:.3f} {b:.2f} {c:.3f}" for a, b, c in each.values())
        )
    return lines


def reliability(p: np.ndarray, y: np.ndarray) -> list[str]:
    """Return in ten bins of a probability how many loops have it and what share of them sticks,
    with its 95 % interval.
    """
    bins = np.minimum((p * BINS).astype(int), BINS - 1)
    lines = []
    for b in np.unique(bins):
        here = y[bins == b]
        lines.append(
            f"  {b / BINS:.1f} to {(b + 1) / BINS:.1f}: {share(int(here.sum()), here.size)} sticks"
        )
    return lines


def by_form(rows: list[dict[str, Any]]) -> list[str]:
    """Return log-loss and AUC by how records were written."""
    p = np.array([probability(log_odds(evidence_of(r))) if r["evidence"] else 0.5 for r in rows])
    y = np.array([r["sticky"] for r in rows])
    lines = []
    for form in dict.fromkeys((*FORMS, *LOOP_FORMS)):
        here = np.array([r["form"] == form for r in rows])
        if len(set(y[here])) == 2:
            loss, area, _ = scores(p[here], y[here])
            lines.append(f"{form:<10} {here.sum():>4} records   {loss:.3f} {area:.2f}")
    return lines


def kept(out: Path, count: int, simulators: Sequence[str], seed: int) -> list[dict[str, Any]]:
    """Return what was measured of so many loops of each simulator; those looked at before are read
    from the folder.
    """
    folder(out)
    jobs = [(s, i) for i in range(count) for s in simulators]
    rows = []
    for s, i in Progress(jobs):
        rows.append(answered(out / f"{s}-{seed}-{i}.json", partial(asked, s, i, seed)))
    return rows


def main(arguments: list[str] | None = None) -> int:
    """Look at simulated loops and print the numbers of `simbench/gap/stiction/probability.py`,
    and what others would do.
    """
    parser = argparse.ArgumentParser(
        prog="python -m results.studies.plant.stiction_probability", description=__doc__
    )
    parser.add_argument(
        "out",
        type=Path,
        metavar="FOLDER",
        help="Where what was found is kept; goes on where it stopped.",
    )
    parser.add_argument("-n", type=int, default=200, help="Loops of each simulator [200].")
    parser.add_argument("--simulators", nargs="+", default=list(SIMULATORS), choices=SIMULATORS)
    parser.add_argument("--seed", type=int, default=SEED, help=f"Seed of the loops [{SEED}].")
    given = parser.parse_args(arguments)
    rows = kept(given.out, given.n, given.simulators, given.seed)
    print("\n".join([*compared(rows), "", *by_form(rows), ""]))
    told = [r for r in rows if r["evidence"]]
    for name in given.simulators:
        here = [r for r in told if r["simulator"] == name]
        p = np.array([probability(log_odds(evidence_of(r))) for r in here])
        print("\n".join([f"{name}, by its probability:", *reliability(p, _labels(here))]))
    for name, rule in RULES.items():
        numbers = learned(*_table([r for r in rows if r["evidence"]], rule))
        print(f"{name}: {' '.join(f'{w:+.3f}' for w in numbers)}")
    return 0


if __name__ == "__main__":
    raise SystemExit(exit_code(main))
