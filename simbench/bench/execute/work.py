"""Compute one piece of a run: simulate, label and judge some groups of scenarios.

Every worker calls it.
"""

from __future__ import annotations

import hashlib
import json
import math
import time
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from simbench.bench.execute.plugin_host import (
    NO_THEORY,
    Theory,
    error_text,
    oracle_of,
    settled,
    theory,
    truth,
)
from simbench.bench.scenario.kept import prepare_once
from simbench.bench.scenario.oracle import ORACLE
from simbench.bench.scenario.truth import Cycled
from simbench.bench.score.no_waveform import features_without_waveform
from simbench.bench.score.rhythm import rhythm_features
from simbench.bench.store import tables
from simbench.detectors.compiled import one_thread
from simbench.detectors.judge import answers
from simbench.detectors.method import Method
from simbench.detectors.plugins.host import SECONDS
from simbench.detectors.plugins.registry import methods as registry
from simbench.detectors.prepared import Prepared
from simbench.detectors.record import LoopRecord
from simbench.detectors.report.summary import level_ends
from simbench.detectors.sources import as_plugin
from simbench.detectors.verdict import NO_DECISION, Verdict
from simbench.loop.hosted import add_parts
from simbench.loop.run import Run
from simbench.scenarios.grid import Grid
from simbench.scenarios.spec import Scenario

Thresholds = Mapping[str, Mapping[str, float]]
_THEORY_COLUMNS = (
    "predicted",
    "refined",
    "theory",
    "theory_period",
    "theory_amplitude",
    "theory_reason",
)
_HELD = 80  # records simulated before they are judged in drawn order


