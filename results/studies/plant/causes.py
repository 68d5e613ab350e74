"""Are the causes named those that were simulated, and do sizes hold?

`python -m results.studies.plant.causes` draws plants of loops with eight causes, stamped in weeks
of their own, some of them upstream and downstream of each other, and loops of simulators that are
not ours, and prints how often the cause named is the one simulated, how many events join loops of
different weeks, and how far S lies within its interval under six archives.
"""

from __future__ import annotations

import argparse
import tempfile
from collections import Counter
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from scipy.signal import lfilter

from results.studies.plant.stiction_probability import PLANTS
from results.studies.withheld.files import write_item
from results.studies.worlds import load_world
from simbench.detectors.errors import Refusal, UserError
from simbench.detectors.judge import judge
from simbench.detectors.prepared import Prepared
from simbench.detectors.record import LoopRecord
from simbench.detectors.records.io import read_record
from simbench.detectors.report.events import shared_oscillations
from simbench.gap.stiction.candidate_loops import CandidateLoops, candidate_loops
from simbench.gap.stiction.causes import Causes, find_causes
from simbench.gap.stiction.margins import margins
from simbench.gap.thresholds import CLAIMED_FROM
from simbench.loop.simulate import simulate
from simbench.progress import Progress
from simbench.scenarios.spec import Loop
from simbench.usage import exit_code

CAUSES = (
    "stiction",
    "dead-band",
    "tuning",
    "outside",
    "upstream",
    "sensor",
    "saturation",
    "healthy",
)
NAMES = {
    "stiction": ("stiction",),
    "dead-band": ("stiction",),
    "tuning": ("tuning",),
    "outside": ("disturbance from outside",),
    "upstream": ("disturbance from outside",),
    "sensor": ("sensor",),
    "saturation": ("saturation",),
    "healthy": ("none",),
}
WEEK = 7 * 86400.0


def tuned(rng: np.random.Generator, tightness: float) -> dict[str, Any]:
    """Return a plant with a PI controller of a gain margin of about `tightness`."""
    T, share = float(rng.uniform(15, 60)), float(rng.uniform(0.1, 0.5))
    K, Td = float(rng.uniform(0.5, 2.0)), share * T
    Ti = T * float(rng.uniform(0.8, 1.2))
    ultimate = 0.5 * np.pi * T / (K * Td) * 0.9
    Ts = float(np.round(max(T / 20, 0.5), 1))
    return {
        "plant": {"type": "foptd", "K": K, "T": T, "Td": Td},
        "controller": {"type": "PI", "Kc": float(ultimate / tightness), "Ti": Ti},
        "sampling": {"Ts": Ts, "n": 2000},
        "noise": {"std": 0.05},
        "disturbance": [
            {"type": "coloured", "amplitude": 0.3, "period": float(rng.uniform(0.3, 1.0) * T)}
        ],
    }


