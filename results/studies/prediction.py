"""Predictions of `gap predict` for other settings, against fresh records of the true loops of three
independent simulators.

`python -m results.studies.prediction DIR` draws records of each world in the proportions of
`asking`, diagnoses each, predicts it under half the controller gain, 1.5 times the gain and a moved
set point, and runs the true loop under these settings. DIR keeps what is done: a call that was cut
off goes on where it was, and `--print` prints what is there.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import pandas as pd
from tqdm import tqdm

from detectors.errors import UserError
from results.studies.asking import THREE, Mixture
from results.studies.worlds import WORLDS
from scenarios.spec import load_loop
from simbench.blind.levels import Share
from simbench.blind.making import write_item
from simbench.blind.menu import TestPlan
from simbench.blind.world import Item
from simbench.files import folder as make_folder
from simbench.files import whole_file
from simbench.gap.command import diagnose_files
from simbench.gap.prediction import measure, predict, read_settings
from simbench.loop.effects import NONE, UNKNOWN

# of the first world, named before anything was predicted; the next worlds have the next numbers
SEED = 1146001
N = 20  # records of each world
FRESH = 10  # records of the true loop under the new settings
NEAR = 0.1  # relative error within which a prediction counts as right
_MEASURED = ("pv_std", "op_std", "op_travel_per_hour", "period_s")


def mixture(seed: int, n: int) -> Mixture:
    """Return `n` records: three of ten without effect, one of ten with a foreign one, the rest with
    a single effect.
    """
    none, foreign = round(0.3 * n), round(0.1 * n)
    return Mixture(seed, n - none - foreign, none, 0, foreign)


def changes(item: Item) -> dict[str, tuple[dict[str, str], float, float]]:
    """Return the changes tried on a loop: settings as on the command line, factor on the true Kc,
    move of SP (PV units).

    SP moves by what one standard deviation of OP does at rest, on an integrating plant by two
    standard deviations of PV.
    """
    columns, plant, Kc = (
        item.columns,
        item.baseline["plant"],
        float(item.baseline["controller"]["Kc"]),
    )
    integrates = plant["type"] == "integrating"
    by = (
        2.0 * float(np.std(columns["pv"]))
        if integrates
        else abs(float(plant["K"])) * float(np.std(columns["op"]))
    )
    value = float(columns["sp"][0]) + by
    return {
        "Kc / 2": ({"controller.Kc": repr(0.5 * Kc)}, 0.5, 0.0),
        "Kc x 1.5": ({"controller.Kc": repr(1.5 * Kc)}, 1.5, 0.0),
        "moved set point": ({"setpoint.value": repr(value)}, 1.0, by),
    }


def truth(item: Item, world: str, ratio: float, by: float) -> list[dict[str, float]]:
    """Run the true loop under other settings; what its fresh records show once the change has
    settled.
    """
    a, sp = item.answer, np.asarray(item.columns["sp"], dtype=float)
    settle = sp.size // 2
    moves = np.concatenate([np.zeros(settle), sp - sp[0]]) + by
    plan = TestPlan("predict", moves.size, moves, np.full(moves.size, np.nan), Kc_ratio=ratio)
    pairs = (
        (a.get("foreign") or a["effect"], a.get("parameters")),
        (a.get("effect2", ""), a.get("parameters2")),
    )
    acts = [
        {"effect": name, "parameters": p} for name, p in pairs if name not in ("", NONE, UNKNOWN)
    ]
    out = []
    for i in range(FRESH):
        run = WORLDS.load(world).test(a, acts, int(a["seed"]) + 8000 + i, plan)
        op, pv = (np.asarray(run[name], dtype=float)[settle:] for name in ("op", "pv"))
        out.append(asdict(measure(op, pv, float(item.baseline["sampling"]["Ts"]))))
    return out


def answer(world: str, seed: int, i: int, entry: dict[str, Any]) -> list[dict[str, Any]]:
    """Draw and diagnose one record, predict its changes, and add the truth to each
    prediction.
    """
    item = WORLDS.load(world).draw(seed, i, entry)
    tried = changes(item)
    with TemporaryDirectory() as place:
        record, baseline = write_item(item, Path(place), "record")
        loop = load_loop(baseline)
        try:
            report = diagnose_files([record], baseline)
            predicted = {
                name: predict(report, read_settings(words, loop)).as_json()
                for name, (words, _, _) in tried.items()
            }
        except UserError as error:  # a record that is refused has no valid prediction
            predicted = {name: {"valid": False, "reason": str(error)} for name in tried}
    about = {"world": world, "kind": item.answer["kind"]}
    return [
        {**about, "change": name, **predicted[name], "truth": truth(item, world, *tried[name][1:])}
        for name in tried
    ]


def judged(row: Mapping[str, Any]) -> dict[str, Any]:
    """Judge one prediction: values against the mean of fresh records, intervals against each of
    them.
    """
    out = {k: row[k] for k in ("world", "kind", "change", "valid", "reason")}
    fresh = pd.DataFrame(row["truth"])
    # a loop oscillates where most of its fresh records do
    period = float(fresh.period_s.median()) if fresh.period_s.notna().mean() > 0.5 else None
    true = {name: float(fresh[name].mean()) for name in _MEASURED} | {"period_s": period}
    for name in _MEASURED:
        one = row.get(name)
        both = one is not None and true[name] is not None
        near = (
            abs(one["value"] / true[name] - 1.0) < NEAR
            if both
            else one is None and true[name] is None
        )
        inside = fresh[name].dropna().between(one["lo"], one["hi"]).mean() if both else np.nan
        out |= {f"{name} near": near, f"{name} inside": inside}
    return out | {"right": out["pv_std near"] and out["period_s near"]}


def table(rows: pd.DataFrame) -> str:
    """Return shares of valid answers, of right ones among them, and coverage of the intervals; by
    world and change.
    """
    groups = [
        ("all", rows),
        *rows.groupby("world", sort=False),
        *rows.groupby("change", sort=False),
    ]
    heads = f"{'':18s}{'n':>5s}{'valid':>7s}{'right':>21s}{'PV near':>9s}{'period near':>13s}"
    lines = [
        f"{heads}{'PV':>8s}{'OP':>6s}{'travel':>8s}{'period':>8s}",
        f"{'':73s}{'coverage of the interval of':>30s}",
    ]
    for name, part in groups:
        valid = part[part.valid.astype(bool)]
        right = Share("", int(valid.right.sum()), len(valid))
        low, high = right.interval if right.n else (np.nan, np.nan)
        share = right.k / right.n if right.n else np.nan
        inside = [valid[f"{x} inside"].astype(float).mean() for x in _MEASURED]
        lines.append(
            f"{name:18s}{len(part):5d}{len(valid) / len(part):7.2f}{share:7.2f} [{low:.2f},"
            f" {high:.2f}]"
            f"{valid['pv_std near'].mean():9.2f}{valid['period_s near'].mean():13.2f}"
            f"{inside[0]:8.2f}{inside[1]:6.2f}{inside[2]:8.2f}{inside[3]:8.2f}"
        )
    return "\n".join(lines)


def main() -> None:
    """Answer what is not answered yet, and print seeds, sizes and the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("-n", type=int, default=N, help="Records of each world.")
    parser.add_argument(
        "--seed", type=int, default=SEED, help=f"Of {THREE[0]}; the next worlds have the next."
    )
    parser.add_argument(
        "--print", action="store_true", help="Print what is answered, and answer nothing more."
    )
    given = parser.parse_args()
    place, todo, done = make_folder(given.folder), [], []
    for k, world in enumerate(THREE):
        entries = mixture(given.seed + k, given.n).entries(list(WORLDS.load(world).FOREIGN))
        order = np.random.default_rng(given.seed + k).permutation(len(entries))
        todo += [(i, world, given.seed + k, entries[at]) for i, at in enumerate(order)]
    for i, world, seed, entry in tqdm(
        sorted(todo, key=lambda x: x[:2]), desc="records", file=sys.stderr, delay=1.0
    ):
        file = place / f"{world}-{seed}-{i}.json"
        if not file.exists() and not given.print:
            rows = answer(world, seed, i, entry)
            with whole_file(file) as f:
                f.write(json.dumps(rows))
        done += json.loads(file.read_text(encoding="utf-8")) if file.exists() else []
    rows = pd.DataFrame([judged(row) for row in done])
    seeds = ", ".join(f"{world} {given.seed + k}" for k, world in enumerate(THREE))
    print(f"seeds {seeds}; {len(done) // 3} of {len(todo)} records, three changes each")
    print(
        f"right: standard deviation of PV and period within {NEAR:.0%} of the mean of {FRESH} fresh"
        " records of the true loop"
    )
    print(
        "(period: none in both, or the median's); coverage: share of single fresh records inside"
        " the 90 % interval\n"
    )
    print(table(rows))
    print("\nwhy answers are not valid (first reason):")
    reasons = (
        rows[~rows.valid.astype(bool)]
        .reason.str.split("; ")
        .str[0]
        .str.replace(r"-?\d[-\d.e+]*", "#", regex=True)
    )
    print(reasons.str[:90].value_counts().to_string() if len(reasons) else "all are")


if __name__ == "__main__":
    main()
