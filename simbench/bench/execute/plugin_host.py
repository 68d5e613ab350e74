"""What a piece of a run asks of a loop, asked where the loop's parts live: here, or in the process of another's."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache
from typing import Any

import numpy as np

from detectors.errors import UserError
from detectors.plugins.host import PluginError
from detectors.plugins.rebuilt import number_of, verdict_of
from detectors.verdict import NO_DECISION, Verdict
from scenarios.cell import Draft
from scenarios.grid import Group
from scenarios.spec import Loop, Noise, Scenario, SetPoint
from simbench.bench.scenario.oracle import ORACLE, judge_oracle
from simbench.bench.scenario.resolve import resolve, settle
from simbench.bench.scenario.truth import CYCLED, Cycled, simulate_with_truth
from simbench.loop.hosted import PartHost, host_of, parts_of_loop, run_of
from simbench.loop.resolve import resolve_loop
from simbench.loop.run import Run
from simbench.theory.tables import truth_columns

Theory = tuple[bool | None, bool | None, bool | None, float | None, float | None, str | None]
NO_THEORY: Theory = (None, None, None, None, None, None)
_LONGEST = 300  # characters of an error's text


def said_of(error: BaseException) -> str:
    """Return an error in one line, as tables hold it."""
    return " ".join(f"{type(error).__name__}: {error}".split())[:_LONGEST]


def settled(group: Group) -> list[tuple[Scenario, str | None]]:
    """Return the scenarios of a group; a draft, with the error, where its rules cannot be settled.

    A healthy loop that cannot be matched with its sticky siblings is left out.
    """
    found: dict[int, tuple[Scenario | None, str | None]] = {}
    parties: dict[PartHost | None, list[int]] = {}
    for i, draft in enumerate(group.drafts):
        parties.setdefault(_host_of_draft(group.twin, draft), []).append(i)
    for host, places in parties.items():
        part = replace(group, drafts=tuple(group.drafts[i] for i in places))
        try:
            answers = [(s, None) for s in (settle(part) if host is None else _settled_there(host, part))]
        except Exception as wrong:  # whatever a model does on numbers of its own: its scenarios, not the run
            answers = [(Scenario(loop=d.loop, seed=group.seed, tags=d.tags), said_of(wrong)) for d in part.drafts]
        found.update(zip(places, answers, strict=True))
    every = (found[i] for i in range(len(group.drafts)))
    return [(scenario, error) for scenario, error in every if scenario is not None]


def refuse_unsettled(group: Group) -> None:
    """Raise UserError when a cell's scenarios cannot be set up; what another's part does there is a row of the run."""
    own = tuple(d for d in group.drafts if _host_of_draft(group.twin, d) is None)
    for scenario in resolve(replace(group, drafts=own)) if own else ():
        resolve_loop(scenario.loop, scenario.seed)


def truth(loop: Loop, seed: int) -> tuple[Run, Cycled]:
    """Return `simulate_with_truth(loop, seed)`, wherever the loop's parts live."""
    host = host_of(parts_of_loop(loop))
    if host is None:
        return simulate_with_truth(loop, seed)
    whole, said = _pair(host.ask(simulate_with_truth, loop, seed, samples=loop.sampling.n))
    run = run_of(whole, loop)
    if said.get("answer") not in CYCLED:
        raise PluginError(f"its loop's truth is {said.get('answer')!r}; allowed: {', '.join(CYCLED)}")
    return run, Cycled(said["answer"], number_of(said.get("period"), "period"), number_of(said.get("swing"), "swing"))


def oracle_of(scenario: Scenario, run: Run) -> tuple[Verdict, str | None]:
    """Return `judge_oracle(scenario, run)`, wherever the loop's parts live, and the error where another's gave none."""
    host = host_of(parts_of_loop(scenario.loop))
    if host is None:
        return judge_oracle(scenario, run), None
    try:
        return verdict_of(ORACLE, host.ask(judge_oracle, scenario, run)), None
    except UserError as wrong:
        return Verdict(ORACLE, NO_DECISION, reason=f"failed: {said_of(wrong)}"), said_of(wrong)


def theory(loop: Loop) -> Theory:
    """Return what theory says of a loop: predicted, refined, exists, period, amplitude, and why there is none of it."""
    # theory knows neither noise nor loads nor the set point: siblings share its answer
    quiet = loop.model_copy(update={"noise": Noise(), "disturbance": (), "setpoint": SetPoint(value=loop.pv0)})
    host = host_of(parts_of_loop(loop))
    try:
        return _theory(quiet.model_dump_json()) if host is None else _theory_there(host, quiet)
    except Exception as wrong:  # whatever a model does on numbers of its own: its theory, not its record
        return *NO_THEORY[:-1], said_of(wrong)


def _plain_settle(group: Group) -> list[dict[str, Any]]:
    """Settle a group, and return plain values; an empty table where there is no scenario."""
    return [{} if s is None else {"loop": s.loop.to_table(), "tags": s.tags} for s in settle(group)]


@lru_cache(maxsize=256)
def _theory(text: str) -> Theory:
    with np.errstate(all="ignore"):  # candidate cycles that grow without bound
        predicted, refined, found = truth_columns(Loop.model_validate_json(text), waves=False)
    why = found["reason"] if found["exists"] is None else None
    return predicted, refined, found["exists"], found["period"], found["amplitude"], why


def _theory_there(host: PartHost, quiet: Loop) -> Theory:
    said = host.ask(_theory, quiet.model_dump_json())
    if not isinstance(said, list) or len(said) != 6:
        raise PluginError("its loop's theory cannot be understood")
    *exist, period, amplitude, why = said
    if not all(v is None or isinstance(v, (bool, float, int)) for v in (*exist, period, amplitude)):
        raise PluginError("its loop's theory cannot be understood")
    predicted, refined, exists = (None if v is None else bool(v) for v in exist)
    return predicted, refined, exists, period, amplitude, None if why is None else str(why)[:_LONGEST]


def _pair(said: Any) -> list[dict]:
    return said if isinstance(said, list) and len(said) == 2 and all(isinstance(s, dict) for s in said) else [{}, {}]


def _host_of_draft(twin: Loop, draft: Draft) -> PartHost | None:
    effects = {("effect", e.name) for e in draft.effects}
    return host_of(parts_of_loop(twin) | parts_of_loop(draft.loop) | effects)


def _settled_there(host: PartHost, part: Group) -> list[Scenario | None]:
    said = host.ask(_plain_settle, part, samples=sum(len(d.loop.model_dump_json()) for d in part.drafts))
    if not isinstance(said, list) or len(said) != len(part.drafts) or not all(isinstance(s, dict) for s in said):
        raise PluginError("its cell has other loops than asked for")
    loops = (Loop.from_table(s.get("loop"), "cell") if s else None for s in said)
    found = zip(loops, said, strict=True)
    return [None if loop is None else Scenario(loop=loop, seed=part.seed, tags=s.get("tags")) for loop, s in found]
