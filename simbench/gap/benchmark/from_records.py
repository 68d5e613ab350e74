"""A grid made from records: of each record the loop that copies it, with a sound valve and with
friction of several sizes (`simbench run FOLDER`).

Every sticky loop that cycles has a healthy sibling that moves as it does (load `echo`), so that
neither amplitude nor rhythm tells them apart. Labels are those of the simulation, as in every grid.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from joblib import delayed

from simbench.bench.execute.compute_piece import record_hash
from simbench.bench.execute.run_options import RunOptions, find_deciding
from simbench.bench.scenario.resolve import seed_of_echo
from simbench.bench.scenario.truth import YES, run_once, simulate_with_truth
from simbench.bench.store.benchmark import FROM_RECORDS
from simbench.detectors.compiled import one_thread
from simbench.detectors.errors import ParameterError, RecordError, Refusal, UserError
from simbench.detectors.faults import sentence_of
from simbench.detectors.record import LoopRecord
from simbench.detectors.records.folder import read_folder
from simbench.files import whole_file
from simbench.gap.closed_loop.gap import describe_gap, within_reach
from simbench.gap.diagnosis import diagnose
from simbench.gap.effects import is_friction
from simbench.gap.report.result import GapReport
from simbench.gap.stiction.deniable import FRICTION, op_range
from simbench.gap.thresholds import LIKELIER, NARROWEST, WORTH_REPAIRING
from simbench.loop import echo
from simbench.parallel import run_parallel
from simbench.scenarios.cell import ECHOES, loop_axes
from simbench.scenarios.grid_file import Block, GridFile
from simbench.scenarios.packaged import grid_names
from simbench.scenarios.parts import Part
from simbench.scenarios.settled import SettledGrid, table_of
from simbench.scenarios.spec import Loop, Scenario
from simbench.scenarios.toml import content_hash

# --- The loop that copies one record, for a grid made from records: with a sound valve, and with
# the friction that the record shows taken out of it.


@dataclass(frozen=True)
class NearLoop:
    """The loop that copies a record, its valve sound, and the S (%) from which friction would show
    in the record.

    `digest` is the record's.
    """

    digest: str
    loop: Loop
    S: float

    def as_json(self) -> dict[str, Any]:
        """Return it as JSON types."""
        return {**vars(self), "loop": self.loop.to_table()}

    @classmethod
    def from_json(cls, kept: dict[str, Any]) -> NearLoop:
        """Return what `as_json` wrote."""
        return cls(**{**kept, "loop": Loop.from_table(kept["loop"], "near loop")})


def near_loop(record: LoopRecord, seed: int = 0) -> NearLoop | Refusal:
    """Return the loop that copies a record, or why there is none, in a sentence."""
    try:
        return loop_of(diagnose(record, identify=True, seed=seed), record)
    except UserError as why:
        return Refusal(str(why))
    except Exception as fault:
        return Refusal(sentence_of(fault))


def loop_of(report: GapReport, record: LoopRecord) -> NearLoop:
    """Return the loop that copies the record of a diagnosis whose loop was identified; RecordError
    where none is near it.

    What its load is drawn again from is what the likelier model left: where friction is likelier
    than not, the residuals of a model without it would carry its motion into a healthy loop.
    """
    # here, for it loads the benchmark
    from simbench.bench.execute.compute_piece import record_hash

    runs = report.behind.loops
    situation = report.behind.found.situation
    probability = report.conclusion.probability
    likely = probability is not None and probability > LIKELIER
    if likely and FRICTION in runs.fitted.parameters:
        effects = [FRICTION]
    else:
        effects = []
    gap = runs.shrink(effects)
    if not within_reach(gap.after, gap.plant_floor):
        far = describe_gap(gap.after, gap.plant_floor)
        raise RecordError(f"no loop is near the record: the nearest is {far}")
    S = max(WORTH_REPAIRING, NARROWEST * op_range(np.asarray(situation.op)))
    loop = _without_friction(runs.corrected(effects))
    return NearLoop(record_hash(record), loop, float(S))


def _without_friction(loop: Loop) -> Loop:
    """Return a loop without the effects of a valve that sticks, and without the push that set it
    moving.
    """
    effects = []
    for e in loop.effect:
        if not is_friction(e.name):
            effects.append(e)
    loads = []
    for d in loop.disturbance:
        if d.parameters.get("at") != "op":
            loads.append(d)
    return loop.model_copy(update={"effect": tuple(effects), "disturbance": tuple(loads)})


VERSION = 1
# S of the cells, in what would show in the record, and J in S
SIZES = (0.5, 1.0, 2.0, 4.0)
JUMPS = (0.25, 0.5, 1.0)
_LARGEST = 30.0  # % of travel; no valve that sticks so much is left in a loop
_VALVE = "choudhury"
_LEAST = 4  # times that the cells of few records are drawn, all together: enough for a ranking
_FEWEST = 5  # records from which those of one are one group, and none is learned from and judged


@dataclass(frozen=True, eq=False)
class RecordsGrid:
    """A grid from records, the loops that copy them, and why others were left out."""

    grid: SettledGrid
    loops: Mapping[str, NearLoop]
    left_out: Mapping[str, str]

    def as_text(self) -> str:
        """Return how many records have a loop that is near, and a line per record that has none."""
        lines = [f"{self.grid.title}."]
        lines += [f"{name} is left out: {why}." for name, why in self.left_out.items()]
        return "\n".join(lines)


def plan_of_records(
    path: str | Path,
    out: Path,
    options: RunOptions,
    *,
    jobs: int = 1,
    **about: Any,
) -> RecordsGrid:
    """Return the grid of the loops that copy the records at a path for a run in the folder `out`,
    where these loops are kept; ParameterError where the options change more of it than its seed.
    """
    sets = dict(options.get("sets") or {})
    seed = sets.pop("seed", 0)
    for key, value in {**find_deciding(options, but=["n", "sets"]), **sets}.items():
        raise ParameterError(
            f"{key}={value}: {path} holds records, and beside them only n and the seed are allowed"
        )
    if isinstance(seed, str) or not 0 <= seed < 2**63 or seed != int(seed):
        raise ParameterError(f"seed = {seed}: a whole number from 0 is needed")

    # before the loops are identified, which takes seconds each
    if out.is_dir() and any(out.iterdir()) and not options.get("resume"):
        raise ParameterError(
            f"folder {out} is not empty; continue its run with --resume, or choose another"
        )
    records, refused = read_folder(path, **about)
    name = Path(path).stem
    if name in grid_names():
        name = f"{name} records"
    found = grid_from_records(records, name, seed=int(seed), jobs=jobs, kept=out / ".near")
    return replace(found, left_out={**refused, **found.left_out})


def grid_from_records(
    records: Mapping[str, LoopRecord],
    name: str = "records",
    *,
    seed: int = 0,
    jobs: int = 1,
    kept: Path | None = None,
) -> RecordsGrid:
    """Return the grid of the loops that copy records.

    Parameters
    ----------
    records : mapping of str to LoopRecord
        Records by their names.
    name : str
        Name of the grid.
    seed : int
        Root of every random stream.
    jobs : int
        Worker processes; -1 uses all cores.
    kept : Path, optional
        Folder in which the loops are kept as they are found; those that are there are not
        identified again.

    Returns
    -------
    RecordsGrid
        The grid, ready to be run, and what was left out.

    Raises
    ------
    RecordError
        Where no record has a loop that is near it.

    Notes
    -----
    Not for a record whose operation changes: one loop copies all of it.
    """
    # The loop near each record, or why there is none
    calls = [delayed(_kept_loop)(record, seed, kept) for record in records.values()]
    answers = dict(zip(records, run_parallel(calls, jobs, "loops identified"), strict=True))
    loops = {}
    for n, one in answers.items():
        if isinstance(one, NearLoop):
            loops[n] = one
    left_out = {}
    for n, one in answers.items():
        if isinstance(one, Refusal):
            left_out[n] = one.reason

    # No loop, no grid
    if not loops:
        why = "; ".join(f"{n}: {reason}" for n, reason in list(left_out.items())[:3])
        raise RecordError(f"{name}: no record has a loop that is near it ({why})")
    title = (
        f"Loops that copy {len(loops)} of {len(records)} records, with sound valves and with"
        " sticking ones"
    )

    # Few loops are drawn more often
    repeats = -(-_LEAST // len(loops))
    grid = grid_of_loops(loops, name, title, repeats=repeats, seed=seed, jobs=jobs)
    return RecordsGrid(grid, loops, left_out)


def grid_of_loops(
    loops: Mapping[str, NearLoop],
    name: str,
    title: str,
    *,
    repeats: int = 1,
    seed: int = 0,
    jobs: int = 1,
) -> SettledGrid:
    """Return the grid of some loops that copy records; loads and noise of every cell are drawn
    `repeats` times.
    """
    # The scenarios of every loop; a few loops form groups by cell, many by record
    calls = [delayed(_scenarios_of_record)(n, one, name, seed, repeats) for n, one in loops.items()]
    rows = []
    group = 0
    for scenarios in run_parallel(calls, jobs, "scenarios settled"):
        for cell, ones in enumerate(scenarios):
            if cell and len(loops) < _FEWEST:
                group += 1
            rows += [_scenario_row(one, group) for one in ones]
        group += 1

    # The grid as a table with nothing to settle
    content = GridFile(
        title=title,
        source=FROM_RECORDS,
        version=VERSION,
        seed=seed,
        block=tuple(Block(name=n) for n in loops),
    )
    return SettledGrid(name, content, {}, table_of(rows), len(rows))


def _scenario_row(one: Scenario, group: int) -> dict[str, Any]:
    return {
        "group": group,
        "scenario_id": one.id,
        "seed": one.seed,
        "loop": json.dumps(one.loop.to_table()),
        "tags": json.dumps({**one.tags}),
    }


def _kept_loop(record: LoopRecord, seed: int, kept: Path | None) -> NearLoop | Refusal:
    """Return the loop of a record, from where it was kept if it was."""
    # Without a folder nothing is kept
    if kept is None:
        return near_loop(record, seed)

    # What the answer depends on is its name
    about = (record.Ts, record.process, record.kind, record.op_span, record.pv_span)
    told = {"record": record_hash(record), "about": [str(x) for x in about], "seed": seed}
    file = kept / f"{content_hash(told)}.json"
    if file.is_file():
        stored = json.loads(file.read_text(encoding="utf-8"))
        if isinstance(stored, str):
            return Refusal(stored)
        return NearLoop.from_json(stored)

    # Found once, kept for the next call
    found = near_loop(record, seed)
    kept.mkdir(parents=True, exist_ok=True)
    with whole_file(file) as f:
        f.write(json.dumps(found.reason if isinstance(found, Refusal) else found.as_json()))
    return found


def _scenarios_of_record(
    name: str, near: NearLoop, grid: str, seed: int, repeats: int
) -> list[list[Scenario]]:
    """Return the scenarios of one record, those of each cell together: sticky and healthy."""
    # Every size with every slip jump
    cells = []
    for jump in JUMPS:
        for size in SIZES:
            cells.append((size * near.S, jump))

    # Cell by cell, each with its own stream
    found = []
    with one_thread():
        for cell, (S, jump) in enumerate(cells):
            members: list[Scenario] = []
            for repeat in range(repeats):
                tags = {
                    "grid": grid,
                    "benchmark": f"{grid}-{VERSION}",
                    "block": name,
                    "cell": cell,
                    "repeat": repeat,
                }
                stream = [seed, cell, repeat]
                members += _draw_cell(near, min(S, _LARGEST), jump, tags, stream)
            if members:
                found.append(members)
    return found


def _draw_cell(
    near: NearLoop, S: float, jump: float, tags: dict[str, Any], stream: list[int]
) -> list[Scenario]:
    """Return a sticky loop and its healthy sibling: an echo of one that cycles. Where none does as
    it, the sibling has fresh loads, as that of one that does not cycle, which stands in every other
    cell. What cannot be simulated is left out.
    """
    # Seeds that depend on the record, the cell and the member
    rng = np.random.default_rng(stream + [int(near.digest[:8], 16)])
    first, other = (int(x) for x in rng.integers(2**31, size=2))
    valve = {"S": S, "J": jump * S}
    sticky = near.loop.model_copy(update={"valve": Part(name=_VALVE, parameters=valve)})

    # The sticky loop, and an echo of it where it cycles
    try:
        cycles = simulate_with_truth(sticky, first)[1].answer == YES
        found = [_make_scenario(near, sticky, first, {**tags, "member": "sticky"}, sticky)]
        kind = str(rng.choice(ECHOES))
        healthy = None
        if cycles:
            healthy = _draw_echo(near.loop, valve, kind, other)

        # Else the loop as it is, in every second cell
        if healthy is None:
            healthy = (near.loop, other)
            kind = "none"
        if cycles or (tags["cell"] + tags["repeat"]) % 2 == 0:
            run_once(*healthy)
            told = {**tags, "member": "healthy", "echo": kind}
            found.append(_make_scenario(near, *healthy, told, sticky))
    except UserError:
        return []
    return found


def _draw_echo(
    loop: Loop, valve: dict[str, float], kind: str, first: int
) -> tuple[Loop, int] | None:
    """Return the healthy loop that moves as a sticky one does, and a seed with which that cycles;
    None where none of a few does.
    """
    load = Part(name=echo.NAME, parameters={echo.VALVE: _VALVE, **valve, "kind": kind})
    healthy = loop.model_copy(update={"disturbance": loop.disturbance + (load,)})
    seed = seed_of_echo(healthy, first)
    if seed is None:
        return None
    return (healthy, seed)


def _make_scenario(
    near: NearLoop, loop: Loop, seed: int, tags: dict[str, Any], sticky: Loop
) -> Scenario:
    """Return a scenario whose id is a hash of the record, the cell and the member."""
    # The axes of the loop, with those that only its cell knows
    axes = {
        **loop_axes(loop),
        "cell_S_over_2J": loop_axes(sticky)["S_over_2J"],
        "echo": tags.get("echo", "none"),
        "disturbance": "record",
        "process": "integrating" if loop.plant.integrating else "foptd",
        "S": float(loop.valve.parameters.get("S", 0.0)),
        "record": tags["block"],
        "ranked": 1.0,
    }

    # The id is of what it was drawn from
    asked = {}
    for key in ("benchmark", "cell", "repeat", "member"):
        asked[key] = tags[key]
    ident = content_hash({**asked, "record": near.digest, "seed": str(seed)})
    return Scenario(loop=loop, seed=seed, tags={**axes, **tags}, asked=ident)