def drawn(cause: str, rng: np.random.Generator, second: str = "") -> tuple[LoopRecord, Loop]:
    """Return the record and the loop of one cause, or of two: `second` is "tuning" or "outside"."""
    table = tuned(rng, float(rng.uniform(2.5, 4.0)))
    T, kick = table["plant"]["T"], 0.0
    if cause in ("stiction", "dead-band"):
        S = float(rng.uniform(2.0, 8.0))
        table["valve"] = {"model": "choudhury", "S": S, "J": float(rng.uniform(0.3, 1.0) * S)}
        # at rest a sticky loop may stay there for ever; the plant's has been moving for years
        kick = S + 1.0
    if cause == "dead-band":  # cycles on an integrating process
        table["plant"] = {
            "type": "integrating",
            "K": table["plant"]["K"] / T,
            "Td": 0.3 * table["plant"]["Td"],
        }
        table["controller"]["Ti"] = 4 * T
        table["valve"] = {"model": "deadband", "S": table["valve"]["S"]}
        table["disturbance"] = [{"type": "coloured", "amplitude": 0.1, "period": T}]
    if "tuning" in (cause, second):
        table["controller"]["Kc"] *= table_margin(table) / float(rng.uniform(1.08, 1.3))
    if "outside" in (cause, second):
        period = float(rng.uniform(4, 15) * T)
        sine = {
            "type": "sine",
            "amplitude": float(rng.uniform(0.8, 3.0)),
            "period": period,
            "at": "output",
        }
        table["disturbance"].append(sine)
        table["sampling"]["n"] = int(min(max(2000, 25 * period / table["sampling"]["Ts"]), 5000))
    if cause == "saturation":
        table["operating_point"] = {"op0": float(rng.uniform(97, 99))}
        table["disturbance"] = [
            {"type": "coloured", "amplitude": 6.0 * table["plant"]["K"], "period": 2 * T}
        ]
    if cause == "healthy" and rng.random() < 0.5:  # sluggish
        table["controller"]["Kc"] /= 4
    if cause == "sensor":
        table["noise"] = (
            {"std": 2.0 * float(rng.uniform(1, 3))} if rng.random() < 0.5 else table["noise"]
        )
    loop = Loop.from_table(table)
    record = simulate(loop, int(rng.integers(2**31)), kick=kick).record.without_mv()
    # stuck: PV rests while the controller integrates on
    if cause == "sensor" and table["noise"]["std"] < 1.0:
        pv, at = np.array(record.pv), int(0.4 * record.n)
        size = int(rng.uniform(0.1, 0.25) * record.n)
        op = np.array(record.op)
        pv[at : at + size] = pv[at]
        op[at : at + size] = op[at] + np.cumsum(
            np.full(size, 0.02 * np.sign(record.pv.mean() - pv[at] + 1e-9))
        )
        record = replace(record, pv=pv, op=np.clip(op, 0, 100))
    return record, loop


def table_margin(table: dict[str, Any]) -> float:
    """Return the gain margin of a table's loop."""
    known = margins(Loop.from_table(table))
    assert known is not None
    return known.gain


def victim(source: LoopRecord, rng: np.random.Generator) -> LoopRecord:
    """Return a sound loop that the source's PV disturbs through a lag."""
    heard = np.asarray(lfilter([0.1], [1.0, -0.9], source.pv - source.pv.mean())) * float(
        rng.uniform(1, 3)
    )
    pv, op = np.zeros(source.n), np.zeros(source.n)
    y = integral = 0.0
    for k in range(source.n):
        y = 0.9 * y + 0.1 * (op[max(k - 1, 0)] + heard[k])
        pv[k] = y + 0.02 * rng.standard_normal()
        integral -= 0.02 * pv[k]
        op[k] = integral - 0.3 * pv[k]
    return LoopRecord(op + 50.0, pv + 20.0, source.Ts)


def plant(n: int, seed: int) -> dict[str, tuple[str, LoopRecord, Loop | None]]:
    """Return loops of every cause by name, each pair of source and victim in one week, every other
    loop in another.
    """
    rng, out = np.random.default_rng(seed), {}
    for i in range(n):
        cause = CAUSES[i % len(CAUSES)]
        start = {"start": 1.7e9 + i * WEEK}
        if cause == "upstream":
            record, loop = drawn("stiction", rng)
            out[f"{i}s"] = ("stiction", replace(record, meta=start), loop)
            out[f"{i}v"] = (cause, replace(victim(record, rng), meta=start), None)
        else:
            record, loop = drawn(cause, rng)
            out[str(i)] = (cause, replace(record, meta=start), loop)
    return out


def sticky(n: int, seed: int, second: str = "") -> dict[str, tuple[str, LoopRecord, Loop]]:
    """Return more loops whose valve sticks by name, in which something else is wrong too."""
    rng = np.random.default_rng([seed, 1])
    return {f"more {i}": ("stiction", *drawn("stiction", rng, second)) for i in range(n)}


BLIND = {
    "stiction": "stiction",
    "oscillation": "outside",
    "saturation": "saturation",
    "none": "healthy",
}


