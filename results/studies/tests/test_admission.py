"""A rule stays where it makes answers right; each can be turned off."""

from importlib import import_module

import pytest

from results.studies.admission import ALL, RULES, SITES, drawn, table, without
from results.studies.withheld.world import right_names
from results.studies.worlds import NAMES, recipes


def row(true, every, **changed):
    names = dict(zip("abcdefghij", RULES))
    said = dict.fromkeys(RULES, every) | {names[k]: v for k, v in changed.items()}
    return {"true": {true}, ALL: every, **said}


def test_a_rule_stays_that_is_worth_one_answer_of_a_hundred_and_no_chance():
    rows = [row("drift", "drift")] * 290 + [row("drift", "drift", a="none", b="noise")] * 5
    # what is wrong both ways counts as changed alone; the second rule loses as much as it brings
    rows += [row("drift", "none", c="noise"), *[row("none", "noise", b="none")] * 5]
    found = table(rows).set_index("rule")
    first, second, third = list(RULES)[:3]
    assert found.loc[first, ["changed", "right with it", "right without"]].tolist() == [5, 5, 0]
    assert found.loc[first, "verdict"] == "stays"
    assert found.loc[second, ["right with it", "right without"]].tolist() == [5, 5]
    assert found.loc[second, "verdict"] == "goes"
    assert found.loc[third, ["changed", "verdict"]].tolist() == [1, "goes"]


def test_a_foreign_effect_that_the_library_knows_is_named_rightly_by_its_own_name_too():
    foreign = {"effect": "unknown", "effect2": "", "foreign": "missed_scans"}
    assert right_names(foreign) == {"missed_executions"}
    assert right_names(foreign | {"foreign": "frozen_sensor"}) == {"frozen_sensor"}
    assert right_names(foreign | {"foreign": "nobody_s"}) == {"unknown"}
    assert right_names({"effect": "drift", "effect2": "stiction"}) == {"drift", "stiction"}


def test_the_sites_that_a_rule_was_built_on_do_not_judge_it():
    records = drawn(20)
    assert {world for world, *_ in records} == {*NAMES, SITES}
    judged = [i for world, i, _ in records if world == SITES]
    assert all(recipes.part(recipes.site_at(i)) == "judge" for i in judged)
    assert len(judged) == 20


@pytest.mark.parametrize("rule", list(RULES))
def test_every_rule_can_be_turned_off_and_is_on_again(rule):
    def now():
        out = []
        for path in RULES[rule]:
            head, _, name = path.rpartition(".")
            try:
                out.append(getattr(import_module(head), name))
            except ModuleNotFoundError:
                module, _, owner = head.rpartition(".")
                out.append(getattr(getattr(import_module(module), owner), name))
        return out

    before = now()
    with without(rule):
        assert all(a is not b for a, b in zip(before, now()))
    assert now() == before
