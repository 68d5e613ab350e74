"""Simulate loops whose parts are plug-ins, in this process or in the worker process of the
plug-in.
"""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache

import numpy as np

from simbench.bench.scenario.oracle import ORACLE, judge_oracle
from simbench.bench.scenario.resolve import resolve, settle
from simbench.bench.scenario.truth import Cycled, simulate_with_truth
from simbench.detectors.errors import UserError
from simbench.detectors.plugins.host import Host
from simbench.detectors.verdict import NO_DECISION, Verdict
from simbench.loop.hosted import ask, host_of, parts_of_loop, valid_run
from simbench.loop.resolve import resolve_loop
from simbench.loop.run import Run
from simbench.scenarios.cell import Draft
from simbench.scenarios.grid import Group
from simbench.scenarios.spec import Loop, Noise, Scenario, SetPoint
from simbench.theory.tables import truth_columns

Theory = tuple[bool | None, bool | None, bool | None, float | None, float | None, str | None]
NO_THEORY: Theory = (None, None, None, None, None, None)
_LONGEST = 300  # characters of an error's text


def error_text(error: BaseException) -> str:
    """Return an error in one line, as tables hold it."""
    return " ".join(f"{type(error).__name__}: {error}".split())[:_LONGEST]


def settled(group: Group) -> list[tuple[Scenario, str | None]]:
    """Return the scenarios of a group; a draft, with the error, where its rules cannot be settled.

    An echo whose sibling does not cycle is left out.
    """
    results: dict[int, tuple[Scenario | None, str | None]] = {}
    parties: dict[Host | None, list[int]] = {}
    for i, draft in enumerate(group.drafts):
        parties.setdefault(_host_of_draft(group.twin, draft), []).append(i)
    for host, places in parties.items():
        part = replace(group, drafts=tuple(group.drafts[i] for i in places))
        try:
            answers = [(scenario, None) for scenario in ask(host, settle, part)]
        except (
            Exception
        ) as wrong:  # whatever a model does on unusual numbers: its scenarios, not the run
            answers = [
                (Scenario(loop=d.loop, seed=d.seed, tags=d.tags, asked=d.id), error_text(wrong))
                for d in part.drafts
            ]
        results.update(zip(places, answers, strict=True))
    every = (results[i] for i in range(len(group.drafts)))
    return [(scenario, error) for scenario, error in every if scenario is not None]


def refuse_unsettled(group: Group) -> None:
    """Raise UserError when a cell's scenarios cannot be set up; what another's part does there is a
    row of the run.
    """
    drafts = tuple(d for d in group.drafts if _host_of_draft(group.twin, d) is None)
    for scenario in resolve(replace(group, drafts=drafts)) if drafts else ():
        resolve_loop(scenario.loop, scenario.seed)


def truth(loop: Loop, seed: int) -> tuple[Run, Cycled]:
    """Return `simulate_with_truth(loop, seed)`, wherever the loop's parts live."""
    run, cycled = ask(host_of(parts_of_loop(loop)), simulate_with_truth, loop, seed)
    return valid_run(run, loop), cycled


def oracle_of(scenario: Scenario, run: Run) -> tuple[Verdict, str | None]:
    """Return `judge_oracle(scenario, run)`, wherever the loop's parts live, and the error where
    another's gave none.
    """
    host = host_of(parts_of_loop(scenario.loop))
    try:
        return ask(host, judge_oracle, scenario, run), None
    except UserError as wrong:
        if host is None:
            raise
        return Verdict(ORACLE, NO_DECISION, reason=f"failed: {error_text(wrong)}"), error_text(
            wrong
        )


def theory(loop: Loop) -> Theory:
    """Return what theory predicts for a loop: predicted, refined, exists, period, amplitude, and
    why there is none of it.
    """
    # theory knows neither noise nor loads nor the set point: siblings share its answer
    quiet = loop.model_copy(
        update={"noise": Noise(), "disturbance": (), "setpoint": SetPoint(value=loop.pv0)}
    )
    try:
        return ask(host_of(parts_of_loop(loop)), _theory, quiet.model_dump_json())
    except (
        Exception
    ) as wrong:  # whatever a model does on unusual numbers: its theory, not its record
        return *NO_THEORY[:-1], error_text(wrong)


@lru_cache(maxsize=256)
def _theory(text: str) -> Theory:
    with np.errstate(all="ignore"):  # candidate cycles that grow without bound
        predicted, refined, cycle = truth_columns(Loop.model_validate_json(text), waves=False)
    why = cycle["reason"] if cycle["exists"] is None else None
    return predicted, refined, cycle["exists"], cycle["period"], cycle["amplitude"], why


def _host_of_draft(twin: Loop, draft: Draft) -> Host | None:
    effects = {("effect", e.name) for e in draft.effects}
    sibling = set() if draft.echo is None else parts_of_loop(draft.echo.of.loop)
    return host_of(parts_of_loop(twin) | parts_of_loop(draft.loop) | effects | sibling)