@dataclass(frozen=True)
class Chunk:
    """What a worker hands back: two parquet files, how much there is and failed, seconds, and the
    records asked for.

    `count` and `failures` are of scenarios, and of verdicts or simulations that ended in an error;
    `simulating` has the truth's seconds, too; `kept` are records by scenario id.
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


@dataclass(frozen=True)
class SimulatedScenario:
    """A scenario of a group with its truth and theory; why there is no run where there is none, and
    the seconds it took.
    """

    scenario: Scenario
    ident: str
    group: int
    run: Run | None
    cycled: Cycled
    theory: Theory
    error: str | None
    seconds: float


@dataclass(frozen=True)
class _Judged:
    """A scenario's rows, how many of its answers are errors, its seconds, and its record where
    there is one.
    """

    row: dict[str, Any]
    verdicts: list[dict[str, Any]]
    failures: int
    simulating: float
    judging: float
    record: LoopRecord | None


@dataclass(frozen=True)
class WorkSettings:
    """How the records of a run are judged, the same for every piece.

    `plugins` and `parts` are files outside the package, of detectors and of parts of loops, which
    may take `time_limit` seconds for a record; `own` are the caller's detectors; of each piece the
    first `keep` records are handed back.
    """

    methods: tuple[str, ...]
    plugins: tuple[str, ...] = ()
    keep: int = 0
    time_limit: float = SECONDS
    parts: tuple[tuple[str, ...], ...] = ()
    own: Mapping[str, Any] = field(default_factory=dict)


def work(grid: Grid, number: int, groups: Sequence[int], settings: WorkSettings) -> Chunk:
    """Simulate, label and judge some groups of a grid: a function of the arguments alone, but for
    its times.
    """
    began = time.perf_counter()
    seconds, methods = settings.time_limit, settings.methods
    add_parts(*settings.parts, seconds=seconds)
    registry.add_hosted(*settings.plugins, seconds=seconds)
    registry.adopt({name: as_plugin(name, detector) for name, detector in settings.own.items()})
    chosen = {m: registry.load(m).METHOD.defaults() for m in methods if m != ORACLE}
    rng = np.random.default_rng([grid.content.seed, number])
    settling, finished, kept, held = 0.0, [], [], []
    # one thread per worker: with more, sums in linear algebra come out in another order
    with one_thread():
        for index in groups:
            since = time.perf_counter()
            scenarios = settled(grid.group(index))
            settling += time.perf_counter() - since
            held += [simulated(scenario, index, wrong) for scenario, wrong in scenarios]
            if len(held) >= _HELD or index == groups[-1]:
                # a sticky loop comes before its siblings in a grid: what is asked next must not
                # follow from what was asked last
                judged = {
                    int(k): _judged(held[k], chosen, ORACLE in methods)
                    for k in rng.permutation(len(held))
                }
                for _, one in sorted(judged.items()):
                    if one.record is not None and len(kept) < settings.keep:
                        kept.append((one.row["scenario_id"], one.record))
                    finished.append(replace(one, record=None))
                held = []
    return Chunk(
        number,
        tables.encode(
            in_columns(tables.SCENARIOS.names, [f.row for f in finished]), tables.SCENARIOS, number
        ),
        tables.encode(
            in_columns(tables.VERDICT_SCHEMA.names, [row for f in finished for row in f.verdicts]),
            tables.VERDICT_SCHEMA,
            number,
        ),
        len(finished),
        sum(f.failures for f in finished),
        settling + sum(f.simulating for f in finished),
        sum(f.judging for f in finished),
        time.perf_counter() - began,
        kept,
    )


def judge_both(
    record: LoopRecord, chosen: Thresholds
) -> tuple[Prepared, list[tuple[Verdict, Verdict, str | None, float]]]:
    """Judge a record by several methods, with and without the common oscillation front end.

    Returns the blinded record with its oscillation and flags, and per method the verdict with
    the front end, the one without, the error if it raised one, and its seconds; methods that do not
    declare that they need MV do not see it.
    """
    since = time.perf_counter()
    unsighted, blind = record.without_mv(), prepare_once(record)
    sustained = blind.oscillation.sustained
    blind.flags  # noqa: B018  computed once, for all methods
    shared = (time.perf_counter() - since) / max(len(chosen), 1)
    results = []
    for name, values in chosen.items():
        method: Method = registry.load(name).METHOD
        since = time.perf_counter()
        # one that takes MV without needing it is ranked with those that do not see it
        prepared = blind.seen_by(method, record if method.needs_mv else unsighted)
        # with an oscillation the front end lets everything pass
        modes = (True, False) if method.front_end and not sustained else (True,)
        verdicts, error = answers(name, prepared, modes, dict(values))
        raw, front = verdicts[0], verdicts[-1]
        results.append((front, raw, error, shared + time.perf_counter() - since))
    return blind, results


def simulated(scenario: Scenario, group: int, error: str | None) -> SimulatedScenario:
    """Simulate and label a scenario of a group; `error` tells why it could not be set up."""
    since = time.perf_counter()
    run, cycled, columns = None, Cycled("unclear"), NO_THEORY
    try:
        if error is None:
            run, cycled = truth(scenario.loop, scenario.seed)
            columns = theory(scenario.loop)
    except (
        Exception
    ) as fault:  # whatever a model does on unusual numbers: one scenario, not the run
        error, run, cycled = error_text(fault), None, Cycled("unclear")
    return SimulatedScenario(
        scenario, scenario.id, group, run, cycled, columns, error, time.perf_counter() - since
    )


def _judged(it: SimulatedScenario, chosen: Thresholds, oracle: bool) -> _Judged:
    then = time.perf_counter()
    if it.run is None:
        methods = (*chosen, *[ORACLE] * oracle)
        failed = [Verdict(m, NO_DECISION, reason=f"failed: {it.error}") for m in methods]
        prepared, results = None, [(v, v, it.error, 0.0) for v in failed]
    else:
        prepared, results = judge_both(it.run.record, chosen)
        if oracle:
            since = time.perf_counter()
            verdict, wrong = oracle_of(it.scenario, it.run)
            results.append((verdict, verdict, wrong, time.perf_counter() - since))
    judging = time.perf_counter() - then
    return _Judged(
        scenario_row(it, prepared),
        [verdict_row(it.ident, *answer) for answer in results],
        sum(raised is not None for _, _, raised, _ in results) or int(it.error is not None),
        it.seconds,
        judging,
        it.run.record if it.run is not None else None,
    )


def scenario_columns(scenario: Scenario, group: int) -> dict[str, Any]:
    """Return the columns of a scenario that its definition gives, without a simulation."""
    loop, tags = scenario.loop, scenario.tags
    return {
        **{name: tags.get(name) for name in tables.TAG_KEYS},
        "scenario_id": scenario.id,
        "group": group,
        "seed": scenario.seed,
        "Ts": loop.sampling.Ts,
        "n": loop.sampling.n,
        "noise_std": loop.noise.std,
        "loop": json.dumps(loop.to_table()),
        "tags": json.dumps(tags),
    }


def scenario_row(it: SimulatedScenario, prepared: Prepared | None) -> dict[str, Any]:
    """Return a scenario's row of the scenarios table; `prepared` is its record without MV."""
    row = scenario_columns(it.scenario, it.group)
    row.update(
        zip(_THEORY_COLUMNS, it.theory),
        cycled=it.cycled.answer,
        cycle_period=it.cycled.period,
        cycle_swing=it.cycled.swing,
        error=it.error,
    )
    if it.run is not None and prepared is not None:
        oscillation = prepared.oscillation
        period_s = oscillation.period_s if oscillation.sustained else math.nan
        without = np.concatenate(
            [f(it.run.record, period_s) for f in (features_without_waveform, rhythm_features)]
        )
        row.update(
            sticky=it.run.sticky,
            S=it.run.friction[0],
            J=it.run.friction[1],
            oscillating=oscillation.sustained,
            regularity=oscillation.regularity,
            period_s=oscillation.period_s,
            flags=",".join(sorted(prepared.flags)),
            no_waveform=without.astype(np.float32).tolist(),
            record_hash=record_hash(it.run.record),
        )
    return row


def verdict_row(
    ident: str, front: Verdict, raw: Verdict, error: str | None, seconds: float
) -> dict[str, Any]:
    """Return one method's row of the verdicts table: its answer with and without the oscillation
    front end.
    """
    (S_lo, S_hi), (J_lo, J_hi) = level_ends(front.S), level_ends(front.J)
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
        "indices": json.dumps(
            {k: float(v) if math.isfinite(v) else None for k, v in front.indices.items()}
        ),
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


def in_columns(names: Iterable[str], rows: Sequence[Mapping[str, Any]]) -> dict[str, list]:
    """Return rows as columns of these names, None where a row has none."""
    return {name: [row.get(name) for row in rows] for name in names}
