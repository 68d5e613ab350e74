"""Settle the scenarios of a group of a grid, as far as they can be."""

from __future__ import annotations

from dataclasses import replace

from simbench.bench.scenario.resolve import resolve, settle
from simbench.loop.part_files import error_text, naming_parts
from simbench.loop.resolve import resolve_loop
from simbench.scenarios.cell import Draft
from simbench.scenarios.expansion import Group
from simbench.scenarios.spec import Scenario


def settled(group: Group) -> list[tuple[Scenario, str | None]]:
    """Return the scenarios of a group; a draft, with the error, where its rules cannot be settled.

    An echo whose sibling does not cycle is left out.
    """
    try:
        answers = [(scenario, None) for scenario in settle(group)]
    except (Exception, SystemExit):  # of one of them: the others are settled without it
        answers = [_settle_one(group, draft) for draft in group.drafts]
    return [(scenario, error) for scenario, error in answers if scenario is not None]


def _settle_one(group: Group, draft: Draft) -> tuple[Scenario | None, str | None]:
    """Return one scenario of a group, or its draft with the error."""
    try:
        return settle(replace(group, drafts=(draft,)))[0], None
    except (Exception, SystemExit) as wrong:  # whatever a model does on unusual numbers
        unsettled = Scenario(loop=draft.loop, seed=draft.seed, tags=draft.tags, asked=draft.id)
        return unsettled, error_text(wrong)


def refuse_unsettled(group: Group) -> None:
    """Raise UserError when a cell's scenarios cannot be set up."""
    with naming_parts():
        for scenario in resolve(group):
            resolve_loop(scenario.loop, scenario.seed)
