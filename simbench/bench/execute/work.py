"""One piece of a run: groups of scenarios simulated, labelled and judged; what every worker does."""

from __future__ import annotations

import hashlib
import json
import math
import time
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from threadpoolctl import threadpool_limits

from detectors.judge import answers, check_thresholds
from detectors.method import Method
from detectors.plugins.host import SECONDS
from detectors.plugins.registry import methods as registry
from detectors.prepared import Prepared, prepare
from detectors.record import LoopRecord
from detectors.verdict import NO_DECISION, Verdict
from scenarios.grid import Grid
from scenarios.spec import Scenario
from simbench.bench.execute.plugin_host import NO_THEORY, Theory, oracle_of, said_of, settled, theory, truth
from simbench.bench.scenario.oracle import ORACLE
from simbench.bench.scenario.truth import Cycled
from simbench.bench.store import tables
from simbench.loop.guest import add_parts
from simbench.loop.run import Run

Thresholds = Mapping[str, Mapping[str, float]]


@dataclass
class Piece:
    """What a worker hands back.

    Parameters
    ----------
    number : int
        Which piece of the run.
    scenarios, verdicts : bytes
        Parquet files.
    count, failures : int
        Scenarios, and verdicts or simulations that ended in an error.
    simulating, judging, total : float
        Seconds spent on simulation with its truth, on detectors, and altogether.
    kept : list of (str, LoopRecord)
        Records asked for, by scenario id.
    """

    number: int
    scenarios: bytes
    verdicts: bytes
    count: int
    failures: int
    simulating: float
    judging: float
    total: float
    kept: list[tuple[str, LoopRecord]] = field(default_factory=list)


def work(
    grid: Grid,
    number: int,
    groups: Sequence[int],
    methods: Sequence[str],
    plugins: Iterable[str] = (),
    thresholds: Thresholds | None = None,
    keep: int = 0,
    seconds: float = SECONDS,
    stages: tuple[tuple[str, ...], ...] = ((), ()),
    front_end: str = "acf",
) -> Piece:
    """Simulate, label and judge some groups of a grid.

    Parameters
    ----------
    grid : Grid
        The grid.
    number : int
        Of the piece.
    groups : sequence of int
        Which groups.
    methods : sequence of str
        Method ids.
    plugins : iterable of str
        Detector files outside the package.
    thresholds : mapping
        Other thresholds than the methods' own, by method id.
    keep : int
        Records to hand back, from the first on.
    seconds : float
        Time a plug-in may take for a record.
    stages : (tuple of str, tuple of str)
        Files of valve models and of effects outside the package.
    front_end : str
        What says whether a loop oscillates.

    Returns
    -------
    Piece
        A function of the arguments alone, but for its times.
    """
    began = time.perf_counter()
    add_parts(*stages, seconds)
    registry.add_guests(plugins, seconds)
    own = [m for m in methods if m != ORACLE]
    chosen = {m: check_thresholds(m, registry.load(m).METHOD, (thresholds or {}).get(m, {})) for m in own}
    rows: dict[str, list] = {name: [] for name in tables.SCENARIOS.names}
    verdicts: dict[str, list] = {name: [] for name in tables.VERDICTS.names}
    piece = Piece(number, b"", b"", 0, 0, 0.0, 0.0, 0.0)
    # one thread per worker: with more, sums in linear algebra come out in another order
    with threadpool_limits(1):
        for index in groups:
            since = time.perf_counter()
            scenarios = settled(grid.group(index))
            piece.simulating += time.perf_counter() - since
            for scenario, wrong in scenarios:
                _one(scenario, index, chosen, ORACLE in methods, rows, verdicts, piece, keep, wrong, front_end)
    piece.scenarios = tables.encode(rows, tables.SCENARIOS, number)
    piece.verdicts = tables.encode(verdicts, tables.VERDICTS, number)
    piece.total = time.perf_counter() - began
    return piece


def judge_both(
    record: LoopRecord, chosen: Thresholds, front_end: str = "acf"
) -> tuple[Prepared, list[tuple[Verdict, Verdict, str | None, float]]]:
    """Judge a record by several methods, with and without the common oscillation front end.

    Parameters
    ----------
    record : LoopRecord
        With MV; methods that do not declare that they need it do not see it.
    chosen : mapping
        All thresholds of every method, by method id.
    front_end : str
        What says whether the loop oscillates.

    Returns
    -------
    prepared : Prepared
        The blinded record and what was found in it.
    list of (Verdict, Verdict, str or None, float)
        Per method: with front end, without, the error if it raised one, and its seconds.
    """
    since = time.perf_counter()
    blind, sighted = prepare(record.blind(), front_end), None
    sustained = blind.oscillation.sustained
    blind.flags  # noqa: B018  found once, for all methods
    shared = (time.perf_counter() - since) / max(len(chosen), 1)
    found = []
    for name, values in chosen.items():
        method: Method = registry.load(name).METHOD
        since, prepared = time.perf_counter(), blind
        if method.whole and blind.part:
            # ranked with those that do not see MV
            prepared = Prepared(record.blind(), front_end)
        elif method.needs_mv:
            prepared = sighted = sighted or blind.sighted(record)
        # with an oscillation the front end lets everything pass
        modes = (True, False) if method.front_end and not sustained else (True,)
        said, error = answers(name, prepared, modes, dict(values))
        raw, front = said[0], said[-1]
        found.append((front, raw, error, shared + time.perf_counter() - since))
    return blind, found


