"""Compute one piece of a run: simulate, label and judge some groups of scenarios.

Every worker calls it.
"""

from __future__ import annotations

import hashlib
import json
import math
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np

from simbench.bench.execute.settle_group import settled
from simbench.bench.scenario.oracle import ORACLE, judge_oracle
from simbench.bench.scenario.truth import Cycled, prepare_once, simulate_with_truth
from simbench.bench.score.no_waveform import features_without_waveform
from simbench.bench.score.rhythm import rhythm_features
from simbench.bench.store import tables
from simbench.bench.store.folder import digest
from simbench.detectors.compiled import one_thread
from simbench.detectors.faults import JUDGING
from simbench.detectors.judge import answer_of
from simbench.detectors.method import Method
from simbench.detectors.plugins.registry import methods as registry
from simbench.detectors.prepared import Prepared
from simbench.detectors.record import LoopRecord
from simbench.detectors.report.summary import level_ends
from simbench.detectors.sources import as_plugin
from simbench.detectors.verdict import NO_DECISION, Verdict
from simbench.loop.part_files import add_parts, error_text
from simbench.loop.run import Run
from simbench.scenarios.expansion import Grid
from simbench.scenarios.spec import Loop, Scenario
from simbench.theory.tables import truth_columns

Thresholds = Mapping[str, Mapping[str, float]]
Theory = tuple[bool | None, bool | None, bool | None, float | None, float | None, str | None]
_NO_THEORY: Theory = (None, None, None, None, None, None)
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
class Receipt:
    """How much a piece holds, and what it took: all that is handed back of one on disk."""

    piece: int  # number
    # scenarios, failures: how many, and how many verdicts or simulations ended in an error
    scenarios: int
    failures: int
    # simulating, judging, working: seconds on simulation with its truth, on detectors, and
    # altogether
    simulating: float
    judging: float
    working: float
    digests: dict[str, str] = field(default_factory=dict)  # of the file of each table
    reused: bool = False  # it was on disk already


class Piece(NamedTuple):
    """A finished piece: its receipt, and the parquet file of each table."""

    receipt: Receipt
    tables: dict[str, bytes]


class Answer(NamedTuple):
    """What a method said of a record, the error if it raised one, and its seconds."""

    verdict: Verdict
    error: str | None
    seconds: float


@dataclass(frozen=True)
class SimulatedScenario:
    """A scenario of a group with its truth and theory, and why there is no run where there is
    none.
    """

    scenario: Scenario
    ident: str
    group: int
    run: Run | None
    cycled: Cycled
    theory: Theory
    error: str | None


@dataclass(frozen=True)
class PieceSettings:
    """How the records of a run are judged, the same for every piece.

    `plugins` and `parts` are files outside the package, of detectors and of parts of loops; `own`
    are the caller's detectors.
    """

    methods: tuple[str, ...]
    plugins: tuple[str, ...] = ()
    parts: tuple[tuple[str, ...], ...] = ()
    own: Mapping[str, Any] = field(default_factory=dict)


def compute_piece(grid: Grid, number: int, groups: Sequence[int], settings: PieceSettings) -> Piece:
    """Simulate, label and judge some groups of a grid: a function of the arguments alone, but for
    its times.
    """
    # The parts and detectors of one's own, in this process too
    began = time.perf_counter()
    methods = settings.methods
    add_parts(*settings.parts)
    registry.add_files(*settings.plugins)
    registry.adopt({name: as_plugin(name, detector) for name, detector in settings.own.items()})
    chosen = {}
    for m in methods:
        if m != ORACLE:
            chosen[m] = registry.load(m).METHOD.defaults()

    # What the piece gathers
    rng = np.random.default_rng([grid.content.seed, number])
    simulating = 0.0
    judging = 0.0
    failures = 0
    scenarios = []
    verdicts = []
    held = []

    # one thread per worker: with more, sums in linear algebra come out in another order
    with one_thread():
        for index in groups:
            since = time.perf_counter()
            held += [simulated(*one, index) for one in settled(grid.group(index))]
            simulating += time.perf_counter() - since
            if len(held) < _HELD and index != groups[-1]:
                continue
            # a sticky loop comes before its siblings in a grid: what is asked next must not follow
            # from what was asked last
            since = time.perf_counter()
            judged = {}
            for k in rng.permutation(len(held)):
                judged[int(k)] = _judge_scenario(held[k], chosen, ORACLE in methods)
            judging += time.perf_counter() - since
            for k, it in enumerate(held):
                prepared, answers = judged[k]
                scenarios.append(scenario_row(it, prepared))
                verdicts += [verdict_row(it.ident, answer) for answer in answers]
                raised = sum(answer.error is not None for answer in answers)
                failures += raised or int(it.error is not None)
            held = []

    # Times of simulating, judging and all
    took = (simulating, judging, time.perf_counter() - began)
    return piece_of(number, scenarios, verdicts, failures, took)


def piece_of(
    number: int,
    scenarios: Sequence[Mapping[str, Any]],
    verdicts: Sequence[Mapping[str, Any]],
    failures: int = 0,
    seconds: tuple[float, float, float] = (0.0, 0.0, 0.0),
) -> Piece:
    """Return the rows of both tables as a piece of a run."""
    files = {
        "scenarios": tables.encode(scenarios, tables.SCENARIOS, number),
        "verdicts": tables.encode(verdicts, tables.VERDICT_SCHEMA, number),
    }
    digests = {}
    for kind, content in files.items():
        digests[kind] = digest(content)
    return Piece(Receipt(number, len(scenarios), failures, *seconds, digests), files)