def blind(world: str, n: int, seed: int) -> dict[str, tuple[str, LoopRecord, Loop | None]]:
    """Return loops of an independent simulator by name, each in a separate week."""
    out: dict[str, tuple[str, LoopRecord, Loop | None]] = {}
    with tempfile.TemporaryDirectory() as place:
        for i in range(n):
            effect = list(BLIND)[i % len(BLIND)]
            about = {"plant": PLANTS[i // 4 % len(PLANTS)], "strength": "strong"}
            asked = (
                {"kind": "none"}
                if effect == "none"
                else {"kind": "single", "effect": effect, **about}
            )
            item = load_world(world).draw(seed, i, {**asked, "mv": False})
            record = read_record(write_item(item, Path(place), "loop")[0])
            out[f"{world}{i}"] = (
                BLIND[effect],
                replace(record, mv=None, meta={"start": 1.7e9 + i * WEEK}),
                None,
            )
    return out


def identified(
    loops: dict[str, tuple[str, LoopRecord, Loop | None]],
) -> dict[str, CandidateLoops | Refusal]:
    """Return the loops that may have made every record, or why none can be identified."""
    candidates: dict[str, CandidateLoops | Refusal] = {}
    for name, (_, record, _) in Progress(loops.items(), desc="loops"):
        try:
            candidates[name] = candidate_loops(record)
        except UserError as why:
            candidates[name] = Refusal(str(why))
    return candidates


def judged(loops: dict[str, tuple[str, LoopRecord, Loop | None]]):
    """Return the named causes and the events."""
    prepared = {name: Prepared(record) for name, (_, record, _) in loops.items()}
    candidates = identified(loops)
    events = shared_oscillations(prepared)
    causes = {n: find_causes(prepared[n], candidates[n]) for n in loops}
    return causes, events


def summary_lines(
    loops: dict[str, Any], causes: dict[str, Causes], events: list[list[str]]
) -> list[str]:
    """Return the table of causes and the events across weeks."""
    lines, right, wrong = [], 0, 0
    for cause in CAUSES:
        named = Counter(
            causes[name].named.name for name, (truth, _, _) in loops.items() if truth == cause
        )
        if not named:
            continue
        good = sum(named[word] for word in NAMES[cause])
        open_ = named["cannot tell"]
        right, wrong = right + good, wrong + sum(named.values()) - good - open_
        lines.append(
            f"{cause:<12} n {sum(named.values()):>3}  right {good:>3}  cannot tell {open_:>3}  said"
            f" {dict(named)}"
        )
    across = sum(len({name.rstrip("sv") for name in event}) > 1 for event in events)
    lines.append(
        f"of {len(loops)} loops: right {right}, wrong {wrong}, cannot tell"
        f" {len(loops) - right - wrong}; right of those said {right / max(right + wrong, 1):.2f},"
        f" wrong of all {wrong / len(loops):.2f}; events {len(events)}, across weeks {across}"
    )
    return lines


ARCHIVES = ("plain", "quantised OP", "quantised PV", "exceptions", "compressed", "every third")


def archived(record: LoopRecord, how: str, file: Path) -> LoopRecord:
    """Return a record as an archive gives it back, through a file."""
    signals = [np.array(record.op), np.array(record.pv)]
    spans = [float(np.ptp(x)) for x in signals]
    for i, word in enumerate(("quantised OP", "quantised PV")):
        if how == word:
            signals[i] = np.round(signals[i] / (0.05 * spans[i])) * 0.05 * spans[i]
    if how == "compressed":
        for x, span in zip(signals, spans, strict=True):
            k = door(x, 0.04 * span)
            x[:] = np.interp(np.arange(x.size), k, x[k])
    if how == "exceptions":
        for x, span in zip(signals, spans, strict=True):
            last = x[0]
            for k in range(1, x.size - 1):
                last = x[k] if abs(x[k] - last) > 0.06 * span else last
                x[k] = last
    cells = [[f"{v:.6f}" for v in x] for x in signals]
    rows = range(0, record.n, 3 if how == "every third" else 1)
    file.write_text(
        "t,op,pv\n" + "".join(f"{k * record.Ts:.3f},{cells[0][k]},{cells[1][k]}\n" for k in rows)
    )
    return read_record(file)


def door(x: np.ndarray, deviation: float) -> list[int]:
    """Return the samples that a swinging door keeps."""
    kept, at, high, low, k = [0], 0, np.inf, -np.inf, 1
    while k < x.size:
        high, low = (
            min(high, (x[k] + deviation - x[at]) / (k - at)),
            max(low, (x[k] - deviation - x[at]) / (k - at)),
        )
        if high < low:
            at = k - 1
            kept.append(at)
            high, low = np.inf, -np.inf
            continue
        k += 1
    return sorted({*kept, x.size - 1})


def sizes(n: int, seed: int) -> list[str]:
    """Return how often S lies within the interval that the procedure states, under every
    archive.
    """
    loops = sticky(n, seed).values()
    lines, all_stated, all_inside = [], 0, 0
    with tempfile.TemporaryDirectory() as place:
        for how in ARCHIVES:
            stated = inside = refused = 0
            for _, record, loop in Progress(loops, desc=how):
                S = loop.to_table()["valve"]["S"]
                try:
                    level = judge(archived(record, how, Path(place) / "loop.csv"), ["procedure"])[
                        0
                    ].S
                except UserError:
                    refused += 1
                    continue
                if level is not None:
                    lo, hi = level if isinstance(level, tuple) else (level, level)
                    stated, inside = stated + 1, inside + (lo <= S <= hi)
            lines.append(
                f"S, {how:<13} n {n}  stated {stated:>3}  within its interval {inside:>3}  refused"
                f" {refused}"
            )
            all_stated, all_inside = all_stated + stated, all_inside + inside
    return [
        *lines,
        f"S: {all_inside} of {all_stated} stated lie within"
        f" ({all_inside / max(all_stated, 1):.2f})",
    ]


def intervals(n: int, seed: int) -> list[str]:
    """Return how often the interval of S that the conclusion states holds the true one, where
    friction is claimed.
    """
    lines = []
    for second, name in (("", "alone"), ("outside", "and a sine"), ("tuning", "near its limit")):
        claimed = inside = 0
        for _, record, loop in Progress(sticky(n, seed, second).values(), desc=name):
            found = candidate_loops(record)
            if found.probability > CLAIMED_FROM and found.sizes is not None:
                S, _ = found.sizes
                claimed, inside = claimed + 1, inside + (S.lo <= loop.valve.parameters["S"] <= S.hi)
        lines.append(
            f"S of the conclusion, friction {name:<14} claimed {claimed:>3}  within {inside:>3}"
        )
    return lines


def main() -> int:
    """Draw, ask, and print."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        "-n",
        type=int,
        default=208,
        help="loops of own grids, each with another upstream joined by it [208]",
    )
    parser.add_argument("--worlds", nargs="*", default=["refinery"], help="[refinery]")
    parser.add_argument("--blind", type=int, default=36, help="loops of each world [36]")
    parser.add_argument("--archived", type=int, default=34, help="sticky loops per archive [34]")
    parser.add_argument(
        "--seed",
        type=int,
        default=4777,
        help="1, 2, 33, 4101, 4205 and 4206 were looked at before [4777]",
    )
    given = parser.parse_args()
    for world in given.worlds:
        loops = blind(world, given.blind, given.seed)
        causes, events = judged(loops)
        print(
            "\n".join(
                [f"{world}, a simulator that is not ours:", *summary_lines(loops, causes, events)]
            ),
            flush=True,
        )
    loops = plant(given.n, given.seed)
    causes, events = judged(loops)
    print("\n".join(["own grids:", *summary_lines(loops, causes, events)]), flush=True)
    print("\n".join([*sizes(given.archived, given.seed), *intervals(given.archived, given.seed)]))
    return 0


if __name__ == "__main__":
    raise SystemExit(exit_code(main))