def _one(
    scenario: Scenario,
    group: int,
    chosen: Thresholds,
    oracle: bool,
    rows: dict,
    verdicts: dict,
    piece: Piece,
    keep: int,
    error: str | None,
    front_end: str,
) -> None:
    since = time.perf_counter()
    run, cycled, columns = None, Cycled("unclear"), NO_THEORY
    try:
        if error is None:
            run, cycled = truth(scenario.loop, scenario.seed)
            columns = theory(scenario.loop)
    except Exception as fault:  # whatever a model does on numbers of its own: one scenario, not the run
        error, run, cycled = said_of(fault), None, Cycled("unclear")
    ident = scenario.id
    then = time.perf_counter()
    piece.simulating += then - since
    if run is None:
        failed = [Verdict(m, NO_DECISION, reason=f"failed: {error}") for m in (*chosen, *[ORACLE] * oracle)]
        prepared, found = None, [(v, v, error, 0.0) for v in failed]
    else:
        prepared, found = judge_both(run.record, chosen, front_end)
        if oracle:
            since = time.perf_counter()
            said, wrong = oracle_of(scenario, run)
            found.append((said, said, wrong, time.perf_counter() - since))
    piece.judging += time.perf_counter() - then
    _add(rows, _scenario_row(scenario, ident, group, run, cycled, columns, prepared, error))
    for front, raw, raised, seconds in found:
        _add(verdicts, _verdict_row(ident, front, raw, raised, seconds))
    piece.count += 1
    piece.failures += sum(raised is not None for _, _, raised, _ in found) or int(error is not None)
    if run is not None and len(piece.kept) < keep:
        piece.kept.append((ident, run.record))


def _scenario_row(
    scenario: Scenario,
    ident: str,
    group: int,
    run: Run | None,
    cycled: Cycled,
    columns: Theory,
    prepared: Prepared | None,
    error: str | None,
) -> dict[str, Any]:
    loop, tags = scenario.loop, scenario.tags
    row: dict[str, Any] = {name: tags.get(name) for name in tables.TAGS}
    row.update(
        scenario_id=ident,
        group=group,
        seed=scenario.seed,
        cycled=cycled.answer,
        cycle_period=cycled.period,
        cycle_swing=cycled.swing,
        Ts=loop.sampling.Ts,
        n=loop.sampling.n,
        noise_std=loop.noise.std,
        loop=json.dumps(loop.to_table()),
        tags=json.dumps(tags),
        error=error,
    )
    row.update(zip(("predicted", "refined", "theory", "theory_period", "theory_amplitude", "theory_reason"), columns))
    if run is not None and prepared is not None:
        found = prepared.oscillation
        row.update(
            sticky=run.sticky,
            oscillating=found.sustained,
            regularity=found.regularity,
            period_s=found.period_s,
            flags=",".join(sorted(prepared.flags)),
            record_hash=record_hash(run.record),
        )
    return row


def _verdict_row(ident: str, front: Verdict, raw: Verdict, error: str | None, seconds: float) -> dict[str, Any]:
    (S_lo, S_hi), (J_lo, J_hi) = _ends(front.S), _ends(front.J)
    return {
        "scenario_id": ident,
        "method": front.method,
        "verdict": front.verdict,
        "score": front.score,
        "verdict_raw": raw.verdict,
        "score_raw": raw.score,
        "applicable": front.applicable,
        "reason": front.reason,
        "reason_raw": None if raw.reason == front.reason else raw.reason,
        "indices": json.dumps({k: float(v) if math.isfinite(v) else None for k, v in front.indices.items()}),
        "S_lo": S_lo,
        "S_hi": S_hi,
        "J_lo": J_lo,
        "J_hi": J_hi,
        "S_unit": front.S_unit,
        "error": error,
        "runtime_s": seconds,
    }


def record_hash(record: LoopRecord) -> str:
    """Return 16 hex digits of a record's signals, bit for bit."""
    digest = hashlib.sha256()
    for signal in (record.sp, record.op, record.pv, record.mv):
        if signal is not None:
            digest.update(np.ascontiguousarray(signal).tobytes())
    return digest.hexdigest()[:16]


def _ends(level: float | tuple[float, float] | None) -> tuple[float, float]:
    if level is None:
        return math.nan, math.nan
    return (float(level[0]), float(level[1])) if isinstance(level, tuple) else (float(level), float(level))


def _add(columns: dict[str, list], row: Mapping[str, Any]) -> None:
    for name, column in columns.items():
        column.append(row.get(name))