def judge_record(record: LoopRecord, chosen: Thresholds) -> tuple[Prepared, list[Answer]]:
    """Judge a record by several methods, and return it as they saw it, with its oscillation and
    flags, too; methods that do not declare that they need MV do not see it.
    """
    since = time.perf_counter()
    unsighted = record.without_mv()
    blind = prepare_once(record)
    _ = blind.oscillation, blind.flags  # found once, for all methods
    shared = (time.perf_counter() - since) / max(len(chosen), 1)
    answers = []
    for name, values in chosen.items():
        method: Method = registry.load(name).METHOD
        since = time.perf_counter()
        # one that takes MV without needing it is ranked with those that do not see it
        prepared = blind.seen_by(method, record if method.needs_mv else unsighted)
        verdict, error = answer_of(name, prepared, dict(values))
        answers.append(Answer(verdict, error, shared + time.perf_counter() - since))
    return blind, answers


def simulated(scenario: Scenario, error: str | None, group: int) -> SimulatedScenario:
    """Simulate and label a scenario of a group; `error` tells why it could not be set up."""
    run = None
    cycled = Cycled("unclear")
    columns = _NO_THEORY
    try:
        if error is None:
            run, cycled = simulate_with_truth(scenario.loop, scenario.seed)
            columns = _predict_cycle(scenario.loop)
    # whatever a model or a plug-in does on unusual numbers: one scenario, not the run
    except (Exception, SystemExit) as fault:
        error = error_text(fault)
        run = None
        cycled = Cycled("unclear")
    return SimulatedScenario(scenario, scenario.id, group, run, cycled, columns, error)


def _predict_cycle(loop: Loop) -> Theory:
    """Return what theory predicts for a loop: predicted, refined, exists, period, amplitude, and
    why there is none of it.
    """
    try:
        with np.errstate(all="ignore"):  # candidate cycles that grow without bound
            predicted, refined, cycle = truth_columns(loop, waves=False)
    # whatever a model does on unusual numbers: its theory, not its record
    except (Exception, SystemExit) as wrong:
        return _NO_THEORY[:-1] + (error_text(wrong),)
    if cycle["exists"] is None:
        why = cycle["reason"]
    else:
        why = None
    return predicted, refined, cycle["exists"], cycle["period"], cycle["amplitude"], why


def _judge_scenario(
    it: SimulatedScenario, chosen: Thresholds, oracle: bool
) -> tuple[Prepared | None, list[Answer]]:
    """Return the record of a scenario as methods saw it, and what each of them said."""
    if it.run is None:
        methods = tuple(chosen) + tuple([ORACLE] * oracle)
        failed = [Verdict(m, NO_DECISION, reason=f"failed: {it.error}") for m in methods]
        return None, [Answer(verdict, it.error, 0.0) for verdict in failed]
    JUDGING["record"] = f"scenario {it.ident}"
    prepared, answers = judge_record(it.run.record, chosen)
    if oracle:
        since = time.perf_counter()
        answers.append(Answer(*_ask_oracle(it.scenario, it.run), time.perf_counter() - since))
    return prepared, answers


def _ask_oracle(scenario: Scenario, run: Run) -> tuple[Verdict, str | None]:
    """Return what the oracle says of a run, and the error where a plug-in gives it no answer."""
    try:
        return judge_oracle(scenario, run), None
    except (Exception, SystemExit) as wrong:
        error = error_text(wrong)
        return Verdict(ORACLE, NO_DECISION, reason=f"failed: {error}"), error


def scenario_columns(scenario: Scenario, group: int) -> dict[str, Any]:
    """Return the columns of a scenario that its definition gives, without a simulation."""
    loop = scenario.loop
    tags = scenario.tags
    return {
        **{name: tags.get(name) for name in tables.TAG_KEYS},
        "scenario_id": scenario.id,
        "loop_digest": scenario.loop_digest,
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
    # What theory predicts and the simulation did
    row = scenario_columns(it.scenario, it.group)
    row.update(
        zip(_THEORY_COLUMNS, it.theory),
        cycled=it.cycled.answer,
        cycle_period=it.cycled.period,
        cycle_swing=it.cycled.swing,
        error=it.error,
    )

    # What the record shows, also without its waveform
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


def verdict_row(ident: str, answer: Answer) -> dict[str, Any]:
    """Return one method's row of the verdicts table."""
    # Ends of the sizes, and indices without infinity
    said = answer.verdict
    S_lo, S_hi = level_ends(said.S)
    J_lo, J_hi = level_ends(said.J)
    indices = {k: float(v) if math.isfinite(v) else None for k, v in said.indices.items()}

    # One row, as the table's schema has it
    return {
        "scenario_id": ident,
        "method": said.method,
        "verdict": said.verdict,
        "score": said.score,
        "applicable": said.applicable,
        "reason": said.reason,
        "indices": json.dumps(indices),
        "S_lo": S_lo,
        "S_hi": S_hi,
        "J_lo": J_lo,
        "J_hi": J_hi,
        "S_unit": said.S_unit,
        "error": answer.error,
        "runtime_s": answer.seconds,
    }


def record_hash(record: LoopRecord) -> str:
    """Return 16 hex digits of a record's signals, bit for bit."""
    digest = hashlib.sha256()
    for signal in (record.sp, record.op, record.pv, record.mv):
        if signal is not None:
            digest.update(np.ascontiguousarray(signal).tobytes())
    return digest.hexdigest()[:16]
