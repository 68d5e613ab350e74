"""The loop that `gap diagnose --write-loop` writes, simulated under other settings, against fresh
records of the true loops of independent simulators.

`python -m results.studies.prediction DIR` draws records of each world in fixed proportions and
diagnoses each. It simulates the written loop under half the controller gain, 1.5 times the gain and
a moved set point, as `simulate fixed.toml --set controller.Kc=2 --seeds 20` does, and runs the true
loop under these settings. DIR keeps what is done: a call that was cut off goes on where it was.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Mapping
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import pandas as pd

from results.studies.mixture import Mixture
from results.studies.withheld.files import write_item
from results.studies.withheld.levels import Share
from results.studies.withheld.world import Item, TestPlan
from results.studies.worlds import NAMES, load_world
from simbench.detectors.errors import UserError
from simbench.detectors.record import LoopRecord
from simbench.files import folder as make_folder
from simbench.files import whole_file
from simbench.gap.command import DiagnosisFiles, diagnose_files
from simbench.loop.effects import NONE
from simbench.loop.several_seeds import measure, simulate_seeds
from simbench.progress import Progress
from simbench.scenarios.spec import Loop, load_loop
from simbench.usage import exit_code

# of the first world, named before anything was predicted; the next worlds have the next numbers
SEED = 471720
N = 20  # records of each world
# records of the true loop under the new settings: half of them are the truth, the other half the
# best that any prediction could be
FRESH = 20
NEAR = 0.1  # relative error within which a prediction counts as right
_ABOUT = ["world", "change", "refused"]
_MEASURED = ["pv_std", "op_std", "op_travel_per_hour", "period_s"]


def mixture(seed: int, n: int) -> Mixture:
    """Return `n` records: three of ten without effect, one of ten with a foreign one, the rest with
    a single effect.
    """
    none, foreign = round(0.3 * n), round(0.1 * n)
    return Mixture(seed, n - none - foreign, none, 0, foreign)


def changes(item: Item) -> dict[str, tuple[float, float]]:
    """Return the changes tried on a loop: factor on Kc, and move of SP (PV units).

    SP moves by what one standard deviation of OP does at rest, on an integrating plant by two
    standard deviations of PV.
    """
    columns, plant = item.columns, item.baseline["plant"]
    if plant["type"] == "integrating":
        by = 2.0 * float(np.std(columns["pv"]))
    else:
        by = abs(float(plant["K"])) * float(np.std(columns["op"]))
    return {"Kc / 2": (0.5, 0.0), "Kc x 1.5": (1.5, 0.0), "moved set point": (1.0, by)}


def settings(loop: Loop, ratio: float, by: float) -> dict[str, Any]:
    """Return what `--set` changes of a loop; every step of the set point moves with its value."""
    steps = [[t, value + by] for t, value in loop.setpoint.steps]
    changed = {"setpoint.value": loop.setpoint.value + by, "setpoint.steps": steps}
    return {"controller.Kc": ratio * loop.controller.Kc, **(changed if by else {})}


def truth(item: Item, world: str, ratio: float, by: float) -> list[dict[str, float]]:
    """Run the true loop under other settings; what its fresh records show once the change has
    settled.
    """
    a, sp = item.answer, np.asarray(item.columns["sp"], dtype=float)
    settle = sp.size // 2
    moves = np.concatenate([np.zeros(settle), sp - sp[0]]) + by
    plan = TestPlan("predict", moves.size, moves, np.full(moves.size, np.nan), Kc_ratio=ratio)
    name = a.get("foreign") or a["effect"]
    acts = [] if name == NONE else [{"effect": name, "parameters": a["parameters"]}]
    out = []
    for i in range(FRESH):
        run = load_world(world).test(a, acts, int(a["seed"]) + 8000 + i, plan)
        op, pv = (np.asarray(run[name], dtype=float)[settle:] for name in ("op", "pv"))
        out.append(measure(LoopRecord(op, pv, float(item.baseline["sampling"]["Ts"]))))
    return out


def answer(world: str, seed: int, i: int, entry: dict[str, Any]) -> list[dict[str, Any]]:
    """Draw and diagnose one record, predict its changes, and add the truth to each
    prediction.
    """
    item = load_world(world).draw(seed, i, entry)
    tried = changes(item)
    with TemporaryDirectory() as place:
        record, baseline = write_item(item, Path(place), "record")
        written = Path(place) / "fixed.toml"
        try:
            diagnose_files([record], baseline, wanted=DiagnosisFiles(write_loop=written))
            loop = load_loop(written)
            predicted = {}
            for name, change in tried.items():
                changed = loop.with_all(settings(loop, *change))
                numbers = simulate_seeds(changed, FRESH).as_json()
                if numbers["oscillates"] <= 0.5:  # as of the true loop
                    numbers["period_s"] = None
                predicted[name] = {**numbers, "refused": False}
        except UserError:
            predicted = {name: {"refused": True} for name in tried}
    return [
        {"world": world, "change": name, **predicted[name], "truth": truth(item, world, *change)}
        for name, change in tried.items()
    ]


def _shown(fresh: pd.DataFrame) -> pd.Series:
    """Return the means of fresh records; a loop oscillates where most of them do."""
    shown, most = fresh.mean(), fresh.period_s.notna().mean() > 0.5
    shown["period_s"] = fresh.period_s.median() if most else np.nan
    return shown


def judged(row: Mapping[str, Any]) -> dict[str, Any]:
    """Judge one prediction: values against the mean of fresh records, intervals against each of
    them. In its place, the mean of as many more (`known`) and one of them (`measured`) are judged.
    """
    runs, none = pd.DataFrame(row["truth"])[_MEASURED], {"value": np.nan, "lo": 0.0, "hi": 0.0}
    fresh, more = runs[: len(runs) // 2], runs[len(runs) // 2 :]
    true, one = _shown(fresh), pd.DataFrame({x: row.get(x) or none for x in _MEASURED})

    def near(values: pd.Series) -> np.ndarray:
        return np.isclose(values, true, rtol=NEAR, atol=0.0, equal_nan=True)

    inside = (fresh >= one.loc["lo"]) & (fresh <= one.loc["hi"])
    inside = inside.astype(float).where(fresh.notna() & one.loc["value"].notna() & true.notna())
    pv, *_, period = near(one.loc["value"])
    return {
        **{k: row[k] for k in _ABOUT},
        "right": pv and period,
        "PV near": pv,
        "period near": period,
        **{f"{name} inside": share for name, share in inside.mean().items()},
        "known": near(_shown(more))[[0, -1]].all(),
        "measured": near(_shown(more[:1]))[[0, -1]].all(),
    }


def table(rows: pd.DataFrame) -> str:
    """Return of the records that are not refused the share of right predictions (95 % interval),
    and the coverage of the intervals; by world and change.
    """
    parts = [*rows.groupby("world", sort=False), *rows.groupby("change", sort=False)]
    columns = {}
    for name, part in [("all", rows), *parts]:
        asked = part[~part.refused]
        right = Share("", int(asked.right.sum()), len(asked))
        low, high = right.interval if right.n else (np.nan, np.nan)
        shares = asked.drop(columns=_ABOUT).astype(float).mean()
        columns[name] = {"n": len(part), "refused": int(part.refused.sum()), **shares}
        columns[name] |= {"right, from": low, "right, to": high}
    return pd.DataFrame(columns).to_string(float_format="%.3g")


def main() -> None:
    """Answer what is not answered yet, and print seeds, sizes and the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("-n", type=int, default=N, help="Records of each world.")
    parser.add_argument(
        "--seed", type=int, default=SEED, help=f"Of {NAMES[0]}; the next worlds have the next."
    )
    given = parser.parse_args()
    place, todo, done = make_folder(given.folder), [], []
    for seed, world in enumerate(NAMES, given.seed):
        entries = mixture(seed, given.n).entries(list(load_world(world).FOREIGN))
        order = np.random.default_rng(seed).permutation(len(entries))
        todo += [(i, world, seed, entries[at]) for i, at in enumerate(order)]
    for i, world, seed, entry in Progress(todo, desc="records", delay=1.0):
        file = place / f"{world}-{seed}-{i}.json"
        if not file.exists():
            with whole_file(file) as f:
                f.write(json.dumps(answer(world, seed, i, entry)))
        done += json.loads(file.read_text(encoding="utf-8"))
    rows, half = pd.DataFrame([judged(row) for row in done]), FRESH // 2
    print(
        f"seeds from {given.seed} on: {', '.join(NAMES)}; {len(todo)} records, three changes each\n"
        f"right: standard deviation of PV and period within {NEAR:.0%} of the mean of {half} fresh"
        " records of the true loop\n(period: none in both, or the median's); coverage: share of"
        " single fresh records inside the 90 % interval\n\n"
        f"{table(rows)}\n\nknown, measured: the mean of {half} more records of the true loop under"
        " the new settings, and one such record,\njudged in place of the predictions"
    )


if __name__ == "__main__":
    raise SystemExit(exit_code(main))
